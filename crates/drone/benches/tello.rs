//! Cost of one image of a Tello's video, from datagrams to RGB, and of its state lines. `TELLO_VIDEO` names a recorded
//! video to use instead of a synthetic one (`docs/bench/tello_video.py` records it, and decodes it with PyAV).

use divan::{Bencher, black_box};
use spf_core::time::Time;
use spf_drone::frames::usable::why_unusable;
use spf_drone::tello::state::State;
use spf_drone::tello::video::Joiner;
use spf_media::Rgb;
use spf_media::h264::{Decoder, Encoder, EncoderSettings, nal_units};

fn main() {
    divan::main();
}

/// A room-like image that moves a little from frame to frame.
fn room(shift: u32) -> Rgb {
    let mut image = Rgb::new(960, 720);
    for y in 0..720 {
        for x in 0..960 {
            let (u, v) = (x + 3 * shift, y);
            let furniture = u / 120 % 3 == 1 && v > 250 && v < 600;
            let edge = u % 120 < 4 || v % 90 < 3;
            let colour = match (furniture, edge, v > 450) {
                (true, false, _) => [(150 + u % 17) as u8, 60, 50],
                (_, true, _) => [40, 45, 50],
                (false, false, true) => [(110 + v % 13) as u8, 115, 125],
                (false, false, false) => [(190 + u % 11) as u8, 190, (170 + v % 7) as u8],
            };
            image.set_pixel(x, y, colour);
        }
    }
    image
}

/// A NAL unit split as by a Tello: a full datagram is never the last.
fn datagrams(nal: &[u8]) -> Vec<Vec<u8>> {
    let mut bytes = [&[0, 0, 0, 1][..], nal].concat();
    if bytes.len().is_multiple_of(1460) {
        bytes.push(0);
    }
    bytes.chunks(1460).map(<[u8]>::to_vec).collect()
}

/// Datagrams of one second of images.
fn second() -> Vec<Vec<Vec<u8>>> {
    let settings = EncoderSettings { key_interval: 1.0, ..EncoderSettings::for_size(960, 720, 30.0) };
    let mut encoder = Encoder::new(settings).expect("the size is valid");
    let cut = |unit: &[u8]| nal_units(unit).flat_map(datagrams).collect();
    (0..30)
        .map(|n| cut(&encoder.encode(Time::from_millis(33 * u64::from(n)), &room(n)).expect("the codec encodes").annex_b))
        .collect()
}

/// Datagrams of a recording's images: NAL units behind start codes, split as by a Tello.
fn recorded(path: &std::ffi::OsStr) -> Vec<Vec<Vec<u8>>> {
    let stream = std::fs::read(path).expect("TELLO_VIDEO can be read");
    let (mut images, mut waiting) = (Vec::new(), Vec::new());
    for nal in nal_units(&stream) {
        waiting.extend(datagrams(nal));
        if matches!(nal.first().map(|first| first & 31), Some(1 | 5)) {
            images.push(std::mem::take(&mut waiting));
        }
    }
    images
}

#[divan::bench]
fn video_to_rgb(bencher: Bencher<'_, '_>) {
    let stream = std::env::var_os("TELLO_VIDEO").map_or_else(second, |path| recorded(&path));
    let (mut joiner, mut decoder) = (Joiner::default(), Decoder::new().expect("the codec is there"));
    let (mut units, mut next) = (Vec::new(), 0);
    bencher.bench_local(|| {
        units.clear();
        for datagram in &stream[next % stream.len()] {
            joiner.push(datagram, &mut units);
        }
        next += 1;
        units.iter().filter_map(|unit| decoder.decode(&unit.annex_b).ok().flatten()).last()
    });
}

/// Part of the cost of each frame besides decoding.
#[divan::bench]
fn whether_a_frame_is_usable(bencher: Bencher<'_, '_>) {
    let image = room(0);
    bencher.bench(|| why_unusable(black_box(&image)));
}

#[divan::bench]
fn state_line(bencher: Bencher<'_, '_>) {
    let line = b"mid:-1;x:-100;y:-100;z:-100;mpry:-1,-1,-1;pitch:0;roll:0;yaw:-3;vgx:0;vgy:0;vgz:1;templ:58;temph:60;tof:71;h:50;bat:82;baro:-57.14;time:14;agx:17.00;agy:-4.00;agz:-956.00;\r\n";
    bencher.bench(|| State::read(black_box(line)));
}
