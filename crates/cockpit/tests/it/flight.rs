//! A short flight by clicking, held, handed over and ended from the page.

use std::sync::mpsc::channel;
use std::sync::{Arc, LazyLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use spf_cockpit::{Cockpit, FlightControls, FlightEnd};
use spf_core::craft::Craft;
use spf_flight::flight::{FlightPlan, Flown, Site, fly};
use spf_flight::sim::{LoadedScene, Simulated, VlmFactory};
use spf_pilot::{Outcome, QueryTiming};
use spf_vlm::Vlm;

use crate::client::Socket;

static YARD: LazyLock<Arc<LoadedScene>> = LazyLock::new(|| Arc::new(LoadedScene::load("yard").unwrap()));

/// Opens a cockpit, and the two sockets of the page that flies.
fn opened() -> (Cockpit, Socket, Socket) {
    let cockpit = Cockpit::open("127.0.0.1:0".parse().unwrap(), None, Arc::new(|_| {})).unwrap();
    let url = cockpit.urls().0;
    let token = url.split_once('#').unwrap().1;
    let mut controls = Socket::open(cockpit.address(), "/control", json!({"token": token}));
    let session = controls.wait("a session", |message| message["type"] == "welcome")["session"].clone();
    let watch = Socket::open(cockpit.address(), "/watch", json!({"session": session}));
    (cockpit, controls, watch)
}

/// Flies an instruction on the wall clock; whoever clicks is asked.
fn flown(cockpit: &Cockpit, only: bool) -> JoinHandle<Flown> {
    let mut site = Simulated::new(YARD.clone(), "yard");
    site.realtime = true;
    let pointers = cockpit.pointers();
    let human: VlmFactory = Arc::new(move |_, _| Ok(Box::new(pointers(None)) as Box<dyn Vlm>));
    let mut plan = FlightPlan::new(Site::Simulated(site), "fly to what I click", "human", human);
    plan.settings.think = QueryTiming::Stop;
    plan.settings.reply_timeout = Duration::from_secs(60);
    let (operator, inputs) = channel();
    plan.operator = Some(inputs);
    cockpit.begin(FlightControls { operator, craft: Craft::quad(), read: Arc::new(|_| Ok(String::new())), only });
    let mut instruments = cockpit.instruments();
    std::thread::spawn(move || fly(plan, &mut [&mut instruments]).unwrap())
}

/// How much a figure changes over ten states.
fn stopped_at(watch: &mut Socket, figure: impl Fn(&mut Socket) -> f64) -> f64 {
    // States that waited while nobody read come first.
    let until = Instant::now() + Duration::from_millis(500);
    while Instant::now() < until {
        figure(watch);
    }
    let first = figure(watch);
    let later: Vec<f64> = (0..10).map(|_| figure(watch)).collect();
    later.iter().map(|value| (value - first).abs()).fold(0.0, f64::max)
}

fn phase(watch: &mut Socket, phase: &str) -> Value {
    watch.wait(phase, |message| message["type"] == "state" && message["phase"] == phase)
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_flight_by_clicking_is_held_watched_and_ended() {
    let (cockpit, mut controls, mut watch) = opened();
    assert!(cockpit.has_pilot());
    // This page answers beats only while it waits for something.
    let flight = flown(&cockpit, false);
    let head = watch.wait("the flight", |message| message["type"] == "flight");
    assert_eq!(head["vlm"], "human");
    assert!(!head["outlines"].as_array().unwrap().is_empty());
    watch.wait("a question", |message| message["type"] == "question" && message["query"].is_u64());
    // The click that decides where it goes: to the left of the middle.
    while watch.pictures.is_empty() {
        watch.wait("a state", |message| message["type"] == "state");
    }
    let frame = watch.pictures.last().unwrap()["frame"].clone();
    let (clicked, _) = controls.order(json!({"point": {"u": 0.3, "v": 0.5, "depth": 6, "frame": frame}}));
    assert_eq!((&clicked["ok"], &clicked["text"]), (&json!(true), &json!("answered")));
    let decision = watch.wait("a decision", |message| message["type"] == "decision");
    let point = decision["point"][0].as_f64().unwrap();
    assert!((point - 0.3).abs() < 0.05, "{decision}");
    // To the west of where it looks, or wherever left is: the plan leads there.
    let state = watch.wait("a plan", |message| message["type"] == "state" && message["goal"].is_array());
    assert!(state["height"].as_f64().unwrap() > 0.5 && state["battery"].is_number(), "{state}");
    // A spectator sees the same, but neither prompt nor reply, and stops nothing.
    let mut spectator = Socket::open(cockpit.address(), "/control", json!({}));
    assert_eq!(spectator.order(json!("hold")).0["ok"], json!(false));
    let mut looks = Socket::open(cockpit.address(), "/watch", json!({}));
    for (socket, knows) in [(&mut watch, true), (&mut looks, false)] {
        socket.say(&json!({"open": decision["query"]}));
        let opened = socket.wait("its details", |message| message["type"] == "opened");
        assert_eq!(opened.get("detail").is_some(), knows, "{opened}");
    }
    // Hold: acknowledged and in force.
    assert_eq!(controls.order(json!("hold")).0["ok"], json!(true));
    phase(&mut watch, "held");
    // Manual flight is held by itself when nothing more comes.
    controls.order(json!({"fly": {"right": 0, "forward": 0, "up": 0, "turn": 1}}));
    phase(&mut watch, "manual");
    // The dead man's stop: no further order comes, and it turns no more.
    let heading = |watch: &mut Socket| phase(watch, "manual")["heading"].as_f64().unwrap();
    std::thread::sleep(Duration::from_secs(2));
    let turned = stopped_at(&mut watch, heading);
    // While ordered it would turn by tens of degrees meanwhile; gusts turn it a little.
    assert!(turned < 4.0, "it turned by {turned}° in the last states");
    // Motors are cut in two steps, and not in one.
    assert_eq!(controls.order(json!("cut")).0["ok"], json!(false));
    assert_eq!(controls.order(json!("arm_cut")).0["ok"], json!(true));
    assert_eq!(controls.order(json!("cut")).0["ok"], json!(true));
    let summary = flight.join().unwrap().summary;
    assert_eq!((summary.outcome, summary.cause.as_str()), (Outcome::Aborted, "the operator cut the motors"));
    cockpit.end(&FlightEnd {
        outcome: "aborted".to_owned(),
        result: vec!["aborted".to_owned()],
        flight_time_s: summary.finished_at_s,
        path_length_m: summary.path_length_m,
        files: "/home/somebody/flights/001".to_owned(),
        problems: vec!["cannot write /home/somebody/flights/001/video.mp4".to_owned()],
    });
    // Whoever flew is told what was not recorded, and why.
    let failed = watch.wait("what failed", |message| message["recording"] == json!(true));
    assert!(failed["text"].as_str().unwrap().contains("cannot write /home/somebody"), "{failed}");
    let end = watch.wait("the end", |message| message["type"] == "end");
    assert_eq!((&end["incomplete"], &end["t"]), (&json!(true), &json!(summary.finished_at_s)));
    let files =
        |socket: &mut Socket| socket.wait("where the files are", |message| message["text"].to_string().contains("/home/"));
    files(&mut watch);
    assert!(controls.order(json!("hold")).0["ok"] == json!(false), "the flight is over");
    // What a spectator was told until the end does not say where files are, but that the recording is not complete.
    let end = looks.wait("the end", |message| {
        assert!(!message.to_string().contains("/home/"), "{message}");
        message["type"] == "end"
    });
    assert_eq!(end["incomplete"], json!(true));
    drop(cockpit);
    while let Some(message) = looks.next() {
        assert!(!message.to_string().contains("/home/"), "{message}");
    }
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_landing_goes_on_when_its_page_is_lost() {
    let (cockpit, mut controls, mut watch) = opened();
    let flight = flown(&cockpit, true);
    // High enough that it lands for longer than the loss goes unnoticed. This page answers beats only while it waits for something.
    while watch.wait("a state", |message| message["type"] == "state")["phase"] != "flying" {
        controls.order(json!({"give": {"page": 0, "yes": false}}));
    }
    assert_eq!(controls.order(json!("land")).0["ok"], json!(true));
    phase(&mut watch, "landing");
    drop(controls);
    watch.wait("that it is noticed", |message| {
        message["text"] == "operator: left the controls, hold ignored: the landing goes on"
    });
    let summary = flight.join().unwrap().summary;
    assert_eq!((summary.outcome, summary.cause.as_str()), (Outcome::Aborted, "the operator ended the flight"));
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_flight_whose_only_page_is_lost_holds() {
    let (cockpit, mut controls, mut watch) = opened();
    let flight = flown(&cockpit, true);
    phase(&mut watch, "take_off");
    // Until now it has answered every beat.
    controls.order(json!({"give": {"page": 0, "yes": false}}));
    let lost = controls.answered;
    controls.alive = false;
    watch.wait("a hold", |message| {
        message["text"].as_str().is_some_and(|text| text.contains("connection to the pilot's page lost"))
    });
    let held = lost.elapsed();
    println!("the flight holds {} ms after the page's last answer", held.as_millis());
    watch.wait("the pilot's note", |message| message["text"] == "operator: left the controls, hold");
    // Another page with the address may take over, and ends it.
    let url = cockpit.urls().0;
    let mut other = Socket::open(cockpit.address(), "/control", json!({"token": url.split_once('#').unwrap().1}));
    assert_eq!(other.order(json!("ask")).0["ok"], json!(true));
    assert_eq!(other.order(json!("arm_cut")).0["ok"], json!(true));
    assert_eq!(other.order(json!("cut")).0["ok"], json!(true));
    assert_eq!(flight.join().unwrap().summary.outcome, Outcome::Aborted);
}
