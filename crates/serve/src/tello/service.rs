//! A virtual Tello in a scene: `spf sim serve --tello`. The server has the protocol; here it gets a scene to see, and a judge who
//! knows the truth.

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
use super::figures::{Figures, Firmware};
use super::pace::{Fineness, VideoQuality};
use super::photograph::{channels, photograph};
use super::server::{Server, Setup};
use super::shared::Tally;
use crate::truth::{Heard, Judge};
use crate::vlm::OnboardCamera;

/// From an image's capture to its sending.
const LATENCY: Duration = Duration::from_millis(120);

/// What is served.
pub struct TelloPlan {
    /// Where it flies.
    pub loaded: Arc<LoadedScene>,
    /// Where it stands at first; `None`: the scene's start.
    pub start: Option<Pose>,
    /// Under what conditions.
    pub flight_conditions: FlightConditions,
    /// Of all chance.
    pub seed: u64,
    /// The drone's address and command port.
    pub listen: SocketAddr,
    /// SDK.
    pub firmware: Firmware,
    /// How fine its images are.
    pub quality: VideoQuality,
    /// What goes wrong.
    pub faults: FaultSource,
    /// What flights are judged by.
    pub instruction: Heard,
    /// Where a line of JSON about each flight goes.
    pub truth: Option<File>,
    /// Who keeps what the camera sees, for an endpoint that is asked about it.
    pub onboard: Option<Arc<OnboardCamera>>,
}

/// A virtual Tello that flies until it is dropped.
pub struct TelloService {
    // Ends first: its last look is at a drone that still flies.
    _judge: Judge,
    server: Server,
    world: SimWorld,
}

impl TelloService {
    /// Begins to serve.
    ///
    /// # Errors
    /// [`ServerError`].
    pub fn start(plan: TelloPlan) -> Result<Self, ServerError> {
        let TelloPlan { loaded, start, flight_conditions, seed, listen, firmware, quality, faults, instruction, truth, onboard } =
            plan;
        let start = start.unwrap_or(loaded.scene.start);
        let world = SimWorld::under(&flight_conditions, loaded, CraftKind::Tello, start, seed);
        let camera = world.clone();
        // The first image in a scene prepares its shadows and lamps: seconds, on a slow machine, in which nobody flies yet.
        drop(world.look(&world.now(), channels(Fineness::Draft)));
        let setup = Setup {
            listen,
            craft: world.shared_craft(),
            quality,
            photographer: Box::new(move |at, wish, fineness| {
                let picture = photograph(&camera, at, wish, fineness)?;
                if let Some((onboard, moment)) = onboard.as_ref().filter(|_| !wish.downwards).zip(camera.snapshot_at(at)) {
                    onboard.keep(moment, &picture);
                }
                Some(picture)
            }),
            figures: Figures::default(),
            firmware,
            faults,
            seed,
            latency: LATENCY,
            start: Instant::now(),
        };
        let server = Server::start(setup)?;
        let judge = Judge::start(world.clone(), instruction, truth).map_err(ServerError::Thread)?;
        Ok(Self { _judge: judge, server, world })
    }

    /// Where it listens for commands.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// What video it has sent.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.server.tally()
    }

    /// The world it flies in. Nobody else may advance it.
    #[must_use]
    pub fn world(&self) -> &SimWorld {
        &self.world
    }
}
