//! Any bytes as a stream of MAVLink, and any payloads in packets that are well-formed, to the driver and to the virtual vehicle's
//! parser: parsed or rejected, never a panic, and nothing is sent that moves a vehicle which nobody flies.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::time::Time;
use spf_drone::mavlink::vehicle::{Outgoing, Vehicle};
use spf_mavlink::modes::Autopilot;
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
    for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
        let mut vehicle = Vehicle::new(Time::ZERO, autopilot.hold(), [1, 191], 3.0, false);
        let mut now = Time::ZERO;
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
                assert!(!matches!(sent, Outgoing::Setpoint(_)), "nobody flies it");
                let _ = sent.body([1, 1], now);
            }
        }
    }
});
