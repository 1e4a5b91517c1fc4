//! Ground that rises in front of the craft: to its own height, or near below a level path.

use std::collections::BTreeMap;

use spf_core::lift::{CameraDisplacement, Lifting, lift};
use spf_core::query::{ImageBox, ImagePoint};

use super::errors::ErrorFile;
use super::extent::{Distances, Hole, Obstacle, band, obstacle_of, side, surrounded};
use super::sight::{GroundTruthView, PerceivedObject};

/// Ground counts as rising from this far above the lowest ground before it in the same column of the image, metres: more than a kerb
/// or a step.
const RISE: f64 = 0.7;
/// It is in the way from this far below the camera, metres.
const BELOW: f64 = 1.0;
/// Distance between sampled columns and rows, pixels.
const STEP: (usize, usize) = (8, 4);
/// Columns without rising ground that separate two slopes.
const GAP: usize = 3;

/// A sample of rising ground.
#[derive(Clone, Copy, Debug)]
struct Sample {
    column: usize,
    row: usize,
    /// Squared straight-line distance, square metres.
    squared: f64,
}

/// The slopes in view, each in pieces like other obstacles.
pub(super) fn slopes_ahead(
    errors: &ErrorFile,
    seed: u64,
    frame: u64,
    sight: &GroundTruthView<'_>,
    things: &[PerceivedObject],
    holes: &[Hole],
) -> Vec<Obstacle> {
    let mut out = Vec::new();
    for (id, samples) in rising(sight, things) {
        let Some(thing) = things.iter().find(|thing| thing.id == id && !thing.tags.opening) else { continue };
        let (nearest, farthest) = samples.iter().fold((f64::INFINITY, 0.0), |(nearest, farthest): (f64, f64), sample| {
            (nearest.min(sample.squared), farthest.max(sample.squared))
        });
        let hole = surrounded(&around(&samples, sight), (nearest, farthest), holes).map(|hole| &holes[hole]);
        let mut pieces: BTreeMap<(usize, usize), Vec<Sample>> = BTreeMap::new();
        for sample in samples {
            let point = ImagePoint {
                u: (sample.column as f64 + 0.5) / sight.width as f64,
                v: (sample.row as f64 + 0.5) / sight.height as f64,
            };
            if let Some(side) = hole.map_or(Some(0), |hole| side(hole, point, sample.squared)) {
                pieces.entry((band(sample.squared, nearest), side)).or_default().push(sample);
            }
        }
        let mut part = 0;
        for samples in pieces.into_values() {
            // Samples are ordered by column.
            for samples in samples.chunk_by(|a, b| b.column - a.column <= GAP * STEP.0) {
                part += 1;
                let nearest = samples.iter().map(|sample| sample.squared).fold(f64::INFINITY, f64::min);
                let pixels = samples.len() * STEP.0 * STEP.1;
                let key = [frame, u64::from(id), u64::MAX, part];
                let mut slope =
                    obstacle_of((errors, seed, frame), sight, thing, around(samples, sight), (nearest, pixels as u64), &key);
                name_of(thing).clone_into(&mut slope.name);
                slope.slope = true;
                out.push(slope);
            }
        }
    }
    out
}

/// What somebody calls such ground.
fn name_of(thing: &PerceivedObject) -> &'static str {
    let words = || thing.tags.names.iter().chain(&thing.tags.synonyms).flat_map(|name| name.split(' '));
    if words().any(|word| matches!(word, "hill" | "ridge" | "knoll" | "mound")) {
        "hillside"
    } else if matches!(thing.tags.kind.as_str(), "water" | "lake" | "pond" | "river" | "sea") {
        "bank"
    } else {
        "slope"
    }
}

/// The rectangle around samples.
fn around(samples: &[Sample], sight: &GroundTruthView<'_>) -> ImageBox {
    let (w, h) = (sight.width as f64, sight.height as f64);
    let whole = ImageBox { left: 1.0, top: 1.0, right: 0.0, bottom: 0.0 };
    samples.iter().fold(whole, |b, sample| ImageBox {
        left: b.left.min(sample.column as f64 / w),
        top: b.top.min(sample.row as f64 / h),
        right: b.right.max((sample.column + STEP.0) as f64 / w).min(1.0),
        bottom: b.bottom.max((sample.row + STEP.1) as f64 / h).min(1.0),
    })
}

/// The samples of rising ground by object, ordered by column.
fn rising(sight: &GroundTruthView<'_>, things: &[PerceivedObject]) -> BTreeMap<u16, Vec<Sample>> {
    let (w, h) = (sight.width, sight.height);
    let ground: Vec<u16> =
        things.iter().filter(|thing| thing.tags.is_surface() && !thing.tags.opening).map(|thing| thing.id).collect();
    let mut is_ground = vec![false; ground.iter().max().map_or(0, |most| usize::from(*most) + 1)];
    ground.iter().for_each(|id| is_ground[usize::from(*id)] = true);
    let upward = |right: f64, forward: f64, up: f64| {
        lift(CameraDisplacement { right, forward, up }, sight.camera, sight.attitude, Lifting::Levelled).up
    };
    // Height above the camera is a sum over the axes of the camera.
    let (across, along, up) = (upward(1.0, 0.0, 0.0), upward(0.0, 1.0, 0.0), upward(0.0, 0.0, 1.0));
    let distances = Distances::of(sight);
    let mut found: BTreeMap<u16, Vec<Sample>> = BTreeMap::new();
    for column in (0..w).step_by(STEP.0) {
        let mut lowest = f64::INFINITY;
        for row in (0..h).step_by(STEP.1).rev() {
            let at = row * w + column;
            let (id, depth) = (sight.ids[at], f64::from(sight.depth[at]));
            if !(is_ground.get(usize::from(id)).is_some_and(|is| *is) && depth > 0.0 && depth.is_finite()) {
                continue;
            }
            let height = depth * (along + across * distances.aside[column] + up * distances.up[row]);
            lowest = lowest.min(height);
            if height - lowest >= RISE && height >= -BELOW {
                let squared = distances.squared(column, row, depth);
                found.entry(id).or_default().push(Sample { column, row, squared });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use spf_core::camera::Camera;
    use spf_core::query::QueryKind;

    use crate::Oracle;
    use crate::tests::{Painting, ask, query, tagged};

    const W: usize = 960;
    const H: usize = 720;

    /// Boxes for flat ground `height` metres below a level camera, which from `foot` metres on rises by `slope` metres a metre up to
    /// `top` metres above the camera.
    fn boxes(height: f64, foot: f64, slope: f64, top: f64) -> Vec<(String, u8)> {
        let camera = Camera { tilt: 0.0, ..Camera::quad() };
        let mut painting = Painting::new().with(tagged(1, "crane", "machine", "red"), 420..540, 10..100, 99.0);
        painting = painting.with(tagged(2, "hill", "ground", "green"), 0..W, 100..H, 0.0).seen_by(camera);
        for row in 100..H {
            let up = (360.0 - row as f64 - 0.5) / 480.0;
            // The ray meets the flat ground, or the slope z = −height + slope · (y − foot).
            let flat = if up < 0.0 { -height / up } else { f64::INFINITY };
            let depth = if flat <= foot { flat } else { (-height - slope * foot) / (up - slope) };
            let hit = depth > 0.0 && up * depth <= top;
            painting = painting.deepened(0..W, row..row + 1, |_| if hit { depth as f32 } else { 0.0 });
        }
        let oracle = Oracle::new(crate::ErrorFile::named("perfect").unwrap(), 3.0, 7);
        let reply = ask(&oracle, &painting, &query(0, QueryKind::point(true), "fly to the red crane"));
        reply.boxes.into_iter().map(|b| (b.name, b.depth)).collect()
    }

    #[test]
    fn a_hill_in_front_is_listed_from_where_it_reaches_the_level_of_flight() {
        let found = boxes(4.0, 10.0, 0.5, 6.0);
        // One metre below the camera it is 16 m away: label 6.4.
        assert_eq!(found.first(), Some(&("hillside".to_owned(), 6)), "{found:?}");
    }

    #[test]
    fn level_ground_and_what_stays_below_are_not_listed() {
        assert_eq!(boxes(0.8, 10.0, 0.0, 0.0), [], "close to level ground");
        assert_eq!(boxes(4.0, 10.0, 0.5, -1.5), [], "a mound 1.5 m below");
        assert_eq!(boxes(1.2, 10.0, 0.5, -0.7), [], "half a metre high");
    }
}
