//! See, point, fly: from a frame to a query, from its reply to a motion, and from the motion to setpoints, tick by tick.
//!
//! Nothing here ends an instruction by itself: what does is returned ([`Ended`]), and the [pilot](crate::Pilot) concludes.

use super::Pilot;
use crate::admissible::{Admitted, Way};
use crate::course::{AT_PLACE, Aim, Course, PLAN_PERIOD, Renewed};
use crate::event::{Action, Decision, Ending, Note, Outcome, Phase};
use crate::following::{TrackNews, walks};
use crate::leg::{State, TURN_ONLY, pose_of, rest_of_plan};
use crate::policy::{Expected, Goto, Move, Output, PolicyEvent, Reckoned, Step, View};
use crate::queries::{Asked, decides};
use crate::settings::QueryTiming;
use crate::steering::TargetEstimate;
use crate::target::{Here, Lead, may_overhang};
use crate::view_height::{Correction, correction};
use spf_core::command::{Command, Manoeuvre, Setpoint};
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::gimbal::GimbalReport;
use spf_core::motion::MotionEstimate;
use spf_core::primitives::Primitives;
use spf_core::query::{Query, QueryId, QueryKind, VerticalRoom};
use spf_core::reply::Status;
use spf_core::time::{Duration, Time};
use spf_core::track::TrackReport;
use spf_envelope::{Cause, ClearedCommand, Reaction};
use spf_motion::executor::{Goal, Motion, OwnFlight};
use spf_space::planner::{Body, Destination};

/// Maximum number of steps of a policy at one instant; more means a policy that never waits.
const STEPS_AT_ONCE: usize = 16;
/// A passed plan is not turned by less than this, radians; the next one turns as well.
const WORTH_TURNING: f64 = 5.0 / 180.0 * core::f64::consts::PI;
/// A target is not turned to whose place is nearer than this, metres: its direction is not known.
const BESIDE: f64 = 1.0;
/// The position's drift within this time counts as its error relative to the map.
const DRIFTING: Duration = Duration::from_secs(3);
/// Deceleration that plans count on, as a fraction of the craft's limit.
const BRAKING: f64 = 0.5;
/// At the end of a course, a target farther off the heading than this is turned to, radians: 15°.
const LOOK_BACK: f64 = 15.0 / 180.0 * core::f64::consts::PI;
/// Longest vertical motion, and longest way back, that one reply permits to bring a target into view, metres.
const AT_MOST: f64 = 1.5;
/// A correction below this is not flown, metres.
const WORTH_FLYING: f64 = 0.15;
/// The gimbal has arrived within this of where it was told to look, radians: 2°.
const ARRIVED: f64 = 2.0 / 180.0 * core::f64::consts::PI;
/// Maximum wait for that.
const ARRIVES: Duration = Duration::from_secs(3);
/// Less than this is left to look up or down, radians: 8°; then the craft climbs or sinks.
const WORTH_TILTING: f64 = 8.0 / 180.0 * core::f64::consts::PI;
/// A gimbal that was not heard for this long is not told anything.
const HEARD: Duration = Duration::from_secs(1);
/// The part of the vertical field of view by which one look tilts the camera: the images overlap.
const LOOK: f64 = 0.7;
/// A craft that has turned by this since a frame looks elsewhere, radians: 10°.
const TURNED_AWAY: f64 = 10.0 / 180.0 * core::f64::consts::PI;

/// Why the instruction ends; `None` if it goes on.
pub(crate) type Ended = Option<Ending>;

impl Pilot {
    // ---- See: frames and queries ----

    /// Passes the newest frame to the policy when a decision is due.
    pub(crate) fn decide(&mut self, now: Time) -> Ended {
        if self.flight.phase != Phase::Flying || self.flight.link_lost || self.leg.is_tilting() {
            return None;
        }
        // Only a good reply ends a hold for failed replies, so one must be requested.
        if !matches!(self.envelope.reaction(now), Reaction::Continue | Reaction::Hold(Cause::FailedReplies)) {
            return None;
        }
        let mut view = self.senses.view?;
        // Checked now and not when the frame arrived: the craft may have moved since.
        view.at_rest = self.leg.rest.holds_since(view.frame.captured);
        // Beside somebody who walks there is no other rest.
        view.at_rest |= self.goes_along(now);
        if !self.queries.is_empty() {
            return None;
        }
        view.room = VerticalRoom { error: self.senses.height_error(), ..self.envelope.room() };
        view.expected = self.expected(now, view.pose);
        view.reckoned = self.reckoned(now, view.pose);
        let from_rest = self.leg.rest.is_needed || self.settings.think == QueryTiming::Stop;
        let moving = self.leg.is_moving();
        if self.senses.is_used(view.frame.id) || (from_rest && (moving || !view.at_rest)) {
            return None;
        }
        if moving && !self.queries.is_news(now, view.pose) {
            return None;
        }
        if let Some(spent) = self.answers.spent(&self.settings).or_else(|| self.queries.spent(&self.settings)) {
            // The last plan is flown to its end.
            return (!moving).then(|| Ending::new(Outcome::Timeout, spent + &self.leg.held_back(now)));
        }
        let refusal = self.answers.refusal(&self.senses.known(now), self.envelope.limits());
        if refusal.is_some() && !moving {
            return refusal;
        }
        self.senses.use_frame(view.frame.id);
        self.leg.rest.is_needed = false;
        let output = self.policy.handle(PolicyEvent::Frame(&view));
        self.carry_out(now, output, &view)
    }

    /// The target that is followed, if there is one. For recording.
    #[must_use]
    pub fn followed(&self, now: Time) -> Option<TargetEstimate> {
        let following = self.target.following.as_ref().filter(|_| self.leg.is_following())?;
        following.target(now, self.senses.known(now).position)
    }

    /// Whether the craft moves along with a target that walks: it cannot wait for it at rest.
    fn goes_along(&self, now: Time) -> bool {
        self.followed(now).is_some_and(|target| walks(&target))
    }

    /// Whether a frame taken at `pose` should show the target.
    fn expected(&self, now: Time, pose: Pose) -> Expected {
        let tracked = self.target.following.as_ref();
        let camera = &self.senses.camera;
        if let Some(expected) = tracked.and_then(|following| following.expected(now, camera, pose, self.followed(now))) {
            return expected;
        }
        let here = Here { at: pose.position, odometry: self.senses.odometry_at(now) };
        let Some(sight) = self.target.sight(here) else { return Expected::Unknown };
        // The direction to a target that is almost reached is not known.
        if sight.lateral_sd > 0.5 * sight.range {
            return Expected::Unknown;
        }
        let anchor = self.target.anchor();
        let in_view = anchor.and_then(|anchor| anchor.image_point(camera, pose, self.settings.lifting));
        match in_view {
            Some(at) if !self.space.hides(pose.position, sight.position, sight.range) => {
                Expected::InView { at, range: sight.range }
            }
            // Only a map permits the pilot to climb or sink to it; the policy's search does so otherwise.
            None if !self.is_mapped() && correction(camera, pose, sight.position).is_some() => Expected::Unknown,
            _ => Expected::Aside,
        }
    }

    /// How far the target is from where a frame was taken.
    fn reckoned(&self, now: Time, pose: Pose) -> Option<Reckoned> {
        let anchor = self.target.anchor()?;
        let sight = anchor.seen_from(pose.position, self.senses.odometry_at(now));
        Some(Reckoned { stage: anchor.stage, range: sight.range, sd: sight.range_sd })
    }

    fn ask(&mut self, now: Time, query: Box<Query>, view: View) {
        let id = query.id;
        match self.queries.open(now, query, view, &self.settings) {
            Some(query) => self.outbox.push(Action::Ask(query)),
            None => _ = self.policy.handle(PolicyEvent::ReplyFailed { id }),
        }
    }

    // ---- Point: replies ----

    /// Takes the complete reply to a query.
    pub(crate) fn replied(&mut self, now: Time, id: QueryId, text: &str) -> Ended {
        let asked = self.close(now, id)?;
        // Motion that began as it arrived does not outdate it.
        if let Some(reason) = self.outdated(now, &asked.view).filter(|_| !asked.has_decided) {
            return self.set_aside(now, id, &asked.view, reason);
        }
        let pose = self.senses.known(now).pose();
        let output = self.policy.handle(PolicyEvent::Reply { id, text, arrived: now, pose });
        self.envelope.observe_reply(now, !matches!(output.step, Step::Reject(_)));
        if decides(&output.step, &asked.query) && !asked.has_decided {
            self.answers.decided(&self.senses.known(now));
        }
        self.learn(now, &asked, &output);
        let decision = self.decision(now, &asked, text, &output);
        self.outbox.note(Note::Decision(Box::new(decision)));
        self.carry_out(now, output, &asked.view)
    }

    fn close(&mut self, now: Time, id: QueryId) -> Option<Asked> {
        let asked = self.queries.close(now, id);
        if asked.is_none() {
            self.outbox.note(Note::LateReply(id));
        }
        asked
    }

    /// Takes part of a streamed reply.
    pub(crate) fn chunk(&mut self, now: Time, id: QueryId, text: &str) -> Ended {
        let asked = self.queries.get(id)?;
        let view = asked.view;
        // The complete reply is set aside when it arrives.
        if !asked.has_decided && self.outdated(now, &view).is_some() {
            return None;
        }
        let output = self.policy.handle(PolicyEvent::Chunk { id, text });
        if self.queries.decides_early(id, &output.step) {
            self.answers.decided(&self.senses.known(now));
        }
        self.carry_out(now, output, &view)
    }

    /// Takes the failure of a query.
    pub(crate) fn reply_failed(&mut self, now: Time, id: QueryId, reason: String) -> Ended {
        let asked = self.close(now, id)?;
        self.give_up(now, id, &asked.view, reason)
    }

    /// Cancels queries whose deadline has passed. The VLM client is notified, and a late reply has no effect.
    pub(crate) fn expire_queries(&mut self, now: Time) -> Ended {
        while let Some((id, asked)) = self.queries.expired(now) {
            self.outbox.push(Action::Cancel(id));
            let reason = format!("no reply within {} s", self.settings.reply_timeout.as_secs_f64());
            let ended = self.give_up(now, id, &asked.view, reason);
            if ended.is_some() {
                return ended;
            }
        }
        None
    }

    /// Why a reply on this frame must move nothing now; `None` if it may. A craft that has held since the capture may use
    /// a reply of any age.
    fn outdated(&self, now: Time, view: &View) -> Option<String> {
        let captured = view.frame.captured;
        if self.leg.rest.holds_since(captured) {
            return None;
        }
        let (age, limit) = (now.since(captured), self.settings.max_reply_age);
        if age > limit {
            let (age, limit) = (age.as_secs_f64(), limit.as_secs_f64());
            return Some(format!("its frame is {age:.1} s old (limit {limit} s), and the craft has flown on"));
        }
        self.senses.lost_since(now, view)
    }

    /// Cancels the queries on frames after which the camera has stopped, unless the craft was at rest: where it has gone
    /// since was not seen (a game that hangs does not move it, whatever was commanded), so that their answers would be
    /// flown from another place.
    pub(crate) fn set_aside_unseen(&mut self, now: Time) -> Ended {
        for id in self.queries.which(|asked| !self.leg.rest.holds_since(asked.view.frame.captured)) {
            let Some(asked) = self.queries.cancel(id) else { continue };
            self.outbox.push(Action::Cancel(id));
            let ended = self.set_aside(now, id, &asked.view, "the camera stopped after its frame".to_owned());
            if ended.is_some() {
                return ended;
            }
        }
        None
    }

    /// Sets a reply aside: the craft holds, and the next query is based on a frame taken at rest, whose reply may take any
    /// time. Not a failed reply, since the VLM has answered; nor a good one.
    fn set_aside(&mut self, now: Time, id: QueryId, view: &View, reason: String) -> Ended {
        self.stop_motion(now);
        self.leg.rest.is_needed = true;
        self.query_failed(now, id, view, reason)
    }

    fn give_up(&mut self, now: Time, id: QueryId, view: &View, reason: String) -> Ended {
        self.envelope.observe_reply(now, false);
        self.stop_motion(now);
        self.query_failed(now, id, view, reason)
    }

    /// Tells the policy that a query has no answer, and does what it makes of that.
    fn query_failed(&mut self, now: Time, id: QueryId, view: &View, reason: String) -> Ended {
        self.outbox.note(Note::QueryFailed { id, reason });
        let output = self.policy.handle(PolicyEvent::ReplyFailed { id });
        self.carry_out(now, output, view)
    }

    /// Cancels all open queries. The policy is notified, otherwise it would wait forever, but its answer is not carried
    /// out: the operator has taken over or the flight is over.
    pub(crate) fn cancel_queries(&mut self) {
        for id in self.queries.take_all() {
            self.outbox.push(Action::Cancel(id));
            self.policy.handle(PolicyEvent::ReplyFailed { id });
        }
    }

    /// Takes what a reply says about target and surroundings, at its frame's time and pose.
    fn learn(&mut self, now: Time, asked: &Asked, output: &Output) {
        let from = asked.view.viewpoint();
        let odometry = self.senses.odometry_at(from.captured);
        let Output { step, reading } = output;
        let goto = if let Step::Goto(goto) = step { Some(goto) } else { None };
        self.target.learn(now, &from, odometry, goto, self.settings.lifting, self.queries.oldest_capture());
        if let Some(reply) = &reading.reply {
            // A search has begun: the target is not where it was thought to be. What is only hidden, and is waited for, is.
            if reply.status == Status::NotVisible && !matches!(step, Step::Keep | Step::Look) {
                self.target.give_up();
            }
            let at = self.senses.known(now).position;
            let is_point = matches!(asked.query.kind, QueryKind::Point { .. });
            if let Some(mapped) = self.space.mapped.as_mut().filter(|_| is_point) {
                mapped.reply(now, at, &from, reply, self.settings.method.measures_view());
            }
        }
        let Some(following) = &mut self.target.following else { return };
        following.learn(&asked.view, output);
        if let Some(reply) = &reading.reply {
            self.space.boxes(from, reply);
            if !matches!(step, Step::Reject(_)) {
                let asked_for = matches!(asked.query.kind, QueryKind::Point { avoid: true, .. });
                self.space.reply(from, odometry, reply, asked_for);
            }
        }
        match following.track_reply(asked.query.id, &asked.view, output) {
            Some(TrackNews::Track(start)) => self.outbox.push(Action::Track(start)),
            Some(TrackNews::Untrack) => self.outbox.push(Action::Untrack),
            None => {}
        }
    }

    fn decision(&self, now: Time, asked: &Asked, text: &str, output: &Output) -> Decision {
        let step = &output.step;
        let (goal, passed) = self.planned(now, step);
        let decided = self.answers.decisions();
        let number = if decides(step, &asked.query) || asked.has_decided { decided } else { decided + 1 };
        let view = &asked.view;
        Decision {
            number,
            query: (*asked.query).clone(),
            reply: text.to_owned(),
            reading: output.reading.clone(),
            step: step.word().to_owned(),
            frame: view.frame.id,
            captured: view.frame.captured,
            queried_at: asked.at,
            answered: now,
            frame_age_s: now.since(view.frame.captured).as_secs_f64(),
            latency_s: now.since(asked.at).as_secs_f64(),
            pose: view.pose,
            pose_at_reply: self.senses.known(now).pose(),
            goal,
            passed,
            anchor: self.target.report(view.pose, self.senses.odometry_at(now)),
        }
    }

    /// The world pose at which a move from a frame ends, and whether the craft is already past it.
    fn planned(&self, now: Time, step: &Step) -> (Option<Pose>, bool) {
        let motion = match step {
            Step::Move(motion) => motion,
            Step::Goto(goto) => match self.lead(now, goto) {
                Lead::Step(_) => &goto.motion,
                Lead::Turn(_) => return (None, true),
                Lead::Fly { goal, .. } => return (Some(pose_of(goal)), false),
                Lead::Stay => return (None, false),
            },
            _ => return (None, false),
        };
        let known = self.senses.known(now);
        let Some(from) = motion.anchor else {
            // An unanchored move starts at the craft's current pose.
            return (Some(pose_of(Goal::of_primitives(known.pose(), motion.primitives))), false);
        };
        let goal = Goal::of_primitives(from, motion.primitives);
        let passed = self.settings.think == QueryTiming::Continuous
            && !motion.then_rest
            && !self.waits_for_queue()
            && self.leg.is_past(now, &known, goal, from.position);
        (Some(pose_of(goal)), passed)
    }

    // ---- Fly: steps become motions ----

    /// Carries out a step, and requests further steps from the policy until it waits.
    pub(crate) fn carry_out(&mut self, now: Time, output: Output, view: &View) -> Ended {
        let ended = self.answers.take(&output, self.envelope.limits());
        if ended.is_some() {
            return ended;
        }
        let mut output = output;
        for _ in 0..STEPS_AT_ONCE {
            let (is_second_look, before_person) = (output.reading.is_done(), output.reading.is_before_person);
            self.leg.centre = output.step.place(view);
            match output.step {
                Step::Ask(query) => self.ask(now, query, *view),
                Step::Move(motion) => self.begin_move(now, motion),
                Step::Goto(goto) => self.begin_lead(now, self.lead(now, &goto)),
                Step::Follow(goto) => self.begin_following(now, &goto),
                Step::Keep => self.keep_on(now, view),
                // A second look at somebody who walks: at rest, the craft would lose them.
                Step::Look if is_second_look && self.goes_along(now) => return None,
                Step::Look => {
                    self.stop_motion(now);
                    self.leg.rest.is_needed = true;
                    return None;
                }
                Step::Wait => return None,
                Step::Done => return Some(Ending::new(Outcome::Reached, "the instruction is fulfilled")),
                Step::Reject(_) => {
                    self.stop_motion(now);
                    return None;
                }
                Step::Fail(reason) => return Some(Ending::given_up(reason)),
            }
            // Who stays with somebody who walks never rests.
            self.leg.rest.is_needed |= before_person && !self.leg.is_following();
            output = self.policy.handle(PolicyEvent::Continue);
        }
        None
    }

    /// Whether plans lead around the obstacles of a map.
    fn is_mapped(&self) -> bool {
        self.space.mapped.is_some() && self.settings.is_guided()
    }

    /// Sequential motion that is always replaced, or stopped because its goal was passed, never climbs: the next plan
    /// waits for its end.
    fn waits_for_queue(&self) -> bool {
        self.settings.motion != Motion::Blended && self.leg.is_moving()
    }

    fn here(&self, now: Time) -> Here {
        Here { at: self.senses.known(now).position, odometry: self.senses.odometry_at(now) }
    }

    /// The consequence of a sighting that has been taken.
    fn lead(&self, now: Time, goto: &Goto) -> Lead {
        // A craft that measures what is in view is led by its planner.
        let by_boxes = self.settings.avoid && !self.settings.method.measures_view();
        self.not_back(now, self.target.lead(goto, self.here(now), by_boxes))
    }

    /// A goal that has been passed is only turned to.
    fn not_back(&self, now: Time, lead: Lead) -> Lead {
        match lead {
            Lead::Fly { from, goal, bearing, .. } if self.leg.is_past(now, &self.senses.known(now), goal, from) => {
                Lead::Turn(bearing)
            }
            lead => lead,
        }
    }

    fn begin_lead(&mut self, now: Time, lead: Lead) {
        if self.flight.link_lost {
            return self.refuse_move(now);
        }
        match lead {
            Lead::Step(motion) => self.begin_move(now, motion),
            Lead::Turn(heading) => self.turn_alone(now, heading),
            Lead::Stay => {}
            Lead::Fly { from, reach, .. } if self.is_mapped() => self.set_course(now, Aim::Target, from, reach, false),
            Lead::Fly { goal, .. } => {
                self.leg.executor.start_goal(now, self.senses.known(now), goal);
                self.leg.start(now, State::Moves, false);
            }
        }
    }

    /// Goes on to a target that the last frame did not show.
    fn keep_on(&mut self, now: Time, view: &View) {
        if self.leg.is_following() {
            return;
        }
        let here = self.here(now);
        let Some(sight) = self.target.sight(Here { at: view.pose.position, ..here }) else { return };
        if self.is_mapped() {
            if sight.is_sure() && self.bring_into_view(now, sight.position) {
                return;
            }
            if let Some(lead) = self.target.lead_unseen(here, view.pose.position) {
                return self.begin_lead(now, self.not_back(now, lead));
            }
        }
        if view.expected == Expected::Aside {
            self.turn_alone(now, here.at.bearing_to(sight.position));
        }
    }

    pub(crate) fn begin_move(&mut self, now: Time, motion: Move) {
        if self.flight.link_lost {
            self.leg.leave_course();
            return self.refuse_move(now);
        }
        if self.look_by_gimbal(now, &motion) {
            return;
        }
        let Some(motion) = self.admissible(now, motion) else {
            self.leg.leave_course();
            return self.refuse_move(now);
        };
        let known = self.senses.known(now);
        if self.is_mapped() && motion.primitives.forward > TURN_ONLY {
            let from = motion.anchor.unwrap_or(known.pose());
            let goal = Goal::of_primitives(from, motion.primitives);
            if self.leg.is_past(now, &known, goal, from.position) {
                return self.turn_past(now, goal.heading);
            }
            // A plan to a place that counts as reached would leave out the turn to it.
            if known.position.distance(goal.position) > AT_PLACE {
                let reach = from.position.distance(goal.position) + AT_PLACE;
                return self.set_course(now, Aim::Place(goal.position, goal.heading), from.position, reach, motion.then_rest);
            }
        }
        self.leg.leave_course();
        let executor = &mut self.leg.executor;
        match motion.anchor {
            Some(from) if self.settings.think == QueryTiming::Continuous && !motion.then_rest => {
                if self.waits_for_queue() {
                    self.leg.pending = Some(motion);
                    return;
                }
                let goal = Goal::of_primitives(from, motion.primitives);
                // In closed-loop tests, flying back to a passed goal failed in up to half of the runs.
                if self.leg.is_past(now, &known, goal, from.position) {
                    return self.turn_past(now, goal.heading);
                }
                if self.settings.motion == Motion::Blended {
                    self.leg.executor.start_goal(now, known, goal);
                } else {
                    let left = rest_of_plan(known.position, known.attitude.heading, goal);
                    self.leg.executor.start(now, known, left);
                }
            }
            Some(from) if motion.then_rest => {
                // A search turn is measured from the frame that requested it, so what was turned since counts.
                let turned = wrap_angle(known.attitude.heading - from.attitude.heading);
                executor.start(now, known, Primitives { yaw: motion.primitives.yaw - turned, ..motion.primitives });
            }
            _ => executor.start(now, known, motion.primitives),
        }
        self.leg.start(now, State::Moves, motion.then_rest);
    }

    /// Turns to where a passed plan led, and no farther than to centre what its reply pointed at; a target that is nearer than it is known
    /// to be is not turned to, which might be anywhere.
    fn turn_past(&mut self, now: Time, heading: f64) {
        let at = self.leg.executor.rest_position(now, self.senses.known(now));
        match self.leg.centre {
            Some(place) if place.horizontal_distance(at) < BESIDE => self.refuse_move(now),
            Some(place) => self.turn_alone(now, at.bearing_to(place)),
            None => self.turn_alone(now, heading),
        }
    }

    /// Turns to the heading of a passed plan where the craft comes to rest: otherwise its target, such as a person
    /// walking by, would leave the frame.
    fn turn_alone(&mut self, now: Time, heading: f64) {
        self.leg.leave_course();
        let known = self.senses.known(now);
        let yaw = wrap_angle(heading - known.attitude.heading);
        if yaw.abs() < WORTH_TURNING {
            return self.refuse_move(now);
        }
        let executor = &mut self.leg.executor;
        if self.settings.motion == Motion::Blended {
            let position = executor.rest_position(now, known);
            executor.start_goal(now, known, Goal { position, heading });
        } else {
            executor.start(now, known, Primitives { yaw, ..Primitives::default() });
        }
        self.leg.start(now, State::Moves, false);
    }

    /// Refuses a move; the policy is notified as if it had been cut short.
    fn refuse_move(&mut self, now: Time) {
        if self.leg.is_moving() {
            self.stop_motion(now);
        } else {
            self.policy.handle(PolicyEvent::MoveEnded { completed: false });
        }
    }

    /// Stops motion because its reason has ended: zero is sent at once, and the policy is notified that its move was
    /// cut short. The policy's answer is not carried out; it gets a frame once it may continue.
    pub(crate) fn stop_motion(&mut self, now: Time) {
        if self.leg.stop(now) {
            self.policy.handle(PolicyEvent::MoveEnded { completed: false });
        }
    }

    fn move_ended(&mut self, now: Time) -> Ended {
        self.leg.state = State::Rest;
        let output = match self.leg.pending.take() {
            Some(motion) => Step::Move(motion).into(),
            None => self.policy.handle(PolicyEvent::MoveEnded { completed: true }),
        };
        let view = self.senses.view?;
        self.carry_out(now, output, &view)
    }

    // ---- What a move must not do ----

    /// What is known of the way of a move that begins now.
    fn way(&self, now: Time) -> Way<'_> {
        let (senses, space, target, envelope) = (&self.senses, &self.space, &self.target, &self.envelope);
        Way { now, pose: senses.known(now).pose(), senses, space, target, envelope, avoid: self.settings.avoid }
    }

    /// The part of a move that may be flown; `None` if nothing is left of it.
    fn admissible(&mut self, now: Time, motion: Move) -> Option<Move> {
        let Admitted { motion, limited, climb } = self.way(now).admits(motion);
        limited.into_iter().for_each(|why| self.limited(why));
        if let Some((wanted, left)) = climb {
            self.answers.refused.climb(wanted, left);
        }
        motion
    }

    fn limited(&mut self, why: &'static str) {
        self.outbox.note(Note::Limited(why));
    }

    /// Climbs or sinks so that the next frame shows a target above or below the image, or flies back where that is not
    /// possible. Returns whether the target lies there.
    pub(crate) fn bring_into_view(&mut self, now: Time, target: EnuPosition) -> bool {
        let pose = self.senses.known(now).pose();
        let Some(Correction { climb, back }) = correction(&self.senses.tilted_camera(), pose, target) else { return false };
        let way = self.way(now);
        let room = way.within_room(climb.clamp(-AT_MOST, AT_MOST));
        // Boxes do not show what reaches over or under them.
        let is_safe = self.settings.method.measures_view() || !may_overhang(target, pose.position, room);
        let primitives = if room.abs() > WORTH_FLYING && is_safe && way.barred(room).is_none() {
            Primitives { climb: room, ..Primitives::default() }
        } else {
            Primitives { forward: -back.clamp(0.0, AT_MOST), ..Primitives::default() }
        };
        self.begin_move(now, Move { primitives, anchor: None, then_rest: true, looks: false });
        true
    }

    // ---- A camera on a gimbal ----

    /// Looks up or down by the gimbal, at rest, if a move is there for nothing but that view, and the gimbal can. Returns whether
    /// it does.
    pub(crate) fn look_by_gimbal(&mut self, now: Time, motion: &Move) -> bool {
        let climb = motion.primitives.climb;
        // It looks up or down from where the frame was taken, and not from where the craft has turned to meanwhile.
        let heading = self.senses.known(now).attitude.heading;
        if motion.anchor.is_some_and(|from| wrap_angle(heading - from.attitude.heading).abs() > TURNED_AWAY) {
            return false;
        }
        let heard = |report: &&GimbalReport| motion.looks && !report.aside && now.since(report.measured) < HEARD;
        let Some(report) = self.senses.gimbal.newest().filter(heard) else { return false };
        let camera = &self.senses.camera;
        let view = 2.0 * libm::atan(0.5 * f64::from(camera.height) / camera.fy);
        let wanted = report.tilt - LOOK * view * climb.signum();
        let tilt = wanted.max(report.range[0]).min(report.range[1]);
        if (tilt - report.tilt).abs() < WORTH_TILTING {
            return false;
        }
        // The move that this one replaces would go on without a limit.
        self.leg.tilt(now, tilt, now + ARRIVES);
        self.command(now, Command::Tilt(tilt));
        true
    }

    /// Ends a look when the gimbal has arrived, or does not; the next decision is made at rest.
    pub(crate) fn follow_gimbal(&mut self, now: Time) -> Ended {
        let State::Tilts(tilt, until) = self.leg.state else { return None };
        let arrived = self.senses.gimbal.newest().is_some_and(|report| (report.tilt - tilt).abs() < ARRIVED);
        let is_flying = self.flight.phase == Phase::Flying;
        if is_flying && !arrived && now < until {
            return None;
        }
        self.leg.state = State::Rest;
        if !is_flying {
            return None;
        }
        self.leg.rest.begin(now);
        self.leg.rest.is_needed = true;
        let output = self.policy.handle(PolicyEvent::MoveEnded { completed: true });
        let view = self.senses.view?;
        self.carry_out(now, output, &view)
    }

    // ---- A target that moves ----

    /// Takes a report on the track of the target.
    pub(crate) fn track_report(&mut self, now: Time, report: TrackReport) {
        // A camera clock that runs ahead must not make all its later frames look old.
        let report = TrackReport { captured: report.captured.min(now), ..report };
        let pose = self.senses.camera_pose_at(report.captured);
        let Some(following) = &mut self.target.following else { return };
        if following.report(&report)
            && let Some(pose) = pose
            && following.tracked(now, &report, pose)
            && self.leg.is_moving()
        {
            self.stay_with_target(now);
        }
    }

    /// Stays with the target from now on. What is in the way is flown around first; and without a track, for instance of a
    /// target that is still too small, the reply's own step is flown, no nearer than the distance to keep.
    fn begin_following(&mut self, now: Time, goto: &Goto) {
        let link_lost = self.flight.link_lost;
        if self.target.following.as_ref().is_some_and(|following| !link_lost && following.can_begin(now, goto)) {
            return self.stay_with_target(now);
        }
        let step = self.target.following.as_ref().map_or(goto.motion.primitives, |following| following.step_to(goto));
        self.begin_move(now, Move { primitives: step, ..goto.motion });
        let is_flown = self.leg.is_moving();
        if let Some(following) = &mut self.target.following {
            following.wait(goto, is_flown);
        }
    }

    fn stay_with_target(&mut self, now: Time) {
        if let Some(following) = self.target.following.as_mut().filter(|_| !self.leg.is_following()) {
            following.begin(now);
            self.leg.executor.stop(now);
        }
        self.leg.start(now, State::Follows, false);
    }

    /// The setpoint that stays with the target; a hold, and the end of it, if the target is lost.
    fn follow_target(&mut self, now: Time, known: &MotionEstimate) -> Result<Setpoint, Ending> {
        let at = known.position;
        let following = self.target.following.as_mut();
        let Some((following, target)) =
            following.and_then(|following| following.target(now, at).map(|target| (following, target)))
        else {
            self.stop_motion(now);
            return Ok(Setpoint::HOLD);
        };
        if let Some(time) = following.is_enough(now, &target) {
            return Err(Ending::new(Outcome::Reached, format!("the target was followed for {} s", time.as_secs_f64())));
        }
        let (camera, odometry) = (&self.senses.camera, self.senses.odometry_at(now));
        let space = &self.space;
        let way_out = following.way_out(at, &target, |to| space.is_way_out(now, camera, odometry, [at, to]));
        Ok(following.setpoint(now, known, &self.craft, &target, way_out))
    }

    /// Tells the envelope where somebody is with whom the craft stays, whatever it does; and the brake, while it flies with
    /// them, of the boxes of replies. Otherwise each step has been checked against its own reply.
    fn tell_of_person(&mut self, now: Time, at: EnuPosition) {
        let person = self.target.following.as_ref().and_then(|following| following.target(now, at));
        if let Some(person) = person {
            self.envelope.observe_person(now, person.position);
        }
    }

    fn brake_for_boxes(&mut self, now: Time) {
        let (follows, is_mapped) = (self.leg.is_following(), self.is_mapped());
        let Some(following) = self.target.following.as_mut().filter(|_| !is_mapped) else { return };
        if follows {
            self.envelope.observe_obstacles(self.space.panels(now));
        } else if following.brakes {
            self.envelope.observe_obstacles(core::iter::empty());
        }
        following.brakes = follows;
    }

    // ---- A course along plans ----

    fn set_course(&mut self, now: Time, aim: Aim, from: EnuPosition, reach: f64, then_rest: bool) {
        let last = self.leg.take_course().map(|course| *course);
        let (course, goes_on) = Course::new(aim, from, reach, last);
        if let Some(mapped) = self.space.mapped.as_mut().filter(|_| !goes_on) {
            mapped.progress.reset();
        }
        self.leg.start(now, State::Course(Box::new(course)), then_rest);
    }

    /// Renews the plan of the course, if it is time.
    fn follow_course(&mut self, now: Time, known: &MotionEstimate) -> Ended {
        let at = known.position;
        self.tell_brake(now, at);
        let course = self.leg.course().filter(|course| course.is_due(now))?;
        if course.is_flown(at) {
            return self.end_course(now);
        }
        let Some(goal) = course.place().or_else(|| self.target_destination(now, at)) else { return self.end_course(now) };
        let body = self.body(now, at);
        let (State::Course(course), Some(mapped)) = (&mut self.leg.state, &mut self.space.mapped) else {
            return self.end_course(now);
        };
        let speed = self.craft.cruise_speed;
        let renewed = course.renew(now, known, speed, (&body, &goal), mapped, &mut self.leg.executor);
        let (around, is_stuck) = match renewed {
            Renewed::GoesOn(around) => (around, false),
            Renewed::Stuck(around) => (around, true),
            Renewed::Ended => return self.end_course(now),
        };
        if let Some(around) = around {
            self.outbox.note(Note::Around(around));
        }
        if !is_stuck {
            return None;
        }
        self.limited("no progress around the obstacle: holds and queries the VLM again");
        let ended = self.end_course(now);
        self.leg.rest.is_needed = true;
        ended
    }

    /// The target as the destination of a course; `None` if it is not known, or was passed: never back.
    fn target_destination(&self, now: Time, at: EnuPosition) -> Option<Destination> {
        let anchor = self.target.anchor()?;
        let odometry = self.senses.odometry_at(now);
        if anchor.is_passed(at, odometry) {
            return None;
        }
        let sight = anchor.seen_from(at, odometry);
        let sigma = libm::hypot(sight.range_sd, sight.lateral_sd);
        Some(Destination::target(sight.position, self.target.stop_distance(), sigma))
    }

    fn body(&self, now: Time, at: EnuPosition) -> Body {
        let drift = self.senses.odometry_at(now - DRIFTING).drift_to(self.senses.odometry_at(now));
        let (down, up) = self.envelope.altitude_room();
        Body {
            radius: self.craft.radius,
            position_sigma: drift.horizontal.sqrt(),
            braking: BRAKING * self.craft.acceleration,
            delay: self.craft.dead_time + self.craft.lag + PLAN_PERIOD.as_secs_f64(),
            cruise_speed: self.craft.cruise_speed,
            altitudes: (at.up - down.max(0.0), at.up + up.max(0.0)),
            half_view: self.senses.camera.half_fov(),
        }
    }

    /// Ends the course; a craft that has flown around something turns to its target, so that the next frame shows it.
    fn end_course(&mut self, now: Time) -> Ended {
        let course = self.leg.take_course()?;
        if let Some(mapped) = &mut self.space.mapped {
            mapped.progress.reset();
        }
        let known = self.senses.known(now);
        let target = self.target.anchor().filter(|_| course.aim == Aim::Target).map(crate::anchor::Anchor::position);
        if let Some(target) = target.filter(|target| target.horizontal_distance(known.position) > AT_PLACE) {
            let heading = known.position.bearing_to(target);
            if wrap_angle(heading - known.attitude.heading).abs() > LOOK_BACK {
                let position = self.leg.executor.rest_position(now, known);
                self.leg.executor.start_goal(now, known, Goal { position, heading });
                return None;
            }
        }
        self.leg.executor.stop(now);
        self.move_ended(now)
    }

    /// Passes the obstacles near the craft to the brake.
    fn tell_brake(&mut self, now: Time, at: EnuPosition) {
        if self.envelope.limits().brake.is_none() {
            return;
        }
        if let Some(near) = self.space.mapped.as_mut().and_then(|mapped| mapped.for_brake(now, at)) {
            self.envelope.observe_obstacles(near);
        }
    }

    // ---- Motions become setpoints ----

    /// Sends one setpoint. Zero is sent too, so that no craft lands for lack of commands while a VLM thinks.
    pub(crate) fn tick(&mut self, now: Time) -> Ended {
        if !matches!(self.flight.phase, Phase::Flying | Phase::Held | Phase::Manual | Phase::Hovering) {
            return None;
        }
        let known = self.senses.known(now);
        self.leg.rest.settle(now, &known, &self.craft);
        self.envelope.observe_motion(now, &known);
        self.tell_of_person(now, known.position);
        let mut finished = false;
        let clearance = match self.flight.by_hand(now) {
            Some(setpoint) => {
                self.leg.wanted = setpoint;
                self.envelope.clear_manual(now, setpoint)
            }
            None => {
                let mut setpoint = Setpoint::HOLD;
                if self.leg.is_moving() && !self.leg.is_following() {
                    let ended = self.follow_course(now, &known);
                    if ended.is_some() {
                        return ended;
                    }
                }
                self.brake_for_boxes(now);
                if self.leg.is_following() {
                    match self.follow_target(now, &known) {
                        Ok(follows) => setpoint = follows,
                        Err(ended) => return Some(ended),
                    }
                } else if self.leg.is_moving() {
                    let tick = self.leg.executor.tick(now, known);
                    match tick.manoeuvre {
                        // Nothing is sent meanwhile: a hold would end the manoeuvre, and `stop_motion` sends one when
                        // its reason ends.
                        Some(OwnFlight::UnderWay) => return None,
                        Some(OwnFlight::Begin(manoeuvre)) => {
                            self.begin_manoeuvre(now, manoeuvre);
                            return None;
                        }
                        None => (setpoint, finished) = (tick.setpoint, tick.finished),
                    }
                }
                self.leg.wanted = setpoint;
                self.envelope.clear_setpoint(now, setpoint)
            }
        };
        finished |= !self.leg.is_following() && self.leg.is_kept_still(now, &clearance);
        self.send(now, clearance);
        if finished && self.leg.course().is_none() { self.move_ended(now) } else { None }
    }

    /// Starts a manoeuvre as limited by the envelope. If the envelope does not allow it to start, the move ends.
    fn begin_manoeuvre(&mut self, now: Time, manoeuvre: Manoeuvre) {
        self.leg.wanted = Setpoint::HOLD;
        let clearance = self.envelope.clear_manoeuvre(now, manoeuvre);
        self.answers.refused.manoeuvre(manoeuvre, &clearance);
        let held = clearance.setpoint().is_some();
        self.send(now, clearance);
        if held {
            self.stop_motion(now);
        }
    }

    fn send(&mut self, now: Time, clearance: ClearedCommand) {
        if let Command::Setpoint(setpoint) = clearance.cleared.get() {
            self.senses.estimator.commanded(now, *setpoint);
        }
        self.leg.sent(now, &clearance);
        let tick = 1.0 / self.settings.rate_hz;
        self.answers.refused.setpoint(self.envelope.limits(), self.leg.wanted, &clearance, tick);
        self.outbox.change(clearance.changed);
        self.outbox.push(Action::Command(clearance.cleared));
    }

    /// Sends a command that the envelope always passes: land, tilt or emergency stop.
    pub(crate) fn command(&mut self, now: Time, command: Command) {
        if let Ok(clearance) = self.envelope.clear(now, command) {
            self.outbox.push(Action::Command(clearance.cleared));
        }
    }
}
