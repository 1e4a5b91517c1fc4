//! Links and clock for a [`VirtualVehicle`].

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_flight::sim::CameraTilt;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::url::MavlinkUrl;
use spf_mavlink::wire::{Decoder, Encoder};
use spf_sim::craft::SimCraft;

use super::error::VehicleServerError;
use super::machine::{Peer, VirtualVehicle};
use super::transport::{Happened, Transports};
use crate::fault::{FaultMachine, Stream};
use crate::tello::FaultSource;
use crate::tello::faults::{Watch, read};
use crate::tello::link::Link;
use crate::tello::shared::lock;

/// Messages that wait for the flight.
const WAITING: usize = 1024;
/// Longest sleep of the flight.
const NAP: Duration = Duration::from_millis(10);
/// System and component of the vehicle.
const VEHICLE: [u8; 2] = [1, 1];
/// Maximum number of clients whose packets are put together.
const DECODERS: usize = 64;

/// What a vehicle carries besides what every one does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Equipment {
    /// Rangefinders ahead, left and right, and a proximity sensor all round.
    pub ranges: bool,
    /// A camera on a gimbal.
    pub gimbal: bool,
}

/// Configuration of a server.
pub struct VehicleSetup {
    /// The autopilot.
    pub autopilot: Autopilot,
    /// Where it is reached: `udpout` sends from the start, `udpin` and `tcpin` answer whoever comes.
    pub links: Vec<MavlinkUrl>,
    /// Parameters that differ from their defaults.
    pub parameters: Vec<(String, f64)>,
    /// The craft. Only the server may advance it.
    pub craft: Arc<Mutex<SimCraft>>,
    /// Faults of its UDP links.
    pub faults: FaultSource,
    /// Tilt of the camera, if it is on a gimbal.
    pub camera_tilt: CameraTilt,
    /// What it carries.
    pub equipment: Equipment,
    /// Seed of all random choices.
    pub seed: u64,
    /// Wall-clock time of the craft's time zero.
    pub start: Instant,
}

/// What somebody at the vehicle does, for tests.
enum Deed {
    Radio(Mode),
}

/// A running virtual vehicle; it stops when dropped.
pub struct VehicleServer {
    transports: Arc<Mutex<Transports>>,
    bound: Vec<Option<SocketAddr>>,
    stopped: Arc<AtomicBool>,
    deeds: Sender<Deed>,
    state: Arc<Mutex<(Mode, bool)>>,
    thread: Option<JoinHandle<()>>,
}

impl VehicleServer {
    /// Opens the links and starts serving.
    ///
    /// # Errors
    /// [`VehicleServerError`] if a link cannot be opened, a thread cannot be started, or the faults are invalid.
    pub fn start(setup: VehicleSetup) -> Result<Self, VehicleServerError> {
        let VehicleSetup { autopilot, links, parameters, craft, faults, camera_tilt, equipment, seed, start } = setup;
        let machine = FaultMachine::new(read(&faults)?, seed)?;
        let (stopped, (events, happened)) = (Arc::new(AtomicBool::new(false)), sync_channel(WAITING));
        let transports = Transports::open(&links, &events, &stopped)?;
        let mut vehicle = VirtualVehicle::new(autopilot, &lock(&craft));
        for (name, value) in &parameters {
            if !vehicle.set_parameter(name, *value) {
                tracing::warn!("the simulated {} has no parameter {name}", autopilot.name());
            }
        }
        if equipment.gimbal {
            vehicle.carry_gimbal(false);
        }
        if equipment.ranges {
            vehicle.measure_ranges();
        }
        let now = Time::ZERO + start.elapsed();
        transports.first.iter().for_each(|peer| vehicle.join(now, *peer));
        let bound = transports.bound.clone();
        let transports = Arc::new(Mutex::new(transports));
        let (deeds, done) = channel();
        let state = Arc::new(Mutex::new((vehicle.mode(), false)));
        let watch = Watch::new(faults, seed);
        let links = (0..links.len()).map(|_| Link::new(machine.clone())).collect();
        let flight = Flight {
            vehicle,
            camera_tilt,
            craft,
            links,
            transports: transports.clone(),
            decoders: BTreeMap::new(),
            encoders: BTreeMap::new(),
            happened,
            done,
            watch,
            start,
            state: state.clone(),
        };
        let ends = stopped.clone();
        let thread = Builder::new().name("mavlink flight".to_owned()).spawn(move || flight.run(&ends));
        Ok(Self { transports, bound, stopped, deeds, state, thread: Some(thread.map_err(VehicleServerError::Thread)?) })
    }

    /// The addresses bound, in the order of the links; `None` for a serial port.
    #[must_use]
    pub fn bound(&self) -> &[Option<SocketAddr>] {
        &self.bound
    }

    /// Its pilot changes the mode by the switch of the radio.
    pub fn radio(&self, mode: Mode) {
        drop(self.deeds.send(Deed::Radio(mode)));
    }

    /// Its flight mode, and whether it is armed.
    #[must_use]
    pub fn state(&self) -> (Mode, bool) {
        *lock(&self.state)
    }
}

impl Drop for VehicleServer {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        drop(self.thread.take().map(JoinHandle::join));
        lock(&self.transports).join();
    }
}

/// The thread that flies.
struct Flight {
    vehicle: VirtualVehicle,
    camera_tilt: CameraTilt,
    craft: Arc<Mutex<SimCraft>>,
    /// The radio, with its faults, of each link.
    links: Vec<Link>,
    transports: Arc<Mutex<Transports>>,
    decoders: BTreeMap<Peer, Decoder>,
    /// Each client gets numbers of its own, by which it sees what is lost.
    encoders: BTreeMap<(Peer, [u8; 2]), Encoder>,
    happened: Receiver<Happened>,
    done: Receiver<Deed>,
    watch: Watch,
    start: Instant,
    state: Arc<Mutex<(Mode, bool)>>,
}

impl Flight {
    fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    fn run(mut self, stopped: &AtomicBool) {
        while !stopped.load(Ordering::Relaxed) {
            let nap = self.vehicle.next_deadline().since(self.now()).clamp(Duration::from_millis(1), NAP);
            match self.happened.recv_timeout(nap) {
                Ok(happened) => self.take(happened),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            while let Ok(happened) = self.happened.try_recv() {
                self.take(happened);
            }
            let now = self.now();
            if let Some(faults) = self.watch.look(now) {
                self.links.iter_mut().for_each(|link| link.set_faults(faults.clone()));
            }
            self.arrive(now);
            let craft = self.craft.clone();
            let mut craft = lock(&craft);
            while let Ok(Deed::Radio(mode)) = self.done.try_recv() {
                self.vehicle.radio(now, mode, &mut craft);
            }
            self.vehicle.advance(now, &mut craft);
            if let Some(tilt) = self.vehicle.camera_tilt() {
                self.camera_tilt.set(craft.time(), tilt);
            }
            drop(craft);
            *lock(&self.state) = (self.vehicle.mode(), self.vehicle.is_armed());
            self.depart(now);
        }
    }

    fn take(&mut self, happened: Happened) {
        let now = self.now();
        match happened {
            Happened::Joined(peer) => self.vehicle.join(now, peer),
            Happened::Left(peer) => {
                self.vehicle.leave(peer);
                self.decoders.remove(&peer);
                self.encoders.retain(|(of, _), _| *of != peer);
            }
            Happened::Received(peer, bytes, _) if lock(&self.transports).is_datagram(peer.link) => {
                self.links[peer.link].send(now, Stream::Commands, peer.address, &bytes);
            }
            Happened::Received(peer, bytes, restarts) => self.decode(now, peer, &bytes, restarts),
        }
    }

    /// Takes the datagrams that have passed the radio.
    fn arrive(&mut self, now: Time) {
        for link in 0..self.links.len() {
            while let Some(packet) = self.links[link].take(now, |stream| stream == Stream::Commands) {
                self.decode(packet.at.max(now), Peer { link, address: packet.peer }, &packet.bytes, true);
            }
        }
    }

    fn decode(&mut self, now: Time, peer: Peer, bytes: &[u8], restarts: bool) {
        if self.decoders.len() >= DECODERS && !self.decoders.contains_key(&peer) {
            self.decoders.clear();
            self.encoders.clear();
        }
        let decoder = self.decoders.entry(peer).or_default();
        if restarts {
            decoder.clear();
        }
        decoder.push(bytes);
        let craft = self.craft.clone();
        let mut craft = lock(&craft);
        craft.advance_to(now);
        while let Some(packet) = decoder.next_packet() {
            self.vehicle.handle(now, peer, &packet, &mut craft);
        }
    }

    /// Sends what there is to send, over the radio.
    fn depart(&mut self, now: Time) {
        let transports = self.transports.clone();
        let transports = lock(&transports);
        let next = |vehicle: &mut VirtualVehicle| {
            vehicle.poll().map(|(peer, body)| (peer, VEHICLE, body)).or_else(|| vehicle.poll_forwarded())
        };
        if self.encoders.len() > DECODERS * 4 {
            self.encoders.clear();
        }
        while let Some((peer, of, body)) = next(&mut self.vehicle) {
            let frame = self.encoders.entry((peer, of)).or_insert_with(|| Encoder::new(of)).frame(&body);
            if transports.is_datagram(peer.link) {
                self.links[peer.link].send(now, Stream::Telemetry, peer.address, &frame);
            } else {
                transports.send(peer, &frame);
            }
        }
        for (link, radio) in self.links.iter_mut().enumerate() {
            while let Some(packet) = radio.take(now, |stream| stream == Stream::Telemetry) {
                transports.send(Peer { link, address: packet.peer }, &packet.bytes);
            }
        }
    }
}
