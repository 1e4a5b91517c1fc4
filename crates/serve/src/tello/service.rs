//! A virtual Tello in a scene, with a judge that has access to ground truth: `spf sim serve --tello`.

use std::fs::File;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_core::time::Duration;
use spf_flight::sim::{FlightConditions, LoadedScene, SimWorld};

use super::error::ServerError;
use super::faults::FaultSource;
use super::figures::{Firmware, ProtocolParameters};
use super::pace::{RenderQuality, VideoQuality};
use super::photograph::{channels, photograph};
use super::server::{Server, Setup};
use super::shared::SendStats;
use crate::truth::{Judge, SharedInstruction};
use crate::vlm::OnboardCamera;

/// Latency from an image's capture to its sending.
const LATENCY: Duration = Duration::from_millis(120);

/// Configuration of the service.
pub struct TelloPlan {
    /// The scene.
    pub loaded: Arc<LoadedScene>,
    /// Start pose; `None` for the scene's start.
    pub start: Option<Pose>,
    /// Flight conditions.
    pub flight_conditions: FlightConditions,
    /// Seed of all random choices.
    pub seed: u64,
    /// The drone's address and command port.
    pub listen: SocketAddr,
    /// SDK version.
    pub firmware: Firmware,
    /// Video quality.
    pub quality: VideoQuality,
    /// Faults.
    pub faults: FaultSource,
    /// The instruction by which flights are judged.
    pub instruction: SharedInstruction,
    /// File for a line of JSON per flight.
    pub truth: Option<File>,
    /// The camera memory for a VLM endpoint.
    pub onboard: Option<Arc<OnboardCamera>>,
}

/// A running virtual Tello in a scene; it stops when dropped.
pub struct TelloService {
    // Dropped first: its last evaluation needs a drone that still flies.
    _judge: Judge,
    server: Server,
    world: SimWorld,
    start: Instant,
}

impl TelloService {
    /// Starts the service.
    ///
    /// # Errors
    /// [`ServerError`] if the server cannot start.
    pub fn start(plan: TelloPlan) -> Result<Self, ServerError> {
        let TelloPlan { loaded, start, flight_conditions, seed, listen, firmware, quality, faults, instruction, truth, onboard } =
            plan;
        let start = start.unwrap_or(loaded.scene.start);
        let world = SimWorld::under(&flight_conditions, loaded, CraftKind::Tello, start, seed);
        let camera = world.clone();
        // The first image in a scene prepares shadows and lamps, which takes seconds on a slow machine; do it before
        // anyone flies.
        drop(world.look(&world.now(), channels(RenderQuality::Draft)));
        let from = Instant::now();
        let setup = Setup {
            listen,
            craft: world.shared_craft(),
            quality,
            photographer: Box::new(move |at, request, fineness| {
                let image = photograph(&camera, at, request, fineness)?;
                if let Some((onboard, moment)) = onboard.as_ref().filter(|_| !request.downwards).zip(camera.snapshot_at(at)) {
                    onboard.keep(moment, &image);
                }
                Some(image)
            }),
            figures: ProtocolParameters::default(),
            firmware,
            faults,
            seed,
            latency: LATENCY,
            start: from,
        };
        let server = Server::start(setup)?;
        let judge = Judge::start(world.clone(), instruction, truth).map_err(ServerError::Thread)?;
        Ok(Self { _judge: judge, server, world, start: from })
    }

    /// The command address.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// Video statistics.
    #[must_use]
    pub fn tally(&self) -> SendStats {
        self.server.tally()
    }

    /// The simulated world. Only the service may advance it.
    #[must_use]
    pub fn world(&self) -> &SimWorld {
        &self.world
    }
    /// Wall-clock time of the world's time zero.
    #[must_use]
    pub fn start_time(&self) -> Instant {
        self.start
    }
}
