//! Object detection with YOLO models in ONNX format, provided by the user (docs/guide/detector.md).
//!
//! A [`Detector`] returns the objects in an image. The network itself needs the feature `onnx`; the parts around it are
//! common to these models: the [`letterbox`], which converts an image to the network's input, and [`decode`], which
//! converts its output to boxes. No model is included.

#![cfg_attr(not(feature = "onnx"), allow(dead_code, reason = "pre- and postprocessing are only used with a network"))]

mod bounds;
pub mod decode;
pub mod letterbox;
mod names;
#[cfg(feature = "onnx")]
mod onnx;
#[cfg(not(feature = "onnx"))]
#[path = "absent.rs"]
mod onnx;
mod process;
mod wire;
pub mod worker;

use std::path::Path;
use std::sync::Arc;

use spf_core::detection::Detection;
use spf_media::Rgb;

use decode::Layout;
use letterbox::Letterbox;
use onnx::Network;
use process::Remote;

pub use bounds::Bounds;
pub use process::Place;

/// Maximum size of a model file, bytes.
pub const MAX_MODEL: u64 = 512 << 20;
/// Maximum side length of a network's input, pixels.
pub const MAX_SIDE: usize = 4096;

/// Why a model or an image cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// Built without the feature `onnx`.
    #[error("this program was built without ONNX support: build it with `--features onnx`")]
    NotBuilt,
    /// The file could not be read.
    #[error("cannot read the model")]
    Read(#[source] std::io::Error),
    /// The file is too large.
    #[error("the model has `{0}` bytes, more than the limit of {MAX_MODEL}")]
    TooLarge(u64),
    /// Not valid ONNX, or with unsupported operators.
    #[error("cannot load the model: {0}")]
    Load(String),
    /// Not a supported kind of detector.
    #[error("unsupported model: {0}")]
    Unfit(String),
    /// The network failed on an image.
    #[error("cannot run the neural network: {0}")]
    Run(String),
}

/// Relevant metadata of a model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Description {
    /// Width and height of the network's input, pixels.
    pub(crate) input: (usize, usize),
    /// Class names, by index; `None` if the model has none.
    pub(crate) names: Option<Vec<String>>,
    /// Whether its boxes are final: non-maximum suppression was exported with it.
    pub(crate) end_to_end: Option<bool>,
}

/// Output of a network.
#[derive(Debug)]
pub(crate) struct Output {
    /// Its dimensions.
    pub(crate) shape: Vec<usize>,
    /// Its values, last dimension fastest.
    pub(crate) values: Vec<f32>,
    /// Whether the network also has masks.
    pub(crate) masks: bool,
}

/// A loaded network, here or in another process.
enum Run {
    Here(Box<Network>),
    Elsewhere(Remote),
}

impl Run {
    fn load(model: Vec<u8>, place: &Place) -> Result<(Self, Description), DetectError> {
        match place {
            Place::Here => {
                let network = Network::load(model)?;
                let description = network.description().clone();
                Ok((Self::Here(Box::new(network)), description))
            }
            Place::Process { program, args, bounds } if cfg!(feature = "onnx") => {
                let (remote, description) = Remote::load(&model, program, args, *bounds)?;
                Ok((Self::Elsewhere(remote), description))
            }
            Place::Process { .. } => Err(DetectError::NotBuilt),
        }
    }

    fn run(&self, values: &[f32]) -> Result<Output, DetectError> {
        match self {
            Self::Here(network) => network.run(values),
            Self::Elsewhere(remote) => remote.run(values),
        }
    }
}

/// A loaded and tested model. Clones share the network.
#[derive(Clone)]
pub struct Detector {
    name: String,
    network: Arc<Run>,
    input: (usize, usize),
    layout: Layout,
    classes: Arc<[String]>,
}

impl Detector {
    /// Loads a model and runs it once on a grey image, so that problems show before a flight. Its metadata is used:
    /// input size, classes, output layout. In a process of its own ([`Place::Process`]) its memory and time are bounded.
    ///
    /// # Errors
    /// [`DetectError`], with a message for the user.
    pub fn open(path: &Path, place: &Place) -> Result<Self, DetectError> {
        let bytes = spf_input::read(path, MAX_MODEL).map_err(|error| match error.kind() {
            std::io::ErrorKind::FileTooLarge => {
                DetectError::TooLarge(std::fs::metadata(path).map_or(MAX_MODEL, |about| about.len()))
            }
            _ => DetectError::Read(error),
        })?;
        let (network, Description { input, names, end_to_end }) = Run::load(bytes, place)?;
        let grey = vec![letterbox::PADDING; 3 * input.0 * input.1];
        let output = network.run(&grey)?;
        let layout = Layout::of(&output.shape, input, names.as_ref().map(Vec::len), output.masks, end_to_end)?;
        let classes = names::complete(names, layout.classes());
        let name = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, network: Arc::new(network), input, layout, classes: classes.into() })
    }

    /// Name of the file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
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
    /// [`DetectError::Run`] if the network fails, [`DetectError::Unfit`] if its output layout has changed.
    pub fn detect(&self, image: &Rgb) -> Result<Vec<Detection>, DetectError> {
        let letterbox = Letterbox::new((image.width(), image.height()), self.input);
        let mut values = Vec::new();
        letterbox.fill(image, &mut values);
        let output = self.network.run(&values)?;
        let candidates = self.layout.decode(&output.shape, &output.values)?;
        let kept = decode::suppress(candidates, self.layout.is_final());
        let named = |candidate: decode::Candidate| Detection {
            name: self.classes.get(candidate.class).cloned().unwrap_or_else(|| format!("class {}", candidate.class)),
            score: f64::from(candidate.score),
            area: letterbox.in_image(candidate.corners),
        };
        Ok(kept.into_iter().map(named).collect())
    }
}
