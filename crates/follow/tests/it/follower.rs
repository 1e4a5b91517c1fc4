//! Walkers that turn and stop, followed by the craft of the executor's tests.

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::direction::Direction;
use spf_core::frame::FrameId;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{Lifting, label_of_range, project_displacement, range_of_label};
use spf_core::motion::MotionEstimate;
use spf_core::query::{ImageBox, QueryId};
use spf_core::rng::RandomStream;
use spf_core::time::{Duration, Time};
use spf_core::track::{TrackQuality, TrackReport};
use spf_follow::follower::Follower;
use spf_motion::executor::craft_model::CraftModel;
use spf_pilot::steering::{Answer, DEFAULT_KEEP, WayOut};

/// Frames, reports and setpoints: 10 a second.
const TICK: Duration = Duration::from_millis(100);
/// From a frame's capture to the report on it.
const DELAY: Duration = Duration::from_millis(200);
/// From a person's middle to their surface, metres.
const SURFACE: f64 = 0.2;
/// A person's shoulders, metres, and the standard deviation of the logarithm of their stature about 1.7 m.
const SHOULDERS: f64 = 0.5;
const STATURES: f64 = 0.06;
/// Standard deviations of the edges of a reply's box as a fraction of its height, and of the camera's pitch, radians, which telemetry
/// does not tell and which changes within a second.
const EDGES: f64 = 0.03;
const PITCH: f64 = 0.02;
/// Standard deviation of the error of the height that telemetry tells, metres.
const HEIGHT: f64 = 0.2;
/// Random walk of the logarithm of a track's scale, 1/√s.
const DRIFT: f64 = 0.05;

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
    /// Within 3 m of the person's surface.
    within_3_m: f64,
    touched: bool,
    nearest: f64,
    /// Mean of the error of the logarithm of the range, and the fraction of the ranges that are within their standard deviation.
    error: f64,
    honest: f64,
}

/// When and where it was taken, the person's box in it, and their range.
type Frame = (Time, Pose, Option<ImageBox>, f64);

/// The box around a person of this stature who stands at a place on the ground; its edges may be beyond the image's.
fn box_at(camera: &Camera, pose: Pose, person: EnuPosition, stature: f64) -> Option<ImageBox> {
    let project = |up: f64| {
        let away = pose.position.displacement_to(EnuPosition { up, ..person }, pose.attitude.heading);
        project_displacement(away, camera, pose.attitude, Lifting::Levelled)
    };
    let (head, foot) = (project(stature)?, project(0.0)?);
    let wide = 0.5 * SHOULDERS / stature * (foot.v - head.v) * f64::from(camera.height) / f64::from(camera.width);
    let u = 0.5 * (head.u + foot.u);
    let area = ImageBox { left: u - wide, right: u + wide, top: head.v, bottom: foot.v };
    (u > 0.0 && u < 1.0 && area.top < 0.9 && area.bottom > 0.1).then_some(area)
}

/// What a reply's box shows of it.
fn cut(area: ImageBox, random: &mut RandomStream) -> ImageBox {
    let noise = EDGES * (area.bottom - area.top);
    let mut edge = |at: f64| (at + noise * random.normal()).clamp(0.0, 1.0);
    let (top, bottom) = (edge(area.top), edge(area.bottom));
    ImageBox { left: area.left.clamp(0.0, 1.0), right: area.right.clamp(0.0, 1.0), top: top.min(bottom), bottom: top.max(bottom) }
}

/// Flies after a person who walks for 60 s.
fn walk(walk: Walk, seed: u64) -> Went {
    let Walk { craft, camera, speed, latency, losses } = walk;
    let mut random = RandomStream::new(seed, "walk", &[]);
    let stature = 1.7 * (STATURES * random.normal()).exp();
    let too_high = HEIGHT * random.normal();
    let (mut pitch, mut drift) = (0.0, 0.0_f64);
    let mut model = CraftModel::new(craft);
    model.position.up = if craft.cruise_speed > 2.0 { 3.0 } else { 1.2 };
    let start = model.now;
    let ahead = Direction { bearing: model.heading, elevation: 0.0 }.place(model.position, 8.0);
    let mut person = EnuPosition { up: 0.0, ..ahead };
    let mut course = core::f64::consts::TAU * random.uniform();
    let mut follower = Follower::new(camera, DEFAULT_KEEP);
    let (mut frames, mut tracked) = (Vec::<Frame>::new(), None);
    let (mut asked, mut id) = (0_usize, 0_u64);
    let mut went = Went { nearest: f64::INFINITY, ..Went::default() };
    let (mut counted, mut estimates) = (0.0, 0.0);
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
        let range = model.position.distance(EnuPosition { up: 0.5 * stature, ..person });
        pitch = 0.9 * pitch + (1.0_f64 - 0.81).sqrt() * PITCH * random.normal();
        let mut truly = model.pose();
        truly.attitude.pitch += pitch;
        let seen = box_at(&camera, truly, person, stature);
        let mut told = model.pose();
        told.position.up += too_high;
        frames.push((now, told, seen, range));
        // The reply about an earlier frame.
        if now.since(frames[asked].0).as_secs_f64() >= latency {
            let (captured, pose, area, range) = frames[asked];
            if let Some(area) = area {
                id += 1;
                let label = label_of_range((range - SURFACE) * (0.2 * random.normal()).exp());
                let range_said = range_of_label(f64::from(label));
                let area = cut(area, &mut random);
                follower.answer(&Answer { captured, pose, area, range: range_said, is_person: true });
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
                drift += DRIFT * 0.1_f64.sqrt() * random.normal();
                let scale = range_at_start / range * (drift + 0.015 * random.normal()).exp();
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
            went.within_3_m += f64::from(u8::from(apart <= 3.0 + SURFACE));
            if let Some(target) = follower.target(now, model.position).filter(|target| target.is_sure) {
                let estimate = model.position.distance(target.position);
                let truth = model.position.distance(EnuPosition { up: 0.5 * stature, ..person }) - SURFACE;
                let error = (estimate / truth).ln();
                went.error += error;
                went.honest += f64::from(u8::from(error.abs() <= target.range_sd / estimate));
                estimates += 1.0;
            }
        }
    }
    Went {
        in_view: went.in_view / counted,
        within_5_m: went.within_5_m / counted,
        within_3_m: went.within_3_m / counted,
        error: went.error / estimates,
        honest: went.honest / estimates,
        ..went
    }
}

/// Means over walks; `touched` is the fraction of walks with a touch.
#[derive(Clone, Copy, Debug)]
struct Means {
    in_view: f64,
    within_5_m: f64,
    within_3_m: f64,
    touched: f64,
    error: f64,
    honest: f64,
}

fn walks(of: Walk) -> Means {
    let went: Vec<Went> = (0..40).map(|seed| walk(of, seed)).collect();
    let mean = |value: fn(&Went) -> f64| went.iter().map(value).sum::<f64>() / went.len() as f64;
    Means {
        in_view: mean(|went| went.in_view),
        within_5_m: mean(|went| went.within_5_m),
        within_3_m: mean(|went| went.within_3_m),
        touched: mean(|went| f64::from(u8::from(went.touched))),
        error: mean(|went| went.error),
        honest: mean(|went| went.honest),
    }
}

fn quad(speed: f64, latency: f64, losses: f64) -> Walk {
    Walk { craft: Craft::quad(), camera: Camera::quad(), speed, latency, losses }
}

fn tello(speed: f64, latency: f64, losses: f64) -> Walk {
    Walk { craft: Craft::tello(), camera: Camera::tello(), speed, latency, losses }
}

#[test]
fn a_walker_is_kept_in_view_and_near_and_is_not_touched() {
    for (of, in_view, within_5_m, within_3_m, touched) in [
        (quad(0.5, 1.5, 0.0), 0.98, 0.95, 0.9, 0.0),
        (quad(1.0, 1.5, 0.0), 0.98, 0.95, 0.9, 0.0),
        (quad(1.5, 1.5, 0.0), 0.97, 0.9, 0.85, 0.25),
        (quad(1.0, 3.0, 0.0), 0.98, 0.95, 0.85, 0.0),
        (quad(1.0, 1.5, 0.1), 0.95, 0.9, 0.85, 0.05),
        (quad(1.0, 3.0, 0.1), 0.9, 0.8, 0.7, 0.1),
        (tello(0.5, 1.5, 0.0), 0.98, 0.95, 0.85, 0.0),
        (tello(0.5, 1.5, 0.05), 0.98, 0.95, 0.8, 0.0),
    ] {
        let went = walks(of);
        println!("{} m/s, {} s, {}: {went:?}", of.speed, of.latency, of.losses);
        assert!(went.in_view >= in_view && went.within_5_m >= within_5_m && went.within_3_m >= within_3_m, "{went:?}");
        assert!(went.touched <= touched, "{went:?}");
        // Nobody is tracked to the end of some walks that lose them.
        assert!(went.error.is_nan() || went.error.abs() < 0.15 && went.honest > 0.55, "{went:?}");
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
        follower.answer(&Answer { captured: at(0), pose, area, range, is_person: false });
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

/// Beside the straight way the craft is faster, so that it gets away as fast, and it does not get any nearer.
#[test]
fn a_way_aside_is_flown_faster_than_one_straight_away() {
    let (camera, craft) = (Camera::quad(), Craft::quad());
    let pose = Pose { position: EnuPosition { up: 1.2, ..EnuPosition::default() }, ..Pose::default() };
    let area = ImageBox { left: 0.4, right: 0.6, top: 0.3, bottom: 0.9 };
    let speed = |bearing: f64| {
        let mut follower = Follower::new(camera, DEFAULT_KEEP);
        follower.answer(&Answer { captured: Time::ZERO, pose, area, range: 2.0, is_person: false });
        let known = MotionEstimate { position: pose.position, ..MotionEstimate::default() };
        let setpoint = follower.setpoint(Time::ZERO, &known, &craft, Some(WayOut { bearing, speed: 2.0 })).unwrap();
        (libm::hypot(setpoint.forward, setpoint.right), setpoint.forward)
    };
    let (back, _) = speed(core::f64::consts::PI);
    let (diagonal, away) = speed(core::f64::consts::PI - core::f64::consts::FRAC_PI_3);
    let (aside, toward) = speed(core::f64::consts::FRAC_PI_2);
    assert!((diagonal / back - 2.0).abs() < 0.05 && (away + back).abs() < 0.05, "{back} {diagonal} {away}");
    assert!((aside / back - 2.0).abs() < 0.05 && toward.abs() < 1e-6, "{aside} {toward}");
}

#[test]
fn a_person_is_looked_at_from_where_all_of_them_is_in_the_image() {
    let (camera, craft) = (Camera::tello(), Craft::tello());
    let climb = |up: f64| {
        let pose = Pose { position: EnuPosition { up, ..EnuPosition::default() }, ..Pose::default() };
        let person = EnuPosition { north: 2.7, ..EnuPosition::default() };
        let area = box_at(&camera, pose, person, 1.7).unwrap();
        let area = ImageBox { top: area.top.max(0.0), bottom: area.bottom.min(1.0), ..area };
        let mut follower = Follower::new(camera, DEFAULT_KEEP);
        follower.answer(&Answer { captured: Time::ZERO, pose, area, range: 2.5, is_person: true });
        let known = MotionEstimate { position: pose.position, ..MotionEstimate::default() };
        follower.setpoint(Time::ZERO, &known, &craft, None).unwrap().up
    };
    // From 1.1 m, 5° downwards; from lower the image cuts off the head, from higher the feet.
    assert_eq!(climb(1.1), 0.0);
    assert!(climb(0.7) > 0.1 && climb(1.5) < -0.1, "{} {}", climb(0.7), climb(1.5));
}
