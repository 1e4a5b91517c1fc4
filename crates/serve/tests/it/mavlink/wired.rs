//! The MAVLink driver and the virtual vehicle, connected in virtual time without sockets.

use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use spf_core::command::{Command, Setpoint};
use spf_core::craft::Craft;
use spf_core::frame::FrameId;
use spf_core::ranges::RangeScan;
use spf_core::time::{Duration, Time};
use spf_drone::frames::Frames;
use spf_drone::mavlink::vehicle::{Notice, Outgoing, Vehicle};
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;
use spf_flight::sim::{SimFrames, SimWorld};
use spf_mavlink::command::VehicleCommand;
use spf_mavlink::message;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::wire::{Body, Decoder, Encoder, LinkStats, Sequence};
use spf_motion::estimator::TelemetryAccuracy;
use spf_serve::fault::{Content, FaultMachine, FaultPlan, Stream};
use spf_serve::mavlink::{Peer, VirtualVehicle};
use spf_sim::frame_clock::FrameClock;

const STEP: Duration = Duration::from_millis(5);
/// Messages that are measurements: system state, satellites, attitude, position, height, ranges, estimator.
const MEASURED: [u32; 9] = [1, 24, 30, 31, 32, 33, 132, 147, 230];
/// Our program, and another ground station.
const US: Peer = Peer { link: 0, address: SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 14_540) };
const OTHERS: Peer = Peer { link: 0, address: SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 14_550) };

/// Something that somebody else does.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Deed {
    /// The switch of the radio.
    Radio(Mode),
    /// Another ground station's command.
    Station(VehicleCommand),
    /// Its position is this uncertain from now on, metres.
    Blur(f32),
    /// Its estimator is reset, by metres east and north.
    Jump([f64; 2]),
    /// From now on another onboard computer sends zero setpoints, 10 a second, and heartbeats.
    Companion,
}

/// What happened during a flight.
#[derive(Default)]
pub(crate) struct Told {
    pub(crate) notices: Vec<(Time, Notice)>,
    /// Everything that the driver sent but heartbeats and requests for parameters.
    pub(crate) sent: Vec<(Time, Outgoing)>,
    /// Modes, as they changed.
    pub(crate) modes: Vec<(Time, Mode)>,
}

/// A message on its way.
type Flying = (Time, Vec<u8>);

/// The driver, the vehicle, and a virtual radio.
pub(crate) struct WiredVehicle {
    world: SimWorld,
    served: VirtualVehicle,
    pub(crate) driver: Vehicle,
    encoders: [Encoder; 4],
    decoders: [Decoder; 3],
    sequence: Sequence,
    faults: FaultMachine,
    count: u64,
    up: Vec<Flying>,
    down: Vec<Flying>,
    deeds: VecDeque<(Time, Deed)>,
    companion: bool,
    /// When a thread of the driver dies.
    pub(crate) thread_dies_at: Option<Time>,
    /// The last message of each kind from before a freeze.
    last: BTreeMap<u32, Body>,
    /// When the program that flies dies.
    pub(crate) dies_at: Option<Time>,
    pub(crate) now: Time,
    clock: FrameClock,
    frame: FrameId,
    events: VecDeque<(Time, DroneEvent)>,
    pub(crate) told: Arc<Mutex<Told>>,
}

impl WiredVehicle {
    /// A vehicle that was switched on three seconds ago, with these parameters.
    pub(crate) fn new(
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
            encoders: [[1, 191], [1, 1], [255, 190], [1, 192]].map(Encoder::new),
            decoders: Default::default(),
            sequence: Sequence::default(),
            faults: FaultMachine::new(faults, 3).unwrap(),
            count: 0,
            up: Vec::new(),
            down: Vec::new(),
            deeds: deeds.into_iter().map(|(at, deed)| (Time::from_secs_f64(at), deed)).collect(),
            companion: false,
            thread_dies_at: None,
            last: BTreeMap::new(),
            dies_at: None,
            now,
            clock: FrameClock::default(),
            frame: FrameId(0),
            events: VecDeque::new(),
            told: Arc::default(),
        }
    }

    /// Until it is known where it stands.
    pub(crate) fn get_ready(&mut self) {
        let begun = self.now;
        while !(self.driver.is_oriented(self.now) && self.driver.is_placed() && self.driver.is_read()) {
            assert!(self.now.since(begun) < Duration::from_secs(10), "not ready: {:?}", self.driver.facts());
            self.step();
        }
        self.driver.engage(self.now);
    }

    /// The program dies and starts again: another driver, which knows nothing. Returns whether it flies the vehicle.
    pub(crate) fn restart(&mut self) -> bool {
        self.dies_at = Some(self.now);
        self.steps(1.0);
        (self.driver, self.dies_at) = (Vehicle::new(self.now, self.served.mode(), [1, 191], 3.0, false), None);
        self.get_ready();
        self.driver.is_ours()
    }

    pub(crate) fn steps(&mut self, seconds: f64) {
        let until = self.now + spf_core::time::duration_from_secs(seconds);
        while self.now < until {
            self.step();
        }
    }

    /// What another onboard computer sends.
    fn accompany(&mut self, craft: &mut spf_sim::craft::SimCraft) {
        self.count += 1;
        let beats = self.count.is_multiple_of(10);
        let bodies = [message::setpoint([1, 1], self.now, Setpoint::HOLD), message::heartbeat_of_computer()];
        for body in bodies.iter().take(1 + usize::from(beats)) {
            self.decoders[2].push(&self.encoders[3].frame(body));
            while let Some(packet) = self.decoders[2].next_packet() {
                self.served.handle(self.now, OTHERS, &packet, craft);
            }
        }
    }

    /// An old ArduPilot, which knows no rates of single messages.
    pub(crate) fn grow_old(&mut self) {
        self.served.grow_old();
    }

    /// With its camera on a gimbal.
    pub(crate) fn carry_gimbal(&mut self, old: bool) {
        self.served.carry_gimbal(old);
    }

    /// Where the gimbal points, radians below the horizon.
    pub(crate) fn camera_tilt(&self) -> Option<f64> {
        self.served.camera_tilt()
    }

    /// Somebody sets its home.
    pub(crate) fn set_home(&mut self, place: spf_mavlink::frames::GlobalPosition) {
        // COMMAND_INT: its place is in units of 1e-7 degrees.
        let [latitude, longitude] = place.e7();
        let mut payload = vec![0; 16];
        payload.extend([latitude, longitude].iter().flat_map(|value| value.to_le_bytes()));
        payload.extend((place.altitude as f32).to_le_bytes());
        payload.extend(179_u16.to_le_bytes());
        payload.extend([1, 1, 0, 0, 0]);
        let body = Body { id: 75, payload };
        self.decoders[2].push(&self.encoders[2].frame(&body));
        let packet = self.decoders[2].next_packet().unwrap();
        let shared = self.world.shared_craft();
        self.served.handle(self.now, OTHERS, &packet, &mut shared.lock().unwrap());
    }

    /// With the receiver of a radio.
    pub(crate) fn carry_receiver(&mut self) {
        self.served.carry_receiver();
    }

    /// With sensors around it.
    pub(crate) fn measure_ranges(&mut self) {
        self.served.measure_ranges();
    }

    /// What another program has told it about obstacles: centimetres clockwise from straight ahead.
    pub(crate) fn told_obstacles(&self) -> Option<[u16; 72]> {
        self.served.told_obstacles().map(|told| told.distances)
    }

    /// From now on its heartbeat comes once a second only.
    pub(crate) fn beat_strictly(&mut self) {
        self.served.beat_strictly();
    }

    fn pass(&mut self, stream: Stream, frame: &[u8]) -> Vec<Flying> {
        self.count += 1;
        let passed = self.faults.pass(self.now, stream, self.count);
        passed.into_iter().filter(|it| it.content == Content::Intact).map(|it| (it.at, frame.to_vec())).collect()
    }

    /// Sends a message of the vehicle over the radio. Frozen telemetry is the last one from before, again and again; states, answers
    /// and texts are none.
    fn deliver(&mut self, body: Body) {
        self.count += 1;
        for passed in self.faults.pass(self.now, Stream::Telemetry, self.count) {
            let body = match passed.content {
                Content::Intact => {
                    self.last.insert(body.id, body.clone());
                    body.clone()
                }
                Content::FrozenSince(_) if MEASURED.contains(&body.id) => self.last.get(&body.id).unwrap_or(&body).clone(),
                Content::FrozenSince(_) => body.clone(),
                _ => continue,
            };
            let frame = self.encoders[1].frame(&body);
            self.down.push((passed.at, frame));
        }
    }

    fn arrived(flying: &mut Vec<Flying>, now: Time) -> Vec<Vec<u8>> {
        let (mut due, rest): (Vec<_>, Vec<_>) = core::mem::take(flying).into_iter().partition(|(at, _)| *at <= now);
        *flying = rest;
        due.sort_by_key(|(at, _)| *at);
        due.into_iter().map(|(_, frame)| frame).collect()
    }

    pub(crate) fn step(&mut self) {
        let alive = self.dies_at.is_none_or(|dies| self.now < dies);
        if self.thread_dies_at.take_if(|at| *at <= self.now).is_some() {
            self.driver.fail(self.now);
        }
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
                Deed::Companion => self.companion = true,
                Deed::Blur(metres) => self.served.blur(metres),
                Deed::Jump(metres) => self.served.jump(metres),
                Deed::Station(command) => {
                    let sent = spf_mavlink::command::Transmission { command, confirmation: 0, as_int: false };
                    let frame = self.encoders[2].frame(&message::command([1, 1], &sent));
                    self.decoders[2].push(&frame);
                    let packet = self.decoders[2].next_packet().unwrap();
                    self.served.handle(now, OTHERS, &packet, &mut craft);
                }
            }
        }
        if self.companion && now.as_nanos().is_multiple_of(100_000_000) {
            self.accompany(&mut craft);
        }
        self.served.advance(now, &mut craft);
        drop(craft);
        while let Some((peer, of, body)) = self.served.poll_forwarded() {
            if peer == US {
                self.down.push((now, Encoder::new(of).frame(&body)));
            }
        }
        while let Some((peer, body)) = self.served.poll() {
            if peer == US {
                self.deliver(body);
            }
        }
        for frame in Self::arrived(&mut self.down, now) {
            self.decoders[1].push(&frame);
            while let Some(packet) = self.decoders[1].next_packet() {
                if let Some(news) = packet.gimbal() {
                    self.driver.handle_gimbal(now, news);
                }
                if packet.component != 1 {
                    if packet.is_controller() && packet.component != 191 {
                        self.driver.hear_station(now);
                    }
                    continue;
                }
                if self.sequence.accept(packet.sequence, &mut LinkStats::default()) {
                    self.driver.handle(now, &packet.report());
                }
            }
        }
        if let Some(tilt) = self.served.camera_tilt() {
            self.world.camera_tilt().set(now, tilt);
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
        let ranges = self.driver.measures_ranges(self.now);
        let facts = self.driver.facts();
        let (return_height, return_climb) = (facts.return_height().ok(), facts.return_climb());
        let craft = Craft { return_height, return_climb, ..Craft::quad() };
        Capabilities { position: true, ranges, ..Capabilities::of(craft, *self.world.camera(), TelemetryAccuracy::quad()) }
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

    fn wants_surroundings(&self) -> bool {
        self.driver.wants_surroundings()
    }

    fn surroundings(&mut self, _now: Time, scan: &RangeScan) {
        self.driver.tell_surroundings(scan);
    }

    fn next_event_at(&self) -> Option<Time> {
        Some(if self.events.is_empty() { self.now + STEP } else { self.now })
    }
}
