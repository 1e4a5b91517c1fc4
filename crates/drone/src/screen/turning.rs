//! How much a camera has turned between two pictures, from points followed in them.
//!
//! Turning the craft moves all points of the picture, whatever their distance; flying moves each along a line through the point of
//! the picture towards which it flies, the farther the nearer the point is. So across that line every point tells of the turn alone. The
//! direction of flight is the one that was commanded. The turn is the weighted least-squares solution, with weights that fall for
//! points that do not fit (Cauchy's), and with the commanded turn as a further, weak observation.

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::query::ImagePoint;

/// Standard deviation of a point's motion, pixels.
const PIXELS: f64 = 0.35;
/// Standard deviation of a commanded turn: this fraction of it, and radians.
const COMMANDED: f64 = 0.25;
const COMMANDED_LEAST: f64 = 0.003;
/// Fewest points that tell of a turn.
const FEWEST: usize = 8;
/// Speed below which a craft does not fly in any direction, m/s.
const STILL: f64 = 0.05;
const ITERATIONS: usize = 8;

/// A turn between two pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// Radians, clockwise.
    pub angle: f64,
    /// Its standard deviation, radians.
    pub deviation: f64,
    /// How many points it follows from.
    pub points: usize,
}

/// One component of a point's motion: `moved = turn · along` but for noise.
struct Equation {
    moved: f64,
    along: f64,
}

/// The turn of a camera between two pictures in which points moved from the first place to the second, each as a fraction of the picture.
/// `flown` is the commanded velocity. `commanded` is the turn that was commanded, if it is known how far a command turns. `None` if too few points tell.
#[must_use]
pub fn turn(camera: &Camera, points: &[(ImagePoint, ImagePoint)], flown: Setpoint, commanded: Option<f64>) -> Option<Turn> {
    let equations: Vec<Equation> = points.iter().flat_map(|(from, to)| equations(camera, *from, *to, flown)).collect();
    let noise = PIXELS / camera.fx.max(1.0);
    let useful = equations.iter().filter(|equation| equation.along.abs() > 0.1).count();
    if useful < FEWEST || points.len() < FEWEST {
        return None;
    }
    // The median is a start that half of the points cannot spoil.
    let mut ratios: Vec<f64> =
        equations.iter().filter(|equation| equation.along.abs() > 0.1).map(|equation| equation.moved / equation.along).collect();
    ratios.sort_by(f64::total_cmp);
    let mut angle = ratios[ratios.len() / 2];
    let prior = commanded.map_or((0.0, 0.0), |turn| {
        let deviation = (COMMANDED * turn.abs()).max(COMMANDED_LEAST);
        (turn, 1.0 / (deviation * deviation))
    });
    let mut information = 0.0;
    for _ in 0..ITERATIONS {
        let (mut above, mut below) = (prior.0 * prior.1, prior.1);
        for Equation { moved, along } in &equations {
            let miss = (moved - angle * along) / noise;
            let weight = 1.0 / (noise * noise * (1.0 + 0.25 * miss * miss));
            above += weight * moved * along;
            below += weight * along * along;
        }
        if below <= 0.0 {
            return None;
        }
        (angle, information) = (above / below, below);
    }
    angle.is_finite().then(|| Turn { angle, deviation: (1.0 / information).sqrt(), points: points.len() })
}

/// What a point tells: across the line along which flying moves it, or both components for a craft that stands still and for the point
/// towards which it flies.
fn equations(camera: &Camera, from: ImagePoint, to: ImagePoint, flown: Setpoint) -> Vec<Equation> {
    let (before, after) = (camera.ray(from), camera.ray(to));
    let (x, y) = (0.5 * (before.right + after.right), 0.5 * (before.up + after.up));
    let moved = (after.right - before.right, after.up - before.up);
    let (sin, cos) = camera.tilt.sin_cos();
    // In the level frame the ray is (right x, forward cos + y sin, up y cos − sin). A turn by a small angle a clockwise moves it
    // by (−a · forward, a · right, 0), which is turned back into the camera's axes and projected.
    let ahead = cos + y * sin;
    let along = (-ahead - x * x * cos, x * sin - y * x * cos);
    // The velocity in the camera's axes.
    let (right, forward, up) = (flown.right, flown.forward * cos - flown.up * sin, flown.forward * sin + flown.up * cos);
    let line = (-right + x * forward, -up + y * forward);
    let length = line.0.hypot(line.1);
    if length < STILL.max(0.05 * flown.speed()) {
        return vec![Equation { moved: moved.0, along: along.0 }, Equation { moved: moved.1, along: along.1 }];
    }
    let across = (-line.1 / length, line.0 / length);
    let onto = |(a, b): (f64, f64)| a * across.0 + b * across.1;
    vec![Equation { moved: onto(moved), along: onto(along) }]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Points at several ranges, before and after the craft turned by `angle` and flew `flown` metres.
    fn scene(camera: &Camera, angle: f64, flown: Setpoint) -> Vec<(ImagePoint, ImagePoint)> {
        let mut points = Vec::new();
        let (sin, cos) = camera.tilt.sin_cos();
        let seen = |right: f64, forward: f64, up: f64| camera.project(right, forward * cos - up * sin, forward * sin + up * cos);
        for n in 0..200_u32 {
            let spread = |k: u32, width: f64| (f64::from((n * k) % 97) / 97.0 - 0.5) * width;
            let forward = 4.0 + f64::from(n % 13) * 5.0;
            let (right, up) = (spread(31, 1.6) * forward, spread(57, 1.2) * forward);
            // By hand: the craft moves, then turns clockwise, so that what was ahead is to the left.
            let (r, f, u) = (right - flown.right, forward - flown.forward, up - flown.up);
            let (s, c) = angle.sin_cos();
            if let (Some(before), Some(after)) = (seen(right, forward, up), seen(r * c - f * s, f * c + r * s, u)) {
                points.push((before, after));
            }
        }
        points
    }

    #[test]
    fn a_turn_on_the_spot_is_measured() {
        let camera = Camera::quad();
        for degrees in [-4.0_f64, -0.5, 0.0, 1.0, 5.0] {
            let found = turn(&camera, &scene(&camera, degrees.to_radians(), Setpoint::HOLD), Setpoint::HOLD, None).unwrap();
            assert!((found.angle.to_degrees() - degrees).abs() < 0.02 + 0.01 * degrees.abs(), "{found:?} {degrees}");
        }
    }

    #[test]
    fn flying_does_not_look_like_turning() {
        let camera = Camera::quad();
        for flown in [
            Setpoint { forward: 0.2, ..Setpoint::HOLD },
            Setpoint { right: 0.2, ..Setpoint::HOLD },
            Setpoint { forward: 0.15, up: 0.1, right: -0.1, ..Setpoint::HOLD },
        ] {
            for degrees in [0.0_f64, 2.0, -3.0] {
                let points = scene(&camera, degrees.to_radians(), flown);
                // A velocity, of which only the direction counts.
                let velocity =
                    Setpoint { forward: 20.0 * flown.forward, right: 20.0 * flown.right, up: 20.0 * flown.up, yaw_rate: 0.0 };
                let found = turn(&camera, &points, velocity, None).unwrap();
                assert!((found.angle.to_degrees() - degrees).abs() < 0.15, "{flown:?}: {found:?} {degrees}");
            }
        }
    }

    #[test]
    fn too_few_points_tell_nothing_and_a_third_of_wrong_ones_little() {
        let camera = Camera::quad();
        let mut points = scene(&camera, 0.03, Setpoint::HOLD);
        assert_eq!(turn(&camera, &points[..4], Setpoint::HOLD, Some(0.03)), None);
        let count = points.len();
        for (from, to) in &mut points[..count / 3] {
            *to = ImagePoint { u: from.u + 0.02, v: from.v - 0.03 };
        }
        let found = turn(&camera, &points, Setpoint::HOLD, None).unwrap();
        assert!((found.angle - 0.03).abs() < 0.002, "{found:?}");
    }

    proptest! {
        #[test]
        fn any_points_give_a_finite_turn_or_none(
            places in proptest::collection::vec((-1.0..2.0, -1.0..2.0, -1.0..2.0, -1.0..2.0), 0..40),
            forward in -5.0..5.0, right in -5.0..5.0, up in -5.0..5.0, commanded in proptest::option::of(-1.0..1.0)
        ) {
            let points: Vec<_> = places.iter().map(|(a, b, c, d)| (ImagePoint { u: *a, v: *b }, ImagePoint { u: *c, v: *d })).collect();
            let flown = Setpoint { forward, right, up, yaw_rate: 0.0 };
            if let Some(found) = turn(&Camera::quad(), &points, flown, commanded) {
                prop_assert!(found.angle.is_finite() && found.deviation.is_finite());
            }
        }
    }
}
