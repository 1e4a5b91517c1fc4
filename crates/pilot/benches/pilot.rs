//! One tick of pilot, executor and envelope in flight. `cargo bench -p spf-pilot --bench pilot`

use divan::{Bencher, black_box};
use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{EnuPosition, EnuVelocity};
use spf_core::grounding::GroundingProfile;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_envelope::Limits;
use spf_motion::estimator::TelemetryAccuracy;
use spf_pilot::policy::spf::{Spf, SpfSettings};
use spf_pilot::{Action, Event, Pilot, PilotParts, PilotSettings, Preset};
use spf_space::avoid::PathShape;

fn main() {
    divan::main();
}

const PRESETS: [Preset; 2] = [Preset::Default, Preset::Paper];
const TICKS: usize = 8;
const TICK: Duration = Duration::from_millis(100);

fn telemetry(now: Time, phase: FlightPhase) -> Event {
    Event::Telemetry(Telemetry {
        time: now,
        position: Some(EnuPosition { up: 3.0, ..EnuPosition::default() }),
        velocity: Some(EnuVelocity::default()),
        yaw_rate: Some(0.0),
        height: Some(3.0),
        battery: Some(0.9),
        phase,
        ..Telemetry::default()
    })
}

fn frame(now: Time) -> Event {
    let counter = now.as_nanos();
    let (width, height) = (960, 720);
    Event::Frame(FrameMeta {
        id: FrameId(counter),
        captured: now,
        received: now,
        capture_counter: counter,
        width,
        height,
        unusable: None,
    })
}

/// Polls until nothing is left to do; true if a moving command was issued.
fn poll(pilot: &mut Pilot, now: Time) -> bool {
    let mut moves = false;
    while let Some(action) = pilot.poll(now) {
        match black_box(action) {
            Action::Command(cleared) => moves |= matches!(cleared.get(), Command::Setpoint(setpoint) if !setpoint.is_hold()),
            Action::Ask(query) => {
                let text = r#"{"status":"navigating","point":[400,700],"depth":10,"target":"red crane"}"#.to_owned();
                // The first is answered; in continuous mode the next one stays open while the craft flies.
                if query.id.0 == 0 {
                    pilot.handle(now, Event::Reply { id: query.id, text });
                }
            }
            _ => {}
        }
    }
    moves
}

/// A pilot that has just begun to fly a step of 10 m, and the time.
fn flying(preset: Preset) -> (Pilot, Time) {
    let (settings, craft) = (PilotSettings::preset(preset), Craft::quad());
    let policy = Spf::new(SpfSettings {
        step: settings.step,
        lifting: settings.lifting,
        shape: PathShape::Straight,
        avoid: false,
        confirm_done: settings.confirm_done,
        grounding: GroundingProfile::default(),
        image_size: None,
        craft,
        depth: settings.depth,
        near_m: settings.near_m,
        method: settings.method,
        keep_m: None,
        close_up: false,
    });
    let mut pilot = Pilot::new(PilotParts {
        settings,
        craft,
        senses: TelemetryAccuracy::quad(),
        camera: Camera::quad(),
        limits: Limits::for_craft(&craft),
        policy: Box::new(policy),
        steering: None,
        instruction: "fly to the red crane".to_owned(),
    });
    let mut now = Time::ZERO;
    for i in 0..200 {
        pilot.handle(now, telemetry(now, if i == 0 { FlightPhase::OnGround } else { FlightPhase::Flying }));
        pilot.handle(now, frame(now));
        if poll(&mut pilot, now) {
            return (pilot, now);
        }
        now += TICK;
    }
    panic!("it never flies");
}

/// Eight ticks between two reports of the craft; the figure per tick is an eighth of it.
#[divan::bench(args = PRESETS)]
fn eight_ticks(bencher: Bencher<'_, '_>, preset: Preset) {
    bencher.with_inputs(|| flying(preset)).bench_local_values(|(mut pilot, mut now)| {
        let mut moving = 0;
        for _ in 0..TICKS {
            now += TICK;
            moving += u32::from(poll(&mut pilot, now));
        }
        // A queue has a zero between two primitives.
        assert!(moving >= 6, "{moving} of {TICKS} ticks move");
        pilot
    });
}

/// The same with a report and a frame at every tick: the total cost of a loop at 10 Hz.
#[divan::bench(args = PRESETS)]
fn eight_ticks_with_reports_and_frames(bencher: Bencher<'_, '_>, preset: Preset) {
    bencher.with_inputs(|| flying(preset)).bench_local_values(|(mut pilot, mut now)| {
        for _ in 0..TICKS {
            now += TICK;
            pilot.handle(now, telemetry(now, FlightPhase::Flying));
            pilot.handle(now, frame(now));
            black_box(poll(&mut pilot, now));
        }
        pilot
    });
}
