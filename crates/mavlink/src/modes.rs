//! Autopilots and their flight modes, as heartbeats and mode commands carry them.

use core::fmt;

/// A family of autopilots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autopilot {
    /// PX4 (`MAV_AUTOPILOT_PX4`, 12).
    Px4,
    /// ArduPilot, flown as ArduCopter (`MAV_AUTOPILOT_ARDUPILOTMEGA`, 3).
    ArduPilot,
}

impl Autopilot {
    /// The autopilot of a heartbeat's `autopilot` field; `None` for any other.
    #[must_use]
    pub fn from_heartbeat(autopilot: u8) -> Option<Self> {
        match autopilot {
            12 => Some(Self::Px4),
            3 => Some(Self::ArduPilot),
            _ => None,
        }
    }

    /// The value of a heartbeat's `autopilot` field.
    #[must_use]
    pub fn to_heartbeat(self) -> u8 {
        match self {
            Self::Px4 => 12,
            Self::ArduPilot => 3,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Px4 => "PX4",
            Self::ArduPilot => "ArduPilot",
        }
    }

    /// The mode in which it is flown by setpoints of another program.
    #[must_use]
    pub fn external(self) -> Mode {
        match self {
            Self::Px4 => Mode::px4(6, 0),
            Self::ArduPilot => Mode(self, 4),
        }
    }

    /// The mode in which it holds its position by itself.
    #[must_use]
    pub fn hold(self) -> Mode {
        match self {
            Self::Px4 => Mode::px4(4, 3),
            Self::ArduPilot => Mode(self, 17),
        }
    }

    /// The mode in which it lands where it is.
    #[must_use]
    pub fn land(self) -> Mode {
        match self {
            Self::Px4 => Mode::px4(4, 6),
            Self::ArduPilot => Mode(self, 9),
        }
    }

    /// The mode in which it returns to its home position and lands.
    #[must_use]
    pub fn return_home(self) -> Mode {
        match self {
            Self::Px4 => Mode::px4(4, 5),
            Self::ArduPilot => Mode(self, 6),
        }
    }
}

/// A flight mode, by the `custom_mode` of the heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode(
    /// Of this autopilot.
    pub Autopilot,
    /// `custom_mode`.
    pub u32,
);

/// PX4's modes: main mode, sub-mode, name (`px4_custom_mode.h`).
const PX4: [(u32, u32, &str); 16] = [
    (1, 0, "MANUAL"),
    (2, 0, "ALTCTL"),
    (3, 0, "POSCTL"),
    (4, 1, "AUTO.READY"),
    (4, 2, "AUTO.TAKEOFF"),
    (4, 3, "AUTO.LOITER"),
    (4, 4, "AUTO.MISSION"),
    (4, 5, "AUTO.RTL"),
    (4, 6, "AUTO.LAND"),
    (4, 8, "AUTO.FOLLOW_TARGET"),
    (4, 9, "AUTO.PRECLAND"),
    (5, 0, "ACRO"),
    (6, 0, "OFFBOARD"),
    (7, 0, "STABILIZED"),
    (8, 0, "RATTITUDE"),
    (10, 0, "TERMINATION"),
];

/// ArduCopter's modes (`ArduCopter/mode.h`).
const COPTER: [(u32, &str); 24] = [
    (0, "STABILIZE"),
    (1, "ACRO"),
    (2, "ALT_HOLD"),
    (3, "AUTO"),
    (4, "GUIDED"),
    (5, "LOITER"),
    (6, "RTL"),
    (7, "CIRCLE"),
    (9, "LAND"),
    (11, "DRIFT"),
    (13, "SPORT"),
    (14, "FLIP"),
    (15, "AUTOTUNE"),
    (16, "POSHOLD"),
    (17, "BRAKE"),
    (18, "THROW"),
    (19, "AVOID_ADSB"),
    (20, "GUIDED_NOGPS"),
    (21, "SMART_RTL"),
    (22, "FLOWHOLD"),
    (23, "FOLLOW"),
    (24, "ZIGZAG"),
    (26, "AUTOROTATE"),
    (27, "AUTO_RTL"),
];

impl Mode {
    /// A mode of PX4 by main and sub-mode.
    #[must_use]
    pub fn px4(main: u32, sub: u32) -> Self {
        Self(Autopilot::Px4, (main & 0xff) << 16 | (sub & 0xff) << 24)
    }

    /// Parameters 2 and 3 of `MAV_CMD_DO_SET_MODE`.
    #[must_use]
    pub fn parameters(self) -> [f32; 2] {
        match self.0 {
            Autopilot::Px4 => [(self.1 >> 16 & 0xff) as f32, (self.1 >> 24) as f32],
            Autopilot::ArduPilot => [self.1 as f32, 0.0],
        }
    }

    /// The mode that parameters 2 and 3 of `MAV_CMD_DO_SET_MODE` name, if they are whole numbers of a known mode.
    #[must_use]
    pub fn from_parameters(autopilot: Autopilot, [main, sub]: [f32; 2]) -> Option<Self> {
        let whole = |value: f32| (value.fract() == 0.0 && (0.0..256.0).contains(&value)).then_some(value as u32);
        let mode = match autopilot {
            Autopilot::Px4 => Self::px4(whole(main)?, if sub.is_nan() { 0 } else { whole(sub)? }),
            Autopilot::ArduPilot => Self(autopilot, whole(main)?),
        };
        mode.known().map(|_| mode)
    }

    fn known(self) -> Option<&'static str> {
        match self.0 {
            Autopilot::Px4 => PX4.iter().find(|(main, sub, _)| Self::px4(*main, *sub) == self).map(|(.., name)| *name),
            Autopilot::ArduPilot => COPTER.iter().find(|(number, _)| *number == self.1).map(|(_, name)| *name),
        }
    }

    /// Whether it lands by itself in this mode, at once or after a return.
    #[must_use]
    pub fn is_landing(self) -> bool {
        self == self.0.land() || self.is_returning() || self == Self::px4(4, 9)
    }

    /// Whether it returns home in this mode.
    #[must_use]
    pub fn is_returning(self) -> bool {
        self == self.0.return_home() || (self.0 == Autopilot::ArduPilot && matches!(self.1, 21 | 27))
    }

    /// Whether this is PX4's automatic take-off, after which it holds by itself.
    #[must_use]
    pub fn is_take_off(self) -> bool {
        self == Self::px4(4, 2)
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.known() {
            Some(name) => f.write_str(name),
            None => write!(f, "mode {:#x}", self.1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_those_of_the_headers() {
        let px4 = Autopilot::Px4;
        assert_eq!((px4.external().1, px4.external().to_string()), (0x0006_0000, "OFFBOARD".to_owned()));
        assert_eq!((px4.hold().1, px4.hold().to_string()), (0x0304_0000, "AUTO.LOITER".to_owned()));
        assert_eq!((px4.land().1, px4.return_home().1), (0x0604_0000, 0x0504_0000));
        let copter = Autopilot::ArduPilot;
        let names = [copter.external(), copter.hold(), copter.land(), copter.return_home()].map(|mode| mode.to_string());
        assert_eq!(names, ["GUIDED", "BRAKE", "LAND", "RTL"]);
        assert_eq!(Mode(copter, 99).to_string(), "mode 0x63");
    }

    #[test]
    fn the_parameters_of_a_mode_name_it() {
        for (autopilot, mode) in [Autopilot::Px4, Autopilot::ArduPilot]
            .into_iter()
            .flat_map(|it| [it.external(), it.hold(), it.land(), it.return_home()].map(|mode| (it, mode)))
        {
            assert_eq!(Mode::from_parameters(autopilot, mode.parameters()), Some(mode));
        }
        assert_eq!(Mode::from_parameters(Autopilot::Px4, [6.0, f32::NAN]), Some(Autopilot::Px4.external()));
        for wrong in [[f32::NAN, 0.0], [6.5, 0.0], [-1.0, 0.0], [300.0, 0.0], [6.0, 9.0]] {
            assert_eq!(Mode::from_parameters(Autopilot::Px4, wrong), None, "{wrong:?}");
        }
    }
}
