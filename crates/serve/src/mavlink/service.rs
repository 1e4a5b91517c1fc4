//! A virtual vehicle in a scene, with a judge that has access to ground truth: `spf sim serve --mavlink`.

use std::fs::File;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_flight::sim::{FlightConditions, LoadedScene, SimWorld};
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::url::MavlinkUrl;
use spf_render::{Channels, Quality};

use super::error::VehicleServerError;
use super::server::{Equipment, VehicleServer, VehicleSetup};
use crate::tello::FaultSource;
use crate::truth::{Judge, SharedInstruction};

/// Configuration of the service.
pub struct VehiclePlan {
    /// The autopilot.
    pub autopilot: Autopilot,
    /// Where it is reached.
    pub links: Vec<MavlinkUrl>,
    /// Parameters that differ from their defaults.
    pub parameters: Vec<(String, f64)>,
    /// The scene.
    pub loaded: Arc<LoadedScene>,
    /// Start pose; `None` for the scene's start.
    pub start: Option<Pose>,
    /// Flight conditions.
    pub flight_conditions: FlightConditions,
    /// Seed of all random choices.
    pub seed: u64,
    /// What it carries.
    pub equipment: Equipment,
    /// Faults of its UDP links.
    pub faults: FaultSource,
    /// The instruction by which flights are judged.
    pub instruction: SharedInstruction,
    /// File for a line of JSON per flight.
    pub truth: Option<File>,
}

/// A running virtual vehicle in a scene; it stops when dropped.
pub struct VehicleService {
    // Dropped first: its last evaluation needs a craft that still flies.
    _judge: Judge,
    server: VehicleServer,
    world: SimWorld,
    start: Instant,
}

impl VehicleService {
    /// Starts the service.
    ///
    /// # Errors
    /// [`VehicleServerError`] if the server cannot start.
    pub fn start(plan: VehiclePlan) -> Result<Self, VehicleServerError> {
        let VehiclePlan {
            autopilot,
            links,
            parameters,
            loaded,
            start,
            flight_conditions,
            seed,
            equipment,
            faults,
            instruction,
            truth,
        } = plan;
        let start = start.unwrap_or(loaded.scene.start);
        let world = SimWorld::under(&flight_conditions, loaded, CraftKind::Quad, start, seed);
        // The first image in a scene prepares shadows and lamps, which takes seconds on a slow machine; do it before anyone flies.
        drop(world.look(&world.now(), Channels { quality: Quality::Live, ..Channels::RGB }));
        let start = Instant::now();
        let (craft, camera_tilt) = (world.shared_craft(), world.camera_tilt());
        let server = VehicleServer::start(VehicleSetup {
            autopilot,
            links,
            parameters,
            craft,
            faults,
            camera_tilt,
            equipment,
            seed,
            start,
        })?;
        let judge = Judge::start(world.clone(), instruction, truth).map_err(VehicleServerError::Thread)?;
        Ok(Self { _judge: judge, server, world, start })
    }

    /// The addresses bound, in the order of the links; `None` for a serial port.
    #[must_use]
    pub fn bound(&self) -> &[Option<SocketAddr>] {
        self.server.bound()
    }

    /// The simulated world. Only the service may advance it.
    #[must_use]
    pub fn world(&self) -> &SimWorld {
        &self.world
    }

    /// Wall-clock time of the craft's time zero.
    #[must_use]
    pub fn start_time(&self) -> Instant {
        self.start
    }

    /// Its pilot changes the mode by the switch of the radio.
    pub fn radio(&self, mode: Mode) {
        self.server.radio(mode);
    }

    /// Its flight mode, and whether it is armed.
    #[must_use]
    pub fn state(&self) -> (Mode, bool) {
        self.server.state()
    }
}
