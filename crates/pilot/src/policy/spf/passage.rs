//! The way to the target past what is in it: the side on which it is passed, and what follows when no direction is free.

use super::answered::Answered;
use super::aside::Aside;
use super::plan::{Before, Plan, Refusal, TurnedFirst};
use super::rules::Rules;
use crate::policy::{Reading, Step, View};
use spf_core::direction::Direction;
use spf_core::geometry::wrap_angle;
use spf_core::query::ImagePoint;
use spf_space::avoid::{self, Avoidance, PassingSide, Side};

/// Number of times in a row that a blocked path is answered by holding and querying again before searching for another.
const BLOCKED_LOOKS: u32 = 3;
/// The same after a way around has been tried: somebody who walks has walked on.
const BLOCKED_AGAIN: u32 = 2;
/// Number of clear paths in a row after which a detour is over.
const DETOUR_OVER: u32 = 2;

/// A reply that points farther than this from the last one points elsewhere, radians: 6°.
const ELSEWHERE: f64 = 6.0 / 180.0 * core::f64::consts::PI;
/// Two ways within this angle are the same, radians: 20°.
const SAME_WAY: f64 = 20.0 / 180.0 * core::f64::consts::PI;

/// A detour under way.
#[derive(Clone, Copy, Debug, Default)]
struct DetourSide {
    passing: Option<PassingSide>,
    /// Clear paths in a row.
    clear: u32,
}

impl DetourSide {
    fn clear(&mut self) {
        self.clear += 1;
        if self.clear >= DETOUR_OVER {
            self.passing = None;
        }
    }

    /// A path around has been found on this side; `None` if it leads over or under.
    fn shifted(&mut self, side: Option<Side>) {
        self.clear = 0;
        let Some(side) = side else { return };
        self.passing = match self.passing {
            Some(passing) if passing.side == side => Some(passing),
            // It changes sides once; a craft that did so at every reply would get nowhere.
            Some(_) => Some(PassingSide { side, strict: true }),
            None => Some(PassingSide { side, strict: false }),
        };
    }
}

/// The way past what is before the target.
#[derive(Clone, Debug)]
pub(super) struct Passage {
    detour: DetourSide,
    /// Replies in a row that point there and leave no direction free.
    blocked: u32,
    /// The bearing of the last of them, radians clockwise from north.
    blocked_at: f64,
    /// Ways around that are out of view; `None` without guidance.
    aside: Option<Aside>,
    /// Whether it has backed off from what is in the way, to hold farther away.
    made_room: bool,
    /// The turn towards the path that was flown instead of the last step.
    turned: Option<TurnedFirst>,
    /// Where the last reply left a way open although somebody was near, radians clockwise from north.
    open: Option<f64>,
}

impl Passage {
    pub(super) fn new(rules: &Rules) -> Self {
        let aside = rules.keeps_place.then(Aside::default);
        Self { detour: DetourSide::default(), blocked: 0, blocked_at: 0.0, aside, made_room: false, turned: None, open: None }
    }

    /// What the decisions before leave for the next plan. Only the very next one follows the turn that was made for it.
    pub(super) fn before(&mut self) -> Before {
        Before { passing: self.detour.passing, turned: self.turned.take() }
    }

    /// Whether the way that a blocked craft is shown may be flown. With somebody near it has to be open in a second image as well, since
    /// they may have walked into it.
    pub(super) fn is_still_open(&mut self, view: &View, way: ImagePoint, somebody_near: bool) -> bool {
        let bearing = view.pose.attitude.heading + libm::atan(view.camera.ray(way).right);
        let before = self.open.take().filter(|_| somebody_near);
        let is_open = !somebody_near || before.is_some_and(|before| wrap_angle(bearing - before).abs() < SAME_WAY);
        self.open = (!is_open).then_some(bearing);
        is_open
    }

    /// Forgets the turn that was made for the next step: it has not shown what lies there, or the step does not follow.
    pub(super) fn forget_turn(&mut self) {
        self.turned = None;
    }

    /// Notes what the checks have made of a plan.
    pub(super) fn checked(&mut self, plan: &Plan<'_>, refusal: Option<Refusal>) {
        if let Some(Refusal::TurnFirst(turn)) = refusal {
            self.turned = Some(turn);
        }
        let Some(outcome) = plan.avoidance.filter(|_| refusal != Some(Refusal::Blocked)) else { return };
        self.blocked = 0;
        if refusal == Some(Refusal::Beside) {
            return;
        }
        match outcome {
            Avoidance::Clear => self.detour.clear(),
            Avoidance::Shifted { point } => self.detour.shifted(avoid::side_of(&plan.straight(), point)),
            Avoidance::Shortened { .. } | Avoidance::Hold => return,
        }
        self.made_room = false;
        if let Some(aside) = &mut self.aside {
            aside.clear();
        }
    }

    /// Whether the craft is to back off from what is in the way, to hold farther away from it: once until its path is free again. Never without
    /// guidance.
    pub(super) fn makes_room(&mut self) -> bool {
        self.aside.is_some() && !core::mem::replace(&mut self.made_room, true)
    }

    /// Notes that no direction is free; returns whether the craft waits for another reply. Whoever points elsewhere is waited for anew: a
    /// model that sees finds a way by itself.
    pub(super) fn waits(&mut self, plan: &Plan<'_>) -> bool {
        let View { camera, pose, .. } = plan.view();
        let bearing = Direction::of_point(camera, *pose, plan.point).bearing;
        if wrap_angle(bearing - self.blocked_at).abs() > ELSEWHERE {
            self.blocked = 0;
        }
        self.blocked_at = bearing;
        self.blocked += 1;
        let looks = if self.aside.is_some_and(|aside| aside.was_tried()) { BLOCKED_AGAIN } else { BLOCKED_LOOKS };
        if self.blocked >= looks {
            self.blocked = 0;
        }
        self.blocked > 0
    }

    /// Begins a way around that is out of view, or holds once all that could be tried has been; `None` without guidance, and for a reply
    /// that does not lead to a target.
    pub(super) fn go_aside(&mut self, plan: &Plan<'_>, reading: &mut Reading) -> Option<Step> {
        let passed = self.detour.passing.map(|passing| passing.side);
        self.aside.as_mut()?.begin(plan, passed, reading)
    }

    /// What follows from a reply about a side to which the craft has turned ([`Aside::look`]).
    pub(super) fn look_aside(&mut self, answer: &Answered<'_>, reading: &mut Reading) -> Option<Step> {
        let passing = self.detour.passing;
        self.aside.as_mut()?.look(answer, passing, reading)
    }

    /// The turn back to the target after a way around.
    pub(super) fn turn_back(&mut self, view: &View) -> Option<Step> {
        self.aside.as_mut()?.turn_back(view)
    }

    /// The path is closed, whatever the side on which it was passed.
    pub(super) fn close(&mut self) {
        self.detour = DetourSide::default();
    }
}
