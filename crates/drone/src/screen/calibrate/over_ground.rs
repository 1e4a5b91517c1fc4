//! How a camera has moved over flat ground between two pictures, from points of the ground followed in them.
//!
//! A point of the ground that is seen at an angle below the horizon is as far away as the height says, so that its motion tells the
//! way in units of the height. But a craft tilts when it gains speed and when it flies, which moves the horizon: a ground that seems 7°
//! lower is a third nearer at 20°. So the tilt is an unknown as well: pitch and roll at the first picture, their changes, the turn, and
//! the way in three directions are found together, by least squares with weights that fall for points that do not fit (Cauchy's), as
//! those of things that stand on the ground. Rotation moves all points alike, a way only those that are near, and the tilt changes
//! which those are: so they can be told apart where the ground is seen over a range of angles. Points above the horizon, at distances
//! that are not known, tell of the rotation: across the line along which a way moves them. What the picture does not tell is what was
//! before: a prior ties the tilt to that of the last two pictures. Where there is too little ground, as below a nose that has risen, all points
//! are taken to be at unknown distances, so that at least the tilt is followed ([`tilted`]).

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, BodyDisplacement};
use spf_core::lift::{CameraDisplacement, Lifting, lift, lower};
use spf_core::query::ImagePoint;

/// Standard deviation of a point's motion, as a fraction of the picture's width.
const NOISE: f64 = 0.0007;
/// Ground is looked for below this tangent of the angle under the horizon: nearer to it the ranges are wrong.
const BELOW: f64 = 0.1;
/// From this tangent on ground counts in full. Nearer to the horizon, what stands on the ground is taken for ground behind it.
const FULL: f64 = 0.5;
/// Fewest points of the ground.
const FEWEST: usize = 12;
/// Part of them that has to fit.
const AGREEING: f64 = 0.5;
/// Standard deviations of what is known before: pitch and roll besides what is said, their changes, a turn, and a way.
const TILT: f64 = 0.003;
const TILTING: f64 = 0.3;
const TURNING: f64 = 0.3;
const WAY: f64 = 0.6;
/// What is wrong of a change of the tilt, as a fraction.
const DOUBT: f64 = 0.1;
/// Steps of the solution. In the first ones points with large misses count as well.
const STEPS: usize = 9;
const UNKNOWNS: usize = 8;
/// Nearness of something very far and of something ten heights away, per height, and the greatest nearness in units of the latter.
const FAR: f64 = 1e-6;
const NEAR: f64 = 0.1;
const MOST: f64 = 8.0;
/// Step of the numeric derivative.
const DELTA: f64 = 1e-5;

type Vector = [f64; UNKNOWNS];

/// A motion between two pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// Pitch at the first picture, radians, nose up.
    pub pitch: f64,
    /// Roll at the first picture, radians, right side down.
    pub roll: f64,
    /// Change of the pitch, radians.
    pub pitched: f64,
    /// Change of the roll, radians.
    pub rolled: f64,
    /// Turn, radians clockwise.
    pub turned: f64,
    /// Way to the right, in units of the height at the first picture, along the axes of its heading.
    pub right: f64,
    /// Way forward, in the same units.
    pub forward: f64,
    /// Way up, in the same units.
    pub up: f64,
    /// Standard deviations of pitch and roll at the second picture, radians.
    pub tilt_sd: (f64, f64),
}

impl Moved {
    /// The same with a tilt that is less certain, radians.
    #[must_use]
    pub fn blurred(&self, by: f64) -> Self {
        let wider = |deviation: f64| libm::hypot(deviation, by).min(0.3);
        Self { tilt_sd: (wider(self.tilt_sd.0), wider(self.tilt_sd.1)), ..*self }
    }

    /// What is expected next: the same motion from where this one ended.
    #[must_use]
    pub fn next(&self) -> Self {
        Self { pitch: self.pitch + self.pitched, roll: self.roll + self.rolled, ..*self }
    }

    fn vector(&self) -> Vector {
        [self.pitch, self.roll, self.pitched, self.rolled, self.turned, self.right, self.forward, self.up]
    }

    fn of([pitch, roll, pitched, rolled, turned, right, forward, up]: Vector) -> Self {
        Self { pitch, roll, pitched, rolled, turned, right, forward, up, tilt_sd: (0.0, 0.0) }
    }
}

/// The motion between two pictures in which points were seen at the first place and then at the second. `expected` is a start, and its pitch and
/// roll are what they are taken to be, within `tilt_sd`. `None` with too few points of the ground, or if they do not agree.
#[must_use]
pub fn moved(camera: &Camera, points: &[(ImagePoint, ImagePoint)], expected: &Moved) -> Option<Moved> {
    let level = Attitude { pitch: expected.pitch, roll: expected.roll, heading: 0.0 };
    let ground: Vec<_> = points.iter().filter(|(from, _)| is_below(camera, *from, level)).collect();
    if ground.len() < FEWEST {
        return None;
    }
    let distant = points.iter().filter(|(from, _)| !is_below(camera, *from, level));
    let all: Vec<_> = ground.iter().map(|pair| (true, **pair)).chain(distant.map(|pair| (false, *pair))).collect();
    let (found, tilt_sd) = fit(camera, &all, expected)?;
    let agrees = |(from, to): &&&(ImagePoint, ImagePoint)| {
        seen(camera, *from, &found).is_some_and(|at| {
            let (u, v) = miss(camera, at, *to);
            u.hypot(v) < 4.0 * NOISE
        })
    };
    let agreeing = ground.iter().filter(agrees).count();
    let is_known = found.iter().all(|value| value.is_finite());
    (is_known && agreeing >= FEWEST && agreeing as f64 >= AGREEING * ground.len() as f64)
        .then(|| Moved { tilt_sd, ..Moved::of(found) })
}

/// Between two pictures that do not show enough ground: how the camera has turned and tilted, from points at any distances. The way is that
/// which was expected. `None` with too few points, or if they do not agree.
#[must_use]
pub fn tilted(camera: &Camera, points: &[(ImagePoint, ImagePoint)], expected: &Moved) -> Option<Moved> {
    if points.len() < FEWEST {
        return None;
    }
    let all: Vec<_> = points.iter().map(|pair| (false, *pair)).collect();
    let (found, tilt_sd) = fit(camera, &all, expected)?;
    let agrees = |pair: &&(ImagePoint, ImagePoint)| aside(camera, pair, &found).is_some_and(|(u, v)| u.hypot(v) < 4.0 * NOISE);
    let agreeing = points.iter().filter(agrees).count();
    let is_known = found.iter().all(|value| value.is_finite());
    let Moved { right, forward, up, .. } = *expected;
    (is_known && agreeing >= FEWEST && agreeing as f64 >= AGREEING * points.len() as f64).then(|| Moved {
        tilt_sd,
        right,
        forward,
        up,
        ..Moved::of(found)
    })
}

/// The motion that fits points of the ground (true) and points at unknown distances best, and the standard deviations of pitch and roll after it.
fn fit(camera: &Camera, all: &[(bool, (ImagePoint, ImagePoint))], expected: &Moved) -> Option<(Vector, (f64, f64))> {
    let level = Attitude { pitch: expected.pitch, roll: expected.roll, heading: 0.0 };
    let before = expected.vector();
    let prior: Vector = [before[0], before[1], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let tilt = |deviation: f64| libm::hypot(deviation, TILT);
    let deviations: Vector = [tilt(expected.tilt_sd.0), tilt(expected.tilt_sd.1), TILTING, TILTING, TURNING, WAY, WAY, WAY];
    let (mut found, mut tilt_sd) = (before, (0.0, 0.0));
    for step in 0..STEPS {
        let scale = NOISE * f64::from(1 << (4_usize.saturating_sub(step)));
        let mut matrix = [[0.0; UNKNOWNS]; UNKNOWNS];
        let mut right = [0.0; UNKNOWNS];
        for number in 0..UNKNOWNS {
            let weight = 1.0 / (deviations[number] * deviations[number]);
            matrix[number][number] += weight;
            right[number] += weight * (prior[number] - found[number]);
        }
        for (is_ground, pair) in all {
            let missed = |motion: &Vector| {
                if *is_ground {
                    seen(camera, pair.0, motion).map(|at| miss(camera, at, pair.1))
                } else {
                    aside(camera, pair, motion)
                }
            };
            let Some((du, dv)) = missed(&found) else { continue };
            let part = if *is_ground { (below(camera, pair.0, level) / FULL).clamp(0.0, 1.0) } else { 1.0 };
            let weight = part / (NOISE * NOISE * (1.0 + 0.25 * (du * du + dv * dv) / (scale * scale)));
            let mut slopes = [[0.0; UNKNOWNS]; 2];
            for number in 0..UNKNOWNS {
                let mut beside = found;
                beside[number] += DELTA;
                let (u, v) = missed(&beside).unwrap_or((du, dv));
                // The miss falls as the prediction rises.
                slopes[0][number] = (du - u) / DELTA;
                slopes[1][number] = (dv - v) / DELTA;
            }
            for (slope, miss) in slopes.iter().zip([du, dv]) {
                for row in 0..UNKNOWNS {
                    right[row] += weight * slope[row] * miss;
                    for column in 0..UNKNOWNS {
                        matrix[row][column] += weight * slope[row] * slope[column];
                    }
                }
            }
        }
        let change = solve(matrix, right)?;
        if step + 1 == STEPS {
            // Of pitch and its change together, and of roll and its change; what is wrong grows with the change.
            let deviation = |at: usize| {
                let unit: Vector = core::array::from_fn(|number| if number == at || number == at + 2 { 1.0 } else { 0.0 });
                let variance = solve(matrix, unit).map_or(0.0, |found| found[at] + found[at + 2]).max(0.0);
                libm::hypot(variance.sqrt(), DOUBT * (found[at + 2] + change[at + 2]))
            };
            tilt_sd = (deviation(0), deviation(1));
        }
        for (value, change) in found.iter_mut().zip(change) {
            // A step of a linear solution is not to be trusted far away.
            *value += change.clamp(-0.3, 0.3);
        }
    }
    Some((found, tilt_sd))
}

/// Whether a place of the picture shows what lies well below the horizon.
fn is_below(camera: &Camera, at: ImagePoint, attitude: Attitude) -> bool {
    below(camera, at, attitude) > BELOW
}

/// Tangent of the angle under the horizon at which something is seen.
fn below(camera: &Camera, at: ImagePoint, attitude: Attitude) -> f64 {
    let level = levelled(camera, at, attitude);
    -level.up / level.right.hypot(level.forward)
}

fn levelled(camera: &Camera, at: ImagePoint, attitude: Attitude) -> BodyDisplacement {
    let ray = camera.ray(at);
    lift(CameraDisplacement { right: ray.right, forward: 1.0, up: ray.up }, camera, attitude, Lifting::Levelled)
}

/// Where a point of the ground is seen after a motion.
fn seen(camera: &Camera, from: ImagePoint, motion: &Vector) -> Option<ImagePoint> {
    let level = levelled(camera, from, Attitude { pitch: motion[0], roll: motion[1], heading: 0.0 });
    let down = -level.up;
    (down > 0.0).then(|| after(camera, level, 1.0 / down, motion)).flatten()
}

/// What is missing of the motion of a point at an unknown distance, whatever that is: what is across the line along which a way moves it.
fn aside(camera: &Camera, (from, to): &(ImagePoint, ImagePoint), motion: &Vector) -> Option<(f64, f64)> {
    let level = levelled(camera, *from, Attitude { pitch: motion[0], roll: motion[1], heading: 0.0 });
    let nearness = |nearness: f64| after(camera, level, 1.0 / nearness, motion);
    let (far, near) = (nearness(FAR)?, nearness(NEAR)?);
    let (du, dv) = miss(camera, far, *to);
    let (gu, gv) = miss(camera, far, near);
    // The distance that fits best, between endless and a nearness that was tried.
    let along = ((du * gu + dv * gv) / (gu * gu + gv * gv + NOISE * NOISE)).clamp(0.0, MOST);
    Some((du - along * gu, dv - along * gv))
}

/// Where something at a distance along a levelled ray is seen after a motion.
fn after(camera: &Camera, level: BodyDisplacement, distance: f64, motion: &Vector) -> Option<ImagePoint> {
    let Moved { pitch, roll, pitched, rolled, turned, right, forward, up, .. } = Moved::of(*motion);
    let (r, f) = (level.right * distance - right, level.forward * distance - forward);
    let (sin, cos) = (libm::sin(turned), libm::cos(turned));
    // What is ahead moves to the left when the nose turns to the right.
    let there = BodyDisplacement { right: r * cos - f * sin, forward: f * cos + r * sin, up: level.up * distance - up };
    let after = Attitude { pitch: pitch + pitched, roll: roll + rolled, heading: 0.0 };
    let CameraDisplacement { right, forward, up } = lower(there, camera, after, Lifting::Levelled);
    camera.project(right, forward, up)
}

/// What is missing from one place to another, as fractions of the picture's width.
fn miss(camera: &Camera, at: ImagePoint, to: ImagePoint) -> (f64, f64) {
    (to.u - at.u, (to.v - at.v) * f64::from(camera.height) / f64::from(camera.width.max(1)))
}

/// The solution of a system with a symmetric, positive definite matrix (Cholesky); `None` if it is not.
fn solve(mut lower: [Vector; UNKNOWNS], mut right: Vector) -> Option<Vector> {
    for i in 0..UNKNOWNS {
        for j in 0..=i {
            let rest = lower[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            if i == j {
                // Also false for what is no number.
                let is_positive = rest > 0.0;
                if !is_positive {
                    return None;
                }
                lower[i][i] = rest.sqrt();
            } else {
                lower[i][j] = rest / lower[j][j];
            }
        }
    }
    for i in 0..UNKNOWNS {
        right[i] = (right[i] - (0..i).map(|k| lower[i][k] * right[k]).sum::<f64>()) / lower[i][i];
    }
    for i in (0..UNKNOWNS).rev() {
        right[i] = (right[i] - (i + 1..UNKNOWNS).map(|k| lower[k][i] * right[k]).sum::<f64>()) / lower[i][i];
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Points before and after a motion of a camera one unit above the ground; every fourth is on a wall 8 units ahead instead, and the
    /// places are a little wrong.
    fn scene(camera: &Camera, motion: &Moved, walls: bool) -> Vec<(ImagePoint, ImagePoint)> {
        let mut points = Vec::new();
        for n in 0..110_u32 {
            let from = ImagePoint { u: f64::from(n % 11) / 11.0 + 0.04, v: 0.5 + 0.05 * f64::from(n / 11) };
            let level = levelled(camera, from, Attitude { pitch: motion.pitch, roll: motion.roll, heading: 0.0 });
            let mut vector = motion.vector();
            if walls && n % 4 == 0 && level.forward / -level.up > 3.0 {
                // The wall is nearer than the ground behind it: its motion is that over ground nearer by.
                let nearer = level.forward / -level.up / 3.0;
                vector[5..].iter_mut().for_each(|way| *way *= nearer);
            }
            if let Some(mut to) = seen(camera, from, &vector) {
                to.u += 0.0004 * (f64::from(n * 37 % 19) / 9.0 - 1.0);
                to.v += 0.0004 * (f64::from(n * 53 % 17) / 8.0 - 1.0);
                points.push((from, to));
            }
        }
        points
    }

    #[test]
    fn a_hand_worked_point_of_the_ground() {
        // Level, 45° below the horizon: one unit ahead. After half a unit forward it is half a unit ahead, 63.4° below.
        let camera = Camera::from_fov(960, 720, 2.5, 2.5, 0.0);
        let at = |tangent: f64| camera.project(0.0, 1.0, -tangent).unwrap();
        let motion = Moved { forward: 0.5, ..Moved::default() };
        let found = seen(&camera, at(1.0), &motion.vector()).unwrap();
        assert!((found.v - at(2.0).v).abs() < 1e-9 && (found.u - 0.5).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_way_is_told_from_a_tilt_that_comes_with_it() {
        let camera = Camera::quad();
        // Gaining speed: the nose goes down by 2° from −5°, while it flies forward and to the right.
        let motion =
            Moved { pitch: -0.0873, pitched: -0.035, rolled: 0.02, right: 0.02, forward: 0.06, turned: 0.01, ..Moved::default() };
        let expected = Moved { pitch: -0.08, tilt_sd: (0.01, 0.01), ..Moved::default() };
        let found = moved(&camera, &scene(&camera, &motion, true), &expected).unwrap();
        assert!((found.forward - motion.forward).abs() < 0.003 && (found.right - motion.right).abs() < 0.002, "{found:?}");
        assert!((found.pitched - motion.pitched).abs() < 0.003 && (found.turned - motion.turned).abs() < 0.002, "{found:?}");
    }

    #[test]
    fn points_above_the_horizon_few_points_and_a_crowd_tell_nothing() {
        let camera = Camera::quad();
        let points = scene(&camera, &Moved { forward: 0.05, ..Moved::default() }, false);
        let rising: Vec<_> = points.iter().map(|(from, to)| (ImagePoint { v: 0.4 * from.v, ..*from }, *to)).collect();
        assert_eq!(moved(&camera, &rising[..40], &Moved::default()), None);
        assert_eq!(moved(&camera, &points[100..], &Moved::default()), None);
        let crowd = points.iter().enumerate().map(|(n, (from, to))| {
            let off = |k: usize| 0.05 * ((n * k % 13) as f64 / 6.0 - 1.0);
            (*from, ImagePoint { u: to.u + off(5), v: to.v + off(7) })
        });
        assert_eq!(moved(&camera, &crowd.collect::<Vec<_>>(), &Moved::default()), None);
    }

    #[test]
    fn a_nose_that_rises_is_seen_by_things_at_any_distance() {
        let camera = Camera::quad();
        // Gaining speed backwards: the nose goes up by 6° from 10°, when hardly any ground is seen.
        let motion = Moved { pitch: 0.17, pitched: 0.105, rolled: -0.01, turned: 0.02, forward: -0.05, ..Moved::default() };
        let mut points = Vec::new();
        for n in 0..90_u32 {
            let from = ImagePoint { u: f64::from(n % 10) / 10.0 + 0.04, v: 0.1 + 0.08 * f64::from(n / 10) };
            let level = levelled(&camera, from, Attitude { pitch: motion.pitch, roll: 0.0, heading: 0.0 });
            points.extend(after(&camera, level, 4.0 + f64::from(n * 7 % 30), &motion.vector()).map(|to| (from, to)));
        }
        let expected = Moved { pitch: 0.17, forward: -0.05, tilt_sd: (0.01, 0.01), ..Moved::default() };
        let found = tilted(&camera, &points, &expected).unwrap();
        assert!((found.pitched - motion.pitched).abs() < 0.005 && (found.rolled - motion.rolled).abs() < 0.005, "{found:?}");
        assert!((found.turned - motion.turned).abs() < 0.005 && found.forward == -0.05, "{found:?}");
        assert_eq!(tilted(&camera, &points[..8], &expected), None);
        let crowd = points.iter().enumerate().map(|(n, (from, to))| {
            let off = |k: usize| 0.05 * ((n * k % 13) as f64 / 6.0 - 1.0);
            (*from, ImagePoint { u: to.u + off(5), v: to.v + off(7) })
        });
        assert_eq!(tilted(&camera, &crowd.collect::<Vec<_>>(), &expected), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_motion_over_ground_is_found_again(
            pitch in -0.15..0.1, roll in -0.1..0.1, pitched in -0.03..0.03, rolled in -0.03..0.03, turned in -0.06..0.06,
            right in -0.08..0.08, forward in -0.08..0.08, up in -0.04..0.04, off in -0.01..0.01, tilt in 0.0..0.3
        ) {
            let camera = Camera::from_fov(960, 720, 1.57, 1.29, tilt);
            let motion = Moved { pitch, roll, pitched, rolled, turned, right, forward, up, ..Moved::default() };
            let expected = Moved { pitch: pitch + off, roll: roll - off, tilt_sd: (0.01, 0.01), ..Moved::default() };
            if let Some(found) = moved(&camera, &scene(&camera, &motion, false), &expected) {
                let close = |a: f64, b: f64| (a - b).abs() < 0.004 + 0.06 * motion.forward.hypot(right).hypot(up);
                prop_assert!(close(found.forward, forward) && close(found.right, right) && close(found.up, up), "{found:?}");
                prop_assert!((found.turned - turned).abs() < 0.005, "{found:?}");
            } else {
                // Only a camera that sees hardly any ground does not tell.
                prop_assert!(pitch > 0.0 && tilt < 0.1, "{motion:?}");
            }
        }

        #[test]
        fn any_points_give_finite_numbers_or_none(
            places in proptest::collection::vec((-1.0..2.0, -1.0..2.0, -1.0..2.0, -1.0..2.0), 0..60), pitch in any::<f64>()
        ) {
            let points: Vec<_> = places.iter().map(|(a, b, c, d)| (ImagePoint { u: *a, v: *b }, ImagePoint { u: *c, v: *d })).collect();
            let expected = Moved { pitch, ..Moved::default() };
            for found in [moved(&Camera::quad(), &points, &expected), tilted(&Camera::quad(), &points, &expected)].into_iter().flatten() {
                prop_assert!(found.vector().iter().all(|value| value.is_finite()));
            }
        }
    }
}
