//! Settings of the driver.

/// How a vehicle of a simulator is flown and seen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AirSimSettings {
    /// Name of the camera that looks ahead.
    pub camera: String,
    /// Whether the pilot gets the exact pose, and not one with the errors of satellite navigation and a compass.
    pub true_pose: bool,
    /// Whether depth images are asked for, as of a stereo camera.
    pub depth_sensor: bool,
    /// Whether the simulator is paused while the pilot thinks.
    pub lockstep: bool,
    /// Seed of the errors put on pose and depth.
    pub seed: u64,
}

impl Default for AirSimSettings {
    /// The camera `0`, with the errors of sensors, without depth, in real time.
    fn default() -> Self {
        Self { camera: "0".to_owned(), true_pose: false, depth_sensor: false, lockstep: false, seed: 0 }
    }
}
