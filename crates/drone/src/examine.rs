//! Looking at a drone on the ground, before a flight: what can be found out about any of them. What to do about it is the driver's to
//! say.

use std::time::{Duration, Instant};

use serde::Serialize;
use spf_core::time::Time;

use crate::frames::Photo;
use crate::{Drone, DroneEvent};

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
    /// A check with what to do when it did not come out well.
    #[must_use]
    pub fn new(what: &'static str, finding: Finding, found: impl Into<String>, advice: Option<&str>) -> Self {
        Self { what, finding, found: found.into(), advice: advice.filter(|_| finding != Finding::Good).map(str::to_owned) }
    }
}

/// How long telemetry and video are watched.
const WATCHED: Duration = Duration::from_secs(3);
/// How long the first image is waited for: a key frame comes every second or two.
pub const FIRST_PICTURE: Duration = Duration::from_secs(6);
/// Between two looks.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Charge to take off with, per cent.
const BATTERY: u8 = 20;
/// A charge that lasts for a flight, per cent.
const BATTERY_LONG: u8 = 40;
/// Mean brightness of an image, of 255, below which a craft that holds itself by its camera loses its hold on the ground.
const DARK: f64 = 40.0;

/// What a drone told and showed while it was watched.
pub struct Watched {
    /// Telemetry reports a second.
    pub telemetry: f64,
    /// The newest image; none when none came within [`FIRST_PICTURE`].
    pub newest: Option<Photo>,
    /// When the first one came.
    first: Duration,
    /// Images a second.
    shown: f64,
    /// Places where one was missing.
    gaps: u64,
}

impl Watched {
    /// Watches a drone for some seconds.
    pub fn of(drone: &mut dyn Drone) -> Self {
        let frames = drone.frames();
        let (begun, mut reports) = (Instant::now(), 0);
        let first = loop {
            reports += count_reports(drone, begun);
            if frames.newest().is_some() || begun.elapsed() > FIRST_PICTURE {
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

    /// Whether so many reports came as should, a second.
    #[must_use]
    pub fn reports(&self, should: f64) -> Finding {
        match self.telemetry / should {
            share if share < 0.5 => Finding::Bad,
            share if share < 0.85 => Finding::Warning,
            _ => Finding::Good,
        }
    }

    /// Whether the images come as they should.
    #[must_use]
    pub fn video(&self, picture: &Photo, advice: &str) -> Check {
        let finding = if self.shown < 5.0 {
            Finding::Bad
        } else if self.gaps > 0 || self.shown < 10.0 {
            Finding::Warning
        } else {
            Finding::Good
        };
        let ((width, height), first) = (picture.size(), self.first.as_secs_f64());
        let said = format!("{width}×{height}, {:.1} frames a second, {} gaps, first after {first:.1} s", self.shown, self.gaps);
        Check::new("video", finding, said, Some(advice))
    }
}

/// Whether the charge, per cent, is enough to fly with.
#[must_use]
pub fn battery(charge: Option<u8>, advice: &str) -> Check {
    let Some(charge) = charge else {
        return Check::new("battery", Finding::Warning, "not told", Some("look at it in the app"));
    };
    let finding = match charge {
        0..BATTERY => Finding::Bad,
        BATTERY..BATTERY_LONG => Finding::Warning,
        _ => Finding::Good,
    };
    Check::new("battery", finding, format!("{charge} %"), Some(advice))
}

/// Whether there is light enough.
#[must_use]
pub fn light(picture: &Photo, advice: &str) -> Check {
    let pixels = picture.pixels();
    let bytes = pixels.data();
    let light = bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / (bytes.len().max(1) as f64);
    let finding = if light < DARK { Finding::Warning } else { Finding::Good };
    Check::new("light", finding, format!("mean {light:.0} of 255"), Some(advice))
}

fn count_reports(drone: &mut dyn Drone, begun: Instant) -> u32 {
    let now = Time::ZERO + begun.elapsed();
    let mut reports = 0;
    while let Some((_, event)) = drone.next_event(now) {
        reports += u32::from(matches!(event, DroneEvent::Telemetry(_)));
    }
    reports
}
