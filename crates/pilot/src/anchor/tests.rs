use proptest::prelude::*;

use super::*;
use spf_core::geometry::Attitude;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::rng::RandomStream;

fn at(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

fn towards(from: EnuPosition, to: EnuPosition) -> EnuDirection {
    EnuDirection::towards(at(to.east - from.east, to.north - from.north, to.up - from.up))
}

/// A sighting of `target` from `from` at `secs`, with a range to 20 %.
fn sighting(secs: f64, from: EnuPosition, target: EnuPosition) -> Sighting {
    Sighting {
        captured: Time::from_secs_f64(secs),
        id: (secs * 1e3) as u64,
        stage: 1,
        from,
        odometry: Odometry::default(),
        direction: towards(from, target),
        bearing_sigma: 0.02,
        elevation_sigma: 0.02,
        range: Some(RangeReading { ln_range: libm::log(from.distance(target)), sigma: 0.2 }),
    }
}

fn near(a: EnuPosition, b: EnuPosition, within: f64) -> bool {
    a.distance(b) < within
}

/// By hand: 20 m north, range to 20 %, bearing to 0.02, no extent: 4 m along and 0.4 m across.
#[test]
fn the_first_sighting_is_the_anchor_with_its_own_uncertainty() {
    let mut anchors = Anchors::new(AnchorSettings { extent: 0.0, ..AnchorSettings::default() });
    assert_eq!(anchors.observe(sighting(1.0, at(0.0, 0.0, 3.0), at(0.0, 20.0, 3.0))), Gate::Opened);
    let sight = anchors.anchor().unwrap().seen_from(at(0.0, 0.0, 3.0), Odometry::default());
    assert!(near(sight.position, at(0.0, 20.0, 3.0), 1e-9));
    assert!((sight.range_sd - 4.0).abs() < 1e-9 && (sight.lateral_sd - 0.4).abs() < 1e-9, "{sight:?}");
    // From 15 m nearer the same 4 m are most of the range, which is then no longer well known.
    let closer = anchors.anchor().unwrap().seen_from(at(0.0, 15.0, 3.0), Odometry::default());
    assert!((closer.range - 5.0).abs() < 1e-9 && (closer.range_sd - 4.0).abs() < 1e-9);
    assert!(!closer.is_sure() && closer.step_limit() == 3.0 && !closer.may_approach_unseen(0.0));
    assert!(sight.is_sure() && (sight.step_limit() - 0.5 * (20.0 - 4.0 - 0.3)).abs() < 1e-9 && sight.may_approach_unseen(11.0));
}

/// The second of two ranges of 20 % from the same place counts 1/2.16 as much as the first (one of two, and 1.08 for the
/// gate), and their logarithms are averaged: (2.16·ln 10 + ln 14.4)/3.16 is ln 11.22.
#[test]
fn two_ranges_from_one_place_average_in_the_logarithm() {
    let mut anchors = Anchors::new(AnchorSettings { extent: 0.0, ..AnchorSettings::default() });
    let from = at(0.0, 0.0, 0.0);
    anchors.observe(sighting(1.0, from, at(10.0, 0.0, 0.0)));
    assert!(matches!(anchors.observe(sighting(2.0, from, at(14.4, 0.0, 0.0))), Gate::Fused { switched: false, .. }));
    let anchor = anchors.anchor().unwrap();
    assert!(near(anchor.position(), at(11.223, 0.0, 0.0), 1e-3), "{:?}", anchor.position());
    assert!((libm::sqrt(anchor.covariance()[2][2]) - 0.2 * libm::sqrt(2.16 / 3.16)).abs() < 1e-6);
    assert_eq!((anchor.hits, anchor.last_seen), (2, Time::from_millis(2000)));
}

/// JSON knows no infinity, and a log that holds one could not be read.
#[test]
fn a_target_seen_on_the_other_side_is_a_doubt_that_can_be_recorded() {
    let from = at(0.0, 0.0, 3.0);
    let mut anchors = Anchors::default();
    anchors.observe(sighting(0.0, from, at(0.0, 20.0, 3.0)));
    let gate = anchors.observe(sighting(1.0, from, at(0.0, -20.0, 3.0)));
    assert_eq!(gate, Gate::Doubted { distance: None });
    let text = serde_json::to_string(&gate).unwrap();
    assert_eq!(serde_json::from_str::<Gate>(&text).unwrap(), gate, "{text}");
}

/// A look-alike or a wrong answer costs one sighting: the next one decides, for the anchor or against it.
#[test]
fn what_does_not_fit_is_a_doubt_that_the_next_sighting_decides() {
    let (from, tree, other) = (at(0.0, 0.0, 3.0), at(0.0, 20.0, 3.0), at(15.0, 15.0, 3.0));
    let mut anchors = Anchors::default();
    anchors.observe(sighting(0.0, from, tree));
    let Gate::Doubted { distance: Some(distance) } = anchors.observe(sighting(1.0, from, other)) else { panic!("fits") };
    assert!(distance > 100.0 && anchors.is_contested());
    assert!(near(anchors.anchor().unwrap().position(), tree, 1e-9), "a doubt moves nothing");

    let mut kept = anchors.clone();
    assert!(matches!(kept.observe(sighting(2.0, from, tree)), Gate::Fused { switched: false, .. }));
    assert!(!kept.is_contested() && near(kept.anchor().unwrap().position(), tree, 0.01));

    assert!(matches!(anchors.observe(sighting(2.0, from, other)), Gate::Fused { switched: true, .. }));
    assert!(!anchors.is_contested() && near(anchors.anchor().unwrap().position(), other, 0.01));
}

#[test]
fn there_are_at_most_three_hypotheses_and_the_oldest_doubt_gives_way() {
    let from = at(0.0, 0.0, 0.0);
    let mut anchors = Anchors::default();
    let places = [at(0.0, 20.0, 0.0), at(20.0, 0.0, 0.0), at(0.0, -20.0, 0.0), at(-20.0, 0.0, 0.0)];
    for (i, place) in places.into_iter().enumerate() {
        anchors.observe(sighting(i as f64, from, place));
    }
    let held: Vec<_> = anchors.hypotheses().iter().map(Anchor::position).collect();
    assert_eq!(held.len(), 3);
    for (held, place) in held.iter().zip([places[0], places[3], places[2]]) {
        assert!(near(*held, place, 1e-9));
    }
}

#[test]
fn a_later_stage_replaces_the_target_and_an_earlier_one_has_no_effect() {
    let from = at(0.0, 0.0, 0.0);
    let mut anchors = Anchors::default();
    anchors.observe(sighting(0.0, from, at(0.0, 20.0, 0.0)));
    assert_eq!(anchors.observe(Sighting { stage: 2, ..sighting(1.0, from, at(9.0, 0.0, 0.0)) }), Gate::Opened);
    assert_eq!(anchors.observe(sighting(2.0, from, at(0.0, 20.0, 0.0))), Gate::EarlierStage);
    assert!(near(anchors.anchor().unwrap().position(), at(9.0, 0.0, 0.0), 1e-9));
    assert_eq!(anchors.anchor().unwrap().stage, 2);
}

#[test]
fn a_target_is_passed_when_it_lies_behind_as_seen_from_the_last_frame() {
    let mut anchors = Anchors::default();
    let target = at(0.0, 20.0, 3.0);
    for secs in 0..10 {
        anchors.observe(sighting(f64::from(secs), at(0.0, 0.0, 3.0), target));
    }
    let anchor = anchors.anchor().unwrap();
    let passed = |north| anchor.is_passed(at(0.5, north, 3.0), Odometry::default());
    assert!(!passed(5.0) && !passed(16.0) && passed(19.0) && passed(21.0));
    let camera = Camera::quad();
    let pose = |heading| Pose { position: at(0.0, 5.0, 3.0), attitude: Attitude { heading, ..Attitude::default() } };
    assert!(anchor.image_point(&camera, pose(0.0), Lifting::Levelled).is_some());
    assert!([1.0, 3.0].iter().all(|turn| anchor.image_point(&camera, pose(*turn), Lifting::Levelled).is_none()));
}

/// By hand: after 20 m by dead reckoning, 5 % of the distance is 1 m, half of its variance on each axis.
#[test]
fn dead_reckoning_adds_its_drift() {
    let mut anchors = Anchors::new(AnchorSettings { extent: 0.0, ..AnchorSettings::default() });
    let from = at(0.0, 0.0, 0.0);
    anchors.observe(sighting(0.0, from, at(0.0, 30.0, 0.0)));
    let before = anchors.anchor().unwrap().seen_from(from, Odometry::default());
    let after = anchors.anchor().unwrap().seen_from(from, Odometry { way: 20.0, ..Odometry::default() });
    assert!((after.range_sd * after.range_sd - before.range_sd * before.range_sd - 0.5).abs() < 1e-9);
    assert!((after.lateral_sd * after.lateral_sd - before.lateral_sd * before.lateral_sd - 0.5).abs() < 1e-9);
}

#[test]
fn positions_before_a_jump_are_forgotten() {
    let mut anchors = Anchors::default();
    let from = at(0.0, 0.0, 0.0);
    anchors.observe(sighting(1.0, from, at(0.0, 30.0, 0.0)));
    anchors.observe(sighting(3.0, from, at(30.0, 0.0, 0.0)));
    anchors.lose_track(Time::from_millis(2000));
    assert_eq!(anchors.hypotheses().len(), 1);
    assert!(near(anchors.anchor().unwrap().position(), at(30.0, 0.0, 0.0), 1e-9));
    assert_eq!(anchors.observe(sighting(1.5, from, at(0.0, 30.0, 0.0))), Gate::TooLate);
    anchors.lose_track(Time::from_millis(4000));
    assert!(anchors.anchor().is_none());
}

#[test]
fn only_an_open_query_keeps_an_old_frame() {
    let mut anchors = Anchors::default();
    let (from, target) = (at(0.0, 0.0, 0.0), at(0.0, 30.0, 0.0));
    anchors.settle(Time::from_millis(25_000), Some(Time::from_millis(8000)));
    assert_eq!(anchors.observe(sighting(8.0, from, target)), Gate::Opened);
    anchors.settle(Time::from_millis(25_000), None);
    assert_eq!(anchors.observe(sighting(14.9, from, target)), Gate::TooLate);
    assert!(matches!(anchors.observe(sighting(15.1, from, target)), Gate::Fused { .. }), "the final state is kept");
}

/// The centre of a level camera looking north, label 6: 12.9 m ahead (10^(5/4.5)).
#[test]
fn a_point_and_a_label_are_a_sighting() {
    let camera = Camera { tilt: 0.0, ..Camera::quad() };
    let pose = Pose { position: at(1.0, 2.0, 3.0), attitude: Attitude::default() };
    let of = |depth| {
        let point = ImagePoint { u: 0.5, v: 0.5 };
        let (time, odometry, trust) = (Time::ZERO, Odometry::default(), Trust::default());
        Sighting::of_label(time, 0, 1, pose, odometry, &camera, Lifting::Levelled, point, depth, &trust).unwrap()
    };
    let sighting = of(Some(6));
    assert!((sighting.direction.north - 1.0).abs() < 1e-12);
    let range = sighting.range.unwrap();
    assert!((libm::exp(range.ln_range) - 12.915).abs() < 1e-3);
    // √(0.2² + 0.5117²/12).
    assert!((range.sigma - 0.2489).abs() < 1e-3, "{}", range.sigma);
    assert!(of(Some(10)).range.unwrap().sigma > 0.5 && of(None).range.is_none());
}

#[test]
fn what_is_not_a_number_is_no_sighting() {
    let good = sighting(1.0, at(0.0, 0.0, 0.0), at(0.0, 9.0, 0.0));
    let mut anchors = Anchors::default();
    for bad in [
        Sighting { from: at(f64::NAN, 0.0, 0.0), ..good },
        Sighting { direction: EnuDirection { east: 2.0, north: 0.0, up: 0.0 }, ..good },
        Sighting { bearing_sigma: 0.0, ..good },
        Sighting { range: Some(RangeReading { ln_range: f64::INFINITY, sigma: 0.1 }), ..good },
        Sighting { odometry: Odometry { way: f64::NAN, ..Odometry::default() }, ..good },
    ] {
        assert_eq!(anchors.observe(bad), Gate::Invalid);
    }
    assert!(anchors.anchor().is_none());
}

/// Parameters of a simulated approach.
#[derive(Clone, Copy)]
struct Approach {
    /// Offset of the path from the straight line to the target, metres.
    aside: f64,
    ranged: bool,
    /// Odometry drift: a random walk with this variance per second.
    walk: f64,
}

/// Normalised estimation error squared at the end of an approach to a target 40 m away, down to 6 m, with noise as stated.
fn nees_of(seed: u64, approach: Approach) -> f64 {
    let mut rng = RandomStream::new(seed, "anchor", &[]);
    let settings = AnchorSettings::default();
    let mut anchors = Anchors::new(settings);
    let mut odometry = Odometry::default();
    let (mut truth, bearing_sigma, sigma) = (at(3.0, 40.0, 4.0), 0.02, 0.25);
    for step in 0..15 {
        let fraction = f64::from(step) / 14.0;
        // In the frame of a drifting odometry, the target drifts.
        odometry.horizontal += approach.walk * 1.5;
        odometry.vertical += approach.walk * 1.5;
        let kick = libm::sqrt(approach.walk * 1.5);
        if step > 0 {
            truth = at(truth.east + kick * rng.normal(), truth.north + kick * rng.normal(), truth.up + kick * rng.normal());
        }
        let from = at(approach.aside * libm::sin(3.0 * fraction), 34.0 * fraction, 3.0);
        let extent = settings.extent;
        let meant = at(truth.east + extent * rng.normal(), truth.north + extent * rng.normal(), truth.up + extent * rng.normal());
        let exact = towards(from, meant);
        let (u, v) = (bearing_sigma * rng.normal(), bearing_sigma * rng.normal());
        let direction = EnuDirection::towards(at(exact.east + u, exact.north, exact.up + v));
        let ln_range = libm::log(from.distance(meant)) + sigma * rng.normal();
        anchors.observe(Sighting {
            captured: Time::from_millis(1500 * step as u64),
            id: step as u64,
            stage: 1,
            from,
            odometry,
            direction,
            bearing_sigma,
            elevation_sigma: bearing_sigma,
            range: (approach.ranged || step == 0).then_some(RangeReading { ln_range, sigma }),
        });
    }
    anchors.anchor().unwrap().nees(truth)
}

/// Mean of χ² with 3 degrees of freedom over 1000 flights: 3 ± 1.96·√(6/1000), the 95 % bounds. A range known from one
/// label and then only from parallax stays slightly overconfident; replies give a label each time.
#[test]
fn the_stated_uncertainty_is_the_real_one() {
    let flights = 1000_u32;
    let bound = 1.96 * libm::sqrt(6.0 / f64::from(flights));
    for (name, approach, optimism) in [
        ("straight", Approach { aside: 0.0, ranged: true, walk: 0.0 }, 0.0),
        ("aside", Approach { aside: 6.0, ranged: true, walk: 0.0 }, 0.0),
        ("one range, then bearings", Approach { aside: 6.0, ranged: false, walk: 0.0 }, 0.15),
        ("drifting", Approach { aside: 3.0, ranged: true, walk: 0.01 }, 0.0),
    ] {
        let nees: Vec<f64> = (0..flights).map(|seed| nees_of(5000 + u64::from(seed), approach)).collect();
        let mean = nees.iter().sum::<f64>() / f64::from(flights);
        println!("{name}: mean {mean:.3}");
        assert!((3.0 - bound..3.0 + bound + optimism).contains(&mean), "{name}: {mean}");
    }
}

/// One reply of a generated flight.
#[derive(Clone, Copy, Debug)]
struct Drawn {
    gap_ms: u64,
    delay_ms: u64,
    target: u8,
    stage: u32,
    noise: [f64; 3],
    ranged: bool,
}

fn drawn() -> impl Strategy<Value = Drawn> {
    let noise = prop::array::uniform3(-2.0..2.0_f64);
    (0..900_u64, 0..9000_u64, 0..8_u8, 0..12_u32, noise, prop::bool::weighted(0.8))
        .prop_map(|(gap_ms, delay_ms, target, stage, noise, ranged)| Drawn { gap_ms, delay_ms, target, stage, noise, ranged })
}

/// Two thirds of the replies mean one place, the others a look-alike or nothing real; one in twelve is of the next stage.
fn sightings(drawn: &[Drawn]) -> Vec<Sighting> {
    let mut time = 0;
    let mut stage = 1;
    drawn
        .iter()
        .enumerate()
        .map(|(i, drawn)| {
            time += drawn.gap_ms;
            stage += u32::from(drawn.stage == 0);
            let from = at(0.0, 1e-3 * time as f64, 3.0);
            let place = match drawn.target {
                0 => at(25.0, 20.0, 2.0),
                1 => at(-30.0 + 5.0 * drawn.noise[0], 10.0, 3.0),
                _ => at(2.0 + 10.0 * f64::from(stage), 45.0, 4.0),
            };
            let mut seen = sighting(1e-3 * time as f64, from, place);
            let d = seen.direction;
            seen.direction = EnuDirection::towards(at(d.east + 0.01 * drawn.noise[0], d.north, d.up + 0.01 * drawn.noise[1]));
            seen.range =
                seen.range.filter(|_| drawn.ranged).map(|r| RangeReading { ln_range: r.ln_range + 0.2 * drawn.noise[2], ..r });
            Sighting { id: i as u64, stage, odometry: Odometry { way: from.north, ..Odometry::default() }, ..seen }
        })
        .collect()
}

proptest! {
    /// Every query is answered in the end; whatever the delays and the order, the state is that of immediate answers.
    #[test]
    fn any_order_and_delay_of_the_same_replies_gives_the_same_state(drawn in prop::collection::vec(drawn(), 1..40)) {
        let sightings = sightings(&drawn);
        let mut expected = Anchors::default();
        for sighting in &sightings {
            expected.observe(*sighting);
        }
        let mut arrivals: Vec<(u64, Sighting)> = sightings
            .iter()
            .zip(&drawn)
            .map(|(sighting, drawn)| (sighting.captured.as_nanos() + 1_000_000 * drawn.delay_ms * (1 + sighting.id % 3), *sighting))
            .collect();
        arrivals.sort_by_key(|(arrival, sighting)| (*arrival, sighting.id));
        let mut anchors = Anchors::default();
        for (i, (arrival, sighting)) in arrivals.iter().enumerate() {
            let now = Time::from_nanos(*arrival);
            let open = arrivals[i..].iter().map(|(_, open)| open.captured).filter(|&captured| captured <= now).min();
            anchors.settle(now, open);
            prop_assert_ne!(anchors.observe(*sighting), Gate::TooLate);
        }
        prop_assert_eq!(anchors.hypotheses().len(), expected.hypotheses().len());
        for (a, b) in anchors.hypotheses().iter().zip(expected.hypotheses()) {
            prop_assert!(near(a.position(), b.position(), 1e-9), "{:?} and {:?}", a.position(), b.position());
            prop_assert_eq!((a.hits, a.stage, a.last_seen), (b.hits, b.stage, b.last_seen));
            for (a, b) in a.covariance().as_flattened().iter().zip(b.covariance().as_flattened()) {
                prop_assert!((a - b).abs() < 1e-9);
            }
        }
    }

    /// Whatever is sighted, the state is finite and its covariance positive.
    #[test]
    fn any_sightings_leave_a_finite_anchor(
        all in prop::collection::vec(
            (prop::array::uniform3(-50.0..50.0_f64), prop::array::uniform3(-1.0..1.0_f64), 1e-6..3.0_f64, -8.0..8.0_f64, 1e-6..3.0_f64),
            1..30,
        )
    ) {
        let mut anchors = Anchors::default();
        for (i, (from, direction, bearing_sigma, ln_range, sigma)) in all.into_iter().enumerate() {
            anchors.observe(Sighting {
                captured: Time::from_millis(100 * i as u64),
                id: i as u64,
                stage: 1,
                from: at(from[0], from[1], from[2]),
                odometry: Odometry::default(),
                direction: EnuDirection::towards(at(direction[0], direction[1], direction[2])),
                bearing_sigma,
                elevation_sigma: bearing_sigma,
                range: Some(RangeReading { ln_range, sigma }),
            });
            for anchor in anchors.hypotheses() {
                let sight = anchor.seen_from(at(0.0, 0.0, 0.0), Odometry::default());
                prop_assert!(sight.range.is_finite() && sight.range_sd.is_finite() && sight.lateral_sd.is_finite());
                let covariance = anchor.covariance();
                prop_assert!((0..3).all(|i| covariance[i][i] > 0.0), "{covariance:?}");
            }
        }
    }
}

/// A tower 40 m away, of which one frame shows the top and the next the foot, 14° apart: a sighting of the same tower.
/// The same apart to the side, it is another.
#[test]
fn a_tall_target_may_be_pointed_at_in_different_heights() {
    let camera = Camera::quad();
    let sighted = |id: u64, point: ImagePoint| {
        let captured = Time::from_millis(1000 * id);
        let (pose, lifting, trust) = (Pose::default(), Lifting::Levelled, Trust::default());
        Sighting::of_label(captured, id, 1, pose, Odometry::default(), &camera, lifting, point, Some(8), &trust).unwrap()
    };
    let gate = |second: ImagePoint| {
        let mut anchors = Anchors::default();
        anchors.observe(sighted(1, ImagePoint { u: 0.5, v: 0.35 }));
        anchors.observe(sighted(2, second))
    };
    assert!(matches!(gate(ImagePoint { u: 0.5, v: 0.55 }), Gate::Fused { .. }));
    assert!(matches!(gate(ImagePoint { u: 0.65, v: 0.35 }), Gate::Doubted { .. }));
}

/// A box of a quarter of the image, of which another point may be meant next time: the direction is less exact by 0.289 of
/// its width, in units of the focal length.
#[test]
fn a_wide_target_is_sighted_less_exactly() {
    let camera = Camera::quad();
    let narrow = sighting(1.0, at(0.0, 0.0, 0.0), at(0.0, 20.0, 0.0));
    let area = ImageBox { left: 0.4, top: 0.5, right: 0.65, bottom: 0.5 };
    let wide = narrow.of_box(area, &camera);
    let across = 0.289 * 0.25 * f64::from(camera.width) / camera.fx;
    assert!((wide.bearing_sigma - across.hypot(narrow.bearing_sigma)).abs() < 1e-12);
    assert!((wide.elevation_sigma - narrow.elevation_sigma).abs() < 1e-12);
}

#[test]
fn the_ground_at_a_targets_foot_is_the_most_that_its_range_can_be() {
    // Level, 1.5 m high; the foot 4 m away appears 20.6° below the horizon, which is at v = 0.5 + (1.5 / 4) / 1.5 = 0.75.
    let camera = Camera::from_fov(960, 720, 90.0_f64.to_radians(), 2.0 * libm::atan(0.75), 0.0);
    let pose = Pose { position: at(0.0, 0.0, 1.5), ..Pose::default() };
    let area = ImageBox { left: 0.45, top: 0.5, right: 0.55, bottom: 0.75 };
    let point = ImagePoint { u: 0.5, v: 0.6 };
    let of = |label| {
        let (time, lifting, trust) = (Time::ZERO, Lifting::Levelled, Trust::default());
        Sighting::of_label(time, 0, 1, pose, Odometry::default(), &camera, lifting, point, Some(label), &trust).unwrap()
    };
    // Label 5 means 7.7 m: between both, nearer to the ground, which is surer; and surer than either.
    let (by_label, both) = (of(5), of(5).on_ground(area, &camera, pose));
    let (label, fused) = (by_label.range.unwrap(), both.range.unwrap());
    let range = libm::exp(fused.ln_range);
    assert!((4.0..6.0).contains(&range) && fused.sigma < 0.8 * label.sigma, "{range} {fused:?}");
    // Label 2 means 1.7 m: it may hang. Label 10 is of something else. A box that goes on below the image says even less.
    assert_eq!(of(2).on_ground(area, &camera, pose), of(2));
    assert_eq!(of(10).on_ground(area, &camera, pose), of(10));
    // On the ground itself there is nothing to measure.
    assert_eq!(of(5).on_ground(area, &camera, Pose::default()), of(5));
}
