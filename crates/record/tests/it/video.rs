//! The video file: third-party programs read it, its times are flight times, its bytes are reproducible.

// The configuration allows it in test functions; this is a helper of tests.
#![allow(clippy::print_stderr)]

use std::path::Path;
use std::process::Command;

use spf_core::time::{Duration, Time};
use spf_media::Rgb;
use spf_media::marks::{Hud, draw_hud};
use spf_record::{VideoError, VideoFacts, VideoWriter};

fn image(width: u32, height: u32, frame: u64) -> Rgb {
    let mut image = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let bar = (u64::from(x) + frame * 5) % u64::from(width) < 20;
            image.set_pixel(x, y, if bar { [230, 60, 20] } else { [x as u8, y as u8, 100] });
        }
    }
    draw_hud(&mut image, &Hud { title: "frame", status: &frame.to_string(), lines: &[], ..Hud::default() });
    image
}

/// Frames at irregular times: every 90 ms, from 0.5 s on, with a gap of 2 s after the twentieth.
fn time_of(frame: u64) -> Time {
    Time::from_millis(500 + frame * 90 + if frame >= 20 { 2000 } else { 0 })
}

fn record(path: &Path, frames: u64) -> VideoFacts {
    let mut video = VideoWriter::create(path, 320, 240, 10.0).unwrap();
    for frame in 0..frames {
        video.push(time_of(frame), &image(320, 240, frame)).unwrap();
    }
    video.finish().unwrap()
}

/// Whether a program exists; with `CI=true` it must.
fn have(program: &str) -> bool {
    let there = Command::new(program).arg("-version").output().is_ok();
    assert!(there || std::env::var("CI").as_deref() != Ok("true"), "`{program}` is missing: install Debian's package `ffmpeg`");
    if !there {
        eprintln!("NOT CHECKED: `{program}` is missing, so this test did not run");
    }
    there
}

fn ffprobe(path: &Path, entries: &str) -> Vec<String> {
    let output = Command::new("ffprobe")
        .args(["-v", "error", "-count_frames", "-select_streams", "v:0", "-of", "default=nw=1:nk=1", "-show_entries", entries])
        .arg(path)
        .output()
        .unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn ffprobe_reads_images_times_and_duration() {
    if !have("ffprobe") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video.mp4");
    let facts = record(&path, 60);
    // The last frame at 0.5 + 59·0.09 + 2 = 7.81 s, shown for 0.1 s.
    assert_eq!((facts.frames, facts.duration.as_millis()), (60, 7910));
    assert_eq!(facts.bytes, path.metadata().unwrap().len());
    let stream = ffprobe(&path, "stream=codec_name,codec_tag_string,width,height,pix_fmt,nb_frames,nb_read_frames");
    assert_eq!(stream, ["h264", "avc1", "320", "240", "yuv420p", "60", "60"]);
    let duration: f64 = ffprobe(&path, "format=duration")[0].parse().unwrap();
    assert!((duration - 7.91).abs() < 1e-3, "{duration}");
    let times: Vec<f64> = ffprobe(&path, "frame=pts_time").iter().map(|time| time.parse().unwrap()).collect();
    assert_eq!(times.len(), 60);
    for (frame, time) in (0..).zip(times) {
        // The first image is shown from the start.
        let expected = if frame == 0 { 0.0 } else { time_of(frame).as_secs_f64() };
        assert!((time - expected).abs() < 1e-4, "frame {frame} at {time}, not {expected}");
    }
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn ffmpeg_decodes_what_was_pushed() {
    if !have("ffmpeg") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video.mp4");
    record(&path, 30);
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-xerror", "-i"])
        .arg(&path)
        .args(["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .output()
        .unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    let images: Vec<&[u8]> = output.stdout.chunks_exact(320 * 240 * 3).collect();
    assert_eq!(images.len(), 30);
    for (frame, decoded) in (0..).zip(images) {
        let wanted = image(320, 240, frame);
        let error: u64 = decoded.iter().zip(wanted.data()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        let mean = error as f64 / decoded.len() as f64;
        assert!(mean < 6.0, "frame {frame} differs by {mean} on average");
    }
}

#[test]
fn the_same_flight_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (folder.path().join("1.mp4"), folder.path().join("2.mp4"));
    record(&one, 25);
    record(&other, 25);
    assert!(std::fs::read(one).unwrap() == std::fs::read(other).unwrap());
}

#[test]
fn images_of_another_size_are_scaled() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video.mp4");
    let mut video = VideoWriter::create(&path, 160, 120, 10.0).unwrap();
    video.push(Time::ZERO, &image(320, 240, 0)).unwrap();
    assert_eq!(video.finish().unwrap().duration, Duration::from_millis(100));
}

#[test]
fn an_image_out_of_order_is_refused_and_the_next_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let mut video = VideoWriter::create(&folder.path().join("video.mp4"), 160, 120, 10.0).unwrap();
    let image = Rgb::new(160, 120);
    video.push(Time::from_millis(100), &image).unwrap();
    assert!(matches!(video.push(Time::from_millis(100), &image), Err(VideoError::Order { .. })));
    video.push(Time::from_millis(200), &image).unwrap();
    assert_eq!(video.finish().unwrap().frames, 2);
}

#[test]
fn a_flight_without_an_image_leaves_no_video() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video.mp4");
    assert_eq!(VideoWriter::create(&path, 160, 120, 10.0).unwrap().finish().unwrap().frames, 0);
    assert!(!path.exists());
}

#[test]
fn what_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = VideoWriter::create(&folder.path().join("none/video.mp4"), 160, 120, 10.0).unwrap_err();
    assert!(matches!(error, VideoError::Write { .. }) && error.to_string().contains("none/video.mp4"), "{error}");
    let error = VideoWriter::create(&folder.path().join("video.mp4"), 161, 120, 10.0).unwrap_err();
    assert!(matches!(error, VideoError::Encode { .. }), "{error}");
}
