//! JPEG files as read by third-party programs.

use std::io::Write;
use std::process::{Command, Stdio};

use spf_media::{Jpeg, Rgb};

use crate::ffmpeg::have_ffmpeg;

/// Bright and dark blocks on a slope of colours.
fn image(width: u32, height: u32) -> Rgb {
    let mut image = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let block = if (x / 24 + y / 16) % 2 == 0 { 60 } else { 0 };
            image.set_pixel(x, y, [(x * 180 / width) as u8 + block, (y * 180 / height) as u8 + block, 90 + block]);
        }
    }
    image
}

/// The image as decoded by ffmpeg, which must not complain.
fn as_ffmpeg_sees(jpeg: &Jpeg) -> Rgb {
    let mut decoder = Command::new("ffmpeg")
        .args(["-v", "error", "-xerror", "-err_detect", "explode", "-f", "jpeg_pipe", "-i", "-"])
        .args(["-sws_flags", "accurate_rnd+full_chroma_int", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    decoder.stdin.take().unwrap().write_all(jpeg.bytes()).unwrap();
    let output = decoder.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    Rgb::from_raw(jpeg.width(), jpeg.height(), output.stdout).unwrap()
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn ffmpeg_reads_every_kind() {
    if !have_ffmpeg() {
        return;
    }
    for (width, height, quality) in [(96, 64, 95), (96, 64, 70), (101, 67, 85), (17, 31, 100), (1, 1, 60)] {
        let original = image(width, height);
        let seen = as_ffmpeg_sees(&Jpeg::encode(&original, quality).unwrap());
        let errors = original.data().iter().zip(seen.data()).map(|(a, b)| f64::from(a.abs_diff(*b)));
        let mean = errors.sum::<f64>() / original.data().len() as f64;
        assert!(mean < 4.0, "{width}×{height} at {quality}: {mean}");
    }
}
