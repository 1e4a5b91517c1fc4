//! A camera of this machine. The device is emulated between program and kernel (`v4l2.c`), by the kernel's own header; ffmpeg, which
//! knows nothing of this, captures from it what was put in.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use std::path::PathBuf;
use std::process::Command;

use crate::harness::{Lab, Run, skip};

const LENGTH: usize = 320 * 240 * 2;

/// The emulated camera.
struct Camera {
    lab: Lab,
    library: PathBuf,
}

impl Camera {
    /// None, with a notice, without a C compiler or ffmpeg.
    fn new() -> Option<Self> {
        let lab = Lab::new();
        let library = lab.path("v4l2.so");
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/v4l2.c");
        let compiled = Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).args([source, "-ldl"]).status();
        if !compiled.is_ok_and(|status| status.success()) {
            skip("cc with the kernel's headers");
            return None;
        }
        if Command::new("ffmpeg").arg("-version").output().is_err() {
            skip("ffmpeg");
            return None;
        }
        Some(Self { lab, library })
    }

    fn ffmpeg(&self, args: &[&str]) {
        let args = [&["-v", "error", "-y"], args].concat();
        let output = Command::new("ffmpeg").args(args).current_dir(self.lab.path("")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }

    /// What the camera sends.
    fn frames(&self, frames: &[Vec<u8>]) {
        let framed: Vec<u8> = frames.iter().flat_map(|frame| [&(frame.len() as u32).to_le_bytes()[..], frame].concat()).collect();
        self.lab.write("frames", framed);
    }

    /// A program that has the camera.
    fn with(&self, mut command: Command, format: &str, fault: &str) -> Run {
        command.env("LD_PRELOAD", &self.library).env("FAKE_FRAMES", self.lab.path("frames"));
        Run::of(&command.env("FAKE_FORMAT", format).env("FAKE_FAULT", fault).output().unwrap())
    }

    fn test(&self, address: &str, format: &str, fault: &str) -> Run {
        let command = self.lab.command(&["camera", "test", address, "--seconds", "0.7", "--overwrite"]);
        self.with(command, format, fault)
    }
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn an_uncompressed_webcam_is_received_with_the_kernel_s_times() {
    let Some(camera) = Camera::new() else { return };
    let source = ["-f", "lavfi", "-i", "testsrc=size=320x240:rate=15", "-frames:v", "8"];
    camera.ffmpeg(&[&source[..], &["-pix_fmt", "yuyv422", "-f", "rawvideo", "sent"]].concat());
    let sent = camera.lab.read("sent");
    camera.frames(&sent.chunks_exact(LENGTH).map(<[u8]>::to_vec).collect::<Vec<_>>());
    // Somebody else's program finds a camera here.
    let mut other = Command::new("ffmpeg");
    other.args(["-v", "error", "-y", "-f", "v4l2", "-i", "/dev/video9", "-frames:v", "4", "-f", "rawvideo", "seen"]);
    other.current_dir(camera.lab.path(""));
    let run = camera.with(other, "YUYV", "");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(camera.lab.read("seen") == sent[..4 * LENGTH]);
    let run = camera.test("v4l2:/dev/video9", "YUYV", "");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.starts_with("image    320×240, YUYV\n"), "{}", run.stdout);
    // Each frame was 20 ms old when the device gave it.
    let age = run.stdout.lines().find_map(|line| line.strip_prefix("age      median ")).unwrap();
    let median: f64 = age.split(' ').next().unwrap().parse().unwrap();
    assert!((0.02..0.3).contains(&median) && age.ends_with("(by the camera's clock)"), "{age}");
    // The time of day is not that of the kernel's clock, so that it does not tell the age.
    let run = camera.test("v4l2:/dev/video9", "YUYV", "realtime");
    assert!(run.code == Some(0) && run.stdout.contains("age      median 0.2"), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("(assumed latency and delays)"), "{}", run.stdout);
    // Every second buffer is cut in half: half of the frames come.
    let run = camera.test("v4l2:/dev/video9?size=320x240&fps=30", "YUYV", "short");
    assert!(run.code == Some(0) && run.stdout.contains(" damaged ("), "{}{}", run.stdout, run.stderr);
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn a_webcam_without_huffman_tables_is_received_and_each_refusal_explained() {
    let Some(camera) = Camera::new() else { return };
    let source = ["-f", "lavfi", "-i", "testsrc=size=320x240:rate=15", "-frames:v", "4"];
    camera.ffmpeg(&[&source[..], &["-c:v", "mjpeg", "-huffman", "default", "-q:v", "5", "%d.jpg"]].concat());
    let without: Vec<Vec<u8>> = (1..=4).map(|n| without_tables(&camera.lab.read(&format!("{n}.jpg")))).collect();
    camera.frames(&without);
    let run = camera.test("v4l2:/dev/video9", "MJPG", "");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.starts_with("image    320×240, JPEG\n") && !run.stdout.contains(" rejected by"), "{}", run.stdout);
    for (address, format, fault, expected) in [
        ("v4l2:/dev/video9", "MJPG", "busy", "another program uses it: `fuser /dev/video9` names the process"),
        ("v4l2:/dev/video9?size=640x480", "MJPG", "", "it has no such size and rate; it has MJPG 320x240 30 fps"),
        ("v4l2:/dev/video9", "H264", "", "it sends H264; only MJPG and YUYV are read here: let ffmpeg or GStreamer send it"),
        ("v4l2:/dev/video9", "RG10", "", "it is a bare sensor (RG10), whose images libcamera makes"),
        ("v4l2:/dev/video-none", "MJPG", "", "there is no such device: plug the camera in"),
        ("v4l2:/dev/null", "MJPG", "", "this is no camera that gives images by itself; a webcam often has two devices"),
    ] {
        let run = camera.test(address, format, fault);
        assert!(run.code == Some(6) && run.stderr.contains(expected), "{address}: {}", run.stderr);
    }
    let run = camera.test("v4l2:/dev/video9", "MJPG", "short");
    assert!(run.code == Some(0) && run.stdout.contains(" damaged ("), "{}{}", run.stdout, run.stderr);
    // The end of the file is there, but a part before it is not.
    let run = camera.test("v4l2:/dev/video9", "MJPG", "gap");
    assert!(run.code == Some(0) && run.stdout.contains(" damaged ("), "{}{}", run.stdout, run.stderr);
    let rate: f64 =
        run.stdout.lines().find_map(|line| line.strip_prefix("rate     ")).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((0.0..22.0).contains(&rate), "half of 30: {}", run.stdout);
    // Unplugged after a third of a second.
    let run = camera.test("v4l2:/dev/video9", "MJPG", "gone");
    assert!(run.code == Some(0) && run.stderr.contains("the camera was unplugged"), "{}{}", run.stdout, run.stderr);
}

#[test]
#[ignore = "slow: a camera is reported 5 s after its last usable image"]
fn images_that_are_none_are_no_silence() {
    let Some(camera) = Camera::new() else { return };
    camera.frames(&[vec![128; LENGTH]]);
    for (fault, expected) in [
        ("long", "its images have 153616 bytes, expected 153600; try another size or MJPG"),
        ("stampless", "its images have no time stamp"),
    ] {
        let run = camera.test("v4l2:/dev/video9", "YUYV", fault);
        assert!(run.code == Some(6) && run.stderr.contains(expected), "{fault}: {}", run.stderr);
    }
}

/// A JPEG file without its Huffman tables, as webcams send it.
fn without_tables(file: &[u8]) -> Vec<u8> {
    let (mut sent, mut at) = (file[..2].to_vec(), 2);
    while file[at + 1] != 0xda {
        let end = at + 2 + usize::from(u16::from_be_bytes([file[at + 2], file[at + 3]]));
        if file[at + 1] != 0xc4 {
            sent.extend_from_slice(&file[at..end]);
        }
        at = end;
    }
    assert!(at > 2 && sent.len() < at);
    sent.extend_from_slice(&file[at..]);
    sent
}
