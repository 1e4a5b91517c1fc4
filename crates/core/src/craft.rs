//! Craft models: the parameters shared by executor, envelope and simulator.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;

/// Speed below which a craft counts as standing still, m/s (the pilot uses the same value for the next frame).
const STANDSTILL: f64 = 0.1;

/// Limits and dynamics of a craft. SI units and radians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Craft {
    /// Preset horizontal speed of a primitive, m/s (the paper's `P_pitch`).
    pub cruise_speed: f64,
    /// Preset climb and descent rate, m/s (the paper's `P_throttle`).
    pub climb_speed: f64,
    /// Preset yaw rate, rad/s (the paper's `P_yaw`).
    pub yaw_rate: f64,
    /// Horizontal acceleration limit, m/s².
    pub acceleration: f64,
    /// Vertical acceleration limit, m/s².
    pub climb_acceleration: f64,
    /// Angular acceleration limit about the vertical, rad/s².
    pub yaw_acceleration: f64,
    /// Time constant of the first-order velocity response, s.
    pub lag: f64,
    /// Time from a setpoint's arrival to the first motion, s.
    pub dead_time: f64,
    /// Radius of the body for collisions and corridors, m.
    pub radius: f64,
    /// Height above ground after take-off, m.
    pub take_off_height: f64,
    /// Height above home to which it climbs at most before it returns by its own navigation, m; `None` if it cannot return.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub return_height: Option<f64>,
    /// Height that it climbs at least before such a return, from wherever it is, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub return_climb: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Craft {
    /// The simulator's general quadrotor (`docs/reference/dynamics.md`): 3 m/s, 4 m/s², lag 0.3 s, dead time 0.1 s.
    #[must_use]
    pub fn quad() -> Self {
        Self {
            cruise_speed: 3.0,
            climb_speed: 1.0,
            yaw_rate: 95.0_f64.to_radians(),
            acceleration: 4.0,
            climb_acceleration: 3.0,
            yaw_acceleration: 600.0_f64.to_radians(),
            lag: 0.3,
            dead_time: 0.1,
            radius: 0.3,
            take_off_height: 3.0,
            return_height: None,
            return_climb: 0.0,
        }
    }

    /// A DJI/Ryze Tello under SDK `rc` commands: 1 m/s, 1.55 m/s², dead time 0.35 s, take-off to 0.8 m.
    #[must_use]
    pub fn tello() -> Self {
        Self {
            cruise_speed: 1.0,
            climb_speed: 0.8,
            yaw_rate: 95.0_f64.to_radians(),
            acceleration: 1.55,
            climb_acceleration: 1.55,
            yaw_acceleration: 600.0_f64.to_radians(),
            lag: 0.2,
            dead_time: 0.35,
            radius: 0.15,
            take_off_height: 0.8,
            return_height: None,
            return_climb: 0.0,
        }
    }

    /// Time from a zero setpoint to standstill (below 0.1 m/s) from `speed` m/s, s: the dead time plus v/a, or the time
    /// of the first-order lag where its tail takes longer than the acceleration limit.
    #[must_use]
    pub fn standstill_time(&self, speed: f64) -> f64 {
        let (speed, a) = (speed.abs(), self.acceleration.max(0.01));
        // The craft slows by min(a, v/lag): at the limit down to a·lag, exponentially from there.
        let knee = (a * self.lag).min(speed);
        let tail = if knee > STANDSTILL { self.lag * libm::log(knee / STANDSTILL) } else { 0.0 };
        self.dead_time + (speed / a).max((speed - knee) / a + tail)
    }
}

/// The craft model a scene is flown with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CraftKind {
    /// A general quadrotor with GPS-like position (`docs/reference/dynamics.md`).
    #[default]
    Quad,
    /// A DJI/Ryze Tello.
    Tello,
}

impl CraftKind {
    /// Its name in scene files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Quad => "quad",
            Self::Tello => "tello",
        }
    }

    /// The craft's parameters.
    #[must_use]
    pub fn craft(self) -> Craft {
        match self {
            Self::Quad => Craft::quad(),
            Self::Tello => Craft::tello(),
        }
    }

    /// The craft's camera.
    #[must_use]
    pub fn camera(self) -> Camera {
        match self {
            Self::Quad => Camera::quad(),
            Self::Tello => Camera::tello(),
        }
    }

    /// The kind with this name; `None` if unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Quad, Self::Tello].into_iter().find(|kind| kind.name() == name)
    }
}
