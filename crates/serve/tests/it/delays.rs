//! Delay from drawing to the frame, frames per second and processor time of each kind of camera, with a clock in the picture.

#![allow(clippy::print_stdout, reason = "the table is for people")]

use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

use spf_camera::clock_code::{ClockCode, read};
use spf_camera::{Camera, CameraSettings};
use spf_core::time::Time;
use spf_drone::frames::Frames as _;
use spf_media::Rgb;
use spf_media::h264::{Encoder, EncoderSettings};
use spf_serve::rtsp::{Server, Unit};

use crate::address::own_address;
use crate::harness::{have, wait};

const SIZE: (u32, u32) = (640, 480);
/// Images per second.
const RATE: u32 = 15;
const INTERVAL: Duration = Duration::from_micros(1_000_000 / RATE as u64);
/// How long each kind is measured.
const MEASURED: Duration = Duration::from_secs(8);

/// Draws a clock and passes the images on, until it is dropped.
struct Drawn {
    stopped: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Drawn {
    /// `send` returns whether it goes on.
    fn start(begun: Instant, mut send: impl FnMut(&Rgb) -> bool + Send + 'static) -> Self {
        let stopped = Arc::new(AtomicBool::new(false));
        let ends = stopped.clone();
        let thread = std::thread::spawn(move || {
            let mut image = Rgb::new(SIZE.0, SIZE.1);
            for (number, value) in image.data_mut().iter_mut().enumerate() {
                *value = (number / 97 * 31 % 200) as u8;
            }
            let mut next = Instant::now();
            while !ends.load(Ordering::Relaxed) {
                ClockCode::of(begun.elapsed().as_millis() as u64).draw(&mut image, 100, 100, 8);
                if !send(&image) {
                    return;
                }
                next = (next + INTERVAL).max(Instant::now());
                std::thread::sleep(next.saturating_duration_since(Instant::now()));
            }
        });
        Self { stopped, thread: Some(thread) }
    }

    /// Into the standard input of a program, without a header.
    fn into_program(begun: Instant, program: &mut Child) -> Self {
        let mut pipe = program.stdin.take().unwrap();
        Self::start(begun, move |image| pipe.write_all(image.data()).is_ok())
    }
}

impl Drop for Drawn {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        drop(self.thread.take().unwrap().join());
    }
}

struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// Processor time of the threads of cameras, s.
fn busy() -> f64 {
    let mut ticks = 0;
    for thread in std::fs::read_dir("/proc/self/task").unwrap() {
        let text = std::fs::read_to_string(thread.unwrap().path().join("stat")).unwrap_or_default();
        if let Some((_, fields)) = text.split_once("(camera-").and_then(|(_, rest)| rest.split_once(") ")) {
            // `utime` and `stime`, of 10 ms.
            ticks += fields.split(' ').skip(11).take(2).map(|field| field.parse::<u64>().unwrap()).sum::<u64>();
        }
    }
    ticks as f64 / 100.0
}

/// Prints a row of the table.
fn measure(kind: &str, url: &str, begun: Instant) {
    let camera = Camera::start(url.parse().unwrap(), &CameraSettings::default(), begun).unwrap();
    let frames = camera.frames();
    wait("images", &camera, || frames.tally().decoded >= 10);
    let (since, before) = (Instant::now(), busy());
    let (mut seen, mut delays, mut ages) = (0, Vec::new(), Vec::new());
    while since.elapsed() < MEASURED {
        let Some(meta) = frames.take_new_frame() else {
            std::thread::sleep(Duration::from_millis(1));
            continue;
        };
        let available = begun.elapsed();
        seen += 1;
        ages.push(meta.received.since(meta.captured).as_secs_f64());
        if let Some(millis) = frames.photo(meta.id).and_then(|photo| read(&photo.pixels())) {
            delays.push(available.as_secs_f64() - millis as f64 / 1000.0);
        }
    }
    let (time, busy) = (since.elapsed().as_secs_f64(), busy() - before);
    assert!(delays.len() >= 20, "{kind}: the clock was read in {} of {seen} frames", delays.len());
    delays.sort_by(f64::total_cmp);
    ages.sort_by(f64::total_cmp);
    let at = |values: &[f64], share: f64| values[(values.len() - 1).min((values.len() as f64 * share) as usize)];
    let basis = if camera.report().own_clock { "RTCP" } else { "assumed 0.2 s" };
    println!(
        "| {kind} | {:.1} | {:.3} s | {:.3} s | {:.3} s ({basis}) | {:.0} % |",
        f64::from(seen) / time,
        at(&delays, 0.5),
        at(&delays, 0.95),
        at(&ages, 0.5),
        100.0 * busy / time
    );
    assert!(at(&delays, 0.5) < 3.0, "{kind}");
}

fn ffmpeg(output: &[&str]) -> Child {
    let size = format!("{}x{}", SIZE.0, SIZE.1);
    let rate = RATE.to_string();
    let input = ["-v", "error", "-probesize", "32", "-analyzeduration", "0", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", &size];
    let mut command = Command::new("ffmpeg");
    command.args(input).args(["-r", &rate, "-i", "-"]).args(output);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// The rows of GStreamer's RTSP server.
fn gstreamer() {
    let ask = "import gi; gi.require_version('GstRtspServer', '1.0'); from gi.repository import Gst, GstRtspServer; Gst.init(None); \
               assert Gst.ElementFactory.find('x264enc')";
    let packages = "gir1.2-gst-rtsp-server-1.0, python3-gst-1.0, gstreamer1.0-plugins-{base,good,ugly}";
    if !have(&format!("GStreamer's RTSP server (Debian's {packages})"), Command::new("/usr/bin/python3").args(["-c", ask])) {
        return;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/gstreamer_server.py");
    for transport in ["rtsp", "rtsp+udp"] {
        // Its datagrams come from 127.0.0.1 whatever its own address is, and the camera takes them from nowhere else.
        let port = own_address().port() + 200 * (std::process::id() % 60) as u16;
        let (begun, address) = (Instant::now(), std::net::SocketAddrV4::new(Ipv4Addr::LOCALHOST, port));
        let mut command = Command::new("/usr/bin/python3");
        command
            .args([script, &address.ip().to_string(), &address.port().to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        let drawn = Drawn::into_program(begun, &mut child);
        let ended = Ended(child);
        measure(&format!("`{transport}://`, GStreamer"), &format!("{transport}://{address}/clock"), begun);
        drop(ended);
        drop(drawn);
    }
}

const H264: &[&str] = &["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-pix_fmt", "yuv420p", "-g", "15"];

#[test]
#[ignore = "a measurement of a minute: -- --ignored delays --nocapture"]
fn delays_of_each_kind_of_camera() {
    if !have("ffmpeg (Debian's package `ffmpeg`)", Command::new("ffmpeg").arg("-version")) {
        return;
    }
    println!("| camera | frames/s | delay, median | delay, 95 % | age told, median | processor |\n|---|---|---|---|---|---|");
    for transport in ["rtsp", "rtsp+udp"] {
        let begun = Instant::now();
        let server = Arc::new(Server::start(SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), "/camera").unwrap());
        let sending = server.clone();
        let settings = EncoderSettings { key_interval: 1.0, ..EncoderSettings::for_size(SIZE.0, SIZE.1, RATE.into()) };
        let mut encoder = Encoder::new(settings).unwrap();
        let _drawn = Drawn::start(begun, move |image| {
            let captured = SystemTime::now();
            if sending.takes_key() {
                encoder.force_key();
            }
            let unit = encoder.encode(Time::ZERO + begun.elapsed(), image).unwrap();
            sending.send(Unit { captured, unit });
            true
        });
        measure(&format!("`{transport}://`, this server"), &server.url().replace("rtsp", transport), begun);
    }
    gstreamer();
    let (rtp, ts, http) = (own_address(), own_address(), own_address());
    let (to_rtp, to_ts) = (format!("rtp://{rtp}?pkt_size=1200"), format!("udp://{ts}?pkt_size=1316"));
    let to_http = format!("http://{http}/video");
    let kinds = [
        ("`udp-rtp://`, ffmpeg", format!("udp-rtp://{rtp}"), [H264, &["-f", "rtp", &to_rtp]].concat()),
        (
            "`udp-ts://`, ffmpeg",
            format!("udp-ts://{ts}"),
            [H264, &["-muxdelay", "0", "-muxpreload", "0", "-flush_packets", "1", "-f", "mpegts", &to_ts]].concat(),
        ),
        (
            "`http://` (MJPEG), ffmpeg",
            to_http.clone(),
            vec!["-c:v", "mjpeg", "-q:v", "3", "-flush_packets", "1", "-f", "mpjpeg", "-listen", "1", &to_http],
        ),
    ];
    for (kind, url, output) in kinds {
        let begun = Instant::now();
        let mut child = ffmpeg(&output);
        let drawn = Drawn::into_program(begun, &mut child);
        let ended = Ended(child);
        measure(kind, &url, begun);
        drop(ended);
        drop(drawn);
    }
}
