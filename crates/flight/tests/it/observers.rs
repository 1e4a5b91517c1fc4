//! Observers of a flight cannot end it.

use std::sync::Arc;

use spf_core::time::Time;
use spf_flight::flight::{FlightPlan, Flown, Site, fly};
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;
use spf_pilot::{Action, Outcome, Pilot};

/// Panics at its second decision, like an encoder with a bug.
#[derive(Default)]
struct Panicking {
    notes: u32,
}

impl Observer for Panicking {
    fn action(&mut self, _now: Time, action: &Action, _pilot: &Pilot) {
        if matches!(action, Action::Note(_)) {
            self.notes += 1;
            assert!(self.notes < 4, "a bug");
        }
    }
}

fn flown(observers: &mut [&mut dyn Observer]) -> Flown {
    let scene = Arc::new(LoadedScene::load("city").unwrap());
    let vlm_factory = oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap());
    let site = Site::Simulated(Simulated::new(scene, "city"));
    fly(FlightPlan::new(site, "fly to the red crane", "oracle:perfect", vlm_factory), observers).unwrap()
}

#[test]
fn an_observer_that_panics_ends_no_flight() {
    let mut observer = Panicking::default();
    let with = flown(&mut [&mut observer]);
    assert_eq!(observer.notes, 4, "it is not called again");
    assert_eq!(with.recording_problems, ["internal error: a part that records or displays the flight failed"]);
    let without = flown(&mut []);
    assert_eq!(with.summary.outcome, Outcome::Reached);
    assert_eq!(serde_json::to_string(&with.summary).unwrap(), serde_json::to_string(&without.summary).unwrap());
}
