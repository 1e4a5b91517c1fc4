//! H.264 streams of third-party encoders.

use std::process::Command;

use spf_media::Rgb;
use spf_media::h264::{Decoder, nal_units};

use crate::ffmpeg::have_ffmpeg;

fn ffmpeg(arguments: &[&str]) -> Vec<u8> {
    let output = Command::new("ffmpeg").args(["-v", "error"]).args(arguments).arg("-").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Units with start codes, one image each.
fn units(stream: &[u8]) -> Vec<Vec<u8>> {
    let (mut units, mut open): (Vec<Vec<u8>>, Vec<u8>) = (Vec::new(), Vec::new());
    for nal in nal_units(stream) {
        open.extend([0, 0, 0, 1]);
        open.extend(nal);
        if matches!(nal[0] & 0x1f, 1 | 5) {
            units.push(std::mem::take(&mut open));
        }
    }
    units
}

/// By default x264 sends images in an order that differs from presentation order.
#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn images_with_b_frames_come_whole_and_in_order() {
    if !have_ffmpeg() {
        return;
    }
    let source = ["-f", "lavfi", "-i", "testsrc=size=160x120:rate=25:duration=1"];
    let form = ["-pix_fmt", "yuv420p", "-c:v", "libx264", "-x264-params", "slices=1:bframes=3", "-f", "h264"];
    let stream = ffmpeg(&[&source[..], &form[..]].concat());
    let file = std::env::temp_dir().join(format!("spf-b-frames-{}.h264", std::process::id()));
    std::fs::write(&file, &stream).unwrap();
    let raw = ffmpeg(&["-i", file.to_str().unwrap(), "-f", "rawvideo", "-pix_fmt", "gray"]);
    std::fs::remove_file(&file).unwrap();
    let expected: Vec<&[u8]> = raw.chunks_exact(160 * 120).collect();

    let mut decoder = Decoder::new().unwrap();
    let mut seen: Vec<Rgb> = units(&stream).iter().filter_map(|unit| decoder.decode_in_order(unit).unwrap()).collect();
    seen.extend(decoder.rest().unwrap());
    assert_eq!((seen.len(), expected.len()), (25, 25));
    // The clock in the test image advances: each decoded image is nearest to its own original.
    let apart = |image: &Rgb, grey: &[u8]| -> u64 {
        let luma = |p: &[u8]| (54 * u32::from(p[0]) + 183 * u32::from(p[1]) + 19 * u32::from(p[2])) >> 8;
        image.data().chunks_exact(3).zip(grey).map(|(p, g)| u64::from(luma(p).abs_diff(u32::from(*g)))).sum()
    };
    for (number, image) in seen.iter().enumerate() {
        let nearest = (0..25).min_by_key(|other| apart(image, expected[*other])).unwrap();
        assert_eq!(nearest, number);
    }
}
