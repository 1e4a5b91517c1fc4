//! The gimbal of the camera: what it reports, and where it is told to look. A manager of version 2 is tried first, and after its
//! word that it is not supported the commands for older mounts. Control is not taken from anybody else but at the user's wish.

use spf_core::geometry::wrap_angle;
use spf_core::gimbal::GimbalReport;
use spf_core::time::{Duration, Time};
use spf_mavlink::command::CommandResult;
use spf_mavlink::gimbal::{GimbalNews, Look, mount, point, take_control};

use super::Vehicle;
use super::clock::BootClock;
use super::control::Control;
use crate::DroneEvent;

/// The range of a gimbal that does not tell, radians below the horizon: from 20° above it to straight down.
const RANGE: [f64; 2] = [-20.0 / 180.0 * core::f64::consts::PI, core::f64::consts::FRAC_PI_2];
/// It has arrived within this of where it was told to look, radians: 3°.
const ARRIVED: f64 = 3.0 / 180.0 * core::f64::consts::PI;
/// A camera that looks farther aside than this shows what is not ahead, radians: 5°.
const ASIDE: f64 = 5.0 / 180.0 * core::f64::consts::PI;
/// A report that is older tells nothing.
const HEARD: Duration = Duration::from_secs(1);
/// `MAV_RESULT` that another station has control.
const NOT_IN_CONTROL: CommandResult = CommandResult::Other(10);
/// A tilt that is not shown is commanded again after this long, at most this often.
const AGAIN: Duration = Duration::from_secs(3);
const TRIES: u8 = 3;

/// What is refused.
const TILT: &str = "the tilt of the camera";

/// What is known of the gimbal.
#[derive(Debug)]
pub(super) struct GimbalState {
    /// Whether its reports are used: the camera may be elsewhere.
    used: bool,
    range: [f64; 2],
    tilt: Option<(Time, f64)>,
    /// The first gimbal that was heard, and its clock.
    device: Option<[u8; 2]>,
    clock: BootClock,
    /// Who has control of it, as its manager says.
    control: Option<[u8; 2]>,
    /// Whether the user wants it tilted, whoever has control.
    wanted_by_user: bool,
    /// Whether it does not follow, or somebody else has it and that was told.
    refused: bool,
    told: bool,
    /// Where it was told to look, when it is told again, and how often it was told.
    wanted: Option<(f64, Time, u8)>,
    /// Whether a manager of version 2 has refused.
    old: bool,
    in_control: bool,
}

impl Default for GimbalState {
    fn default() -> Self {
        Self {
            used: true,
            range: RANGE,
            tilt: None,
            device: None,
            clock: BootClock::default(),
            control: None,
            wanted_by_user: false,
            refused: false,
            told: false,
            wanted: None,
            old: false,
            in_control: false,
        }
    }
}

impl Vehicle {
    /// Its reports are not used: the camera is not on it.
    pub fn ignore_gimbal(&mut self) {
        self.gimbal.used = false;
    }

    /// Tilt of the camera below the horizon, radians, as the gimbal reports it.
    #[must_use]
    pub fn camera_tilt(&self, now: Time) -> Option<f64> {
        let (at, tilt) = self.gimbal.tilt.filter(|_| self.gimbal.used)?;
        (now.since(at) <= HEARD).then_some(tilt)
    }

    /// The gimbal's range, if there is a gimbal.
    #[must_use]
    pub fn gimbal_range(&self, now: Time) -> Option<[f64; 2]> {
        self.camera_tilt(now).map(|_| self.gimbal.range)
    }

    /// The user wants the camera tilted: control is taken, whoever has it.
    pub fn insist_on_gimbal(&mut self) {
        self.gimbal.wanted_by_user = true;
    }

    /// Whether another station has control of the gimbal, and may keep it.
    fn is_gimbal_theirs(&self) -> bool {
        !self.gimbal.wanted_by_user && self.gimbal.control.is_some_and(|whose| whose != [0, 0] && whose != self.own)
    }

    /// A report of where the camera looks.
    fn look(&mut self, now: Time, look: &Look) {
        // Of several gimbals the first counts: the others carry other cameras.
        if *self.gimbal.device.get_or_insert(look.device) != look.device {
            return;
        }
        let Some(measured) = self.gimbal.clock.measured(now, look.boot_ms) else { return };
        let ahead = if look.from_north { self.sensed.heading(now) } else { Some(0.0) };
        let aside = look.yaw.zip(ahead).is_none_or(|(yaw, ahead)| wrap_angle(yaw - ahead).abs() > ASIDE);
        let tilt = look.tilt;
        self.gimbal.tilt = Some((measured, tilt));
        if self.gimbal.wanted.is_some_and(|(wanted, ..)| (wanted - tilt).abs() < ARRIVED) {
            self.gimbal.wanted = None;
        }
        // One that may not be tilted has no range: the craft climbs instead.
        let range = if self.gimbal.refused || self.is_gimbal_theirs() { [tilt; 2] } else { self.gimbal.range };
        self.push_measured(now, DroneEvent::Gimbal(GimbalReport { measured, tilt, range, aside }));
    }

    /// A report of the gimbal.
    pub fn handle_gimbal(&mut self, now: Time, news: GimbalNews) {
        if !self.gimbal.used {
            return;
        }
        match news {
            GimbalNews::Range(range) => self.gimbal.range = range,
            GimbalNews::Look(look) => self.look(now, &look),
            GimbalNews::Control(whose) => {
                self.gimbal.control = Some(whose);
                if self.is_gimbal_theirs() {
                    (self.gimbal.wanted, self.gimbal.in_control) = (None, false);
                }
            }
        }
    }

    /// Tilts the camera, radians below the horizon. Not while somebody else flies.
    pub fn tilt(&mut self, now: Time, tilt: f64) {
        if matches!(self.control, Control::Released(_) | Control::Watching) || !self.gimbal.used {
            return;
        }
        if self.gimbal.refused || self.is_gimbal_theirs() {
            if !core::mem::replace(&mut self.gimbal.told, true) {
                self.refuse(now, TILT, NOT_IN_CONTROL);
            }
            return;
        }
        self.gimbal.wanted = Some((tilt.max(self.gimbal.range[0]).min(self.gimbal.range[1]), now, 0));
    }

    /// Commands what is wanted, until it is shown.
    pub(super) fn advance_gimbal(&mut self, now: Time) {
        let Some((tilt, _, tries)) = self.gimbal.wanted.filter(|(_, again, _)| now >= *again) else { return };
        if matches!(self.control, Control::Released(_)) {
            self.gimbal.wanted = None;
            return;
        }
        if tries >= TRIES {
            return self.gimbal_is_refused(now, CommandResult::Unanswered);
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

    /// It does not follow: it is not tilted any more.
    pub(super) fn gimbal_is_refused(&mut self, now: Time, result: CommandResult) {
        self.gimbal.wanted = None;
        if !core::mem::replace(&mut self.gimbal.refused, true) {
            self.gimbal.told = true;
            self.refuse(now, TILT, result);
        }
    }

    /// The manager does not know a command: from now on the older one is used.
    pub(super) fn gimbal_is_old(&mut self, now: Time) {
        self.gimbal.old = true;
        if let Some((tilt, ..)) = self.gimbal.wanted {
            self.gimbal.wanted = Some((tilt, now, 0));
        }
    }
}
