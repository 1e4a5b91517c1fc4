//! The RTSP server with clients that others wrote (ffmpeg, GStreamer), with our own, and with what is no client.

use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use spf_core::time::Time;
use spf_media::Rgb;
use spf_media::h264::{Encoder, EncoderSettings};
use spf_serve::rtsp::{Quirks, Server, Unit};

use crate::harness::{camera, have, have_if, images, wait};

const SIZE: (u32, u32) = (320, 240);

/// A server that shows a moving picture, 20 images a second while somebody watches.
struct Shown {
    server: Arc<Server>,
    stopped: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Shown {
    fn new() -> Self {
        Self::with(Quirks::default())
    }

    fn with(quirks: Quirks) -> Self {
        let server = Server::start_with(SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), "/camera", quirks);
        let server = Arc::new(server.unwrap());
        let stopped = Arc::new(AtomicBool::new(false));
        let (sending, ends) = (server.clone(), stopped.clone());
        let thread = std::thread::spawn(move || {
            let settings = EncoderSettings { key_interval: 60.0, ..EncoderSettings::for_size(SIZE.0, SIZE.1, 20.0) };
            let mut encoder = Encoder::new(settings).unwrap();
            for number in 0_u32.. {
                if ends.load(Ordering::Relaxed) {
                    return;
                }
                if sending.takes_key() {
                    encoder.force_key();
                }
                if number == 0 || sending.is_watched() {
                    let unit = encoder.encode(Time::from_millis(50 * u64::from(number)), &picture(number)).unwrap();
                    sending.send(Unit { captured: SystemTime::now(), unit });
                }
                std::thread::sleep(Duration::from_millis(50));
            }
        });
        Self { server, stopped, thread: Some(thread) }
    }

    fn raw(&self) -> TcpStream {
        let stream = TcpStream::connect(self.server.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        stream
    }
}

impl Drop for Shown {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        drop(self.thread.take().unwrap().join());
    }
}

/// Bars of all colours that move, with fine noise, so that an image takes several packets.
fn picture(number: u32) -> Rgb {
    let mut image = Rgb::new(SIZE.0, SIZE.1);
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let bar = (x + 4 * number) / 40 % 6;
            let noise = ((x * 7919 + y * 104_729 + number * 31) % 23) as u8;
            let on = |bit: u32| if (bar + 1) >> bit & 1 == 1 { 230 + noise } else { noise };
            image.set_pixel(x, y, [on(0), on(1), on(2)]);
        }
    }
    image
}

#[test]
fn our_own_receiver_plays_it_by_tcp_and_udp() {
    let shown = Shown::new();
    assert!(!shown.server.is_watched());
    let tcp = camera(&shown.server.url());
    images(&tcp, 10, SIZE);
    let udp = camera(&shown.server.url().replace("rtsp://", "rtsp+udp://"));
    images(&udp, 10, SIZE);
    for camera in [&tcp, &udp] {
        assert_eq!((camera.report().codec, camera.report().packets_lost), (Some("H.264"), 0));
        // The image is as old as the time since it was drawn.
        wait("the time by the camera's clock", camera, || camera.report().own_clock);
        let (meta, _) = spf_drone::frames::Frames::newest(&camera.frames()).unwrap();
        assert!(meta.received.since(meta.captured) < Duration::from_secs(10));
    }
    drop((tcp, udp));
    let begun = Instant::now();
    while shown.server.is_watched() {
        assert!(begun.elapsed() < Duration::from_secs(20), "nobody watches any more");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// What the standards forbid, and common players play: all at once, each over its own connection, and all of it over one.
#[test]
fn the_quirks_of_cameras_are_played_without_a_second_connection() {
    let none = Quirks::default();
    let all = Quirks { no_channels: true, other_source: true, stray_packets: true, noise: true, back: 6000, jump: -20 };
    let quirks = [
        Quirks { no_channels: true, ..none },
        Quirks { other_source: true, ..none },
        Quirks { stray_packets: true, ..none },
        Quirks { noise: true, ..none },
        // Images are 4500 apart.
        Quirks { back: 6000, ..none },
        Quirks { jump: 20, ..none },
        Quirks { jump: -20, ..none },
        Quirks { jump: 3600, ..none },
        all,
    ];
    let shown: Vec<_> = quirks.iter().map(|quirks| (quirks, Shown::with(*quirks))).collect();
    let cameras: Vec<_> = shown.iter().map(|(quirks, shown)| (quirks, camera(&shown.server.url()))).collect();
    for (quirks, camera) in &cameras {
        images(camera, 12, SIZE);
        let report = camera.report();
        assert_eq!((report.connections, report.packets_lost, report.last_failure), (1, 0, None), "{quirks:?}");
        // A clock that was set makes no image old for long.
        wait("an image of now", camera, || {
            let (meta, _) = spf_drone::frames::Frames::newest(&camera.frames()).unwrap();
            meta.received.since(meta.captured) < Duration::from_secs(3)
        });
    }
}

#[test]
#[ignore = "needs ffprobe: .ci/interop runs it"]
fn ffmpeg_plays_it_by_tcp_and_udp() {
    if !have("ffprobe (Debian's package `ffmpeg`)", Command::new("ffprobe").arg("-version")) {
        return;
    }
    let shown = Shown::new();
    for transport in ["tcp", "udp"] {
        let asked = [
            "-v",
            "error",
            "-rtsp_transport",
            transport,
            "-i",
            &shown.server.url(),
            "-read_intervals",
            "%+#12",
            "-count_frames",
            "-show_entries",
            "stream=codec_name,width,height,nb_read_frames",
            "-of",
            "csv=p=0",
        ];
        let output = Command::new("timeout").args(["30", "ffprobe"]).args(asked).output().unwrap();
        let (told, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        let fields: Vec<&str> = told.trim().split(',').collect();
        assert_eq!(fields[..3], ["h264", "320", "240"], "{transport}: {told}{errors}");
        assert!(fields[3].parse::<u32>().unwrap() >= 10 && errors.is_empty(), "{transport}: {told}{errors}");
    }
}

#[test]
#[ignore = "needs GStreamer: .ci/interop runs it"]
fn gstreamer_plays_it_by_tcp_and_udp() {
    let folder = tempfile::tempdir().unwrap();
    // A list of plugins of its own: a scan that a busy machine cut short leaves a plugin out of the user's list for ever.
    let registry = (1..=3).map(|scan| folder.path().join(format!("registry-{scan}"))).find(|registry| {
        ["rtspsrc", "rtph264depay", "avdec_h264"].iter().all(|element| {
            let mut ask = Command::new("gst-inspect-1.0");
            ask.args(["--exists", element]).env("GST_REGISTRY", registry).status().is_ok_and(|status| status.success())
        })
    });
    let wanted = "GStreamer's H.264 (Debian's gstreamer1.0-tools, gstreamer1.0-plugins-good, gstreamer1.0-libav)";
    if !have_if(wanted, registry.is_some()) {
        return;
    }
    let shown = Shown::new();
    for transport in ["tcp", "udp"] {
        let raw = folder.path().join(transport);
        let pipeline = format!(
            "rtspsrc location={} protocols={transport} latency=0 ! rtph264depay ! avdec_h264 ! videoconvert ! video/x-raw,format=RGB ! \
             identity eos-after=11 ! filesink location={}",
            shown.server.url(),
            raw.display()
        );
        let mut play = Command::new("timeout");
        play.args(["30", "gst-launch-1.0", "-q"]).args(pipeline.split(' ')).env("GST_REGISTRY", registry.as_ref().unwrap());
        let output = play.output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        let bytes = std::fs::read(&raw).unwrap();
        let frame = (SIZE.0 * SIZE.1 * 3) as usize;
        assert!(bytes.len() >= 8 * frame && bytes.len().is_multiple_of(frame), "{transport}: {} {errors}", bytes.len());
        let last = &bytes[bytes.len() - frame..];
        assert!((0..3).all(|channel| last.iter().skip(channel).step_by(3).any(|value| *value > 200)), "{transport}: no colours");
    }
}

/// Reads until the server closes the connection.
fn rest(mut stream: TcpStream) -> String {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn a_page_of_a_browser_and_garbage_are_turned_away() {
    let shown = Shown::new();
    for sent in [&b"POST /camera HTTP/1.1\r\nHost: localhost\r\n\r\n"[..], &[b'x'; 9000], b"PLAY x RTSP/1.0\r\n\r\n"] {
        let mut stream = shown.raw();
        stream.write_all(sent).unwrap();
        assert_eq!(rest(stream), "RTSP/1.0 400 Bad Request\r\n\r\n");
    }
    // Others are served on.
    images(&camera(&shown.server.url()), 2, SIZE);
}

/// A client that plays and never reads: the others are not delayed, and the images do not pile up.
#[test]
fn a_stalled_viewer_delays_nobody() {
    let shown = Shown::new();
    let mut stream = shown.raw();
    let url = shown.server.url();
    let mut ask = |text: String| {
        stream.write_all(text.as_bytes()).unwrap();
        let mut buffer = [0; 2048];
        let length = stream.read(&mut buffer).unwrap();
        String::from_utf8_lossy(&buffer[..length]).into_owned()
    };
    let told = ask(format!("SETUP {url}/video RTSP/1.0\r\nCSeq: 1\r\nTransport: RTP/AVP/TCP;interleaved=0-1\r\n\r\n"));
    let session = told.split("Session: ").nth(1).and_then(|rest| rest.split(';').next()).unwrap().to_owned();
    ask(format!("PLAY {url} RTSP/1.0\r\nCSeq: 2\r\nSession: {session}\r\n\r\n"));
    let other = camera(&url);
    // More than what fits between the server and the stalled one.
    images(&other, 60, SIZE);
}
