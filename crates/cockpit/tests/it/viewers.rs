//! Viewers cost the flight nothing: eight of them, one of which reads nothing.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use serde_json::json;
use spf_cockpit::{Cockpit, FlightControls};
use spf_core::craft::Craft;
use spf_core::pilot::{Action, Pilot};
use spf_core::time::Time;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;

use crate::client::Socket;

/// Measures the time between two commands to the craft.
#[derive(Default)]
struct Ticks {
    last: Option<Instant>,
    gaps_ms: Vec<f64>,
}

impl Observer for Ticks {
    fn action(&mut self, _: Time, action: &Action, _: &Pilot) {
        if matches!(action, Action::Command(_)) {
            let now = Instant::now();
            self.gaps_ms.extend(self.last.replace(now).map(|last| 1000.0 * now.duration_since(last).as_secs_f64()));
        }
    }
}

impl Ticks {
    fn percentile(&mut self, share: f64) -> f64 {
        self.gaps_ms.sort_by(f64::total_cmp);
        self.gaps_ms[(share * (self.gaps_ms.len() - 1) as f64) as usize]
    }
}

/// Flies for some seconds, with a cockpit or without.
fn flown(cockpit: Option<&Cockpit>) -> Ticks {
    let mut site = Simulated::new(Arc::new(LoadedScene::load("yard").unwrap()), "yard");
    site.realtime = true;
    let mut plan = FlightPlan::new(
        Site::Simulated(site),
        "fly to the door",
        "oracle",
        oracle_factory("oracle".to_owned(), ErrorFile::default()),
    );
    plan.settings.max_time = Duration::from_secs(8);
    let (operator, inputs) = channel();
    plan.operator = Some(inputs);
    let mut ticks = Ticks::default();
    let mut instruments = cockpit.map(|cockpit| {
        cockpit.begin(FlightControls { operator, craft: Craft::quad(), read: Arc::new(|_| Ok(String::new())), only: false });
        cockpit.instruments()
    });
    let mut observers: Vec<&mut dyn Observer> = vec![&mut ticks];
    if let Some(instruments) = &mut instruments {
        observers.push(instruments);
    }
    fly(plan, &mut observers).unwrap();
    ticks
}

#[test]
#[ignore = "slow: two flights on the wall clock"]
fn eight_viewers_of_which_one_is_stuck_cost_the_flight_nothing() {
    let mut without = flown(None);
    let cockpit = Cockpit::open("127.0.0.1:0".parse().unwrap(), None, Arc::new(|_| {})).unwrap();
    let over = Arc::new(AtomicBool::new(false));
    // Pictures are sent to it, and it reads none of them.
    let (address, until) = (cockpit.address(), over.clone());
    let stuck = std::thread::spawn(move || {
        let mut stuck = Socket::open(address, "/watch", json!({}));
        while !until.load(Ordering::Relaxed) {
            stuck.pretend();
            std::thread::sleep(Duration::from_millis(20));
        }
        stuck
    });
    let viewers: Vec<_> = (0..7)
        .map(|_| {
            let (address, over) = (cockpit.address(), over.clone());
            std::thread::spawn(move || {
                let mut socket = Socket::open(address, "/watch", json!({}));
                while !over.load(Ordering::Relaxed) && socket.next().is_some() {}
                socket.pictures.len()
            })
        })
        .collect();
    let mut with = flown(Some(&cockpit));
    over.store(true, Ordering::Relaxed);
    let mut stuck = stuck.join().unwrap();
    stuck.alive = false;
    while stuck.pictures.len() <= 20 {
        assert!(stuck.next().is_some(), "only {} pictures waited for the stuck viewer", stuck.pictures.len());
    }
    drop(cockpit);
    let seen: Vec<usize> = viewers.into_iter().map(|viewer| viewer.join().unwrap()).collect();
    let (alone, watched) = (without.percentile(0.99), with.percentile(0.99));
    println!(
        "time between commands, 99th percentile: {alone:.1} ms without, {watched:.1} ms with 8 viewers; pictures seen: {seen:?}"
    );
    assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
    // Ten a second; the machine that tests may be busy with other things.
    assert!(watched < 1.1 * alone + 25.0, "{alone} ms without viewers, {watched} ms with");
}
