//! Two open queries while searching: the craft turns on before the answer about the last view has come, and asks about the next
//! view, as if that answer will not show the target. One that does makes the second query void, and leads back: nothing more is
//! asked until the camera shows the target again.
//!
//! Each answer that does not show the target is the reason for the turn that it asks for and for one more. Nothing else is: not a
//! turn of before somebody took over, nor one whose end was followed by anything but the next query.

use super::{OpenQuery, Spf};
use crate::geometry::wrap_angle;
use crate::policy::search::Search;
use crate::policy::{Goto, Move, Reading, Step, View};
use crate::primitives::Primitives;
use crate::query::QueryId;
use crate::time::Duration;

/// Turns that differ by less than this lead to the same view, radians.
const SAME_TURN: f64 = 0.05;
/// A target within this part of half of the field of view is shown.
const SHOWN: f64 = 0.8;
/// After this time one asks in any case.
const TURNS_BACK: Duration = Duration::from_secs(10);
/// What is done with the answer about the second view if it comes first.
pub(super) const OVERTAKEN: &str = "not used: the view before is not answered yet";

/// What is done before the open query is answered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    /// The turn from the view of the open query, radians, clockwise positive.
    yaw: f64,
    progress: Progress,
}

#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
enum Progress {
    /// The craft turns.
    Turning,
    /// It has turned, and asks about the next frame that is taken at rest.
    Turned,
    /// It has asked.
    Asked(OpenQuery),
    /// Nothing more until the open query is answered: the turn was cut short, the second query has failed, or it was answered
    /// first. Whether it is of use is not known then, so that the view is asked about again.
    Over,
}

/// What the last answer, if it has led to a turn of a search, permits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Sweep {
    /// No turn before the next answer.
    #[default]
    Over,
    /// The craft makes the turn for which it asked.
    Turns,
    /// One more turn once the next query is sent: that turn was made to its end.
    Turned,
}

/// What an answer may change, and is as before if it is decided again from the view that was answered.
pub(super) struct Before {
    /// The part of the instruction.
    stage: u32,
    /// The search and the steps back, if the craft has turned on.
    counted: Option<(Option<Search>, u32)>,
}

impl Spf {
    /// What there is before an answer is read.
    pub(super) fn before_answer(&self) -> Before {
        Before { stage: self.memory.stage, counted: self.ahead.map(|_| (self.search.clone(), self.retreats)) }
    }

    /// Whether the next frame at rest is wanted although a query is open.
    pub(super) fn wants_second(&self) -> bool {
        matches!(self.ahead, Some(Ahead { progress: Progress::Turned, .. }))
    }

    /// The turn that the craft has made since the view of the open query, radians.
    pub(super) fn turned_since_open(&self) -> f64 {
        self.ahead.map_or(0.0, |ahead| ahead.yaw)
    }

    /// Whether a query is the second one.
    pub(super) fn is_second(&self, id: QueryId) -> bool {
        matches!(self.ahead, Some(Ahead { progress: Progress::Asked(second), .. }) if second.id == id)
    }

    /// Turns on while the query just sent, or the one that was the second, is open.
    pub(super) fn turn_ahead(&mut self) -> Step {
        let (true, Sweep::Turned) = (self.asks_ahead && !self.came_too_late, self.sweep) else { return Step::Wait };
        let (None, Some(open), Some(search)) = (self.ahead, self.open_query, &self.search) else { return Step::Wait };
        let is_search = !open.confirming && self.hidden_since.is_none() && !self.told_lost;
        let Some(yaw) = search.expected_turn(open.view.pose.attitude.heading).filter(|_| is_search) else {
            return Step::Wait;
        };
        self.ahead = Some(Ahead { yaw, progress: Progress::Turning });
        self.sweep = Sweep::Over;
        let primitives = Primitives { yaw, ..Primitives::default() };
        Step::Move(Move { primitives, anchor: Some(open.view.pose), then_rest: true, looks: false })
    }

    /// Notes that a motion has ended.
    pub(super) fn turned_ahead(&mut self, completed: bool) {
        self.turning_back = None;
        self.sweep = if completed && self.sweep == Sweep::Turns { Sweep::Turned } else { Sweep::Over };
        if let Some(Ahead { progress: progress @ Progress::Turning, .. }) = &mut self.ahead {
            *progress = if completed { Progress::Turned } else { Progress::Over };
        }
    }

    /// Whether a frame is one of a turn back to the target, which it does not show yet.
    pub(super) fn is_turning_back(&mut self, view: &View) -> bool {
        let Some((heading, until)) = &mut self.turning_back else { return false };
        let until = *until.get_or_insert(view.frame.captured + TURNS_BACK);
        let shown = SHOWN * view.camera.half_fov().0;
        view.frame.captured < until && wrap_angle(view.pose.attitude.heading - *heading).abs() > shown
    }

    /// Asks about the view after the turn.
    pub(super) fn ask_second(&mut self, view: &View) -> Step {
        let (Some(ahead), Some(first)) = (self.ahead, self.open_query) else { return Step::Wait };
        let step = self.ask(view);
        let second = self.open_query.replace(first);
        self.ahead = second.map(|second| Ahead { progress: Progress::Asked(second), ..ahead });
        step
    }

    /// After the answer to the open query about `view`, which leads to `step`: the second query is the open one if this is the turn that
    /// was begun, and the answer has not ended a part of the instruction. Returns the step to take, from where the craft has turned to.
    pub(super) fn settle_ahead(&mut self, view: &View, step: Step, before: Before) -> Step {
        let Some(Ahead { yaw, progress }) = self.ahead.take() else { return step };
        match &step {
            // What backs off from what was seen in that view, or looks at it again, begins with the turn back to it.
            Step::Move(Move { primitives, then_rest: true, .. }) if primitives.forward != 0.0 || primitives.right != 0.0 => {
                return self.turn_back_to(view, before);
            }
            Step::Look => return self.turn_back_to(view, before),
            Step::Move(Move { primitives, then_rest: true, .. }) => {
                let turn = Primitives { yaw: primitives.yaw, ..Primitives::default() };
                if let Progress::Asked(second) = progress
                    && self.memory.stage == before.stage
                    && self.sweep == Sweep::Turns
                    && *primitives == turn
                    && (turn.yaw - yaw).abs() < SAME_TURN
                {
                    self.open_query = Some(second);
                    self.sweep = Sweep::Turned;
                }
            }
            // Who is followed may walk on, and is turned to all the time.
            Step::Move(motion) | Step::Goto(Goto { motion, .. }) | Step::Follow(Goto { motion, .. }) => {
                let heading = view.pose.attitude.heading + motion.primitives.yaw;
                self.turning_back = Some((heading, None));
            }
            _ => {}
        }
        step
    }

    /// The second query has failed, or was answered first.
    pub(super) fn give_up_second(&mut self) {
        if let Some(ahead) = &mut self.ahead {
            ahead.progress = Progress::Over;
        }
    }

    /// The open query has no answer, or one that came too late for a craft that has turned on: it does not turn on again.
    pub(super) fn fail_ahead(&mut self) {
        self.came_too_late |= self.ahead.take().is_some();
        self.sweep = Sweep::Over;
    }

    /// Turns to where a frame was taken, and decides by one that is taken there at rest, in place of what was to be flown.
    fn turn_back_to(&mut self, view: &View, before: Before) -> Step {
        if let Some((search, retreats)) = before.counted {
            (self.search, self.retreats) = (search, retreats);
        }
        self.reading = Reading {
            reply: self.reading.reply.take(),
            listed: self.reading.listed.take(),
            actions: vec!["turns back to that view first".to_owned()],
            ..Reading::default()
        };
        self.history.nothing_planned();
        Step::Move(Move { primitives: Primitives::default(), anchor: Some(view.pose), then_rest: true, looks: false })
    }
}
