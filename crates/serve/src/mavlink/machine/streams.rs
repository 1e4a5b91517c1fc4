//! What it sends by itself, to each client at that client's [rates](super::rates), and on request.

use std::collections::BTreeMap;

use spf_core::geometry::wrap_angle;
use spf_core::telemetry::FlightPhase;
use spf_core::time::Time;
use spf_mavlink::dialect::*;
use spf_mavlink::frames::{position_to_ned, velocity_to_ned};
use spf_mavlink::modes::Autopilot;
use spf_mavlink::wire::{Body, EKF_STATUS_REPORT, MOUNT_STATUS};
use spf_sim::craft::SimCraft;

use super::loops::Target;
use super::rates::has;
use super::sensors;
use super::{ORIGIN, VirtualVehicle, relative};

/// Cells of the battery, and their voltages when empty and full, mV.
const CELLS: usize = 4;
const VOLTAGES: (f64, f64) = (3500.0, 4150.0);
/// Range of the rangefinder that looks down, cm.
const RANGE: (u16, u16) = (10, 4000);

impl VirtualVehicle {
    pub(super) fn stream(&mut self, now: Time, craft: &SimCraft) {
        let mut made: BTreeMap<u32, Option<Body>> = BTreeMap::new();
        for (peer, ids) in self.clients.due(now) {
            for id in ids {
                if let Some(body) = made.entry(id).or_insert_with(|| self.message(id, now, craft)).clone() {
                    self.clients.send(peer, body);
                }
                if id == 132 && self.autopilot == Autopilot::ArduPilot {
                    let boot = (now.since(self.started).as_nanos() / 1_000_000) as u32;
                    let told: Vec<Body> = self.told.iter().flat_map(|told| sensors::echo(boot, told)).collect();
                    told.into_iter().for_each(|body| self.clients.send(peer, body));
                }
                if id == 132 && self.ranges {
                    for body in sensors::rangefinders((now.since(self.started).as_nanos() / 1_000_000) as u32, craft) {
                        self.clients.send(peer, body);
                    }
                }
            }
        }
    }

    /// A message about the present state; `None` if it has no such message, or nothing to say yet.
    pub(super) fn message(&self, id: u32, now: Time, craft: &SimCraft) -> Option<Body> {
        let telemetry = craft.telemetry();
        let time_boot_ms = (now.since(self.started).as_nanos() / 1_000_000) as u32;
        let time_usec = now.as_nanos() / 1000;
        let position = self.position(craft);
        let velocity = telemetry.velocity.unwrap_or_default();
        let global = ORIGIN.offset(position);
        let [lat, lon] = global.e7();
        let alt = (global.altitude * 1e3) as i32;
        let ([x, y, z], [vx, vy, vz]) = (position_to_ned(position), velocity_to_ned(velocity));
        let attitude = telemetry.attitude;
        let [roll, pitch, yaw] = [attitude.roll, attitude.pitch, attitude.heading].map(|angle| angle as f32);
        let yawspeed = telemetry.yaw_rate.unwrap_or(0.0) as f32;
        let heading = (wrap_angle(attitude.heading).to_degrees() + 360.0) % 360.0;
        let charge = telemetry.battery.unwrap_or(1.0);
        let cell = (VOLTAGES.0 + charge * (VOLTAGES.1 - VOLTAGES.0)) as u16;
        let current = if craft.dynamics().airborne() { 1500 } else { 50 };
        let ready = self.is_ready(now);
        // Without a position nothing of it is sent, as by an estimator that aligns.
        if !ready && matches!(id, 32 | 33 | 49 | 85 | EKF_STATUS_REPORT | 230 | 242) {
            return None;
        }
        if matches!(id, MOUNT_STATUS | 280 | 281 | 285) {
            return self.gimbal_message(id, now);
        }
        if id == EKF_STATUS_REPORT && has(self.autopilot, id) {
            // Parts of the innovations' gates, and every flag of an estimator with a position: attitude, velocities, positions.
            // The second is the horizontal position's: a part of five standard deviations of a measurement of 0.5 m.
            let position = self.blurred.map_or(0.1, |metres| metres / 2.5);
            let parts = [0.05_f32, position, 0.1, 0.05, 0.0].into_iter().flat_map(f32::to_le_bytes);
            let payload = parts.chain(0x033f_u16.to_le_bytes()).chain(0.0_f32.to_le_bytes()).collect();
            return Some(Body { id, payload });
        }
        Some(Body::from(&match id {
            0 => MavMessage::HEARTBEAT(self.heartbeat()),
            1 => {
                let battery = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY.bits();
                // PX4 never tells whether a fence is in force.
                let px4 = self.autopilot == Autopilot::Px4;
                let fence = if px4 { 0 } else { MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE.bits() };
                let receiver =
                    if self.radio.is_some() { MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER.bits() } else { 0 };
                let all =
                    receiver | 1 | 2 | 4 | 8 | 32 | fence | battery | MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK.bits();
                let fenced = self.fence.is_in_force(self.autopilot, &self.parameters)
                    || self.parameters.number("FENCE_ENABLE", 0.0) != 0.0;
                let healthy = if ready { all } else { all & !32 };
                let refused = !self.armed && self.arming_refusal(now, craft).is_some();
                let healthy = if refused { healthy & !MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK.bits() } else { healthy };
                MavMessage::SYS_STATUS(SYS_STATUS_DATA {
                    onboard_control_sensors_present: MavSysStatusSensor::from_bits_retain(all),
                    onboard_control_sensors_enabled: MavSysStatusSensor::from_bits_retain(if fenced {
                        all
                    } else {
                        all & !fence
                    }),
                    onboard_control_sensors_health: MavSysStatusSensor::from_bits_retain(healthy),
                    load: 300,
                    voltage_battery: cell * CELLS as u16,
                    current_battery: current,
                    battery_remaining: (charge * 100.0) as i8,
                    onboard_control_sensors_present_extended: MavSysStatusSensorExtended::empty(),
                    onboard_control_sensors_enabled_extended: MavSysStatusSensorExtended::empty(),
                    onboard_control_sensors_health_extended: MavSysStatusSensorExtended::empty(),
                    ..SYS_STATUS_DATA::default()
                })
            }
            2 => MavMessage::SYSTEM_TIME(SYSTEM_TIME_DATA { time_unix_usec: 0, time_boot_ms }),
            24 => MavMessage::GPS_RAW_INT(GPS_RAW_INT_DATA {
                time_usec,
                lat,
                lon,
                alt,
                eph: 80,
                epv: 110,
                vel: (velocity.horizontal_speed() * 100.0) as u16,
                cog: u16::MAX,
                fix_type: if ready && self.blurred.is_none() {
                    GpsFixType::GPS_FIX_TYPE_3D_FIX
                } else {
                    GpsFixType::GPS_FIX_TYPE_NO_FIX
                },
                satellites_visible: if ready { 14 } else { 3 },
                alt_ellipsoid: alt,
                h_acc: self.blurred.map_or(300, |metres| (metres * 1e3) as u32),
                v_acc: 500,
                vel_acc: 50,
                ..GPS_RAW_INT_DATA::default()
            }),
            30 => {
                MavMessage::ATTITUDE(ATTITUDE_DATA { time_boot_ms, roll, pitch, yaw, rollspeed: 0.0, pitchspeed: 0.0, yawspeed })
            }
            31 => {
                let [q1, q2, q3, q4] = quaternion([attitude.roll, attitude.pitch, attitude.heading]);
                MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA {
                    time_boot_ms,
                    q1,
                    q2,
                    q3,
                    q4,
                    yawspeed,
                    ..ATTITUDE_QUATERNION_DATA::default()
                })
            }
            32 => MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA { time_boot_ms, x, y, z, vx, vy, vz }),
            33 => MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
                time_boot_ms,
                lat,
                lon,
                alt,
                relative_alt: (self.height(craft) * 1e3) as i32,
                vx: (vx * 100.0) as i16,
                vy: (vy * 100.0) as i16,
                vz: (vz * 100.0) as i16,
                hdg: (heading * 100.0) as u16 % 36_000,
            }),
            65 => {
                let [chan1_raw, chan2_raw, chan3_raw, chan4_raw, chan5_raw, chan6_raw, chan7_raw, chan8_raw] = self.radio?;
                MavMessage::RC_CHANNELS(RC_CHANNELS_DATA {
                    time_boot_ms,
                    chancount: 8,
                    chan1_raw,
                    chan2_raw,
                    chan3_raw,
                    chan4_raw,
                    chan5_raw,
                    chan6_raw,
                    chan7_raw,
                    chan8_raw,
                    rssi: 200,
                    ..RC_CHANNELS_DATA::default()
                })
            }
            74 => MavMessage::VFR_HUD(VFR_HUD_DATA {
                airspeed: velocity.horizontal_speed() as f32,
                groundspeed: velocity.horizontal_speed() as f32,
                alt: global.altitude as f32,
                climb: velocity.up as f32,
                heading: heading as i16,
                throttle: if craft.dynamics().airborne() { 50 } else { 0 },
            }),
            85 => {
                let (_, target) = self.target.filter(|_| self.mode == self.autopilot.external())?;
                MavMessage::POSITION_TARGET_LOCAL_NED(target_message(time_boot_ms, target))
            }
            132 => {
                let truth = craft.dynamics().pose().position;
                let below = craft.collider().ground_below(truth).map_or(f64::INFINITY, |ground| truth.up - ground.up);
                MavMessage::DISTANCE_SENSOR(DISTANCE_SENSOR_DATA {
                    time_boot_ms,
                    min_distance: RANGE.0,
                    max_distance: RANGE.1,
                    current_distance: (below * 100.0).min(f64::from(RANGE.1)) as u16,
                    mavtype: MavDistanceSensor::MAV_DISTANCE_SENSOR_LASER,
                    orientation: MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270,
                    covariance: u8::MAX,
                    ..DISTANCE_SENSOR_DATA::default()
                })
            }
            147 => {
                let mut voltages = [u16::MAX; 10];
                voltages[..CELLS].fill(cell);
                MavMessage::BATTERY_STATUS(BATTERY_STATUS_DATA {
                    voltages,
                    temperature: i16::MAX,
                    current_battery: current,
                    current_consumed: -1,
                    energy_consumed: -1,
                    battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL,
                    mavtype: MavBatteryType::MAV_BATTERY_TYPE_LIPO,
                    battery_remaining: (charge * 100.0) as i8,
                    fault_bitmask: MavBatteryFault::empty(),
                    ..BATTERY_STATUS_DATA::default()
                })
            }
            148 => {
                // PARAM_FLOAT, MISSION_INT, COMMAND_INT, SET_POSITION_TARGET_LOCAL_NED, MAVLINK2, fences, and how integers travel.
                let integers = if self.autopilot == Autopilot::Px4 { 16 } else { 131_072 };
                let version: u32 = if self.autopilot == Autopilot::Px4 { 0x010f_02ff } else { 0x0405_07ff };
                MavMessage::AUTOPILOT_VERSION(AUTOPILOT_VERSION_DATA {
                    capabilities: MavProtocolCapability::from_bits_retain(2 | 4 | 8 | 128 | 8192 | 16_384 | integers),
                    flight_sw_version: version,
                    ..AUTOPILOT_VERSION_DATA::default()
                })
            }
            230 if has(self.autopilot, id) => MavMessage::ESTIMATOR_STATUS(ESTIMATOR_STATUS_DATA {
                time_usec,
                pos_horiz_accuracy: self.blurred.unwrap_or(0.3),
                pos_vert_accuracy: 0.4,
                flags: EstimatorStatusFlags::from_bits_retain(0b11_0011_1111),
                ..ESTIMATOR_STATUS_DATA::default()
            }),
            242 => {
                let home = relative(self.home, self.origin);
                // ArduPilot leaves the place relative to the origin at zero.
                let px4 = self.autopilot == Autopilot::Px4;
                let (place, [x, y, z]) = (ORIGIN.offset(home), if px4 { position_to_ned(home) } else { [0.0; 3] });
                let [latitude, longitude] = place.e7();
                MavMessage::HOME_POSITION(HOME_POSITION_DATA {
                    latitude,
                    longitude,
                    altitude: (place.altitude * 1e3) as i32,
                    x,
                    y,
                    z,
                    q: [1.0, 0.0, 0.0, 0.0],
                    time_usec,
                    ..HOME_POSITION_DATA::default()
                })
            }
            49 => {
                let [latitude, longitude] = ORIGIN.e7();
                let altitude = (ORIGIN.altitude * 1e3) as i32;
                MavMessage::GPS_GLOBAL_ORIGIN(GPS_GLOBAL_ORIGIN_DATA { latitude, longitude, altitude, time_usec })
            }
            330 if self.ranges => sensors::proximity(now, craft),
            // What it was told is told again.
            330 => MavMessage::OBSTACLE_DISTANCE(OBSTACLE_DISTANCE_DATA { time_usec, ..self.told.as_deref()?.clone() }),
            245 => MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
                vtol_state: MavVtolState::MAV_VTOL_STATE_UNDEFINED,
                landed_state: match craft.dynamics().phase() {
                    FlightPhase::TakingOff => MavLandedState::MAV_LANDED_STATE_TAKEOFF,
                    FlightPhase::Flying | FlightPhase::Manoeuvring => MavLandedState::MAV_LANDED_STATE_IN_AIR,
                    FlightPhase::Landing => MavLandedState::MAV_LANDED_STATE_LANDING,
                    FlightPhase::OnGround | FlightPhase::Stopped => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
                },
            }),
            _ => return None,
        }))
    }

    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let kind = if self.mode == self.autopilot.external() {
            8 | 16
        } else if self.mode.is_landing() || self.mode == self.autopilot.hold() || self.mode.is_take_off() {
            4 | 8 | 16
        } else {
            16 | 64
        };
        let armed = if self.armed { 128 } else { 0 };
        HEARTBEAT_DATA {
            custom_mode: self.mode.1,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: match self.autopilot {
                Autopilot::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
                Autopilot::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            },
            base_mode: MavModeFlag::from_bits_retain(1 | kind | armed),
            system_status: if self.armed && (self.autopilot == Autopilot::Px4 || self.phase != FlightPhase::OnGround) {
                MavState::MAV_STATE_ACTIVE
            } else {
                MavState::MAV_STATE_STANDBY
            },
            mavlink_version: 3,
        }
    }
}

/// The setpoint that is flown, as an echo.
fn target_message(time_boot_ms: u32, target: Target) -> POSITION_TARGET_LOCAL_NED_DATA {
    let empty =
        POSITION_TARGET_LOCAL_NED_DATA { time_boot_ms, coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED, ..Default::default() };
    match target {
        Target::Velocity([vx, vy, vz], _) => {
            let type_mask = PositionTargetTypemask::from_bits_retain(0x0dc7);
            POSITION_TARGET_LOCAL_NED_DATA { vx, vy, vz, type_mask, ..empty }
        }
        Target::Position(place, _) => {
            let ([x, y, z], type_mask) = (position_to_ned(place), PositionTargetTypemask::from_bits_retain(0x0df8));
            POSITION_TARGET_LOCAL_NED_DATA { x, y, z, type_mask, ..empty }
        }
    }
}

/// Rotation from the body (forward, right, down) to north, east, down: w, x, y, z.
fn quaternion(angles: [f64; 3]) -> [f32; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|angle| (libm::sin(0.5 * angle), libm::cos(0.5 * angle)));
    [cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy]
        .map(|part| part as f32)
}
