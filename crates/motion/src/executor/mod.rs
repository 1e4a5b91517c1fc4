//! The executor: from control primitives, or a goal in the world, to velocity setpoints (paper §3.4 and the appendix;
//! `docs/explanation/method.md`).
//!
//! At every tick it predicts where the craft would come to rest if commanded to hold now, including commands not yet
//! flown (dead time), the lag and the acceleration limit. The remaining distance to the goal is commanded: at the axis
//! speed while that does not suffice, at the matching fraction of it in the last tick. Time is therefore never rounded
//! to ticks at any tick rate, and a step ends at its goal although the craft responds late and slowly.
//!
//! The paper's timed motion is the same law applied to an ideal craft that follows its commands exactly.

mod axis;
mod blended;
mod clock;
mod manoeuvres;
pub(crate) mod response;
mod sequential;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::axis::{Axis, Rules};
use self::blended::Blend;
use self::clock::TickClock;
use self::manoeuvres::Manoeuvres;
use self::response::{CommandLog, Response, State};
use self::sequential::Queue;
use spf_core::command::{Manoeuvre, Setpoint};
use spf_core::craft::Craft;
use spf_core::geometry::{BodyDisplacement, EnuPosition, EnuVelocity, Pose, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::primitives::{PrimitiveKind, Primitives};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};

/// Order in which primitives are flown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// One after the other, in the order of [`PrimitiveKind::QUEUE`], each ended by zero (the paper).
    Sequential,
    /// All at once, arriving together: straight to the goal while the body turns into the motion.
    #[default]
    Blended,
    /// Turn, then straight to the position, as manoeuvres that the craft ends by itself ([`Manoeuvre`]): for a craft
    /// that would continue with its last setpoint if the link is lost. Moves too short for a manoeuvre are flown as
    /// [`Sequential`](Self::Sequential).
    Manoeuvres,
}

/// What ends a primitive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// Time alone, at the full preset speed (the paper). A craft that must accelerate stops short of the goal.
    Timed,
    /// The distance flown according to telemetry, with a time limit as fallback; the speed is at most `√(a·magnitude)`.
    #[default]
    Measured,
}

/// A goal pose in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Goal {
    /// World position, metres.
    pub position: EnuPosition,
    /// Heading there, radians clockwise from north.
    pub heading: f64,
}

impl Goal {
    /// The end of a displacement from a pose, facing the direction flown: the plan of a frame, anchored at the pose of
    /// its capture. A purely vertical displacement keeps the heading.
    #[must_use]
    pub fn from_pose(pose: Pose, displacement: BodyDisplacement) -> Self {
        Self::of_primitives(pose, Primitives::from_displacement(displacement))
    }

    /// The end of primitives flown from a pose.
    #[must_use]
    pub fn of_primitives(pose: Pose, primitives: Primitives) -> Self {
        let heading = pose.attitude.heading;
        Self {
            position: pose.position.displaced(primitives.to_displacement(), heading),
            heading: wrap_angle(heading + primitives.yaw),
        }
    }

    /// True if `at` lies beyond the goal as seen from `anchor`, the position of the goal's frame: the goal was passed,
    /// and the craft must hold and never fly back. Evaluated horizontally; a goal above or below its anchor (nearer
    /// than 1 mm) is never passed.
    #[must_use]
    pub fn is_passed(&self, anchor: EnuPosition, at: EnuPosition) -> bool {
        let (east, north) = (self.position.east - anchor.east, self.position.north - anchor.north);
        east * east + north * north > 1e-6
            && (self.position.east - at.east) * east + (self.position.north - at.north) * north < 0.0
    }
}

/// The output of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// To be held until the next tick. While there is a [`manoeuvre`](Self::manoeuvre) this hold must not be sent,
    /// since it would end it.
    pub setpoint: Setpoint,
    /// The manoeuvre that the craft flies by itself, if any.
    pub manoeuvre: Option<OwnFlight>,
    /// True if the motion has ended *and the craft is at rest* as far as is known, or its time limit has passed. An
    /// empty queue alone is not the end, since its last item is still being flown. The setpoint is then a hold.
    pub finished: bool,
}

/// State of a manoeuvre at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OwnFlight {
    /// Start this manoeuvre.
    Begin(Manoeuvre),
    /// Started, not ended yet.
    UnderWay,
}

/// Maximum speed that counts as rest, m/s: stop-and-think takes its next frame below it.
const REST_SPEED: f64 = 0.1;
/// Maximum yaw rate that counts as rest, rad/s: 3 °/s.
const REST_YAW_RATE: f64 = 3.0 * core::f64::consts::PI / 180.0;

/// Minimum speed of a motion to a goal, m/s.
const LEAST_SPEED: f64 = 0.05;
/// A craft that has held for this long, s, or for its braking time from cruise speed, counts as at rest: in wind it
/// keeps drifting.
const REST_WAIT: f64 = 1.5;

/// Converts motion plans to setpoints. Takes the motion estimate at each tick; never reads a clock.
///
/// Between ticks the last setpoint is assumed to hold. If the craft received something else (the envelope reduced a
/// setpoint, or an operator flew), report it through [`commanded`](Self::commanded), so that the prediction stays
/// correct.
#[derive(Clone, Debug)]
pub struct Executor {
    craft: Craft,
    motion: Motion,
    ending: Ending,
    real: Response,
    /// Response of the craft, or of the ideal craft for [`Ending::Timed`].
    response: Response,
    clock: TickClock,
    log: CommandLog,
    plan: Option<Plan>,
    /// Heading, unwrapped.
    heading: f64,
    /// Motion of the ideal craft since the start; only for [`Ending::Timed`].
    ideal: State,
    deadline: Time,
    timed_out: bool,
}

#[derive(Clone, Debug)]
enum Plan {
    Queue(Queue),
    Blend(Blend),
    Manoeuvres(Manoeuvres),
}

impl Executor {
    /// An executor that holds until a motion starts. It assumes ticks at 10 Hz and measures their actual interval.
    #[must_use]
    pub fn new(craft: Craft, motion: Motion, ending: Ending) -> Self {
        let real = Response::of(&craft);
        Self {
            craft,
            motion,
            ending,
            real,
            response: if ending == Ending::Timed { Response::ideal() } else { real },
            clock: TickClock::new(0.1),
            log: CommandLog::default(),
            plan: None,
            heading: 0.0,
            ideal: State::default(),
            deadline: Time::ZERO,
            timed_out: false,
        }
    }

    /// Sets the tick interval to assume until ticks have been measured. Zero is ignored.
    #[must_use]
    pub fn with_period(mut self, period: Duration) -> Self {
        if !period.is_zero() {
            self.clock = TickClock::new(period.as_secs_f64());
        }
        self
    }

    /// Starts a motion from the current pose, replacing any other, even one in progress: earlier commands are accounted
    /// for, and blended motion continues without a stop. Non-finite primitives result in a hold.
    pub fn start(&mut self, now: Time, known: MotionEstimate, primitives: Primitives) {
        let from = self.begin(now, known);
        if !primitives.is_finite() || !known.is_finite() {
            self.plan = None;
            return;
        }
        self.plan = Some(match self.motion {
            Motion::Sequential => Plan::Queue(Queue::new(from, primitives, self.rules())),
            Motion::Manoeuvres => Plan::Manoeuvres(Manoeuvres::new(primitives, self.rules())),
            Motion::Blended => {
                let position = from.position.displaced(primitives.to_displacement(), from.heading);
                Plan::Blend(Blend::new(from, position, from.heading + primitives.yaw, self.rules()))
            }
        });
        self.limit(now, primitives);
    }

    /// Takes the flight phase from a report measured at `time`: whether the craft is flying a manoeuvre by itself.
    pub fn observe(&mut self, time: Time, phase: FlightPhase) {
        if let Some(Plan::Manoeuvres(manoeuvres)) = &mut self.plan {
            manoeuvres.observe(time, phase);
        }
    }

    /// Starts a motion to a goal in the world, replacing any other as [`start`](Self::start) does. Always blended,
    /// whatever the executor's motion; takes the shorter turn. A non-finite goal results in a hold.
    pub fn start_goal(&mut self, now: Time, known: MotionEstimate, goal: Goal) {
        self.start_goal_at(now, known, goal, self.craft.cruise_speed);
    }

    /// The same at no more than this horizontal speed, m/s; the climb is slowed down with it.
    pub fn start_goal_at(&mut self, now: Time, known: MotionEstimate, goal: Goal, speed: f64) {
        let from = self.begin(now, known);
        let finite = [goal.position.east, goal.position.north, goal.position.up, goal.heading].iter().all(|x| x.is_finite());
        if !finite || !known.is_finite() {
            self.plan = None;
            return;
        }
        let yaw = wrap_angle(goal.heading - from.heading);
        let cruise_speed = self.craft.cruise_speed.min(speed.max(LEAST_SPEED));
        let slower = cruise_speed < self.craft.cruise_speed;
        let climb_speed = if slower { self.craft.climb_speed.min(cruise_speed) } else { self.craft.climb_speed };
        let rules = Rules { craft: Craft { cruise_speed, climb_speed, ..self.craft }, ..self.rules() };
        self.plan = Some(Plan::Blend(Blend::new(from, goal.position, from.heading + yaw, rules)));
        let forward = from.position.horizontal_distance(goal.position);
        self.limit(now, Primitives { yaw, forward, right: 0.0, climb: goal.position.up - from.position.up });
    }

    /// Ends any motion: from the next tick on the setpoint is a hold. `now` is when the hold takes effect.
    pub fn stop(&mut self, now: Time) {
        self.plan = None;
        self.log.push(now, Setpoint::HOLD);
    }

    /// Records the actual command from `now` on, where it differs from what [`tick`](Self::tick) returned.
    pub fn commanded(&mut self, now: Time, setpoint: Setpoint) {
        if setpoint.is_finite() {
            self.advance_ideal(now);
            self.log.push(now, setpoint);
        }
    }

    /// Horizontal rest position if the craft is commanded to hold `now`: pending commands are flown for the dead time,
    /// then it brakes. The height is that at the end of the dead time.
    #[must_use]
    pub fn rest_position(&self, now: Time, known: MotionEstimate) -> EnuPosition {
        let present = state_of(known, known.attitude.heading);
        let State { position, velocity, .. } = self.log.follow(&self.real, present, now, now + self.real.dead_time);
        let [east, north] = self.real.horizontal.stop_2d([velocity.east, velocity.north]);
        EnuPosition { east: position.east + east, north: position.north + north, up: position.up }
    }

    /// The setpoint to hold from `now` until the next tick.
    pub fn tick(&mut self, now: Time, known: MotionEstimate) -> Tick {
        self.advance_ideal(now);
        self.clock.tick(now);
        let Some(plan) = &mut self.plan else {
            self.log.push(now, Setpoint::HOLD);
            return Tick { setpoint: Setpoint::HOLD, manoeuvre: None, finished: true };
        };
        if known.is_finite() {
            self.heading += wrap_angle(known.attitude.heading - self.heading);
        }
        let present = state_of(known, self.heading);
        // The state in which a setpoint sent now will find the craft, given the commands already sent.
        let state = match self.ending {
            Ending::Timed => self.ideal,
            Ending::Measured => self.log.follow(&self.real, present, now, now + self.real.dead_time),
        };
        let held = now.since(self.log.last_change());
        let quiet = self.log.last().is_hold() && held >= self.real.dead_time;
        let still = present.velocity.speed() < REST_SPEED && present.yaw_rate.abs() < REST_YAW_RATE;
        let braked = self.craft.standstill_time(self.craft.cruise_speed).max(REST_WAIT);
        let at_rest = still || held.as_secs_f64() >= braked;
        let view = TickInput { now, state, rest: quiet && at_rest, interval: self.clock.interval(), response: &self.response };
        let outcome = match plan {
            Plan::Queue(queue) => queue.tick(&view),
            Plan::Blend(blend) => blend.tick(&view),
            Plan::Manoeuvres(manoeuvres) => manoeuvres.tick(&view),
        };
        self.timed_out = now >= self.deadline;
        let mut manoeuvre = None;
        let (setpoint, mut finished) = match outcome {
            _ if self.timed_out => (Setpoint::HOLD, true),
            Outcome::Fly(setpoint) if setpoint.is_finite() => (setpoint, false),
            Outcome::Fly(_) => (Setpoint::HOLD, false),
            Outcome::Begin(begun) => {
                manoeuvre = Some(OwnFlight::Begin(begun));
                (Setpoint::HOLD, false)
            }
            Outcome::Wait => {
                manoeuvre = Some(OwnFlight::UnderWay);
                (Setpoint::HOLD, false)
            }
            Outcome::Arrived => (Setpoint::HOLD, view.rest),
        };
        finished &= setpoint.is_hold();
        if finished {
            self.plan = None;
        }
        self.log.push(now, setpoint);
        Tick { setpoint, manoeuvre, finished }
    }

    /// True while a motion is in progress.
    #[must_use]
    pub fn is_active(&self) -> bool {
        self.plan.is_some()
    }

    /// True if the last motion ended by its time limit instead of at its goal: something kept the craft from flying it.
    #[must_use]
    pub fn timed_out(&self) -> bool {
        self.timed_out
    }

    /// Maximum remaining time of the current motion; zero without one.
    #[must_use]
    pub fn remaining(&self, now: Time) -> Duration {
        if self.plan.is_some() { self.deadline.since(now) } else { Duration::ZERO }
    }

    fn begin(&mut self, now: Time, known: MotionEstimate) -> State {
        self.heading = known.attitude.heading;
        self.timed_out = false;
        let from = state_of(known, self.heading);
        self.ideal = State { velocity: EnuVelocity::default(), yaw_rate: 0.0, ..from };
        // The ideal craft of a timed motion starts at rest, whatever was commanded before.
        if self.ending == Ending::Timed {
            self.log.push(now, Setpoint::HOLD);
        }
        self.clock.mark(now);
        // The pause since the last motion is not a tick interval.
        if self.plan.is_none() {
            self.clock.rest();
        }
        from
    }

    fn rules(&self) -> Rules {
        Rules { craft: self.craft, ending: self.ending }
    }

    /// Sets the time limit: twice the sum of the axis times at their speeds, plus room for the craft to respond and to
    /// correct once per axis, plus two seconds.
    fn limit(&mut self, now: Time, primitives: Primitives) {
        let each = 2.5 * self.rules().settling();
        let mut total = 2.0;
        if let Some(Plan::Manoeuvres(manoeuvres)) = &self.plan {
            total += manoeuvres.overhead();
        }
        for kind in PrimitiveKind::QUEUE {
            let magnitude = primitives.magnitude(kind).abs();
            if magnitude > 0.0 {
                let axis = Axis::new(kind, magnitude, self.rules());
                let speed = axis.speed(magnitude);
                total += 2.0 * (magnitude / speed + speed / kind.acceleration(&self.craft)) + each;
            }
        }
        self.deadline = now + duration_from_secs(total);
    }

    fn advance_ideal(&mut self, now: Time) {
        if self.ending == Ending::Timed {
            let passed = self.clock.since(now);
            self.ideal = self.response.follow(self.ideal, self.log.last(), passed);
        }
        self.clock.mark(now);
    }
}

fn state_of(known: MotionEstimate, heading: f64) -> State {
    State { position: known.position, velocity: known.velocity, heading, yaw_rate: known.yaw_rate }
}

/// Input of a plan at a tick.
struct TickInput<'a> {
    now: Time,
    /// State of the craft when the setpoint of this tick takes effect.
    state: State,
    /// The craft is at rest, and no command is pending.
    rest: bool,
    /// How long the setpoint of this tick will probably hold, s.
    interval: f64,
    response: &'a Response,
}

/// Output of a plan at a tick.
enum Outcome {
    /// Command this setpoint; a hold waits until the craft has flown the previous ones.
    Fly(Setpoint),
    /// Start this manoeuvre.
    Begin(Manoeuvre),
    /// Wait for the manoeuvre to end.
    Wait,
    /// Nothing left to command.
    Arrived,
}

#[cfg(any(test, feature = "craft-model"))]
pub mod craft_model;
#[cfg(test)]
mod tests;
