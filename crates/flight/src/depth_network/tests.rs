//! A network beside a flight delays nothing, one that fails is left out, and what comes of it is depth in metres of the right frame.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::depth::{CameraAxes, DepthGrid, DepthSource};
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::gimbal::GimbalReport;
use spf_core::query::ImagePoint;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_detect::mono_depth::DepthKind;
use spf_drone::frames::Frames;
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;
use spf_media::Rgb;
use spf_motion::estimator::TelemetryAccuracy;

use super::scaling::Scaling;
use super::*;

/// A network that says 3 m, waits until it may go on, if it has to, and says which frames it got.
struct Fake {
    seen: Seen,
    go_on: Option<Receiver<()>>,
    fails: bool,
}

impl EstimatesDepth for Fake {
    fn name(&self) -> &str {
        "fake.onnx"
    }

    fn estimate(&mut self, frame: (FrameId, Time), camera: &Camera, photo: &Photo) -> Result<MonoDepth, String> {
        assert_eq!(photo.size(), (16, 12));
        self.seen.lock().unwrap().push(frame.0.0);
        if self.go_on.as_ref().is_some_and(|go_on| go_on.recv().is_err()) || self.fails {
            return Err("it fails".to_owned());
        }
        Ok(MonoDepth::new(frame, camera, DepthKind::Metric, (8, 6), &[3.0; 48]).unwrap())
    }
}

struct Grey;

impl Frames for Grey {
    fn photo(&self, _: FrameId) -> Option<Photo> {
        Some(Photo::received(Arc::new(Rgb::filled(16, 12, [90; 3]))))
    }

    fn newest(&self) -> Option<(FrameMeta, Photo)> {
        None
    }
}

/// A craft that reports what is left to report.
#[derive(Default)]
struct Scripted(VecDeque<(Time, DroneEvent)>);

impl Drone for Scripted {
    fn name(&self) -> &str {
        "scripted"
    }

    fn capabilities(&self) -> Capabilities {
        about()
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(Grey)
    }

    fn apply(&mut self, _: Time, _: &Cleared<Command>) -> Result<(), DroneError> {
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.0.pop_front_if(|(at, _)| *at <= until)
    }

    fn next_event_at(&self) -> Option<Time> {
        self.0.front().map(|(at, _)| *at)
    }
}

fn about() -> Capabilities {
    Capabilities { position: true, ..Capabilities::of(Craft::quad(), Camera::quad(), TelemetryAccuracy::EXACT) }
}

fn plan(period: u64) -> DepthPlan {
    let network: DepthFactory = Arc::new(|_, _| Err("the tests give their own".into()));
    let name = "fake".to_owned();
    DepthPlan {
        details: name.clone(),
        name,
        given_up: Arc::default(),
        network,
        period: Duration::from_millis(period),
        latency: LATENCY,
    }
}

fn meta(id: u64) -> FrameMeta {
    let captured = Time::from_millis(100 * id);
    FrameMeta { id: FrameId(id), captured, received: captured, capture_counter: id, width: 16, height: 12, unusable: None }
}

fn frame(id: u64) -> (Time, DroneEvent) {
    (Time::from_millis(100 * id), DroneEvent::Frame(meta(id)))
}

fn at(north: f64, up: f64) -> Pose {
    Pose { position: EnuPosition { north, up, ..EnuPosition::default() }, ..Pose::default() }
}

fn report(time: Time, phase: FlightPhase, pose: Pose) -> Telemetry {
    Telemetry { time, phase, position: Some(pose.position), attitude: pose.attitude, ..Telemetry::default() }
}

/// On the ground level with its lens, so that the ground tells no scale.
fn told(id: u64, phase: FlightPhase) -> (Time, DroneEvent) {
    let time = Time::from_millis(100 * id);
    (time, DroneEvent::Telemetry(report(time, phase, Pose::default())))
}

type Seen = Arc<Mutex<Vec<u64>>>;

fn fake(fails: bool) -> (Fake, Seen) {
    let seen = Seen::default();
    (Fake { seen: seen.clone(), go_on: None, fails }, seen)
}

/// All that the craft reports until `until`, as in virtual time.
fn reported(drone: &mut WithDepth, until: Time) -> Vec<(Time, DroneEvent)> {
    let mut all = Vec::new();
    while let Some(at) = drone.next_event_at().filter(|at| *at <= until) {
        all.extend(drone.next_event(at));
    }
    all
}

fn depths(events: &[(Time, DroneEvent)]) -> Vec<(Time, DepthGrid)> {
    let depth = |(at, event): &(Time, DroneEvent)| match event {
        DroneEvent::Depth(grid) => Some((*at, (**grid).clone())),
        _ => None,
    };
    events.iter().filter_map(depth).collect()
}

#[test]
fn in_virtual_time_the_rate_and_the_latency_are_those_stated() {
    let (fake, seen) = fake(false);
    let mut events = VecDeque::from([frame(0)]);
    for n in 1..=20 {
        events.extend([told(n, FlightPhase::Flying), frame(n)]);
    }
    events.extend([told(90, FlightPhase::Landing), frame(90)]);
    let count = events.len();
    let mut drone = WithDepth::in_virtual_time(Box::new(Scripted(events)), Box::new(fake), &plan(500));
    assert_eq!(drone.capabilities().depth, Some(12.0));
    let all = reported(&mut drone, Time::from_millis(9000));
    assert!(all.is_sorted_by_key(|(at, _)| *at));
    assert_eq!(*seen.lock().unwrap(), [1, 6, 11, 16], "nothing on the ground");
    let found = depths(&all);
    assert_eq!(all.len(), count + found.len(), "whatever the craft reports is passed on");
    let times: Vec<_> = found.iter().map(|(at, grid)| (*at, grid.captured)).collect();
    assert_eq!(times, [1, 6, 11, 16].map(|n| (Time::from_millis(100 * n + 400), Time::from_millis(100 * n))));
    for (_, grid) in found {
        assert_eq!((grid.check(), grid.source), (Ok(()), DepthSource::Network));
        assert!(grid.cm.iter().all(|cm| *cm == 300), "{:?}", grid.cm);
    }
}

#[test]
fn a_network_that_fails_three_times_in_a_row_is_left_out() {
    let (fake, seen) = fake(true);
    let mut events = VecDeque::from([told(0, FlightPhase::Flying)]);
    events.extend((1..50).map(|n| frame(5 * n)));
    let mut drone = WithDepth::in_virtual_time(Box::new(Scripted(events)), Box::new(fake), &plan(100));
    assert_eq!(depths(&reported(&mut drone, Time::from_millis(90_000))), []);
    assert_eq!((seen.lock().unwrap().len(), drone.next_event_at()), (3, None));
}

#[test]
fn a_network_that_takes_ten_seconds_is_left_out() {
    let (fake, seen) = fake(false);
    let mut estimator = Estimator::new(Box::new(fake), Camera::quad(), Arc::default());
    let (meta, photo) = (meta(1), Grey.photo(FrameId(1)).unwrap());
    for _ in 0..2 {
        assert_eq!(estimator.estimate(&meta, &photo, || Duration::from_secs(10)), None);
    }
    // One in time, and the count begins again.
    assert!(estimator.estimate(&meta, &photo, || Duration::from_millis(900)).is_some());
    for left_out in [false, false, true] {
        assert_eq!(estimator.estimate(&meta, &photo, || Duration::from_secs(10)), None);
        assert_eq!(estimator.is_over(), left_out);
    }
    assert_eq!(estimator.estimate(&meta, &photo, || Duration::ZERO), None);
    assert_eq!(seen.lock().unwrap().len(), 6);
}

/// While the network works, the flight leaves frames, of which it then takes the newest. When the flight ends, nobody waits for it.
#[test]
fn the_flight_never_waits_for_the_network() {
    let seen = Seen::default();
    let (release, go_on): (Sender<()>, _) = channel();
    let network = Fake { seen: seen.clone(), go_on: Some(go_on), fails: false };
    let began = Instant::now();
    let mut events = VecDeque::from([told(0, FlightPhase::Flying), frame(1)]);
    events.extend((1990..=2000).map(|n| told(n, FlightPhase::Flying)));
    let mut drone = WithDepth::in_a_thread(Box::new(Scripted(events)), Box::new(network), &plan(1)).unwrap();
    let now = Time::from_millis(200_000);
    let mut passed = 0;
    while drone.next_event(now).is_some() {
        passed += 1;
    }
    assert_eq!(passed, 13);
    let patient = |holds: &dyn Fn() -> bool| {
        while !holds() {
            assert!(began.elapsed() < Duration::from_secs(20));
            std::thread::yield_now();
        }
    };
    patient(&|| !seen.lock().unwrap().is_empty());
    (2..2000).for_each(|n| drone.frame(now, &meta(n)));
    release.send(()).unwrap();
    // The first one is of a frame that is too old by now.
    patient(&|| seen.lock().unwrap().len() == 2);
    assert_eq!(*seen.lock().unwrap(), [1, 1999]);
    release.send(()).unwrap();
    let mut found = None;
    while found.is_none() {
        assert!(began.elapsed() < Duration::from_secs(20));
        found = drone.next_event(now);
    }
    assert!(matches!(found, Some((_, DroneEvent::Depth(grid))) if grid.captured == Time::from_millis(199_900)));
    drone.frame(now, &meta(2000));
    patient(&|| seen.lock().unwrap().len() == 3);
    // It works on a third one, which it never finishes by itself.
    drop(drone);
    assert!(release.send(()).is_ok(), "the network still waits");
}

/// A wall to the north of the start, metres.
const WALL: f64 = 9.0;

/// What a network says of a wall and of level ground, seen at `pose`: a third of the depth, or the same everywhere if it knows nothing.
fn estimate(camera: &Camera, pose: Pose, captured: Time, knows: bool) -> MonoDepth {
    let axes = CameraAxes::new(camera, pose);
    let (width, height) = (48_usize, 36_usize);
    let value = |index: usize| {
        let place = |i: usize, of: usize| (i as f64 + 0.5) / of as f64;
        let ray = camera.ray(ImagePoint { u: place(index % width, width), v: place(index / width, height) });
        let along = axes.place(ray.right, 1.0, ray.up);
        let (north, down) = (along.north - pose.position.north, pose.position.up - along.up);
        let wall = if north > 0.0 { (WALL - pose.position.north) / north } else { f64::INFINITY };
        let ground = if down > 0.0 { pose.position.up / down } else { f64::INFINITY };
        if knows { (wall.min(ground) / 3.0) as f32 } else { 1.0 }
    };
    let output: Vec<f32> = (0..width * height).map(value).collect();
    MonoDepth::new((FrameId(1), captured), camera, DepthKind::Relative, (width, height), &output).unwrap()
}

/// Where a craft is that flies north at 1 m/s, 2 m high, from 5 m before the start.
fn place(seconds: f64) -> Pose {
    at(seconds - 5.0, 2.0)
}

/// Such a craft after 10 s.
fn flown() -> Scaling {
    let mut scaling = Scaling::new(&about());
    for n in 0..=100 {
        let time = Time::from_millis(100 * n);
        scaling.telemetry(time, &report(time, FlightPhase::Flying, place(time.as_secs_f64())));
    }
    scaling
}

/// Distances to the north of what a grid shows well above the ground, from where its frame was captured.
fn walls(grid: &DepthGrid, pose: Pose) -> Vec<f64> {
    let axes = CameraAxes::new(&grid.camera, pose);
    let places = grid.points().map(|(_, seen)| axes.place(seen.right, seen.forward, seen.up));
    places.filter(|place| place.up > 1.0).map(|place| place.north).collect()
}

#[test]
fn an_estimate_is_of_the_frame_that_it_saw_however_late_it_comes() {
    for late in [0.1, 1.0, 2.5] {
        let (mut scaling, captured, pose) = (flown(), Time::from_secs_f64(10.0 - late), place(10.0 - late));
        let grid = scaling.grid(Time::from_millis(10_000), &estimate(&Camera::quad(), pose, captured, true)).unwrap();
        assert_eq!((grid.captured, grid.source), (captured, DepthSource::Network));
        let walls = walls(&grid, pose);
        assert!(walls.len() > 20 && walls.iter().all(|north| (north - WALL).abs() < 0.8), "{late} s: {walls:?}");
        // What knows nothing has no scale.
        assert_eq!(scaling.grid(Time::from_millis(10_000), &estimate(&Camera::quad(), pose, captured, false)), None);
    }
}

#[test]
fn an_old_estimate_one_of_before_a_jump_and_one_beside_a_sensor_are_not_used() {
    let now = Time::from_millis(10_000);
    let of = |captured: f64| estimate(&Camera::quad(), place(captured), Time::from_secs_f64(captured), true);
    assert!(flown().grid(now, &of(7.5)).is_some());
    assert_eq!(flown().grid(now, &of(6.5)), None, "3.5 s old");
    let mut sensed = flown();
    sensed.sensed(now);
    assert_eq!(sensed.grid(now, &of(9.5)), None);
    assert!(sensed.grid(now + Duration::from_secs(2), &of(9.5)).is_some(), "the sensor has stopped");
    let mut jumped = flown();
    for n in 101..=110 {
        let time = Time::from_millis(100 * n);
        jumped.telemetry(time, &report(time, FlightPhase::Flying, at(500.0, 2.0)));
    }
    assert_eq!(jumped.grid(Time::from_millis(11_000), &of(9.5)), None);
}

/// The grid of a camera on a gimbal is one of a camera that is fixed to the craft, with another tilt.
#[test]
fn a_gimbal_tilts_the_camera_of_the_grid() {
    let camera = Camera::quad();
    let flown = |roll: f64| {
        let mut scaling = Scaling::new(&about());
        let attitude = Attitude { pitch: 0.1, roll, ..Attitude::default() };
        for n in 0..=20 {
            let time = Time::from_millis(100 * n);
            scaling.telemetry(time, &report(time, FlightPhase::Flying, Pose { attitude, ..at(0.0, 2.0) }));
        }
        scaling.gimbal(GimbalReport { measured: Time::from_millis(1900), tilt: 0.3, range: [-0.5, 1.5], aside: false });
        // What the camera sees: 0.3 below the horizon, whatever the craft's attitude.
        let sight = Pose { attitude: Attitude { pitch: camera.tilt - 0.3, ..Attitude::default() }, ..at(0.0, 2.0) };
        let grid = scaling.grid(Time::from_millis(2000), &estimate(&camera, sight, Time::from_millis(1900), true));
        grid.map(|grid| walls(&grid, Pose { attitude, ..at(0.0, 2.0) }))
    };
    let walls = flown(0.0).unwrap();
    assert!(walls.len() > 20 && walls.iter().all(|north| (north - WALL).abs() < 0.8), "{walls:?}");
    assert_eq!(flown(0.2), None, "no fixed camera sees this");
}
