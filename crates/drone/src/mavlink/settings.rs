//! MAVLink settings.

/// How a vehicle is flown by MAVLink.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MavlinkSettings {
    /// The vehicle's system number; `None` for the only one that is heard.
    pub vehicle: Option<u8>,
    /// Our system number; `None` for that of the vehicle, of which this program is then an onboard computer.
    pub system: Option<u8>,
    /// Tilt of the camera at the start, by its gimbal.
    pub gimbal: GimbalUse,
    /// The fence with which that of the autopilot is replaced before a flight; `None` leaves it.
    pub fence: Option<FencePlan>,
}

/// Whether the camera is on the vehicle's gimbal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum GimbalUse {
    /// It is, if the vehicle reports one.
    #[default]
    Reported,
    /// It is, and begins with this tilt below the horizon, radians.
    At(f64),
    /// It is not.
    Off,
}

/// A fence in metres east and north of the origin of the vehicle's position.
#[derive(Clone, Debug, PartialEq)]
pub enum FencePlan {
    /// A circle around home.
    Circle {
        /// Metres.
        radius: f64,
    },
    /// Inside a polygon, and outside of holes in it.
    Polygon {
        /// Its corners.
        outer: Vec<(f64, f64)>,
        /// The corners of each hole.
        holes: Vec<Vec<(f64, f64)>>,
    },
}
