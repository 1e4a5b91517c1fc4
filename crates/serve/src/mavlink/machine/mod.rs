//! The virtual autopilot: modes, arming, setpoints, failsafes and what it sends.

mod clients;
mod commands;
mod fence;
mod fly;
mod gimbal;
mod loops;
mod messages;
mod modes;
mod rates;
mod returning;
mod sensors;
mod state;
mod streams;

use std::net::SocketAddr;

use spf_core::geometry::EnuPosition;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::dialect::OBSTACLE_DISTANCE_DATA;
use spf_mavlink::frames::GlobalPosition;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::wire::{Body, Packet};
use spf_sim::craft::SimCraft;

use self::clients::Clients;
use self::fence::Fence;
use self::gimbal::Gimbal;
use self::loops::Target;
use self::returning::Return;
use super::parameters::Parameters;

/// Interval at which the autopilot decides.
const CONTROL: Duration = Duration::from_millis(20);
/// Place of the origin: the usual one of PX4's simulators, in Zurich.
const ORIGIN: GlobalPosition = GlobalPosition { latitude: 47.397_742, longitude: 8.545_594, altitude: 488.0 };

/// Results of commands (`MAV_RESULT`).
pub(super) mod result {
    pub(crate) const ACCEPTED: u8 = 0;
    pub(crate) const REJECTED: u8 = 1;
    pub(crate) const DENIED: u8 = 2;
    pub(crate) const UNSUPPORTED: u8 = 3;
    pub(crate) const FAILED: u8 = 4;
}

/// A client: the link on which it was heard, and its address there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Peer {
    /// Index of the link.
    pub link: usize,
    /// Address; of no meaning on a serial port.
    pub address: SocketAddr,
}

/// The virtual vehicle's protocol. Sans-IO; see the [module](super).
#[derive(Debug)]
pub struct VirtualVehicle {
    autopilot: Autopilot,
    parameters: Parameters,
    clients: Clients,
    mode: Mode,
    armed: bool,
    /// Since when it has been armed, or on the ground again.
    since: Time,
    /// Where its estimator started, and where it returns to.
    origin: EnuPosition,
    home: EnuPosition,
    /// What another program wants, and when it said so.
    target: Option<(Time, Target)>,
    /// Since when [`Mode`] is that of other programs.
    external_since: Time,
    /// A stop because the other program is silent (ArduPilot).
    stopped_silent: bool,
    goto: Option<(EnuPosition, Option<f64>)>,
    returning: Return,
    /// Height of the take-off, metres above home.
    take_off_height: f64,
    phase: FlightPhase,
    fence: Fence,
    gimbal: Option<Gimbal>,
    /// Whether a low battery, and a breached fence, were noticed.
    noticed: [bool; 2],
    next_control: Time,
    strict_beat: bool,
    /// Whether it has sensors around it.
    ranges: bool,
    /// Channels of its radio, microseconds; `None` without a receiver.
    radio: Option<[u16; 8]>,
    /// Standard deviation of its position, metres, that it tells; `None` with its usual one and satellites.
    blurred: Option<f32>,
    /// The last `OBSTACLE_DISTANCE` of another component.
    told: Option<Box<OBSTACLE_DISTANCE_DATA>>,
    started: Time,
}

impl VirtualVehicle {
    /// A vehicle switched on now, at the craft's time.
    #[must_use]
    pub fn new(autopilot: Autopilot, craft: &SimCraft) -> Self {
        let now = craft.time();
        let origin = craft.telemetry().position.unwrap_or_default();
        Self {
            autopilot,
            parameters: Parameters::of(autopilot),
            clients: Clients::new(autopilot),
            mode: match autopilot {
                Autopilot::Px4 => autopilot.hold(),
                Autopilot::ArduPilot => Mode(autopilot, 0),
            },
            armed: false,
            since: now,
            origin,
            home: origin,
            target: None,
            external_since: now,
            stopped_silent: false,
            goto: None,
            returning: Return::default(),
            take_off_height: 0.0,
            phase: craft.dynamics().phase(),
            fence: Fence::default(),
            gimbal: None,
            noticed: [false; 2],
            next_control: now,
            strict_beat: false,
            ranges: false,
            radio: None,
            blurred: None,
            told: None,
            started: now,
        }
    }

    /// Adds a client, to which it sends from now on. More than 16 are ignored.
    pub fn join(&mut self, now: Time, peer: Peer) {
        self.clients.join(now, peer);
    }

    /// Removes a client.
    pub fn leave(&mut self, peer: Peer) {
        self.clients.leave(peer);
    }

    /// Whether it is armed.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.armed
    }

    /// Sets a parameter, as a ground station would; false if it has none of this name.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> bool {
        self.parameters.set(name, value as f32, spf_mavlink::parameter::REAL32).is_some()
    }

    /// Gives it a receiver, whose radio has its sticks in the middle.
    pub fn carry_receiver(&mut self) {
        self.radio = Some([1500, 1500, 1000, 1500, 1000, 1000, 1000, 1000]);
    }

    /// Its satellites are lost, and from now on it tells this standard deviation of its position, metres. It flies as before.
    pub fn blur(&mut self, metres: f32) {
        self.blurred = Some(metres);
    }

    /// Its estimator is reset: from now on its position is another by this, metres east and north, although it has not moved. Its home
    /// keeps its coordinates, and is therefore elsewhere, too.
    pub fn jump(&mut self, [east, north]: [f64; 2]) {
        for place in [&mut self.origin, &mut self.home] {
            (place.east, place.north) = (place.east - east, place.north - north);
        }
    }

    /// Its pilot changes the mode by the switch of the radio, its fifth channel, if it has a receiver.
    pub fn radio(&mut self, now: Time, mode: Mode, craft: &mut SimCraft) {
        if let Some(channels) = &mut self.radio {
            channels[4] = if channels[4] < 1500 { 2000 } else { 1000 };
        }
        self.enter(now, mode, craft);
    }

    /// When [`advance`](Self::advance) is next needed.
    #[must_use]
    pub fn next_deadline(&self) -> Time {
        self.next_control
    }

    /// Handles a packet of a client; the craft must have been advanced to `now`.
    pub fn handle(&mut self, now: Time, peer: Peer, packet: &Packet, craft: &mut SimCraft) {
        self.join(now, peer);
        if !self.clients.has(peer) {
            return;
        }
        if let Some(command) = packet.command() {
            let [system, component] = command.target;
            // Another component of the vehicle answers for itself, or is not there.
            if matches!(system, 0 | 1) && matches!(component, 0 | 1) {
                let before = self.clients.waiting();
                let result = self.execute(now, peer, &command, craft);
                let to = [packet.system, packet.component];
                // Before whatever it led to: clients wait for one after the other.
                self.clients.send_before(before, peer, spf_mavlink::message::acknowledgement(to, command.id, result));
                if result == result::ACCEPTED && command.id == spf_mavlink::command::ids::ARM {
                    self.tell_state(now, craft);
                }
            }
        } else if packet.id == 0 {
            self.clients.forward(peer, packet);
        } else if let Some(message) = packet.message() {
            self.receive(now, peer, [packet.system, packet.component], &message, craft);
        }
    }

    /// Advances to `now`: flies, and sends what is due.
    pub fn advance(&mut self, now: Time, craft: &mut SimCraft) {
        while self.next_control <= now {
            let at = self.next_control;
            craft.advance_to(at);
            self.control(at, craft);
            if let Some((to, ask)) = self.fence.ask(at) {
                self.clients.send(to, ask);
            }
            self.stream(at, craft);
            self.next_control = at + CONTROL;
        }
        craft.advance_to(now);
    }

    /// The next message of a client to pass on, with the client that it is for, and the system and component that it is of.
    pub fn poll_forwarded(&mut self) -> Option<(Peer, [u8; 2], Body)> {
        self.clients.poll_forwarded()
    }

    /// The next message to send, with its client.
    pub fn poll(&mut self) -> Option<(Peer, Body)> {
        self.clients.poll()
    }

    /// From now on its heartbeat comes once a second only, as that of a real autopilot, and not also at a change of its state.
    pub fn beat_strictly(&mut self) {
        self.strict_beat = true;
    }

    /// From now on it is an old ArduPilot: new clients get nothing but heartbeats, and rates of single messages are unknown to it.
    pub fn grow_old(&mut self) {
        self.clients.grow_old();
    }

    /// Gives it rangefinders ahead, left and right, and a proximity sensor all round.
    pub fn measure_ranges(&mut self) {
        self.ranges = true;
    }

    /// What another component has last told it about obstacles.
    #[must_use]
    pub fn told_obstacles(&self) -> Option<&OBSTACLE_DISTANCE_DATA> {
        self.told.as_deref()
    }
}

fn relative(position: EnuPosition, origin: EnuPosition) -> EnuPosition {
    EnuPosition { east: position.east - origin.east, north: position.north - origin.north, up: position.up - origin.up }
}
