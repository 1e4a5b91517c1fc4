//! A craft with a depth network: a network of the user's estimates the depth of the camera's frames, beside the flight
//! (`docs/guide/obstacles.md`, "A depth network").
//!
//! What comes of it is a depth grid as of a depth sensor, in metres; whoever flies does not know where it is from. The network gets the
//! newest frame a few times a second, and never delays the flight. One that fails or is too slow is left out for the rest of the
//! flight, which goes on without.

mod beside;
mod craft;
mod network;
mod picture;
mod scaling;
mod stand_in;

pub(crate) use craft::WithDepth;
use network::OnnxDepth;
pub use picture::picture;
pub use stand_in::StandIn;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::time::{Duration, Time};
use spf_detect::DepthNetwork;
use spf_detect::mono_depth::{DepthKind, MonoDepth};
use spf_drone::frames::Photo;

use crate::sim::{SimWorld, VlmFactoryError};

/// In virtual time, from a frame to its estimate.
const LATENCY: Duration = Duration::from_millis(400);
/// An estimate that takes longer is of no use.
const TOO_LATE: Duration = Duration::from_secs(3);
/// Number of estimates in a row that may fail or be too late.
const PATIENCE: u32 = 3;

/// Estimates the depth of images.
pub trait EstimatesDepth: Send {
    /// Its name.
    fn name(&self) -> &str;

    /// The depth of a frame that `camera` took, of which it takes the image in the size that it wants, if it looks at one.
    ///
    /// # Errors
    /// Why there is none, as text for a person.
    fn estimate(&mut self, frame: (FrameId, Time), camera: &Camera, photo: &Photo) -> Result<MonoDepth, String>;
}

/// Creates the network of a flight: in this simulated world, if it is one, and with this seed.
pub type DepthFactory = Arc<dyn Fn(Option<&SimWorld>, u64) -> Result<Box<dyn EstimatesDepth>, VlmFactoryError> + Send + Sync>;

/// A network beside a flight, and how often it is asked.
#[derive(Clone)]
pub struct DepthPlan {
    /// Its name.
    pub name: String,
    /// What tells it from others: kind and size of its output.
    pub details: String,
    /// Whether it was given up in flight.
    pub given_up: Arc<AtomicBool>,
    /// Creates the network.
    pub network: DepthFactory,
    /// Least time from one frame to the next.
    pub period: Duration,
    /// In virtual time, from a frame to its estimate.
    pub latency: Duration,
}

impl DepthPlan {
    /// The network of an ONNX file. In virtual time its estimates are assumed to take 0.4 s, so that flights do not depend on the
    /// machine.
    #[must_use]
    pub fn onnx(network: DepthNetwork, period: Duration) -> Self {
        let (name, (width, height)) = (network.name().to_owned(), network.input());
        let details = format!("{name}:{} {width}x{height}", network.kind());
        let factory: DepthFactory = Arc::new(move |_, _| Ok(Box::new(OnnxDepth::new(network.clone()))));
        Self { name, details, given_up: Arc::default(), network: factory, period, latency: LATENCY }
    }

    /// A stand-in for a network, in the simulator: true depths with a mean relative error, in metres or up to a scale.
    #[must_use]
    pub fn stand_in(error: f64, kind: DepthKind, period: Duration) -> Self {
        let factory: DepthFactory = Arc::new(move |world, seed| match world {
            Some(world) => Ok(Box::new(StandIn::new(world.clone(), (error, kind), seed))),
            None => Err("a stand-in for a depth network needs the simulator".into()),
        });
        let name = stand_in::name(error, kind);
        Self { details: name.clone(), name, given_up: Arc::default(), network: factory, period, latency: LATENCY }
    }
}

/// Asks the network, and gives it up if it fails.
struct Estimator {
    network: Box<dyn EstimatesDepth>,
    camera: Camera,
    failures: u32,
    given_up: Arc<AtomicBool>,
}

impl Estimator {
    fn new(network: Box<dyn EstimatesDepth>, camera: Camera, given_up: Arc<AtomicBool>) -> Self {
        Self { network, camera, failures: 0, given_up }
    }

    /// Whether it has been given up.
    fn is_over(&self) -> bool {
        self.failures >= PATIENCE
    }

    /// The depth of a frame; `None` if there is none. `took` tells how long it has taken.
    fn estimate(&mut self, meta: &FrameMeta, photo: &Photo, took: impl FnOnce() -> Duration) -> Option<MonoDepth> {
        if self.is_over() {
            return None;
        }
        let found = self.network.estimate((meta.id, meta.captured), &self.camera, photo);
        let took = took();
        let found = match found {
            Ok(_) if took > TOO_LATE => Err(format!("it takes {:.1} s per image", took.as_secs_f64())),
            found => found,
        };
        match found {
            Ok(estimate) => {
                self.failures = 0;
                Some(estimate)
            }
            Err(why) => {
                self.failures += 1;
                if self.is_over() {
                    self.given_up.store(true, Ordering::Relaxed);
                    tracing::warn!("the depth network {} is left out from now on: {why}", self.network.name());
                }
                None
            }
        }
    }
}

#[cfg(test)]
mod tests;
