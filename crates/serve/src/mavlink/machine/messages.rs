//! Messages of clients besides commands: setpoints, parameters, and what is answered without effect.
#![allow(deprecated, reason = "clients still send what the protocol has marked as such")]

use spf_core::time::Time;
use spf_mavlink::dialect::{
    FILE_TRANSFER_PROTOCOL_DATA, MISSION_ACK_DATA, MISSION_COUNT_DATA, MavMessage, MavMissionResult, MavMissionType,
    MavParamType, MavSeverity, PARAM_VALUE_DATA, PING_DATA, SET_POSITION_TARGET_LOCAL_NED_DATA, TIMESYNC_DATA,
};
use spf_mavlink::fence::FenceMessage;
use spf_mavlink::frames::position_from_ned;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::parameter::{name_bytes, name_of};
use spf_mavlink::wire::Body;
use spf_sim::craft::SimCraft;

use super::loops::{Target, Yaw};
use super::{Peer, VirtualVehicle};

/// A velocity above this is an error of the sender, m/s.
const FASTEST: f32 = 1000.0;

impl VirtualVehicle {
    pub(super) fn receive(&mut self, now: Time, from: Peer, sender: [u8; 2], message: &MavMessage, craft: &mut SimCraft) {
        if let Some((message, target)) = FenceMessage::read(message) {
            if matches!(target[0], 0 | 1)
                && let Some(answer) = self.fence.receive(now, from, sender, message, self.autopilot)
            {
                self.clients.send(from, answer.body(sender));
            }
            return;
        }
        match message {
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(it) if matches!(it.target_system, 0 | 1) => self.setpoint(now, it, craft),
            MavMessage::SET_MODE(it) if matches!(it.target_system, 0 | 1) && it.base_mode.bits() & 1 != 0 => {
                let mode = Mode(self.autopilot, it.custom_mode);
                if Mode::from_parameters(self.autopilot, mode.parameters()) == Some(mode) {
                    self.enter(now, mode, craft);
                }
            }
            MavMessage::PARAM_REQUEST_LIST(_) => (0..self.parameters.count()).for_each(|index| self.send_parameter(from, index)),
            MavMessage::PARAM_REQUEST_READ(it) => {
                let index = match u16::try_from(it.param_index) {
                    Ok(index) => Some(index),
                    Err(_) => name_of(&it.param_id[..]).and_then(|name| self.parameters.index(name)),
                };
                if let Some(index) = index {
                    self.send_parameter(from, index);
                }
            }
            MavMessage::PARAM_SET(it) => {
                let set = name_of(&it.param_id[..]).and_then(|name| {
                    let name = name.to_owned();
                    self.parameters.set(&name, it.param_value, it.param_type as u8)
                });
                // Also if it was refused: the value that counts is told.
                if let Some(index) = set {
                    self.send_parameter(from, index);
                }
            }
            MavMessage::PING(it) if it.target_system == 0 => {
                let [target_system, target_component] = sender;
                self.reply(from, &MavMessage::PING(PING_DATA { target_system, target_component, ..*it }));
            }
            MavMessage::TIMESYNC(it) if it.tc1 == 0 => {
                let [target_system, target_component] = sender;
                let tc1 = now.as_nanos() as i64;
                self.reply(from, &MavMessage::TIMESYNC(TIMESYNC_DATA { tc1, ts1: it.ts1, target_system, target_component }));
            }
            MavMessage::MISSION_REQUEST_LIST(it) => {
                let [target_system, target_component] = sender;
                let data = MISSION_COUNT_DATA {
                    target_system,
                    target_component,
                    mission_type: it.mission_type,
                    ..MISSION_COUNT_DATA::default()
                };
                self.reply(from, &MavMessage::MISSION_COUNT(data));
            }
            MavMessage::MISSION_COUNT(it) => {
                self.clients.say(MavSeverity::MAV_SEVERITY_WARNING, "Missions are not simulated");
                self.mission(from, sender, MavMissionResult::MAV_MISSION_UNSUPPORTED, it.mission_type);
            }
            MavMessage::MISSION_CLEAR_ALL(it) => {
                if matches!(it.mission_type, MavMissionType::MAV_MISSION_TYPE_FENCE | MavMissionType::MAV_MISSION_TYPE_ALL) {
                    self.fence.clear();
                }
                self.mission(from, sender, MavMissionResult::MAV_MISSION_ACCEPTED, it.mission_type);
            }
            MavMessage::MISSION_REQUEST_INT(it) => {
                self.mission(from, sender, MavMissionResult::MAV_MISSION_INVALID_SEQUENCE, it.mission_type);
            }
            MavMessage::REQUEST_DATA_STREAM(it) => {
                let rate = if it.start_stop == 0 { 0 } else { it.req_message_rate.min(50) };
                self.clients.set_group(now, from, it.req_stream_id as u8, rate);
            }
            MavMessage::OBSTACLE_DISTANCE(it) => self.told = Some(Box::new(it.clone())),
            MavMessage::FILE_TRANSFER_PROTOCOL(it) => self.refuse_files(from, sender, it),
            _ => {}
        }
    }

    fn reply(&mut self, to: Peer, message: &MavMessage) {
        self.clients.send(to, Body::from(message));
    }

    fn mission(
        &mut self,
        to: Peer,
        [target_system, target_component]: [u8; 2],
        result: MavMissionResult,
        mission_type: MavMissionType,
    ) {
        let data =
            MISSION_ACK_DATA { target_system, target_component, mavtype: result, mission_type, ..MISSION_ACK_DATA::default() };
        self.reply(to, &MavMessage::MISSION_ACK(data));
    }

    fn send_parameter(&mut self, to: Peer, index: u16) {
        let Some((name, value)) = self.parameters.at(index) else { return };
        let (param_value, kind) = value.encode(self.parameters.encoding);
        let param_type = match kind {
            2 => MavParamType::MAV_PARAM_TYPE_INT8,
            4 => MavParamType::MAV_PARAM_TYPE_INT16,
            6 => MavParamType::MAV_PARAM_TYPE_INT32,
            _ => MavParamType::MAV_PARAM_TYPE_REAL32,
        };
        let data = PARAM_VALUE_DATA {
            param_value,
            param_count: self.parameters.count(),
            param_index: index,
            param_id: name_bytes(name).into(),
            param_type,
        };
        self.reply(to, &MavMessage::PARAM_VALUE(data));
    }

    /// There are no files: a client is told so at once, and asks by other messages.
    fn refuse_files(&mut self, to: Peer, [target_system, target_component]: [u8; 2], asked: &FILE_TRANSFER_PROTOCOL_DATA) {
        let mut payload = [0; 251];
        let [low, high, session, operation, ..] = asked.payload;
        let sequence = u16::from_le_bytes([low, high]).wrapping_add(1).to_le_bytes();
        // NAK (129) of the operation, with one byte: an unknown command (7).
        payload[..6].copy_from_slice(&[sequence[0], sequence[1], session, 129, 1, operation]);
        payload[12] = 7;
        let data = FILE_TRANSFER_PROTOCOL_DATA { target_network: 0, target_system, target_component, payload };
        self.reply(to, &MavMessage::FILE_TRANSFER_PROTOCOL(data));
    }

    /// A setpoint, by the rules of the autopilot.
    fn setpoint(&mut self, now: Time, it: &SET_POSITION_TARGET_LOCAL_NED_DATA, craft: &SimCraft) {
        let mask = it.type_mask.bits();
        let frame = it.coordinate_frame as u8;
        let px4 = self.autopilot == Autopilot::Px4;
        if !px4 && self.mode != self.autopilot.external() {
            return;
        }
        let refused = if px4 { !matches!(frame, 1 | 8) } else { !matches!(frame, 1 | 7 | 8 | 9) };
        if refused {
            if px4 {
                self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, "SET_POSITION_TARGET_LOCAL_NED invalid");
            } else {
                // Guided starts over, and stops.
                self.target = None;
            }
            return;
        }
        let (has_position, has_velocity) = (mask & 7 == 0, mask & 56 == 0);
        let body = matches!(frame, 8 | 9);
        let yaw = match (mask & 1024 == 0, mask & 2048 == 0) {
            (_, true) if it.yaw_rate.is_finite() => Yaw::Rate(it.yaw_rate),
            (true, _) if it.yaw.is_finite() => Yaw::Heading(it.yaw),
            _ => Yaw::Keep,
        };
        let velocity = [it.vx, it.vy, it.vz];
        let place = [it.x, it.y, it.z];
        let target = if has_position && !(body && px4) && place.iter().all(|value| value.is_finite()) {
            let ned = position_from_ned(place);
            let here = self.position(craft);
            let place = match frame {
                1 => ned,
                9 => {
                    let heading = craft.telemetry().attitude.heading;
                    let [forward, right, down] = place.map(f64::from);
                    here.displaced(spf_core::geometry::BodyDisplacement { right, forward, up: -down }, heading)
                }
                _ => spf_core::geometry::EnuPosition {
                    east: here.east + ned.east,
                    north: here.north + ned.north,
                    up: here.up + ned.up,
                },
            };
            Target::Position(place, yaw)
        } else if has_velocity {
            if velocity.iter().any(|value| !value.is_finite() || value.abs() > FASTEST) {
                if !px4 {
                    self.target = None;
                }
                return;
            }
            let ned = if body { turned(velocity, craft.telemetry().attitude.heading) } else { velocity };
            Target::Velocity(ned, yaw)
        } else {
            if px4 {
                self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, "SET_POSITION_TARGET_LOCAL_NED invalid");
            }
            return;
        };
        (self.target, self.stopped_silent) = (Some((now, target)), false);
    }
}

/// A velocity forward, right, down as one north, east, down: turned by the heading once, on receipt.
fn turned([forward, right, down]: [f32; 3], heading: f64) -> [f32; 3] {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    let (forward, right) = (f64::from(forward), f64::from(right));
    [(forward * cos - right * sin) as f32, (forward * sin + right * cos) as f32, down]
}
