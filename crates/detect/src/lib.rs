//! Object detectors: YOLO models in ONNX that the user gives (docs/guide/detector.md).
//!
//! A [`Detector`] takes an image and lists what it found in it. Around the network, which runs only with the feature `onnx`,
//! lie the parts that are the same for all of these models: the [`letterbox`], which makes the network's input of an image, and
//! [`decode`], which makes boxes of its output. No model comes with the program.

#![cfg_attr(not(feature = "onnx"), allow(dead_code, reason = "what lies around a network waits for one"))]

pub mod decode;
pub mod letterbox;
mod names;
#[cfg(feature = "onnx")]
mod onnx;
#[cfg(not(feature = "onnx"))]
#[path = "absent.rs"]
mod onnx;

use std::path::Path;
use std::sync::Arc;

use spf_core::detection::Detection;
use spf_media::Rgb;

use decode::Layout;
use letterbox::Letterbox;
use onnx::Network;

/// Largest model file that is read, bytes.
pub const MAX_MODEL: u64 = 1 << 30;
/// Longest side of a network's input, pixels.
pub const MAX_SIDE: usize = 4096;

/// Why a model cannot be used, or an image not be looked at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// The program was built without the feature.
    #[error("this program was built without ONNX models: build it with `--features onnx`")]
    NotBuilt,
    /// The file cannot be read.
    #[error("the model cannot be read")]
    Read(#[source] std::io::Error),
    /// The file is too large.
    #[error("the model has `{0}` bytes, more than {MAX_MODEL}")]
    TooLarge(u64),
    /// No ONNX, or with something that the runtime does not know.
    #[error("the model cannot be loaded: {0}")]
    Load(String),
    /// Not a detector of the kind that is read.
    #[error("the model is none that is read here: {0}")]
    Unfit(String),
    /// The network failed on an image.
    #[error("the network cannot be run: {0}")]
    Run(String),
}

/// What a model says of itself, as far as it is of use.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Description {
    /// Width and height of the network's input, pixels.
    pub(crate) input: (usize, usize),
    /// Names of the classes, by number; none where the model has none.
    pub(crate) names: Option<Vec<String>>,
    /// Whether its boxes are final: its own suppression was exported with it.
    pub(crate) end_to_end: Option<bool>,
}

/// What came out of a network.
pub(crate) struct Output {
    /// Sizes of its dimensions.
    pub(crate) shape: Vec<usize>,
    /// Its numbers, the last dimension fastest.
    pub(crate) values: Vec<f32>,
    /// Whether the network has masks as well.
    pub(crate) masks: bool,
}

/// A model, loaded and tried. Clones share the network.
#[derive(Clone)]
pub struct Detector {
    name: String,
    network: Arc<Network>,
    input: (usize, usize),
    layout: Layout,
    classes: Arc<[String]>,
}

impl Detector {
    /// Loads a model and runs it once on a grey image, so that what does not fit shows before a flight. Everything that it
    /// says of itself counts: the size of its input, its classes, the form of its output.
    ///
    /// # Errors
    /// [`DetectError`], in words for a person.
    pub fn open(path: &Path) -> Result<Self, DetectError> {
        let size = std::fs::metadata(path).map_err(DetectError::Read)?.len();
        if size > MAX_MODEL {
            return Err(DetectError::TooLarge(size));
        }
        let network = Network::load(std::fs::read(path).map_err(DetectError::Read)?)?;
        let Description { input, names, end_to_end } = network.description().clone();
        let grey = vec![letterbox::PADDING; 3 * input.0 * input.1];
        let output = network.run(&grey)?;
        let layout = Layout::of(&output.shape, input, names.as_ref().map(Vec::len), output.masks, end_to_end)?;
        let classes = names::complete(names, layout.classes());
        let name = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, network: Arc::new(network), input, layout, classes: classes.into() })
    }

    /// The file's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Width and height of the network's input, pixels.
    #[must_use]
    pub fn input(&self) -> (usize, usize) {
        self.input
    }

    /// The names of its classes, by number; as many as there are, but end-to-end models without names tell none.
    #[must_use]
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// What is in an image of any size: the surest first, at most [`decode::MAX_BOXES`].
    ///
    /// # Errors
    /// [`DetectError::Run`] when the network fails, [`DetectError::Unfit`] when its output has another form than at first.
    pub fn detect(&self, picture: &Rgb) -> Result<Vec<Detection>, DetectError> {
        let letterbox = Letterbox::new((picture.width(), picture.height()), self.input);
        let mut values = Vec::new();
        letterbox.fill(picture, &mut values);
        let output = self.network.run(&values)?;
        let candidates = self.layout.decode(&output.shape, &output.values)?;
        let kept = decode::suppress(candidates, self.layout.is_final());
        let named = |candidate: decode::Candidate| Detection {
            name: self.classes.get(candidate.class).cloned().unwrap_or_else(|| format!("class {}", candidate.class)),
            score: f64::from(candidate.score),
            area: letterbox.in_picture(candidate.corners),
        };
        Ok(kept.into_iter().map(named).collect())
    }
}
