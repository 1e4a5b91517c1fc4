//! The simulated craft's motion: commands with their dead time, flight phases, contacts (`docs/reference/dynamics.md`).
//!
//! Time goes in ticks of 5 ms on an absolute grid, tick `n` lasting from `5n` to `5n + 5` ms of flight time, so that results
//! do not depend on how far the world advances at once. A command takes effect at the first tick that begins its dead time
//! after it was given.

use std::collections::VecDeque;

use spf_core::command::{Command, Setpoint};
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose};
use spf_core::rng::Draw;
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

/// A surface that faces up at least this much (60° of slope) can be stood on.
const STANDABLE: f64 = 0.5;
/// A craft lands by itself at this charge, and does not take off below the other.
const BATTERY_LAND: f64 = 0.05;
const BATTERY_TAKE_OFF: f64 = 0.10;
/// How often a landing looks for the ground below it, ticks.
const GROUND_LOOK: u64 = 20;
/// Commands waiting for their dead time; more than this in flight at once drops the oldest.
const QUEUE: usize = 4096;

/// In what a flight takes place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimConditions {
    /// Seed of gusts, creep and sensor noise.
    pub seed: u64,
    /// True: telemetry without error or rounding (also of a Tello, which then has a position), and no creep. For tests of
    /// what flies the craft.
    pub exact: bool,
    /// The wind.
    pub wind: Wind,
    /// Battery charge at the start, 0..=1.
    pub battery: f64,
    /// True: the flight begins in the air at the start pose; false: on the ground below it, motors off.
    pub hovering: bool,
}

impl SimConditions {
    /// Still air, honest senses, a full battery, on the ground.
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

/// How a craft without motors comes down.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fall {
    /// It flies on as a thrown body.
    Thrown,
    /// It hit something and drops straight down, to this height of its centre.
    Straight { floor: f64 },
    /// It lies.
    Lying,
}

/// The true motion of one craft.
#[derive(Clone, Debug)]
pub struct Dynamics {
    model: Model,
    response: Response,
    body: Body,
    phase: FlightPhase,
    /// Ticks done.
    tick: u64,
    waiting: VecDeque<Waiting>,
    /// What is held, and until when.
    setpoint: Option<(Setpoint, Time)>,
    dead_time: Duration,
    /// Where the last take-off began (for a craft that begins in the air: the ground below it).
    launch: EnuPosition,
    spin_up_left: u64,
    /// Height of the centre when standing on what is below, as a landing last saw it; none where nothing is below.
    landing_floor: Option<f64>,
    fall: Fall,
    crashed: bool,
    contacts: Vec<(Time, ObjectId)>,
    path_length: f64,
    battery: f64,
    air: Air,
    creep: [Wander; 2],
    /// A place and the free distance around it: no need to look for contacts until the body may have left it.
    free: (EnuPosition, f64),
}

impl Dynamics {
    /// A craft at rest. On the ground, `start` is lowered (or lifted) to stand on the surface below its position, level;
    /// where nothing is below, the craft stands at `start` as on invisible ground.
    #[must_use]
    pub fn new(collider: &Collider, model: Model, start: Pose, conditions: SimConditions) -> Self {
        let radius = model.craft.radius;
        // A start given as a point of the ground lies a rounding error below it as often as not.
        let above = EnuPosition { up: start.position.up + radius, ..start.position };
        let ground = collider.ground_below(above).map(|ground| EnuPosition { up: ground.up + radius, ..start.position });
        let launch = ground.unwrap_or(start.position);
        let attitude = Attitude { pitch: 0.0, roll: 0.0, ..start.attitude };
        let position = if conditions.hovering { start.position } else { launch };
        let creep = |key| {
            let sigma = if conditions.exact { 0.0 } else { model.creep };
            Wander::new(sigma, 5.0, STEP, Draw::new(conditions.seed, "creep", &[key]))
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

    /// Takes a command given at `now`. A setpoint holds until `valid_until`, then the craft holds still; both reach its
    /// motion the dead time later. An emergency stop has no dead time. What does not fit the phase when it takes effect is
    /// ignored, as real craft do: setpoints on the ground and during take-off and landing, take-off in the air, with less
    /// than a tenth of the battery or after the motors were cut.
    pub fn apply(&mut self, now: Time, command: Command, valid_until: Time) {
        let delay = if command == Command::EmergencyStop { Duration::ZERO } else { self.dead_time };
        let from_tick = (now + delay).as_nanos().div_ceil(TICK_NANOS).max(self.tick);
        if self.waiting.len() == QUEUE {
            self.waiting.pop_front();
        }
        // Kept in order of effect. An emergency stop annuls what was given earlier and has not reached the motors yet.
        let place = self.waiting.partition_point(|other| other.from_tick <= from_tick);
        if command == Command::EmergencyStop {
            self.waiting.truncate(place);
        }
        self.waiting.insert(place, Waiting { from_tick, command, expires: valid_until + self.dead_time });
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
            // No craft of the simulator flies manoeuvres by itself; the virtual Tello flies its own by setpoints.
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

    /// Height of the centre when standing on what is straight below; none where nothing is.
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

    /// What the body is to follow during this tick.
    fn wanted(&mut self, now: Time, collider: &Collider) -> Setpoint {
        match self.phase {
            FlightPhase::TakingOff => {
                // A position loop at a quarter of the velocity loop's bandwidth comes to rest without overshoot.
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

    /// The first contact on the way from `before`, looked for only where something may be near.
    fn contact(&mut self, collider: &Collider, before: EnuPosition) -> Option<Contact> {
        let (radius, to) = (self.model.craft.radius, self.body.position);
        let (centre, distance) = self.free;
        // The millimetre makes up for single precision in the geometry.
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
            // The ground that the craft is leaving.
            FlightPhase::TakingOff if contact.upward >= STANDABLE => {}
            _ => self.crash(collider, now, contact.object, contact.centre),
        }
    }

    /// Something that moves was hit during the last tick, with the body's centre at `centre`. In flight that is a collision.
    pub(crate) fn strike(&mut self, collider: &Collider, object: ObjectId, centre: EnuPosition) {
        if self.airborne() {
            self.crash(collider, self.time(), object, centre);
        }
    }

    /// Whether it flies with motors.
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
            // Solid ground ends the landing by contact; where there is none, the take-off level does.
            FlightPhase::Landing if self.landing_floor.is_none() && body.position.up <= self.launch.up => {
                body.rest();
                self.phase = FlightPhase::OnGround;
            }
            _ => {}
        }
    }

    /// Motors off, in the air or lying. Contacts of a fall are not collisions of the flight and are not counted.
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

    /// The instant up to which the motion is known.
    #[must_use]
    pub fn time(&self) -> Time {
        Time::from_nanos(self.tick * TICK_NANOS)
    }

    /// Ticks done.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// The model that flies.
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

    /// Whether it flies.
    #[must_use]
    pub fn phase(&self) -> FlightPhase {
        self.phase
    }

    /// True height above the place of the last take-off, metres.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.body.position.up - self.launch.up
    }

    /// True once it hit something in flight.
    #[must_use]
    pub fn crashed(&self) -> bool {
        self.crashed
    }

    /// What was hit in flight, and when. The first hit cuts the motors, so there is at most one.
    #[must_use]
    pub fn contacts(&self) -> &[(Time, ObjectId)] {
        &self.contacts
    }

    /// Length of the way flown with motors, metres.
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
