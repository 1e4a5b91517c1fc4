//! Replays asked for over HTTP: one at a time, also without who asked, and none beside a flight.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use spf_core::craft::Craft;
use spf_core::time::Duration;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;
use spf_record::out_dir::OutDir;

use super::gate::Gate;
use super::{Flights, again};
use crate::cockpit::Cockpit;
use crate::flight_controls::FlightControls;

struct Served {
    cockpit: Cockpit,
    begun: Receiver<()>,
    go_on: Sender<()>,
    _folder: tempfile::TempDir,
}

/// Serves one flight, whose log is none; its replays wait.
fn served() -> Served {
    let folder = tempfile::tempdir().unwrap();
    let flight = folder.path().join("one");
    std::fs::create_dir(&flight).unwrap();
    std::fs::write(flight.join("summary.json"), "{}").unwrap();
    std::fs::write(flight.join("flight.mcap"), "no log").unwrap();
    let (gate, begun, go_on) = Gate::closed();
    let flights = Flights { gate, ..Flights::of(folder.path()) };
    let cockpit = Cockpit::open("127.0.0.1:0".parse().unwrap(), Some(flights), Arc::new(|_| {})).unwrap();
    Served { cockpit, begun, go_on, _folder: folder }
}

impl Served {
    fn ask(&self) -> TcpStream {
        let (address, url) = (self.cockpit.address(), self.cockpit.urls().0);
        let secret = url.split_once('#').unwrap().1.to_owned();
        let mut stream = TcpStream::connect(address).unwrap();
        write!(
            stream,
            "POST /again/one HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Length: 0\r\n\
             Authorization: Bearer {secret}\r\n\r\n"
        )
        .unwrap();
        stream
    }

    fn answer(&self) -> String {
        let mut answer = String::new();
        self.ask().read_to_string(&mut answer).unwrap();
        answer
    }
}

#[test]
fn a_replay_that_nobody_waits_for_any_more_keeps_its_place_until_it_is_over() {
    let served = served();
    let abandoned = served.ask();
    served.begun.recv().unwrap();
    drop(abandoned);
    for _ in 0..3 {
        let answer = served.answer();
        assert!(answer.starts_with("HTTP/1.1 429") && answer.contains("being replayed"), "{answer}");
    }
    assert!(served.begun.try_recv().is_err(), "no other one has begun");
    // It ends: the next one gets its place.
    served.go_on.send(()).unwrap();
    // That of the next one may go on as soon as it begins.
    served.go_on.send(()).unwrap();
    let answer = loop {
        let answer = served.answer();
        if !answer.starts_with("HTTP/1.1 429") {
            break answer;
        }
        // The place is not free yet.
    };
    served.begun.recv().unwrap();
    assert!(answer.starts_with("HTTP/1.1 409") && answer.contains("cannot be"), "{answer}");
}

#[test]
fn a_replay_ends_when_a_flight_begins() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = FlightPlan {
        record: Some(RecordPlan { out: OutDir::at(folder.path()).unwrap(), video: false, view: None }),
        ..FlightPlan::new(
            Site::Simulated(Simulated::new(Arc::new(LoadedScene::load("city").unwrap()), "city")),
            "fly to the red crane",
            "oracle:perfect",
            oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap()),
        )
    };
    plan.settings.max_time = Duration::from_secs(9);
    fly(plan, &mut []).unwrap();
    let asked = std::cell::Cell::new(0);
    let flying = || {
        asked.set(asked.get() + 1);
        asked.get() > 50
    };
    let why = again::differences(&folder.path().join("flight.mcap"), flying).unwrap_err();
    assert!(why.contains("a flight has begun") && asked.get() == 51, "{why}, {}", asked.get());
}

#[test]
fn none_begins_beside_a_flight() {
    let served = served();
    let (operator, _inputs) = channel();
    served.cockpit.begin(FlightControls { operator, craft: Craft::quad(), read: Arc::new(|_| Ok(String::new())), only: false });
    let answer = served.answer();
    assert!(answer.starts_with("HTTP/1.1 403") && answer.contains("under way"), "{answer}");
}
