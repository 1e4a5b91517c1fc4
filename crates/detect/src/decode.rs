//! Decodes a network's output to boxes, in the layouts exported for YOLO versions 8 to 12 and similar models.
//!
//! | output | contents |
//! |---|---|
//! | 1 × (4 + classes) × cells | rows of centres, widths, heights and class probabilities; the default |
//! | 1 × cells × (4 + classes) | the same transposed |
//! | the same with 32 more rows, and a second output | with masks, which are ignored |
//! | 1 × boxes × 6 | corners, score, class: after non-maximum suppression |
//!
//! Coordinates are pixels of the input, or fractions of it, as RT-DETR gives them; probabilities are final, and there is no
//! objectness.

use spf_core::coco::CLASSES;
use spf_core::detection::MAX_DETECTIONS;
use spf_core::query::ImageBox;

use crate::error::NetworkError;

/// Minimum score.
pub const MIN_SCORE: f32 = 0.25;
/// Maximum intersection over union of two boxes of one class; beyond it only the one with the higher score is kept.
pub const MAX_OVERLAP: f64 = 0.45;
/// Maximum number of boxes per image.
pub const MAX_BOXES: usize = MAX_DETECTIONS;
/// Maximum number of boxes compared with each other, by score.
const MAX_CANDIDATES: usize = 2000;
/// Maximum number of values in an output.
const MAX_VALUES: usize = 1 << 26;
/// Number of mask rows.
const MASK_ROWS: usize = 32;
/// Number of values of a final box.
const FINAL: usize = 6;

/// A box before suppression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Left, top, right, bottom, pixels of the input.
    pub corners: [f32; 4],
    /// [`MIN_SCORE`]..=1.
    pub score: f32,
    /// Class index.
    pub class: usize,
}

/// The layout of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    form: Form,
    /// Number of rows per cell that are not classes.
    masks: usize,
    /// Width and height of the input if coordinates are fractions of it, else 1.
    scale: (usize, usize),
}

/// The unit of a box's coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    /// Pixels of the input.
    Pixels,
    /// Fractions of the input's width and height.
    Fractions,
}

/// What a network gives for one box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Row {
    /// Its place: centre, width and height, or corners.
    pub(crate) place: [f32; 4],
    /// Its greatest score, and its least one.
    pub(crate) score: f32,
    pub(crate) least: f32,
    /// The class of a final box.
    pub(crate) class: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// One row per value, one column per cell.
    Rows(usize),
    /// One row per cell.
    Cells(usize),
    /// One row per box.
    Final,
}

impl Layout {
    /// The layout of an output of this `shape` from an input of `input` pixels (width, height). `classes`: number of
    /// class names in the model; `masks`: whether it has masks; `end_to_end`: whether it declares its boxes final.
    ///
    /// # Errors
    /// [`NetworkError::Unfit`] for layouts that are not in the table above.
    pub fn of(
        shape: &[usize],
        input: (usize, usize),
        classes: Option<usize>,
        masks: bool,
        end_to_end: Option<bool>,
    ) -> Result<Self, NetworkError> {
        let masks = if masks { MASK_ROWS } else { 0 };
        let &[1, a, b] = shape else { return Err(unfit(shape, classes)) };
        let scale = (1, 1);
        let cells: usize = [8, 16, 32].map(|stride| (input.0 / stride) * (input.1 / stride)).iter().sum();
        let layout = |form| Ok(Self { form, masks, scale });
        let is_final = b == FINAL + masks;
        if end_to_end == Some(true) {
            return if is_final { layout(Form::Final) } else { Err(unfit(shape, classes)) };
        }
        let count = |rows: usize| rows.checked_sub(4 + masks).filter(|found| *found > 0);
        // Without names, one class more than COCO has is its objectness.
        let raw = |rows: usize| count(rows).filter(|found| classes.map_or(*found != 1 + CLASSES.len(), |n| n == *found));
        // The number of cells identifies the dimension; heads without the usual three strides have other numbers.
        match (raw(a), raw(b)) {
            (Some(found), _) if b == cells => layout(Form::Rows(found)),
            (_, Some(found)) if a == cells => layout(Form::Cells(found)),
            _ if is_final && end_to_end != Some(false) => layout(Form::Final),
            (Some(found), _) if classes.is_some() => layout(Form::Rows(found)),
            (None, Some(found)) if classes.is_some() => layout(Form::Cells(found)),
            _ => {
                let rows = if b == cells { count(a) } else { count(b).filter(|_| a == cells) };
                match (rows, classes) {
                    (Some(rows), Some(names)) => Err(misnamed(rows, names)),
                    _ => Err(unfit(shape, classes)),
                }
            }
        }
    }

    /// The layout with coordinates in this unit, of an input of `input` pixels.
    pub(crate) fn with_unit(self, unit: Unit, input: (usize, usize)) -> Self {
        Self { scale: if unit == Unit::Fractions { input } else { (1, 1) }, ..self }
    }

    /// Number of classes; `None` for final boxes.
    #[must_use]
    pub fn classes(&self) -> Option<usize> {
        match self.form {
            Form::Rows(classes) | Form::Cells(classes) => Some(classes),
            Form::Final => None,
        }
    }

    /// Whether boxes are already suppressed.
    #[must_use]
    pub fn is_final(&self) -> bool {
        self.form == Form::Final
    }

    /// The boxes of an output with a sufficient score. NaN counts as zero.
    ///
    /// # Errors
    /// [`NetworkError::Unfit`] if the output does not have this layout.
    pub fn decode(&self, shape: &[usize], values: &[f32]) -> Result<Vec<Candidate>, NetworkError> {
        let (values, boxes) = self.checked(shape, values)?;
        let width = values.len() / boxes.max(1);
        let mut found = match self.form {
            Form::Rows(classes) => best_rows(values, classes, boxes),
            Form::Cells(classes) => values.chunks_exact(width.max(1)).filter_map(|cell| best(&cell[..4 + classes])).collect(),
            Form::Final => values.chunks_exact(width.max(1)).filter_map(last).collect::<Vec<_>>(),
        };
        let (width, height) = (self.scale.0 as f32, self.scale.1 as f32);
        for candidate in &mut found {
            let [left, top, right, bottom] = candidate.corners;
            candidate.corners = [left * width, top * height, right * width, bottom * height];
        }
        Ok(found)
    }

    /// The values of an output and its number of boxes, if it has this layout.
    fn checked<'a>(&self, shape: &[usize], values: &'a [f32]) -> Result<(&'a [f32], usize), NetworkError> {
        let &[1, a, b] = shape else { return Err(unfit(shape, None)) };
        let (rows, boxes) = match self.form {
            Form::Rows(classes) => (a == 4 + classes + self.masks, b),
            Form::Cells(classes) => (b == 4 + classes + self.masks, a),
            Form::Final => (b == FINAL + self.masks, a),
        };
        if !rows || a.checked_mul(b).is_none_or(|all| all != values.len() || all > MAX_VALUES) {
            return Err(unfit(shape, self.classes()));
        }
        Ok((values, boxes))
    }

    /// Everything in an output, as it is.
    pub(crate) fn rows(&self, shape: &[usize], values: &[f32]) -> Result<Vec<Row>, NetworkError> {
        let (values, boxes) = self.checked(shape, values)?;
        let width = values.len() / boxes.max(1);
        let at = |number: usize, of: usize| match self.form {
            Form::Rows(_) => values[of * boxes + number],
            Form::Cells(_) | Form::Final => values[number * width + of],
        };
        let scores = match self.form {
            Form::Rows(classes) | Form::Cells(classes) => 4..4 + classes,
            Form::Final => 4..5,
        };
        let row = |number: usize| {
            let all = || scores.clone().map(|of| at(number, of));
            Row {
                place: core::array::from_fn(|of| at(number, of)),
                score: all().fold(f32::NEG_INFINITY, f32::max),
                least: all().fold(f32::INFINITY, f32::min),
                class: if self.is_final() { at(number, 5) } else { 0.0 },
            }
        };
        Ok((0..boxes).map(row).collect())
    }
}

/// Boxes from rows of values, processed row by row because of the cache.
fn best_rows(values: &[f32], classes: usize, cells: usize) -> Vec<Candidate> {
    let mut surest = vec![(0.0_f32, 0_usize); cells];
    for (class, row) in values.chunks_exact(cells.max(1)).skip(4).take(classes).enumerate() {
        for (best, score) in surest.iter_mut().zip(row) {
            // NaN never passes the comparison; of equal scores the first is kept.
            if *score > best.0 {
                *best = (*score, class);
            }
        }
    }
    let of_cell = |(cell, (score, class)): (usize, (f32, usize))| {
        candidate(core::array::from_fn(|row| values[row * cells + cell]), score, class)
    };
    surest.into_iter().enumerate().filter_map(of_cell).collect()
}

/// The box of a cell with its highest-scoring class.
fn best(cell: &[f32]) -> Option<Candidate> {
    let (measures, scores) = cell.split_at_checked(4)?;
    let mut surest = (0.0_f32, 0_usize);
    for (class, score) in scores.iter().enumerate() {
        if *score > surest.0 {
            surest = (*score, class);
        }
    }
    candidate(measures.try_into().ok()?, surest.0, surest.1)
}

/// A box from centre, width and height.
fn candidate([x, y, width, height]: [f32; 4], score: f32, class: usize) -> Option<Candidate> {
    sound([x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height], score, class)
}

/// A final box.
fn last(row: &[f32]) -> Option<Candidate> {
    let &[left, top, right, bottom, score, class, ..] = row else { return None };
    // `as` maps NaN to 0; the class is checked first.
    (0.0..1e6).contains(&class).then(|| sound([left, top, right, bottom], score, class.round() as usize))?
}

fn sound(corners: [f32; 4], score: f32, class: usize) -> Option<Candidate> {
    let [left, top, right, bottom] = corners;
    let real = corners.iter().all(|number| number.is_finite()) && left < right && top < bottom;
    (real && score >= MIN_SCORE).then_some(Candidate { corners, score: score.min(1.0), class })
}

/// The remaining boxes, highest score first: of overlapping ones of one class only the best, unless `is_final`.
#[must_use]
pub fn suppress(mut candidates: Vec<Candidate>, is_final: bool) -> Vec<Candidate> {
    // Stable, so that equal scores keep the network's order.
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
    candidates.truncate(MAX_CANDIDATES);
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        if kept.len() == MAX_BOXES {
            break;
        }
        let same = |other: &Candidate| other.class == candidate.class && area(other).iou(&area(&candidate)) > MAX_OVERLAP;
        if is_final || !kept.iter().any(same) {
            kept.push(candidate);
        }
    }
    kept
}

fn area(candidate: &Candidate) -> ImageBox {
    let [left, top, right, bottom] = candidate.corners.map(f64::from);
    ImageBox { left, top, right, bottom }
}

/// The error for an output with another number of classes than the metadata names.
fn misnamed(rows: usize, names: usize) -> NetworkError {
    let objectness = if rows == names + 1 { " (or an objectness score, as YOLOv5 and older have: not supported)" } else { "" };
    NetworkError::Unfit(format!("its output has scores of {rows} classes{objectness}, but its metadata has {names} class names"))
}

/// The error for an output of this shape.
fn unfit(shape: &[usize], classes: Option<usize>) -> NetworkError {
    let shown = shape.iter().map(usize::to_string).collect::<Vec<_>>().join("×");
    let names = classes.map_or(String::new(), |classes| format!(" with {classes} class names"));
    let old = classes.map_or(85, |classes| 5 + classes);
    let hint = if shape.last() == Some(&old) { "; heads with objectness (YOLOv5 and older) are not supported" } else { "" };
    let known = "1×(4+classes)×cells, 1×cells×(4+classes), or 1×boxes×6 with NMS exported";
    NetworkError::Unfit(format!("its output is {shown}{names}, expected {known}{hint}"))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const INPUT: (usize, usize) = (640, 640);

    fn layout(shape: &[usize], classes: Option<usize>, masks: bool, end: Option<bool>) -> Option<Layout> {
        Layout::of(shape, INPUT, classes, masks, end).ok()
    }

    #[test]
    fn every_export_is_known_by_its_shape() {
        let is = |form, masks| Some(Layout { form, masks, scale: (1, 1) });
        for classes in [Some(80), None] {
            assert_eq!(layout(&[1, 84, 8400], classes, false, None), is(Form::Rows(80), 0));
            assert_eq!(layout(&[1, 8400, 84], classes, false, None), is(Form::Cells(80), 0));
            assert_eq!(layout(&[1, 116, 8400], classes, true, None), is(Form::Rows(80), 32));
            assert_eq!(layout(&[1, 300, 6], classes, false, None), is(Form::Final, 0));
            assert_eq!(layout(&[1, 300, 38], classes, true, Some(true)), is(Form::Final, 32));
        }
        // Two classes: six rows, as many numbers as a final box has. The number of cells decides, or the model itself.
        assert_eq!(layout(&[1, 6, 8400], Some(2), false, None), is(Form::Rows(2), 0));
        assert_eq!(layout(&[1, 8400, 6], Some(2), false, None), is(Form::Cells(2), 0));
        assert_eq!(layout(&[1, 300, 6], Some(2), false, None), is(Form::Final, 0));
        assert_eq!(layout(&[1, 8500, 6], Some(2), false, Some(false)), is(Form::Cells(2), 0));
        // A head of four strides has more cells.
        assert_eq!(layout(&[1, 84, 34_000], Some(80), false, None), is(Form::Rows(80), 0));
    }

    #[test]
    fn what_is_no_detector_is_refused_in_words() {
        let words = |shape: &[usize], classes| match Layout::of(shape, INPUT, classes, false, None) {
            Err(error) => error.to_string(),
            Ok(layout) => panic!("{layout:?}"),
        };
        let old = words(&[1, 25_200, 85], Some(80));
        assert!(old.contains("1×25200×85 with 80 class names") && old.contains("objectness"), "{old}");
        // Without names too: as YOLOX exports COCO's classes.
        assert!(words(&[1, 8400, 85], None).contains("objectness"));
        assert!(words(&[1, 84, 8400], Some(3)).contains("scores of 80 classes, but its metadata has 3 class names"));
        assert!(words(&[1, 8400, 7], Some(2)).contains("3 classes (or an objectness score"));
        assert!(words(&[1, 1000], None).contains("1×1000, expected"));
        for none in [&[][..], &[2, 84, 8400], &[1, 84, 8400, 1], &[1, 4, 8400], &[1, 0, 0]] {
            words(none, None);
        }
    }

    /// Two cells: one with a confident car, one with nothing.
    const ROWS: [f32; 14] = [100.0, 50.0, 60.0, 50.0, 20.0, 4.0, 40.0, 4.0, 0.1, 0.2, 0.2, 0.1, 0.9, 0.0];
    const SHAPE: [usize; 3] = [1, 7, 2];

    #[test]
    fn numbers_become_boxes_in_every_form() {
        let car = Candidate { corners: [90.0, 40.0, 110.0, 80.0], score: 0.9, class: 2 };
        let decode =
            |form, shape: &[usize], values: &[f32]| Layout { form, masks: 0, scale: (1, 1) }.decode(shape, values).unwrap();
        assert_eq!(decode(Form::Rows(3), &SHAPE, &ROWS), [car]);
        let turned: Vec<f32> = (0..2).flat_map(|cell| (0..7).map(move |row| ROWS[2 * row + cell])).collect();
        assert_eq!(decode(Form::Cells(3), &[1, 2, 7], &turned), [car]);
        let last = [90.0, 40.0, 110.0, 80.0, 0.9, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(decode(Form::Final, &[1, 2, 6], &last), [car]);
        assert!(Layout { form: Form::Rows(3), masks: 0, scale: (1, 1) }.decode(&[1, 8, 2], &ROWS).is_err());
        assert!(Layout { form: Form::Rows(3), masks: 0, scale: (1, 1) }.decode(&SHAPE, &ROWS[..13]).is_err());
    }

    #[test]
    fn of_boxes_about_one_thing_the_surest_stays() {
        let at = |left: f32, score: f32, class: usize| Candidate { corners: [left, 0.0, left + 10.0, 10.0], score, class };
        // Three pixels off: 7 of 13 in common; five: 5 of 15.
        let all = vec![at(0.0, 0.6, 1), at(3.0, 0.8, 1), at(8.0, 0.7, 1), at(3.0, 0.5, 2)];
        assert_eq!(suppress(all.clone(), false), [at(3.0, 0.8, 1), at(8.0, 0.7, 1), at(3.0, 0.5, 2)]);
        assert_eq!(suppress(all, true).len(), 4);
        assert_eq!(suppress(vec![at(0.0, 0.5, 0); 5000], true).len(), MAX_BOXES);
    }

    proptest! {
        /// For any output of a network, boxes are finite, ordered, confident, and of an existing class.
        #[test]
        fn any_output_gives_sound_boxes(
            values in prop::collection::vec(prop_oneof![any::<f32>(), 0.0_f32..1.0, 0.0_f32..640.0], 60),
            form in prop_oneof![Just(Form::Rows(6)), Just(Form::Cells(6)), Just(Form::Final)],
        ) {
            let shape = match form {
                Form::Rows(_) => [1, 10, 6],
                Form::Cells(_) => [1, 6, 10],
                Form::Final => [1, 10, 6],
            };
            let layout = Layout { form, masks: 0, scale: (1, 1) };
            let kept = suppress(layout.decode(&shape, &values).unwrap(), layout.is_final());
            for pair in kept.windows(2) {
                prop_assert!(pair[0].score >= pair[1].score);
            }
            for Candidate { corners: [left, top, right, bottom], score, class } in kept {
                prop_assert!(left < right && top < bottom && left.is_finite() && bottom.is_finite());
                prop_assert!((MIN_SCORE..=1.0).contains(&score) && (layout.is_final() || class < 6));
            }
        }

        /// Row order and cell order are two layouts of one output.
        #[test]
        fn transposed_is_the_same(values in prop::collection::vec(0.0_f32..640.0, 7 * 9), scores in prop::collection::vec(0.0_f32..1.0, 3 * 9)) {
            let value = |row: usize, cell: usize| if row < 4 { values[row * 9 + cell] } else { scores[(row - 4) * 9 + cell] };
            let rows: Vec<f32> = (0..7).flat_map(|row| (0..9).map(move |cell| (row, cell))).map(|(row, cell)| value(row, cell)).collect();
            let cells: Vec<f32> = (0..9).flat_map(|cell| (0..7).map(move |row| (row, cell))).map(|(row, cell)| value(row, cell)).collect();
            let decode = |form, shape: &[usize], values: &[f32]| Layout { form, masks: 0, scale: (1, 1) }.decode(shape, values).unwrap();
            prop_assert_eq!(decode(Form::Rows(3), &[1, 7, 9], &rows), decode(Form::Cells(3), &[1, 9, 7], &cells));
        }

        #[test]
        fn any_shape_is_read_or_refused(shape in prop::collection::vec(0_usize..9000, 0..5), classes in prop::option::of(0_usize..100), masks: bool, end: Option<bool>) {
            if let Ok(layout) = Layout::of(&shape, INPUT, classes, masks, end) {
                prop_assert!(layout.decode(&shape, &[]).is_err() || shape.contains(&0));
            }
        }
    }
}
