//! The simulated craft as one object: true motion, telemetry, and ground truth for evaluation.

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
use crate::senses::{TelemetrySensors, exact};

/// How far back [`SimCraft::true_pose_at`] can look.
pub const HISTORY: Duration = Duration::from_secs(10);
const HISTORY_TICKS: usize = 2000;
/// Maximum reduction of the distance between a craft and an actor during one actor tick, metres: at 50 m/s, more than
/// both reach.
const WATCH_REACH: f64 = 2.5;

/// Ground truth, for the judge, the renderer and the recorder only.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Flight time of the state.
    pub time: Time,
    /// Pose of the body's centre; the camera sits there too.
    pub pose: Pose,
    /// Velocity.
    pub velocity: EnuVelocity,
    /// Flight phase.
    pub phase: FlightPhase,
    /// Objects hit in flight, with times. Landing does not count.
    pub collided_with: Vec<(Time, ObjectId)>,
    /// Length of the path flown, metres.
    pub path_length: f64,
}

/// A craft in a scene.
///
/// Pass commands in order of time, and advance it. Results depend only on the commands, their times and the seed, not
/// on how time is split into calls of [`advance_to`](Self::advance_to).
#[derive(Clone, Debug)]
pub struct SimCraft {
    collider: Arc<Collider>,
    dynamics: Dynamics,
    senses: TelemetrySensors,
    telemetry: Telemetry,
    /// Poses of the last ticks; the latest last.
    history: VecDeque<Pose>,
    traffic: Traffic,
    watch: Watch,
}

/// The actors that the craft can touch before their next tick.
#[derive(Clone, Debug, Default)]
struct Watch {
    until: Time,
    actors: Vec<usize>,
}

impl SimCraft {
    /// A craft on the ground below `start`, with its heading, in still air with realistic telemetry.
    #[must_use]
    pub fn new(collider: Arc<Collider>, model: Model, start: Pose, seed: u64) -> Self {
        Self::with_conditions(collider, model, start, SimConditions::new(seed))
    }

    /// A craft with the given conditions.
    #[must_use]
    pub fn with_conditions(collider: Arc<Collider>, model: Model, start: Pose, conditions: SimConditions) -> Self {
        Self::with_traffic(Arc::default(), collider, model, start, conditions)
    }

    /// A craft among the actors of its scene, which depend on the seed of the conditions. They stop for the craft but
    /// do not flee from it.
    #[must_use]
    pub fn with_traffic(cast: Arc<Cast>, collider: Arc<Collider>, model: Model, start: Pose, conditions: SimConditions) -> Self {
        let dynamics = Dynamics::new(&collider, model, start, conditions);
        let mut senses = TelemetrySensors::new(&dynamics, conditions.seed, conditions.exact);
        let telemetry = senses.report(&dynamics);
        let history = VecDeque::from([dynamics.pose()]);
        let traffic = Traffic::new(cast, conditions.seed);
        Self { collider, dynamics, senses, telemetry, history, traffic, watch: Watch::default() }
    }

    /// Takes a command given at `now`; a setpoint is valid until `valid_until`. See [`Dynamics::apply`].
    pub fn apply(&mut self, now: Time, command: Command, valid_until: Time) {
        self.dynamics.apply(now, command, valid_until);
    }

    /// Sets the height of later take-offs, metres above the take-off point.
    pub fn set_take_off_height(&mut self, height: f64) {
        self.dynamics.set_take_off_height(height);
    }

    /// Changes the steady wind, m/s towards the east and the north.
    pub fn set_wind(&mut self, east: f64, north: f64) {
        self.dynamics.set_wind(east, north);
    }

    /// Puts the craft somewhere else. See [`Dynamics::place`].
    pub fn place(&mut self, pose: Pose, velocity: EnuVelocity, hovering: bool) {
        self.dynamics.place(pose, velocity, hovering);
        if let Some(last) = self.history.back_mut() {
            *last = self.dynamics.pose();
        }
        self.watch = Watch::default();
    }

    /// Advances the world to the last tick that ends at or before `now`.
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

    /// Advances the actors to the end of the tick, and checks whether the craft, which was at `before`, has hit one.
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

    /// Actor positions at `at`, in the order of the cast; `None` if it is in the future or more than
    /// [`HISTORY`](actors::HISTORY) ago.
    #[must_use]
    pub fn actors_at(&self, at: Time) -> Option<Vec<ActorPlace>> {
        self.traffic.places_at(at)
    }

    /// The actors around it.
    #[must_use]
    pub fn cast(&self) -> &Arc<Cast> {
        self.traffic.cast()
    }

    /// The latest telemetry report; `time` is when it was measured.
    #[must_use]
    pub fn telemetry(&self) -> Telemetry {
        self.telemetry
    }

    /// Time of the first report after `after`.
    #[must_use]
    pub fn next_telemetry(&self, after: Time) -> Time {
        let period = self.senses.period() * TICK.as_nanos() as u64;
        Time::from_nanos((after.as_nanos() / period + 1).saturating_mul(period))
    }

    /// A report of the current tick without error, rounding or omission, for tests only.
    #[must_use]
    pub fn exact_telemetry(&self) -> Telemetry {
        exact(&self.dynamics)
    }

    /// Ground truth at [`time`](Self::time).
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

    /// The true pose at `at`, for rendering a frame: interpolated between ticks, exact on them; `None` if it is in the
    /// future or more than [`HISTORY`] ago.
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
        let fraction = rest as f64 / step as f64;
        let (a, b) = (earlier.attitude, later.attitude);
        Some(Pose {
            position: earlier.position.towards(later.position, fraction),
            attitude: Attitude {
                heading: wrap_angle(a.heading + wrap_angle(b.heading - a.heading) * fraction),
                pitch: a.pitch + (b.pitch - a.pitch) * fraction,
                roll: a.roll + (b.roll - a.roll) * fraction,
            },
        })
    }

    /// The time up to which the world was advanced.
    #[must_use]
    pub fn time(&self) -> Time {
        self.dynamics.time()
    }

    /// The true motion.
    #[must_use]
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// The scene's collision geometry.
    #[must_use]
    pub fn collider(&self) -> &Arc<Collider> {
        &self.collider
    }
}
