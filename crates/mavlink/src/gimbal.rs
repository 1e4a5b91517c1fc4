//! Gimbals: what they report of the camera's tilt, and the commands that tilt it. In MAVLink a pitch is negative downwards.

use mavlink::dialects::common::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage};

use crate::command::{VehicleCommand, ids};
use crate::wire::{MOUNT_STATUS, Packet};

/// The gimbal keeps the camera's roll and pitch (`GIMBAL_DEVICE_FLAGS_ROLL_LOCK`, `..._PITCH_LOCK`).
const LEVEL: f32 = 12.0;
/// `GIMBAL_DEVICE_FLAGS`: the yaw is kept, which means relative to north; the yaw is relative to the vehicle, or to north.
const YAW_LOCK: u16 = 16;
const YAW_IN_VEHICLE_FRAME: u16 = 32;
const YAW_IN_EARTH_FRAME: u16 = 64;
/// The length of a rotation's quaternion differs from 1 by at most this.
const UNIT: f64 = 0.05;
/// `MAV_MOUNT_MODE_MAVLINK_TARGETING`.
const TARGETING: f32 = 2.0;

/// What a gimbal reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GimbalNews {
    /// Where the camera looks.
    Look(Look),
    /// Least and greatest tilt, radians.
    Range([f64; 2]),
    /// System and component that have control of the gimbal; zero for nobody.
    Control([u8; 2]),
}

/// Where a gimbal's camera looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Tilt of the camera below the horizon, radians.
    pub tilt: f64,
    /// Direction, radians clockwise; `None` if it is not told.
    pub yaw: Option<f64>,
    /// Whether [`yaw`](Self::yaw) counts from north, not from straight ahead.
    pub from_north: bool,
    /// Component and number of the gimbal.
    pub device: [u8; 2],
    /// The gimbal's clock, ms; zero if it has none.
    pub boot_ms: u64,
}

impl Packet {
    /// What a gimbal reports in it: `GIMBAL_DEVICE_ATTITUDE_STATUS`, `GIMBAL_MANAGER_INFORMATION`, `GIMBAL_MANAGER_STATUS`,
    /// `MOUNT_ORIENTATION` or `MOUNT_STATUS`. It may be a component of its own.
    #[must_use]
    pub fn gimbal(&self) -> Option<GimbalNews> {
        if self.id == MOUNT_STATUS {
            // Its pitch is in hundredths of a degree.
            let [pitch, yaw] = [0, 8].map(|offset| (f64::from(i32::from_le_bytes(self.bytes(offset))) * 0.01).to_radians());
            return self.look(pitch, yaw, false, 0, 0);
        }
        if !matches!(self.id, 265 | 280 | 281 | 285) {
            return None;
        }
        match self.message()? {
            MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(it) => {
                let flags = it.flags.bits();
                let told = flags & (YAW_IN_VEHICLE_FRAME | YAW_IN_EARTH_FRAME);
                let from_north = told == YAW_IN_EARTH_FRAME || (told == 0 && flags & YAW_LOCK != 0);
                let [pitch, yaw] = angles(&it)?;
                self.look(pitch, yaw, from_north, it.gimbal_device_id, it.time_boot_ms)
            }
            MavMessage::GIMBAL_MANAGER_STATUS(it) => {
                Some(GimbalNews::Control([it.primary_control_sysid, it.primary_control_compid]))
            }
            #[allow(deprecated, reason = "older firmware has no other")]
            MavMessage::MOUNT_ORIENTATION(it) => {
                let [pitch, yaw] = [it.pitch, it.yaw].map(|degrees| f64::from(degrees).to_radians());
                self.look(pitch, yaw, false, 0, it.time_boot_ms)
            }
            MavMessage::GIMBAL_MANAGER_INFORMATION(it) => {
                let range = [-f64::from(it.pitch_max), -f64::from(it.pitch_min)];
                (range.iter().all(|angle| angle.is_finite()) && range[0] < range[1]).then_some(GimbalNews::Range(range))
            }
            _ => None,
        }
    }

    /// A direction that a camera can have.
    fn look(&self, pitch: f64, yaw: f64, from_north: bool, device: u8, boot_ms: u32) -> Option<GimbalNews> {
        let yaw = Some(yaw).filter(|yaw| yaw.is_finite());
        let look = Look { tilt: -pitch, yaw, from_north, device: [self.component, device], boot_ms: boot_ms.into() };
        (pitch.is_finite() && pitch.abs() <= 3.2).then_some(GimbalNews::Look(look))
    }
}

/// Pitch of the camera above the horizon and yaw, radians: roll and pitch are relative to the horizon, whatever the yaw is relative
/// to. `None` if it is no rotation. Straight down or up the yaw is that of the upper edge of the image, whose direction is continuous there.
fn angles(it: &GIMBAL_DEVICE_ATTITUDE_STATUS_DATA) -> Option<[f64; 2]> {
    let [w, x, y, z] = it.q.map(f64::from);
    let length = libm::sqrt(w * w + x * x + y * y + z * z);
    if !length.is_finite() || (length - 1.0).abs() > UNIT {
        return None;
    }
    let pitch = libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0));
    let side = if pitch < 0.0 { -1.0 } else { 1.0 };
    // The level parts of what is ahead of the camera, and of what is below it: one of them is always there.
    let north = 1.0 - 2.0 * (y * y + z * z) + side * 2.0 * (x * z + w * y);
    let east = 2.0 * (w * z + x * y) + side * 2.0 * (y * z - w * x);
    Some([pitch, libm::atan2(east, north)])
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
        let Some(GimbalNews::Look(look)) = news else { panic!("{news:?}") };
        assert_eq!(look.device[0], 154);
        look.tilt.to_degrees()
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
        // What is no rotation is none.
        for q in [[0.0; 4], [2.0, 0.0, 0.0, 0.0], [f32::NAN; 4]] {
            let device = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { q, ..Default::default() };
            assert_eq!(read(&Body::from(&MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device))), None);
        }
    }

    /// Yaw of 90°, from straight ahead or from north as the flags say.
    #[test]
    fn the_yaw_of_a_gimbal_and_what_it_counts_from_are_read() {
        let half = core::f32::consts::FRAC_PI_4;
        let look = |flags: u16| {
            let device = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
                q: [half.cos(), 0.0, 0.0, half.sin()],
                flags: mavlink::dialects::common::GimbalDeviceFlags::from_bits_retain(flags),
                gimbal_device_id: 3,
                time_boot_ms: 5000,
                ..Default::default()
            };
            match read(&Body::from(&MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device))) {
                Some(GimbalNews::Look(look)) => look,
                other => panic!("{other:?}"),
            }
        };
        let read = [12, 12 | 16, 12 | 32, 12 | 16 | 32, 12 | 64].map(|flags| look(flags).from_north);
        assert_eq!(read, [false, true, false, false, true]);
        let look = look(12 | 32);
        // Straight down it is known, too.
        let half = core::f32::consts::FRAC_PI_4;
        let down = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { q: [half.cos(), 0.0, -half.sin(), 0.0], ..Default::default() };
        let [pitch, yaw] = angles(&down).unwrap();
        assert!((pitch + core::f64::consts::FRAC_PI_2).abs() < 1e-3 && yaw.abs() < 1e-6, "{pitch} {yaw}");
        assert!((look.yaw.unwrap() - core::f64::consts::FRAC_PI_2).abs() < 1e-6, "{look:?}");
        assert_eq!((look.device, look.boot_ms), ([154, 3], 5000));
    }
}
