//! `spf camera`, and cameras of other commands.

use std::io::{BufRead, BufReader, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::address::own_address;
use crate::harness::Lab;
use crate::track::film;

#[test]
fn a_film_is_tested_as_a_camera() {
    let lab = Lab::new();
    film(&lab.path("square.mp4"), 30);
    let args = ["camera", "test", "file:square.mp4", "--seconds", "1", "-o", "seen.jpg"];
    let run = lab.spf(&args);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let rows: Vec<&str> = run.stdout.lines().map(|line| line.split_whitespace().next().unwrap()).collect();
    assert_eq!(rows, ["image", "rate", "age", "loss", "omitted", "picture"], "{}", run.stdout);
    assert!(run.stdout.starts_with("image    400×300, H.264\n"), "{}", run.stdout);
    assert!(lab.read("seen.jpg").starts_with(&[0xff, 0xd8]));
    assert_eq!(lab.spf(&args).code, Some(2));
    assert_eq!(lab.spf(&[&args[..], &["--overwrite"]].concat()).code, Some(0));
}

#[test]
fn what_is_no_camera_is_refused_and_no_password_is_shown() {
    let lab = Lab::new();
    // What a program without the feature says, or that it was tried.
    let gstreamer =
        if cfg!(feature = "gstreamer") { "no image from the camera gstreamer:…" } else { "built without GStreamer" };
    for (args, code, expected) in [
        (
            &["camera", "test", "rtps://user:pa55word@cam/x"][..],
            2,
            "did you mean `rtsp://HOST/PATH`? Cameras are: rtsp://HOST/PATH, ",
        ),
        (&["camera", "test", "film.mp4"], 2, "hint: did you mean `file:film.mp4`? Cameras are: "),
        (&["camera", "test", "udp://:5600"], 2, "did you mean `udp-ts://:5600`, for MPEG-TS, or `udp-rtp://:5600`, for RTP?"),
        (&["camera", "test", "/dev/video0"], 2, "did you mean `v4l2:/dev/video0`?"),
        (&["camera", "calibrate", "file:film.mp4"], 2, "a video file cannot film this terminal"),
        (&["camera", "test", "http://127.0.0.1:1/x"], 6, "hint: nothing listens at this port"),
        (&["camera", "test", "rtsp://user:pa55word@"], 2, "the host is missing"),
        (&["camera", "test", "rtsp://user:pa55word@cam:pa55word/x"], 2, "the port is not a number"),
        (&["camera", "test", "http://user:pa55word@127.0.0.1:1/x?pwd=pa55word"], 6, "http://…@127.0.0.1:1/x?…"),
        (&["camera", "test", "file:none.mp4"], 6, "cannot read the video"),
        (&["camera", "test", "file:none.mp4", "--seconds", "-1"], 2, "--seconds"),
        (&["camera", "test", "gstreamer:rtspsrc user-pw=pa55word"], 6, gstreamer),
        (&["camera", "test", "v4l2:/dev/video0?format=MJPG"], 2, "only the size and the rate may follow"),
        (&["camera", "test", "file:none.mp4?loop=2"], 2, "only ?loop=true may follow"),
        (&["fly", "go", "--vlm", "oracle", "--camera", "rtsp://user:pa55word@cam/x"], 2, "what a camera sees needs a VLM"),
        (&["fly", "go", "--camera", "rtsp://user:pa55word@cam/x"], 2, "no API key set"),
        (&["doctor", "--drone", "tello@127.0.0.1", "--camera-fov", "60"], 2, "--camera <URL>"),
        (&["doctor", "--camera", "rtsp://user:pa55word@cam/x"], 2, "how wide the camera sees is unknown"),
        (&["doctor", "--camera", "udp-rtp://:5600", "--camera-fov", "300"], 2, "--camera-fov"),
        (&["doctor", "--camera", "udp-rtp://:5600", "--camera-calibration", "none.yaml"], 2, "calibration file `none.yaml`"),
    ] {
        let run = lab.spf(args);
        assert_eq!(run.code, Some(code), "{args:?}: {}", run.stderr);
        assert!(run.stderr.contains(expected), "{args:?}: {}", run.stderr);
        assert!(run.stderr.matches("rtsp+udp://HOST/PATH").count() <= 1, "the list is there once: {}", run.stderr);
        let shown = format!("{}{}", run.stdout, run.stderr);
        assert!(!shown.contains("pa55word"), "{shown}");
    }
}

#[test]
fn no_real_drone_follows_a_film_without_end() {
    let lab = Lab::new();
    let camera = ["--vlm", "gemini", "--camera", "file:square.mp4?loop=true", "--camera-fov", "60"];
    // A router on this machine may pass commands on to a real vehicle.
    for drone in ["tello", "tello@192.0.2.1", "mavlink@udpout:127.0.0.1:14550"] {
        let run = lab.spf(&[&["fly", "go", "--drone", drone], &camera[..]].concat());
        assert!(run.code == Some(2) && run.stderr.contains("a film without end"), "{drone}: {}", run.stderr);
    }
    let run = lab.spf(&["fly", "go", "--drone", "tello@192.0.2.1", "--vlm", "gemini", "--camera", "tello@192.0.2.2"]);
    assert!(run.code == Some(2) && run.stderr.contains("the states of two Tellos"), "{}", run.stderr);
}

#[test]
fn the_doctor_watches_a_camera() {
    let lab = Lab::new();
    film(&lab.path("square.mp4"), 60);
    lab.write(
        "front.yaml",
        "image_width: 800\nimage_height: 600\ncamera_matrix:\n  data: [700, 0, 400, 0, 700, 300, 0, 0, 1]\ndistortion_coefficients:\n  data: [-0.2, 0.1, 0, 0, 0]\n",
    );
    let run = lab.spf(&["doctor", "--camera", "file:square.mp4", "--camera-calibration", "front.yaml"]);
    let line = run.stdout.lines().find(|line| line.contains("camera")).unwrap_or_else(|| panic!("{}{}", run.stdout, run.stderr));
    assert!(line.contains("400×300") && line.contains("frames/s (fine from 10, too few below 5), frames "), "{line}");
    assert!(line.contains("(fine without gaps, too many from 5 % lost)"), "{line}");
    // The lens as it was read: 2·atan(400/700) by 2·atan(300/700).
    let lens = run.stdout.lines().find(|line| line.contains("lens")).unwrap_or_else(|| panic!("{}", run.stdout));
    let read =
        "800×600, focal length 700.0 and 700.0 pixels, centre at (400.0, 300.0), Brown (plumb_bob, radtan): k1 -0.2, k2 0.1";
    assert!(lens.starts_with("ok") && lens.contains(read) && lens.contains("sees 59° × 46°"), "{lens}");
    // Under a name that is none, the distortion would be lost.
    let file = String::from_utf8(lab.read("front.yaml")).unwrap();
    lab.write("other.yaml", file.replace("distortion_coefficients", "distortion"));
    let run = lab.spf(&["doctor", "--camera", "file:square.mp4", "--camera-calibration", "other.yaml"]);
    assert!(run.code == Some(2) && run.stderr.contains("the key `distortion.data` is unknown"), "{}", run.stderr);
}

/// A camera that films the terminal and sends its images 0.4 s later; ffmpeg adds its own time.
#[test]
#[ignore = "slow: films a clock for some seconds"]
fn the_latency_of_a_camera_that_films_the_terminal_is_measured() {
    let lab = Lab::new();
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/filmed.py");
    let address = own_address().to_string();
    let mut command = std::process::Command::new("timeout");
    command.args(["-k", "5", "60", "python3"]).arg(script).args(["0.4", &address]).arg(env!("CARGO_BIN_EXE_spf"));
    command.args(["camera", "calibrate", &format!("udp-rtp://{address}"), "--seconds", "5"]).current_dir(lab.path(""));
    let Ok(output) = command.output() else { return crate::harness::skip("python3") };
    let run = crate::harness::Run::of(&output);
    if run.stderr.contains("'ffmpeg'") {
        return crate::harness::skip("ffmpeg");
    }
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let written = String::from_utf8(lab.read("camera-latency.toml")).unwrap();
    let latency: f64 = written.lines().find_map(|line| line.strip_prefix("latency_s = ")).unwrap().parse().unwrap();
    assert!((0.38..0.9).contains(&latency), "{written}{}", run.stdout);
    // The file is taken where a number is.
    film(&lab.path("square.mp4"), 30);
    let run = lab.spf(&["camera", "test", "file:square.mp4", "--seconds", "1", "--latency", "camera-latency.toml"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    lab.write("camera-latency.toml", "latency_s = -1");
    let run = lab.spf(&["camera", "test", "file:square.mp4", "--latency", "camera-latency.toml", "--overwrite"]);
    assert!(run.code == Some(2) && run.stderr.contains("--latency: `-1` is not a number"), "{}", run.stderr);
}

#[test]
fn a_clock_needs_a_terminal() {
    let lab = Lab::new();
    let run = lab.spf(&["camera", "calibrate", "udp-rtp://127.0.0.1:5600"]);
    assert!(run.code == Some(2) && run.stderr.contains("no terminal to show the clock on"), "{}", run.stderr);
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
#[cfg(unix)]
fn a_clock_needs_a_terminal_that_is_large_enough() {
    let lab = Lab::new();
    // A terminal of 15 lines and 80 columns.
    let script = "import fcntl, os, pty, struct, sys, termios
child, terminal = pty.fork()
if child == 0:
    fcntl.ioctl(2, termios.TIOCSWINSZ, struct.pack('HHHH', 15, 80, 0, 0))
    os.execv(sys.argv[1], sys.argv[1:])
try:
    while said := os.read(terminal, 4096):
        sys.stderr.buffer.write(said)
except OSError:
    pass
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))";
    let mut command = std::process::Command::new("python3");
    command.args(["-c", script, env!("CARGO_BIN_EXE_spf"), "camera", "calibrate", "udp-rtp://127.0.0.1:5600"]);
    let Ok(output) = command.current_dir(lab.path("")).output() else { return crate::harness::skip("python3") };
    let run = crate::harness::Run::of(&output);
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("a terminal of 29 columns and 16 lines; this one has 80 and 15"), "{}", run.stderr);
}

/// What somebody gets who sends the wrong kind of video: before the wait is over, and with what to do.
#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn packets_of_another_kind_and_other_colours_are_named() {
    let lab = Lab::new();
    let source = ["-v", "error", "-re", "-f", "lavfi", "-i", "testsrc=size=320x240:rate=15", "-c:v", "libx264", "-g", "15"];
    let codec = ["-preset", "ultrafast", "-tune", "zerolatency", "-pix_fmt"];
    for (scheme, colours, target, expected, hint) in [
        ("udp-rtp", "yuv420p", "udp", "they seem to be MPEG-TS", "receive them by udp-ts://127."),
        ("udp-ts", "yuv420p", "rtp", "they seem to be RTP", "receive them by udp-rtp://127."),
        ("udp-rtp", "yuv444p", "rtp", "profile High 4:4:4 Predictive (244)", "`-pix_fmt yuv420p`"),
        ("udp-ts", "yuv422p", "udp", "profile High 4:2:2 (122)", "`-pix_fmt yuv420p`"),
    ] {
        let address = own_address();
        let container = if target == "udp" { "mpegts" } else { "rtp" };
        let to = format!("{target}://{address}?pkt_size=1316");
        let mut ffmpeg = std::process::Command::new("ffmpeg");
        ffmpeg.args(source).args(codec).args([colours, "-f", container, &to]);
        let Ok(mut sender) = ffmpeg.stdout(std::process::Stdio::null()).spawn() else { return crate::harness::skip("ffmpeg") };
        let run = lab.spf(&["camera", "test", &format!("{scheme}://{address}")]);
        sender.kill().unwrap();
        sender.wait().unwrap();
        assert_eq!(run.code, Some(6), "{}{}", run.stdout, run.stderr);
        assert!(run.stderr.contains(expected) && run.stderr.contains(hint), "{scheme} {colours}: {}", run.stderr);
    }
}

/// An encoder of High profile with and without B-frames, and an MP4 file sent as the hint says.
#[test]
#[ignore = "needs ffmpeg: .ci/interop runs it"]
fn b_frames_are_named_and_high_profile_alone_is_fine() {
    let lab = Lab::new();
    let source = ["-v", "error", "-f", "lavfi", "-i", "testsrc=size=320x240:rate=15"];
    let codec = ["-c:v", "libx264", "-profile:v", "high", "-g", "15", "-pix_fmt", "yuv420p"];
    let mut film = std::process::Command::new("ffmpeg");
    film.args(source).args(["-t", "30"]).args(codec).args(["-bf", "0", "film.mp4"]);
    let Ok(made) = film.current_dir(lab.path("")).status() else { return crate::harness::skip("ffmpeg") };
    assert!(made.success());
    let film = ["-v", "error", "-re", "-i", "film.mp4", "-c", "copy", "-bsf:v", "h264_mp4toannexb,dump_extra"];
    let with = |b_frames| [&["-re"], &source[..], &codec[..], &["-bf", b_frames]].concat();
    for (what, input, named) in [("none", with("0"), false), ("two", with("2"), true), ("film", film.to_vec(), false)] {
        let address = own_address();
        let mut ffmpeg = std::process::Command::new("ffmpeg");
        ffmpeg.args(input).args(["-f", "rtp", &format!("rtp://{address}")]).current_dir(lab.path(""));
        let mut sender = ffmpeg.stdout(std::process::Stdio::null()).spawn().unwrap();
        let run = lab.spf(&["camera", "test", &format!("udp-rtp://{address}"), "--seconds", "3", "-o", &format!("{what}.jpg")]);
        sender.kill().unwrap();
        sender.wait().unwrap();
        assert_eq!(run.code, Some(0), "{what}: {}{}", run.stdout, run.stderr);
        assert_eq!(run.stderr.contains("warning: the video has B-frames"), named, "{what}: {}", run.stderr);
        assert!(!named || run.stderr.contains("the profile may stay High"), "{}", run.stderr);
    }
}

/// A server that is starting does not know its stream yet; one that refuses an account is not asked again.
#[test]
fn a_stream_that_is_not_there_yet_is_asked_for_again_and_a_forbidden_one_is_not() {
    let jpeg = spf_media::Jpeg::encode(&spf_media::Rgb::new(64, 48), 80).unwrap();
    for (status, code, requests) in [("404 Not Found", 0, 3), ("403 Forbidden", 6, 1)] {
        let lab = Lab::new();
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/video", listener.local_addr().unwrap());
        let (jpeg, asked) = (jpeg.bytes().to_vec(), Arc::new(AtomicU32::new(0)));
        let count = asked.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let mut stream = stream.unwrap();
                let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
                while lines.next().is_some_and(|line| line.is_ok_and(|line| !line.is_empty())) {}
                if count.fetch_add(1, Ordering::Relaxed) < 2 {
                    drop(write!(stream, "HTTP/1.1 {status}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"));
                    continue;
                }
                drop(stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n"));
                loop {
                    let part = format!("--b\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len());
                    if stream.write_all(&[part.as_bytes(), &jpeg, b"\r\n"].concat()).is_err() {
                        break;
                    }
                    std::thread::sleep(std::time::Duration::from_millis(50));
                }
            }
        });
        let run = lab.spf(&["camera", "test", &url, "--seconds", "0.2"]);
        assert_eq!((run.code, asked.load(Ordering::Relaxed)), (Some(code), requests), "{status}: {}", run.stderr);
        assert_eq!(run.stderr.contains("403 (Forbidden)"), code == 6, "{}", run.stderr);
    }
}
