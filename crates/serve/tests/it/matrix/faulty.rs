//! Any drone behind message faults, in virtual time.

use std::collections::BTreeMap;
use std::sync::Arc;

use spf_core::command::Command;
use spf_core::depth::DepthGrid;
use spf_core::frame::{FrameMeta, Unusable};
use spf_core::telemetry::Telemetry;
use spf_core::time::{Duration, Time};
use spf_drone::frames::Frames;
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;
use spf_serve::fault::{Content, FaultMachine, Stream};

use super::faults::DepthFailing;

/// Drops, delays, copies and damages a drone's reports, and loses commands.
pub(crate) struct Faulty {
    drone: Box<dyn Drone>,
    faults: FaultMachine,
    /// The reported charge from a time on.
    pub(crate) charge: Option<(Time, f64)>,
    /// From when on it reports an error of its inertial measurement.
    pub(crate) imu_error_from: Option<Time>,
    /// From when on its depth sensor fails, and how.
    pub(crate) depth: Option<(Time, DepthFailing)>,
    last_depths: Vec<u16>,
    counts: [u64; 3],
    /// The last frame and telemetry from before a freeze.
    last: (Option<FrameMeta>, Option<Telemetry>),
    queue: BTreeMap<(Time, u64), DroneEvent>,
    serial: u64,
}

impl Faulty {
    pub(crate) fn new(drone: Box<dyn Drone>, faults: FaultMachine) -> Self {
        Self {
            drone,
            faults,
            charge: None,
            imu_error_from: None,
            depth: None,
            last_depths: Vec::new(),
            counts: [0; 3],
            last: (None, None),
            queue: BTreeMap::new(),
            serial: 0,
        }
    }

    fn frame(&mut self, frame: FrameMeta, content: Content) -> FrameMeta {
        match content {
            Content::Intact => {
                self.last.0 = Some(frame);
                frame
            }
            Content::FrozenSince(_) => {
                let capture_counter = self.last.0.map_or(0, |last| last.capture_counter);
                FrameMeta { capture_counter, ..frame }
            }
            Content::Corrupt(_) => FrameMeta { unusable: Some(Unusable::Undecodable), ..frame },
            Content::Blank => FrameMeta { unusable: Some(Unusable::Blank), ..frame },
        }
    }

    fn telemetry(&mut self, telemetry: Telemetry, content: Content) -> Telemetry {
        let telemetry = match self.charge {
            Some((from, charge)) if telemetry.time >= from => Telemetry { battery: Some(charge), ..telemetry },
            _ => telemetry,
        };
        let imu_error = telemetry.imu_error || self.imu_error_from.is_some_and(|from| telemetry.time >= from);
        let telemetry = Telemetry { imu_error, ..telemetry };
        match content {
            Content::FrozenSince(_) => self.last.1.unwrap_or(telemetry),
            _ => {
                self.last.1 = Some(telemetry);
                telemetry
            }
        }
    }

    /// What arrives of a depth grid, and when.
    fn depth(&mut self, at: Time, mut grid: Box<DepthGrid>) -> Option<(Time, Box<DepthGrid>)> {
        let fault = self.depth.filter(|(from, _)| grid.captured >= *from).map(|(_, fault)| fault);
        match fault {
            None => self.last_depths.clone_from(&grid.cm),
            Some(DepthFailing::Silent) => return None,
            Some(DepthFailing::Frozen) => grid.cm.clone_from(&self.last_depths),
            Some(DepthFailing::HalfBlack) => {
                let width = grid.camera.width as usize;
                grid.cm.iter_mut().enumerate().filter(|(index, _)| index % width < width / 2).for_each(|(_, cm)| *cm = 0);
            }
            Some(DepthFailing::Scale) => grid.cm.iter_mut().for_each(|cm| *cm += *cm / 10),
            Some(DepthFailing::Late) => return Some((at + Duration::from_millis(1500), grid)),
        }
        Some((at, grid))
    }

    fn take(&mut self, at: Time, event: DroneEvent) {
        if let DroneEvent::Depth(grid) = event {
            if let Some((at, grid)) = self.depth(at, grid) {
                self.serial += 1;
                self.queue.insert((at, self.serial), DroneEvent::Depth(grid));
            }
            return;
        }
        let stream = match &event {
            DroneEvent::Frame(_) => Stream::Frames,
            DroneEvent::Telemetry(_) => Stream::Telemetry,
            _ => {
                self.serial += 1;
                self.queue.insert((at, self.serial), event);
                return;
            }
        };
        let count = &mut self.counts[stream as usize];
        *count += 1;
        for delivery in self.faults.pass(at, stream, *count) {
            let event = match event.clone() {
                DroneEvent::Frame(frame) => {
                    DroneEvent::Frame(FrameMeta { received: delivery.at, ..self.frame(frame, delivery.content) })
                }
                DroneEvent::Telemetry(telemetry) => DroneEvent::Telemetry(self.telemetry(telemetry, delivery.content)),
                other => other,
            };
            self.serial += 1;
            self.queue.insert((delivery.at, self.serial), event);
        }
    }
}

impl Drone for Faulty {
    fn name(&self) -> &str {
        self.drone.name()
    }

    fn capabilities(&self) -> Capabilities {
        self.drone.capabilities()
    }

    fn frames(&self) -> Arc<dyn Frames> {
        self.drone.frames()
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        let count = &mut self.counts[2];
        *count += 1;
        if self.faults.pass(now, Stream::Commands, *count).is_empty() { Ok(()) } else { self.drone.apply(now, command) }
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        while let Some((at, event)) = self.drone.next_event(until) {
            self.take(at, event);
        }
        let first = *self.queue.first_key_value()?.0;
        (first.0 <= until).then(|| self.queue.remove(&first).map(|event| (first.0, event)))?
    }

    fn resume(&mut self, now: Time) {
        self.drone.resume(now);
    }

    fn next_event_at(&self) -> Option<Time> {
        let queued = self.queue.first_key_value().map(|((at, _), _)| *at);
        [self.drone.next_event_at(), queued].into_iter().flatten().min()
    }
}
