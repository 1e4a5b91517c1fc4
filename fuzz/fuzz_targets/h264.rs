//! Any bytes as the video of a Tello: its datagrams, the access units that they make, and the decoder, which must refuse
//! what it cannot decode, and decode a good image afterwards.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_drone::tello::video::Joiner;
use spf_media::h264::Decoder;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut decoder) = Decoder::new() else { return };
    // As it comes, and as datagrams: the first byte says how long they are.
    let _ = decoder.decode(bytes);
    let (mut joiner, mut units) = (Joiner::default(), Vec::new());
    let length = bytes.first().map_or(1, |byte| 6 * usize::from(*byte) + 1);
    for datagram in bytes.get(1..).unwrap_or_default().chunks(length) {
        joiner.push(datagram, &mut units);
    }
    for unit in units {
        match decoder.decode(&unit.annex_b) {
            Ok(Some(image)) => assert_eq!(image.data().len(), image.width() as usize * image.height() as usize * 3),
            Ok(None) => {}
            Err(_) => joiner.refuse(),
        }
    }
});
