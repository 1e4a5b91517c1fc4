//! Walkers that turn and stop, followed by the craft of the executor's tests.

use super::*;
use crate::executor::craft_model::CraftModel;
use crate::frame::FrameId;
use crate::lift::{label_of_range, project_displacement, range_of_label};
use crate::rng::RandomStream;

/// Frames, reports and setpoints: 10 a second.
const TICK: Duration = Duration::from_millis(100);
/// From a frame's capture to the report on it.
const DELAY: Duration = Duration::from_millis(200);
/// Height and width of the box around a person's middle, metres.
const PERSON: (f64, f64) = (1.7, 0.5);

/// A walk and how it is seen.
#[derive(Clone, Copy)]
struct Walk {
    craft: Craft,
    camera: Camera,
    /// Speed of the person, m/s.
    speed: f64,
    /// From a frame's capture to its reply, s.
    latency: f64,
    /// How often the tracker loses the target, 1/s; each time until the next reply.
    losses: f64,
}

/// How a walk went: fractions of the time after the first 15 s.
#[derive(Clone, Copy, Debug, Default)]
struct Went {
    in_view: f64,
    within_5_m: f64,
    touched: bool,
    nearest: f64,
}

/// When and where it was taken, the person's box in it, and their range.
type Frame = (Time, Pose, Option<ImageBox>, f64);

fn box_at(camera: &Camera, pose: Pose, person: EnuPosition) -> Option<ImageBox> {
    let away = pose.position.displacement_to(person, pose.attitude.heading);
    let at = project_displacement(away, camera, pose.attitude, Lifting::Levelled).filter(|at| at.is_in_image())?;
    let range = away.length();
    let (high, wide) = (0.25 * PERSON.0 / range, 0.25 * PERSON.1 / range);
    Some(ImageBox { left: at.u - wide, right: at.u + wide, top: at.v - high, bottom: at.v + high })
}

/// Flies after a person who walks for 60 s.
fn walk(walk: Walk, seed: u64) -> Went {
    let Walk { craft, camera, speed, latency, losses } = walk;
    let mut random = RandomStream::new(seed, "walk", &[]);
    let mut model = CraftModel::new(craft);
    model.position.up = if craft.cruise_speed > 2.0 { 3.0 } else { 1.2 };
    let start = model.now;
    let ahead = Direction { bearing: model.heading, elevation: 0.0 }.place(model.position, 8.0);
    let mut person = EnuPosition { up: 0.9, ..ahead };
    let mut course = core::f64::consts::TAU * random.uniform();
    let mut follower = Follower::new(camera, DEFAULT_KEEP);
    let (mut frames, mut tracked) = (Vec::<Frame>::new(), None);
    let (mut asked, mut id) = (0_usize, 0_u64);
    let mut went = Went { nearest: f64::INFINITY, ..Went::default() };
    let mut counted = 0.0;
    for tick in 0..600_usize {
        let now = start + TICK * tick as u32;
        model.fly_until(now);
        if tick % 50 == 0 {
            course += 1.2 * (2.0 * random.uniform() - 1.0);
        }
        // Stands still in every fourth stretch of 5 s.
        let pace = if tick / 50 % 4 == 3 { 0.0 } else { speed };
        person.east += pace * 0.1 * course.sin();
        person.north += pace * 0.1 * course.cos();
        let range = model.position.distance(person);
        let seen = box_at(&camera, model.pose(), person);
        frames.push((now, model.pose(), seen, range));
        // The reply about an earlier frame.
        if now.since(frames[asked].0).as_secs_f64() >= latency {
            let (captured, pose, area, range) = frames[asked];
            if let Some(area) = area {
                id += 1;
                let label = label_of_range(range * (0.2 * random.normal()).exp());
                let range_said = range_of_label(f64::from(label));
                follower.answer(&Answer { captured, pose, area, range: range_said });
                tracked = Some((QueryId(id), range));
            }
            asked = frames.len() - 1;
        }
        let delay = (DELAY.as_nanos() / TICK.as_nanos()) as usize;
        if let (Some((track, range_at_start)), Some(&(captured, pose, area, range))) =
            (tracked, frames.get(frames.len().wrapping_sub(1 + delay)))
        {
            if area.is_none() || random.chance(losses * 0.1) {
                tracked = None;
            } else if let Some(area) = area {
                let scale = range_at_start / range * (0.015 * random.normal()).exp();
                let quality = TrackQuality::Good;
                let frame = FrameId(tick as u64);
                follower.report(&TrackReport { id: track, frame, captured, area, scale, quality }, pose);
            }
        }
        let away = (model.position.east - person.east).atan2(model.position.north - person.north);
        let setpoint =
            follower.setpoint(now, &model.known(), &craft, Some(WayOut { bearing: away, speed: 2.0 })).unwrap_or(Setpoint::HOLD);
        model.send(setpoint);
        let apart = model.position.horizontal_distance(person);
        went.nearest = went.nearest.min(apart);
        went.touched |= apart < 0.25 + craft.radius;
        if tick >= 150 {
            counted += 1.0;
            went.in_view += f64::from(u8::from(seen.is_some()));
            went.within_5_m += f64::from(u8::from(apart <= 5.0));
        }
    }
    Went { in_view: went.in_view / counted, within_5_m: went.within_5_m / counted, ..went }
}

/// Means over walks: in view, within 5 m, fraction of walks with a touch.
fn walks(of: Walk) -> (f64, f64, f64) {
    let went: Vec<Went> = (0..40).map(|seed| walk(of, seed)).collect();
    let mean = |value: fn(&Went) -> f64| went.iter().map(value).sum::<f64>() / went.len() as f64;
    (mean(|went| went.in_view), mean(|went| went.within_5_m), mean(|went| f64::from(u8::from(went.touched))))
}

fn quad(speed: f64, latency: f64, losses: f64) -> Walk {
    Walk { craft: Craft::quad(), camera: Camera::quad(), speed, latency, losses }
}

#[test]
fn a_walker_is_kept_in_view_and_near_and_is_not_touched() {
    for (of, in_view, within, touched) in [
        (quad(0.5, 1.5, 0.0), 0.98, 0.95, 0.0),
        (quad(1.0, 1.5, 0.0), 0.98, 0.95, 0.0),
        (quad(1.5, 1.5, 0.0), 0.97, 0.9, 0.05),
        (quad(1.0, 3.0, 0.0), 0.98, 0.95, 0.0),
        (quad(1.0, 1.5, 0.1), 0.95, 0.9, 0.05),
        (quad(1.0, 3.0, 0.1), 0.9, 0.8, 0.1),
    ] {
        let went = walks(of);
        println!("{} m/s, {} s, {}: {went:?}", of.speed, of.latency, of.losses);
        assert!(went.0 >= in_view && went.1 >= within && went.2 <= touched, "{went:?}");
    }
}

/// A tracker that takes a part of somebody for all of them says that they walk away: the craft does not follow into them.
#[test]
fn somebody_who_fills_the_image_is_not_come_nearer_to_whatever_the_track_says() {
    let (camera, craft) = (Camera::quad(), Craft::quad());
    let pose = Pose { position: EnuPosition { up: 1.2, ..EnuPosition::default() }, ..Pose::default() };
    let at = |tenths: u32| Time::ZERO + TICK * tenths;
    let whole = ImageBox { left: 0.3, right: 0.7, top: 0.0, bottom: 1.0 };
    let part = ImageBox { left: 0.45, right: 0.55, top: 0.4, bottom: 0.6 };
    let forward = |area: ImageBox, range: f64| {
        let mut follower = Follower::new(camera, DEFAULT_KEEP);
        follower.answer(&Answer { captured: at(0), pose, area, range });
        for tenths in 1..15 {
            let scale = 1.0 / (1.0 + 0.2 * f64::from(tenths));
            let frame = FrameId(u64::from(tenths));
            let quality = TrackQuality::Good;
            follower.report(&TrackReport { id: QueryId(1), frame, captured: at(tenths), area: part, scale, quality }, pose);
        }
        let known = MotionEstimate { position: pose.position, ..MotionEstimate::default() };
        follower.setpoint(at(15), &known, &craft, None).unwrap().forward
    };
    assert!(forward(part, 3.0) > 1.0, "somebody who walks away is followed");
    assert_eq!(forward(whole, 3.0), 0.0, "cut off above and below");
    assert_eq!(forward(part, 1.0), 0.0, "label 1");
}
