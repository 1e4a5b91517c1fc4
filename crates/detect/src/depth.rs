//! Networks that estimate the depth of a frame.

use std::path::Path;
use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::time::Time;
use spf_media::{Rgb, resize};

use crate::bounds::MAX_SIDE;
use crate::error::NetworkError;
use crate::exchange::{Description, Input};
use crate::model::Model;
use crate::mono_depth::MonoDepth;
use crate::output_kind::OutputKind;
use crate::process::Place;
use crate::trial;

/// Mean and standard deviation of red, green and blue in ImageNet, by which the inputs of these networks are normalised.
pub(crate) const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
pub(crate) const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];
/// Width and height of the input of a network that takes any: multiples of 14, the patches of a vision transformer.
const SIZE: (usize, usize) = (252, 196);
/// Smallest side of an input, pixels.
const MIN_SIDE: usize = 14;
/// Largest number of values of an output.
const MAX_VALUES: usize = 1 << 24;
/// Largest factor between the proportions of input and output.
const MAX_STRETCH: f64 = 1.25;
/// Parts of the names of outputs that are depths, in networks with several outputs.
const NAMES: [&str; 2] = ["depth", "disp"];

/// What the user states of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthOptions {
    /// What its output means.
    pub kind: OutputKind,
    /// Width and height of its input, pixels, if it takes any; `None` for 252×196.
    pub size: Option<(usize, usize)>,
}

/// A loaded and tested depth network. Clones share it.
#[derive(Clone)]
pub struct DepthNetwork {
    model: Arc<Model>,
    kind: OutputKind,
    input: (usize, usize),
    output: usize,
    /// Width and height of its output, pixels.
    output_size: (usize, usize),
}

impl DepthNetwork {
    /// Loads a model and runs it on a grey image and on noise, so that problems show before a flight. In a process of its own
    /// ([`Place::Process`]) its memory and time are bounded.
    ///
    /// # Errors
    /// [`NetworkError`], with a message for the user.
    pub fn open(path: &Path, options: DepthOptions, place: &Place) -> Result<Self, NetworkError> {
        let model = Model::open(path, place)?;
        let input = input_size(&model.description, options.size)?;
        let output = output(&model.description)?;
        let pixels = 3 * input.0 * input.1;
        let grey = model.run(Input { size: input, values: &vec![0.0; pixels], output })?;
        let output_size = output_size(&grey.shape, input)?;
        let noise = model.run(Input { size: input, values: &trial::noise(pixels, -2.0, 2.0), output })?;
        if trial::is_same(&grey.values, &noise.values) {
            return Err(trial::constant());
        }
        Ok(Self { model: Arc::new(model), kind: options.kind, input, output, output_size })
    }

    /// Name of the file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.model.name
    }

    /// What its output means.
    #[must_use]
    pub fn kind(&self) -> OutputKind {
        self.kind
    }

    /// Width and height of its input, pixels.
    #[must_use]
    pub fn input(&self) -> (usize, usize) {
        self.input
    }

    /// Width and height of its output, pixels.
    #[must_use]
    pub fn output(&self) -> (usize, usize) {
        self.output_size
    }

    /// The depth of a frame of any size that `camera` took.
    ///
    /// # Errors
    /// [`NetworkError::Run`] if the network fails or what it gives is no depth, [`NetworkError::Unfit`] if its output has another form
    /// than when it was loaded.
    pub fn estimate(&self, frame: (FrameId, Time), camera: &Camera, image: &Rgb) -> Result<MonoDepth, NetworkError> {
        let values = normalised(image, self.input);
        let output = self.model.run(Input { size: self.input, values: &values, output: self.output })?;
        let size = output_size(&output.shape, self.input)?;
        if size != self.output_size {
            let ((a, b), (c, d)) = (size, self.output_size);
            return Err(NetworkError::Unfit(format!("its output has {a}×{b} pixels, and had {c}×{d}")));
        }
        let mut depths = output.values;
        if let OutputKind::Canonical(focal) = self.kind {
            let seen = camera.resized(self.input.0 as u32, self.input.1 as u32);
            let factor = (0.5 * (seen.fx + seen.fy) / focal) as f32;
            depths.iter_mut().for_each(|depth| *depth *= factor);
        }
        MonoDepth::new(frame, camera, self.kind.depth_kind(), size, &depths).map_err(|error| NetworkError::Run(error.to_string()))
    }
}

/// Width and height of the input: fixed by the model, or as the user wants it.
fn input_size(about: &Description, wanted: Option<(usize, usize)>) -> Result<(usize, usize), NetworkError> {
    let (width, height) = wanted.unwrap_or(SIZE);
    let size = (about.input.0.unwrap_or(width), about.input.1.unwrap_or(height));
    if wanted.is_some_and(|wanted| wanted != size) {
        return Err(NetworkError::Unfit(format!(
            "its input is fixed at {}×{} pixels, and cannot be set to {width}×{height}",
            size.0, size.1
        )));
    }
    if [size.0, size.1].iter().all(|side| (MIN_SIDE..=MAX_SIDE).contains(side)) {
        return Ok(size);
    }
    Err(NetworkError::Unfit(format!("its input has {}×{} pixels, expected sides from {MIN_SIDE} to {MAX_SIDE}", size.0, size.1)))
}

/// The output with the depth: of several, the one whose name says so.
fn output(about: &Description) -> Result<usize, NetworkError> {
    let named = |name: &str| about.outputs.iter().position(|output| output.name.to_ascii_lowercase().contains(name));
    let output = NAMES.iter().find_map(|name| named(name)).or((about.outputs.len() == 1).then_some(0));
    output.ok_or_else(|| {
        let all: Vec<String> = about.outputs.iter().map(|output| format!("`{}` ({})", output.name, output.shown())).collect();
        NetworkError::Unfit(format!("of its outputs {}, none has a name with `depth` or `disp`", all.join(", ")))
    })
}

/// Width and height of an output: its two dimensions that are not 1, with those of 1 before or after them.
fn output_size(shape: &[usize], input: (usize, usize)) -> Result<(usize, usize), NetworkError> {
    let shown = shape.iter().map(usize::to_string).collect::<Vec<_>>().join("×");
    let refused =
        || NetworkError::Unfit(format!("its output is {shown}, expected 1×height×width, 1×1×height×width or height×width"));
    let after_one = shape.strip_suffix(&[1]).filter(|rest| rest.len() == 3).unwrap_or(shape);
    let [before @ .., height, width] = after_one else { return Err(refused()) };
    // An image of other proportions is a table.
    let stretched = (*width as f64 * input.1 as f64) / (*height as f64 * input.0 as f64);
    let is_image = (1.0 / MAX_STRETCH..=MAX_STRETCH).contains(&stretched)
        && before.iter().all(|side| *side == 1)
        && before.len() <= 3
        && *height > 1
        && *width > 1;
    match width.checked_mul(*height) {
        Some(values) if is_image && values <= MAX_VALUES => Ok((*width, *height)),
        _ => Err(refused()),
    }
}

/// The input for an image: resized, whatever its proportions, and normalised; planes of red, green and blue, in rows from the top.
fn normalised(image: &Rgb, size: (usize, usize)) -> Vec<f32> {
    // Sides are at most `MAX_SIDE`.
    let scaled = resize(image, size.0 as u32, size.1 as u32);
    let plane = |channel: usize| {
        let (mean, deviation) = (255.0 * MEAN[channel], 255.0 * DEVIATION[channel]);
        scaled.data().chunks_exact(3).map(move |pixel| (f32::from(pixel[channel]) - mean) / deviation)
    };
    (0..3).flat_map(plane).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::exchange::Outlet;

    #[test]
    fn an_image_is_normalised_as_in_training() {
        // Red 124 is ImageNet's mean to 0.3 of a level; white is 2.25, 2.43 and 2.64 deviations above.
        let values = normalised(&Rgb::filled(40, 30, [124, 255, 0]), (28, 14));
        let plane = 28 * 14;
        assert_eq!(values.len(), 3 * plane);
        let near = |value: f32, wanted: f32| (value - wanted).abs() < 0.01;
        assert!(near(values[0], 0.006) && near(values[plane], 2.429) && near(values[2 * plane], -1.804), "{:?}", &values[..3]);
    }

    #[test]
    fn sizes_are_the_models_or_else_the_users() {
        let of = |input, wanted| input_size(&Description { input, ..Description::default() }, wanted);
        assert_eq!(of((None, None), None).unwrap(), (252, 196));
        assert_eq!(of((None, None), Some((336, 252))).unwrap(), (336, 252));
        assert_eq!(of((Some(518), Some(518)), None).unwrap(), (518, 518));
        let fixed = of((Some(518), Some(518)), Some((252, 196))).unwrap_err();
        assert!(fixed.to_string().contains("fixed at 518×518"), "{fixed}");
        assert!(of((Some(8), None), None).is_err() && of((None, None), Some((5000, 14))).is_err());
    }

    #[test]
    fn of_several_outputs_the_one_named_depth_counts() {
        let about = |names: &[&str]| Description {
            outputs: names.iter().map(|name| Outlet { name: (*name).to_owned(), shape: vec![Some(1), None] }).collect(),
            ..Description::default()
        };
        assert_eq!(output(&about(&["anything"])).unwrap(), 0);
        assert_eq!(output(&about(&["conf", "predicted_depth"])).unwrap(), 1);
        assert_eq!(output(&about(&["disparity", "mask"])).unwrap(), 0);
        let unclear = output(&about(&["a", "b"])).unwrap_err();
        assert!(unclear.to_string().contains("`a` (1×?), `b` (1×?)"), "{unclear}");
        assert!(output(&about(&[])).is_err());
    }

    #[test]
    fn an_output_is_an_image_of_one_value_a_pixel() {
        for shape in [&[1, 20, 30][..], &[1, 1, 20, 30], &[20, 30], &[1, 20, 30, 1], &[1, 1, 1, 20, 30]] {
            assert_eq!(output_size(shape, (60, 40)).unwrap(), (30, 20), "{shape:?}");
        }
        for shape in [
            &[][..],
            &[30],
            &[1, 3, 20, 30],
            &[1, 6, 84],
            &[2, 20, 30],
            &[1, 30],
            &[1, 1 << 13, 1 << 13],
            &[usize::MAX, usize::MAX],
        ] {
            assert!(output_size(shape, (60, 40)).is_err(), "{shape:?}");
        }
    }

    proptest! {
        #[test]
        fn any_shape_is_an_image_or_refused(shape in prop::collection::vec(any::<usize>(), 0..7)) {
            if let Ok((width, height)) = output_size(&shape, (60, 40)) {
                prop_assert!(width * height <= MAX_VALUES);
            }
        }
    }
}
