//! Gimbals: what they report of the camera's tilt, and the commands that tilt it. In MAVLink a pitch is negative downwards.

use mavlink::dialects::common::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage};

use crate::command::{VehicleCommand, ids};
use crate::wire::{MOUNT_STATUS, Packet};

/// The gimbal keeps the camera's roll and pitch (`GIMBAL_DEVICE_FLAGS_ROLL_LOCK`, `..._PITCH_LOCK`).
const LEVEL: f32 = 12.0;
/// `MAV_MOUNT_MODE_MAVLINK_TARGETING`.
const TARGETING: f32 = 2.0;

/// What a gimbal reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GimbalNews {
    /// Tilt of the camera below the horizon, radians.
    Tilt(f64),
    /// Least and greatest tilt, radians.
    Range([f64; 2]),
}

impl Packet {
    /// What a gimbal reports in it: `GIMBAL_DEVICE_ATTITUDE_STATUS`, `GIMBAL_MANAGER_INFORMATION`, `MOUNT_ORIENTATION` or
    /// `MOUNT_STATUS`. It may be a component of its own.
    #[must_use]
    pub fn gimbal(&self) -> Option<GimbalNews> {
        if self.id == MOUNT_STATUS {
            // Its pitch is in hundredths of a degree.
            let pitch = f64::from(i32::from_le_bytes(self.bytes(0))) * 0.01;
            return tilt(pitch.to_radians());
        }
        if !matches!(self.id, 265 | 280 | 285) {
            return None;
        }
        match self.message()? {
            MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(it) => tilt(pitch(&it)),
            #[allow(deprecated, reason = "older firmware has no other")]
            MavMessage::MOUNT_ORIENTATION(it) => tilt(f64::from(it.pitch).to_radians()),
            MavMessage::GIMBAL_MANAGER_INFORMATION(it) => {
                let range = [-f64::from(it.pitch_max), -f64::from(it.pitch_min)];
                (range.iter().all(|angle| angle.is_finite()) && range[0] < range[1]).then_some(GimbalNews::Range(range))
            }
            _ => None,
        }
    }
}

/// A pitch that a camera can have, as a tilt.
fn tilt(pitch: f64) -> Option<GimbalNews> {
    (pitch.is_finite() && pitch.abs() <= 3.2).then_some(GimbalNews::Tilt(-pitch))
}

/// Pitch of the camera above the horizon, radians: roll and pitch are relative to the horizon, whatever the yaw is relative to.
fn pitch(it: &GIMBAL_DEVICE_ATTITUDE_STATUS_DATA) -> f64 {
    let [w, x, y, z] = it.q.map(f64::from);
    libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0))
}

/// Takes control of the gimbal, as this system and component.
#[must_use]
pub fn take_control([system, component]: [u8; 2]) -> VehicleCommand {
    VehicleCommand::new(ids::GIMBAL_CONFIGURE, &[system.into(), component.into(), -1.0, -1.0, 0.0, 0.0, 0.0])
}

/// Tilts the camera by this angle below the horizon, radians, level and straight ahead: for gimbal managers (version 2).
#[must_use]
pub fn point(tilt: f64) -> VehicleCommand {
    let nan = f32::NAN;
    VehicleCommand::new(ids::GIMBAL_PITCHYAW, &[-tilt.to_degrees() as f32, 0.0, nan, nan, LEVEL, 0.0, 0.0])
}

/// The same for mounts of older firmware.
#[must_use]
pub fn mount(tilt: f64) -> VehicleCommand {
    VehicleCommand::new(ids::MOUNT_CONTROL, &[-tilt.to_degrees() as f32, 0.0, 0.0, 0.0, 0.0, 0.0, TARGETING])
}

#[cfg(test)]
#[allow(deprecated, reason = "older firmware has no other")]
mod tests {
    use mavlink::dialects::common::{GIMBAL_MANAGER_INFORMATION_DATA, MOUNT_ORIENTATION_DATA};

    use super::*;
    use crate::wire::{Body, Decoder, Encoder};

    fn read(body: &Body) -> Option<GimbalNews> {
        let mut decoder = Decoder::default();
        decoder.push(&Encoder::new([1, 154]).frame(body));
        decoder.next_packet().unwrap().gimbal()
    }

    fn degrees(news: Option<GimbalNews>) -> f64 {
        let Some(GimbalNews::Tilt(tilt)) = news else { panic!("{news:?}") };
        tilt.to_degrees()
    }

    /// Worked by hand: a rotation by −30° about the right-hand axis, after a yaw of 90°.
    #[test]
    fn every_report_of_a_gimbal_tells_the_same_tilt() {
        let (half, yaw) = (-15.0_f64.to_radians(), core::f64::consts::FRAC_PI_4);
        let (s, c, sy, cy) = (half.sin(), half.cos(), yaw.sin(), yaw.cos());
        let q = [c * cy, -s * sy, s * cy, c * sy].map(|part| part as f32);
        let device = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { q, ..Default::default() };
        assert!((degrees(read(&Body::from(&MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device)))) - 30.0).abs() < 0.01);
        let orientation = MOUNT_ORIENTATION_DATA { pitch: -30.0, ..Default::default() };
        assert!((degrees(read(&Body::from(&MavMessage::MOUNT_ORIENTATION(orientation)))) - 30.0).abs() < 0.01);
        let payload = (-3000_i32).to_le_bytes().into_iter().chain([0; 11]).collect();
        assert!((degrees(read(&Body { id: MOUNT_STATUS, payload })) - 30.0).abs() < 1e-9);
        let range = GIMBAL_MANAGER_INFORMATION_DATA { pitch_min: -1.5, pitch_max: 0.5, ..Default::default() };
        assert_eq!(read(&Body::from(&MavMessage::GIMBAL_MANAGER_INFORMATION(range))), Some(GimbalNews::Range([-0.5, 1.5])));
        let nan = MOUNT_ORIENTATION_DATA { pitch: f32::NAN, ..Default::default() };
        assert_eq!(read(&Body::from(&MavMessage::MOUNT_ORIENTATION(nan))), None);
    }
}
