//! What is being flown: the executor with its motion, a course along plans, or a steering of its own; and the rest in between.

use crate::course::Course;
use crate::policy::Move;
use spf_core::command::{Command, Setpoint};
use spf_core::craft::Craft;
use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::primitives::Primitives;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_envelope::{Cause, ClearedCommand};
use spf_motion::executor::{Executor, Goal};

/// Maximum speed at which a frame counts as taken at rest, m/s.
const REST_SPEED: f64 = 0.1;
const REST_YAW_RATE: f64 = 3.0 / 180.0 * core::f64::consts::PI;
/// Maximum wait for that; in wind a craft never stands still.
const REST_WAIT: Duration = Duration::from_millis(1500);
/// A plan shorter than this, metres, is a turn on the spot, with no direction in which it could be passed.
pub(crate) const TURN_ONLY: f64 = 0.05;
/// A move that a limit blocks entirely for this long is over.
const KEPT_STILL: Duration = Duration::from_secs(1);
/// Up to this fraction of the requested speed counts as blocked: near a limit the remainder comes and goes with the
/// height noise.
const KEPT_FRACTION: f64 = 0.3;
/// Maximum distance flown backwards, metres: a craft that brakes for its goal stops within centimetres of it.
const FLY_BACK: f64 = 0.1;
/// A boundary that reduced a setpoint less than this before a timeout is named as its likely cause.
const HELD_BACK: Duration = Duration::from_secs(10);

/// What is being flown.
#[derive(Debug)]
pub(crate) struct Leg {
    pub(crate) executor: Executor,
    pub(crate) state: State,
    /// The place of what the reply pointed at that is being flown.
    pub(crate) centre: Option<EnuPosition>,
    /// The move that waits for the end of this one: a queue that is always replaced never climbs.
    pub(crate) pending: Option<Move>,
    pub(crate) rest: Rest,
    pub(crate) next_tick: Time,
    /// The last setpoint requested from the envelope.
    pub(crate) wanted: Setpoint,
    /// When the first moving setpoint was sent.
    pub(crate) first_motion: Option<Time>,
    /// Since when a limit has left nothing of the requested motion.
    kept_since: Option<Time>,
    /// When a boundary last reduced a setpoint, and which.
    held_back: Option<(Time, Cause)>,
}

/// What the craft does.
#[derive(Clone, Debug)]
pub(crate) enum State {
    /// It holds.
    Rest,
    /// It holds while the gimbal turns the camera to this tilt, radians, until this time at the latest.
    Tilts(f64, Time),
    /// The executor's motion.
    Moves,
    /// Along plans that are renewed until their end.
    Course(Box<Course>),
    /// It stays with a target that moves.
    Follows,
}

/// Rest: the craft stands still, and has for how long.
#[derive(Debug)]
pub(crate) struct Rest {
    /// The next frame must be taken at rest.
    pub(crate) is_needed: bool,
    /// Since when nothing but zero was commanded.
    since: Option<Time>,
    /// Since when the craft stands still.
    settled: Option<Time>,
}

impl Rest {
    /// Rest counts from `now`.
    pub(crate) fn begin(&mut self, now: Time) {
        (self.since, self.settled) = (Some(now), None);
    }

    fn end(&mut self) {
        (self.since, self.settled) = (None, None);
    }

    /// Whether the craft has held since that time.
    pub(crate) fn holds_since(&self, captured: Time) -> bool {
        self.settled.is_some_and(|settled| settled <= captured)
    }

    /// Records the time from which the craft stands still, counted from the first zero command: rest that the executor
    /// has already waited for is not waited for again.
    pub(crate) fn settle(&mut self, now: Time, known: &MotionEstimate, craft: &Craft) {
        let (Some(since), None) = (self.since, self.settled) else { return };
        let waited = now.since(since);
        // Dead time and lag first: a craft commanded to move a moment ago stands still just before it starts.
        let answered = waited >= duration_from_secs(craft.dead_time + craft.lag);
        let still = known.velocity.speed() < REST_SPEED && known.yaw_rate.abs() < REST_YAW_RATE;
        if (answered && still) || waited >= REST_WAIT {
            self.settled = Some(now);
        }
    }
}

impl Leg {
    pub(crate) fn new(executor: Executor) -> Self {
        Self {
            executor,
            state: State::Rest,
            centre: None,
            pending: None,
            rest: Rest { is_needed: true, since: None, settled: None },
            next_tick: Time::ZERO,
            wanted: Setpoint::HOLD,
            first_motion: None,
            kept_since: None,
            held_back: None,
        }
    }

    /// Whether a motion is under way.
    pub(crate) fn is_moving(&self) -> bool {
        !matches!(self.state, State::Rest | State::Tilts(..))
    }

    pub(crate) fn is_following(&self) -> bool {
        matches!(self.state, State::Follows)
    }

    pub(crate) fn is_tilting(&self) -> bool {
        matches!(self.state, State::Tilts(..))
    }

    pub(crate) fn course(&self) -> Option<&Course> {
        if let State::Course(course) = &self.state { Some(course) } else { None }
    }

    /// Starts a motion; `then_rest`: the next frame must be taken at rest after it.
    pub(crate) fn start(&mut self, now: Time, state: State, then_rest: bool) {
        self.state = state;
        self.rest.is_needed = then_rest;
        self.rest.end();
        self.next_tick = now;
    }

    /// Leaves a course or a target that is followed; what the executor flies of it goes on until it is replaced.
    pub(crate) fn leave_course(&mut self) {
        if matches!(self.state, State::Course(_) | State::Follows) {
            self.state = State::Moves;
        }
    }

    /// Takes the course out, if one is flown; the executor's motion goes on.
    pub(crate) fn take_course(&mut self) -> Option<Box<Course>> {
        match core::mem::replace(&mut self.state, State::Moves) {
            State::Course(course) => Some(course),
            other => {
                self.state = other;
                None
            }
        }
    }

    /// Commands zero from now on. Returns whether a motion was under way.
    pub(crate) fn stop(&mut self, now: Time) -> bool {
        self.pending = None;
        let was_moving = self.is_moving();
        if was_moving {
            self.state = State::Rest;
            self.executor.stop(now);
            self.next_tick = now;
        }
        was_moving
    }

    /// Holds while the gimbal looks to `tilt`, radians.
    pub(crate) fn tilt(&mut self, now: Time, tilt: f64, until: Time) {
        self.pending = None;
        self.executor.stop(now);
        self.rest.begin(now);
        self.next_tick = now;
        self.state = State::Tilts(tilt, until);
    }

    /// Whether the craft is past a goal, or too fast to stop before it; either way it would have to fly back.
    pub(crate) fn is_past(&self, now: Time, known: &MotionEstimate, goal: Goal, anchor: EnuPosition) -> bool {
        let length = anchor.horizontal_distance(goal.position);
        if length < TURN_ONLY || goal.is_passed(anchor, known.position) {
            return length >= TURN_ONLY;
        }
        let rest = self.executor.rest_position(now, *known);
        let (east, north) = (goal.position.east - anchor.east, goal.position.north - anchor.north);
        let beyond = (rest.east - goal.position.east) * east + (rest.north - goal.position.north) * north;
        beyond > FLY_BACK * length
    }

    /// Whether a limit has blocked a move for so long that it will not reach its end, such as downwards at the floor or
    /// outwards at the fence. Without this check, only its time limit would end it.
    pub(crate) fn is_kept_still(&mut self, now: Time, clearance: &ClearedCommand) -> bool {
        let wanted = self.wanted;
        let nothing_left = |cleared: Setpoint| {
            cleared.speed() <= KEPT_FRACTION * wanted.speed() && cleared.yaw_rate.abs() <= KEPT_FRACTION * wanted.yaw_rate.abs()
        };
        let kept = self.is_moving() && !wanted.is_hold() && clearance.setpoint().is_some_and(nothing_left);
        if !kept {
            self.kept_since = None;
            return false;
        }
        let is_over = now.since(*self.kept_since.get_or_insert(now)) >= KEPT_STILL;
        if is_over {
            self.kept_since = None;
            self.executor.stop(now);
        }
        is_over
    }

    /// Takes note of a command that is sent.
    pub(crate) fn sent(&mut self, now: Time, clearance: &ClearedCommand) {
        if let Command::Setpoint(setpoint) = clearance.cleared.get() {
            self.executor.commanded(now, *setpoint);
        }
        if clearance.setpoint().is_some_and(Setpoint::is_hold) {
            self.rest.since.get_or_insert(now);
        } else {
            self.rest.end();
            self.first_motion.get_or_insert(now);
        }
        if let Some(cause) = clearance.changed.filter(|cause| cause.is_boundary()) {
            self.held_back = Some((now, cause));
        }
    }

    /// The end of the message of a timeout: the boundary that held the craft back, if any.
    pub(crate) fn held_back(&self, now: Time) -> String {
        let recent = self.held_back.filter(|(at, _)| now.since(*at) <= HELD_BACK);
        recent.map_or(String::new(), |(_, cause)| format!("; in the last {} s, the craft was {cause}", HELD_BACK.as_secs()))
    }
}

/// The primitives from the craft's position to the end of an anchored plan: turn, fly, climb.
pub(crate) fn rest_of_plan(position: EnuPosition, heading: f64, goal: Goal) -> Primitives {
    let ahead = position.displacement_to(goal.position, heading);
    if libm::hypot(ahead.right, ahead.forward) > TURN_ONLY {
        Primitives::from_displacement(ahead)
    } else {
        Primitives { yaw: wrap_angle(goal.heading - heading), climb: ahead.up, ..Primitives::default() }
    }
}

/// The pose at a goal.
pub(crate) fn pose_of(goal: Goal) -> Pose {
    Pose { position: goal.position, attitude: Attitude { heading: goal.heading, ..Attitude::default() } }
}
