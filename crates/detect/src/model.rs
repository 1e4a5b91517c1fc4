//! A user's model file, loaded where it shall run.

use std::path::Path;

use crate::bounds::MAX_MODEL;
use crate::error::NetworkError;
use crate::exchange::{Description, Input, Output};
use crate::network::Network;
use crate::process::{Place, Remote};

/// A loaded network, here or in another process.
pub(crate) struct Model {
    /// Name of the file.
    pub(crate) name: String,
    /// What it says of itself.
    pub(crate) description: Description,
    run: Run,
}

enum Run {
    Here(Box<Network>),
    Elsewhere(Remote),
}

impl Model {
    /// Loads the model of a file. In a process of its own ([`Place::Process`]) its memory and time are bounded.
    pub(crate) fn open(path: &Path, place: &Place) -> Result<Self, NetworkError> {
        let bytes = spf_input::read(path, MAX_MODEL).map_err(|error| match error.kind() {
            std::io::ErrorKind::FileTooLarge => {
                NetworkError::TooLarge(std::fs::metadata(path).map_or(MAX_MODEL, |about| about.len()))
            }
            _ => NetworkError::Read(error),
        })?;
        let name = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
        let (run, description) = match place {
            Place::Here => {
                let network = Network::load(bytes)?;
                let description = network.description().clone();
                (Run::Here(Box::new(network)), description)
            }
            Place::Process { program, args, bounds } if cfg!(feature = "onnx") => {
                let (remote, description) = Remote::load(&bytes, program, args, *bounds)?;
                (Run::Elsewhere(remote), description)
            }
            Place::Process { .. } => return Err(NetworkError::NotBuilt),
        };
        Ok(Self { name, description, run })
    }

    /// Runs it on an image.
    pub(crate) fn run(&self, input: Input<'_>) -> Result<Output, NetworkError> {
        match &self.run {
            Run::Here(network) => network.run(input),
            Run::Elsewhere(remote) => remote.run(input),
        }
    }
}
