//! Placeholder for the network in builds without the feature `onnx`.

use core::convert::Infallible;

use crate::error::NetworkError;
use crate::exchange::{Description, Input, Output};

/// No network.
pub(crate) struct Network(Infallible);

impl Network {
    pub(crate) fn load(_: Vec<u8>) -> Result<Self, NetworkError> {
        Err(NetworkError::NotBuilt)
    }

    pub(crate) fn description(&self) -> &Description {
        match self.0 {}
    }

    pub(crate) fn run(&self, _: Input<'_>) -> Result<Output, NetworkError> {
        match self.0 {}
    }
}
