//! Any bytes as a message between a Tello and its clients: parsed or rejected, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_drone::tello::answer::Answer;
use spf_drone::tello::state::State;
use spf_drone::tello::video::Joiner;
use spf_serve::tello::Firmware;
use spf_serve::tello::command::parse;

fuzz_target!(|bytes: &[u8]| {
    let _ = Answer::read(bytes);
    let _ = State::read(bytes);
    for firmware in [Firmware::V13, Firmware::V20, Firmware::V30] {
        let _ = parse(bytes, firmware);
    }
    // The first byte sets the length of datagrams.
    let mut joiner = Joiner::default();
    let mut units = Vec::new();
    let length = bytes.first().map_or(1, |byte| 6 * usize::from(*byte) + 1);
    for datagram in bytes.chunks(length) {
        joiner.push(datagram, &mut units);
    }
});
