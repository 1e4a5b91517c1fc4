//! A network beside a flight delays nothing, and one that fails is left out.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use spf_core::mono_depth::DepthKind;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_drone::frames::Frames;

use super::*;

/// A network that waits until it may go on, if it has to, and says which frames it got.
struct Fake {
    seen: Arc<Mutex<Vec<u64>>>,
    go_on: Option<Receiver<()>>,
    fails: bool,
}

impl EstimatesDepth for Fake {
    fn name(&self) -> &str {
        "fake.onnx"
    }

    fn size(&self) -> (u32, u32) {
        (8, 6)
    }

    fn estimate(&mut self, frame: (FrameId, Time), camera: &Camera, image: &Rgb) -> Result<MonoDepth, String> {
        assert_eq!((image.width(), image.height()), (8, 6));
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

fn plan(fake: Fake, period: u64) -> DepthPlan {
    DepthPlan { network: Box::new(fake), period: Duration::from_millis(period), latency: Duration::from_millis(400) }
}

fn frame(id: u64) -> Event {
    let captured = Time::from_millis(100 * id);
    Event::Frame(FrameMeta {
        id: FrameId(id),
        captured,
        received: captured,
        capture_counter: id,
        width: 16,
        height: 12,
        unusable: None,
    })
}

fn flying(phase: FlightPhase) -> Event {
    Event::Telemetry(Telemetry { phase, ..Telemetry::default() })
}

type Seen = Arc<Mutex<Vec<u64>>>;

fn fake(fails: bool) -> (Fake, Seen) {
    let seen = Seen::default();
    (Fake { seen: seen.clone(), go_on: None, fails }, seen)
}

#[test]
fn in_virtual_time_the_rate_and_the_latency_are_those_stated() {
    let (fake, seen) = fake(false);
    let mut depth = VirtualDepth::new(plan(fake, 500), Camera::quad(), Arc::new(Grey));
    depth.event(Time::ZERO, &frame(0));
    depth.event(Time::ZERO, &flying(FlightPhase::Flying));
    let mut arrived = Vec::new();
    for n in 1..=20_u64 {
        let now = Time::from_millis(100 * n);
        depth.event(now, &frame(n));
        while let Some(Event::MonoDepth(estimate)) = depth.take(now) {
            arrived.push((n, estimate.frame.0, estimate.captured));
        }
        assert!(depth.next_at().is_none_or(|at| at > now));
    }
    assert_eq!(*seen.lock().unwrap(), [1, 6, 11, 16]);
    assert_eq!(arrived, [1, 6, 11, 16].map(|n| (n + 4, n, Time::from_millis(100 * n))));
    depth.event(Time::from_millis(9000), &flying(FlightPhase::Landing));
    depth.event(Time::from_millis(9000), &frame(90));
    assert_eq!(seen.lock().unwrap().len(), 4, "nothing on the ground");
}

#[test]
fn a_network_that_fails_three_times_in_a_row_is_left_out() {
    let (fake, seen) = fake(true);
    let mut depth = VirtualDepth::new(plan(fake, 100), Camera::quad(), Arc::new(Grey));
    depth.event(Time::ZERO, &flying(FlightPhase::Flying));
    (0..50).for_each(|n| depth.event(Time::from_millis(500 * n), &frame(n)));
    assert_eq!((seen.lock().unwrap().len(), depth.next_at()), (3, None));
}

#[test]
fn a_network_that_takes_ten_seconds_is_left_out() {
    let (fake, seen) = fake(false);
    let mut estimator = Estimator::new(Box::new(fake), Camera::quad());
    let Event::Frame(meta) = frame(1) else { return };
    let photo = Grey.photo(FrameId(1)).unwrap();
    for _ in 0..2 {
        assert_eq!(estimator.estimate(&meta, &photo, || Duration::from_secs(10)), None);
    }
    // One in time, and the count begins again.
    assert!(estimator.estimate(&meta, &photo, || Duration::from_millis(900)).is_some());
    for left_out in [false, false, true] {
        assert_eq!(estimator.estimate(&meta, &photo, || Duration::from_secs(10)), None);
        assert_eq!(estimator.is_over(), left_out);
    }
    assert_eq!(seen.lock().unwrap().len(), 6);
}

/// While the network works, the flight leaves frames, of which it then takes the newest. When the flight ends, nobody waits for it.
#[test]
fn the_flight_never_waits_for_the_network() {
    let seen = Seen::default();
    let (release, go_on): (Sender<()>, _) = channel();
    let (events, arrived) = channel();
    let fake = Fake { seen: seen.clone(), go_on: Some(go_on), fails: false };
    let began = Instant::now();
    let mut depth = DepthThread::start(began, plan(fake, 1), Camera::quad(), Arc::new(Grey), events).unwrap();
    depth.event(&flying(FlightPhase::Flying));
    depth.event(&frame(1));
    while seen.lock().unwrap().is_empty() {
        assert!(began.elapsed() < Duration::from_secs(10));
        std::thread::yield_now();
    }
    (2..2000).for_each(|n| depth.event(&frame(n)));
    release.send(()).unwrap();
    let first = arrived.recv_timeout(Duration::from_secs(10)).unwrap().1;
    assert!(matches!(first, Event::MonoDepth(estimate) if estimate.frame == FrameId(1)));
    release.send(()).unwrap();
    let second = arrived.recv_timeout(Duration::from_secs(10)).unwrap().1;
    assert!(matches!(second, Event::MonoDepth(estimate) if estimate.frame == FrameId(1999)));
    depth.event(&frame(2000));
    while seen.lock().unwrap().len() < 3 {
        assert!(began.elapsed() < Duration::from_secs(20));
        std::thread::yield_now();
    }
    // It works on a third one, which it never finishes by itself.
    drop(depth);
    assert!(arrived.try_recv().is_err());
    drop(release);
    assert!(arrived.recv_timeout(Duration::from_secs(10)).is_err(), "the thread has ended");
}
