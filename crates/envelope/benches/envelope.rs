//! Cost of the envelope per control tick (`docs/reference/performance.md`).

use divan::{Bencher, black_box};
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{EnuPosition, EnuVelocity};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::Time;
use spf_envelope::geofence::Geofence;
use spf_envelope::{Envelope, Limits};

fn main() {
    divan::main();
}

/// A fence with `corners` on a circle of 50 m; `None` for 0.
fn fence(corners: u32) -> Option<Geofence> {
    let point = |i: u32| {
        let angle = core::f64::consts::TAU * f64::from(i % corners) / f64::from(corners);
        format!("[{},{}]", 50.0 * libm::cos(angle), 50.0 * libm::sin(angle))
    };
    (corners > 0).then(|| {
        let ring: Vec<String> = (0..=corners).map(point).collect();
        let text = format!(r#"{{"type":"Polygon","coordinates":[[{}]]}}"#, ring.join(","));
        Geofence::from_geojson(&text).expect("a regular polygon is a fence")
    })
}

/// A quad in flight at `north` metres, with everything fresh at 1 s.
fn flying(corners: u32, north: f64) -> (Envelope, Telemetry) {
    let mut envelope = Envelope::new(Limits { geofence: fence(corners), ..Limits::default() }, Craft::quad());
    let mut telemetry = Telemetry { position: Some(EnuPosition::default()), ..Telemetry::default() };
    envelope.observe_telemetry(Time::ZERO, &telemetry);
    telemetry.time = Time::from_millis(1000);
    telemetry.phase = FlightPhase::Flying;
    telemetry.position = Some(EnuPosition { north, up: 3.0, east: 0.0 });
    telemetry.velocity = Some(EnuVelocity { north: 2.0, ..EnuVelocity::default() });
    envelope.observe_telemetry(telemetry.time, &telemetry);
    let frame = FrameMeta {
        id: FrameId(0),
        captured: telemetry.time,
        received: telemetry.time,
        capture_counter: 1,
        width: 960,
        height: 720,
        unusable: None,
    };
    envelope.observe_frame(telemetry.time, &frame);
    (envelope, telemetry)
}

const ASKED: Setpoint = Setpoint { right: 0.4, forward: 2.5, up: 0.3, yaw_rate: 0.5 };

/// One setpoint cleared: far from any limit, and at the fence, where it slides. Arguments: corners of the fence.
#[divan::bench(args = [0, 8, 64])]
fn clear_in_the_open(bencher: Bencher<'_, '_>, corners: u32) {
    let (mut envelope, telemetry) = flying(corners, 0.0);
    bencher.bench_local(|| envelope.clear_setpoint(black_box(telemetry.time), black_box(ASKED)));
}

#[divan::bench(args = [8, 64])]
fn clear_at_the_fence(bencher: Bencher<'_, '_>, corners: u32) {
    let (mut envelope, telemetry) = flying(corners, 47.0);
    bencher.bench_local(|| envelope.clear_setpoint(black_box(telemetry.time), black_box(ASKED)));
}

#[divan::bench]
fn reaction_and_deadline(bencher: Bencher<'_, '_>) {
    let (envelope, telemetry) = flying(8, 0.0);
    bencher.bench_local(|| {
        let now = black_box(telemetry.time);
        (envelope.reaction(now), envelope.next_deadline(now))
    });
}
