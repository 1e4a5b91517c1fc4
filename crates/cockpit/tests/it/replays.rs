//! Replays of recorded flights: one at a time, for who may fly, and not while a drone flies.

use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use spf_cockpit::{Cockpit, FlightControls, Flights};
use spf_core::craft::Craft;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;
use spf_record::out_dir::OutDir;

use crate::strangers::answered;

/// Asks for a replay, with a secret.
fn replay(address: SocketAddr, secret: &str) -> String {
    answered(TcpStream::connect(address).unwrap(), "POST", "/again/one", &headers(address, secret))
}

fn headers(address: SocketAddr, secret: &str) -> String {
    format!("Host: {address}\r\nConnection: close\r\nContent-Length: 0\r\nAuthorization: Bearer {secret}")
}

#[test]
fn a_replay_is_for_who_may_fly_and_none_runs_beside_a_flight() {
    let folder = tempfile::tempdir().unwrap();
    let site = Simulated::new(Arc::new(LoadedScene::load("yard").unwrap()), "yard");
    let oracle = oracle_factory("oracle".to_owned(), ErrorFile::default());
    let mut plan = FlightPlan::new(Site::Simulated(site), "fly to the door", "oracle", oracle);
    plan.settings.max_time = Duration::from_secs(20);
    plan.record = Some(RecordPlan { out: OutDir::at(&folder.path().join("one")).unwrap(), video: false, view: None });
    fly(plan, &mut []).unwrap();
    let flights = Flights::of(folder.path());
    let cockpit = Cockpit::open("127.0.0.1:0".parse().unwrap(), Some(flights), Arc::new(|_| {})).unwrap();
    let (address, url) = (cockpit.address(), cockpit.urls().0);
    let secret = url.split_once('#').unwrap().1.trim_start_matches("key=");

    // An address alone, as in an image of another page, replays nothing.
    let get = answered(TcpStream::connect(address).unwrap(), "GET", "/again/one", &headers(address, secret));
    assert!(get.starts_with("HTTP/1.1 405"), "{get}");
    assert!(replay(address, "0123").starts_with("HTTP/1.1 403"));

    let began = Instant::now();
    // One that is under way is waited for.
    let done = loop {
        let answer = replay(address, secret);
        if !answer.starts_with("HTTP/1.1 429") {
            break answer;
        }
        assert!(began.elapsed() < Duration::from_secs(60), "{answer}");
        std::thread::sleep(Duration::from_millis(100));
    };
    assert!(done.starts_with("HTTP/1.1 200") && done.contains(r#""differences":0"#), "{done}");

    let (operator, _inputs) = channel();
    cockpit.begin(FlightControls { operator, craft: Craft::quad(), read: Arc::new(|_| Ok(String::new())), only: false });
    let beside = replay(address, secret);
    assert!(beside.starts_with("HTTP/1.1 403") && beside.contains("under way"), "{beside}");
}
