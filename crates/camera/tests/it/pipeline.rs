//! Pipelines of GStreamer as cameras.

use spf_camera::CameraState;
use spf_drone::frames::Frames as _;

use crate::harness::{camera, images, wait};

/// The width is no multiple of four, so that rows are padded.
#[test]
fn a_pipeline_is_received_at_once() {
    let camera = camera("gstreamer:videotestsrc is-live=true ! video/x-raw,width=322,height=240,framerate=15/1");
    images(&camera, 12, (322, 240));
    assert!(camera.report().own_clock && camera.report().codec == Some("raw"), "{:?}", camera.report());
    let (meta, photo) = camera.frames().newest().unwrap();
    let age = meta.received.since(meta.captured).as_secs_f64();
    assert!(age < 0.5, "{age}");
    // The bars of the test picture: white at the left, and yellow beside it.
    let image = photo.pixels();
    let (white, yellow) = (image.pixel(10, 100).unwrap(), image.pixel(68, 100).unwrap());
    assert!(white.iter().all(|value| *value > 180) && yellow[0] > 180 && yellow[2] < 60, "{white:?} {yellow:?}");
}

#[test]
fn a_pipeline_that_ends_or_is_wrong_says_so_without_its_passwords() {
    for (pipeline, expected) in [
        ("videotestsrc num-buffers=5", "closed the connection"),
        ("nosuchelement user-pw=pa55word", "no element \"nosuchelement\""),
        ("videotestsrc pattern=pa55word", "a property cannot have its value"),
        ("rtspsrc location=rtsp://user:pa55word@127.0.0.1:1/s ! decodebin", "…"),
    ] {
        let camera = camera(&format!("gstreamer:{pipeline}"));
        wait("a failure", &camera, || matches!(camera.report().state, CameraState::Failed(_)));
        let report = format!("{:?}", camera.report());
        assert!(!report.contains("pa55word"), "{report}");
        assert!(expected == "…" || camera.report().last_failure.unwrap().contains(expected), "{report}");
    }
}
