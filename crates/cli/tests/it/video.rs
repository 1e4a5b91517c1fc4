//! The video of a flight, read by a third-party tool.

use std::process::Command;

use crate::harness::{Lab, skip};

#[test]
#[ignore = "needs ffprobe: .ci/interop runs it"]
fn a_video_has_ten_images_a_second_of_the_whole_flight() {
    if Command::new("ffprobe").arg("-version").output().is_err() {
        return skip("ffprobe");
    }
    let lab = Lab::new();
    let run = lab.spf(&["fly", "fly to the red crane", "--max-time", "8", "--json", "--out", "mine"]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let line = run.stderr.lines().rev().find(|line| line.ends_with("ended")).unwrap();
    let ended: f64 = line.split_whitespace().next().unwrap().parse().unwrap();
    let mut probe = Command::new("ffprobe");
    probe.args(["-v", "error", "-select_streams", "v", "-count_frames", "-of", "json"]);
    probe.args(["-show_entries", "stream=codec_name,nb_read_frames,width,height,start_time:format=duration"]);
    let output = probe.arg(lab.path("mine/video.mp4")).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    let probed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let stream = &probed["streams"][0];
    let number = |value: &serde_json::Value| value.as_str().unwrap().parse::<f64>().unwrap();
    assert_eq!(stream["codec_name"], "h264");
    assert_eq!(number(&stream["start_time"]), 0.0);
    // It contains take-off, waiting and landing, each second with ten images or more.
    let (images, duration) = (number(&stream["nb_read_frames"]), number(&probed["format"]["duration"]));
    assert!((duration - ended).abs() < 0.25, "{duration} s of video, {ended} s of flight");
    assert!(images >= 10.0 * duration - 1.0, "{images} pictures in {duration} s");
}
