//! The virtual vehicle's protocol in virtual time: what it answers, refuses and does.

use std::net::SocketAddr;

use proptest::prelude::*;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::command::{Transmission, VehicleCommand, ids};
use spf_mavlink::dialect::{
    MavFrame, MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_SET_DATA, PositionTargetTypemask, SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use spf_mavlink::message;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::parameter::{ParameterEncoding, ParameterValue, name_bytes};
use spf_mavlink::report::Report;
use spf_mavlink::wire::{Body, Decoder, Encoder, Packet};
use spf_serve::mavlink::{Peer, VirtualVehicle};
use spf_sim::craft::SimCraft;
use spf_sim::dynamics::SimConditions;
use spf_sim::model::Model;

use crate::boxes::{at, facing, scene};

const CLIENT: Peer = Peer { link: 0, address: SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 14_550) };
const NAN: f32 = f32::NAN;

/// A ground station and a vehicle, connected only by virtual time.
struct Bench {
    craft: SimCraft,
    vehicle: VirtualVehicle,
    now: Time,
    encoders: [Encoder; 2],
    heard: Vec<Packet>,
}

impl Bench {
    fn with(autopilot: Autopilot, battery: f64) -> Self {
        let conditions = SimConditions { exact: true, battery, ..SimConditions::new(1) };
        // It looks east.
        let craft = SimCraft::with_conditions(scene(), Model::quad(), facing(at(0.0, 0.0, 0.0), 90.0), conditions);
        let vehicle = VirtualVehicle::new(autopilot, &craft);
        let encoders = [Encoder::new([255, 190]), Encoder::new([1, 1])];
        let mut bench = Self { craft, vehicle, now: Time::ZERO, encoders, heard: Vec::new() };
        bench.wait(3.0);
        bench
    }

    /// In the air, held by itself.
    fn flying(autopilot: Autopilot) -> Self {
        let mut bench = Self::with(autopilot, 1.0);
        if autopilot == Autopilot::ArduPilot {
            assert_eq!(bench.ask(ids::SET_MODE, &[1.0, 4.0]), 0);
        }
        assert_eq!(bench.ask(ids::ARM, &[1.0]), 0);
        let height = if autopilot == Autopilot::Px4 { NAN } else { 3.0 };
        assert_eq!(bench.ask(ids::TAKE_OFF, &[0.0, 0.0, 0.0, NAN, NAN, NAN, height]), 0);
        bench.wait(8.0);
        assert_eq!(bench.craft.dynamics().phase(), FlightPhase::Flying);
        bench
    }

    fn say(&mut self, body: &Body) {
        let frame = self.encoders[0].frame(body);
        let mut decoder = Decoder::default();
        decoder.push(&frame);
        let packet = decoder.next_packet().unwrap();
        self.vehicle.handle(self.now, CLIENT, &packet, &mut self.craft);
        self.listen();
    }

    fn listen(&mut self) {
        while let Some((_, body)) = self.vehicle.poll() {
            let mut decoder = Decoder::default();
            decoder.push(&self.encoders[1].frame(&body));
            self.heard.push(decoder.next_packet().unwrap());
        }
    }

    fn wait(&mut self, seconds: f64) {
        let until = self.now + Duration::from_secs_f64(seconds);
        while self.now < until {
            self.now += Duration::from_millis(10);
            self.vehicle.advance(self.now, &mut self.craft);
            self.listen();
        }
    }

    /// The result of a command.
    fn ask(&mut self, id: u16, parameters: &[f32]) -> u8 {
        self.heard.clear();
        let command = VehicleCommand::new(id, parameters);
        self.say(&message::command([1, 1], &Transmission { command, confirmation: 0, as_int: false }));
        let result = |packet: &Packet| match packet.report() {
            Report::Acknowledgement { command, result, target } if command == id && target == [255, 190] => Some(result),
            _ => None,
        };
        self.heard.iter().find_map(result).unwrap_or_else(|| panic!("no acknowledgement of {id}"))
    }

    fn setpoint(&mut self, frame: MavFrame, mask: u16, velocity: [f32; 3]) {
        let [vx, vy, vz] = velocity;
        let data = SET_POSITION_TARGET_LOCAL_NED_DATA {
            vx,
            vy,
            vz,
            target_system: 1,
            coordinate_frame: frame,
            type_mask: PositionTargetTypemask::from_bits_retain(mask),
            ..SET_POSITION_TARGET_LOCAL_NED_DATA::default()
        };
        self.say(&Body::from(&MavMessage::SET_POSITION_TARGET_LOCAL_NED(data)));
    }

    /// Streams a setpoint at 20 Hz; returns the velocity at the end, east and north.
    fn stream(&mut self, seconds: f64, frame: MavFrame, velocity: [f32; 3]) -> [f64; 2] {
        for _ in 0..(seconds * 20.0) as u32 {
            self.setpoint(frame, 0x05c7, velocity);
            self.wait(0.05);
        }
        let velocity = self.craft.truth().velocity;
        [velocity.east, velocity.north]
    }

    fn texts(&self) -> Vec<String> {
        let text = |packet: &Packet| if let Report::Text { text, .. } = packet.report() { Some(text) } else { None };
        self.heard.iter().filter_map(text).collect()
    }
}

/// The craft looks east: forward is east, and a velocity north in the world's frame is to its left.
#[test]
#[allow(deprecated, reason = "the frame that both autopilots take")]
fn velocities_are_flown_in_the_frames_that_each_autopilot_takes() {
    let mut px4 = Bench::flying(Autopilot::Px4);
    px4.stream(1.0, MavFrame::MAV_FRAME_BODY_NED, [0.0; 3]);
    assert_eq!(px4.ask(ids::SET_MODE, &[129.0, 6.0, 0.0]), 0);
    let [east, north] = px4.stream(3.0, MavFrame::MAV_FRAME_BODY_NED, [2.0, 0.0, 0.0]);
    assert!((east - 2.0).abs() < 0.1 && north.abs() < 0.1, "{east} {north}");
    let [east, north] = px4.stream(3.0, MavFrame::MAV_FRAME_LOCAL_NED, [1.0, 0.0, 0.0]);
    assert!(east.abs() < 0.1 && (north - 1.0).abs() < 0.1, "{east} {north}");
    // Refused frames are told, and count for nothing.
    px4.heard.clear();
    px4.stream(0.2, MavFrame::MAV_FRAME_BODY_OFFSET_NED, [1.0, 0.0, 0.0]);
    assert!(px4.texts().iter().any(|text| text == "SET_POSITION_TARGET_LOCAL_NED invalid"), "{:?}", px4.texts());

    let mut copter = Bench::flying(Autopilot::ArduPilot);
    let [east, _] = copter.stream(3.0, MavFrame::MAV_FRAME_BODY_OFFSET_NED, [2.0, 0.0, 0.0]);
    assert!((east - 2.0).abs() < 0.1, "{east}");
    // Without a velocity in full there is none.
    copter.setpoint(MavFrame::MAV_FRAME_BODY_NED, 0x05c7, [NAN, 0.0, 0.0]);
    copter.wait(2.0);
    assert!(copter.craft.truth().velocity.speed() < 0.1);
}

#[test]
#[allow(deprecated, reason = "the frame that both autopilots take")]
fn offboard_needs_a_stream_and_its_loss_does_what_the_parameters_say() {
    let mut bench = Bench::flying(Autopilot::Px4);
    assert_eq!(bench.ask(ids::SET_MODE, &[129.0, 6.0, 0.0]), 1);
    assert_eq!(bench.texts(), ["Switching to Offboard is currently not available"]);
    // Just one, as MAVSDK does.
    bench.setpoint(MavFrame::MAV_FRAME_BODY_NED, 0x05c7, [1.0, 0.0, 0.0]);
    assert_eq!(bench.ask(ids::SET_MODE, &[129.0, 6.0, 0.0]), 0);
    bench.wait(0.9);
    assert_eq!(bench.vehicle.mode(), Autopilot::Px4.external());
    bench.wait(0.3);
    assert_eq!(bench.vehicle.mode(), Mode::px4(3, 0));
    assert!(bench.vehicle.set_parameter("COM_OBL_RC_ACT", 3.0) && bench.vehicle.set_parameter("RTL_RETURN_ALT", 5.0));
    bench.setpoint(MavFrame::MAV_FRAME_BODY_NED, 0x05c7, [1.0, 0.0, 0.0]);
    assert_eq!(bench.ask(ids::SET_MODE, &[129.0, 6.0, 0.0]), 0);
    bench.stream(8.0, MavFrame::MAV_FRAME_BODY_NED, [2.0, 0.0, 0.0]);
    let home = at(0.0, 0.0, 0.0);
    assert!(bench.craft.truth().pose.position.horizontal_distance(home) > 10.0);
    bench.wait(50.0);
    assert!(bench.craft.truth().pose.position.horizontal_distance(home) < 1.0 && !bench.vehicle.is_armed());
}

#[test]
fn what_cannot_be_done_is_refused_and_what_is_unknown_is_unsupported() {
    for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
        let mut bench = Bench::with(autopilot, 1.0);
        assert_eq!(bench.ask(54_321, &[]), 3);
        assert_ne!(bench.ask(ids::TAKE_OFF, &[0.0, 0.0, 0.0, NAN, NAN, NAN, 3.0]), 0, "disarmed");
        assert_ne!(bench.ask(ids::LAND, &[]), 0);
        assert_eq!(bench.ask(ids::SET_MODE, &[1.0, 77.0]), 2);
        assert_eq!(bench.ask(ids::SET_MODE, &[NAN, NAN, NAN]), 2);
        let mission: &[f32] = if autopilot == Autopilot::Px4 { &[1.0, 4.0, 4.0] } else { &[1.0, 3.0] };
        assert_eq!((bench.ask(ids::SET_MODE, mission), bench.texts()), (2, vec!["No valid mission available".to_owned()]));
        assert_eq!(bench.ask(ids::REQUEST, &[9999.0]), 3);
        assert_eq!(bench.ask(ids::INTERVAL, &[NAN, 1.0]), 3);
        let mut flying = Bench::flying(autopilot);
        assert_ne!(flying.ask(ids::ARM, &[0.0]), 0, "in the air");
        assert!(flying.vehicle.is_armed());
        assert_eq!(flying.ask(ids::ARM, &[0.0, spf_mavlink::command::FORCE]), 0);
        flying.wait(5.0);
        assert!(!flying.vehicle.is_armed());
    }
}

#[test]
fn all_parameters_arrive_and_one_that_is_set_is_told() {
    for (autopilot, encoding) in [(Autopilot::Px4, ParameterEncoding::Bytewise), (Autopilot::ArduPilot, ParameterEncoding::Cast)]
    {
        let mut bench = Bench::with(autopilot, 1.0);
        bench.heard.clear();
        bench
            .say(&Body::from(&MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 1 })));
        let listed = bench.heard.iter().filter(|packet| matches!(packet.report(), Report::Parameter { .. })).count();
        assert!(listed > 20, "{listed}");
        let (name, kind) = if autopilot == Autopilot::Px4 { ("COM_OBL_RC_ACT", 6) } else { ("FENCE_ENABLE", 2) };
        let (param_value, _) = ParameterValue::Integer(1, kind).encode(encoding);
        let param_type = if kind == 6 {
            spf_mavlink::dialect::MavParamType::MAV_PARAM_TYPE_INT32
        } else {
            spf_mavlink::dialect::MavParamType::MAV_PARAM_TYPE_INT8
        };
        let param_id = name_bytes(name).into();
        bench.heard.clear();
        let data = PARAM_SET_DATA { param_value, target_system: 1, target_component: 1, param_id, param_type };
        bench.say(&Body::from(&MavMessage::PARAM_SET(data)));
        let Report::Parameter { name: told, field, kind } = bench.heard[0].report() else { panic!("{:?}", bench.heard) };
        assert_eq!((told.as_str(), ParameterValue::decode(field, kind, encoding).unwrap().number()), (name, 1.0));
    }
}

#[test]
fn a_fence_and_a_landing_end_a_flight_that_goes_too_far() {
    let mut bench = Bench::flying(Autopilot::ArduPilot);
    for (name, value) in [("FENCE_ENABLE", 1.0), ("FENCE_RADIUS", 8.0), ("RTL_ALT", 400.0)] {
        assert!(bench.vehicle.set_parameter(name, value));
    }
    bench.heard.clear();
    #[allow(deprecated, reason = "the frame that both autopilots take")]
    bench.stream(6.0, MavFrame::MAV_FRAME_BODY_NED, [2.0, 0.0, 0.0]);
    assert!(bench.texts().iter().any(|text| text == "Fence Breached"), "{:?}", bench.texts());
    assert_eq!(bench.vehicle.mode(), Autopilot::ArduPilot.return_home());
    bench.wait(40.0);
    assert_eq!((bench.craft.dynamics().phase(), bench.vehicle.is_armed()), (FlightPhase::OnGround, false));
}

proptest! {
    /// Whatever clients send, it answers in bounded memory and its numbers stay finite.
    #[test]
    fn no_packet_panics(packets in proptest::collection::vec((0_u32..270, proptest::collection::vec(any::<u8>(), 0..60)), 1..20)) {
        for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
            let mut bench = Bench::with(autopilot, 1.0);
            bench.ask(ids::ARM, &[1.0]);
            for (id, payload) in &packets {
                bench.say(&Body { id: *id, payload: payload.clone() });
                bench.wait(0.05);
            }
            let truth = bench.craft.truth();
            prop_assert!(truth.velocity.speed().is_finite() && truth.pose.position.up.is_finite());
        }
    }
}
