//! Pipelines of GStreamer as cameras.

use std::process::Command;

use spf_camera::CameraState;
use spf_drone::frames::Frames as _;

use crate::address::own_address;
use crate::harness::{Program, camera, have, images, wait};

/// The width is no multiple of four, so that rows are padded.
#[test]
fn a_pipeline_is_received_at_once() {
    let camera = camera("gstreamer:videotestsrc is-live=true ! video/x-raw,width=322,height=240,framerate=15/1");
    images(&camera, 12, (322, 240));
    assert!(camera.report().codec == Some("raw") && !camera.report().recorded, "{:?}", camera.report());
    let (meta, photo) = camera.frames().newest().unwrap();
    let age = meta.received.since(meta.captured).as_secs_f64();
    // Its times may be those of an arrival, so that nothing is younger than the latency.
    assert!((0.1..0.6).contains(&age), "{age}");
    // The bars of the test picture: white at the left, and yellow beside it.
    let image = photo.pixels();
    let (white, yellow) = (image.pixel(10, 100).unwrap(), image.pixel(68, 100).unwrap());
    assert!(white.iter().all(|value| *value > 180) && yellow[0] > 180 && yellow[2] < 60, "{white:?} {yellow:?}");
}

#[test]
fn what_is_not_live_is_a_recording() {
    let camera = camera("gstreamer:videotestsrc ! video/x-raw,width=320,height=240,framerate=15/1 ! identity sync=true");
    images(&camera, 2, (320, 240));
    assert!(camera.report().recorded, "{:?}", camera.report());
}

/// Times of a stream from a network begin with its arrival: they say nothing about how long it took.
#[test]
fn a_stream_from_a_network_is_no_younger_than_the_latency() {
    let (port, host) = (own_address().port(), *own_address().ip());
    let camera = camera(&format!(
        "gstreamer:udpsrc port={port} address={host} ! application/x-rtp,media=video,encoding-name=RAW,sampling=RGB,depth=(string)8,\
         width=(string)160,height=(string)120,clock-rate=90000 ! rtpvrawdepay"
    ));
    let sender = format!(
        "videotestsrc is-live=true ! video/x-raw,format=RGB,width=160,height=120,framerate=15/1 ! rtpvrawpay ! udpsink host={host} port={port}"
    );
    if !have("gst-launch-1.0 (Debian's package `gstreamer1.0-tools`)", Command::new("gst-launch-1.0").arg("--version")) {
        return;
    }
    let _sender = Program::start("gst-launch-1.0", &sender.split(' ').collect::<Vec<_>>());
    images(&camera, 5, (160, 120));
    let (meta, _) = camera.frames().newest().unwrap();
    let age = meta.received.since(meta.captured).as_secs_f64();
    assert!(age >= 0.1 && !camera.report().recorded, "{age} {:?}", camera.report());
}

#[test]
fn a_pipeline_that_ends_or_is_wrong_says_so_without_its_passwords() {
    for (pipeline, expected) in [
        ("videotestsrc num-buffers=5", "closed the connection"),
        ("nosuchelement user-pw=pa55word", "no element \"nosuchelement\""),
        ("videotestsrc pattern=pa55word", "a property cannot have its value"),
        ("filesrc location=/none/pa55word ! decodebin", "a source or a device: not found"),
        ("rtspsrc location=rtsp://user:pa55word@127.0.0.1:1/s ! decodebin", "…"),
    ] {
        let camera = camera(&format!("gstreamer:{pipeline}"));
        wait("a failure", &camera, || matches!(camera.report().state, CameraState::Failed(_)));
        let report = format!("{:?}", camera.report());
        assert!(!report.contains("pa55word"), "{report}");
        assert!(expected == "…" || camera.report().last_failure.unwrap().why.contains(expected), "{report}");
    }
}
