//! Any sequence of what can happen to the link to a Tello: datagrams, commands, silence, passing time. It never panics,
//! never says anything but the protocol's words, never holds more than a few events, and an emergency is repeated.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::command::{Command, Setpoint};
use spf_core::craft::Craft;
use spf_envelope::{Envelope, Limits};
use spf_core::telemetry::Telemetry;
use spf_core::time::{Duration, Time};
use spf_drone::tello::conversation::Order;
use spf_drone::tello::link::Link;
use spf_drone::tello::sticks::Calibration;

const STATES: [&str; 4] = [
    "pitch:0;roll:0;yaw:0;vgx:0;vgy:0;vgz:0;templ:60;temph:62;tof:10;h:0;bat:80;baro:1.0;time:3;agx:0.0;agy:0.0;agz:-1000.0;",
    "pitch:0;roll:0;yaw:90;vgx:5;vgy:0;vgz:0;templ:60;temph:62;tof:90;h:80;bat:50;baro:1.0;time:9;agx:0.0;agy:0.0;agz:-999.0;",
    "pitch:-3;roll:2;yaw:-179;vgx:-9;vgy:3;vgz:1;tof:6553;h:200;bat:5;time:10;agx:1.0;agy:0.0;agz:-990.0;",
    "h:80;time:12;",
];
const ANSWERS: [&str; 6] = ["ok", "error", "error Motor stop", "error No valid imu", "forced stop", "out of range"];

fuzz_target!(|bytes: &[u8]| {
    let mut link = Link::new(Calibration::default());
    let mut envelope = Envelope::new(Limits::for_craft(&Craft::tello()), Craft::tello());
    let mut now = Time::ZERO;
    let mut bytes = bytes.iter().copied();
    while let Some(step) = bytes.next() {
        let mut next = || bytes.next().unwrap_or_default();
        now = now + Duration::from_millis(u64::from(next()) * if step & 0x80 == 0 { 1 } else { 50 });
        match step & 0x0f {
            0 => link.handle_state(now, STATES[usize::from(next()) % STATES.len()].as_bytes()),
            1 => link.handle_answer(now, ANSWERS[usize::from(next()) % ANSWERS.len()].as_bytes()),
            2 => {
                let length = next();
                let datagram: Vec<u8> = (0..length).map(|_| next()).collect();
                link.handle_state(now, &datagram);
            }
            3 => {
                let length = next();
                let datagram: Vec<u8> = (0..length).map(|_| next()).collect();
                link.handle_answer(now, &datagram);
            }
            4 => apply(&mut link, &mut envelope, now, Command::TakeOff),
            5 => apply(&mut link, &mut envelope, now, Command::Land),
            6 => apply(&mut link, &mut envelope, now, Command::EmergencyStop),
            7 => {
                let part = |byte: u8| (f64::from(byte) - 128.0) / 32.0;
                let setpoint = Setpoint { right: part(next()), forward: part(next()), up: part(next()), yaw_rate: part(next()) };
                apply(&mut link, &mut envelope, now, Command::Setpoint(setpoint));
            }
            8 => link.heartbeat(now),
            9 => link.adopt(now),
            10 => link.fail(now),
            11 => link.leave(now),
            12 => link.ask_for_video(),
            13 => link.ask_for_key_frame(),
            14 => link.order(Order::quick("streamon")),
            _ => while link.take_event().is_some() {},
        }
        let mut said = 0;
        while let Some(text) = link.poll(now) {
            said += 1;
            assert!(said < 100, "it does not stop talking at one instant");
            assert!(text.len() < 64 && text.bytes().all(|byte| byte.is_ascii_graphic() || byte == b' '), "{text:?}");
            if let Some(sticks) = text.strip_prefix("rc ") {
                let sticks: Vec<i32> = sticks.split(' ').map(|stick| stick.parse().expect("a whole number")).collect();
                assert!(sticks.len() == 4 && sticks.iter().all(|stick| (-100..=100).contains(stick)), "{text}");
            }
        }
        while link.take_notice().is_some() {}
    }
    assert!(std::iter::from_fn(|| link.take_event()).count() <= 200, "events pile up");
});

fn apply(link: &mut Link, envelope: &mut Envelope, now: Time, command: Command) {
    envelope.observe_telemetry(now, &Telemetry { time: now, battery: Some(0.8), ..Telemetry::default() });
    if let Ok(clearance) = envelope.clear(now, command) {
        link.apply(now, &clearance.cleared);
    }
}
