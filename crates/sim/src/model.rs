//! The two craft models: parameters shared with the core, and those only the simulator needs.

use spf_core::craft::{Craft, CraftKind};

/// Parameters of a simulated craft. SI units and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Kind of craft, which determines the contents of its telemetry.
    pub kind: CraftKind,
    /// Parameters shared with executor and envelope.
    pub craft: Craft,
    /// Maximum horizontal speed, m/s; faster setpoints are limited to it.
    pub max_speed: f64,
    /// Maximum climb rate, m/s.
    pub max_climb: f64,
    /// Maximum descent rate, m/s, > 0.
    pub max_sink: f64,
    /// Maximum yaw rate, rad/s.
    pub max_yaw_rate: f64,
    /// Maximum tilt, radians, which bounds the thrust available for acceleration, drag and wind.
    pub max_tilt: f64,
    /// Time constant of the attitude response, s.
    pub tilt_lag: f64,
    /// Linear drag: deceleration per speed through the air, 1/s.
    pub drag: f64,
    /// Time constant of the controller's wind estimate, s.
    pub wind_lag: f64,
    /// Climb rate of an automatic take-off, m/s.
    pub take_off_speed: f64,
    /// Time that the motors run before an automatic take-off lifts off, s.
    pub spin_up: f64,
    /// Descent rate of an automatic landing, m/s.
    pub landing_speed: f64,
    /// Descent rate at touch-down, m/s; between the landing speed and this, the rate in m/s equals the height in m.
    pub touch_down_speed: f64,
    /// Standard deviation of the drift velocity at hover, along each horizontal axis, m/s.
    pub creep: f64,
    /// Fraction of the battery used per second in the air.
    pub drain_flying: f64,
    /// Fraction of the battery used per second with the motors off.
    pub drain_idle: f64,
    /// Telemetry errors and rates.
    pub senses: SensorParameters,
}

/// Errors and rates of telemetry. Spreads are standard deviations; a slow error is a random walk with its time
/// constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorParameters {
    /// Report interval, milliseconds; a multiple of the 5 ms tick.
    pub period_ms: u64,
    /// Position error, slow, along each axis, metres; `None` if the craft has no position.
    pub position: Option<f64>,
    /// Time constant of the position error, s.
    pub position_time: f64,
    /// Error of the height above the take-off point, if measured separately, slow, metres.
    pub height: f64,
    /// Velocity error, white, along each axis, m/s.
    pub velocity: f64,
    /// Heading error, slow, radians.
    pub heading: f64,
    /// Time constant of the heading error, s.
    pub heading_time: f64,
    /// Yaw rate error, white, rad/s; `None` if the craft does not report it.
    pub yaw_rate: Option<f64>,
    /// Resolution of the values.
    pub steps: Resolutions,
}

/// Resolution of telemetry values: each is rounded to the nearest multiple; zero for no rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Resolutions {
    /// Angles of the attitude, radians.
    pub angle: f64,
    /// Velocities, m/s.
    pub velocity: f64,
    /// Height, m.
    pub height: f64,
    /// Battery, as a fraction of full charge.
    pub battery: f64,
}

impl Model {
    /// The model of this kind.
    #[must_use]
    pub fn of(kind: CraftKind) -> Self {
        match kind {
            CraftKind::Quad => Self::quad(),
            CraftKind::Tello => Self::tello(),
        }
    }

    /// The generic quadrotor: [`Craft::quad`], up to 10 m/s, 30° of tilt; drag of 0.3/s tilts it by 5° at 3 m/s.
    #[must_use]
    pub fn quad() -> Self {
        let craft = Craft::quad();
        Self {
            kind: CraftKind::Quad,
            craft,
            max_speed: 10.0,
            max_climb: 3.0,
            max_sink: 2.0,
            max_yaw_rate: craft.yaw_rate,
            max_tilt: 30.0_f64.to_radians(),
            tilt_lag: 0.1,
            drag: 0.3,
            wind_lag: 1.0,
            take_off_speed: 1.0,
            spin_up: 0.5,
            landing_speed: 1.0,
            touch_down_speed: 0.3,
            creep: 0.0,
            drain_flying: 1.0 / 1500.0,
            drain_idle: 1.0 / 20_000.0,
            senses: SensorParameters {
                period_ms: 50,
                position: Some(0.3),
                position_time: 30.0,
                height: 0.0,
                velocity: 0.05,
                heading: 1.0_f64.to_radians(),
                heading_time: 30.0,
                yaw_rate: Some(0.5_f64.to_radians()),
                steps: Resolutions { battery: 0.01, ..Resolutions::default() },
            },
        }
    }

    /// The Tello: [`Craft::tello`] with 9° of tilt (slow mode), whose balance with drag at the manual's 4 m/s gives the
    /// drag; 1 s of spin-up (a take-off then lasts the 3.9 s of a published log), automatic climb and descent at 0.5
    /// m/s down to the ground; 0.13 % of the battery per second in the air. The heading drifts by 2°, and the hover
    /// drifts at 2 cm/s, which over its time constant of 5 s gives the 5–10 cm observed over textured floors.
    #[must_use]
    pub fn tello() -> Self {
        let craft = Craft::tello();
        let max_tilt = 9.0_f64.to_radians();
        Self {
            kind: CraftKind::Tello,
            craft,
            max_speed: 1.0,
            max_climb: 1.0,
            max_sink: 0.8,
            max_yaw_rate: craft.yaw_rate,
            max_tilt,
            tilt_lag: 0.1,
            drag: GRAVITY * libm::tan(max_tilt) / 4.0,
            wind_lag: 1.0,
            take_off_speed: 0.5,
            spin_up: 1.0,
            landing_speed: 0.5,
            touch_down_speed: 0.5,
            creep: 0.02,
            drain_flying: 0.0013,
            drain_idle: 0.0003,
            senses: SensorParameters {
                period_ms: 100,
                position: None,
                position_time: 0.0,
                height: 0.05,
                velocity: 0.03,
                heading: 2.0_f64.to_radians(),
                heading_time: 60.0,
                yaw_rate: None,
                steps: Resolutions { angle: 1.0_f64.to_radians(), velocity: 0.1, height: 0.1, battery: 0.01 },
            },
        }
    }

    /// The same craft with another cruise speed; limits are raised where necessary.
    #[must_use]
    pub fn with_cruise_speed(mut self, speed: f64) -> Self {
        self.craft.cruise_speed = speed;
        self.max_speed = self.max_speed.max(speed);
        self
    }
}

/// Standard gravity, m/s².
pub const GRAVITY: f64 = 9.806_65;
