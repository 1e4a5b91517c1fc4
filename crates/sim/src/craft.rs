//! The simulated craft as one object: true motion, honest telemetry, and the truth for the judge.

use std::collections::VecDeque;
use std::sync::Arc;

use spf_core::command::Command;
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose, wrap_angle};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_scene::actors::{self, ActorPlace, Cast, Traffic};
use spf_scene::collide::Collider;
use spf_scene::geometry::ObjectId;

use crate::dynamics::{Dynamics, SimConditions, TICK};
use crate::model::Model;
use crate::senses::{Senses, exact};

/// How far back [`SimCraft::true_pose_at`] remembers.
pub const HISTORY: Duration = Duration::from_secs(10);
const HISTORY_TICKS: usize = 2000;
/// What a craft and an actor can come nearer to each other during one tick of the actors, metres: 50 m/s, which is more than
/// both reach.
const WATCH_REACH: f64 = 2.5;

/// Ground truth. It belongs to the judge, the renderer and the recorder; no pilot may see it.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// As of this flight time.
    pub time: Time,
    /// Pose of the body's centre; the camera sits there too.
    pub pose: Pose,
    /// Velocity.
    pub velocity: EnuVelocity,
    /// Whether it flies.
    pub phase: FlightPhase,
    /// What was hit in flight, and when. Landing is no hit.
    pub collided_with: Vec<(Time, ObjectId)>,
    /// Length of the way flown, metres.
    pub path_length: f64,
}

/// A craft in a scene.
///
/// Tell it commands as they are given, in order of time, and advance it; results depend on the commands, their times and the
/// seed alone, not on how time is cut into calls of [`advance_to`](Self::advance_to).
#[derive(Clone, Debug)]
pub struct SimCraft {
    collider: Arc<Collider>,
    dynamics: Dynamics,
    senses: Senses,
    telemetry: Telemetry,
    /// Poses of the last ticks; the latest last.
    history: VecDeque<Pose>,
    traffic: Traffic,
    watch: Watch,
}

/// The actors that the craft can touch before the actors' next tick.
#[derive(Clone, Debug, Default)]
struct Watch {
    until: Time,
    actors: Vec<usize>,
}

impl SimCraft {
    /// A craft on the ground below `start`, facing its heading, in still air with honest senses.
    #[must_use]
    pub fn new(collider: Arc<Collider>, model: Model, start: Pose, seed: u64) -> Self {
        Self::with_conditions(collider, model, start, SimConditions::new(seed))
    }

    /// A craft under other conditions.
    #[must_use]
    pub fn with_conditions(collider: Arc<Collider>, model: Model, start: Pose, conditions: SimConditions) -> Self {
        Self::with_traffic(Arc::default(), collider, model, start, conditions)
    }

    /// A craft among the actors of its scene, who follow the seed of the conditions. They stop for it, but do not flee from it.
    #[must_use]
    pub fn with_traffic(cast: Arc<Cast>, collider: Arc<Collider>, model: Model, start: Pose, conditions: SimConditions) -> Self {
        let dynamics = Dynamics::new(&collider, model, start, conditions);
        let mut senses = Senses::new(&dynamics, conditions.seed, conditions.exact);
        let telemetry = senses.report(&dynamics);
        let history = VecDeque::from([dynamics.pose()]);
        let traffic = Traffic::new(cast, conditions.seed);
        Self { collider, dynamics, senses, telemetry, history, traffic, watch: Watch::default() }
    }

    /// Takes a command given at `now`, valid until `valid_until` if it is a setpoint; see [`Dynamics::apply`].
    pub fn apply(&mut self, now: Time, command: Command, valid_until: Time) {
        self.dynamics.apply(now, command, valid_until);
    }

    /// Moves the world on to the last tick that ends at or before `now`.
    pub fn advance_to(&mut self, now: Time) {
        while self.dynamics.time() + TICK <= now {
            let before = self.dynamics.pose().position;
            self.dynamics.step(&self.collider);
            self.meet(before);
            if self.history.len() > HISTORY_TICKS {
                self.history.pop_front();
            }
            self.history.push_back(self.dynamics.pose());
            if self.dynamics.tick().is_multiple_of(self.senses.period()) {
                self.telemetry = self.senses.report(&self.dynamics);
            }
        }
    }

    /// Lets the actors go on to the end of the tick, and finds out whether the craft, which was at `before`, has met one.
    fn meet(&mut self, before: EnuPosition) {
        let (now, after) = (self.dynamics.time(), self.dynamics.pose().position);
        let radius = self.dynamics.model().craft.radius;
        self.traffic.set_craft(after, radius);
        self.traffic.advance_to(now);
        if !self.dynamics.airborne() || self.traffic.cast().is_empty() {
            return;
        }
        let cast = self.traffic.cast().clone();
        let then = now - TICK;
        if then >= self.watch.until {
            let spare = self.dynamics.model().craft.radius + WATCH_REACH;
            let near = |actor: &usize| {
                self.traffic.place_at(*actor, now).is_some_and(|place| cast.may_touch(*actor, &place, after, spare))
            };
            self.watch = Watch { until: then + actors::TICK, actors: (0..cast.len()).filter(near).collect() };
        }
        for &actor in &self.watch.actors {
            let places = self.traffic.place_at(actor, then).zip(self.traffic.place_at(actor, now));
            let Some((left, reached)) = places else { continue };
            let radius = self.dynamics.model().craft.radius;
            if let Some(centre) = cast.sweep(actor, [&left, &reached], before, after, radius) {
                self.dynamics.strike(&self.collider, cast.object(actor), centre);
                return;
            }
        }
    }

    /// Where the actors were at `at`, in the order of the cast. None when it lies in the future or more than
    /// [`HISTORY`](actors::HISTORY) back.
    #[must_use]
    pub fn actors_at(&self, at: Time) -> Option<Vec<ActorPlace>> {
        self.traffic.places_at(at)
    }

    /// The actors around it.
    #[must_use]
    pub fn cast(&self) -> &Arc<Cast> {
        self.traffic.cast()
    }

    /// The latest report of the craft. Its `time` says when it was measured.
    #[must_use]
    pub fn telemetry(&self) -> Telemetry {
        self.telemetry
    }

    /// When the next report after `after` is made; later than `after`.
    #[must_use]
    pub fn next_telemetry(&self, after: Time) -> Time {
        let period = self.senses.period() * TICK.as_nanos() as u64;
        Time::from_nanos((after.as_nanos() / period + 1).saturating_mul(period))
    }

    /// A report of this very tick without error, rounding or omission; for tests, never for a pilot that is measured.
    #[must_use]
    pub fn exact_telemetry(&self) -> Telemetry {
        exact(&self.dynamics)
    }

    /// The truth at [`time`](Self::time).
    #[must_use]
    pub fn truth(&self) -> Truth {
        Truth {
            time: self.dynamics.time(),
            pose: self.dynamics.pose(),
            velocity: self.dynamics.velocity(),
            phase: self.dynamics.phase(),
            collided_with: self.dynamics.contacts().to_vec(),
            path_length: self.dynamics.path_length(),
        }
    }

    /// The true pose at `at`, for rendering a frame at its capture time: interpolated between ticks, exact on them. None when
    /// it lies in the future or more than [`HISTORY`] back.
    #[must_use]
    pub fn true_pose_at(&self, at: Time) -> Option<Pose> {
        let step = TICK.as_nanos() as u64;
        let (tick, rest) = (at.as_nanos() / step, at.as_nanos() % step);
        let oldest = self.dynamics.tick() + 1 - self.history.len() as u64;
        let index = usize::try_from(tick.checked_sub(oldest)?).ok()?;
        let earlier = *self.history.get(index)?;
        if rest == 0 {
            return Some(earlier);
        }
        let later = *self.history.get(index + 1)?;
        let share = rest as f64 / step as f64;
        let (a, b) = (earlier.attitude, later.attitude);
        Some(Pose {
            position: earlier.position.towards(later.position, share),
            attitude: Attitude {
                heading: wrap_angle(a.heading + wrap_angle(b.heading - a.heading) * share),
                pitch: a.pitch + (b.pitch - a.pitch) * share,
                roll: a.roll + (b.roll - a.roll) * share,
            },
        })
    }

    /// The instant up to which the world has moved.
    #[must_use]
    pub fn time(&self) -> Time {
        self.dynamics.time()
    }

    /// The true motion.
    #[must_use]
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// The scene it may touch.
    #[must_use]
    pub fn collider(&self) -> &Arc<Collider> {
        &self.collider
    }
}
