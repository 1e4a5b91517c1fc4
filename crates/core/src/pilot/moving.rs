//! Plans become setpoints, tick by tick, through the executor and the envelope.

use super::{Action, Phase, Pilot, Think};
use crate::command::{Command, Manoeuvre, Setpoint};
use crate::envelope::Clearance;
use crate::executor::{Goal, Motion, OwnFlight};
use crate::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use crate::policy::{Move, PolicyEvent, Step};
use crate::primitives::Primitives;
use crate::time::{Duration, Time, duration_from_secs};

/// Standing still, for a frame to be one taken at rest (issue: 0.1 m/s and 3 °/s).
const REST_SPEED: f64 = 0.1;
const REST_YAW_RATE: f64 = 3.0 / 180.0 * core::f64::consts::PI;
/// Longest wait for that; a craft that drifts in the wind never stands still.
const REST_WAIT: Duration = Duration::from_millis(1500);
/// A plan shorter than this, metres, is a turn on the spot: it has no direction to have been passed in.
const TURN_ONLY: f64 = 0.05;
/// A move of which a limit leaves nothing for so long is over.
const KEPT_STILL: Duration = Duration::from_secs(1);
/// Up to this share of what is wanted counts as nothing: near a limit what is left comes and goes with the noise of the height.
const KEPT_SHARE: f64 = 0.3;
/// A plan that was passed is not turned by less than this, radians: the next one turns as well.
const WORTH_TURNING: f64 = 5.0 / 180.0 * core::f64::consts::PI;
/// Flown back at most, metres: a craft that brakes for its goal stops within centimetres of it.
const FLY_BACK: f64 = 0.1;

impl Pilot {
    /// Where a move from a frame ends in the world, and whether the craft is already past it.
    pub(super) fn planned(&self, now: Time, step: &Step) -> (Option<Pose>, bool) {
        let Step::Move(motion) = step else { return (None, false) };
        let Some(from) = motion.anchor else {
            // It begins where the craft is when it begins.
            let from = self.known_pose(now);
            let goal = Goal::of_primitives(from, motion.primitives);
            return (Some(pose_of(goal)), false);
        };
        let goal = Goal::of_primitives(from, motion.primitives);
        let passed = self.settings.think == Think::Continuous
            && !motion.then_rest
            && !self.waits_for_queue()
            && self.is_passed(now, goal, from.position);
        (Some(pose_of(goal)), passed)
    }

    /// Whether the craft is past a goal, or too fast to stop before it: either way it would have to fly back.
    fn is_passed(&self, now: Time, goal: Goal, anchor: EnuPosition) -> bool {
        let known = self.known(now);
        let length = anchor.horizontal_distance(goal.position);
        if length < TURN_ONLY || goal.is_passed(anchor, known.position) {
            return length >= TURN_ONLY;
        }
        let rest = self.executor.rest_position(now, known);
        let (east, north) = (goal.position.east - anchor.east, goal.position.north - anchor.north);
        let beyond = (rest.east - goal.position.east) * east + (rest.north - goal.position.north) * north;
        beyond > FLY_BACK * length
    }

    /// A queue that is always replaced, or stopped for what it has passed, never climbs: the next plan waits for its end.
    fn waits_for_queue(&self) -> bool {
        self.settings.motion != Motion::Blended && self.executing
    }

    pub(super) fn begin_move(&mut self, now: Time, motion: Move) {
        if self.link_lost {
            return self.refuse_move(now);
        }
        let known = self.known(now);
        let relative = |yaw: f64| Primitives { yaw, ..motion.primitives };
        match motion.anchor {
            Some(from) if self.settings.think == Think::Continuous && !motion.then_rest => {
                if self.waits_for_queue() {
                    self.pending = Some(motion);
                    return;
                }
                let goal = Goal::of_primitives(from, motion.primitives);
                // Flying back to it fails in up to half of the runs (closed-loop study, finding 6).
                if self.is_passed(now, goal, from.position) {
                    return self.turn_alone(now, goal.heading);
                }
                if self.settings.motion == Motion::Blended {
                    self.executor.start_goal(now, known, goal);
                } else {
                    self.executor.start(now, known, rest_of_plan(known.position, known.attitude.heading, goal));
                }
            }
            Some(from) if motion.then_rest => {
                // A search turn is measured from the frame that asked for it; what was turned since counts.
                let turned = wrap_angle(known.attitude.heading - from.attitude.heading);
                self.executor.start(now, known, relative(motion.primitives.yaw - turned));
            }
            _ => self.executor.start(now, known, motion.primitives),
        }
        self.executing = true;
        self.needs_rest = motion.then_rest;
        self.hold_since = None;
        self.settled = None;
        self.next_tick = now;
    }

    /// Of a plan that was passed the turn is still flown, where the craft comes to rest: what it points at, somebody who walks by say,
    /// would leave the picture otherwise.
    fn turn_alone(&mut self, now: Time, heading: f64) {
        let known = self.known(now);
        let yaw = wrap_angle(heading - known.attitude.heading);
        if yaw.abs() < WORTH_TURNING {
            return self.refuse_move(now);
        }
        if self.settings.motion == Motion::Blended {
            let position = self.executor.rest_position(now, known);
            self.executor.start_goal(now, known, Goal { position, heading });
        } else {
            self.executor.start(now, known, Primitives { yaw, ..Primitives::default() });
        }
        self.executing = true;
        self.needs_rest = false;
        (self.hold_since, self.settled) = (None, None);
        self.next_tick = now;
    }

    /// A move that does not begin: the policy hears of it as of one that was cut short.
    fn refuse_move(&mut self, now: Time) {
        if self.executing {
            self.stop_motion(now);
        } else {
            self.policy.handle(PolicyEvent::MoveEnded { completed: false });
        }
    }

    /// The reason to move has ended: zero goes out at once, and the policy is told that its move was cut short. What it wants to
    /// do about that is not carried out: it is shown a frame once it may go on.
    pub(super) fn stop_motion(&mut self, now: Time) {
        self.pending = None;
        if self.executing {
            self.executing = false;
            self.executor.stop(now);
            self.next_tick = now;
            self.policy.handle(PolicyEvent::MoveEnded { completed: false });
        }
    }

    pub(super) fn rest_from(&mut self, now: Time) {
        self.hold_since = Some(now);
        self.settled = None;
    }

    /// Notes the instant from which the craft stands still, counted from the first zero commanded: an executor that has waited
    /// for rest has not to be waited for twice.
    fn settle(&mut self, now: Time) {
        let (Some(since), None) = (self.hold_since, self.settled) else { return };
        let known = self.known(now);
        let waited = now.since(since);
        // Dead time and lag first: a craft told to move a moment ago stands still just before it starts.
        let answered = waited >= duration_from_secs(self.craft.dead_time + self.craft.lag);
        let still = known.velocity.speed() < REST_SPEED && known.yaw_rate.abs() < REST_YAW_RATE;
        if (answered && still) || waited >= REST_WAIT {
            self.settled = Some(now);
        }
    }

    /// One setpoint. Zero is sent too, so that no craft lands for want of commands while a VLM thinks.
    pub(super) fn tick(&mut self, now: Time) {
        if !matches!(self.phase, Phase::Flying | Phase::Held | Phase::Manual) {
            return;
        }
        self.settle(now);
        let known = self.known(now);
        let mut finished = false;
        let by_hand = self.phase == Phase::Manual && !self.link_lost;
        let clearance = match self.manual.filter(|(_, until)| by_hand && now < *until) {
            Some((setpoint, _)) => {
                self.wanted = setpoint;
                self.envelope.clear_manual(now, setpoint)
            }
            None => {
                let mut setpoint = Setpoint::HOLD;
                if self.executing {
                    let tick = self.executor.tick(now, known);
                    match tick.manoeuvre {
                        // Nothing is said meanwhile: a hold would end it, and `stop_motion` says one when its reason ends.
                        Some(OwnFlight::UnderWay) => return,
                        Some(OwnFlight::Begin(manoeuvre)) => return self.begin_manoeuvre(now, manoeuvre),
                        None => (setpoint, finished) = (tick.setpoint, tick.finished),
                    }
                }
                self.wanted = setpoint;
                self.envelope.clear_setpoint(now, setpoint)
            }
        };
        if self.is_kept_still(now, &clearance) {
            finished = true;
            self.kept_since = None;
            self.executor.stop(now);
        }
        self.send(now, clearance);
        if finished {
            self.move_ended(now);
        }
    }

    /// Whether a limit has left nothing of what a move asks for, for so long that it will not come to its end: down at the floor, out
    /// at the fence. Without this it would end by its time limit only.
    fn is_kept_still(&mut self, now: Time, clearance: &Clearance) -> bool {
        let wanted = self.wanted;
        let nothing_left = |cleared: Setpoint| {
            cleared.speed() <= KEPT_SHARE * wanted.speed() && cleared.yaw_rate.abs() <= KEPT_SHARE * wanted.yaw_rate.abs()
        };
        let kept = self.executing && !wanted.is_hold() && clearance.setpoint().is_some_and(nothing_left);
        if !kept {
            self.kept_since = None;
            return false;
        }
        now.since(*self.kept_since.get_or_insert(now)) >= KEPT_STILL
    }

    /// A manoeuvre as far as the envelope lets it go. One that it does not let begin is the end of the move.
    fn begin_manoeuvre(&mut self, now: Time, manoeuvre: Manoeuvre) {
        self.wanted = Setpoint::HOLD;
        let clearance = self.envelope.clear_manoeuvre(now, manoeuvre);
        let held = clearance.setpoint().is_some();
        self.send(now, clearance);
        if held {
            self.stop_motion(now);
        }
    }

    fn move_ended(&mut self, now: Time) {
        self.executing = false;
        let step = match self.pending.take() {
            Some(motion) => Step::Move(motion),
            None => self.policy.handle(PolicyEvent::MoveEnded { completed: true }),
        };
        if let Some(view) = self.view {
            self.carry_out(now, step, &view);
        }
    }

    fn send(&mut self, now: Time, clearance: Clearance) {
        if let Command::Setpoint(setpoint) = clearance.cleared.get() {
            self.estimator.commanded(now, *setpoint);
            self.executor.commanded(now, *setpoint);
        }
        if clearance.setpoint().is_some_and(Setpoint::is_hold) {
            self.hold_since.get_or_insert(now);
        } else {
            (self.hold_since, self.settled) = (None, None);
            self.first_motion.get_or_insert(now);
        }
        let told = core::mem::replace(&mut self.told_change, clearance.changed);
        self.tell(clearance.changed, told);
        self.outbox.push_back(Action::Command(clearance.cleared));
    }
}

fn pose_of(goal: Goal) -> Pose {
    Pose { position: goal.position, attitude: Attitude { heading: goal.heading, ..Attitude::default() } }
}

/// The primitives from where the craft is to the end of an anchored plan: turn to it, fly to it, climb to it.
fn rest_of_plan(position: EnuPosition, heading: f64, goal: Goal) -> Primitives {
    let ahead = position.displacement_to(goal.position, heading);
    if libm::hypot(ahead.right, ahead.forward) > TURN_ONLY {
        Primitives::from_displacement(ahead)
    } else {
        Primitives { yaw: wrap_angle(goal.heading - heading), climb: ahead.up, ..Primitives::default() }
    }
}
