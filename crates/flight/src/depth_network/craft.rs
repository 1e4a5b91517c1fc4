//! A craft whose depth a network estimates.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use spf_core::command::Command;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameMeta;
use spf_core::ranges::RangeScan;
use spf_core::time::{Duration, Time};
use spf_detect::mono_depth::{FARTHEST, MonoDepth};
use spf_drone::frames::{Frames, Photo};
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;

use super::beside::Beside;
use super::scaling::Scaling;
use super::{DepthPlan, EstimatesDepth, Estimator};

/// A craft with a depth network beside it: to whoever flies it, one with a depth sensor.
pub(crate) struct WithDepth {
    drone: Box<dyn Drone>,
    frames: Arc<dyn Frames>,
    scaling: Scaling,
    /// Whether the craft flies.
    flies: bool,
    work: Work,
}

/// Where the network runs.
enum Work {
    /// At once, in virtual time: how often the network is asked, and how long it takes, are stated, so that the flight does not depend
    /// on the machine that simulates it.
    Virtual {
        estimator: Box<Estimator>,
        period: Duration,
        latency: Duration,
        next: Time,
        /// With the times at which a computer in flight would have them.
        estimates: VecDeque<(Time, MonoDepth)>,
    },
    /// In a thread of its own.
    Thread(Beside<(FrameMeta, Photo), MonoDepth>),
}

impl WithDepth {
    /// A network for a craft in virtual time.
    pub(crate) fn in_virtual_time(drone: Box<dyn Drone>, network: Box<dyn EstimatesDepth>, plan: &DepthPlan) -> Self {
        let &DepthPlan { period, latency, .. } = plan;
        let camera = drone.capabilities().camera;
        let work = Work::Virtual {
            estimator: Box::new(Estimator::new(network, camera, plan.given_up.clone())),
            // The network works on one image at a time.
            period: period.max(latency),
            latency,
            next: Time::ZERO,
            estimates: VecDeque::new(),
        };
        Self::new(drone, work)
    }

    /// A network for a craft on the wall clock.
    ///
    /// # Errors
    /// The operating system's error if the thread cannot be started.
    pub(crate) fn in_a_thread(
        drone: Box<dyn Drone>,
        network: Box<dyn EstimatesDepth>,
        plan: &DepthPlan,
    ) -> std::io::Result<Self> {
        let camera = drone.capabilities().camera;
        let mut estimator = Estimator::new(network, camera, plan.given_up.clone());
        let network = move |(meta, photo): (FrameMeta, Photo)| {
            let began = Instant::now();
            estimator.estimate(&meta, &photo, || began.elapsed())
        };
        Ok(Self::new(drone, Work::Thread(Beside::start("depth", plan.period, network)?)))
    }

    fn new(drone: Box<dyn Drone>, work: Work) -> Self {
        let (frames, scaling) = (drone.frames(), Scaling::new(&drone.capabilities()));
        Self { drone, frames, scaling, flies: false, work }
    }

    /// Notes an event of the craft.
    fn note(&mut self, now: Time, event: &DroneEvent) {
        match event {
            DroneEvent::Telemetry(telemetry) => {
                self.flies = telemetry.phase.is_flying();
                self.scaling.telemetry(now, telemetry);
            }
            DroneEvent::Gimbal(report) => self.scaling.gimbal(*report),
            DroneEvent::Ranges(scan) => self.scaling.ranges(now, scan),
            DroneEvent::Depth(_) => self.scaling.sensed(now),
            DroneEvent::Frame(meta) if self.flies && meta.unusable.is_none() => self.frame(now, meta),
            _ => {}
        }
    }

    pub(super) fn frame(&mut self, now: Time, meta: &FrameMeta) {
        if let Work::Virtual { estimator, next, .. } = &self.work
            && (now < *next || estimator.is_over())
        {
            return;
        }
        // The frame is held from now on: its camera may drop it within a second.
        let Some(photo) = self.frames.photo(meta.id) else { return };
        match &mut self.work {
            Work::Virtual { estimator, period, latency, next, estimates } => {
                *next = now + *period;
                let found = estimator.estimate(meta, &photo, || *latency);
                estimates.extend(found.map(|estimate| (now + *latency, estimate)));
            }
            Work::Thread(network) => network.put((*meta, photo)),
        }
    }

    /// When the next estimate is due, in virtual time.
    fn estimate_at(&self) -> Option<Time> {
        match &self.work {
            Work::Virtual { estimates, .. } => estimates.front().map(|(at, _)| *at),
            Work::Thread(_) => None,
        }
    }

    /// The depth of the next estimate that has come by `until`, if its scale is known, and when it came.
    fn estimated(&mut self, until: Time) -> Option<(Time, DepthGrid)> {
        loop {
            let (at, estimate) = match &mut self.work {
                Work::Virtual { estimates, .. } => estimates.pop_front_if(|(due, _)| *due <= until)?,
                Work::Thread(network) => (until, network.take()?),
            };
            if let Some(grid) = self.scaling.grid(at, &estimate) {
                return Some((at, grid));
            }
        }
    }
}

impl Drone for WithDepth {
    fn name(&self) -> &str {
        self.drone.name()
    }

    fn capabilities(&self) -> Capabilities {
        let own = self.drone.capabilities();
        Capabilities { depth: own.depth.or(Some(FARTHEST)), ..own }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        self.frames.clone()
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        if let Command::Setpoint(setpoint) = command.get() {
            self.scaling.commanded(now, *setpoint);
        }
        self.drone.apply(now, command)
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        // In the order of their times; at equal times the craft comes first, so that the pose of the frame is known.
        let own_at = self.drone.next_event_at();
        let is_first = self.estimate_at().is_some_and(|at| own_at.is_none_or(|own| at < own));
        if is_first && let Some((at, grid)) = self.estimated(until) {
            return Some((at, DroneEvent::Depth(Box::new(grid))));
        }
        if let Some((at, event)) = self.drone.next_event(until) {
            self.note(at, &event);
            return Some((at, event));
        }
        self.estimated(until).map(|(at, grid)| (at, DroneEvent::Depth(Box::new(grid))))
    }

    fn resume(&mut self, now: Time) {
        self.drone.resume(now);
    }

    fn wants_surroundings(&self) -> bool {
        self.drone.wants_surroundings()
    }

    fn surroundings(&mut self, now: Time, scan: &RangeScan) {
        self.drone.surroundings(now, scan);
    }

    fn next_event_at(&self) -> Option<Time> {
        [self.drone.next_event_at(), self.estimate_at()].into_iter().flatten().min()
    }
}
