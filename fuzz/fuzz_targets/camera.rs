//! Any bytes as what a camera sends, as its address and as its calibration: read or rejected, never a panic, and never more memory than allowed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_camera::{Calibration, CameraUrl};
use spf_camera::mjpeg::PartReader;
use spf_camera::rtp::Receiver;
use spf_camera::ts::TsReceiver;
use spf_core::time::Time;

fuzz_target!(|bytes: &[u8]| {
    // The first byte says what it is, the second how long the pieces are.
    let [kind, length, rest @ ..] = bytes else { return };
    let length = 6 * usize::from(*length) + 1;
    match kind % 5 {
        0 => {
            let (mut receiver, mut units) = (Receiver::default(), Vec::new());
            for (number, datagram) in rest.chunks(length).enumerate() {
                receiver.push(Time::from_millis(5 * number as u64), datagram, &mut units);
            }
        }
        1 => {
            let (mut receiver, mut units) = (TsReceiver::default(), Vec::new());
            rest.chunks(length).for_each(|piece| receiver.push(Time::ZERO, piece, &mut units));
        }
        2 => {
            let (mut reader, mut parts) = (PartReader::default(), Vec::new());
            rest.chunks(length).for_each(|piece| reader.push(piece, &mut parts));
        }
        3 => {
            if let Ok(url) = String::from_utf8_lossy(rest).parse::<CameraUrl>() {
                drop((url.to_string(), format!("{url:?}")));
            }
        }
        _ => {
            if let Ok(read) = Calibration::parse(&String::from_utf8_lossy(rest)) {
                assert!(read.fx > 0.0 && read.fy > 0.0 && !read.to_string().is_empty());
            }
        }
    }
});
