use proptest::prelude::*;

use super::*;

/// A square of 100 m about the origin with a hole of 20 m, up to 30 m, and a strip east of it, between 10 m and 60 m.
fn fence() -> Geofence {
    Geofence::from_geojson(
        r#"{"type": "FeatureCollection", "features": [
            {"type": "Feature", "properties": {"name": "field", "max_altitude_m": 30}, "geometry": {"type": "Polygon", "coordinates": [
                [[-50, -50], [50, -50], [50, 50], [-50, 50], [-50, -50]],
                [[-10, 20], [10, 20], [10, 40], [-10, 40], [-10, 20]]]}},
            {"type": "Feature", "properties": {"min_altitude_m": 10, "max_altitude_m": 60}, "geometry": {"type": "MultiPolygon",
                "coordinates": [[[[50, -20], [150, -20], [150, 20], [50, 20], [50, -20]]]]}}]}"#,
    )
    .unwrap()
}

fn at(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

const LOW: (f64, f64) = (5.0, 5.0);
const MIDDLE: (f64, f64) = (20.0, 20.0);

#[test]
fn contains_the_union_without_holes_within_the_bands() {
    let fence = fence();
    assert!(fence.contains(at(0.0, 0.0, 5.0)));
    assert!(!fence.contains(at(0.0, 30.0, 5.0)), "in the hole");
    assert!(!fence.contains(at(0.0, 0.0, 31.0)), "above the field");
    assert!(fence.contains(at(100.0, 0.0, 31.0)) && !fence.contains(at(100.0, 0.0, 5.0)), "the strip has its own band");
    assert!(!fence.contains(at(f64::NAN, 0.0, 5.0)) && !fence.contains(at(0.0, 0.0, f64::NAN)));
    assert!(fence.contains_below_ceiling(at(100.0, 0.0, 5.0)));
}

#[test]
fn edge_distance_is_signed() {
    let fence = fence();
    assert_eq!(fence.edge_distance(at(-40.0, 0.0, 0.0)), 10.0);
    assert_eq!(fence.edge_distance(at(0.0, 25.0, 0.0)), -5.0);
    assert_eq!(fence.edge_distance(at(-53.0, -54.0, 0.0)), -5.0);
}

#[test]
fn a_ray_leaves_at_edges_and_holes_and_passes_a_common_edge() {
    let fence = fence();
    let exit = |from, along, band| fence.exit(from, along, band, 1000.0).map(|e| (e.distance, e.out));
    assert_eq!(exit((0.0, 0.0), (-1.0, 0.0), LOW), Some((50.0, (-1.0, 0.0))));
    assert_eq!(exit((0.0, 0.0), (0.0, 1.0), LOW), Some((20.0, (0.0, 1.0))), "the hole");
    assert_eq!(exit((0.0, 0.0), (1.0, 0.0), LOW), Some((50.0, (1.0, 0.0))), "the strip is closed below 10 m");
    assert_eq!(exit((0.0, 0.0), (1.0, 0.0), MIDDLE), Some((150.0, (1.0, 0.0))), "and open at 20 m");
    assert_eq!(fence.exit((0.0, 0.0), (1.0, 0.0), MIDDLE, 100.0), None, "beyond the reach");
}

#[test]
fn way_back_is_the_nearest_edge() {
    let fence = fence();
    assert_eq!(fence.nearest_inside((-60.0, 7.0), LOW), Some((-50.0, 7.0)));
    assert_eq!(fence.nearest_inside((1.0, 22.0), LOW), Some((1.0, 20.0)));
    assert_eq!(fence.nearest_inside((0.0, 0.0), (100.0, 100.0)), None);
}

#[test]
fn the_band_is_that_of_the_place() {
    let fence = fence();
    assert_eq!(fence.band(at(0.0, 0.0, 5.0)), (f64::NEG_INFINITY, 30.0));
    assert_eq!(fence.band(at(100.0, 0.0, 5.0)), (10.0, 60.0), "below its floor: to climb");
    assert_eq!(fence.band(at(160.0, 0.0, 40.0)), (10.0, 60.0), "outside: of the nearest");
}

#[test]
fn errors_state_problem_place_and_remedy() {
    let ring = |points: &str| Geofence::from_geojson(&format!(r#"{{"type":"Polygon","coordinates":[{points}]}}"#));
    let shown = |result: Result<Geofence, GeofenceError>| result.unwrap_err().to_string();
    for (result, message) in [
        (Geofence::from_geojson("{"), "the geofence is not valid JSON: EOF while parsing an object at line 1 column 1"),
        (Geofence::from_geojson("[]"), "`geofence` must be an object, found an array"),
        (
            Geofence::from_geojson(r#"{"type":"Point","coordinates":[1,2]}"#),
            "`type` must be `Polygon`, `MultiPolygon`, `Feature` or `FeatureCollection`, found `\"Point\"`",
        ),
        (Geofence::from_geojson(r#"{"type":"FeatureCollection","features":[]}"#), "the geofence has no polygon"),
        (
            ring("[[0,0],[9,0],[9,9]]"),
            "`coordinates[0]` has `3` points; a ring needs at least 4, with the last equal to the \
            first",
        ),
        (ring("[[0,0],[9,0],[9,9],[0,9]]"), "`coordinates[0]` is not closed; repeat the first point at the end"),
        (
            ring("[[121.001,24.001],[121.002,24.001],[121.002,24.002],[121.001,24.001]]"),
            "`coordinates[0]` looks like longitude and latitude; use metres east and north of the origin",
        ),
        (ring("[[0,0],[1,0],[1,1],[0,0]]"), "`coordinates[0]` encloses `0.500` m²; at least 1 m² is required"),
        (
            ring("[[0,0],[9,9],[9,0],[0,9],[0,0]]"),
            // The bow-tie has no area by the shoelace rule.
            "`coordinates[0]` encloses `0.000` m²; at least 1 m² is required",
        ),
        (
            ring("[[0,0],[9,9],[9,0],[0,20],[0,0]]"),
            "`coordinates[0]` intersects itself at edges `0` and `2`; order the points along the outline",
        ),
        (ring("[[0,0],[9,0],[9,\"x\"],[0,0]]"), "`coordinates[0][2][1]` must be a number of metres, found `\"x\"`"),
        (
            ring("[[0,0],[9,0],[9,1e6],[0,0]]"),
            "`coordinates[0][2][1]` is `1000000`; coordinates must be within 100000 m of the origin",
        ),
    ] {
        assert_eq!(shown(result), message);
    }
    let feature = |properties: &str| {
        Geofence::from_geojson(&format!(
            r#"{{"type":"Feature","properties":{properties},"geometry":{{"type":"Polygon","coordinates":[[[0,0],[9,0],[9,9],[0,0]]]}}}}"#
        ))
    };
    assert_eq!(
        shown(feature(r#"{"max_altitude":9}"#)),
        "`properties` has an unknown property `max_altitude`; only `min_altitude_m` and `max_altitude_m` are allowed"
    );
    assert_eq!(
        shown(feature(r#"{"min_altitude_m":9,"max_altitude_m":9}"#)),
        "`properties`: `min_altitude_m` `9` must be less than `max_altitude_m` `9`"
    );
}

#[test]
fn size_is_bounded() {
    let long = " ".repeat(MAX_BYTES + 1);
    assert_eq!(Geofence::from_geojson(&long), Err(GeofenceError::TooLarge { bytes: MAX_BYTES + 1 }));
    let points: Vec<String> = (0..=MAX_VERTICES).map(|i| format!("[{i},{i}]")).collect();
    let many = format!(r#"{{"type":"Polygon","coordinates":[[{}]]}}"#, points.join(","));
    assert_eq!(Geofence::from_geojson(&many), Err(GeofenceError::TooManyVertices { at: "coordinates[0]".into() }));
    let deep = "[".repeat(100_000);
    assert!(matches!(Geofence::from_geojson(&deep), Err(GeofenceError::Json(_))));
}

/// A star-shaped polygon: never crosses itself.
fn star() -> impl Strategy<Value = Geofence> {
    (prop::collection::vec(5.0..80.0_f64, 3..20), -200.0..200.0_f64, -200.0..200.0_f64).prop_map(|(radii, east, north)| {
        let n = radii.len() as f64;
        let mut ring: Vec<[f64; 2]> = radii
            .iter()
            .enumerate()
            .map(|(i, r)| {
                let angle = core::f64::consts::TAU * i as f64 / n;
                [east + r * libm::cos(angle), north + r * libm::sin(angle)]
            })
            .collect();
        ring.push(ring[0]);
        let value = serde_json::json!({"type": "Polygon", "coordinates": [ring]});
        Geofence::try_from(value).unwrap()
    })
}

proptest! {
    #[test]
    fn arbitrary_text_never_panics(text in "\\PC*") {
        let _ = Geofence::from_geojson(&text);
    }

    #[test]
    fn arbitrary_numbers_are_read_or_refused(
        ring in prop::collection::vec((-1e6..1e6_f64, -1e6..1e6_f64), 0..8), close in any::<bool>()
    ) {
        let mut ring: Vec<[f64; 2]> = ring.into_iter().map(|(x, y)| [x, y]).collect();
        if close && let Some(&first) = ring.first() {
            ring.push(first);
        }
        if let Ok(fence) = Geofence::try_from(serde_json::json!({"type": "Polygon", "coordinates": [ring]})) {
            prop_assert!(fence.outlines().all(|o| o.len() >= 3));
        }
    }

    #[test]
    fn written_and_read_it_is_the_same(fence in star()) {
        let text = serde_json::to_string(&fence).unwrap();
        prop_assert_eq!(Geofence::from_geojson(&text).unwrap(), fence);
    }

    /// Points before the exit are allowed, points just behind it are not.
    #[test]
    fn exit_is_the_first_point_out(fence in star(), x in -1.0..1.0_f64, y in -1.0..1.0_f64, angle in 0.0..core::f64::consts::TAU) {
        let centre = fence.outlines().next().unwrap().iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
        let n = fence.outlines().next().unwrap().len() as f64;
        let from = (centre.0 / n + 20.0 * x, centre.1 / n + 20.0 * y);
        let along = (libm::cos(angle), libm::sin(angle));
        let point = |t: f64| (from.0 + along.0 * t, from.1 + along.1 * t);
        prop_assume!(fence.allows(from, LOW) && fence.edge_distance(at(from.0, from.1, 0.0)) > 0.01);
        let exit = fence.exit(from, along, LOW, 1000.0).expect("every ray leaves a polygon");
        for i in 1..20 {
            prop_assert!(fence.allows(point(exit.distance * f64::from(i) / 20.0), LOW));
        }
        let behind = fence.allows(point(exit.distance + 1e-5), LOW);
        // A ray may graze a corner by less than the distance that counts as one crossing.
        prop_assert!(!behind || fence.edge_distance(at(point(exit.distance).0, point(exit.distance).1, 0.0)) < 1e-4);
        prop_assert!((libm::hypot(exit.out.0, exit.out.1) - 1.0).abs() < 1e-12);
        prop_assert!(exit.out.0 * along.0 + exit.out.1 * along.1 >= 0.0);
    }
}
