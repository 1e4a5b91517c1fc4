//! The gimbal of the camera: what it reports, and where it is told to look. A manager of version 2 is tried first, and after its
//! word that it is not supported the commands for older mounts. Control is not taken from anybody else but at the user's wish.

use spf_core::geometry::wrap_angle;
use spf_core::gimbal::GimbalReport;
use spf_core::time::{Duration, Time};
use spf_mavlink::command::{CommandResult, Commands, ids};
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

impl GimbalState {
    /// Tilt of the camera below the horizon, radians, if it was reported lately.
    fn tilt(&self, now: Time) -> Option<f64> {
        let (at, tilt) = self.tilt.filter(|_| self.used)?;
        (now.since(at) <= HEARD).then_some(tilt)
    }

    /// Whether another station than our `own` has control of it, and may keep it.
    fn is_theirs(&self, own: [u8; 2]) -> bool {
        !self.wanted_by_user && self.control.is_some_and(|whose| whose != [0, 0] && whose != own)
    }

    /// A report of where the camera looks, of a craft with this heading, radians.
    fn look(&mut self, now: Time, look: &Look, own: [u8; 2], heading: Option<f64>) -> Option<GimbalReport> {
        // Of several gimbals the first counts: the others carry other cameras.
        if *self.device.get_or_insert(look.device) != look.device {
            return None;
        }
        let measured = self.clock.measured(now, look.boot_ms)?;
        let ahead = if look.from_north { heading } else { Some(0.0) };
        let aside = look.yaw.zip(ahead).is_none_or(|(yaw, ahead)| wrap_angle(yaw - ahead).abs() > ASIDE);
        let tilt = look.tilt;
        self.tilt = Some((measured, tilt));
        if self.wanted.is_some_and(|(wanted, ..)| (wanted - tilt).abs() < ARRIVED) {
            self.wanted = None;
        }
        // One that may not be tilted has no range: the craft climbs instead.
        let range = if self.refused || self.is_theirs(own) { [tilt; 2] } else { self.range };
        Some(GimbalReport { measured, tilt, range, aside })
    }

    fn handle(&mut self, now: Time, news: GimbalNews, own: [u8; 2], heading: Option<f64>) -> Option<GimbalReport> {
        if !self.used {
            return None;
        }
        match news {
            GimbalNews::Range(range) => self.range = range,
            GimbalNews::Look(look) => return self.look(now, &look, own, heading),
            GimbalNews::Control(whose) => {
                self.control = Some(whose);
                if self.is_theirs(own) {
                    (self.wanted, self.in_control) = (None, false);
                }
            }
        }
        None
    }

    /// Wants the camera tilted, radians below the horizon. Returns a refusal that the user has not read yet.
    fn want(&mut self, now: Time, tilt: f64, own: [u8; 2]) -> Option<CommandResult> {
        if !self.used {
            return None;
        }
        if self.refused || self.is_theirs(own) {
            return (!core::mem::replace(&mut self.told, true)).then_some(NOT_IN_CONTROL);
        }
        self.wanted = Some((tilt.max(self.range[0]).min(self.range[1]), now, 0));
        None
    }

    /// Commands what is wanted, until it is shown, unless somebody else has the craft (`is_released`). Returns a refusal that the
    /// user has not read yet.
    fn advance(&mut self, now: Time, own: [u8; 2], is_released: bool, commands: &mut Commands) -> Option<CommandResult> {
        let (tilt, _, tries) = self.wanted.filter(|(_, again, _)| now >= *again)?;
        if is_released {
            self.wanted = None;
            return None;
        }
        if tries >= TRIES {
            return self.refuse(CommandResult::Unanswered);
        }
        self.wanted = Some((tilt, now + AGAIN, tries + 1));
        if self.old {
            commands.submit(mount(tilt));
            return None;
        }
        if !core::mem::replace(&mut self.in_control, true) {
            commands.submit(take_control(own));
        }
        commands.submit(point(tilt));
        None
    }

    /// It does not follow: it is not tilted any more. Returns the refusal if the user has not read it yet.
    fn refuse(&mut self, result: CommandResult) -> Option<CommandResult> {
        self.wanted = None;
        if core::mem::replace(&mut self.refused, true) {
            return None;
        }
        self.told = true;
        Some(result)
    }

    /// The result of a command to it, which was not accepted. Where its manager does not know the command, the older one is used
    /// from now on. Returns a refusal that the user has not read yet.
    fn settle(&mut self, now: Time, command: u16, result: CommandResult) -> Option<CommandResult> {
        if command == ids::MOUNT_CONTROL || result != CommandResult::Unsupported {
            return self.refuse(result);
        }
        self.old = true;
        self.wanted = self.wanted.map(|(tilt, ..)| (tilt, now, 0));
        None
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
        self.gimbal.tilt(now)
    }

    /// The gimbal's range, if there is a gimbal.
    #[must_use]
    pub fn gimbal_range(&self, now: Time) -> Option<[f64; 2]> {
        self.gimbal.tilt(now).map(|_| self.gimbal.range)
    }

    /// The user wants the camera tilted: control is taken, whoever has it.
    pub fn insist_on_gimbal(&mut self) {
        self.gimbal.wanted_by_user = true;
    }

    /// A report of the gimbal.
    pub fn handle_gimbal(&mut self, now: Time, news: GimbalNews) {
        if let Some(report) = self.gimbal.handle(now, news, self.own, self.sensed.heading(now)) {
            self.push_measured(now, DroneEvent::Gimbal(report));
        }
    }

    /// Tilts the camera, radians below the horizon. Not while somebody else flies.
    pub fn tilt(&mut self, now: Time, tilt: f64) {
        if matches!(self.control, Control::Released(_) | Control::Watching) {
            return;
        }
        if let Some(result) = self.gimbal.want(now, tilt, self.own) {
            self.refuse(now, TILT, result);
        }
    }

    /// Follows the result of a command to the gimbal, which was not accepted.
    pub(super) fn settle_gimbal(&mut self, now: Time, command: u16, result: CommandResult) {
        if let Some(result) = self.gimbal.settle(now, command, result) {
            self.refuse(now, TILT, result);
        }
    }

    /// Commands what is wanted of the gimbal, until it is shown.
    pub(super) fn advance_gimbal(&mut self, now: Time) {
        let is_released = matches!(self.control, Control::Released(_));
        if let Some(result) = self.gimbal.advance(now, self.own, is_released, &mut self.commands) {
            self.refuse(now, TILT, result);
        }
    }
}
