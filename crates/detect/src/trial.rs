//! What a network gives for two images without a meaning, before a flight: whether it depends on the image at all, in which unit a
//! detector's boxes are, and whether its rows are what their number suggests.

use crate::decode::{Layout, Row, Unit};
use crate::error::NetworkError;

/// A detector's coordinates up to this, pixels, are fractions of the image.
pub(crate) const FRACTIONS: f32 = 1.5;
/// Least spread of the centres of boxes in fractions. What is counted from the corner of each cell spreads less, or has logarithms
/// for sides.
const SPREAD: f32 = 0.3;
/// Share of the sides that are sides in fractions.
const MOST_SIDES: f64 = 0.95;
/// How far a score may be from a probability.
const TOLERANCE: f32 = 0.01;
/// How far a class may be from a whole number.
const WHOLE: f32 = 1e-3;

/// Noise for the second image: `count` values from `least` to `most`, always the same ones.
pub(crate) fn noise(count: usize, least: f32, most: f32) -> Vec<f32> {
    let mut state = 0x2545_f491_u32;
    let next = || {
        // By Numerical Recipes; its upper bits are random enough.
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        least + (most - least) * (state >> 8) as f32 / (1 << 24) as f32
    };
    core::iter::repeat_with(next).take(count).collect()
}

/// The error for an output that does not depend on the image.
pub(crate) fn constant() -> NetworkError {
    NetworkError::Unfit(
        "its output is the same for every image: what it computed was lost when it was exported, or it is no network for images"
            .to_owned(),
    )
}

/// Whether two outputs are the same, bit for bit.
pub(crate) fn is_same(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// The unit of a detector's boxes, by its outputs for a grey image and for noise, each with its shape. `names`: number of class
/// names of the model.
///
/// # Errors
/// [`NetworkError::Unfit`] if the rows are not those of `layout`, or do not depend on the image.
pub(crate) fn unit(
    layout: &Layout,
    names: Option<usize>,
    input: (usize, usize),
    grey: (&[usize], &[f32]),
    noise: (&[usize], &[f32]),
) -> Result<Unit, NetworkError> {
    let same = is_same(grey.1, noise.1);
    let (grey, noise) = (layout.rows(grey.0, grey.1)?, layout.rows(noise.0, noise.1)?);
    if layout.is_final() {
        return last(&[grey, noise].concat(), same, names);
    }
    if same {
        return Err(constant());
    }
    // Of noise the scores of a small network may be anything.
    let scores = grey.iter().flat_map(|row| [row.least, row.score]);
    let (least, most) = scores.fold((0.0_f32, 0.0_f32), |(least, most), score| (least.min(score), most.max(score)));
    if least < -TOLERANCE || most > 1.0 + TOLERANCE {
        return Err(NetworkError::Unfit(format!(
            "its scores are from {least:.1} to {most:.1}, expected probabilities: export it with its last activation (sigmoid)"
        )));
    }
    cells(&[grey, noise].concat(), input)
}

/// The unit of boxes by centre and size.
fn cells(rows: &[Row], (width, height): (usize, usize)) -> Result<Unit, NetworkError> {
    let range = |of: usize| {
        let values = rows.iter().map(|row| row.place[of]).filter(|value| value.is_finite());
        values.fold((f32::INFINITY, f32::NEG_INFINITY), |(least, most), value| (least.min(value), most.max(value)))
    };
    let (x, y) = (range(0), range(1));
    if x.0 > x.1 || y.0 > y.1 {
        return Err(NetworkError::Unfit("its boxes are no numbers".to_owned()));
    }
    // The cells of a head are all over the image.
    if x.1 > 0.25 * width as f32 || y.1 > 0.25 * height as f32 {
        return Ok(Unit::Pixels);
    }
    let is_inside = |(least, most): (f32, f32)| least >= 1.0 - FRACTIONS && most <= FRACTIONS && most - least >= SPREAD;
    let sides = rows.iter().flat_map(|row| [row.place[2], row.place[3]]);
    let fitting = sides.filter(|side| (f32::MIN_POSITIVE..=FRACTIONS).contains(side)).count();
    if is_inside(x) && is_inside(y) && fitting as f64 >= MOST_SIDES * 2.0 * rows.len() as f64 {
        return Ok(Unit::Fractions);
    }
    Err(NetworkError::Unfit(format!(
        "the centres of its boxes are from ({:.1}, {:.1}) to ({:.1}, {:.1}) in an input of {width}×{height} pixels: they seem to count \
         cells of its grid; export it with its decoding, which gives pixels of the input",
        x.0, y.0, x.1, y.1
    )))
}

/// The unit of final boxes; pixels if there are none.
fn last(rows: &[Row], same: bool, names: Option<usize>) -> Result<Unit, NetworkError> {
    let given: Vec<&Row> = rows.iter().filter(|row| row.score > 0.0).collect();
    if given.is_empty() {
        return Ok(Unit::Pixels);
    }
    if same {
        return Err(constant());
    }
    let expected = "expected left, top, right, bottom, score and class";
    if let Some(row) = given.iter().find(|row| row.score > 1.0 + TOLERANCE || (row.class - row.class.round()).abs() > WHOLE) {
        return Err(NetworkError::Unfit(format!(
            "the last two of a row of its output are {} and {}, {expected}; heads with objectness (YOLOv5 and older) are not supported",
            row.score, row.class
        )));
    }
    let real = |row: &&&Row| {
        let [left, top, right, bottom] = row.place;
        left < right && top < bottom
    };
    let boxes: Vec<&&Row> = given.iter().filter(real).collect();
    if 2 * boxes.len() < given.len() {
        return Err(NetworkError::Unfit(format!("most rows of its output are no boxes by their corners, {expected}")));
    }
    if let Some((row, names)) = names.and_then(|names| Some((given.iter().find(|row| row.class >= names as f32)?, names))) {
        return Err(NetworkError::Unfit(format!(
            "it finds class {:.0}, counted from 0, and its metadata has {names} names",
            row.class
        )));
    }
    let is_fraction = |row: &&&Row| row.place.iter().all(|at| (1.0 - FRACTIONS..=FRACTIONS).contains(at));
    Ok(if !boxes.is_empty() && boxes.iter().all(is_fraction) { Unit::Fractions } else { Unit::Pixels })
}
