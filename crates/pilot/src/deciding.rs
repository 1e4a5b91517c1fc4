//! Frames, queries, replies and the steps that follow.

use super::{Action, Decision, Note, Outcome, Phase, Pilot, QueryTiming, Waiting};
use crate::policy::{Expected, FailReason, Output, PolicyEvent, Step, View};
use spf_core::frame::{FrameMeta, Unusable};
use spf_core::geometry::wrap_angle;
use spf_core::query::{Query, QueryId, QueryKind, VerticalRoom};
use spf_core::time::{Duration, Time};
use spf_envelope::{Cause, Reaction};

/// Maximum number of steps of a policy at one instant; more means a policy that never waits.
const STEPS_AT_ONCE: usize = 16;
/// Maximum number of open queries; further ones are cancelled at once.
const QUERIES_AT_ONCE: usize = 8;
/// Minimum reply timeout: a query that expires as it is sent would be repeated forever.
const LEAST_TIMEOUT: Duration = Duration::from_millis(100);
/// A reply moves nothing if the craft has moved farther than this since its frame, metres, and its pose is unknown.
const MOVED: f64 = 0.5;
/// The same for turning, radians: 10°.
const TURNED: f64 = 10.0 / 180.0 * core::f64::consts::PI;

impl Pilot {
    pub(super) fn frame(&mut self, now: Time, frame: FrameMeta) {
        // A camera clock that runs ahead must not make all its later frames look old.
        let mut frame = FrameMeta { captured: frame.captured.min(now), ..frame };
        if !self.gimbal.reports.looks_ahead(frame.captured) {
            frame.unusable = frame.unusable.or(Some(Unusable::Aside));
        }
        self.envelope.observe_frame(now, &frame);
        let newer = self
            .view
            .is_none_or(|view| frame.captured > view.frame.captured && frame.capture_counter != view.frame.capture_counter);
        if let Some(known) = self.camera_pose_at(frame.captured).filter(|_| newer && frame.unusable.is_none()) {
            let odometry = self.estimator.odometry_at(frame.captured);
            self.seen.frame(frame.captured, known, odometry);
            self.map_frame(now, frame.captured, known);
            let (room, expected) = (VerticalRoom::default(), Expected::Unknown);
            self.view = Some(View { frame, camera: self.camera, pose: known, at_rest: false, room, expected });
        }
    }

    /// Passes the newest frame to the policy when a decision is due.
    pub(super) fn decide(&mut self, now: Time) {
        if self.phase != Phase::Flying || self.link_lost || self.is_tilting() {
            return;
        }
        // Only a good reply ends a hold for failed replies, so one must be requested.
        if !matches!(self.envelope.reaction(now), Reaction::Continue | Reaction::Hold(Cause::FailedReplies)) {
            return;
        }
        let Some(mut view) = self.view else { return };
        // Checked now and not when the frame arrived: the craft may have moved since.
        view.at_rest = self.settled.is_some_and(|settled| view.frame.captured >= settled);
        // Beside somebody who walks there is no other rest.
        view.at_rest |= self.goes_along(now);
        if !self.waiting.is_empty() {
            return;
        }
        view.room = self.envelope.room();
        view.expected = self.expected(now, view.pose);
        let from_rest = self.needs_rest || self.settings.think == QueryTiming::Stop;
        if self.used == Some(view.frame.id) || (from_rest && (self.executing || !view.at_rest)) {
            return;
        }
        if self.counted_decisions() >= self.settings.max_decisions {
            if self.executing {
                return; // The last plan is flown to its end.
            }
            let limit = self.settings.max_decisions;
            let held_back = self.held_back(now);
            return self.end_instruction(now, Outcome::Timeout, format!("the limit of {limit} decisions was reached{held_back}"));
        }
        self.used = Some(view.frame.id);
        self.needs_rest = false;
        let output = self.policy.handle(PolicyEvent::Frame(&view));
        self.carry_out(now, output, &view);
    }

    pub(super) fn reply(&mut self, now: Time, id: QueryId, text: &str) {
        let Some(waiting) = self.waiting.remove(&id) else {
            self.late_replies += 1;
            return self.note(Note::LateReply(id));
        };
        // Motion that began as it arrived does not outdate it.
        if let Some(reason) = self.outdated(now, &waiting.view).filter(|_| !waiting.decided) {
            return self.set_aside(now, id, &waiting.view, reason);
        }
        let output = self.policy.handle(PolicyEvent::Reply { id, text });
        self.envelope.observe_reply(now, !matches!(output.step, Step::Reject(_)));
        if decides(&output.step, &waiting.query) && !waiting.decided {
            self.decisions += 1;
        }
        self.learn(now, &waiting, &output);
        self.track_reply(&waiting, &output);
        let (goal, passed) = self.planned(now, &output.step);
        let decision = self.decision(now, &waiting, text, &output, goal, passed);
        self.note(Note::Decision(Box::new(decision)));
        self.carry_out(now, output, &waiting.view);
    }

    pub(super) fn chunk(&mut self, now: Time, id: QueryId, text: &str) {
        let Some(waiting) = self.waiting.get(&id) else { return };
        let view = waiting.view;
        // The complete reply is set aside when it arrives.
        if !waiting.decided && self.outdated(now, &view).is_some() {
            return;
        }
        let output = self.policy.handle(PolicyEvent::Chunk { id, text });
        if let Some(waiting) = self.waiting.get_mut(&id)
            && decides(&output.step, &waiting.query)
            && !core::mem::replace(&mut waiting.decided, true)
        {
            self.decisions += 1;
        }
        self.carry_out(now, output, &view);
    }

    pub(super) fn reply_failed(&mut self, now: Time, id: QueryId, reason: String) {
        let Some(waiting) = self.waiting.remove(&id) else {
            self.late_replies += 1;
            return self.note(Note::LateReply(id));
        };
        self.give_up(now, id, &waiting.view, reason);
    }

    /// Cancels queries whose deadline has passed. The VLM client is notified, and a late reply has no effect.
    pub(super) fn expire_queries(&mut self, now: Time) {
        while let Some(id) = self.waiting.iter().find(|(_, waiting)| waiting.query.deadline <= now).map(|(id, _)| *id) {
            if let Some(waiting) = self.waiting.remove(&id) {
                self.outbox.push_back(Action::Cancel(id));
                let reason = format!("no reply within {} s", self.settings.reply_timeout.as_secs_f64());
                self.give_up(now, id, &waiting.view, reason);
            }
        }
    }

    /// Why a reply on this frame must move nothing now; `None` if it may. A craft that has held since the capture may use
    /// a reply of any age.
    fn outdated(&self, now: Time, view: &View) -> Option<String> {
        let captured = view.frame.captured;
        if self.is_at_rest_since(captured) {
            return None;
        }
        let (age, limit) = (now.since(captured), self.settings.max_reply_age);
        if age > limit {
            let (age, limit) = (age.as_secs_f64(), limit.as_secs_f64());
            return Some(format!("its frame is {age:.1} s old (limit {limit} s), and the craft has flown on"));
        }
        if self.estimator.is_tracked_since(captured, now) {
            return None;
        }
        let at = self.estimator.reckoned(now)?.pose();
        let moved = at.position.distance(view.pose.position);
        let turned = wrap_angle(at.attitude.heading - view.pose.attitude.heading).abs();
        let unknown = "since the frame, estimated from commands alone, as its pose is unknown";
        if moved > MOVED {
            Some(format!("the craft has moved {moved:.1} m {unknown}"))
        } else if turned > TURNED {
            Some(format!("the craft has turned {:.0}° {unknown}", turned.to_degrees()))
        } else {
            None
        }
    }

    /// Whether the craft has held since that time.
    fn is_at_rest_since(&self, captured: Time) -> bool {
        self.settled.is_some_and(|settled| settled <= captured)
    }

    /// Cancels the queries on frames after which the camera has stopped, unless the craft was at rest: where it has gone
    /// since was not seen (a game that hangs does not move it, whatever was commanded), so that their answers would be
    /// flown from another place.
    pub(super) fn set_aside_unseen(&mut self, now: Time) {
        let in_motion = |waiting: &Waiting| !self.is_at_rest_since(waiting.view.frame.captured);
        let unseen: Vec<QueryId> = self.waiting.iter().filter(|(_, waiting)| in_motion(waiting)).map(|(id, _)| *id).collect();
        for id in unseen {
            if let Some(waiting) = self.waiting.remove(&id) {
                self.outbox.push_back(Action::Cancel(id));
                self.set_aside(now, id, &waiting.view, "the camera stopped after its frame".to_owned());
            }
        }
    }

    /// Sets a reply aside: the craft holds, and the next query is based on a frame taken at rest, whose reply may take any
    /// time. Not a failed reply, since the VLM has answered; nor a good one.
    fn set_aside(&mut self, now: Time, id: QueryId, view: &View, reason: String) {
        self.stop_motion(now);
        self.needs_rest = true;
        self.query_failed(now, id, view, reason);
    }

    fn give_up(&mut self, now: Time, id: QueryId, view: &View, reason: String) {
        self.envelope.observe_reply(now, false);
        self.stop_motion(now);
        self.query_failed(now, id, view, reason);
    }

    /// Tells the policy that a query has no answer, and does what it makes of that.
    fn query_failed(&mut self, now: Time, id: QueryId, view: &View, reason: String) {
        self.note(Note::QueryFailed { id, reason });
        let output = self.policy.handle(PolicyEvent::ReplyFailed { id });
        self.carry_out(now, output, view);
    }

    /// Cancels all open queries. The policy is notified, otherwise it would wait forever, but its answer is not carried
    /// out: the operator has taken over or the flight is over.
    pub(super) fn cancel_queries(&mut self) {
        for (id, _) in core::mem::take(&mut self.waiting) {
            self.outbox.push_back(Action::Cancel(id));
            self.policy.handle(PolicyEvent::ReplyFailed { id });
        }
    }

    /// Carries out a step, and requests further steps from the policy until it waits.
    pub(super) fn carry_out(&mut self, now: Time, output: Output, view: &View) {
        let mut output = output;
        for _ in 0..STEPS_AT_ONCE {
            let is_second_look = output.reading.is_done();
            match output.step {
                Step::Ask(query) => self.ask(now, query, *view),
                Step::Move(motion) => self.begin_move(now, motion),
                Step::Goto(goto) => self.begin_goto(now, &goto),
                Step::Follow(goto) => self.begin_following(now, &goto),
                Step::Keep => self.keep_on(now, view),
                // A second look at somebody who walks: at rest, the craft would lose them.
                Step::Look if is_second_look && self.goes_along(now) => return,
                Step::Look => {
                    self.stop_motion(now);
                    self.needs_rest = true;
                    return;
                }
                Step::Wait => return,
                Step::Done => return self.end_instruction(now, Outcome::Reached, "the instruction is fulfilled".to_owned()),
                Step::Reject(_) => return self.stop_motion(now),
                Step::Fail(reason) => {
                    let (outcome, cause) = match reason {
                        FailReason::NotFound => (Outcome::NotFound, "two full search turns without seeing the target"),
                        FailReason::NoProgram => (Outcome::Failed, "several programs in a row failed"),
                    };
                    return self.end_instruction(now, outcome, cause.to_owned());
                }
            }
            output = self.policy.handle(PolicyEvent::Continue);
        }
    }

    /// When a query that is sent now expires.
    pub(super) fn reply_deadline(&self, now: Time) -> Time {
        now + self.settings.reply_timeout.max(LEAST_TIMEOUT)
    }

    fn ask(&mut self, now: Time, mut query: Box<Query>, view: View) {
        if self.waiting.len() >= QUERIES_AT_ONCE {
            self.policy.handle(PolicyEvent::ReplyFailed { id: query.id });
            return;
        }
        query.deadline = self.reply_deadline(now);
        self.waiting.insert(query.id, Waiting { query: query.clone(), view, queried_at: now, decided: false });
        self.outbox.push_back(Action::Ask(query));
    }

    fn decision(
        &self,
        now: Time,
        waiting: &Waiting,
        text: &str,
        output: &Output,
        goal: Option<spf_core::geometry::Pose>,
        passed: bool,
    ) -> Decision {
        let step = &output.step;
        let number = if decides(step, &waiting.query) || waiting.decided { self.decisions } else { self.decisions + 1 };
        let step = match step {
            Step::Ask(_) => "ask",
            Step::Move(_) => "move",
            Step::Goto(_) => "goto",
            Step::Follow(_) => "follow",
            Step::Keep => "keep",
            Step::Look => "look",
            Step::Wait => "wait",
            Step::Done => "done",
            Step::Reject(_) => "reject",
            Step::Fail(_) => "fail",
        };
        Decision {
            number,
            query: (*waiting.query).clone(),
            reply: text.to_owned(),
            reading: output.reading.clone(),
            step: step.to_owned(),
            frame: waiting.view.frame.id,
            captured: waiting.view.frame.captured,
            queried_at: waiting.queried_at,
            answered: now,
            frame_age_s: now.since(waiting.view.frame.captured).as_secs_f64(),
            latency_s: now.since(waiting.queried_at).as_secs_f64(),
            pose: waiting.view.pose,
            pose_at_reply: self.known_pose(now),
            goal,
            passed,
            anchor: self.anchor_report(now, waiting.view.pose),
        }
    }

    pub(super) fn note(&mut self, note: Note) {
        self.outbox.push_back(Action::Note(note));
    }
}

/// Whether a step ends a decision. Further queries and waiting do not, and neither does a list of detections, on which
/// no model decided.
fn decides(step: &Step, query: &Query) -> bool {
    !matches!(step, Step::Ask(_) | Step::Wait) && !matches!(query.kind, QueryKind::Detect { .. })
}
