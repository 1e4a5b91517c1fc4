//! The messages that the driver sends, and what it reads from those of a vehicle.

use mavlink::dialects::common::{
    HEARTBEAT_DATA, MISSION_ACK_DATA, MISSION_REQUEST_LIST_DATA, MavAutopilot, MavFrame, MavMessage, MavMissionResult,
    MavMissionType, MavModeFlag, MavState, MavSysStatusSensor, MavType, PARAM_REQUEST_READ_DATA, PositionTargetTypemask,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use spf_core::command::Setpoint;
use spf_core::time::Time;

use crate::command::Transmission;
use crate::fence::FenceMessage;
use crate::frames::{GlobalPosition, VELOCITY_AND_YAW_RATE, attitude, position_from_ned, setpoint_to_body, velocity_from_ned};
use crate::modes::Autopilot;
use crate::parameter::{name_bytes, name_of};
use crate::ranges::{looks_down, of_rangefinder, of_sectors};
use crate::report::{Channels, Gps, Heartbeat, Report};
use crate::wire::{Body, EKF_STATUS_REPORT, Packet};

/// `COMMAND_INT` and `COMMAND_LONG`.
const COMMAND_INT: u32 = 75;
/// See [`COMMAND_INT`].
const COMMAND_LONG: u32 = 76;
const COMMAND_ACK: u32 = 77;
const HEARTBEAT: u32 = 0;
const REQUEST_DATA_STREAM: u32 = 66;

/// The heartbeat of an onboard computer.
#[must_use]
pub fn heartbeat_of_computer() -> Body {
    Body::from(&MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    }))
}

/// A velocity for the level body frame, m/s, and a yaw rate.
#[must_use]
#[allow(deprecated, reason = "the frame that replaces it is refused by PX4 and ArduPilot")]
pub fn setpoint(target: [u8; 2], now: Time, setpoint: Setpoint) -> Body {
    let ([vx, vy, vz], yaw_rate) = setpoint_to_body(setpoint);
    Body::from(&MavMessage::SET_POSITION_TARGET_LOCAL_NED(SET_POSITION_TARGET_LOCAL_NED_DATA {
        time_boot_ms: (now.as_nanos() / 1_000_000) as u32,
        vx,
        vy,
        vz,
        yaw_rate,
        type_mask: PositionTargetTypemask::from_bits_retain(VELOCITY_AND_YAW_RATE),
        target_system: target[0],
        target_component: target[1],
        coordinate_frame: MavFrame::MAV_FRAME_BODY_NED,
        ..SET_POSITION_TARGET_LOCAL_NED_DATA::default()
    }))
}

/// A request for a group of messages (`MAV_DATA_STREAM`) at a rate in Hz, as firmware without `SET_MESSAGE_INTERVAL` takes it.
#[must_use]
pub fn request_stream(target: [u8; 2], stream: u8, rate: u16) -> Body {
    let [low, high] = rate.to_le_bytes();
    Body { id: REQUEST_DATA_STREAM, payload: vec![low, high, target[0], target[1], stream, 1] }
}

/// A request for a parameter.
#[must_use]
pub fn read_parameter(target: [u8; 2], name: &str) -> Body {
    Body::from(&MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: target[0],
        target_component: target[1],
        param_id: name_bytes(name).into(),
    }))
}

/// A request for the number of rally points.
#[must_use]
pub fn count_rally_points([target_system, target_component]: [u8; 2]) -> Body {
    let mission_type = MavMissionType::MAV_MISSION_TYPE_RALLY;
    Body::from(&MavMessage::MISSION_REQUEST_LIST(MISSION_REQUEST_LIST_DATA { target_system, target_component, mission_type }))
}

/// Ends the conversation about rally points.
#[must_use]
pub fn end_rally_points([target_system, target_component]: [u8; 2]) -> Body {
    let mission_type = MavMissionType::MAV_MISSION_TYPE_RALLY;
    let data = MISSION_ACK_DATA { target_system, target_component, mission_type, ..MISSION_ACK_DATA::default() };
    Body::from(&MavMessage::MISSION_ACK(data))
}

/// A command, in the form that the vehicle wants.
#[must_use]
pub fn command(target: [u8; 2], sent: &Transmission) -> Body {
    let [p1, p2, p3, p4, p5, p6, p7] = sent.command.parameters;
    let mut payload = Vec::with_capacity(35);
    payload.extend([p1, p2, p3, p4].iter().flat_map(|value| value.to_le_bytes()));
    if sent.as_int {
        // Without a place, which is the largest number: nothing here is commanded to one, and zero is one off Africa.
        payload.extend([p5, p6].iter().flat_map(|value| if value.is_finite() { *value as i32 } else { i32::MAX }.to_le_bytes()));
        payload.extend(p7.to_le_bytes());
        payload.extend(sent.command.id.to_le_bytes());
        payload.extend([target[0], target[1], 0, 0, 0]);
        return Body { id: COMMAND_INT, payload };
    }
    payload.extend([p5, p6, p7].iter().flat_map(|value| value.to_le_bytes()));
    payload.extend(sent.command.id.to_le_bytes());
    payload.extend([target[0], target[1], sent.confirmation]);
    Body { id: COMMAND_LONG, payload }
}

/// An acknowledgement of any command, known to the dialect or not.
#[must_use]
pub fn acknowledgement(to: [u8; 2], command: u16, result: u8) -> Body {
    let mut payload = command.to_le_bytes().to_vec();
    payload.extend([result, 0, 0, 0, 0, 0, to[0], to[1]]);
    Body { id: COMMAND_ACK, payload }
}

/// A command that was received, in either form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceivedCommand {
    /// `MAV_CMD`.
    pub id: u16,
    /// Parameters 1 to 4.
    pub parameters: [f32; 4],
    /// Parameters 5 and 6: numbers, or latitude and longitude in degrees.
    pub place: [f64; 2],
    /// Parameter 7.
    pub altitude: f32,
    /// Frame of the place (`MAV_FRAME`); `None` in a `COMMAND_LONG`.
    pub frame: Option<u8>,
    /// Addressed system and component; zero for all.
    pub target: [u8; 2],
}

impl Packet {
    /// The command in it, if it is one. Read from its bytes: the dialect refuses commands that it does not know, which are to be
    /// acknowledged as unsupported.
    #[must_use]
    pub fn command(&self) -> Option<ReceivedCommand> {
        let number = |offset| f32::from_le_bytes(self.bytes(offset));
        let int = |offset| i32::from_le_bytes(self.bytes(offset));
        let parameters = [number(0), number(4), number(8), number(12)];
        let id = u16::from_le_bytes(self.bytes(28));
        let (altitude, target) = (number(24), self.bytes(30));
        Some(match self.id {
            COMMAND_LONG => {
                let place = [number(16), number(20)].map(f64::from);
                ReceivedCommand { id, parameters, place, altitude, frame: None, target }
            }
            COMMAND_INT => {
                let place = [int(16), int(20)].map(|value| if value == i32::MAX { f64::NAN } else { f64::from(value) * 1e-7 });
                let [frame] = self.bytes(32);
                ReceivedCommand { id, parameters, place, altitude, frame: Some(frame), target }
            }
            _ => return None,
        })
    }

    /// The `autopilot` field of a heartbeat.
    #[must_use]
    pub fn autopilot(&self) -> Option<u8> {
        (self.id == HEARTBEAT).then(|| self.bytes::<1>(5)[0])
    }

    /// Whether it is the heartbeat of a ground station, or of an onboard computer: of somebody who may command the vehicle.
    #[must_use]
    pub fn is_controller(&self) -> bool {
        self.id == HEARTBEAT && matches!(self.bytes::<1>(4), [6 | 18])
    }

    /// What ArduPilot's estimator tells about its horizontal position, as a standard deviation: `pos_horiz_variance` is the innovation
    /// as a part of its gate of 5 standard deviations (`EK3_POS_I_GATE`) of a measurement (`EK3_POSNE_M_NSE`, 0.5 m).
    fn position_error(&self) -> f64 {
        const HAS_POSITION: u16 = 16;
        const GATE: f64 = 5.0;
        const MEASUREMENT: f64 = 0.5;
        let part = f64::from(f32::from_le_bytes(self.bytes(4)));
        let flags = u16::from_le_bytes(self.bytes(20));
        if flags & HAS_POSITION == 0 || !part.is_finite() { f64::INFINITY } else { MEASUREMENT * (GATE * part).max(1.0) }
    }

    /// What it reports.
    #[must_use]
    pub fn report(&self) -> Report {
        // From their bytes: types and commands that the dialect does not know are no reason to drop them.
        match self.id {
            HEARTBEAT => {
                let [kind, autopilot, base_mode, state] = self.bytes(4);
                return Report::Heartbeat(Heartbeat {
                    autopilot: Autopilot::from_heartbeat(autopilot),
                    kind,
                    custom_mode: u32::from_le_bytes(self.bytes(0)),
                    armed: base_mode & 128 != 0,
                    state,
                });
            }
            COMMAND_ACK => {
                let (command, [result]) = (u16::from_le_bytes(self.bytes(0)), self.bytes(2));
                return Report::Acknowledgement { command, result, target: self.bytes(8) };
            }
            EKF_STATUS_REPORT => return Report::PositionError(self.position_error()),
            _ => {}
        }
        self.message().map_or(Report::Other, |message| read(&message))
    }
}

/// Degrees from units of 1e-7, metres from millimetres.
fn place(latitude: i32, longitude: i32, altitude: i32) -> GlobalPosition {
    GlobalPosition {
        latitude: f64::from(latitude) * 1e-7,
        longitude: f64::from(longitude) * 1e-7,
        altitude: f64::from(altitude) * 1e-3,
    }
}

/// The larger standard deviation of two axes; variances that are not known are not numbers.
fn of_variances(one: f32, other: f32) -> Report {
    let variance = f64::from(one).max(f64::from(other));
    if one.is_nan() || other.is_nan() { Report::Other } else { Report::PositionCovariance(variance.max(0.0).sqrt()) }
}

/// Charge, 0..=1, of what `SYS_STATUS` tells: per cent, with -1 for a charge that is not known, and millivolts. Without a sensor some
/// firmware tells an empty battery, whose voltage is zero or unknown.
fn charge(remaining: i8, millivolts: u16) -> Option<f64> {
    let charge = u8::try_from(remaining).ok().filter(|charge| *charge <= 100)?;
    let is_measured = charge > 0 || !matches!(millivolts, 0 | u16::MAX);
    is_measured.then(|| f64::from(charge) * 0.01)
}

fn read(message: &MavMessage) -> Report {
    match message {
        MavMessage::SYS_STATUS(status) => {
            let check = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
            let fence = MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE;
            let says = status.onboard_control_sensors_present.contains(check);
            Report::System {
                battery: charge(status.battery_remaining, status.voltage_battery),
                may_arm: says.then(|| status.onboard_control_sensors_health.contains(check)),
                fenced: status
                    .onboard_control_sensors_present
                    .contains(fence)
                    .then(|| status.onboard_control_sensors_enabled.contains(fence)),
                receiver: status.onboard_control_sensors_present.contains(MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER),
            }
        }
        MavMessage::RC_CHANNELS(it) => Report::Radio(Channels {
            count: it.chancount,
            values: [
                it.chan1_raw,
                it.chan2_raw,
                it.chan3_raw,
                it.chan4_raw,
                it.chan5_raw,
                it.chan6_raw,
                it.chan7_raw,
                it.chan8_raw,
                it.chan9_raw,
                it.chan10_raw,
                it.chan11_raw,
                it.chan12_raw,
                it.chan13_raw,
                it.chan14_raw,
                it.chan15_raw,
                it.chan16_raw,
                it.chan17_raw,
                it.chan18_raw,
            ],
        }),
        MavMessage::LOCAL_POSITION_NED_COV(it) => of_variances(it.covariance[0], it.covariance[9]),
        MavMessage::ODOMETRY(it) => of_variances(it.pose_covariance[0], it.pose_covariance[6]),
        MavMessage::GPS_RAW_INT(gps) => Report::Gps(Gps {
            fix: gps.fix_type as u8,
            satellites: (gps.satellites_visible != u8::MAX).then_some(gps.satellites_visible),
            hdop: (gps.eph != u16::MAX).then(|| f64::from(gps.eph) * 0.01),
            accuracy: (gps.h_acc != 0).then(|| f64::from(gps.h_acc) * 1e-3),
        }),
        MavMessage::ATTITUDE(it) => {
            let boot_ms = it.time_boot_ms;
            Report::Attitude { attitude: attitude([it.roll, it.pitch, it.yaw]), yaw_rate: it.yawspeed.into(), boot_ms }
        }
        MavMessage::LOCAL_POSITION_NED(it) => Report::LocalPosition {
            position: position_from_ned([it.x, it.y, it.z]),
            velocity: velocity_from_ned([it.vx, it.vy, it.vz]),
            boot_ms: it.time_boot_ms,
        },
        MavMessage::GLOBAL_POSITION_INT(it) => Report::Height(f64::from(it.relative_alt) * 1e-3, it.time_boot_ms),
        MavMessage::DISTANCE_SENSOR(it) if !looks_down(it) => of_rangefinder(it).map_or(Report::Other, Report::Ranges),
        MavMessage::OBSTACLE_DISTANCE(it) => Report::Ranges(of_sectors(it)),
        MavMessage::DISTANCE_SENSOR(it) => {
            let valid = it.current_distance >= it.min_distance.max(1) && it.current_distance < it.max_distance;
            Report::GroundClearance(valid.then(|| f64::from(it.current_distance) * 0.01))
        }
        MavMessage::AUTOPILOT_VERSION(it) => {
            let [_, patch, minor, major] = it.flight_sw_version.to_le_bytes();
            Report::Version { capabilities: it.capabilities.bits(), firmware: [major, minor, patch] }
        }
        MavMessage::HOME_POSITION(it) => Report::Home(place(it.latitude, it.longitude, it.altitude)),
        MavMessage::GPS_GLOBAL_ORIGIN(it) => Report::Origin(place(it.latitude, it.longitude, it.altitude)),
        MavMessage::MISSION_COUNT(it) if it.mission_type == MavMissionType::MAV_MISSION_TYPE_RALLY => {
            Report::RallyPoints(it.count, [it.target_system, it.target_component])
        }
        // A vehicle that does not know them has none.
        MavMessage::MISSION_ACK(it)
            if it.mission_type == MavMissionType::MAV_MISSION_TYPE_RALLY
                && it.mavtype == MavMissionResult::MAV_MISSION_UNSUPPORTED =>
        {
            Report::RallyPoints(0, [it.target_system, it.target_component])
        }
        MavMessage::EXTENDED_SYS_STATE(it) => Report::Landed(it.landed_state as u8),
        MavMessage::STATUSTEXT(it) => {
            // Printable characters only: the text goes to a terminal.
            let text = String::from_utf8_lossy(it.text.to_str().unwrap_or_default().as_bytes());
            let text: String = text.chars().filter(|c| !c.is_control()).collect();
            Report::Text { severity: it.severity as u8, text: text.trim().to_owned() }
        }
        MavMessage::PARAM_VALUE(it) => match name_of(&it.param_id[..]) {
            Some(name) => Report::Parameter { name: name.to_owned(), field: it.param_value, kind: it.param_type as u8 },
            None => Report::Other,
        },
        MavMessage::ESTIMATOR_STATUS(it) => Report::PositionError(it.pos_horiz_accuracy.into()),
        other => FenceMessage::read(other).map_or(Report::Other, |(message, target)| Report::Fence(message, target)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::{VehicleCommand, ids};

    /// Bytes as pymavlink 2.4 packs them: seven floats, the command, target, confirmation.
    #[test]
    fn a_command_is_laid_out_as_in_the_protocol_and_read_back() {
        let command = VehicleCommand::new(ids::ARM, &[1.0, 0.5]);
        let body = super::command([1, 2], &Transmission { command, confirmation: 3, as_int: false });
        assert_eq!((body.id, body.payload.len(), &body.payload[28..]), (76, 33, &[0x90, 0x01, 1, 2, 3][..]));
        let packet = |body: &Body| {
            let mut decoder = crate::wire::Decoder::default();
            decoder.push(&crate::wire::Encoder::new([255, 190]).frame(body));
            decoder.next_packet().unwrap()
        };
        let read = packet(&body).command().unwrap();
        assert_eq!((read.id, read.parameters[0], read.parameters[1], read.target), (ids::ARM, 1.0, 0.5, [1, 2]));
        let int = super::command([1, 2], &Transmission { command, confirmation: 0, as_int: true });
        let read = packet(&int).command().unwrap();
        assert_eq!((read.id, read.frame, read.target), (ids::ARM, Some(0), [1, 2]));
        // No place is no place in both forms.
        let land = VehicleCommand { id: ids::LAND, parameters: [0.0, 0.0, 0.0, f32::NAN, f32::NAN, f32::NAN, 0.0] };
        let int = super::command([1, 2], &Transmission { command: land, confirmation: 0, as_int: true });
        assert_eq!(int.payload[16..24], [0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x7f]);
        assert!(packet(&int).command().unwrap().place.iter().all(|value| value.is_nan()));
        // One that no dialect has is acknowledged all the same.
        let ack = packet(&acknowledgement([255, 190], 54_321, 3)).report();
        assert_eq!(ack, Report::Acknowledgement { command: 54_321, result: 3, target: [255, 190] });
    }

    #[test]
    fn a_battery_without_a_sensor_is_unknown_and_an_empty_one_is_empty() {
        let told = |remaining: i8, millivolts: u16| {
            let status = mavlink::dialects::common::SYS_STATUS_DATA {
                voltage_battery: millivolts,
                battery_remaining: remaining,
                ..Default::default()
            };
            let mut decoder = crate::wire::Decoder::default();
            decoder.push(&crate::wire::Encoder::new([1, 1]).frame(&Body::from(&MavMessage::SYS_STATUS(status))));
            let Report::System { battery, .. } = decoder.next_packet().unwrap().report() else { panic!("no status") };
            battery
        };
        for (remaining, millivolts) in [(0, 0), (0, u16::MAX), (-1, 0), (-1, u16::MAX), (-1, 11_800), (101, 12_000)] {
            assert_eq!(told(remaining, millivolts), None, "{remaining} % {millivolts} mV");
        }
        // A charge that is told without a voltage is one.
        assert_eq!([told(0, 9600), told(1, 0), told(50, u16::MAX), told(100, 12_600)], [0.0, 0.01, 0.5, 1.0].map(Some));
    }

    /// Bytes as pymavlink 2.4 packs them: five floats, the flags, one more float.
    #[test]
    fn what_ardupilot_s_estimator_says_becomes_a_standard_deviation() {
        let report = |part: f32, flags: u16| {
            let floats = [0.1, part, 0.3, 0.4, 0.5].into_iter().flat_map(f32::to_le_bytes);
            let payload = floats.chain(flags.to_le_bytes()).chain(0.0_f32.to_le_bytes()).collect();
            let mut decoder = crate::wire::Decoder::default();
            decoder.push(&crate::wire::Encoder::new([1, 1]).frame(&Body { id: EKF_STATUS_REPORT, payload }));
            decoder.next_packet().unwrap().report()
        };
        assert_eq!(report(0.1, 831), Report::PositionError(0.5));
        assert_eq!(report(0.5, 831), Report::PositionError(1.25));
        assert_eq!(report(0.1, 128), Report::PositionError(f64::INFINITY));
        assert_eq!(report(f32::NAN, 831), Report::PositionError(f64::INFINITY));
    }

    #[test]
    fn a_setpoint_has_the_frame_and_the_mask_that_both_autopilots_take() {
        let body = setpoint([1, 1], Time::from_millis(7), Setpoint { right: 0.5, forward: 1.0, up: 0.25, yaw_rate: 0.125 });
        let floats: Vec<f32> = body.payload[4..48].as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        assert_eq!(floats, [0.0, 0.0, 0.0, 1.0, 0.5, -0.25, 0.0, 0.0, 0.0, 0.0, 0.125]);
        assert_eq!(body.payload[48..], [0xc7, 0x05, 1, 1, 8]);
    }
}
