//! A craft for tests: dead time, first-order lag and acceleration limits, integrated in steps of 1 ms, in still air. Written
//! apart from the response that the executor looks ahead with, so that one checks the other.

use crate::command::Setpoint;
use crate::craft::Craft;
use crate::estimator::{Known, MotionEstimator, Senses};
use crate::executor::Executor;
use crate::geometry::{Attitude, BodyDisplacement, EnuPosition, EnuVelocity, Pose, wrap_angle};
use crate::rng::Draw;
use crate::telemetry::{FlightPhase, Telemetry};
use crate::time::{Duration, Time};

const STEP: Duration = Duration::from_millis(1);

/// The craft as it truly moves.
pub(crate) struct CraftModel {
    pub(crate) craft: Craft,
    pub(crate) now: Time,
    pub(crate) position: EnuPosition,
    pub(crate) velocity: EnuVelocity,
    /// Not wrapped.
    pub(crate) heading: f64,
    pub(crate) yaw_rate: f64,
    sent: Vec<(Time, Setpoint)>,
    arrived: usize,
}

impl CraftModel {
    pub(crate) fn new(craft: Craft) -> Self {
        let position = EnuPosition { east: 12.0, north: -7.0, up: 3.0 };
        let start = Time::from_millis(5000);
        Self {
            craft,
            now: start,
            position,
            velocity: EnuVelocity::default(),
            heading: 2.9,
            yaw_rate: 0.0,
            sent: vec![(Time::ZERO, Setpoint::HOLD)],
            arrived: 0,
        }
    }

    pub(crate) fn send(&mut self, setpoint: Setpoint) {
        self.sent.push((self.now, setpoint));
    }

    pub(crate) fn fly_until(&mut self, time: Time) {
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
            let wanted_east = setpoint.right * cos + setpoint.forward * sin;
            let wanted_north = setpoint.forward * cos - setpoint.right * sin;
            let (mut east, mut north) =
                ((wanted_east - self.velocity.east) / c.lag, (wanted_north - self.velocity.north) / c.lag);
            let share = (c.acceleration / east.hypot(north).max(1e-12)).min(1.0);
            (east, north) = (east * share, north * share);
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

    /// Exactly what is so.
    pub(crate) fn known(&self) -> Known {
        Known {
            position: self.position,
            velocity: self.velocity,
            attitude: Attitude { heading: wrap_angle(self.heading), pitch: 0.0, roll: 0.0 },
            yaw_rate: self.yaw_rate,
        }
    }

    /// What a Tello tells of it: whole degrees, dm/s, 10 cm, no position, no yaw rate.
    pub(crate) fn tello_telemetry(&self) -> Telemetry {
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

    /// What a quadrotor with satellite navigation tells: `wander` is the slow error of its position.
    pub(crate) fn quad_telemetry(&self, wander: [f64; 3], noise: &mut Draw) -> Telemetry {
        let (p, v) = (self.position, self.velocity);
        let mut velocity_noise = || 0.05 * noise.normal();
        let velocity =
            EnuVelocity { east: v.east + velocity_noise(), north: v.north + velocity_noise(), up: v.up + velocity_noise() };
        let heading = wrap_angle(self.heading + 1.0_f64.to_radians() * noise.normal());
        Telemetry {
            time: self.now,
            position: Some(EnuPosition { east: p.east + wander[0], north: p.north + wander[1], up: p.up + wander[2] }),
            velocity: Some(velocity),
            attitude: Attitude { heading, ..Attitude::default() },
            yaw_rate: Some(self.yaw_rate),
            height: Some(p.up),
            phase: FlightPhase::Flying,
            ..Telemetry::default()
        }
    }

    pub(crate) fn pose(&self) -> Pose {
        Pose { position: self.position, attitude: self.known().attitude }
    }
}

/// What the executor is told of the craft.
pub(crate) trait Sense {
    /// Called every 10 ms of flight.
    fn look(&mut self, craft: &CraftModel);
    /// What is known now.
    fn known(&mut self, craft: &CraftModel) -> Known;
}

/// Everything exactly.
pub(crate) struct Exact;

impl Sense for Exact {
    fn look(&mut self, _: &CraftModel) {}
    fn known(&mut self, craft: &CraftModel) -> Known {
        craft.known()
    }
}

/// Telemetry of one of the two models, through the estimator. Reports are taken between ticks and heard 20 ms later.
pub(crate) struct Coarse {
    pub(crate) estimator: MotionEstimator,
    quad: bool,
    noise: Draw,
    wander: [f64; 3],
    told: usize,
    waiting: Option<Telemetry>,
}

impl Coarse {
    pub(crate) fn tello(craft: &Craft) -> Self {
        Self::new(MotionEstimator::new(craft, Senses::tello()), false, 0)
    }

    pub(crate) fn quad(craft: &Craft, seed: u64) -> Self {
        Self::new(MotionEstimator::new(craft, Senses::quad()), true, seed)
    }

    fn new(estimator: MotionEstimator, quad: bool, seed: u64) -> Self {
        let mut noise = Draw::new(seed, "senses", &[]);
        let wander = [0.3 * noise.normal(), 0.3 * noise.normal(), 0.3 * noise.normal()];
        Self { estimator, quad, noise, wander, told: 0, waiting: None }
    }
}

impl Sense for Coarse {
    fn look(&mut self, craft: &CraftModel) {
        for &(time, setpoint) in &craft.sent[self.told..] {
            self.estimator.commanded(time, setpoint);
        }
        self.told = craft.sent.len();
        // 10 Hz (Tello) or 20 Hz, 30 ms after the tick.
        let millis = craft.now.as_nanos() / 1_000_000;
        let every = if self.quad { 50 } else { 100 };
        if millis % every == 50 % every
            && let Some(telemetry) = self.waiting.take()
        {
            self.estimator.observe(&telemetry);
        }
        if millis % every == 30 {
            // The slow error forgets itself over 30 s: an Ornstein-Uhlenbeck process of 0.3 m.
            let step = every as f64 * 1e-3;
            for axis in &mut self.wander {
                *axis += -*axis * step / 30.0 + 0.3 * (2.0 * step / 30.0).sqrt() * self.noise.normal();
            }
            let report = if self.quad { craft.quad_telemetry(self.wander, &mut self.noise) } else { craft.tello_telemetry() };
            self.waiting = Some(report);
        }
    }

    fn known(&mut self, craft: &CraftModel) -> Known {
        self.estimator.at(craft.now).unwrap_or_else(|| craft.known())
    }
}

/// How a flight of one motion went.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flown {
    /// In the level frame of the start.
    pub(crate) displacement: BodyDisplacement,
    pub(crate) turned: f64,
    /// Seconds from the start to finished.
    pub(crate) seconds: f64,
    /// True speed and distance from the later standstill at finished, m/s and m.
    pub(crate) speed_at_end: f64,
    pub(crate) coasted: f64,
    pub(crate) timed_out: bool,
}

/// Lets the craft hold for `time` while it is looked at.
pub(crate) fn pass(craft: &mut CraftModel, time: Duration, sense: &mut impl Sense) {
    let until = craft.now + time;
    while craft.now < until {
        // In steps that end on whole 10 ms, so that reports come at their times whatever the tick.
        let next = Time::from_millis((craft.now.as_nanos() / 10_000_000 + 1) * 10);
        craft.fly_until(next.min(until));
        if craft.now == next {
            sense.look(craft);
        }
    }
}

/// Ticks the executor until it has finished and the craft has come to rest.
pub(crate) fn fly(executor: &mut Executor, craft: &mut CraftModel, period: Duration, sense: &mut impl Sense) -> Flown {
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
        seconds,
        speed_at_end,
        coasted: end.distance(craft.position),
        timed_out: executor.timed_out(),
    }
}
