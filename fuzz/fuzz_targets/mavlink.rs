//! Any bytes as a stream of MAVLink, and any payloads in packets that are well-formed, to the driver and to the virtual vehicle's
//! parser: parsed or rejected, never a panic, and nothing is sent that moves a vehicle which is only watched. A vehicle that flies
//! gets no setpoint that moves without one of the pilot.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_envelope::{Cleared, Envelope, Limits};
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_drone::mavlink::vehicle::{Outgoing, Vehicle};
use spf_mavlink::modes::Autopilot;
use spf_mavlink::report::Report;
use spf_mavlink::url::MavlinkUrl;
use spf_mavlink::wire::{Body, Decoder, Encoder};

/// Messages that the driver reads.
const READ: [u32; 15] = [0, 1, 22, 24, 30, 32, 33, 77, 132, 148, 230, 242, 245, 253, 111];

fuzz_target!(|bytes: &[u8]| {
    let _ = core::str::from_utf8(bytes).map(str::parse::<MavlinkUrl>);
    let mut decoder = Decoder::default();
    decoder.push(bytes);
    let mut encoder = Encoder::new([1, 1]);
    // The first byte of a piece selects a message, the second the length of its payload.
    let mut rest = bytes;
    while let [kind, length, after @ ..] = rest {
        let (payload, next) = after.split_at(after.len().min(usize::from(*length)));
        let id = READ[usize::from(*kind) % READ.len()];
        decoder.push(&encoder.frame(&Body { id, payload: payload.to_vec() }));
        rest = next;
    }
    for (autopilot, flies) in [Autopilot::Px4, Autopilot::ArduPilot].into_iter().flat_map(|it| [(it, false), (it, true)]) {
        let mut vehicle = Vehicle::new(Time::ZERO, autopilot.hold(), [1, 191], 3.0, false);
        let mut now = Time::ZERO;
        if flies {
            vehicle.handle(now, &Report::Parameter { name: "MIS_TAKEOFF_ALT".to_owned(), field: 2.5, kind: 9 });
            vehicle.engage(now);
            vehicle.apply(now, &take_off());
        }
        let mut decoder = Decoder::default();
        decoder.push(bytes);
        let mut encoder = Encoder::new([1, 1]);
        for piece in bytes.chunks(40) {
            let id = READ[usize::from(piece[0]) % READ.len()];
            decoder.push(&encoder.frame(&Body { id, payload: piece[1..].to_vec() }));
        }
        while let Some(packet) = decoder.next_packet() {
            now += core::time::Duration::from_millis(20);
            let _ = (packet.message(), packet.command());
            vehicle.handle(now, &packet.report());
            while let Some(sent) = vehicle.poll(now) {
                assert!(!matches!(sent, Outgoing::Setpoint(it) if !flies || !it.is_hold()), "nobody moves it");
                let _ = sent.body([1, 1], now);
            }
        }
    }
});

/// A take-off that the envelope has passed.
fn take_off() -> Cleared<Command> {
    let mut envelope = Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
    envelope.observe_telemetry(Time::ZERO, &Telemetry { battery: Some(0.8), ..Telemetry::default() });
    envelope.clear(Time::ZERO, Command::TakeOff).expect("nothing is in the way").cleared
}
