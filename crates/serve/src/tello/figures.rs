//! What a Tello's protocol measures: the times its answers take, and what it refuses.

use spf_core::rng::Draw;
use spf_core::time::{Duration, duration_from_secs};

/// Which SDK the firmware speaks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Firmware {
    /// Tello, SDK 1.3.
    V13,
    /// Tello EDU, SDK 2.0: mission pads, `stop`, station mode.
    #[default]
    V20,
    /// RoboMaster TT and newer EDU, SDK 3.0: ports, video settings, `EXT`.
    V30,
}

impl Firmware {
    /// The firmware of that name: `1.3`, `2.0` or `3.0`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::V13, Self::V20, Self::V30].into_iter().find(|firmware| firmware.name() == name)
    }

    /// The SDK's number.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::V13 => "1.3",
            Self::V20 => "2.0",
            Self::V30 => "3.0",
        }
    }
}

/// Times and limits of the protocol. Seconds, metres, m/s, radians; spreads are standard deviations unless said.
///
/// Most are published measurements (`docs/guide/tello.md` lists which); all can be changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// An answer that waits for no motion takes this long …
    pub quick: f64,
    /// … give or take this, uniformly.
    pub quick_spread: f64,
    /// A refusal takes this long.
    pub refusal: f64,
    /// From the end of a manoeuvre to its answer.
    pub settle: f64,
    /// Without a command for so long, it lands.
    pub idle_landing: f64,
    /// A manoeuvre that is not done by then beyond its own length is given up with `error Run timeout`.
    pub run_timeout: f64,
    /// Between lines of state.
    pub state_period: f64,
    /// Speed on the map at full stick.
    pub stick_speed: f64,
    /// Climb rate at full stick.
    pub stick_climb: f64,
    /// Sink rate at full stick.
    pub stick_sink: f64,
    /// Yaw rate at full stick.
    pub stick_yaw: f64,
    /// Yaw rate of `cw` and `ccw`.
    pub turn_rate: f64,
    /// Spread of a move's length, as a fraction of it.
    pub move_share: f64,
    /// Spread of a move's length that is there however short it is.
    pub move_fixed: f64,
    /// Spread of a turn.
    pub turn_spread: f64,
    /// Way of a flip.
    pub flip_way: f64,
    /// No flips at this charge or below.
    pub flip_battery: f64,
    /// No take-off below this charge.
    pub take_off_battery: f64,
}

impl Default for Figures {
    fn default() -> Self {
        Self {
            quick: 0.030,
            quick_spread: 0.015,
            refusal: 0.045,
            settle: 0.3,
            idle_landing: 15.0,
            run_timeout: 15.0,
            state_period: 0.1,
            stick_speed: 1.0,
            stick_climb: 1.0,
            stick_sink: 0.8,
            stick_yaw: 95.0_f64.to_radians(),
            turn_rate: 90.0_f64.to_radians(),
            move_share: 0.05,
            move_fixed: 0.05,
            turn_spread: 2.0_f64.to_radians(),
            flip_way: 0.3,
            flip_battery: 0.5,
            take_off_battery: 0.10,
        }
    }
}

impl Figures {
    /// The same without chance in moves and turns: for tests of what flies it.
    #[must_use]
    pub fn exact() -> Self {
        Self { move_share: 0.0, move_fixed: 0.0, turn_spread: 0.0, quick_spread: 0.0, ..Self::default() }
    }

    pub(super) fn quick(&self, draw: &mut Draw) -> Duration {
        duration_from_secs(self.quick + self.quick_spread * (2.0 * draw.uniform() - 1.0))
    }
}
