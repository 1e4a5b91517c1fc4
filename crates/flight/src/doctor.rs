//! `spf doctor`: everything that can be found out before a flight, and what to do about what is wrong.

use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;
use spf_core::time::Duration as FlightDuration;
use spf_detect::Detector;
use spf_drone::Drone;
use spf_drone::DroneEvent;
use spf_drone::tello::answer::explain;
use spf_drone::tello::{ConnectError, Connected, Tello, TelloSettings};
use spf_media::Rgb;
use spf_render::Channels;
use spf_vlm::Vlm;
use spf_vlm::check::{Verdict, check};

use crate::sim::Stage;

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// As it should be.
    Good,
    /// One can fly, and should know.
    Warning,
    /// One should not fly.
    Bad,
}

/// One thing looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What.
    pub what: &'static str,
    /// How it came out.
    pub finding: Finding,
    /// What was found.
    pub found: String,
    /// What to do; none where nothing is to be done.
    pub advice: Option<String>,
}

impl Check {
    fn new(what: &'static str, finding: Finding, found: impl Into<String>, advice: Option<&str>) -> Self {
        Self { what, finding, found: found.into(), advice: advice.filter(|_| finding != Finding::Good).map(str::to_owned) }
    }
}

/// How long state and video are watched.
const WATCHED: Duration = Duration::from_secs(3);
/// How long the first picture is waited for: a key frame comes every second or two.
const FIRST_PICTURE: Duration = Duration::from_secs(6);
/// Charge to take off with, per cent.
const BATTERY: u8 = 20;
/// A charge that lasts for a flight, per cent.
const BATTERY_LONG: u8 = 40;
/// It switches itself off somewhat above, °C.
const HOT: i32 = 80;
/// Mean brightness of a picture, of 255, below which a Tello loses its hold on the ground.
const DARK: f64 = 40.0;
/// A detector should not take longer for a picture.
const SLOW_DETECTOR: Duration = Duration::from_millis(700);
/// Free space that a long flight with video takes, bytes.
const SPACE: u64 = 1 << 30;

/// Looks at a Tello: the way to it, its state, its video.
#[must_use]
pub fn tello(settings: &TelloSettings) -> Vec<Check> {
    let Connected { mut drone, state, firmware } = match Tello::connect(settings, Instant::now()) {
        Ok(connected) => connected,
        Err(error) => return vec![unreachable(settings, &error)],
    };
    let (address, frames) = (settings.drone, drone.frames());
    let mut checks = vec![Check::new("drone", Finding::Good, format!("{address} answers, {firmware}"), None)];
    checks.push(match state.battery {
        None => Check::new("battery", Finding::Warning, "not told", Some("look at it in the app")),
        Some(charge) => {
            let finding = match charge {
                0..BATTERY => Finding::Bad,
                BATTERY..BATTERY_LONG => Finding::Warning,
                _ => Finding::Good,
            };
            Check::new(
                "battery",
                finding,
                format!("{charge} %"),
                Some("charge it: below 20 % the envelope refuses a take-off, below 10 % the drone does"),
            )
        }
    });
    if let Some([low, high]) = state.temperature {
        let finding = if high >= HOT { Finding::Bad } else { Finding::Good };
        checks.push(Check::new(
            "temperature",
            finding,
            format!("{low} to {high} °C"),
            Some("switch it off and let it cool: it switches itself off above some 85 °C"),
        ));
    }
    let (begun, mut states) = (Instant::now(), 0);
    let first = loop {
        states += count_states(&mut drone, begun);
        if frames.newest().is_some() || begun.elapsed() > FIRST_PICTURE {
            break begun.elapsed();
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let before = (frames.tally(), Instant::now());
    while before.1.elapsed() < WATCHED {
        states += count_states(&mut drone, begun);
        std::thread::sleep(Duration::from_millis(20));
    }
    let rate = f64::from(states) / begun.elapsed().as_secs_f64();
    let finding = if rate < 5.0 {
        Finding::Bad
    } else if rate < 8.5 {
        Finding::Warning
    } else {
        Finding::Good
    };
    checks.push(Check::new(
        "state",
        finding,
        format!("{rate:.1} lines a second of 10"),
        Some("go nearer to the drone, or to where fewer Wi-Fi networks are"),
    ));
    let Some((_, picture)) = frames.newest() else {
        let todo = format!(
            "allow UDP {} from {} in the firewall; a Tello EDU that joined a router sends no video with SDK 2.0",
            settings.video_port,
            address.ip()
        );
        checks.push(Check { what: "video", finding: Finding::Bad, found: "none within 6 s".to_owned(), advice: Some(todo) });
        return checks;
    };
    let tally = frames.tally();
    let shown = (tally.decoded - before.0.decoded) as f64 / WATCHED.as_secs_f64();
    let gaps = tally.video.gaps - before.0.video.gaps;
    let finding = if shown < 5.0 {
        Finding::Bad
    } else if gaps > 0 || shown < 10.0 {
        Finding::Warning
    } else {
        Finding::Good
    };
    let said = format!(
        "{}×{}, {shown:.1} frames a second, {gaps} gaps, first after {:.1} s",
        picture.size().0,
        picture.size().1,
        first.as_secs_f64()
    );
    checks.push(Check::new(
        "video",
        finding,
        said,
        Some("go nearer to the drone; each lost datagram costs the rest of a second"),
    ));
    let light = brightness(&picture.pixels());
    let finding = if light < DARK { Finding::Warning } else { Finding::Good };
    checks.push(Check::new(
        "light",
        finding,
        format!("mean {light:.0} of 255"),
        Some("switch on a light: in the dark it drifts, and answers `error No valid imu`"),
    ));
    checks
}

fn count_states(drone: &mut Tello, begun: Instant) -> u32 {
    let now = spf_core::time::Time::ZERO + begun.elapsed();
    let mut states = 0;
    while let Some((_, event)) = drone.next_event(now) {
        states += u32::from(matches!(event, DroneEvent::Telemetry(_)));
    }
    states
}

fn unreachable(settings: &TelloSettings, error: &ConnectError) -> Check {
    let ip = settings.drone.ip();
    let advice = match error {
        ConnectError::Port { port, .. } => {
            format!("end the program that has UDP port {port}: another Tello program, or a second flight")
        }
        ConnectError::Unreachable { .. } | ConnectError::NoAnswer { .. } => {
            format!(
                "switch it on and join its Wi-Fi TELLO-…; `ping {ip}` should answer; after the app was used, switch it off and on"
            )
        }
        ConnectError::NoState { port } => format!("allow UDP {port} and {} from {ip} in the firewall", settings.video_port),
        ConnectError::Refused { answer, .. } => explain(answer).to_owned(),
        _ => "start again; if it stays so, tell the project".to_owned(),
    };
    Check { what: "drone", finding: Finding::Bad, found: error.to_string(), advice: Some(advice) }
}

fn brightness(picture: &Rgb) -> f64 {
    let bytes = picture.data();
    bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / (bytes.len().max(1) as f64)
}

/// Draws some pictures of a scene as a flight on the wall clock does, and counts how many a second there are.
#[must_use]
pub fn simulator(stage: &Stage) -> Check {
    let moment = stage.beginning(stage.scene.start);
    let camera = stage.scene.default_craft.camera();
    let (begun, mut drawn) = (Instant::now(), 0_u32);
    while begun.elapsed() < WATCHED {
        drop(stage.render(&camera, &moment, Channels::RGB));
        drawn += 1;
    }
    let rate = f64::from(drawn) / begun.elapsed().as_secs_f64();
    // The film of a flight shows ten a second.
    let finding = if rate < 10.0 { Finding::Warning } else { Finding::Good };
    let said = format!("{} is drawn {rate:.1} times a second", stage.scene.name);
    Check::new("simulator", finding, said, Some("end what keeps this machine busy, or fly with --no-video"))
}

/// Asks who points about pictures of a dot.
#[must_use]
pub fn vlm(name: &str, vlm: &mut dyn Vlm, time: FlightDuration) -> Check {
    let checked = check(vlm, time);
    let latencies = checked.pointed.iter().map(|pointed| pointed.answer.latency.as_secs_f64());
    let slowest = latencies.fold(0.0, f64::max);
    match checked.verdict {
        Verdict::Good(worst) => {
            let finding = if slowest > 5.0 { Finding::Warning } else { Finding::Good };
            let said = format!("{name} points within {:.1} % of the picture, after {slowest:.2} s at most", 100.0 * worst);
            Check::new("VLM", finding, said, Some("a faster model: the drone waits, or flies on, while it thinks"))
        }
        Verdict::Failed(error) => Check::new(
            "VLM",
            Finding::Bad,
            format!("{name}: {error}"),
            Some("is the key set, and is the Internet reached beside the drone's Wi-Fi?"),
        ),
        _ => Check::new("VLM", Finding::Bad, format!("{name} answers, and points astray"), Some("`spf vlm check` tells how")),
    }
}

/// Has a detector look at a grey picture of a camera's size.
#[must_use]
pub fn detector(model: &Detector) -> Check {
    let began = Instant::now();
    let seen = model.detect(&Rgb::filled(960, 720, [128; 3]));
    let took = began.elapsed();
    let (width, height) = model.input();
    let found = format!("{} knows {} classes, {width}×{height} pixels", model.name(), model.classes().len());
    match seen {
        Err(error) => Check::new("detector", Finding::Bad, error.to_string(), Some("take another model: docs/detector.md")),
        Ok(_) => {
            let finding = if took > SLOW_DETECTOR { Finding::Warning } else { Finding::Good };
            let advice = "every decision waits so long before the VLM is asked: take a smaller model or input";
            Check::new("detector", finding, format!("{found}, a picture in {:.2} s", took.as_secs_f64()), Some(advice))
        }
    }
}

/// Looks at the disk that a folder is on; none where that cannot be found out.
#[must_use]
pub fn disk(folder: &Path) -> Option<Check> {
    let free = free_bytes(folder)?;
    let finding = if free < SPACE { Finding::Warning } else { Finding::Good };
    Some(Check::new("disk", finding, format!("{:.1} GB free", free as f64 * 1e-9), Some("make room, or fly with --no-video")))
}

#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let found = rustix::fs::statvfs(folder).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize))
}

#[cfg(not(unix))]
fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}
