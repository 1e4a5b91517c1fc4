//! The gimbal of the camera: what it reports, and where it is told to look. A manager of version 2 is tried first, and after its
//! refusal the commands for older mounts.

use spf_core::gimbal::GimbalReport;
use spf_core::time::{Duration, Time};
use spf_mavlink::command::CommandResult;
use spf_mavlink::gimbal::{GimbalNews, mount, point, take_control};

use super::control::Control;
use super::{Notice, Vehicle};
use crate::DroneEvent;

/// The range of a gimbal that does not tell, radians below the horizon: from 20° above it to straight down.
const RANGE: [f64; 2] = [-20.0 / 180.0 * core::f64::consts::PI, core::f64::consts::FRAC_PI_2];
/// It has arrived within this of where it was told to look, radians: 3°.
const ARRIVED: f64 = 3.0 / 180.0 * core::f64::consts::PI;
/// A tilt that is not shown is commanded again after this long, at most this often.
const AGAIN: Duration = Duration::from_secs(3);
const TRIES: u8 = 3;

/// What is known of the gimbal.
#[derive(Debug)]
pub(super) struct GimbalState {
    /// Whether its reports are used: the camera may be elsewhere.
    used: bool,
    range: [f64; 2],
    tilt: Option<f64>,
    /// Where it was told to look, when it is told again, and how often it was told.
    wanted: Option<(f64, Time, u8)>,
    /// Whether a manager of version 2 has refused.
    old: bool,
    in_control: bool,
}

impl Default for GimbalState {
    fn default() -> Self {
        Self { used: true, range: RANGE, tilt: None, wanted: None, old: false, in_control: false }
    }
}

impl Vehicle {
    /// Its reports are not used: the camera is not on it.
    pub fn ignore_gimbal(&mut self) {
        self.gimbal.used = false;
    }

    /// Tilt of the camera below the horizon, radians, as the gimbal reports it.
    #[must_use]
    pub fn camera_tilt(&self) -> Option<f64> {
        self.gimbal.tilt.filter(|_| self.gimbal.used)
    }

    /// The gimbal's range, if there is a gimbal.
    #[must_use]
    pub fn gimbal_range(&self) -> Option<[f64; 2]> {
        self.camera_tilt().map(|_| self.gimbal.range)
    }

    /// A report of the gimbal.
    pub fn handle_gimbal(&mut self, now: Time, news: GimbalNews) {
        if !self.gimbal.used {
            return;
        }
        match news {
            GimbalNews::Range(range) => self.gimbal.range = range,
            GimbalNews::Tilt(tilt) => {
                self.gimbal.tilt = Some(tilt);
                if self.gimbal.wanted.is_some_and(|(wanted, ..)| (wanted - tilt).abs() < ARRIVED) {
                    self.gimbal.wanted = None;
                }
                let report = GimbalReport { measured: now, tilt, range: self.gimbal.range };
                self.push_measured(now, DroneEvent::Gimbal(report));
            }
        }
    }

    /// Tilts the camera, radians below the horizon. Not while somebody else flies.
    pub fn tilt(&mut self, now: Time, tilt: f64) {
        if matches!(self.control, Control::Released | Control::Watching) || !self.gimbal.used {
            return;
        }
        self.gimbal.wanted = Some((tilt.max(self.gimbal.range[0]).min(self.gimbal.range[1]), now, 0));
    }

    /// Commands what is wanted, until it is shown.
    pub(super) fn advance_gimbal(&mut self, now: Time) {
        let Some((tilt, _, tries)) = self.gimbal.wanted.filter(|(_, again, _)| now >= *again) else { return };
        if matches!(self.control, Control::Released) {
            self.gimbal.wanted = None;
            return;
        }
        if tries >= TRIES {
            self.gimbal.wanted = None;
            let texts = self.facts.recent_words(now);
            self.notices.push_back(Notice::Refused { what: "the tilt of the camera", result: CommandResult::Unanswered, texts });
            return;
        }
        self.gimbal.wanted = Some((tilt, now + AGAIN, tries + 1));
        if self.gimbal.old {
            self.commands.submit(mount(tilt));
            return;
        }
        if !core::mem::replace(&mut self.gimbal.in_control, true) {
            self.commands.submit(take_control(self.own));
        }
        self.commands.submit(point(tilt));
    }

    /// The manager does not take a command: from now on the older one is used.
    pub(super) fn gimbal_is_old(&mut self, now: Time) {
        self.gimbal.old = true;
        if let Some((tilt, ..)) = self.gimbal.wanted {
            self.gimbal.wanted = Some((tilt, now, 0));
        }
    }
}
