//! A craft model for tests: dead time, first-order lag, acceleration limits, and thrust against drag, integrated in 1
//! ms steps in still air. It is independent of the executor's response model (which has no drag), so that each checks
//! the other. The telemetry errors are those of the simulator's two models.

use crate::estimator::{MotionEstimator, TelemetryAccuracy};
use crate::executor::Executor;
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::geometry::{Attitude, BodyDisplacement, EnuPosition, EnuVelocity, Pose, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::rng::RandomStream;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};

const STEP: Duration = Duration::from_millis(1);

/// The true motion of the craft.
pub struct CraftModel {
    /// The craft whose response it has.
    pub craft: Craft,
    /// Time up to which it has flown.
    pub now: Time,
    /// World position, metres.
    pub position: EnuPosition,
    /// World velocity, m/s.
    pub velocity: EnuVelocity,
    /// Not wrapped.
    pub heading: f64,
    /// Radians per second, clockwise positive.
    pub yaw_rate: f64,
    /// Drag per speed, 1/s, and the acceleration at maximum tilt, m/s².
    drag: f64,
    thrust: f64,
    /// Unmeasured drift, m/s.
    pub creep: [f64; 2],
    sent: Vec<(Time, Setpoint)>,
    arrived: usize,
}

impl CraftModel {
    /// At rest at the origin, heading north.
    pub fn new(craft: Craft) -> Self {
        let position = EnuPosition { east: 12.0, north: -7.0, up: 3.0 };
        let start = Time::from_millis(5000);
        // A Tello tilts by at most 9°, which sustains 4 m/s; the quad by 30°.
        let (drag, thrust) = if craft.acceleration < 2.0 { (0.388, 1.553) } else { (0.3, 5.66) };
        Self {
            craft,
            now: start,
            position,
            velocity: EnuVelocity::default(),
            heading: 2.9,
            yaw_rate: 0.0,
            drag,
            thrust,
            creep: [0.0; 2],
            sent: vec![(Time::ZERO, Setpoint::HOLD)],
            arrived: 0,
        }
    }

    /// Sends a setpoint, which takes effect after the dead time.
    pub fn send(&mut self, setpoint: Setpoint) {
        self.sent.push((self.now, setpoint));
    }

    /// Flies on up to this time.
    pub fn fly_until(&mut self, time: Time) {
        while self.now < time {
            let delay = Duration::from_nanos((self.craft.dead_time * 1e9) as u64);
            while self.sent.get(self.arrived + 1).is_some_and(|&(sent, _)| sent + delay <= self.now) {
                self.arrived += 1;
            }
            let setpoint = self.sent[self.arrived].1;
            let step = time.since(self.now).min(STEP).as_secs_f64();
            let c = &self.craft;
            self.yaw_rate += ((setpoint.yaw_rate - self.yaw_rate) / c.lag).clamp(-c.yaw_acceleration, c.yaw_acceleration) * step;
            self.heading += self.yaw_rate * step;
            let (sin, cos) = self.heading.sin_cos();
            let limited = |(x, y): (f64, f64), limit: f64| {
                let fraction = (limit / x.hypot(y).max(1e-12)).min(1.0);
                (x * fraction, y * fraction)
            };
            let v = self.velocity;
            let wanted_east = setpoint.right * cos + setpoint.forward * sin + self.creep[0];
            let wanted_north = setpoint.forward * cos - setpoint.right * sin + self.creep[1];
            let requested = limited(((wanted_east - v.east) / c.lag, (wanted_north - v.north) / c.lag), c.acceleration);
            let thrust = limited((requested.0 + self.drag * v.east, requested.1 + self.drag * v.north), self.thrust);
            let (east, north) = (thrust.0 - self.drag * v.east, thrust.1 - self.drag * v.north);
            self.velocity.east += east * step;
            self.velocity.north += north * step;
            self.velocity.up +=
                ((setpoint.up - self.velocity.up) / c.lag).clamp(-c.climb_acceleration, c.climb_acceleration) * step;
            self.position.east += self.velocity.east * step;
            self.position.north += self.velocity.north * step;
            self.position.up += self.velocity.up * step;
            self.now += STEP.min(time.since(self.now));
        }
    }

    /// The exact state.
    pub fn known(&self) -> MotionEstimate {
        MotionEstimate {
            position: self.position,
            velocity: self.velocity,
            attitude: Attitude { heading: wrap_angle(self.heading), pitch: 0.0, roll: 0.0 },
            yaw_rate: self.yaw_rate,
        }
    }

    /// Tello telemetry: whole degrees, dm/s, 10 cm, no position, no yaw rate; otherwise exact.
    pub fn tello_telemetry(&self) -> Telemetry {
        let tenth = |x: f64| (x * 10.0).round() / 10.0;
        let v = self.velocity;
        Telemetry {
            time: self.now,
            velocity: Some(EnuVelocity { east: tenth(v.east), north: tenth(v.north), up: tenth(v.up) }),
            attitude: Attitude { heading: wrap_angle(self.heading).to_degrees().round().to_radians(), ..Attitude::default() },
            height: Some(tenth(self.position.up)),
            phase: FlightPhase::Flying,
            ..Telemetry::default()
        }
    }

    /// Position and heading.
    pub fn pose(&self) -> Pose {
        Pose { position: self.position, attitude: self.known().attitude }
    }
}

/// The executor's input from the craft.
pub trait Sense {
    /// Called every 10 ms of flight.
    fn look(&mut self, craft: &mut CraftModel);
    /// The current estimate.
    fn known(&mut self, craft: &CraftModel) -> MotionEstimate;
}

/// Exact knowledge.
pub struct Exact;

impl Sense for Exact {
    fn look(&mut self, _: &mut CraftModel) {}
    fn known(&mut self, craft: &CraftModel) -> MotionEstimate {
        craft.known()
    }
}

/// A drifting error: an Ornstein-Uhlenbeck process.
struct Wander {
    spread: f64,
    time: f64,
    value: f64,
}

impl Wander {
    fn new(spread: f64, time: f64, noise: &mut RandomStream) -> Self {
        Self { spread, time, value: spread * noise.normal() }
    }

    fn advance(&mut self, step: f64, noise: &mut RandomStream) -> f64 {
        let keep = (-step / self.time).exp();
        self.value = self.value * keep + self.spread * (1.0 - keep * keep).sqrt() * noise.normal();
        self.value
    }
}

/// Telemetry of one of the two models, through the estimator. Reports are measured between ticks and arrive 20 ms
/// later.
pub struct Coarse {
    /// The estimator that reads it.
    pub estimator: MotionEstimator,
    quad: bool,
    noise: RandomStream,
    position: [Wander; 3],
    heading: Wander,
    creep: [Wander; 2],
    applied: usize,
    waiting: Option<Telemetry>,
}

impl Coarse {
    /// Velocity to 0.03 m/s, then rounded to dm/s; heading drifts by 2° over 60 s, height by 5 cm over 20 s; the craft
    /// creeps at 2 cm/s, in another direction every 5 s.
    pub fn tello(craft: &Craft, seed: u64) -> Self {
        Self::new(MotionEstimator::new(craft, TelemetryAccuracy::tello()), false, seed)
    }

    /// Position drifts by 0.3 m and heading by 1° over 30 s; velocity to 0.05 m/s, yaw rate to 0.5 °/s.
    pub fn quad(craft: &Craft, seed: u64) -> Self {
        Self::new(MotionEstimator::new(craft, TelemetryAccuracy::quad()), true, seed)
    }

    fn new(estimator: MotionEstimator, quad: bool, seed: u64) -> Self {
        let mut noise = RandomStream::new(seed, "senses", &[]);
        let rng = &mut noise;
        let (place, place_time) = if quad { (0.3, 30.0) } else { (0.05, 20.0) };
        let (turn, turn_time) = if quad { (1.0_f64, 30.0) } else { (2.0, 60.0) };
        let position = [(); 3].map(|()| Wander::new(place, place_time, rng));
        let heading = Wander::new(turn.to_radians(), turn_time, rng);
        let creep = [(); 2].map(|()| Wander::new(if quad { 0.0 } else { 0.02 }, 5.0, rng));
        Self { estimator, quad, noise, position, heading, creep, applied: 0, waiting: None }
    }

    fn report(&mut self, craft: &CraftModel, step: f64) -> Telemetry {
        let draw = &mut self.noise;
        let white = if self.quad { 0.05 } else { 0.03 };
        let v = craft.velocity;
        let [east, north, up] = [v.east, v.north, v.up].map(|v| v + white * draw.normal());
        let wander = [0, 1, 2].map(|i: usize| self.position[i].advance(step, draw));
        let heading = wrap_angle(craft.heading + self.heading.advance(step, draw));
        let rounded = |x: f64, unit: f64| (x / unit).round() * unit;
        let p = craft.position;
        if self.quad {
            return Telemetry {
                time: craft.now,
                position: Some(EnuPosition { east: p.east + wander[0], north: p.north + wander[1], up: p.up + wander[2] }),
                velocity: Some(EnuVelocity { east, north, up }),
                attitude: Attitude { heading, ..Attitude::default() },
                yaw_rate: Some(craft.yaw_rate + 0.5_f64.to_radians() * draw.normal()),
                height: Some(p.up + wander[2]),
                phase: FlightPhase::Flying,
                ..Telemetry::default()
            };
        }
        Telemetry {
            time: craft.now,
            velocity: Some(EnuVelocity { east: rounded(east, 0.1), north: rounded(north, 0.1), up: rounded(up, 0.1) }),
            attitude: Attitude { heading: rounded(heading, 1.0_f64.to_radians()), ..Attitude::default() },
            height: Some(rounded(p.up + wander[2], 0.1)),
            phase: FlightPhase::Flying,
            ..Telemetry::default()
        }
    }
}

impl Sense for Coarse {
    fn look(&mut self, craft: &mut CraftModel) {
        for &(time, setpoint) in &craft.sent[self.applied..] {
            self.estimator.commanded(time, setpoint);
        }
        self.applied = craft.sent.len();
        // 10 Hz (Tello) or 20 Hz, 30 ms after the tick.
        let millis = craft.now.as_nanos() / 1_000_000;
        let every = if self.quad { 50 } else { 100 };
        if millis % every == 50 % every
            && let Some(telemetry) = self.waiting.take()
        {
            self.estimator.observe(&telemetry);
        }
        if millis % every == 30 {
            let step = every as f64 * 1e-3;
            craft.creep = [0, 1].map(|i: usize| self.creep[i].advance(step, &mut self.noise));
            self.waiting = Some(self.report(craft, step));
        }
    }

    fn known(&mut self, craft: &CraftModel) -> MotionEstimate {
        self.estimator.at(craft.now).unwrap_or_else(|| craft.known())
    }
}

/// Result of one flown motion.
#[derive(Clone, Copy, Debug)]
pub struct Flown {
    /// At rest, in the level frame of the start.
    pub displacement: BodyDisplacement,
    /// Turned, radians, clockwise positive.
    pub turned: f64,
    /// When `finished` was reported: a craft that creeps never rests.
    pub displacement_at_end: BodyDisplacement,
    /// Seconds from the start to `finished`.
    pub seconds: f64,
    /// True speed, and distance from the later rest position, at `finished`, m/s and m.
    pub speed_at_end: f64,
    /// Flown after the end of the last primitive, metres.
    pub coasted: f64,
    /// Whether the motion had to be given up.
    pub timed_out: bool,
}

/// Lets the craft hold for `time` while it is observed.
pub fn pass(craft: &mut CraftModel, time: Duration, sense: &mut impl Sense) {
    let until = craft.now + time;
    while craft.now < until {
        // Steps end on multiples of 10 ms, so that reports arrive at their times whatever the tick.
        let next = Time::from_millis((craft.now.as_nanos() / 10_000_000 + 1) * 10);
        craft.fly_until(next.min(until));
        if craft.now == next {
            sense.look(craft);
        }
    }
}

/// Ticks the executor until it has finished and the craft is at rest.
pub fn fly(executor: &mut Executor, craft: &mut CraftModel, period: Duration, sense: &mut impl Sense) -> Flown {
    let (start, heading, began) = (craft.position, craft.heading, craft.now);
    loop {
        let tick = executor.tick(craft.now, sense.known(craft));
        craft.send(tick.setpoint);
        if tick.finished {
            break;
        }
        assert!(craft.now.since(began) < Duration::from_secs(200), "never finishes");
        pass(craft, period, sense);
    }
    let seconds = craft.now.since(began).as_secs_f64();
    let (speed_at_end, end) = (craft.velocity.speed(), craft.position);
    pass(craft, Duration::from_secs(4), sense);
    Flown {
        displacement: start.displacement_to(craft.position, heading),
        turned: craft.heading - heading,
        displacement_at_end: start.displacement_to(end, heading),
        seconds,
        speed_at_end,
        coasted: end.distance(craft.position),
        timed_out: executor.timed_out(),
    }
}
