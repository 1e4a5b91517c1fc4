//! Checks of a drone on the ground before a flight that apply to any drone. Advice comes from the driver.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;
use spf_core::time::Time;
use spf_media::Rgb;

use crate::frames::Photo;
use crate::{Drone, DroneEvent};

/// The result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// As it should be.
    Good,
    /// Flight is possible, with a reservation.
    Warning,
    /// Do not fly.
    Bad,
}

/// A completed check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What was checked.
    pub what: &'static str,
    /// The result.
    pub finding: Finding,
    /// Details of the result.
    pub found: String,
    /// Remedy; `None` if none is needed.
    pub advice: Option<String>,
    /// What was seen, for people to look at.
    #[serde(skip)]
    pub picture: Option<Arc<Rgb>>,
}

impl Check {
    /// A check; `advice` is kept unless the result is good.
    #[must_use]
    pub fn new(what: &'static str, finding: Finding, found: impl Into<String>, advice: Option<&str>) -> Self {
        let advice = advice.filter(|_| finding != Finding::Good).map(str::to_owned);
        Self { what, finding, found: found.into(), advice, picture: None }
    }

    /// The same with what was seen.
    #[must_use]
    pub fn with_picture(self, picture: Arc<Rgb>) -> Self {
        Self { picture: Some(picture), ..self }
    }
}

/// How long telemetry and video are observed.
const WATCHED: Duration = Duration::from_secs(3);
/// Maximum wait for the first image: a key frame arrives every second or two.
pub const FIRST_FRAME: Duration = Duration::from_secs(6);
/// Polling interval.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Minimum charge for take-off, per cent.
const BATTERY: u8 = 20;
/// Charge sufficient for a long flight, per cent.
const BATTERY_LONG: u8 = 40;
/// Mean brightness of an image, of 255, below which a craft that stabilises itself by camera loses its position.
const DARK: f64 = 40.0;

/// What a drone reported while it was observed.
pub struct Observation {
    /// Telemetry reports per second.
    pub telemetry: f64,
    /// The newest image; `None` if none arrived within [`FIRST_FRAME`].
    pub newest: Option<Photo>,
    /// Time until the first image.
    first: Duration,
    /// Images per second.
    shown: f64,
    /// Number of gaps in the video.
    gaps: u64,
}

impl Observation {
    /// Observes a drone for some seconds.
    pub fn of(drone: &mut dyn Drone) -> Self {
        let frames = drone.frames();
        let (begun, mut reports) = (Instant::now(), 0);
        let first = loop {
            reports += count_reports(drone, begun);
            if frames.newest().is_some() || begun.elapsed() > FIRST_FRAME {
                break begun.elapsed();
            }
            std::thread::sleep(POLL_INTERVAL);
        };
        let (before, since) = (frames.tally(), Instant::now());
        while since.elapsed() < WATCHED {
            reports += count_reports(drone, begun);
            std::thread::sleep(POLL_INTERVAL);
        }
        let telemetry = f64::from(reports) / begun.elapsed().as_secs_f64();
        let tally = frames.tally();
        Self {
            telemetry,
            newest: frames.newest().map(|(_, photo)| photo),
            first,
            shown: (tally.decoded - before.decoded) as f64 / WATCHED.as_secs_f64(),
            gaps: tally.video.gaps - before.video.gaps,
        }
    }

    /// Compares the telemetry rate with the expected one, in reports per second.
    #[must_use]
    pub fn reports(&self, should: f64) -> Finding {
        match self.telemetry / should {
            fraction if fraction < 0.5 => Finding::Bad,
            fraction if fraction < 0.85 => Finding::Warning,
            _ => Finding::Good,
        }
    }

    /// Checks the video.
    #[must_use]
    pub fn video(&self, image: &Photo, advice: &str) -> Check {
        let finding = if self.shown < 5.0 {
            Finding::Bad
        } else if self.gaps > 0 || self.shown < 10.0 {
            Finding::Warning
        } else {
            Finding::Good
        };
        let ((width, height), first) = (image.size(), self.first.as_secs_f64());
        let text = format!("{width}×{height}, {:.1} frames/s, {} gaps, first frame after {first:.1} s", self.shown, self.gaps);
        Check::new("video", finding, text, Some(advice))
    }
}

/// Checks whether the charge, per cent, is sufficient for a flight.
#[must_use]
pub fn battery(charge: Option<u8>, advice: &str) -> Check {
    let Some(charge) = charge else {
        return Check::new("battery", Finding::Warning, "unknown", Some("check it in the app"));
    };
    let finding = match charge {
        0..BATTERY => Finding::Bad,
        BATTERY..BATTERY_LONG => Finding::Warning,
        _ => Finding::Good,
    };
    Check::new("battery", finding, format!("{charge} %"), Some(advice))
}

/// Checks the brightness.
#[must_use]
pub fn light(image: &Photo, advice: &str) -> Check {
    let pixels = image.pixels();
    let bytes = pixels.data();
    let light = bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / (bytes.len().max(1) as f64);
    let finding = if light < DARK { Finding::Warning } else { Finding::Good };
    Check::new("light", finding, format!("mean brightness {light:.0} of 255"), Some(advice))
}

fn count_reports(drone: &mut dyn Drone, begun: Instant) -> u32 {
    let now = Time::ZERO + begun.elapsed();
    let mut reports = 0;
    while let Some((_, event)) = drone.next_event(now) {
        reports += u32::from(matches!(event, DroneEvent::Telemetry(_)));
    }
    reports
}
