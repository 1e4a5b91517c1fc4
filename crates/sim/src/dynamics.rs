//! The simulated craft's motion: commands with their dead time, flight phases, contacts (`docs/reference/dynamics.md`).
//!
//! Time advances in ticks of 5 ms on an absolute grid (tick `n` lasts from `5n` to `5n + 5` ms of flight time), so
//! results do not depend on the size of each advance. A command takes effect at the first tick that starts at least the
//! dead time after it was given.

use std::collections::VecDeque;

use spf_core::command::{Command, Setpoint};
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose};
use spf_core::rng::RandomStream;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_scene::collide::{Collider, Contact};
use spf_scene::geometry::ObjectId;

use crate::body::{Body, Response};
use crate::model::Model;
use crate::noise::Wander;
use crate::wind::{Air, Wind};

/// Length of a tick.
pub const TICK: Duration = Duration::from_millis(5);
const TICK_NANOS: u64 = 5_000_000;
const STEP: f64 = 0.005;

/// Minimum upward component of the normal of a surface that can be stood on (60° of slope).
const STANDABLE: f64 = 0.5;
/// Charge at which a craft lands by itself, and below which it does not take off.
const BATTERY_LAND: f64 = 0.05;
const BATTERY_TAKE_OFF: f64 = 0.10;
/// Interval at which a landing looks for the ground below, ticks.
const GROUND_LOOK: u64 = 20;
/// Maximum number of commands waiting for their dead time; beyond it the oldest is dropped.
const QUEUE: usize = 4096;

/// Conditions of a simulated flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimConditions {
    /// Seed of gusts, hover drift and sensor noise.
    pub seed: u64,
    /// True for telemetry without error or rounding (for a Tello also with a position), and no drift. For tests of the
    /// controller.
    pub exact: bool,
    /// The wind.
    pub wind: Wind,
    /// Battery charge at the start, 0..=1.
    pub battery: f64,
    /// True to start in the air at the start pose; false to start on the ground below it, motors off.
    pub hovering: bool,
}

impl SimConditions {
    /// Conditions with still air, realistic telemetry, a full battery and a start on the ground.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { seed, exact: false, wind: Wind::default(), battery: 1.0, hovering: false }
    }
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    from_tick: u64,
    command: Command,
    expires: Time,
}

/// How a craft without motors falls.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fall {
    /// Ballistic flight.
    Thrown,
    /// It hit something and drops straight down, until its centre is at this height.
    Straight { floor: f64 },
    /// On the ground.
    Lying,
}

/// The true motion of one craft.
#[derive(Clone, Debug)]
pub struct Dynamics {
    model: Model,
    response: Response,
    body: Body,
    phase: FlightPhase,
    /// Number of ticks so far.
    tick: u64,
    waiting: VecDeque<Waiting>,
    /// The current setpoint and its expiry.
    setpoint: Option<(Setpoint, Time)>,
    dead_time: Duration,
    /// Start of the last take-off (for a craft that starts in the air: the ground below it).
    launch: EnuPosition,
    spin_up_left: u64,
    /// Height of the centre when standing on the surface below, as last seen by a landing; `None` if nothing is below.
    landing_floor: Option<f64>,
    fall: Fall,
    crashed: bool,
    contacts: Vec<(Time, ObjectId)>,
    path_length: f64,
    battery: f64,
    air: Air,
    creep: [Wander; 2],
    /// A position and the free distance around it: contacts need no check until the body may have left it.
    free: (EnuPosition, f64),
}

impl Dynamics {
    /// A craft at rest. On the ground, `start` is moved vertically to stand level on the surface below its position;
    /// where nothing is below, the craft stands at `start` as if on invisible ground.
    #[must_use]
    pub fn new(collider: &Collider, model: Model, start: Pose, conditions: SimConditions) -> Self {
        let radius = model.craft.radius;
        // A start position on the ground may be a rounding error below it.
        let above = EnuPosition { up: start.position.up + radius, ..start.position };
        let ground = collider.ground_below(above).map(|ground| EnuPosition { up: ground.up + radius, ..start.position });
        let launch = ground.unwrap_or(start.position);
        let attitude = Attitude { pitch: 0.0, roll: 0.0, ..start.attitude };
        let position = if conditions.hovering { start.position } else { launch };
        let creep = |key| {
            let sigma = if conditions.exact { 0.0 } else { model.creep };
            Wander::new(sigma, 5.0, STEP, RandomStream::new(conditions.seed, "creep", &[key]))
        };
        Self {
            model,
            response: Response::new(&model, STEP),
            body: Body { position, attitude, ..Body::default() },
            phase: if conditions.hovering { FlightPhase::Flying } else { FlightPhase::OnGround },
            tick: 0,
            waiting: VecDeque::new(),
            setpoint: None,
            dead_time: duration_from_secs(model.craft.dead_time),
            launch,
            spin_up_left: 0,
            landing_floor: None,
            fall: Fall::Lying,
            crashed: false,
            contacts: Vec::new(),
            path_length: 0.0,
            battery: conditions.battery.clamp(0.0, 1.0),
            air: Air::new(conditions.wind, conditions.seed, STEP),
            creep: [creep(0), creep(1)],
            free: (position, f64::NEG_INFINITY),
        }
    }

    /// Takes a command given at `now`. A setpoint holds until `valid_until`, then the craft holds; both take effect
    /// after the dead time. An emergency stop has no dead time. Commands that do not fit the phase at that time are
    /// ignored, as by real craft: setpoints on the ground and during take-off and landing; take-off in the air, with
    /// less than a tenth of the battery, or after the motors were cut.
    pub fn apply(&mut self, now: Time, command: Command, valid_until: Time) {
        let delay = if command == Command::EmergencyStop { Duration::ZERO } else { self.dead_time };
        let from_tick = (now + delay).as_nanos().div_ceil(TICK_NANOS).max(self.tick);
        if self.waiting.len() == QUEUE {
            self.waiting.pop_front();
        }
        // In order of effect. An emergency stop cancels earlier commands that have not taken effect yet.
        let place = self.waiting.partition_point(|other| other.from_tick <= from_tick);
        if command == Command::EmergencyStop {
            self.waiting.truncate(place);
        }
        self.waiting.insert(place, Waiting { from_tick, command, expires: valid_until + self.dead_time });
    }

    /// Sets the height of later take-offs, metres above the take-off point.
    pub fn set_take_off_height(&mut self, height: f64) {
        self.model.craft.take_off_height = height;
    }

    /// Changes the steady wind, from the next tick on; gusts stay.
    pub fn set_wind(&mut self, east: f64, north: f64) {
        self.air.set_steady(east, north);
    }

    /// Puts the craft somewhere else between two ticks, as simulators do on request: it hovers there with this velocity, or, not
    /// `hovering`, stands there with its motors off. A crash is undone, commands that wait and earlier contacts are forgotten.
    pub fn place(&mut self, pose: Pose, velocity: EnuVelocity, hovering: bool) {
        self.body = Body { position: pose.position, velocity, attitude: pose.attitude, ..Body::default() };
        self.phase = if hovering { FlightPhase::Flying } else { FlightPhase::OnGround };
        self.waiting.clear();
        self.contacts.clear();
        (self.setpoint, self.crashed, self.fall) = (None, false, Fall::Lying);
        self.free = (pose.position, f64::NEG_INFINITY);
    }

    /// One tick.
    pub fn step(&mut self, collider: &Collider) {
        let now = self.time();
        while self.waiting.front().is_some_and(|next| next.from_tick <= self.tick) {
            if let Some(next) = self.waiting.pop_front() {
                self.obey(next, collider);
            }
        }
        self.drain(collider);
        let air = self.air.advance();
        let creep = (self.creep[0].advance(), self.creep[1].advance());
        let before = self.body.position;
        match self.phase {
            FlightPhase::OnGround => {}
            FlightPhase::Stopped => self.come_down(collider, air),
            FlightPhase::TakingOff if self.spin_up_left > 0 => self.spin_up_left -= 1,
            // No simulated craft flies manoeuvres by itself; the virtual Tello flies its own by setpoints.
            FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Manoeuvring | FlightPhase::Landing => {
                let setpoint = self.wanted(now, collider);
                self.body.follow(&self.model, &self.response, setpoint, air, creep);
                self.touch(collider, before, now + TICK);
                self.path_length += before.distance(self.body.position);
                self.next_phase();
            }
        }
        self.tick += 1;
    }

    fn obey(&mut self, order: Waiting, collider: &Collider) {
        match (order.command, self.phase) {
            (Command::TakeOff, FlightPhase::OnGround) if self.battery >= BATTERY_TAKE_OFF => {
                self.launch = self.body.position;
                self.spin_up_left = duration_from_secs(self.model.spin_up).as_nanos() as u64 / TICK_NANOS;
                self.phase = FlightPhase::TakingOff;
            }
            (Command::Setpoint(setpoint), FlightPhase::Flying) => {
                let setpoint = if setpoint.is_finite() { setpoint } else { Setpoint::HOLD };
                self.setpoint = Some((setpoint, order.expires));
            }
            // A hold, and nothing else, interrupts a landing.
            (Command::Setpoint(setpoint), FlightPhase::Landing) if setpoint.is_hold() => {
                self.setpoint = None;
                self.phase = FlightPhase::Flying;
            }
            (Command::Land, FlightPhase::TakingOff | FlightPhase::Flying) => self.begin_landing(collider),
            (Command::EmergencyStop, FlightPhase::OnGround) => {}
            (Command::EmergencyStop, FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Landing) => {
                self.setpoint = None;
                self.phase = FlightPhase::Stopped;
                self.fall = Fall::Thrown;
            }
            _ => {}
        }
    }

    fn begin_landing(&mut self, collider: &Collider) {
        self.setpoint = None;
        self.phase = FlightPhase::Landing;
        self.landing_floor = self.floor_below(collider);
    }

    /// Height of the centre when standing on the surface straight below; `None` if there is none.
    fn floor_below(&self, collider: &Collider) -> Option<f64> {
        Some(collider.ground_below(self.body.position)?.up + self.model.craft.radius)
    }

    fn drain(&mut self, collider: &Collider) {
        let rate = if self.airborne() { self.model.drain_flying } else { self.model.drain_idle };
        self.battery = (self.battery - rate * STEP).max(0.0);
        if self.battery <= BATTERY_LAND && matches!(self.phase, FlightPhase::TakingOff | FlightPhase::Flying) {
            self.begin_landing(collider);
        }
    }

    /// The setpoint that the body follows during this tick.
    fn wanted(&mut self, now: Time, collider: &Collider) -> Setpoint {
        match self.phase {
            FlightPhase::TakingOff => {
                // A position loop at a quarter of the velocity loop's bandwidth settles without overshoot.
                let missing = self.launch.up + self.model.craft.take_off_height - self.body.position.up;
                let up = (missing / (4.0 * self.model.craft.lag)).clamp(-self.model.take_off_speed, self.model.take_off_speed);
                Setpoint { up, ..Setpoint::HOLD }
            }
            FlightPhase::Landing => {
                if self.tick.is_multiple_of(GROUND_LOOK) {
                    self.landing_floor = self.floor_below(collider);
                }
                let height = self.body.position.up - self.landing_floor.unwrap_or(self.launch.up);
                Setpoint { up: -height.clamp(self.model.touch_down_speed, self.model.landing_speed), ..Setpoint::HOLD }
            }
            _ => match self.setpoint {
                Some((setpoint, expires)) if now < expires => setpoint,
                _ => Setpoint::HOLD,
            },
        }
    }

    /// The first contact on the path from `before`; checked only where something may be near.
    fn contact(&mut self, collider: &Collider, before: EnuPosition) -> Option<Contact> {
        let (radius, to) = (self.model.craft.radius, self.body.position);
        let (centre, distance) = self.free;
        // The millimetre compensates for single precision in the geometry.
        if centre.distance(to) + radius + 1e-3 < distance && centre.distance(before) + radius + 1e-3 < distance {
            return None;
        }
        let contact = collider.sweep(before, to, radius);
        if contact.is_none() {
            self.free = (to, collider.nearest(to).map_or(f64::INFINITY, |near| near.distance));
        }
        contact
    }

    fn touch(&mut self, collider: &Collider, before: EnuPosition, now: Time) {
        let Some(contact) = self.contact(collider, before) else { return };
        match self.phase {
            FlightPhase::Landing if contact.upward >= STANDABLE => {
                self.body.position = contact.centre;
                self.body.rest();
                self.phase = FlightPhase::OnGround;
            }
            // The ground that the craft is taking off from.
            FlightPhase::TakingOff if contact.upward >= STANDABLE => {}
            _ => self.crash(collider, now, contact.object, contact.centre),
        }
    }

    /// A moving object was hit during the last tick, with the body's centre at `centre`. In flight this is a collision.
    pub(crate) fn strike(&mut self, collider: &Collider, object: ObjectId, centre: EnuPosition) {
        if self.airborne() {
            self.crash(collider, self.time(), object, centre);
        }
    }

    /// Whether it flies with motors on.
    #[must_use]
    pub fn airborne(&self) -> bool {
        matches!(self.phase, FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Landing)
    }

    fn crash(&mut self, collider: &Collider, now: Time, object: ObjectId, centre: EnuPosition) {
        self.contacts.push((now, object));
        self.crashed = true;
        self.phase = FlightPhase::Stopped;
        self.setpoint = None;
        self.drop_from(collider, centre);
    }

    fn drop_from(&mut self, collider: &Collider, centre: EnuPosition) {
        self.body.position = centre;
        self.body.stop();
        self.fall = Fall::Straight { floor: self.floor_below(collider).unwrap_or(self.launch.up).min(centre.up) };
    }

    fn next_phase(&mut self) {
        let body = &mut self.body;
        match self.phase {
            FlightPhase::TakingOff => {
                let missing = self.launch.up + self.model.craft.take_off_height - body.position.up;
                if missing.abs() < 0.03 && body.velocity.up.abs() < 0.05 {
                    self.phase = FlightPhase::Flying;
                }
            }
            // Solid ground ends the landing by contact; without ground, the take-off height does.
            FlightPhase::Landing if self.landing_floor.is_none() && body.position.up <= self.launch.up => {
                body.rest();
                self.phase = FlightPhase::OnGround;
            }
            _ => {}
        }
    }

    /// Motors off, falling or lying. Contacts during a fall are not counted as collisions.
    fn come_down(&mut self, collider: &Collider, air: EnuVelocity) {
        let before = self.body.position;
        match self.fall {
            Fall::Lying => {}
            Fall::Straight { floor } => {
                self.body.fall(&self.model, &self.response, EnuVelocity::default());
                if self.body.position.up <= floor {
                    self.body.position.up = floor;
                    self.body.stop();
                    self.fall = Fall::Lying;
                }
            }
            Fall::Thrown => {
                self.body.fall(&self.model, &self.response, air);
                if let Some(contact) = self.contact(collider, before) {
                    self.drop_from(collider, contact.centre);
                } else if self.body.position.up <= self.launch.up && collider.ground_below(before).is_none() {
                    self.body.stop();
                    self.fall = Fall::Lying;
                }
            }
        }
    }

    /// The time up to which the motion was computed.
    #[must_use]
    pub fn time(&self) -> Time {
        Time::from_nanos(self.tick * TICK_NANOS)
    }

    /// Number of ticks so far.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// The craft model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// True pose of the body's centre.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.body.pose()
    }

    /// True velocity.
    #[must_use]
    pub fn velocity(&self) -> EnuVelocity {
        self.body.velocity
    }

    /// True yaw rate, rad/s, clockwise positive.
    #[must_use]
    pub fn yaw_rate(&self) -> f64 {
        self.body.yaw_rate
    }

    /// Flight phase.
    #[must_use]
    pub fn phase(&self) -> FlightPhase {
        self.phase
    }

    /// True height above the last take-off point, metres.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.body.position.up - self.launch.up
    }

    /// True once it has hit something in flight.
    #[must_use]
    pub fn crashed(&self) -> bool {
        self.crashed
    }

    /// Objects hit in flight, with times. The first hit cuts the motors, so there is at most one.
    #[must_use]
    pub fn contacts(&self) -> &[(Time, ObjectId)] {
        &self.contacts
    }

    /// Length of the path flown with motors on, metres.
    #[must_use]
    pub fn path_length(&self) -> f64 {
        self.path_length
    }

    /// Battery charge, 0..=1.
    #[must_use]
    pub fn battery(&self) -> f64 {
        self.battery
    }
}
