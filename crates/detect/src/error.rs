//! Why a model or an image cannot be used.

use crate::bounds::MAX_MODEL;

/// Why a model or an image cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
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
    /// Not a supported kind of model.
    #[error("unsupported model: {0}")]
    Unfit(String),
    /// The network failed on an image.
    #[error("cannot run the neural network: {0}")]
    Run(String),
}
