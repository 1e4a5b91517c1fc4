//! Parameters of the Tello protocol: response times and limits.

use spf_core::rng::RandomStream;
use spf_core::time::{Duration, duration_from_secs};

/// SDK version of the firmware.
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
    /// The firmware with this name: `1.3`, `2.0` or `3.0`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::V13, Self::V20, Self::V30].into_iter().find(|firmware| firmware.name() == name)
    }

    /// SDK version.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::V13 => "1.3",
            Self::V20 => "2.0",
            Self::V30 => "3.0",
        }
    }
}

/// Times and limits of the protocol. Seconds, metres, m/s, radians; spreads are standard deviations unless stated
/// otherwise.
///
/// Most are published measurements (listed in `docs/guide/tello.md`); all can be changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProtocolParameters {
    /// Response time without motion …
    pub quick: f64,
    /// … plus or minus this, uniformly distributed.
    pub quick_spread: f64,
    /// Response time of a refusal.
    pub refusal: f64,
    /// Time from the end of a manoeuvre to its response.
    pub settle: f64,
    /// Time without a command after which it lands.
    pub idle_landing: f64,
    /// Time beyond its regular duration after which a manoeuvre is aborted with `error Run timeout`.
    pub run_timeout: f64,
    /// Interval of state lines.
    pub state_period: f64,
    /// Horizontal speed at full stick.
    pub stick_speed: f64,
    /// Climb rate at full stick.
    pub stick_climb: f64,
    /// Descent rate at full stick.
    pub stick_sink: f64,
    /// Yaw rate at full stick.
    pub stick_yaw: f64,
    /// Yaw rate of `cw` and `ccw`.
    pub turn_rate: f64,
    /// Standard deviation of the length of a move, as a fraction of it.
    pub move_share: f64,
    /// Standard deviation of the length of a move, independent of it.
    pub move_fixed: f64,
    /// Standard deviation of a turn.
    pub turn_spread: f64,
    /// Distance of a flip.
    pub flip_distance: f64,
    /// Charge at or below which flips are refused.
    pub flip_battery: f64,
    /// Charge below which take-off is refused.
    pub take_off_battery: f64,
}

impl Default for ProtocolParameters {
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
            flip_distance: 0.3,
            flip_battery: 0.5,
            take_off_battery: 0.10,
        }
    }
}

impl ProtocolParameters {
    /// The same without random errors in moves and turns, for tests of clients.
    #[must_use]
    pub fn exact() -> Self {
        Self { move_share: 0.0, move_fixed: 0.0, turn_spread: 0.0, quick_spread: 0.0, ..Self::default() }
    }

    pub(super) fn quick(&self, rng: &mut RandomStream) -> Duration {
        duration_from_secs(self.quick + self.quick_spread * (2.0 * rng.uniform() - 1.0))
    }
}
