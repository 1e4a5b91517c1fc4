//! The MAVLink driver and the virtual vehicle, connected in virtual time without sockets.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::envelope::Cleared;
use spf_core::estimator::TelemetryAccuracy;
use spf_core::fault::{Content, FaultMachine, FaultPlan, Stream};
use spf_core::frame::FrameId;
use spf_core::time::{Duration, Time};
use spf_drone::frames::Frames;
use spf_drone::mavlink::vehicle::{Notice, Outgoing, Vehicle};
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_flight::sim::{SimFrames, SimWorld};
use spf_mavlink::command::VehicleCommand;
use spf_mavlink::message;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::wire::{Decoder, Encoder, LinkStats, Sequence};
use spf_serve::mavlink::{Peer, VirtualVehicle};
use spf_sim::frame_clock::FrameClock;

const STEP: Duration = Duration::from_millis(5);
/// Our program, and another ground station.
const US: Peer = Peer { link: 0, address: SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 14_540) };
const OTHERS: Peer = Peer { link: 0, address: SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 14_550) };

/// Something that somebody else does.
#[derive(Clone, Copy, Debug)]
pub(super) enum Deed {
    /// The switch of the radio.
    Radio(Mode),
    /// Another ground station's command.
    Station(VehicleCommand),
}

/// What happened during a flight.
#[derive(Default)]
pub(super) struct Told {
    pub(super) notices: Vec<(Time, Notice)>,
    /// Everything that the driver sent but heartbeats and requests for parameters.
    pub(super) sent: Vec<(Time, Outgoing)>,
    /// Modes, as they changed.
    pub(super) modes: Vec<(Time, Mode)>,
}

/// A message on its way.
type Flying = (Time, Vec<u8>);

/// The driver, the vehicle, and a virtual radio.
pub(super) struct WiredVehicle {
    world: SimWorld,
    served: VirtualVehicle,
    pub(super) driver: Vehicle,
    encoders: [Encoder; 3],
    decoders: [Decoder; 3],
    sequence: Sequence,
    faults: FaultMachine,
    count: u64,
    up: Vec<Flying>,
    down: Vec<Flying>,
    deeds: VecDeque<(Time, Deed)>,
    /// When the program that flies dies.
    pub(super) dies_at: Option<Time>,
    pub(super) now: Time,
    clock: FrameClock,
    frame: FrameId,
    events: VecDeque<(Time, DroneEvent)>,
    pub(super) told: Arc<Mutex<Told>>,
}

impl WiredVehicle {
    /// A vehicle that was switched on three seconds ago, with these parameters.
    pub(super) fn new(
        world: SimWorld,
        autopilot: Autopilot,
        parameters: &[(&str, f64)],
        faults: FaultPlan,
        deeds: Vec<(f64, Deed)>,
    ) -> Self {
        let shared = world.shared_craft();
        let mut craft = shared.lock().unwrap();
        let mut served = VirtualVehicle::new(autopilot, &craft);
        for (name, value) in parameters {
            assert!(served.set_parameter(name, *value), "{name}");
        }
        served.join(Time::ZERO, US);
        served.join(Time::ZERO, OTHERS);
        let now = Time::from_millis(0);
        let driver = Vehicle::new(now, served.mode(), [1, 191], 3.0, false);
        served.advance(now, &mut craft);
        drop(craft);
        Self {
            world,
            served,
            driver,
            encoders: [[1, 191], [1, 1], [255, 190]].map(Encoder::new),
            decoders: Default::default(),
            sequence: Sequence::default(),
            faults: FaultMachine::new(faults, 3).unwrap(),
            count: 0,
            up: Vec::new(),
            down: Vec::new(),
            deeds: deeds.into_iter().map(|(at, deed)| (Time::from_secs_f64(at), deed)).collect(),
            dies_at: None,
            now,
            clock: FrameClock::default(),
            frame: FrameId(0),
            events: VecDeque::new(),
            told: Arc::default(),
        }
    }

    /// Until it is known where it stands.
    pub(super) fn get_ready(&mut self) {
        while !(self.driver.is_oriented(self.now) && self.driver.is_placed() && self.driver.is_read()) {
            assert!(self.now < Time::from_secs_f64(10.0), "not ready: {:?}", self.driver.facts());
            self.step();
        }
        self.driver.engage(self.now, true);
    }

    /// From now on its heartbeat comes once a second only.
    pub(super) fn beat_strictly(&mut self) {
        self.served.beat_strictly();
    }

    fn pass(&mut self, stream: Stream, frame: &[u8]) -> Vec<Flying> {
        self.count += 1;
        let passed = self.faults.pass(self.now, stream, self.count);
        passed.into_iter().filter(|it| it.content == Content::Intact).map(|it| (it.at, frame.to_vec())).collect()
    }

    fn arrived(flying: &mut Vec<Flying>, now: Time) -> Vec<Vec<u8>> {
        let (mut due, rest): (Vec<_>, Vec<_>) = core::mem::take(flying).into_iter().partition(|(at, _)| *at <= now);
        *flying = rest;
        due.sort_by_key(|(at, _)| *at);
        due.into_iter().map(|(_, frame)| frame).collect()
    }

    pub(super) fn step(&mut self) {
        let alive = self.dies_at.is_none_or(|dies| self.now < dies);
        while alive && let Some(outgoing) = self.driver.poll(self.now) {
            let frame = self.encoders[0].frame(&outgoing.body([1, 1], self.now));
            let passed = self.pass(Stream::Commands, &frame);
            self.up.extend(passed);
            if !matches!(outgoing, Outgoing::Heartbeat | Outgoing::ReadParameter(_)) {
                self.told.lock().unwrap().sent.push((self.now, outgoing));
            }
        }
        self.now += STEP;
        let now = self.now;
        let shared = self.world.shared_craft();
        let mut craft = shared.lock().unwrap();
        craft.advance_to(now);
        for frame in Self::arrived(&mut self.up, now) {
            self.decoders[0].push(&frame);
            while let Some(packet) = self.decoders[0].next_packet() {
                self.served.handle(now, US, &packet, &mut craft);
            }
        }
        while let Some((_, deed)) = self.deeds.pop_front_if(|(at, _)| *at <= now) {
            match deed {
                Deed::Radio(mode) => self.served.radio(now, mode, &mut craft),
                Deed::Station(command) => {
                    let sent = spf_mavlink::command::Transmission { command, confirmation: 0, as_int: false };
                    let frame = self.encoders[2].frame(&message::command([1, 1], &sent));
                    self.decoders[2].push(&frame);
                    let packet = self.decoders[2].next_packet().unwrap();
                    self.served.handle(now, OTHERS, &packet, &mut craft);
                }
            }
        }
        self.served.advance(now, &mut craft);
        drop(craft);
        while let Some((peer, body)) = self.served.poll() {
            if peer == US {
                let frame = self.encoders[1].frame(&body);
                let passed = self.pass(Stream::Telemetry, &frame);
                self.down.extend(passed);
            }
        }
        for frame in Self::arrived(&mut self.down, now) {
            self.decoders[1].push(&frame);
            while let Some(packet) = self.decoders[1].next_packet() {
                if self.sequence.accept(packet.sequence, &mut LinkStats::default()) {
                    self.driver.handle(now, &packet.report());
                }
            }
        }
        let mut told = self.told.lock().unwrap();
        if told.modes.last().is_none_or(|(_, mode)| *mode != self.served.mode()) {
            told.modes.push((now, self.served.mode()));
        }
        while let Some(notice) = self.driver.take_notice() {
            told.notices.push((now, notice));
        }
        drop(told);
        let camera = *self.world.camera();
        let meta = self.clock.meta(self.frame, camera.width, camera.height);
        if meta.received <= now {
            self.frame = FrameId(self.frame.0 + 1);
            self.events.push_back((now, DroneEvent::Frame(meta)));
        }
    }
}

impl Drone for WiredVehicle {
    fn name(&self) -> &str {
        "mavlink"
    }

    fn capabilities(&self) -> Capabilities {
        let craft = Craft { return_height: self.driver.facts().return_height().ok(), ..Craft::quad() };
        Capabilities { position: true, ..Capabilities::of(craft, *self.world.camera(), TelemetryAccuracy::quad()) }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(SimFrames::new(self.world.clone()))
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        self.driver.heartbeat(now);
        self.driver.apply(now, command);
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.driver.heartbeat(self.now);
        loop {
            if let Some(event) = self.driver.take_event().or_else(|| self.events.pop_front()) {
                return Some(event);
            }
            if self.now + STEP > until {
                return None;
            }
            self.step();
        }
    }

    fn resume(&mut self, _now: Time) {
        self.driver.resume();
    }

    fn next_event_at(&self) -> Option<Time> {
        Some(if self.events.is_empty() { self.now + STEP } else { self.now })
    }
}
