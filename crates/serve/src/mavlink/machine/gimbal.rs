//! The gimbal of the simulated camera, and its manager.

use core::f64::consts::FRAC_PI_2;

use spf_core::time::Time;
use spf_mavlink::dialect::{
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, GimbalDeviceFlags,
    GimbalManagerCapFlags, MavMessage,
};
use spf_mavlink::message::ReceivedCommand;
use spf_mavlink::wire::{Body, MOUNT_STATUS};

use super::{CONTROL, Peer, VirtualVehicle, result};

/// Pitch of the camera, radians: from straight down to 30° above the horizon.
const RANGE: (f64, f64) = (-FRAC_PI_2, 0.524);
/// How fast it turns, rad/s.
const SPEED: f64 = 1.0;
/// `MAV_MOUNT_MODE_MAVLINK_TARGETING`.
const TARGETING: f64 = 2.0;
const NOT_IN_CONTROL: u8 = 10;

/// The gimbal. It keeps the camera level.
#[derive(Debug)]
pub(super) struct Gimbal {
    pub(super) pitch: f64,
    wanted: f64,
    controller: Option<(Peer, [u8; 2])>,
    /// Firmware without a gimbal manager.
    pub(super) old: bool,
}

impl Gimbal {
    pub(super) fn new(old: bool) -> Self {
        Self { pitch: 0.0, wanted: 0.0, controller: None, old }
    }

    fn aim(&mut self, pitch_deg: f64) -> u8 {
        if !pitch_deg.is_finite() {
            return result::DENIED;
        }
        self.wanted = pitch_deg.to_radians().clamp(RANGE.0, RANGE.1);
        result::ACCEPTED
    }

    /// Every [`CONTROL`].
    pub(super) fn turn(&mut self) {
        let most = SPEED * CONTROL.as_secs_f64();
        self.pitch += (self.wanted - self.pitch).clamp(-most, most);
    }

    pub(super) fn message(&self, id: u32, time_boot_ms: u32) -> Option<Body> {
        if id == MOUNT_STATUS && self.old {
            let pitch = (self.pitch.to_degrees() * 100.0) as i32;
            let payload = pitch.to_le_bytes().into_iter().chain([0; 10]).chain([TARGETING as u8]).collect();
            return Some(Body { id, payload });
        }
        if self.old {
            return None;
        }
        let (sin, cos) = (libm::sin(0.5 * self.pitch) as f32, libm::cos(0.5 * self.pitch) as f32);
        Some(Body::from(&match id {
            280 => MavMessage::GIMBAL_MANAGER_INFORMATION(GIMBAL_MANAGER_INFORMATION_DATA {
                time_boot_ms,
                cap_flags: GimbalManagerCapFlags::from_bits_retain(0b1_0011_1110),
                pitch_min: RANGE.0 as f32,
                pitch_max: RANGE.1 as f32,
                gimbal_device_id: 1,
                ..GIMBAL_MANAGER_INFORMATION_DATA::default()
            }),
            281 => {
                let [primary_control_sysid, primary_control_compid] = self.controller.map_or([0; 2], |(_, who)| who);
                MavMessage::GIMBAL_MANAGER_STATUS(GIMBAL_MANAGER_STATUS_DATA {
                    time_boot_ms,
                    gimbal_device_id: 1,
                    primary_control_sysid,
                    primary_control_compid,
                    ..GIMBAL_MANAGER_STATUS_DATA::default()
                })
            }
            285 => MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
                time_boot_ms,
                q: [cos, 0.0, sin, 0.0],
                flags: GimbalDeviceFlags::from_bits_retain(4 | 8 | 32),
                ..GIMBAL_DEVICE_ATTITUDE_STATUS_DATA::default()
            }),
            _ => return None,
        }))
    }
}

impl VirtualVehicle {
    /// A command to the gimbal, if it has one.
    pub(super) fn point(&mut self, from: Peer, command: &ReceivedCommand) -> u8 {
        use spf_mavlink::command::ids::{GIMBAL_CONFIGURE, GIMBAL_PITCHYAW, MOUNT_CONTROL};
        let px4 = self.autopilot == spf_mavlink::modes::Autopilot::Px4;
        let Some(gimbal) = &mut self.gimbal else { return result::UNSUPPORTED };
        match command.id {
            GIMBAL_CONFIGURE if !gimbal.old => {
                let [system, component, ..] = command.parameters;
                gimbal.controller = Some((from, [system as u8, component as u8]));
                result::ACCEPTED
            }
            // Whoever does not have control is refused; PX4 wants it taken first.
            GIMBAL_PITCHYAW if !gimbal.old && gimbal.controller.map_or(px4, |(controller, _)| controller != from) => {
                NOT_IN_CONTROL
            }
            GIMBAL_PITCHYAW if !gimbal.old => gimbal.aim(command.parameters[0].into()),
            MOUNT_CONTROL if gimbal.old && f64::from(command.altitude) == TARGETING => gimbal.aim(command.parameters[0].into()),
            _ => result::UNSUPPORTED,
        }
    }

    /// Gives it a camera on a gimbal, of old firmware or with a gimbal manager.
    pub fn carry_gimbal(&mut self, old: bool) {
        self.gimbal = Some(Gimbal::new(old));
    }

    /// Tilt of the camera below the horizon, radians, if it is on a gimbal.
    #[must_use]
    pub fn camera_tilt(&self) -> Option<f64> {
        self.gimbal.as_ref().map(|gimbal| -gimbal.pitch)
    }

    pub(super) fn gimbal_message(&self, id: u32, now: Time) -> Option<Body> {
        let time_boot_ms = (now.since(self.started).as_nanos() / 1_000_000) as u32;
        self.gimbal.as_ref().and_then(|gimbal| gimbal.message(id, time_boot_ms))
    }
}
