//! Streams of ffmpeg: RTP, MPEG-TS, MJPEG by HTTP, and the MP4 file of a phone.

use std::process::Command;
use std::time::Duration;

use spf_camera::film::Film;
use spf_camera::{CameraState, CameraUrl};
use spf_drone::frames::Frames as _;

use crate::address::own_address;
use crate::harness::{Program, camera, have, images, wait};

const SIZE: (u32, u32) = (320, 240);

fn have_ffmpeg() -> bool {
    have("ffmpeg (Debian's package `ffmpeg`)", Command::new("ffmpeg").arg("-version"))
}

/// Sends a test picture of 15 images a second, with a key frame each second, by these options.
fn send(options: &[&str]) -> Program {
    let source = ["-v", "error", "-re", "-f", "lavfi", "-i", "testsrc=size=320x240:rate=15"];
    Program::start("ffmpeg", &[&source, options].concat())
}

const H264: &[&str] = &["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-pix_fmt", "yuv420p", "-g", "15"];

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn rtp() {
    if !have_ffmpeg() {
        return;
    }
    let address = own_address();
    let camera = camera(&format!("udp-rtp://{address}"));
    let sender = send(&[H264, &["-f", "rtp", &format!("rtp://{address}?pkt_size=1200")]].concat());
    images(&camera, 12, SIZE);
    assert_eq!((camera.report().codec, camera.report().packets_lost), (Some("H.264"), 0));
    // Another sender, with other numbers.
    drop(sender);
    let _sender = send(&[H264, &["-f", "rtp", &format!("rtp://{address}?pkt_size=1200")]].concat());
    images(&camera, 5, SIZE);
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn mpeg_ts() {
    if !have_ffmpeg() {
        return;
    }
    let address = own_address();
    let camera = camera(&format!("udp-ts://{address}"));
    let _sender = send(&[H264, &["-f", "mpegts", &format!("udp://{address}?pkt_size=1316")]].concat());
    images(&camera, 12, SIZE);
}

/// ffmpeg's own size of datagrams is no multiple of 188 bytes.
#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn mpeg_ts_in_datagrams_that_begin_anywhere() {
    if !have_ffmpeg() {
        return;
    }
    let address = own_address();
    // No image is shown before more than 30 datagrams came.
    let seldom =
        ["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-pix_fmt", "yuv420p", "-g", "20", "-b:v", "4M"];
    let _sender = send(&[&seldom[..], &["-f", "mpegts", &format!("udp://{address}")]].concat());
    std::thread::sleep(Duration::from_millis(500));
    let camera = camera(&format!("udp-ts://{address}"));
    images(&camera, 8, SIZE);
    assert_eq!((camera.report().last_failure, camera.report().connections), (None, 1));
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn mjpeg() {
    if !have_ffmpeg() {
        return;
    }
    let address = format!("http://{}/video", own_address());
    // It serves one client, and then ends.
    let _sender = send(&["-c:v", "mjpeg", "-q:v", "3", "-f", "mpjpeg", "-listen", "1", &address]);
    let camera = camera(&address);
    images(&camera, 12, SIZE);
    assert_eq!(camera.report().codec, Some("JPEG"));
}

#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn h265_is_refused_clearly() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film = folder.path().join("film.mp4");
    let made = Command::new("ffmpeg")
        .args([
            "-v",
            "error",
            "-f",
            "lavfi",
            "-i",
            "testsrc=size=320x240:rate=15",
            "-frames:v",
            "5",
            "-c:v",
            "libx265",
            "-tag:v",
            "hvc1",
        ])
        .arg(&film)
        .output();
    if !made.is_ok_and(|output| output.status.success()) {
        have("libx265 in ffmpeg", &mut Command::new("false"));
        return;
    }
    let address = own_address();
    let file = camera(&format!("file:{}", film.display()));
    let stream = camera(&format!("udp-rtp://{address}"));
    let film = film.display().to_string();
    let _sender = Program::start(
        "ffmpeg",
        &["-v", "error", "-re", "-stream_loop", "-1", "-i", &film, "-c", "copy", "-f", "rtp", &format!("rtp://{address}")],
    );
    for camera in [&file, &stream] {
        wait("a refusal", camera, || camera.report().last_failure.is_some());
        let failure = camera.report().last_failure.unwrap().why;
        assert!(failure.contains("H.265"), "{failure}");
    }
}

/// What the decoder would only call damaged, and containers that are not read.
#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn films_that_cannot_be_decoded_say_why() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, options, expected) in [
        ("plain.mp4", &["-pix_fmt", "yuv420p"][..], None),
        ("444.mp4", &["-pix_fmt", "yuv444p"], Some("profile High 4:4:4 Predictive (244)")),
        ("422.mp4", &["-pix_fmt", "yuv422p"], Some("profile High 4:2:2 (122)")),
        ("10.mp4", &["-pix_fmt", "yuv420p10le"], Some("profile High 10 (110)")),
        ("fields.mp4", &["-pix_fmt", "yuv420p", "-x264-params", "interlaced=1"], Some("interlaced")),
        ("film.mkv", &["-pix_fmt", "yuv420p"], Some("this is a WebM or Matroska file; videos are read")),
        ("film.avi", &["-pix_fmt", "yuv420p"], Some("this is an AVI file")),
        ("film.ts", &["-pix_fmt", "yuv420p"], Some("this is an MPEG transport stream")),
        ("parts.mp4", &["-pix_fmt", "yuv420p", "-movflags", "frag_keyframe+empty_moov"], Some("this is a fragmented MP4 file")),
    ] {
        let path = folder.path().join(name);
        let source = ["-v", "error", "-f", "lavfi", "-i", "testsrc=size=320x240:rate=15", "-frames:v", "4", "-c:v", "libx264"];
        let made = Command::new("ffmpeg").args(source).args(options).arg(&path).output().unwrap();
        assert!(made.status.success(), "{name}: {}", String::from_utf8_lossy(&made.stderr));
        let film = Film::open(&std::fs::read(&path).unwrap());
        match (film, expected) {
            (Ok(film), None) => assert_eq!(film.len(), 4),
            (Err(error), Some(expected)) => {
                assert!(error.to_string().contains(expected) && error.hint().is_some(), "{name}: {error}");
            }
            (film, _) => panic!("{name}: {film:?}"),
        }
    }
}

/// A phone held upright writes lying images and a matrix.
#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn a_phone_s_film_is_upright() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (lying, upright) = (path("lying.mp4"), path("upright.mp4"));
    let run = |args: &[&str]| Command::new("ffmpeg").args(["-v", "error"]).args(args).output().unwrap().status.success();
    // Red above, blue below when upright: turned by a quarter anticlockwise in the file.
    let picture = "color=red:size=320x120:rate=30[a];color=blue:size=320x120:rate=30[b];[a][b]vstack,transpose=2";
    assert!(run(&["-filter_complex", picture, "-frames:v", "20", "-c:v", "libx264", "-pix_fmt", "yuv420p", &lying]));
    // The option of ffmpeg 6, or that of the versions before.
    assert!(
        run(&["-display_rotation", "-90", "-i", &lying, "-c", "copy", &upright])
            || run(&["-i", &lying, "-c", "copy", "-metadata:s:v:0", "rotate=270", &upright])
    );
    let camera = camera(&format!("file:{upright}"));
    wait("the end", &camera, || camera.report().state == CameraState::Ended);
    let (_, photo) = camera.frames().newest().unwrap();
    let image = photo.pixels();
    assert_eq!((image.width(), image.height()), (320, 240));
    let (above, below) = (image.pixel(160, 30).unwrap(), image.pixel(160, 210).unwrap());
    assert!(above[0] > 180 && above[2] < 80 && below[2] > 180 && below[0] < 80, "{above:?} {below:?}");
    // Played again and again, it goes on after its 20 images, at the same pace and as upright.
    let again = crate::harness::camera(&format!("file:{upright}?loop=true"));
    let begun = std::time::Instant::now();
    wait("the third time", &again, || again.frames().tally().decoded >= 45);
    let took = begun.elapsed().as_secs_f64();
    assert!(took > 40.0 / 30.0 && again.report().state == CameraState::Receiving, "{took} {:?}", again.report());
    let (meta, photo) = again.frames().newest().unwrap();
    assert_eq!((photo.size(), photo.pixels().pixel(160, 30).unwrap()[0] > 180), ((320, 240), true));
    // Two images are a thirtieth of a second apart at least, also where the film begins again.
    assert!(meta.captured.as_secs_f64() > 43.0 / 30.0, "{:?}", meta.captured);
}

/// The address of a camera that sends nothing is no error, and stopping it does not take long.
#[test]
fn a_silent_camera_is_stopped_at_once() {
    let url: CameraUrl = format!("udp-rtp://{}", own_address()).parse().unwrap();
    let camera = camera(&url.to_string());
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(camera.report().state, CameraState::Connecting);
}
