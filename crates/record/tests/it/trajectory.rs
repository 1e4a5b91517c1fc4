//! The trajectory image: well-formed for any content, and to scale.

use proptest::prelude::*;
use spf_core::geometry::EnuPosition;
use spf_core::time::Time;
use spf_record::{DecisionMark, MarkedPlace, Outline, TrajectoryInput, trajectory_svg};

fn at(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

fn square(east: f64, north: f64, half: f64) -> Vec<[f64; 2]> {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| [east + x * half, north + y * half]).to_vec()
}

/// A flight of 40 s: up to 3 m, then along a bend to a crane 60 m away.
fn flight() -> TrajectoryInput {
    let place =
        |fraction: f64| at(4.0 + 46.0 * fraction, 60.0 * fraction * fraction, (3.0 + 9.0 * fraction).min(40.0 * fraction));
    let path: Vec<_> = (0..=400).map(|n| (Time::from_millis(n * 100), place(n as f64 / 400.0))).collect();
    let known_path = path.iter().map(|(time, p)| (*time, at(p.east + 0.8, p.north - 0.5, p.up + 0.2))).collect();
    let decisions = (0..9)
        .map(|n| {
            let fraction = 0.08 + n as f64 * 0.1;
            let ahead = place((fraction + 0.13).min(1.0));
            DecisionMark {
                time: Time::from_secs_f64(fraction * 40.0),
                position: place(fraction),
                waypoint: (n != 4).then(|| at(ahead.east + 2.0, ahead.north - 1.0, ahead.up)),
                label: format!("red tower crane, depth {}", 9 - n),
            }
        })
        .collect();
    let outline = |name: &str, colour, polygons| Outline { name: name.into(), colour, polygons };
    TrajectoryInput {
        title: "Take off and fly to the red crane".into(),
        outcome: "reached (verified) after 34.2 s, 9 decisions, 84.1 m flown, 3.1 m from the target · oracle, seed 7".into(),
        outlines: vec![
            outline("road", [150, 155, 160], vec![vec![[-90.0, 20.0], [140.0, 20.0], [140.0, 28.0], [-90.0, 28.0]]]),
            outline("tall white building", [235, 235, 240], vec![square(20.0, 48.0, 9.0)]),
            outline("trees", [70, 150, 70], (0..6).map(|n| square(-2.0 + n as f64 * 9.0, 12.0, 1.6)).collect()),
            outline("red tower crane", [220, 50, 40], vec![square(52.0, 62.0, 1.5)]),
            outline("black car", [40, 40, 45], vec![square(33.0, 24.0, 1.8)]),
        ],
        path,
        known_path,
        decisions,
        target: Some(at(52.0, 62.0, 12.0)),
        marked: vec![MarkedPlace { number: 2, ends: [at(20.0, 20.0, 6.0), at(26.0, 20.0, 6.0)], label: "keep away 2".into() }],
    }
}

/// A parser of tags with as much XML as this document uses: every tag is closed in order, attributes are quoted.
fn check_well_formed(svg: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = svg;
    while let Some(start) = rest.find('<') {
        assert!(!rest[..start].contains('>'), "stray >");
        let end = start + rest[start..].find('>').expect("an open tag");
        let tag = &rest[start + 1..end];
        assert!(!tag.contains('<') && tag.matches('"').count().is_multiple_of(2), "{tag}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split(' ').next().unwrap_or(tag));
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty(), "{open:?}");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "a number that no viewer reads");
}

#[test]
fn a_flight_is_plotted_completely_and_repeatably() {
    let svg = trajectory_svg(&flight());
    if let Some(folder) = std::env::var_os("SPF_TEST_PICTURES") {
        std::fs::write(std::path::Path::new(&folder).join("trajectory.svg"), &svg).unwrap();
    }
    check_well_formed(&svg);
    assert_eq!(svg, trajectory_svg(&flight()));
    for part in [
        "Take off and fly to the red crane",
        "tall white building",
        ">9</text>",
        "20 m",
        ">N<",
        "flight time, s",
        "<title>keep away 2</title>",
        ">2</text>",
        ">keep away</text>",
    ] {
        assert!(svg.contains(part), "{part}");
    }
    // Nine decisions on the map and nine on the curve, and one in the legend.
    assert_eq!(svg.matches("r=\"7.5\"").count(), 19);
}

#[test]
fn the_map_is_to_scale_and_north_is_up() {
    let mut input = TrajectoryInput {
        path: vec![(Time::ZERO, at(0.0, 0.0, 0.0)), (Time::from_millis(9000), at(30.0, 20.0, 3.0))],
        ..TrajectoryInput::default()
    };
    input.decisions = vec![];
    let svg = trajectory_svg(&input);
    let line = svg.lines().find(|line| line.contains("<polyline")).unwrap();
    let numbers: Vec<f64> = line.split('"').nth(1).unwrap().split([' ', ',']).map(|n| n.parse().unwrap()).collect();
    let (right, up) = (numbers[2] - numbers[0], numbers[1] - numbers[3]);
    // 30 m by 20 m with 30 % around them on a map 908 wide: 908 / 39 = 23.28 a metre.
    assert!((right - 698.5).abs() < 0.2 && (up - 465.6).abs() < 0.2, "{right} {up}");
}

#[test]
fn a_marked_place_is_where_it_was_and_on_the_map_although_nobody_flew_there() {
    let path = vec![(Time::ZERO, at(0.0, 0.0, 0.0)), (Time::from_millis(9000), at(30.0, 20.0, 3.0))];
    let ends = [at(40.0, 0.0, 3.0), at(40.0, 20.0, 3.0)];
    let marked = vec![MarkedPlace { number: 1, ends, label: "keep away 1".into() }];
    let svg = trajectory_svg(&TrajectoryInput { path, marked, ..TrajectoryInput::default() });
    let line = svg.lines().find(|line| line.contains("stroke=\"#b3261e\"")).unwrap();
    let figure =
        |name: &str| -> f64 { line.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap() };
    // 40 m by 20 m with 30 % around them on a map 908 wide: 908 / 52 = 17.46 a metre; the wall leads northwards, 20 m.
    assert!((figure("x1") - figure("x2")).abs() < 0.1 && (figure("y1") - figure("y2") - 349.2).abs() < 0.2, "{line}");
    assert!(figure("x1") < 46.0 + 908.0, "{line}");
}

#[test]
fn nothing_at_all_is_still_an_image() {
    check_well_formed(&trajectory_svg(&TrajectoryInput::default()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn any_texts_and_coordinates_give_a_well_formed_image(
        title in ".{0,200}",
        name in ".{0,30}",
        points in proptest::collection::vec((any::<u64>(), any::<f64>(), any::<f64>(), any::<f64>()), 0..12),
        near in proptest::collection::vec((0_u64..90_000_000_000, -50.0..50.0_f64, -50.0..50.0_f64, -5.0..50.0_f64), 0..12),
    ) {
        let path: Vec<_> = near.iter().chain(&points).map(|&(time, e, n, u)| (Time::from_nanos(time), at(e, n, u))).collect();
        let decisions = path.iter().map(|&(time, position)| DecisionMark { time, position, waypoint: Some(position), label: name.clone() });
        let input = TrajectoryInput {
            title: title.clone(),
            outcome: title,
            outlines: vec![Outline { name: name.clone(), colour: [9, 200, 30], polygons: vec![path.iter().map(|(_, p)| [p.east, p.north]).collect()] }],
            decisions: decisions.collect(),
            target: path.first().map(|(_, p)| *p),
            marked: path.windows(2).map(|ends| MarkedPlace { number: 1, ends: [ends[0].1, ends[1].1], label: name.clone() }).collect(),
            known_path: path.clone(),
            path,
        };
        check_well_formed(&trajectory_svg(&input));
    }
}
