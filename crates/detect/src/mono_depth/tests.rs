//! A room whose depths are known: level ground, and a wall across the view. The "networks" say what each kind would.

use proptest::prelude::*;

use spf_core::depth::CameraAxes;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::query::ImagePoint;
use spf_core::ranges::{RangeRay, RangeScan};
use spf_core::rng::RandomStream;
use spf_space::obstacle_map::{Cell, CellState, ObstacleMap};

use super::*;

const HEIGHT: f64 = 2.0;
const WALL: f64 = 6.0;
const SIZE: (usize, usize) = (252, 196);

fn pose() -> Pose {
    Pose { position: EnuPosition { east: 3.0, north: -2.0, up: HEIGHT }, ..Pose::default() }
}

/// The true depth at a place of the image, along the optical axis.
fn truth(camera: &Camera, at: ImagePoint) -> f64 {
    let axes = CameraAxes::new(camera, Pose { position: EnuPosition::default(), ..pose() });
    let ray = camera.ray(at);
    let along = axes.place(ray.right, 1.0, ray.up);
    let wall = WALL / along.north;
    if along.up < 0.0 { wall.min(HEIGHT / -along.up) } else { wall }
}

/// The output of a network, which makes a value of each depth, with noise of its logarithm.
fn output(kind: DepthKind, noise: f64, value: impl Fn(f64) -> f64) -> MonoDepth {
    let camera = Camera::quad();
    let mut random = RandomStream::new(1, "mono depth", &[]);
    let values: Vec<f32> = (0..SIZE.0 * SIZE.1)
        .map(|index| {
            let at = ImagePoint {
                u: ((index % SIZE.0) as f64 + 0.5) / SIZE.0 as f64,
                v: ((index / SIZE.0) as f64 + 0.5) / SIZE.1 as f64,
            };
            value(truth(&camera, at) * libm::exp(noise * random.normal())) as f32
        })
        .collect();
    MonoDepth::new((FrameId(1), Time::ZERO), &camera, kind, SIZE, &values).unwrap()
}

fn disparity() -> MonoDepth {
    output(DepthKind::Disparity, 0.0, |z| 40.0 / z + 3.0)
}

fn relative() -> MonoDepth {
    output(DepthKind::Relative, 0.0, |z| 0.07 * z)
}

fn metric() -> MonoDepth {
    output(DepthKind::Metric, 0.0, |z| 1.3 * z)
}

fn clues(scans: &[PastScan], height: Option<f64>) -> Clues<'_> {
    Clues { pose: pose(), scans, height }
}

/// Ranges to the wall and to the ground; every `wrong`th of them, if any, is half of what it should be.
fn ranges(wrong: usize) -> Vec<PastScan> {
    let camera = Camera::quad();
    let axes = CameraAxes::new(&camera, Pose { position: EnuPosition::default(), ..pose() });
    let grid = (1..8).flat_map(|x| (1..8).map(move |y| (x, y)));
    let ray = |(id, (x, y)): (usize, (u32, u32))| {
        let at = ImagePoint { u: f64::from(x) / 8.0, v: f64::from(y) / 8.0 };
        let ray = camera.ray(at);
        let along = axes.place(ray.right, 1.0, ray.up);
        let level = along.horizontal_distance(EnuPosition::default());
        let metres = truth(&camera, at) * libm::hypot(level, along.up) * if wrong > 0 && id % wrong == 0 { 0.5 } else { 1.0 };
        let (azimuth, elevation) = (libm::atan2(along.east, along.north), libm::atan2(along.up, level));
        RangeRay { azimuth, elevation, width: 0.0, metres: Some(metres), reach: 100.0 }
    };
    scan(grid.enumerate().map(ray).collect())
}

fn scan(rays: Vec<RangeRay>) -> Vec<PastScan> {
    vec![PastScan { scan: RangeScan { captured: Time::ZERO, sensor: 1, rays }, pose: pose() }]
}

/// A rangefinder that looks straight ahead, and sees the wall.
fn rangefinder() -> Vec<PastScan> {
    scan(vec![RangeRay { azimuth: 0.0, elevation: 0.0, width: 0.05, metres: Some(WALL), reach: 10.0 }])
}

/// Fraction of the depths that are off by more than their standard deviation, and the error of a logarithm that one in fifty exceeds:
/// those of cells that show the foot of the wall.
fn errors(metres: &Metres) -> (f64, f64) {
    let camera = metres.grid.camera;
    let errors = metres.grid.cm.iter().enumerate().filter(|(_, cm)| **cm > 0).map(|(index, cm)| {
        let at = ImagePoint {
            u: ((index % camera.width as usize) as f64 + 0.5) / f64::from(camera.width),
            v: ((index / camera.width as usize) as f64 + 0.5) / f64::from(camera.height),
        };
        let error = libm::log(0.01 * f64::from(*cm) / truth(&camera, at)).abs();
        (error > f64::from(metres.log_sd[index]), error)
    });
    let errors: Vec<(bool, f64)> = errors.collect();
    let beyond = errors.iter().filter(|(beyond, _)| *beyond).count() as f64 / errors.len() as f64;
    let mut sizes: Vec<f64> = errors.into_iter().map(|(_, error)| error).collect();
    sizes.sort_by(f64::total_cmp);
    (beyond, sizes[sizes.len() * 49 / 50])
}

#[test]
fn each_kind_gives_the_metres_of_the_room_by_each_source() {
    let (ranges, rangefinder) = (ranges(0), rangefinder());
    let sources = [(clues(&ranges, None), ScaleSource::Ranges), (clues(&[], Some(HEIGHT)), ScaleSource::Ground)];
    for estimate in [disparity(), relative(), metric()] {
        for (clues, source) in sources {
            let (metres, scale) = estimate.in_metres(&clues).unwrap();
            let (_, worst) = errors(&metres);
            assert_eq!(scale.source, source);
            assert!(worst < 0.1, "{:?} by {source:?}: {worst}", estimate.kind);
            assert!(metres.grid.valid_fraction() > 0.6, "{:?} by {source:?}: {}", estimate.kind, metres.grid.valid_fraction());
            assert!(metres.grid.check().is_ok() && metres.grid.source == spf_core::depth::DepthSource::Network);
        }
    }
    // One range is enough for a scale, not for a shift.
    for estimate in [relative(), metric(), output(DepthKind::Disparity, 0.0, |z| 40.0 / z)] {
        let (metres, scale) = estimate.in_metres(&clues(&rangefinder, None)).unwrap();
        assert_eq!(scale.source, ScaleSource::Ranges);
        assert!(errors(&metres).1 < 0.1, "{:?}: {:?}", estimate.kind, errors(&metres));
    }
}

#[test]
fn without_a_scale_there_are_no_metres() {
    let nothing = clues(&[], None);
    for estimate in [disparity(), relative()] {
        assert_eq!(estimate.in_metres(&nothing).map(|_| ()), Err(NoScale::NoClues));
        // On the ground, the ground tells nothing.
        assert_eq!(estimate.in_metres(&clues(&[], Some(0.1))).map(|_| ()), Err(NoScale::NoClues));
        assert_eq!(estimate.in_metres(&clues(&[], Some(f64::NAN))).map(|_| ()), Err(NoScale::NoClues));
    }
    // Its own metres are taken as such, with a quarter of error.
    let (metres, scale) = metric().in_metres(&nothing).unwrap();
    assert_eq!(scale.source, ScaleSource::Network);
    assert!((errors(&metres).1 - libm::log(1.3)).abs() < 0.03, "{}", errors(&metres).1);
    assert!(metres.log_sd.iter().zip(&metres.grid.cm).all(|(sd, cm)| *cm == 0 || (0.25..0.3).contains(sd)));
}

#[test]
fn wrong_ranges_are_outvoted_and_what_fits_nothing_is_refused() {
    let ranges = ranges(3);
    for estimate in [disparity(), relative(), metric()] {
        let (metres, _) = estimate.in_metres(&clues(&ranges, None)).unwrap();
        assert!(errors(&metres).1 < 0.1, "{:?}: {}", estimate.kind, errors(&metres).1);
    }
    // A network that says the opposite of what it was stated to say, and one that says the same everywhere.
    for wrong in [output(DepthKind::Relative, 0.0, |z| 1.0 / (z * z)), output(DepthKind::Disparity, 0.0, |z| z * z)] {
        let refused = wrong.in_metres(&clues(&ranges, Some(HEIGHT)));
        assert!(refused.is_err(), "{:?}: {:?}", wrong.kind, refused.map(|(_, scale)| scale));
    }
}

#[test]
fn a_wall_is_no_ground() {
    // Nothing but a wall in view, all at about the same depth.
    let camera = Camera::quad();
    let flat = MonoDepth::new((FrameId(1), Time::ZERO), &camera, DepthKind::Relative, SIZE, &vec![0.4; SIZE.0 * SIZE.1]).unwrap();
    let refused = flat.in_metres(&clues(&[], Some(HEIGHT)));
    assert_eq!(refused.map(|_| ()), Err(NoScale::NoClues));
}

#[test]
fn sources_that_contradict_each_other_make_the_scale_less_sure() {
    let ranges = ranges(0);
    let alone = [clues(&ranges, None), clues(&[], Some(HEIGHT))].map(|clues| relative().in_metres(&clues).unwrap().1);
    // As if the ground were much farther below.
    let contradicted = relative().in_metres(&clues(&ranges, Some(3.0 * HEIGHT))).map(|(_, scale)| scale);
    assert_eq!(contradicted, Err(NoScale::Uncertain));
    let agreed = relative().in_metres(&clues(&ranges, Some(HEIGHT))).unwrap().1;
    assert!(alone.contains(&agreed), "{agreed:?} of {alone:?}");
}

/// A kind, and the value that a network of it gives a depth.
type Maker = (DepthKind, fn(f64) -> f64);

/// With noise of 15 % a third of the depths at most are off by more than a standard deviation.
#[test]
fn the_stated_error_contains_the_noise() {
    let ranges = ranges(0);
    let makers: [Maker; 3] =
        [(DepthKind::Disparity, |z| 40.0 / z + 3.0), (DepthKind::Relative, |z| 0.07 * z), (DepthKind::Metric, |z| 1.3 * z)];
    for (kind, value) in makers {
        // The median of a cell takes some of the noise of its pixels away.
        let noisy = output(kind, 0.3, value);
        for clues in [clues(&ranges, None), clues(&[], Some(HEIGHT))] {
            let (metres, scale) = noisy.in_metres(&clues).unwrap();
            let (beyond, _) = errors(&metres);
            assert!(beyond < 0.33, "{kind:?} by {:?}: {beyond}", scale.source);
        }
    }
}

#[test]
fn the_map_gets_the_wall_and_the_nearer_half_of_the_way_to_it() {
    let (metres, _) = relative().in_metres(&clues(&ranges(0), None)).unwrap();
    let mut map = ObstacleMap::new();
    map.advance(Time::ZERO, pose().position);
    map.depth(&metres.grid, pose());
    let at = |away: f64| map.known(Cell::of(EnuPosition { north: pose().position.north + away, ..pose().position }));
    assert_eq!([at(1.0), at(0.4 * WALL)], [CellState::Free; 2]);
    assert_eq!(at(WALL + 0.1), CellState::Occupied);
    assert_eq!([at(0.8 * WALL), at(WALL + 1.0)], [CellState::Unknown; 2]);
}

#[test]
fn values_keep_their_size_to_a_fifth_of_a_percent() {
    for value in [1e-30_f32, 0.003, 1.0, 77.7, 3.4e37] {
        let kept = f32::from_bits(u32::from(rounded(value)) << 16);
        assert!((kept / value - 1.0).abs() < 0.004, "{value}: {kept}");
    }
    assert_eq!(rounded(f32::MAX), 0);
    let wrong = MonoDepth::new((FrameId(1), Time::ZERO), &Camera::quad(), DepthKind::Metric, (4, 4), &[1.0; 15]);
    assert_eq!(wrong, Err(MonoDepthError::WrongSize { values: 15, width: 4, height: 4 }));
    for empty in [f32::NAN, f32::INFINITY, 0.0, -1.0] {
        let none = MonoDepth::new((FrameId(1), Time::ZERO), &Camera::quad(), DepthKind::Metric, (4, 4), &[empty; 16]);
        assert_eq!(none, Err(MonoDepthError::NoNumbers));
    }
}

fn any_kind() -> impl Strategy<Value = DepthKind> {
    prop_oneof![Just(DepthKind::Disparity), Just(DepthKind::Relative), Just(DepthKind::Metric)]
}

/// A number as networks give it, or any.
fn any_value() -> impl Strategy<Value = f32> {
    prop_oneof![0.01_f32..20.0, any::<f32>(), Just(f32::NAN), Just(f32::INFINITY), Just(-1.0), Just(1e-40)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn whatever_a_network_gives_is_depth_within_bounds_or_nothing(
        kind in any_kind(),
        (width, output) in (1_usize..120).prop_flat_map(|width| (Just(width), prop::collection::vec(any_value(), width..width * 20))),
        height in prop::option::of(any::<f64>()),
        known in prop::collection::vec((-0.7_f64..0.7, -0.5_f64..0.5, prop::option::of(any_value())), 0..20),
    ) {
        let rows = output.len() / width;
        let Ok(estimate) =
            MonoDepth::new((FrameId(1), Time::ZERO), &Camera::quad(), kind, (width, rows), &output[..rows * width])
        else { return Ok(()) };
        prop_assert!(estimate.is_valid());
        let scans = scan(known.iter().map(|&(azimuth, elevation, metres)| RangeRay {
            azimuth, elevation, width: 0.3, metres: metres.map(f64::from), reach: 10.0,
        }).collect());
        if let Ok((metres, scale)) = estimate.in_metres(&clues(&scans, height)) {
            prop_assert!(metres.grid.check().is_ok() && metres.log_sd.len() == metres.grid.cm.len());
            prop_assert!(scale.farthest <= 12.0);
            for (cm, sd) in metres.grid.cm.iter().zip(&metres.log_sd) {
                prop_assert!(*cm == 0 || ((20..=1200).contains(cm) && *sd > 0.0 && *sd <= 0.351), "{cm} cm, {sd}");
            }
            let mut map = ObstacleMap::new();
            map.advance(Time::ZERO, pose().position);
            map.depth(&metres.grid, pose());
        }
    }
}
