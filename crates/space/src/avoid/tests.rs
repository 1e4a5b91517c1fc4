use proptest::prelude::*;

use super::*;
use spf_core::geometry::{Attitude, Pose};
use spf_core::reply::DEPTH_LABELS;
use spf_core::time::Time;

/// Clearance of a quad: 0.3 m and the margin.
const CLEARANCE: f64 = 0.55;
const MIDDLE: ImagePoint = ImagePoint { u: 0.5, v: 0.5 };

fn boxed(left: f64, top: f64, right: f64, bottom: f64, depth: u8, name: &str) -> ObstacleBox {
    ObstacleBox { area: ImageBox { left, top, right, bottom }, depth, name: name.to_owned() }
}

/// 90° × 90°, level: `u` and `v` off the middle are half tangents.
fn square() -> Viewpoint {
    view(Camera::from_fov(800, 800, PI / 2.0, PI / 2.0, 0.0))
}

fn view(camera: Camera) -> Viewpoint {
    Viewpoint { camera, pose: Pose::default(), captured: Time::ZERO }
}

/// What the boxes of its own view make of a plan.
fn avoid(
    plan: &PlannedStep<'_>,
    clearance: f64,
    boxes: &[ObstacleBox],
    target: Option<&str>,
    passing: Option<PassingSide>,
) -> Avoidance {
    super::avoid(plan, clearance, &obstacles(plan.view, boxes), target, passing).0
}

/// The index of the box in the way.
fn blocking(plan: &PlannedStep<'_>, clearance: f64, boxes: &[ObstacleBox]) -> Option<usize> {
    super::avoid(plan, clearance, &obstacles(plan.view, boxes), None, None).1
}

fn obstacles(view: &Viewpoint, boxes: &[ObstacleBox]) -> Vec<Obstacle> {
    Obstacle::of(view, boxes).collect()
}

fn plan(view: &Viewpoint, step: f64) -> PlannedStep<'_> {
    PlannedStep { view, lifting: Lifting::Levelled, shape: PathShape::Straight, point: MIDDLE, step, dives: true }
}

/// Failing 9 of similar programs: boxes that are requested but never compared with the path.
#[test]
fn failing_9_a_box_on_the_path_changes_the_flight() {
    let camera = square();
    let pole = [boxed(0.45, 0.0, 0.55, 1.0, 3, "pole")];
    // Label 3 begins at 10^(1.5/4.5) = 2.15 m. A step of 4 m would fly into it ...
    let Avoidance::Shifted { point } = avoid(&plan(&camera, 4.0), CLEARANCE, &pole, Some("door"), None) else { panic!() };
    // ... its right edge stands at tan = 0.1, 5.7° off the middle, and asin(0.8 / 2.15) = 21.8° more leave room: 27.5°, so
    // the ring of 28° is the first that does. tan 28° = 0.532, half of that right of the middle.
    assert!((point.u - (0.5 + 0.5 * 28.0_f64.to_radians().tan())).abs() < 1e-9 && (point.v - 0.5).abs() < 1e-9, "{point:?}");
    // A step of 1.5 m ends 0.65 m before it, one of 1.7 m would end 0.45 m before it.
    assert_eq!(avoid(&plan(&camera, 1.5), CLEARANCE, &pole, None, None), Avoidance::Clear);
    assert_ne!(avoid(&plan(&camera, 1.7), CLEARANCE, &pole, None, None), Avoidance::Clear);
    // Where there is no path round: stop before it, 2.154 − 0.55 = 1.604 m; 16 of 40 parts of 4 m.
    let wall = [boxed(0.0, 0.0, 1.0, 1.0, 3, "wall")];
    assert_eq!(avoid(&plan(&camera, 4.0), CLEARANCE, &wall, None, None), Avoidance::Shortened { step: 1.6 });
    // Nowhere to go at all: label 2 begins at 1.292 m, of which 0.092 m may be flown, which is no step.
    let close = |depth| [boxed(0.0, 0.0, 1.0, 1.0, 9, "sky"), boxed(0.0, 0.0, 1.0, 1.0, depth, "wall")];
    assert_eq!(avoid(&plan(&camera, 0.4), 1.2, &close(2), None, None), Avoidance::Hold);
    assert_eq!(blocking(&plan(&camera, 0.4), 1.2, &close(2)), Some(1));
}

/// Label 1 stands for anything nearer than 1.29 m. The middle of its interval leaves room for a short step, but after
/// ten of those the craft would touch a wall.
#[test]
fn nothing_of_the_least_label_is_flown_towards_however_short_the_step() {
    let camera = square();
    let all = [boxed(0.0, 0.0, 1.0, 1.0, 1, "wall")];
    for step in [0.1, 0.2, 0.4, 4.0] {
        assert_eq!(avoid(&plan(&camera, step), CLEARANCE, &all, None, None), Avoidance::Hold, "{step}");
    }
    // Past it one may fly, in a direction that keeps 0.4 m away from it however near it is within its label: 31° from its edge, which
    // is 31° left of the middle.
    let left = [boxed(0.0, 0.0, 0.2, 1.0, 1, "wall")];
    for step in [0.1, 2.0] {
        let Avoidance::Shifted { point } = avoid(&plan(&camera, step), CLEARANCE, &left, None, None) else { panic!() };
        assert!((0.50..0.66).contains(&point.u), "{point:?}");
    }
    // The object at the point is not an obstacle.
    assert_eq!(avoid(&plan(&camera, 0.2), CLEARANCE, &all, Some("wall"), None), Avoidance::Clear);
    // Level first and then up to a lamp right above: the corner is beside it, the end is not.
    let lamp = [boxed(0.0, 0.0, 1.0, 0.4, 1, "lamp")];
    let up = PlannedStep { shape: PathShape::LevelThenClimb, point: ImagePoint { u: 0.5, v: 0.3 }, ..plan(&camera, 0.15) };
    assert!(!matches!(avoid(&up, 0.3, &lamp, None, None), Avoidance::Clear | Avoidance::Shortened { .. }));
}

#[test]
fn a_craft_that_may_not_dive_stops_before_a_wall_instead_of_flying_to_its_foot() {
    let camera = square();
    let wall = [boxed(0.0, 0.0, 1.0, 0.55, 4, "white wall")];
    let plan = plan(&camera, 6.0);
    let Avoidance::Shifted { point } = avoid(&plan, CLEARANCE, &wall, None, None) else { panic!("not shifted") };
    assert!(point.v > 0.6, "{point:?}");
    let held = avoid(&PlannedStep { dives: false, ..plan }, CLEARANCE, &wall, None, None);
    assert!(matches!(held, Avoidance::Shortened { step } if (2.0..4.0).contains(&step)), "{held:?}");
    // Over a low one it flies all the same.
    let low = [boxed(0.0, 0.45, 1.0, 1.0, 4, "hedge")];
    let over = avoid(&PlannedStep { dives: false, ..plan }, CLEARANCE, &low, None, None);
    assert!(matches!(over, Avoidance::Shifted { point } if point.v < 0.4), "{over:?}");
}

#[test]
fn a_path_along_the_left_or_right_edge_is_detected() {
    let camera = square();
    let along = |u: f64, step: f64| leads_along_edge(&plan(&camera, step), ImagePoint { u, v: 0.5 }, step, CLEARANCE);
    // 45° to the edge: at 4 m along the axis the end is (1 − tan)·4·cos 45° from its plane, 0.55 m at tan = 0.81.
    assert!(along(0.92, 4.0) && along(0.08, 4.0));
    assert!(!along(0.89, 4.0) && !along(0.11, 4.0));
    // A short step stays near the lens and therefore near the edge, but does not lead along it.
    assert!(along(0.7, 0.5) && !along(0.6, 0.5) && !along(0.5, 0.1));
}

#[test]
fn a_box_that_an_edge_cuts_off_extends_beyond_it() {
    let camera = square();
    // 2 m ahead and well outside the image, 60° up, down, left or right: beyond one edge each.
    let far = 2.0 * 60.0_f64.to_radians().tan();
    for (area, outside) in [
        ([0.4, 0.0, 0.6, 0.2], DVec3::new(0.0, 2.0, far)),
        ([0.4, 0.8, 0.6, 1.0], DVec3::new(0.0, 2.0, -far)),
        ([0.0, 0.4, 0.2, 0.6], DVec3::new(-far, 2.0, 0.0)),
        ([0.8, 0.4, 1.0, 0.6], DVec3::new(far, 2.0, 0.0)),
    ] {
        let [left, top, right, bottom] = area;
        let solid = |shrunk: f64| {
            let whole = boxed(left + shrunk, top + shrunk, right - shrunk, bottom - shrunk, 3, "wall");
            Solid::new(&camera, &Obstacle { from: camera, listed: whole }, 0, CLEARANCE)
        };
        assert_eq!(solid(0.0).distance(outside), 0.0, "{area:?}");
        // The same box, but whole.
        assert!(solid(0.02).distance(outside) > 0.5, "{area:?}");
    }
}

#[test]
fn what_is_far_beside_or_the_target_itself_is_not_in_the_way() {
    let camera = square();
    let clear = |boxes: &[ObstacleBox], target| avoid(&plan(&camera, 4.0), CLEARANCE, boxes, target, None) == Avoidance::Clear;
    assert!(clear(&[], None));
    // Label 6 begins at 10 m.
    assert!(clear(&[boxed(0.0, 0.0, 1.0, 1.0, 6, "house")], None));
    // At 2.15 m and tan 0.4 (21.8°) to the side there are 0.80 m between path and tree.
    assert!(clear(&[boxed(0.7, 0.0, 1.0, 1.0, 3, "tree")], None));
    let crane = [boxed(0.4, 0.4, 0.6, 0.6, 2, "Red crane ")];
    assert!(clear(&crane, Some("red Crane")));
    assert!(!clear(&crane, Some("crane")) && !clear(&crane, None));
    // Another object with the same name, which does not contain the point.
    assert!(!clear(&[boxed(0.4, 0.52, 0.6, 0.9, 2, "tree")], Some("tree")));
}

#[test]
fn the_side_is_chosen_by_angle_and_then_by_rule() {
    let camera = square();
    let shifted = |boxes: &[ObstacleBox]| match avoid(&plan(&camera, 4.0), CLEARANCE, boxes, None, None) {
        Avoidance::Shifted { point } => point,
        other => panic!("{other:?}"),
    };
    assert!(shifted(&[boxed(0.4, 0.0, 0.55, 1.0, 3, "pole")]).u > 0.5);
    assert!(shifted(&[boxed(0.45, 0.0, 0.6, 1.0, 3, "pole")]).u < 0.5);
    // Over a wall that fills the width, and under a beam.
    let over = shifted(&[boxed(0.0, 0.45, 1.0, 1.0, 3, "wall")]);
    assert!(over.v < 0.4 && (over.u - 0.5).abs() < 1e-9, "{over:?}");
    assert!(shifted(&[boxed(0.0, 0.0, 1.0, 0.55, 3, "beam")]).v > 0.6);
    // Both sides of a gap too narrow to pass are obstacles together.
    let gap = shifted(&[boxed(0.3, 0.0, 0.49, 1.0, 3, "left leaf"), boxed(0.51, 0.0, 0.7, 1.0, 3, "right leaf")]);
    assert!(gap.u > 0.7, "{gap:?}");
}

#[test]
fn a_sequential_path_is_checked_leg_by_leg() {
    let camera = square();
    // Up and ahead: straight over a kerb, but the level leg comes first and runs into it.
    let up = ImagePoint { u: 0.5, v: 0.1 };
    let kerb = [boxed(0.0, 0.5, 1.0, 1.0, 3, "kerb")];
    let straight = PlannedStep { point: up, ..plan(&camera, 4.0) };
    assert_eq!(avoid(&straight, CLEARANCE, &kerb, None, None), Avoidance::Clear);
    let sequential = PlannedStep { shape: PathShape::LevelThenClimb, ..straight };
    assert_ne!(avoid(&sequential, CLEARANCE, &kerb, None, None), Avoidance::Clear);
    // And the climb at its end, which starts below a balcony.
    let balcony = [boxed(0.4, 0.2, 0.6, 0.3, 4, "balcony")];
    let steep = PlannedStep { point: ImagePoint { u: 0.5, v: 0.0 }, ..sequential };
    assert_eq!(avoid(&PlannedStep { shape: PathShape::Straight, ..steep }, CLEARANCE, &balcony, None, None), Avoidance::Clear);
    assert_ne!(avoid(&steep, CLEARANCE, &balcony, None, None), Avoidance::Clear);
    // A lens tilted down by 20°: the level leg runs through the image where the horizon is, tan 20° above the middle.
    let tilted = view(Camera::from_fov(800, 800, PI / 2.0, PI / 2.0, 20.0_f64.to_radians()));
    let horizon = 0.5 - 0.5 * 20.0_f64.to_radians().tan();
    let bar = [boxed(0.4, horizon - 0.02, 0.6, horizon + 0.02, 3, "bar")];
    let below = PlannedStep { point: ImagePoint { u: 0.5, v: 0.9 }, view: &tilted, ..sequential };
    assert_ne!(avoid(&below, CLEARANCE, &bar, None, None), Avoidance::Clear);
    assert_eq!(avoid(&PlannedStep { shape: PathShape::Straight, ..below }, CLEARANCE, &bar, None, None), Avoidance::Clear);
}

#[test]
fn no_step_is_no_flight() {
    let camera = square();
    for (point, step) in
        [(ImagePoint { u: 1.5, v: 0.5 }, 1.0), (ImagePoint { u: f64::NAN, v: 0.5 }, 1.0), (MIDDLE, 0.0), (MIDDLE, f64::NAN)]
    {
        assert_eq!(avoid(&PlannedStep { point, ..plan(&camera, step) }, CLEARANCE, &[], None, None), Avoidance::Hold);
    }
}

/// The minimum distance between path and obstacle by brute force, in steps of 1 % of the path, 24 by 24 rays of the box
/// and 60 ranges: an independent calculation, too large by what the grid misses.
fn sampled_distance(plan: &PlannedStep<'_>, point: ImagePoint, step: f64, obstacle: &ObstacleBox) -> f64 {
    let path = plan.path(point, step).unwrap();
    let near = 10.0_f64.powf((f64::from(obstacle.depth) - 1.5) / 4.5);
    let mut least = f64::INFINITY;
    let legs = [(DVec3::ZERO, path.corner), (path.corner, path.end)];
    let way: Vec<DVec3> = legs.iter().flat_map(|&(a, b)| (0..=50).map(move |i| a + (b - a) * (f64::from(i) / 50.0))).collect();
    let area = obstacle.area;
    let label_end = 10.0_f64.powf((f64::from(obstacle.depth) - 0.5) / 4.5);
    let far =
        label_end + ((area.right - area.left) * f64::from(plan.view.camera.width) / plan.view.camera.fx * label_end).min(3.0);
    for (i, j) in (0..=24).flat_map(|i| (0..=24).map(move |j| (i, j))) {
        let fraction = |k: i32, low: f64, high: f64| low + (high - low) * f64::from(k) / 24.0;
        let toward = direction(
            &plan.view.camera,
            ImagePoint { u: fraction(i, area.left, area.right), v: fraction(j, area.top, area.bottom) },
        );
        for p in &way {
            // On one ray the nearest point is the foot, if that is neither before the near edge nor behind the far one.
            let range = p.dot(toward).clamp(near, far);
            least = least.min((*p - toward * range).length());
        }
    }
    least
}

fn boxes() -> impl Strategy<Value = Vec<ObstacleBox>> {
    let one = (0.0..=1.0f64, 0.0..=1.0f64, 0.02..=0.6f64, 0.02..=0.6f64, 1..=6u8).prop_map(|(u, v, width, height, depth)| {
        boxed(
            (u - width / 2.0).max(0.0),
            (v - height / 2.0).max(0.0),
            (u + width / 2.0).min(1.0),
            (v + height / 2.0).min(1.0),
            depth,
            "thing",
        )
    });
    proptest::collection::vec(one, 0..4)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn what_is_flown_keeps_clear(boxes in boxes(), u in 0.02..0.98f64, v in 0.02..0.98f64, step in 0.1..10.0f64, pitch in -0.3..0.3f64, roll in -0.3..0.3f64, sequential: bool) {
        let camera = view(Camera::quad());
        let shape = if sequential { PathShape::LevelThenClimb } else { PathShape::Straight };
        let attitude = Attitude { heading: 1.0, pitch, roll };
        let view = Viewpoint { pose: Pose { attitude, ..Pose::default() }, ..camera };
        let plan = PlannedStep { view: &view, lifting: Lifting::Levelled, shape, point: ImagePoint { u, v }, step, dives: true };
        let (point, flown) = match avoid(&plan, CLEARANCE, &boxes, None, None) {
            Avoidance::Clear => (plan.point, step),
            Avoidance::Shifted { point } => {
                prop_assert!((0.0..=1.0).contains(&point.u) && (0.0..=1.0).contains(&point.v));
                (point, step)
            }
            Avoidance::Shortened { step: shorter, .. } => {
                prop_assert!(shorter < step && shorter >= MIN_STEP);
                (plan.point, shorter)
            }
            Avoidance::Hold => {
                prop_assert!(blocking(&plan, CLEARANCE, &boxes).is_some());
                return Ok(());
            }
        };
        for obstacle in &boxes {
            let least = sampled_distance(&plan, point, flown, obstacle);
            prop_assert!(least >= CLEARANCE - 1e-6, "{least} {obstacle:?}");
        }
    }

    #[test]
    fn a_straight_path_is_only_changed_for_a_reason(boxes in boxes(), u in 0.02..0.98f64, v in 0.02..0.98f64, step in 0.1..10.0f64) {
        let camera = view(Camera::quad());
        let plan = PlannedStep { point: ImagePoint { u, v }, ..plan(&camera, step) };
        if let Some(by) = blocking(&plan, CLEARANCE, &boxes) {
            // The brute force misses at most what lies between its rays and samples.
            let least = sampled_distance(&plan, plan.point, step, &boxes[by]);
            prop_assert!(boxes[by].depth == 1 || least < CLEARANCE + 0.15, "{least} {:?}", boxes[by]);
        }
    }

    #[test]
    fn a_farther_label_never_makes_it_worse(boxes in boxes(), u in 0.02..0.98f64, v in 0.02..0.98f64, step in 0.1..10.0f64) {
        let camera = view(Camera::quad());
        let plan = PlannedStep { point: ImagePoint { u, v }, ..plan(&camera, step) };
        let farther: Vec<ObstacleBox> = boxes.iter().map(|b| ObstacleBox { depth: (b.depth + 1).min(DEPTH_LABELS), ..b.clone() }).collect();
        if avoid(&plan, CLEARANCE, &boxes, None, None) == Avoidance::Clear {
            prop_assert_eq!(avoid(&plan, CLEARANCE, &farther, None, None), Avoidance::Clear);
        }
    }
}

fn standing(name: &str, left: f64, right: f64, depth: u8) -> ObstacleBox {
    ObstacleBox { area: ImageBox { left, top: 0.2, right, bottom: 0.8 }, depth, name: name.to_owned() }
}

#[test]
fn more_is_kept_free_around_a_person() {
    let camera = view(Camera::quad());
    // 2.15 m away and 12 to 17° right of the way: 0.45 to 0.65 m beside it.
    let beside = |name: &str| avoid(&plan(&camera, 4.0), 0.4, &[standing(name, 0.62, 0.66, 3)], None, None);
    assert_eq!(beside("post"), Avoidance::Clear);
    assert_ne!(beside("person"), Avoidance::Clear);
    assert_ne!(beside("legs of a man"), Avoidance::Clear);
}

#[test]
fn what_another_view_has_shown_stands_where_it_was() {
    let here = view(Camera::quad());
    let turned =
        |heading: f64| Viewpoint { pose: Pose { attitude: Attitude { heading, ..Attitude::default() }, ..here.pose }, ..here };
    // A post straight ahead, 3.6 to 6 m away, and the craft turned by 60° since: out of the image.
    let post = Obstacle { from: here, listed: boxed(0.45, 0.2, 0.55, 1.0, 4, "post") };
    let outcome = |view: &Viewpoint, point: f64, step: f64| {
        let plan = PlannedStep { point: ImagePoint { u: point, v: 0.5 }, ..plan(view, step) };
        super::avoid(&plan, CLEARANCE, core::slice::from_ref(&post), None, None).0
    };
    let side = turned(PI / 3.0);
    assert_eq!(outcome(&here, 0.5, 3.0), Avoidance::Clear);
    assert_ne!(outcome(&here, 0.5, 4.0), Avoidance::Clear);
    assert_eq!(outcome(&side, 0.5, 6.0), Avoidance::Clear);
    // 45° left of there is 15° right of the post: 0.55 m to the side at 2.1 m, but from 3.6 m on there are 0.7 m.
    assert_eq!(outcome(&side, 0.0, 4.0), Avoidance::Clear);
    let aside = turned(PI / 4.0);
    assert_ne!(outcome(&aside, 0.02, 4.0), Avoidance::Clear);
    // Flown past it, it is behind.
    let position = here.pose.position.displaced(BodyDisplacement { forward: 8.0, right: 0.0, up: 0.0 }, 0.0);
    let past = Viewpoint { pose: Pose { position, ..here.pose }, ..here };
    assert_eq!(outcome(&past, 0.5, 6.0), Avoidance::Clear);
}

#[test]
fn whatever_leads_away_is_free() {
    let here = view(Camera::quad());
    // The last target, a chair an arm's length ahead, and another to its right; then the craft turns by 120°.
    let chair = Obstacle { from: here, listed: boxed(0.3, 0.3, 0.7, 1.0, 1, "chair") };
    let pose = Pose { attitude: Attitude { heading: 2.1, ..Attitude::default() }, ..here.pose };
    let away = Viewpoint { pose, ..here };
    assert_eq!(super::avoid(&plan(&away, 3.0), CLEARANCE, core::slice::from_ref(&chair), None, None).0, Avoidance::Clear);
    assert_ne!(super::avoid(&plan(&here, 3.0), CLEARANCE, &[chair], None, None).0, Avoidance::Clear);
}

#[test]
fn behind_a_thing_the_path_is_free_again() {
    let here = view(Camera::quad());
    // A pole of 2.8 m, thin, that the craft has passed to the left: what is right behind it is seen to be free.
    let position = here.pose.position.displaced(BodyDisplacement { forward: 5.0, right: -1.5, up: 0.0 }, 0.0);
    let pole = Obstacle { from: here, listed: boxed(0.49, 0.0, 0.51, 1.0, 3, "pole") };
    let past = Viewpoint { pose: Pose { position, attitude: Attitude { heading: 0.7, ..Attitude::default() } }, ..here };
    assert_eq!(super::avoid(&plan(&past, 4.0), CLEARANCE, &[pole], None, None).0, Avoidance::Clear);
}

#[test]
fn the_side_to_keep_comes_first_and_alone_if_it_is_strict() {
    let camera = view(Camera::quad());
    let post = [standing("post", 0.46, 0.50, 3)];
    let to = |keep| match avoid(&plan(&camera, 4.0), CLEARANCE, &post, None, keep) {
        Avoidance::Shifted { point } => point.u - 0.5,
        other => panic!("{other:?}"),
    };
    let keep = |side| Some(PassingSide { side, strict: true });
    assert!(to(None) > 0.0 && to(keep(Side::Left)) < 0.0 && to(keep(Side::Right)) > 0.0);
    // A wall to the left, up and down.
    let wall =
        [ObstacleBox { area: ImageBox { left: 0.0, top: 0.0, right: 0.55, bottom: 1.0 }, depth: 3, name: "wall".to_owned() }];
    let kept = |keep| avoid(&plan(&camera, 4.0), CLEARANCE, &wall, None, keep);
    assert!(matches!(kept(keep(Side::Left)), Avoidance::Shortened { .. }), "{:?}", kept(keep(Side::Left)));
    assert!(matches!(kept(Some(PassingSide { side: Side::Left, strict: false })), Avoidance::Shifted { .. }));
}
