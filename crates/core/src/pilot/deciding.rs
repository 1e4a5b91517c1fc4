//! Frames in, queries out, replies in, steps carried out.

use super::{Action, Decision, Note, Outcome, Phase, Pilot, Think, Waiting};
use crate::envelope::Reaction;
use crate::frame::FrameMeta;
use crate::policy::{FailReason, PolicyEvent, Step, View};
use crate::query::{Query, QueryId};
use crate::time::Time;

/// Steps a policy may take at one instant; more means a policy that never waits.
const STEPS_AT_ONCE: usize = 16;

impl Pilot {
    pub(super) fn frame(&mut self, now: Time, frame: FrameMeta) {
        self.envelope.observe_frame(now, &frame);
        let newer = self
            .view
            .is_none_or(|view| frame.captured > view.frame.captured && frame.capture_counter != view.frame.capture_counter);
        if let Some(known) = self.estimator.pose_at(frame.captured).filter(|_| newer && !frame.unusable) {
            let at_rest = self.settled.is_some_and(|settled| frame.captured >= settled);
            self.view = Some(View { frame, camera: self.camera, pose: known, at_rest });
        }
    }

    /// Shows the policy the newest frame when a decision is due.
    pub(super) fn decide(&mut self, now: Time) {
        if self.phase != Phase::Flying || !self.waiting.is_empty() || self.envelope.reaction(now) != Reaction::Continue {
            return;
        }
        let Some(view) = self.view else { return };
        let from_rest = self.needs_rest || self.settings.think == Think::Stop;
        if self.used == Some(view.frame.id) || (from_rest && (self.executing || !view.at_rest)) {
            return;
        }
        if self.decisions >= self.settings.max_decisions {
            return self.finish(now, Outcome::Timeout, format!("{} decisions were spent", self.decisions));
        }
        self.used = Some(view.frame.id);
        self.needs_rest = false;
        let step = self.policy.handle(PolicyEvent::Frame(&view));
        self.carry_out(now, step, &view);
    }

    pub(super) fn reply(&mut self, now: Time, id: QueryId, text: &str) {
        let Some(waiting) = self.waiting.remove(&id) else {
            self.late_replies += 1;
            return self.note(Note::LateReply(id));
        };
        let step = self.policy.handle(PolicyEvent::Reply { id, text });
        self.envelope.observe_reply(now, !matches!(step, Step::Reject(_)));
        if !matches!(step, Step::Ask(_) | Step::Wait) {
            self.decisions += 1;
        }
        let (goal, passed) = self.planned(now, &step, &waiting.view);
        let decision = self.decision(now, &waiting, text, &step, goal, passed);
        self.note(Note::Decision(Box::new(decision)));
        self.carry_out(now, step, &waiting.view);
    }

    pub(super) fn chunk(&mut self, now: Time, id: QueryId, text: &str) {
        if let Some(waiting) = self.waiting.get(&id) {
            let view = waiting.view;
            let step = self.policy.handle(PolicyEvent::Chunk { id, text });
            self.carry_out(now, step, &view);
        }
    }

    pub(super) fn reply_failed(&mut self, now: Time, id: QueryId, reason: String) {
        let Some(waiting) = self.waiting.remove(&id) else {
            self.late_replies += 1;
            return self.note(Note::LateReply(id));
        };
        self.give_up(now, id, &waiting.view, reason);
    }

    /// Gives up the queries whose deadline has passed; the VLM is told, and a late answer moves nothing.
    pub(super) fn expire_queries(&mut self, now: Time) {
        while let Some(id) = self.waiting.iter().find(|(_, waiting)| waiting.query.deadline <= now).map(|(id, _)| *id) {
            if let Some(waiting) = self.waiting.remove(&id) {
                self.outbox.push_back(Action::Cancel(id));
                let reason = format!("no answer within {} s", self.settings.reply_timeout.as_secs_f64());
                self.give_up(now, id, &waiting.view, reason);
            }
        }
    }

    fn give_up(&mut self, now: Time, id: QueryId, view: &View, reason: String) {
        self.envelope.observe_reply(now, false);
        self.stop_motion(now);
        self.note(Note::QueryFailed { id, reason });
        let step = self.policy.handle(PolicyEvent::ReplyFailed { id });
        self.carry_out(now, step, view);
    }

    /// No answer is waited for any more.
    pub(super) fn cancel_queries(&mut self) {
        for (id, _) in core::mem::take(&mut self.waiting) {
            self.outbox.push_back(Action::Cancel(id));
        }
    }

    /// Carries out what the policy wants, and asks it for more until it waits.
    pub(super) fn carry_out(&mut self, now: Time, step: Step, view: &View) {
        let mut step = step;
        for _ in 0..STEPS_AT_ONCE {
            match step {
                Step::Ask(query) => self.ask(now, query, *view),
                Step::Move(motion) => self.begin_move(now, motion),
                Step::Look => {
                    self.stop_motion(now);
                    self.needs_rest = true;
                    return;
                }
                Step::Wait => return,
                Step::Done => return self.finish(now, Outcome::Reached, "the instruction is fulfilled".to_owned()),
                Step::Reject(_) => return self.stop_motion(now),
                Step::Fail(FailReason::NotFound) => {
                    return self.finish(
                        now,
                        Outcome::NotFound,
                        "searched all round, twice, and did not see the target".to_owned(),
                    );
                }
            }
            step = self.policy.handle(PolicyEvent::Continue);
        }
    }

    fn ask(&mut self, now: Time, mut query: Box<Query>, view: View) {
        query.deadline = now + self.settings.reply_timeout;
        self.waiting.insert(query.id, Waiting { query: query.clone(), view, asked: now });
        self.outbox.push_back(Action::Ask(query));
    }

    fn decision(
        &self,
        now: Time,
        waiting: &Waiting,
        text: &str,
        step: &Step,
        goal: Option<crate::geometry::Pose>,
        passed: bool,
    ) -> Decision {
        let step = match step {
            Step::Ask(_) => "ask",
            Step::Move(_) => "move",
            Step::Look => "look",
            Step::Wait => "wait",
            Step::Done => "done",
            Step::Reject(_) => "reject",
            Step::Fail(_) => "fail",
        };
        Decision {
            number: self.decisions,
            query: (*waiting.query).clone(),
            reply: text.to_owned(),
            reading: self.policy.reading(),
            step: step.to_owned(),
            frame: waiting.view.frame.id,
            captured: waiting.view.frame.captured,
            asked: waiting.asked,
            answered: now,
            frame_age_s: now.since(waiting.view.frame.captured).as_secs_f64(),
            latency_s: now.since(waiting.asked).as_secs_f64(),
            pose: waiting.view.pose,
            pose_at_reply: self.known_pose(now),
            goal,
            passed,
        }
    }

    pub(super) fn note(&mut self, note: Note) {
        self.outbox.push_back(Action::Note(note));
    }
}
