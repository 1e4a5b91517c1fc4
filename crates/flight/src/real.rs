//! A real craft: no ground truth and no seed.

use std::sync::Arc;

use spf_core::time::Time;
use spf_drone::Drone;
use spf_pilot::{Action, Pilot};

use crate::frame_age::FrameAge;
use crate::frame_source::CameraFrameSource;
use crate::odometer::Odometer;
use crate::run::Observer;
use crate::site::{Clock, Judge, Parts};
use crate::summary::Summary;

/// A craft outside this program, real or simulated elsewhere.
pub struct Real {
    /// The connected driver.
    pub drone: Box<dyn Drone>,
    /// The clock of its timestamps.
    pub clock: Clock,
}

impl Real {
    /// The parts needed by a flight.
    pub(crate) fn open(self) -> Parts {
        let Self { drone, clock } = self;
        let frame_source = Arc::new(CameraFrameSource::new(drone.as_ref()));
        let judge = FinalEstimate { drone: drone.name().to_owned(), ..FinalEstimate::default() };
        Parts { drone, clock, seed: 0, frame_source, judge: Box::new(judge), sim: None }
    }
}

/// The pilot's estimate when the outcome was settled.
#[derive(Default)]
struct FinalEstimate {
    drone: String,
    odometer: Odometer,
    /// What it showed when the outcome was settled, metres; `None` before that.
    flown: Option<f64>,
    frame_age: FrameAge,
}

impl FinalEstimate {
    /// Path length, metres: also of a flight that ended without an outcome.
    fn flown(&self) -> f64 {
        self.flown.unwrap_or_else(|| self.odometer.metres())
    }
}

impl Observer for FinalEstimate {
    fn time(&mut self, now: Time, pilot: &Pilot) {
        self.odometer.tick(now, pilot);
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        self.frame_age.action(now, action, pilot);
    }
}

impl Judge for FinalEstimate {
    fn settle(&mut self, _now: Time, _instruction: &str) {
        self.flown = Some(self.odometer.metres());
    }

    fn tell(&self, summary: &mut Summary) {
        summary.path_length_m = self.flown();
        summary.drone_model.clone_from(&self.drone);
        summary.glass_to_decision = self.frame_age.latency();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_path_ends_with_the_outcome_or_with_the_flight() {
        let mut judge = FinalEstimate { odometer: Odometer::showing(3.0), ..FinalEstimate::default() };
        assert_eq!(judge.flown(), 3.0);
        judge.settle(Time::ZERO, "go");
        judge.odometer = Odometer::showing(5.0);
        assert_eq!(judge.flown(), 3.0, "the way down does not count");
    }
}
