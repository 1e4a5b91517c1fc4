//! A step towards an image point, as it is planned, and the checks that may refuse it: the first refusal wins.

use super::answered::Answered;
use super::retreat;
use super::rules::{KeptClear, is_at_edge};
use crate::policy::{Because, Expected, Goto, Move, Reading, Step, View};
use spf_core::direction::Direction;
use spf_core::geometry::BodyDisplacement;
use spf_core::lift::{self, UnprojectError};
use spf_core::primitives::Primitives;
use spf_core::query::ImagePoint;
use spf_core::reply::Status;
use spf_space::avoid::{self, Avoidance, Corridor, MIN_STEP, PassingSide, PathShape, PlannedStep, Side, is_person};
use spf_space::views::Views;
use spf_space::{Obstacle, Viewpoint};

/// Climb with which the craft looks over what blocks its path, metres.
pub(super) const BLOCKED_CLIMB: f64 = 1.0;
/// Most turns in a row towards paths along the image edges; the second only towards the other edge.
const TURNS_FIRST: u32 = 2;
/// Nearer than this multiple of the distance to keep, the craft is beside who is followed.
const BESIDE: f64 = 1.6;
/// Words for what is flown through.
const THROUGH: [&str; 4] = ["through", "opening", "openings", "gap"];
/// Depth label up to which an opening is flown through in one step, 4.6 m; how far beyond, metres; and how far off the heading it may be,
/// radians: 12°.
const OPENING: f64 = 4.0;
const BEYOND: f64 = 1.5;
const CENTRED: f64 = 12.0 / 180.0 * core::f64::consts::PI;
/// By how much less is kept clear between the sides of an opening, or of a door that is nowhere named, metres: each is seen beside the way,
/// and only its range is uncertain.
const SPARED_BETWEEN: f64 = 0.15;
/// How far a way is flown at once that leaves no more than that, metres.
const NARROW: f64 = 0.5;
/// A way this far off the heading is still in sight, as a part of half the field of view.
const IN_SIGHT: f64 = 0.8;
/// Angle below which a target is not below the craft, radians: 6°.
const BELOW: f64 = 6.0 / 180.0 * core::f64::consts::PI;

/// Turns flown instead of the step itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TurnedFirst {
    /// Where the last one led.
    side: Side,
    /// Number in a row.
    turns: u32,
}

impl TurnedFirst {
    /// The turn to this side after the one `before`; `None` if the step itself comes next.
    fn next(before: Option<Self>, side: Side) -> Option<Self> {
        match before {
            None => Some(Self { side, turns: 1 }),
            Some(last) if last.side != side && last.turns < TURNS_FIRST => Some(Self { side, turns: last.turns + 1 }),
            Some(_) => None,
        }
    }
}

/// What the decisions before have left for this one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Before {
    /// The side on which an obstacle is being passed.
    pub(super) passing: Option<PassingSide>,
    /// The turn towards the path that was flown instead of the last step.
    pub(super) turned: Option<TurnedFirst>,
}

/// A step towards an image point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan<'a> {
    pub(super) answer: Answered<'a>,
    /// Where the reply points, and the depth label of what is there.
    pub(super) point: ImagePoint,
    pub(super) label: f64,
    before: Before,
    /// From where the image of the reply was taken.
    from: Viewpoint,
    /// What the obstacles make of it; `None` if nothing is checked.
    pub(super) avoidance: Option<Avoidance>,
    /// The obstacle in the way.
    by: Option<&'a Obstacle>,
    /// The point flown to.
    pub(super) waypoint: ImagePoint,
    /// Distance along the optical axis that the obstacles leave, metres.
    step: f64,
    /// The most that a person leaves who walks towards the craft, metres, where it is less.
    yields_to: Option<f64>,
    /// Whether it leads to beyond an opening.
    leads_through: bool,
}

/// What a check makes of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Verdict {
    /// It may be flown.
    Fly,
    /// It may be flown for so many metres along the optical axis.
    Within(f64),
    /// It is not flown.
    Refused(Refusal),
}

/// Why a plan is not flown, and what is done instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Refusal {
    /// The craft is beside somebody with whom it stays, and something is in the way: it stays there, and goes on looking at them.
    Beside,
    /// No direction is free: it waits, and then looks for a way over or around.
    Blocked,
    /// Somebody walks towards it: it waits for them.
    Met,
    /// The path leads along the edge of the image: it turns there first.
    TurnFirst(TurnedFirst),
}

/// The checks, in order.
const CHECKS: [fn(&Plan<'_>, &Views) -> Verdict; 4] = [stays_beside, is_blocked, meets_somebody, leads_along_edge];

/// The craft stays with somebody whose track tells where they are: it does not need to get anywhere, and comes no nearer.
fn stays_beside(plan: &Plan<'_>, _: &Views) -> Verdict {
    let Answered { rules, reply, .. } = plan.answer;
    let beside = rules.kept_m.map_or(0.0, |kept| BESIDE * kept);
    let is_beside = matches!(plan.view().expected, Expected::Followed { is_tracked: true, range, .. } if range < beside);
    let is_in_the_way = plan.avoidance.is_some_and(|outcome| outcome != Avoidance::Clear);
    let stays = is_in_the_way && is_beside && reply.status == Status::Following && rules.follows(reply);
    if stays { Verdict::Refused(Refusal::Beside) } else { Verdict::Fly }
}

fn is_blocked(plan: &Plan<'_>, _: &Views) -> Verdict {
    let is_blocked = plan.avoidance == Some(Avoidance::Hold);
    if is_blocked { Verdict::Refused(Refusal::Blocked) } else { Verdict::Fly }
}

/// The craft does not go to meet a person who walks towards it, unless it is to stay with them.
fn meets_somebody(plan: &Plan<'_>, views: &Views) -> Verdict {
    let Answered { rules, reply, .. } = plan.answer;
    match retreat::room_before_target(plan.view(), reply, views) {
        Some(room) if room < plan.step && !rules.follows(reply) => {
            if room < MIN_STEP {
                Verdict::Refused(Refusal::Met)
            } else {
                Verdict::Within(room)
            }
        }
        _ => Verdict::Fly,
    }
}

/// Half of a path along the edge of the image is outside it, where no box is listed.
fn leads_along_edge(plan: &Plan<'_>, _: &Views) -> Verdict {
    let Answered { rules, reply, .. } = plan.answer;
    // A craft that follows turns to its target all the time.
    let stays = rules.follows(reply) && reply.status == Status::Following;
    if plan.avoidance.is_none() || stays {
        return Verdict::Fly;
    }
    let planned = rules.planned(&plan.from, plan.point, plan.step);
    if !avoid::leads_along_edge(&planned, plan.waypoint, plan.step, rules.clearance()) {
        return Verdict::Fly;
    }
    let side = if plan.view().camera.ray(plan.waypoint).right > 0.0 { Side::Right } else { Side::Left };
    // A target at the very edge of the frame every time is flown to anyway.
    let next = TurnedFirst::next(plan.before.turned, side);
    next.map_or(Verdict::Fly, |turn| Verdict::Refused(Refusal::TurnFirst(turn)))
}

/// Whether a reply of a guided craft leads through an opening.
fn is_opening(answer: &Answered<'_>) -> bool {
    let Answered { rules, reply, .. } = answer;
    let is_named = |name: &String| {
        let mut words = name.split(|c: char| !c.is_alphanumeric());
        words.any(|word| THROUGH.iter().any(|through| word.eq_ignore_ascii_case(through)))
    };
    let is_opening = reply.target.as_ref().is_some_and(is_named) && reply.status == Status::Navigating;
    is_opening && rules.keeps_place && rules.kept_clear == KeptClear::ByBoxes
}

impl<'a> Plan<'a> {
    /// The step towards a point, led around what the obstacles of the reply leave no room for.
    pub(super) fn new(answer: Answered<'a>, (point, label): (ImagePoint, f64), before: Before, views: &Views) -> Self {
        let step = answer.rules.settings.step.length_of(label);
        let from = answer.view().viewpoint();
        let plan = Self {
            answer,
            point,
            label,
            before,
            from,
            avoidance: None,
            by: None,
            waypoint: point,
            step,
            yields_to: None,
            leads_through: false,
        };
        if answer.rules.kept_clear != KeptClear::ByBoxes && !views.has_keep_out() {
            return plan;
        }
        let planned = plan.answer.rules.planned(&plan.from, point, step);
        let (target, obstacles) = (answer.reply.target.as_deref(), plan.counted());
        let clearance = plan.clearance();
        let check_at = |planned: &PlannedStep<'_>, clearance| avoid::avoid(planned, clearance, obstacles, target, before.passing);
        let check = |planned: &PlannedStep<'_>| check_at(planned, clearance);
        // A step that ends in it would be followed by one from between its sides.
        let is_centred = libm::atan(answer.view().camera.ray(point).right).abs() < CENTRED;
        if label <= OPENING && is_centred && is_opening(&answer) {
            let step = step.max(lift::range_of_label(label) + BEYOND);
            if check(&PlannedStep { step, ..planned }).0 == Avoidance::Clear {
                return Self { step, avoidance: Some(Avoidance::Clear), leads_through: true, ..plan };
            }
        }
        let (mut outcome, by) = check(&planned);
        let by = by.and_then(|by| obstacles.get(by));
        let mut step = step;
        if outcome == Avoidance::Hold && !views.has_keep_out() && plan.may_squeeze() {
            let narrow = PlannedStep { step: step.min(NARROW), ..planned };
            (outcome, step) = match check_at(&narrow, answer.rules.clearance() - SPARED_BETWEEN).0 {
                Avoidance::Clear => (Avoidance::Shortened { step: narrow.step }, step),
                shifted @ Avoidance::Shifted { .. } => (shifted, narrow.step),
                Avoidance::Shortened { .. } | Avoidance::Hold => (outcome, step),
            };
        }
        let (waypoint, step) = match outcome {
            Avoidance::Shifted { point } => (point, step),
            Avoidance::Shortened { step: shorter } => (point, shorter),
            Avoidance::Clear | Avoidance::Hold => (point, step),
        };
        let plan = Self { avoidance: Some(outcome), by, ..plan };
        // Beside somebody, the craft keeps looking at them.
        if stays_beside(&plan, views) == Verdict::Fly { Self { waypoint, step, ..plan } } else { plan }
    }

    /// Lets all checks look at the plan, until one refuses it.
    ///
    /// # Errors
    /// The first refusal.
    pub(super) fn check(&mut self, views: &Views) -> Result<(), Refusal> {
        for check in CHECKS {
            match check(self, views) {
                Verdict::Fly => {}
                Verdict::Within(room) => self.yields_to = Some(room),
                Verdict::Refused(refusal) => return Err(refusal),
            }
        }
        Ok(())
    }

    /// How far it goes before it yields to a person who walks towards the craft, metres.
    pub(super) fn yields_to(&self) -> Option<f64> {
        self.yields_to
    }

    pub(super) fn view(&self) -> &View {
        self.answer.view()
    }

    /// Distance flown along the optical axis, metres.
    pub(super) fn length(&self) -> f64 {
        self.yields_to.unwrap_or(self.step)
    }

    /// The planned step without obstacles.
    pub(super) fn straight(&self) -> PlannedStep<'_> {
        let Answered { rules, .. } = &self.answer;
        rules.planned(&self.from, self.point, rules.settings.step.length_of(self.label))
    }

    /// The motions of the step (paper §3.3, §3.4), written into the reading; `turns`: nothing is flown of it but the turn.
    ///
    /// # Errors
    /// If the point cannot be lifted; the craft must not fly there.
    pub(super) fn read(&self, turns: bool, reading: &mut Reading) -> Result<Primitives, UnprojectError> {
        let View { camera, pose, .. } = self.view();
        (reading.waypoint, reading.step) = (Some(self.waypoint), Some(self.length()));
        let lifting = self.answer.rules.settings.lifting;
        let displacement = lift::lift(lift::unproject(camera, self.waypoint, self.length())?, camera, pose.attitude, lifting);
        let mut primitives = self.facing(displacement).unwrap_or(Primitives::from_displacement(displacement));
        reading.displacement = Some(displacement);
        if turns {
            primitives = Primitives { yaw: primitives.yaw, ..Primitives::default() };
            (reading.step, reading.displacement) = (None, None);
        }
        reading.primitives = Some(primitives);
        Ok(primitives)
    }

    /// The same motion with the camera towards the target that is flown around, as long as it then still looks along the way; `None`
    /// otherwise, and where one motion follows the other.
    fn facing(&self, displacement: BodyDisplacement) -> Option<Primitives> {
        let Answered { rules, reply, .. } = self.answer;
        let dodges = self.waypoint != self.point && reply.status.leads_to_a_point();
        if !dodges || rules.settings.shape != PathShape::Straight {
            return None;
        }
        let View { camera, pose, .. } = self.view();
        let ray = lift::unproject(camera, self.point, 1.0).ok()?;
        let target = Primitives::from_displacement(lift::lift(ray, camera, pose.attitude, rules.settings.lifting));
        let straight = Primitives::from_displacement(displacement);
        let aside = straight.yaw - target.yaw;
        (aside.abs() < IN_SIGHT * camera.half_fov().0).then(|| Primitives {
            yaw: target.yaw,
            forward: straight.forward * libm::cos(aside),
            right: straight.forward * libm::sin(aside),
            climb: straight.climb,
        })
    }

    /// The motion of the step.
    pub(super) fn motion(&self, primitives: Primitives) -> Move {
        // An open direction is flown to its end.
        let then_rest = self.answer.reply.status == Status::NotVisible;
        Move { primitives, anchor: Some(self.view().pose), then_rest, looks: false }
    }

    /// The distance to keep from what counts, metres.
    fn clearance(&self) -> f64 {
        self.answer.rules.clearance() - if is_opening(&self.answer) { SPARED_BETWEEN } else { 0.0 }
    }

    /// Whether less may be kept clear: nobody is near, and of nothing in the image is it known only that it is within a metre.
    fn may_squeeze(&self) -> bool {
        let is_here = |obstacle: &Obstacle| obstacle.listed.depth <= 1 && obstacle.from.pose == self.from.pose;
        !self.counted().iter().any(|obstacle| is_here(obstacle) || is_person(&obstacle.listed.name))
    }

    /// Whether something within a metre, which the image shows, is in the way. Of persons the retreat decides.
    pub(super) fn is_here(&self) -> bool {
        self.by.is_some_and(|by| by.listed.depth <= 1 && by.from.pose == self.from.pose && !is_person(&by.listed.name))
    }

    /// The obstacles that count.
    fn counted(&self) -> &'a [Obstacle] {
        self.answer.obstacles
    }

    /// What is in the way.
    pub(super) fn because(&self) -> Option<Because> {
        let Obstacle { from, listed } = self.by?;
        let age = self.from.captured.since(from.captured).as_secs_f64();
        let walks = from.captured == self.from.captured && from.pose != self.from.pose;
        Some(Because { name: listed.name.clone(), seen_before_s: (age > 0.0).then_some(age), walks })
    }

    /// What the way to the target must keep clear of, up to half of the range that the label states; before a person who walks towards
    /// the craft no farther than the motion.
    fn corridor(&self, motion: &Move) -> Corridor {
        let Primitives { forward, climb, .. } = motion.primitives;
        let own = libm::hypot(forward, climb);
        let half = 0.5 * lift::range_of_label(self.label) * own / self.length();
        let longest = if self.yields_to.is_some() { own } else { half };
        let (checked, target) = (self.avoidance.is_some(), self.answer.reply.target.as_deref());
        let obstacles = if checked { self.answer.obstacles } else { &[] };
        Corridor::new(&self.from, self.clearance(), obstacles, (self.point, target), longest)
    }

    /// Whether the reply's point tells the pilot where the target is: a point beside, above or behind it, or straight on, does
    /// not.
    pub(super) fn tells_place(&self) -> bool {
        let Answered { rules, reply, .. } = self.answer;
        let is_on_target = reply.target_box.is_some_and(|area| area.contains(self.point)) && !is_at_edge(self.point);
        // Of a point without its depth only the direction is known.
        let is_placed = reply.label().is_some();
        !self.leads_through
            && is_placed
            && (rules.follows(reply) || reply.status == Status::Navigating && rules.keeps_place && is_on_target)
    }

    /// The step with the sighting of the target, of this stage. `stays`: it comes no nearer.
    pub(super) fn sighting(&self, motion: Move, stage: u32, stays: bool) -> Step {
        let Answered { rules, query, reply, .. } = self.answer;
        let is_clear = stays || self.avoidance.is_none_or(|outcome| outcome == Avoidance::Clear);
        let goto = Goto {
            id: query.id,
            point: self.point,
            area: reply.target_box,
            label: self.label,
            stage,
            motion,
            is_detour: self.waypoint != self.point || !is_clear,
            corridor: (!stays).then(|| Box::new(self.corridor(&motion))),
        };
        if rules.follows(reply) { Step::Follow(goto) } else { Step::Goto(goto) }
    }

    /// Why the craft does not climb to look over what blocks the path; `None` if it may.
    pub(super) fn no_climb(&self, views: &Views) -> Option<&'static str> {
        let (rules, view) = (&self.answer.rules, self.view());
        if !views.clears(&view.pose, BLOCKED_CLIMB, rules.clearance()) {
            return Some("an obstacle reaches beyond the upper edge of the frame");
        }
        // Over what stands before a low target, that target would be lost under the craft.
        let is_below = Direction::of_point(&view.camera, view.pose, self.point).elevation < -BELOW;
        (rules.keeps_place && is_below).then_some("the target would be lost under the craft")
    }
}

#[cfg(test)]
mod tests {
    use super::super::asking::{OpenQuery, Purpose};
    use super::super::rules::Rules;
    use super::super::tests::{settings, view};
    use super::*;
    use spf_core::query::{ImageBox, QueryId};
    use spf_core::reply::{ObstacleBox, Reply};

    const AHEAD: ImagePoint = ImagePoint { u: 0.5, v: 0.5 };
    /// At the image's edge, where the path leads along what has not been observed.
    const ASIDE: ImagePoint = ImagePoint { u: 0.97, v: 0.5 };

    /// What the checks make of a step to a tower at this point, 12.9 m away by its label, among obstacles.
    fn checked<T>(point: ImagePoint, boxes: &[ObstacleBox], of: impl Fn(&Plan<'_>, Option<Refusal>) -> T) -> T {
        let area = ImageBox { left: point.u - 0.02, top: 0.4, right: point.u + 0.02, bottom: 0.6 };
        let reply = Reply {
            target: Some("tower".to_owned()),
            target_box: Some(area),
            point: Some(point),
            depth: Some(6),
            boxes: boxes.to_vec(),
            ..Reply::new(Status::Navigating)
        };
        let query = OpenQuery { id: QueryId(1), view: view(1), purpose: Purpose::Decide };
        let obstacles: Vec<_> = Obstacle::of(&query.view.viewpoint(), boxes).collect();
        let answer = Answered { rules: Rules::new(settings(true)), query, reply: &reply, obstacles: &obstacles };
        let mut plan = Plan::new(answer, (point, 6.0), Before::default(), &Views::default());
        let refusal = plan.check(&Views::default()).err();
        of(&plan, refusal)
    }

    fn wall(depth: u8) -> ObstacleBox {
        let area = ImageBox { left: 0.0, top: 0.0, right: 1.0, bottom: 1.0 };
        ObstacleBox { area, depth, name: "wall".to_owned() }
    }

    #[test]
    fn the_first_refusal_wins() {
        let refusal = |point, boxes: &[ObstacleBox]| checked(point, boxes, |_, refusal| refusal);
        assert_eq!(refusal(AHEAD, &[]), None);
        assert!(matches!(refusal(ASIDE, &[]), Some(Refusal::TurnFirst(_))));
        assert_eq!(refusal(AHEAD, &[wall(1)]), Some(Refusal::Blocked));
        // No turn is made towards a path that is not free.
        assert_eq!(refusal(ASIDE, &[wall(1)]), Some(Refusal::Blocked));
    }

    #[test]
    fn the_way_to_a_target_is_clear_up_to_half_of_its_range_and_up_to_what_is_in_it() {
        // The label 6 is 12.9 m, and the paper's step for it 3.99 m.
        let clear = |boxes: &[ObstacleBox], up: f64| {
            checked(AHEAD, boxes, |plan, _| {
                let motion = plan.motion(plan.read(false, &mut Reading::default()).unwrap());
                let ahead = BodyDisplacement { right: 0.0, forward: 20.0, up };
                let View { pose, .. } = plan.view();
                plan.corridor(&motion).clear(pose.position.displaced(ahead, pose.attitude.heading), 3.9, 20.0)
            })
        };
        assert!((clear(&[], 0.0).unwrap() - 6.46).abs() < 0.05, "{:?}", clear(&[], 0.0));
        assert_eq!(clear(&[wall(4)], 0.0), None, "a wall from 3.6 m on");
        // The lower half of the image: the way up leads over it, another one to the same target, lower, does not.
        let hedge = ObstacleBox { area: ImageBox { left: 0.0, top: 0.52, right: 1.0, bottom: 1.0 }, ..wall(4) };
        assert!(clear(core::slice::from_ref(&hedge), 8.0).is_some_and(|clear| clear > 6.0) && clear(&[hedge], -2.0).is_none());
    }

    #[test]
    fn between_the_posts_of_a_door_a_little_is_flown_and_between_persons_nothing() {
        // Seen from 0.3 m before, both sides have left the image.
        let flown = |name: &str| {
            let sides = [(0.0, 0.18), (0.82, 1.0)].map(|(left, right)| ObstacleBox {
                area: ImageBox { left, top: 0.0, right, bottom: 1.0 },
                depth: 1,
                name: name.to_owned(),
            });
            let mut from = view(0).viewpoint();
            from.pose.position.north -= 0.3;
            let obstacles: Vec<_> = Obstacle::of(&from, &sides).collect();
            let reply =
                Reply { target: Some("tower".to_owned()), point: Some(AHEAD), depth: Some(6), ..Reply::new(Status::Navigating) };
            let query = OpenQuery { id: QueryId(1), view: view(1), purpose: Purpose::Decide };
            let answer = Answered { rules: Rules::new(settings(true)), query, reply: &reply, obstacles: &obstacles };
            Plan::new(answer, (AHEAD, 6.0), Before::default(), &Views::default()).avoidance
        };
        assert_eq!(flown("door post"), Some(Avoidance::Shortened { step: NARROW }));
        assert_eq!(flown("man"), Some(Avoidance::Hold));
    }

    #[test]
    fn a_turn_is_made_once_to_each_side() {
        let first = TurnedFirst::next(None, Side::Right);
        assert!(first.is_some() && TurnedFirst::next(first, Side::Right).is_none());
        let second = TurnedFirst::next(first, Side::Left);
        assert!(
            second.is_some()
                && TurnedFirst::next(second, Side::Right).is_none()
                && TurnedFirst::next(second, Side::Left).is_none()
        );
    }
}
