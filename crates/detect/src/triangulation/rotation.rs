//! The error of a frame's rotation, and of the direction in which the craft is said to have flown, from all points together.
//!
//! A turn of the camera moves all points alike, and a translation moves each along its own line, the farther the nearer it is. So of
//! a point whose range is not known only the motion across that line tells of the turn; of one whose range is known, both do. And if
//! the velocity is reported along other axes than the heading, as with a heading that is off by 2°, the lines meet beside the
//! direction of flight: near points then miss their lines by more than far ones. Both errors are solved for together, by weighted
//! least squares with weights that fall for points that do not fit (Cauchy's). From frame to frame they change little.

use std::collections::BTreeMap;

use glam::DVec3;

use spf_core::time::Time;

use super::{MotionError, Track, unit};

/// Standard deviation of a corrected rotation, radians, however many points there are.
const ERROR: f64 = 0.0005;
/// Standard deviations of telemetry's rotation, and of its change from one frame to the next, radians: 2° and 0.4°. A craft that
/// reports whole degrees is wrong by at most half of one.
const PRIOR: f64 = 0.035;
const CHANGE: f64 = 0.007;
/// The same of the direction of flight, and the standard deviation of a corrected one, however many points there are.
const AIM_PRIOR: f64 = 0.05;
const AIM_CHANGE: f64 = 0.003;
const AIM_ERROR: f64 = 0.008;
/// A point of unknown range is taken to be this far away, in 1/metres, with this standard deviation: more than the ranges of a scene
/// differ. The error is one that all points of a scene share, and must not become smaller with their number.
const INVERSE_RANGE: f64 = 0.1;
const INVERSE_RANGE_SD: f64 = 1.0;
/// Iterations of the weights.
const ITERATIONS: usize = 4;

/// What is wrong with telemetry's rotation and direction of flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correction {
    /// The rotation of this frame's rays, a vector in the world, radians.
    pub(super) turned: DVec3,
    /// Its standard deviation about the axis that is known least, radians.
    pub(super) turned_sd: f64,
    /// The rotation of all displacements, and its standard deviation, radians.
    pub(super) aim: DVec3,
    pub(super) aim_sd: f64,
}

impl Default for Correction {
    fn default() -> Self {
        Self { turned: DVec3::ZERO, turned_sd: CHANGE, aim: DVec3::ZERO, aim_sd: AIM_PRIOR }
    }
}

impl Correction {
    /// Whether telemetry may be wrong by as much.
    pub(super) fn is_plausible(&self) -> bool {
        self.turned.length() < 3.0 * PRIOR && self.aim.length() < 3.0 * AIM_PRIOR
    }

    /// A displacement, turned to where the craft has flown in the axes of the rays.
    pub(super) fn displacement(&self, displacement: DVec3) -> DVec3 {
        displacement + self.aim.cross(displacement)
    }

    /// A direction in the axes of the rays, turned back to the axes of the displacements.
    pub(super) fn direction(&self, direction: DVec3) -> DVec3 {
        direction - self.aim.cross(direction)
    }
}

/// Errors of what is compared.
#[derive(Clone, Copy)]
pub(super) struct Errors {
    /// Of a ray's direction, standard deviation in radians.
    pub(super) ray: f64,
    pub(super) motion: MotionError,
}

/// One component of where a point is seen, compared with where it is expected: `value = along · (turned, aim)` but for the noise.
struct Equation {
    along: [f64; 6],
    value: f64,
    deviation: f64,
}

/// The correction for a frame with these rays, seen at a time and from a place.
pub(super) fn correction(
    tracks: &BTreeMap<u32, Track>,
    rays: &BTreeMap<u32, DVec3>,
    from: (Time, DVec3),
    before: Correction,
    errors: Errors,
) -> Correction {
    let compared: Vec<(&Track, DVec3)> = rays.iter().filter_map(|(id, ray)| Some((tracks.get(id)?, *ray))).collect();
    let mut equations = Vec::with_capacity(2 * compared.len());
    for (track, ray) in &compared {
        compare(track, *ray, from, &before, errors, compared.len() as f64, &mut equations);
    }
    let information = |deviation: f64| 1.0 / (deviation * deviation);
    let last: [f64; 6] = core::array::from_fn(|i| if i < 3 { before.turned[i] } else { before.aim[i - 3] });
    let change = [information(CHANGE), information(AIM_CHANGE)];
    let prior = [information(PRIOR), information(AIM_PRIOR)];
    let mut found = last;
    let mut deviations = [CHANGE, AIM_PRIOR];
    for _ in 0..ITERATIONS {
        let mut matrix = [[0.0; 6]; 6];
        let mut right: [f64; 6] = core::array::from_fn(|i| change[i / 3] * last[i]);
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] = change[i / 3] + prior[i / 3];
        }
        for Equation { along, value, deviation } in &equations {
            let miss = (value - along.iter().zip(&found).map(|(a, x)| a * x).sum::<f64>()) / deviation;
            let weight = 1.0 / (deviation * deviation * (1.0 + 0.25 * miss * miss));
            for i in 0..6 {
                for j in 0..6 {
                    matrix[i][j] += weight * along[i] * along[j];
                }
                right[i] += weight * along[i] * value;
            }
        }
        let Some(lower) = factor(matrix) else { return before };
        found = solved(&lower, right);
        let variance = |i: usize| {
            let unit: [f64; 6] = core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
            solved(&lower, unit)[i]
        };
        deviations = [0, 3].map(|from| (from..from + 3).map(variance).fold(0.0, f64::max).max(0.0).sqrt());
    }
    let [a, b, c, d, e, f] = found;
    Correction {
        turned: DVec3::new(a, b, c),
        turned_sd: libm::hypot(ERROR, deviations[0]),
        aim: DVec3::new(d, e, f),
        aim_sd: libm::hypot(AIM_ERROR, deviations[1]),
    }
}

/// Adds what a point tells. The ranges of all `shared` points are wrong alike where the direction of flight or the distance is, so
/// that as far as their ranges go all of them tell no more than one: counted singly they would prove whatever correction has made
/// them, and it would grow without bound.
fn compare(
    track: &Track,
    seen: DVec3,
    (now, from): (Time, DVec3),
    before: &Correction,
    Errors { ray, motion }: Errors,
    shared: f64,
    equations: &mut Vec<Equation>,
) {
    let Some(first) = track.seen.front() else { return };
    // The direction in which it is expected, and in which its unknown range moves it.
    let to_first = before.displacement(first.from - from);
    let (inverse, inverse_sd) = track.inverse.unwrap_or((INVERSE_RANGE, INVERSE_RANGE_SD));
    let towards = first.along + inverse * to_first;
    let Some(expected) = unit(towards) else { return };
    let slide = to_first - to_first.dot(expected) * expected;
    let Some(slides) = unit(slide).or_else(|| unit(expected.cross(DVec3::Z))) else { return };
    let other = expected.cross(slides);
    // The error of the direction is solved for, if the range is known.
    let moved = match track.inverse {
        Some(_) => libm::hypot(motion.least, motion.relative * to_first.length()),
        None => motion.of(to_first.length(), now.since(first.at)),
    };
    let noise = 2.0 * ray * ray + moved * moved * inverse * inverse;
    let unknown = slide.length() * inverse_sd;
    let nearness = if track.inverse.is_some() { inverse / towards.length() } else { 0.0 };
    for (axis, variance) in [(slides, noise + shared * unknown * unknown), (other, noise)] {
        // A small turn of the ray adds `axis · (turned × ray)`, one of the displacement takes `nearness axis · (aim × displacement)`
        // away: together they have to make up for what is missed. The displacement is turned by the last aim already.
        let turn = seen.cross(axis);
        let aim = -nearness * to_first.cross(axis);
        let along = core::array::from_fn(|i| if i < 3 { turn[i] } else { aim[i - 3] });
        equations.push(Equation { along, value: -axis.dot(seen) + aim.dot(before.aim), deviation: libm::sqrt(variance) });
    }
}

/// The lower triangle whose product with its transpose is the matrix (Cholesky); `None` unless it is positive definite.
fn factor(matrix: [[f64; 6]; 6]) -> Option<[[f64; 6]; 6]> {
    let mut lower = [[0.0; 6]; 6];
    for i in 0..6 {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            if i == j {
                // Also false for what is no number.
                let positive = rest > 0.0;
                if !positive {
                    return None;
                }
                lower[i][i] = libm::sqrt(rest);
            } else {
                lower[i][j] = rest / lower[j][j];
            }
        }
    }
    Some(lower)
}

/// The solution of a factored system.
fn solved(lower: &[[f64; 6]; 6], mut right: [f64; 6]) -> [f64; 6] {
    for i in 0..6 {
        right[i] = (right[i] - (0..i).map(|k| lower[i][k] * right[k]).sum::<f64>()) / lower[i][i];
    }
    for i in (0..6).rev() {
        right[i] = (right[i] - (i + 1..6).map(|k| lower[k][i] * right[k]).sum::<f64>()) / lower[i][i];
    }
    right
}
