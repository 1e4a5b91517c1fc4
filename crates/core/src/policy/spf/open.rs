//! Open space: where a reply has shown that nothing is near, the next query does not ask for boxes, which cost tokens.

use super::{Boxes, Spf};
use crate::avoid::{is_person, leads_along_edge};
use crate::geometry::wrap_angle;
use crate::lift::{Lifting, lift, project_displacement, range_of_label, unproject};
use crate::policy::{Step, View};
use crate::query::ImagePoint;
use crate::reply::{Reply, Status};
use crate::time::Duration;

/// Free distance from which nothing counts as near, metres: a step and a half.
const OPEN: f64 = 8.0;
/// Labels by which an obstacle may be nearer than stated: half of its interval, and an error of one.
const NEARER: f64 = 1.5;
/// How much nearer a person may have come until the next boxes, metres: a brisk walk of 5 s.
const WALKED: f64 = 8.0;
/// What a frame showed counts for this long.
const FRESH: Duration = Duration::from_secs(3);
/// The next frame's view is the same one up to this turn, radians: 15°.
const SAME_VIEW: f64 = 15.0 / 180.0 * core::f64::consts::PI;
/// Distance of a path from the end of the free space, metres, and from the edge of the frame that showed it, as a fraction of
/// its size: the clearance at the end of a step.
const MARGIN: f64 = 1.0;
const INSIDE: f64 = 0.08;

/// What a reply with boxes has shown to be free.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenSpace {
    view: View,
    /// Distance from the lens within the frame, metres.
    free: f64,
}

impl OpenSpace {
    /// The space that a reply with boxes shows to be free; `None` if something may be near. Boxes are listed only if they are
    /// nearer than the target.
    pub(super) fn shown(view: &View, reply: &Reply) -> Option<Self> {
        let target = reply.label().filter(|_| reply.status == Status::Navigating && reply.point.is_some())?;
        let near = |label: f64, is_person: bool| range_of_label(label - NEARER) - if is_person { WALKED } else { 0.0 };
        let boxes = reply.boxes.iter().map(|obstacle| near(f64::from(obstacle.depth), is_person(&obstacle.name)));
        let leads_to_person = reply.target.as_deref().is_some_and(is_person);
        let free = boxes.fold(near(target, leads_to_person), f64::min);
        (free >= OPEN).then_some(Self { view: *view, free })
    }

    /// How far from where `view` was taken it is still free, metres; `None` if that is not far, or too old, or another view.
    pub(super) fn left(&self, view: &View) -> Option<f64> {
        let turned = wrap_angle(view.pose.attitude.heading - self.view.pose.attitude.heading).abs();
        let left = self.free - self.view.pose.position.distance(view.pose.position);
        let is_fresh = view.frame.captured.since(self.view.frame.captured) <= FRESH;
        (is_fresh && turned <= SAME_VIEW && left >= OPEN).then_some(left)
    }

    /// The length of a step from `view` towards `point` that stays within it, at most `step` metres along the optical axis; `None`
    /// if that leads out of the frame that showed it.
    fn step(&self, view: &View, point: ImagePoint, step: f64) -> Option<f64> {
        let ray = view.camera.ray(point);
        let slant = libm::sqrt(1.0 + ray.right * ray.right + ray.up * ray.up);
        let step = step.min((self.left(view)? - MARGIN) / slant);
        let lifted = lift(unproject(&view.camera, point, step).ok()?, &view.camera, view.pose.attitude, Lifting::Levelled);
        let end = view.pose.position.displaced(lifted, view.pose.attitude.heading);
        let then = &self.view;
        let ahead = then.pose.position.displacement_to(end, then.pose.attitude.heading);
        let seen = project_displacement(ahead, &then.camera, then.pose.attitude, Lifting::Levelled)?;
        let is_inside = [seen.u, seen.v].iter().all(|at| (INSIDE..=1.0 - INSIDE).contains(at));
        is_inside.then_some(step)
    }
}

impl Spf {
    /// Where the boxes of a decision about a frame come from. A reply is not asked for them if the one before has shown that
    /// nothing is near.
    pub(super) fn boxes_for(&self, view: &View) -> Boxes {
        let may_skip = !self.guidance.is_off() && !self.guidance.map && self.kept_out.is_empty();
        match self.settings.avoid {
            false => Boxes::Off,
            true if may_skip && self.open.is_some_and(|open| open.left(view).is_some()) => Boxes::Skipped,
            true => Boxes::Reply,
        }
    }

    /// The step that a reply without boxes may make, metres along the optical axis; `None` if boxes are needed for it.
    pub(super) fn open_step(&self, view: &View, reply: &Reply, point: ImagePoint, step: f64) -> Option<f64> {
        let step = self.open.filter(|_| reply.status == Status::Navigating)?.step(view, point, step)?;
        let is_seen = !leads_along_edge(&self.plan_to(view, point, step), point, step, self.clearance());
        is_seen.then_some(step)
    }

    /// After a query that did not ask for boxes, however it ended, the next one does.
    pub(super) fn ask_boxes_after(&mut self, boxes: Boxes) {
        if boxes == Boxes::Skipped {
            self.open = None;
        }
    }

    /// What a reply without boxes asks for cannot be done without them.
    pub(super) fn needs_boxes(&mut self) -> Step {
        self.reading.actions.push("asks again, also for obstacles".to_owned());
        Step::Look
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::{Attitude, EnuPosition, Pose};
    use crate::guidance::Guidance;
    use crate::policy::spf::tests::{settings, told_from, view};
    use crate::policy::spf::{QueryKind, Spf};
    use crate::policy::{Policy, PolicyEvent, Step, View};
    use crate::time::{Duration, Time};

    fn policy(guidance: Guidance) -> Spf {
        let mut spf = Spf::new(settings(true)).with_guidance(guidance);
        spf.handle(PolicyEvent::Instruction("fly to the crane"));
        spf
    }

    fn guided() -> Guidance {
        Guidance { slow_anchor: true, ..Guidance::default() }
    }

    /// The frame after this many seconds, this far north, at this heading in degrees.
    fn at(seconds: u64, north: f64, heading: f64) -> View {
        let mut view = view(seconds);
        view.frame.captured = Time::ZERO + Duration::from_secs(seconds);
        let attitude = Attitude { heading: heading.to_radians(), ..Attitude::default() };
        View { pose: Pose { position: EnuPosition { north, ..EnuPosition::default() }, attitude }, ..view }
    }

    /// A crane at a label, and a box of this name at another.
    fn with_box(crane: u8, depth: u8, name: &str) -> String {
        format!(
            r#"{{"status":"navigating","point":[500,500],"depth":{crane},"target":"crane",
                "boxes":[{{"box":[400,700,600,800],"depth":{depth},"name":"{name}"}}]}}"#
        )
    }

    fn without(crane: u8) -> String {
        format!(r#"{{"status":"navigating","point":[500,500],"depth":{crane},"target":"crane"}}"#)
    }

    /// Whether this frame's query asks for boxes, and the step that follows from the answer.
    fn told(spf: &mut Spf, view: &View, answer: &str) -> (bool, Step) {
        let (query, step) = told_from(spf, view, answer);
        (query.kind == QueryKind::point(true), step)
    }

    fn forward(step: &Step) -> f64 {
        let Step::Move(motion) = step else { panic!("{step:?}") };
        motion.primitives.forward
    }

    #[test]
    fn in_the_open_every_second_query_asks_for_no_boxes() {
        let mut spf = policy(guided());
        let asks: Vec<bool> = (0..4)
            .map(|nth| {
                let answer = if nth % 2 == 0 { with_box(9, 8, "tower") } else { without(9) };
                let (asks, step) = told(&mut spf, &at(2 * nth, 3.0 * nth as f64, 0.0), &answer);
                assert!(forward(&step) > 5.0, "{step:?}");
                asks
            })
            .collect();
        assert_eq!(asks, [true, false, true, false]);
    }

    #[test]
    fn it_does_wherever_something_may_be_near() {
        let next_asks = |guidance, first: &str, next: View| {
            let mut spf = policy(guidance);
            told(&mut spf, &at(0, 0.0, 0.0), first);
            told(&mut spf, &next, &with_box(9, 8, "tower")).0
        };
        let far = with_box(9, 8, "tower");
        assert!(!next_asks(guided(), &far, at(2, 3.0, 0.0)));
        // Something nearer, somebody who may walk there, a near target, before which alone boxes are listed.
        assert!(next_asks(guided(), &with_box(9, 6, "tower"), at(2, 3.0, 0.0)));
        assert!(next_asks(guided(), &with_box(9, 7, "man"), at(2, 1.0, 0.0)));
        assert!(next_asks(guided(), &with_box(6, 8, "tower"), at(2, 3.0, 0.0)));
        // Long ago, another view, near what was far away.
        assert!(next_asks(guided(), &far, at(6, 3.0, 0.0)));
        assert!(next_asks(guided(), &far, at(2, 3.0, 20.0)));
        assert!(next_asks(guided(), &far, at(2, 12.0, 0.0)));
        // Nothing is known yet, or the switches are those of the paper.
        assert!(next_asks(guided(), r#"{"status":"not_visible","look":"left","boxes":[]}"#, at(2, 0.0, 0.0)));
        assert!(next_asks(Guidance::default(), &far, at(2, 3.0, 0.0)));
        assert!(next_asks(Guidance { map: true, ..guided() }, &far, at(2, 3.0, 0.0)));
    }

    #[test]
    fn after_an_answer_without_boxes_the_next_query_asks_for_them_however_that_one_ended() {
        let far = with_box(10, 9, "tower");
        for refused in [true, false] {
            let mut spf = policy(guided());
            told(&mut spf, &at(0, 0.0, 0.0), &far);
            let Step::Ask(query) = spf.handle(PolicyEvent::Frame(&at(1, 1.0, 0.0))) else { panic!("it asks") };
            assert_eq!(query.kind, QueryKind::point(false));
            spf.handle(if refused {
                PolicyEvent::Reply { id: query.id, text: "I see a crane." }
            } else {
                PolicyEvent::ReplyFailed { id: query.id }
            });
            assert!(told(&mut spf, &at(2, 1.0, 0.0), &far).0, "{refused}");
        }
        // A list that was not asked for is kept clear of.
        let mut spf = policy(guided());
        told(&mut spf, &at(0, 0.0, 0.0), &far);
        let wall = r#"{"status":"navigating","point":[500,500],"depth":10,"target":"crane",
            "boxes":[{"box":[0,0,1000,1000],"depth":2,"name":"wall"}]}"#;
        let (asks, step) = told(&mut spf, &at(1, 1.0, 0.0), wall);
        assert!(!asks && forward(&step) < 1.0, "{step:?}");
    }

    #[test]
    fn an_answer_without_boxes_leads_no_farther_than_is_known_to_be_free() {
        // At label 7 and with its errors a tower may stand 10 m ahead; the paper's step for label 10 has 10 m.
        let mut spf = policy(guided());
        told(&mut spf, &at(0, 0.0, 0.0), &with_box(10, 7, "tower"));
        let (asks, step) = told(&mut spf, &at(1, 1.0, 0.0), &without(10));
        assert!(!asks && (7.5..8.1).contains(&forward(&step)), "{step:?}");
        // To the side the same distance is less along the optical axis, and near the edge of the image it asks again.
        let reach = |across: u32| {
            let mut spf = policy(guided());
            told(&mut spf, &at(0, 0.0, 0.0), &with_box(10, 7, "tower"));
            let answer = format!(r#"{{"status":"navigating","point":[500,{across}],"depth":10,"target":"crane"}}"#);
            told(&mut spf, &at(1, 1.0, 0.0), &answer).1
        };
        assert!((7.5..8.1).contains(&forward(&reach(800))), "{:?}", reach(800));
        assert_eq!(reach(960), Step::Look);
        // Where no path is known, it asks again: an open direction, beside what the earlier frame showed, a way that is blocked.
        let open = r#"{"status":"not_visible","look":"ahead","open_way":{"point":[500,500],"depth":6}}"#;
        let aside = r#"{"status":"navigating","point":[500,980],"depth":9,"target":"crane"}"#;
        for answer in [open, aside, r#"{"status":"blocked"}"#] {
            let mut spf = policy(guided());
            told(&mut spf, &at(0, 0.0, 0.0), &with_box(10, 8, "tower"));
            let (asks, step) = told(&mut spf, &at(1, 1.0, 10.0), answer);
            assert_eq!((asks, step), (false, Step::Look), "{answer}");
            assert!(told(&mut spf, &at(2, 1.0, 10.0), &with_box(10, 8, "tower")).0, "{answer}");
        }
    }
}
