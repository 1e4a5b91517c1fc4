//! Placeholder for the network in builds without the feature `onnx`.

use core::convert::Infallible;

use crate::{Description, DetectError, Output};

/// No network.
pub(crate) struct Network(Infallible);

impl Network {
    pub(crate) fn load(_: Vec<u8>) -> Result<Self, DetectError> {
        Err(DetectError::NotBuilt)
    }

    pub(crate) fn description(&self) -> &Description {
        match self.0 {}
    }

    pub(crate) fn run(&self, _: &[f32]) -> Result<Output, DetectError> {
        match self.0 {}
    }
}
