//! Object detectors: YOLO models.

use std::path::Path;
use std::sync::Arc;

use spf_core::detection::Detection;
use spf_media::Rgb;

use crate::bounds::MAX_SIDE;
use crate::decode::{self, Layout};
use crate::error::NetworkError;
use crate::exchange::{Description, Input};
use crate::letterbox::{self, Letterbox};
use crate::model::Model;
use crate::names;
use crate::process::Place;
use crate::trial;

/// Default side of the input for models with a dynamic size.
const DEFAULT_SIDE: usize = 640;
/// Sides of an input are multiples of this, the largest stride.
const STRIDE: usize = 32;
/// Usual name of the output with boxes; without it the first output is used.
const BOXES: &str = "output0";

/// A loaded and tested model. Clones share the network.
#[derive(Clone)]
pub struct Detector {
    model: Arc<Model>,
    input: (usize, usize),
    output: usize,
    layout: Layout,
    classes: Arc<[String]>,
}

impl Detector {
    /// Loads a model and runs it on a grey image and on noise, so that problems show before a flight. Its metadata is used:
    /// input size, classes, output layout. In a process of its own ([`Place::Process`]) its memory and time are bounded.
    ///
    /// # Errors
    /// [`NetworkError`], with a message for the user.
    pub fn open(path: &Path, place: &Place) -> Result<Self, NetworkError> {
        let model = Model::open(path, place)?;
        let about = &model.description;
        check_task(about)?;
        let input = input_size(about)?;
        let output = about.outputs.iter().position(|output| output.name == BOXES).unwrap_or(0);
        if about.outputs.is_empty() {
            return Err(NetworkError::Unfit("it has no outputs".to_owned()));
        }
        let masks = about.outputs.iter().enumerate().any(|(index, other)| index != output && other.shape.len() == 4);
        let class_names = class_names(about)?;
        let pixels = 3 * input.0 * input.1;
        let grey = model.run(Input { size: input, values: &vec![letterbox::PADDING; pixels], output })?;
        let count = class_names.as_ref().map(Vec::len);
        let layout = Layout::of(&grey.shape, input, count, masks, end_to_end(about))?;
        let noise = model.run(Input { size: input, values: &trial::noise(pixels, 0.0, 1.0), output })?;
        let (grey, noise) = ((&grey.shape[..], &grey.values[..]), (&noise.shape[..], &noise.values[..]));
        let layout = layout.with_unit(trial::unit(&layout, count, input, grey, noise)?, input);
        let classes = names::complete(class_names, layout.classes());
        Ok(Self { model: Arc::new(model), input, output, layout, classes: classes.into() })
    }

    /// Name of the file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.model.name
    }

    /// Width and height of the network's input, pixels.
    #[must_use]
    pub fn input(&self) -> (usize, usize) {
        self.input
    }

    /// Its class names, by index; empty for end-to-end models without names.
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// The objects in an image of any size, highest score first, at most [`decode::MAX_BOXES`].
    ///
    /// # Errors
    /// [`NetworkError::Run`] if the network fails, [`NetworkError::Unfit`] if its output layout has changed.
    pub fn detect(&self, image: &Rgb) -> Result<Vec<Detection>, NetworkError> {
        let letterbox = Letterbox::new((image.width(), image.height()), self.input);
        let mut values = Vec::new();
        letterbox.fill(image, &mut values);
        let output = self.model.run(Input { size: self.input, values: &values, output: self.output })?;
        let candidates = self.layout.decode(&output.shape, &output.values)?;
        // The trial may have found nothing by which to tell.
        let is_corner = |candidate: &decode::Candidate| candidate.corners.iter().all(|at| *at <= trial::FRACTIONS);
        if !candidates.is_empty() && candidates.iter().all(is_corner) {
            let why =
                "all its boxes are in the first pixel: they seem to be fractions of the image; export it with boxes in pixels";
            return Err(NetworkError::Unfit(why.to_owned()));
        }
        let kept = decode::suppress(candidates, self.layout.is_final());
        let named = |candidate: decode::Candidate| Detection {
            name: self.classes.get(candidate.class).cloned().unwrap_or_else(|| format!("class {}", candidate.class)),
            score: f64::from(candidate.score),
            area: letterbox.in_image(candidate.corners),
        };
        Ok(kept.into_iter().map(named).collect())
    }
}

/// The class names of the metadata. Names that cannot be read would be taken for those of other classes.
fn class_names(about: &Description) -> Result<Option<Vec<String>>, NetworkError> {
    let Some(text) = about.metadata("names") else { return Ok(None) };
    let names = names::parse(text).ok_or_else(|| {
        let start: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(80).collect();
        let expected = "{0: 'person', 1: 'bicycle'}, from 0 without gaps, or ['person', 'bicycle']";
        NetworkError::Unfit(format!("the `names` of its metadata cannot be read: `{start}`; expected {expected}"))
    })?;
    Ok(Some(names))
}

/// Models for other tasks have other outputs, some with the same shape.
fn check_task(about: &Description) -> Result<(), NetworkError> {
    match about.metadata("task") {
        None | Some("detect" | "segment") => Ok(()),
        Some(other) => {
            let other: String = other.chars().map(|c| if c.is_control() { ' ' } else { c }).take(300).collect();
            Err(NetworkError::Unfit(format!("its task is `{other}`, expected `detect`")))
        }
    }
}

/// Width and height of the input: fixed, from metadata, or the default.
fn input_size(about: &Description) -> Result<(usize, usize), NetworkError> {
    let named = about.metadata("imgsz").and_then(sides).unwrap_or((DEFAULT_SIDE, DEFAULT_SIDE));
    let side = |fixed: Option<usize>, named: usize| fixed.unwrap_or_else(|| named.next_multiple_of(STRIDE));
    let (width, height) = (side(about.input.0, named.1), side(about.input.1, named.0));
    if [width, height].iter().all(|side| (STRIDE..=MAX_SIDE).contains(side)) {
        return Ok((width, height));
    }
    Err(NetworkError::Unfit(format!(
        "its input is 1×3×{height}×{width}, expected 1×3×height×width with sides from {STRIDE} to {MAX_SIDE}"
    )))
}

/// Height and width in metadata: `[480, 640]`.
fn sides(text: &str) -> Option<(usize, usize)> {
    let (height, width) = text.trim().strip_prefix('[')?.strip_suffix(']')?.split_once(',')?;
    let side = |text: &str| text.trim().parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
    Some((side(height)?, side(width)?))
}

/// Whether the model declares its boxes final; `None` if it does not state it.
fn end_to_end(about: &Description) -> Option<bool> {
    let says = |key: &str| about.metadata(key).is_some_and(|value| value.trim().eq_ignore_ascii_case("true"));
    let exported = about.metadata("args").is_some_and(|args| args.contains("'nms': True"));
    (says("end2end") || says("nms") || exported).then_some(true)
}
