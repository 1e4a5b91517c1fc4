//! `--depth-model`: the network that estimates the depth of frames.

use std::path::Path;

use spf_core::time::{Duration, duration_from_secs};
use spf_detect::{Bounds, DepthNetwork, DepthOptions, KINDS, NetworkError, OutputKind, Place};
use spf_flight::depth_network::{DepthPlan, OnnxDepth};

use crate::error::CliError;
use crate::settings::Settings;

/// In virtual time, from a frame to its estimate: assumed, so that flights do not depend on the machine.
const LATENCY: Duration = Duration::from_millis(400);

/// The configured network, opened; `None` without one.
pub(crate) fn plan(settings: &Settings) -> Result<Option<(DepthPlan, String)>, CliError> {
    let Some(named) = settings.fly.depth_model.text() else { return Ok(None) };
    let network = open(settings, named)?;
    let period = duration_from_secs(1.0 / settings.fly.depth_model_hz.or_default()?);
    let (width, height) = network.input();
    let sentence = format!("Depth network: {} ({}), {width}×{height} pixels.", network.name(), network.kind());
    Ok(Some((DepthPlan { network: Box::new(OnnxDepth(network)), period, latency: LATENCY }, sentence)))
}

/// The file and what its output means: `FILE.onnx:KIND`.
fn parts(named: &str) -> Result<(&str, OutputKind), CliError> {
    let hint = "the kind of output is not in the file, its documentation tells it (docs/guide/obstacles.md): disparity for Depth \
        Anything V2, relative for V3, metric for their metric models, canonical for V3's metric one";
    let end = named.to_ascii_lowercase().rfind(".onnx").map(|at| at + ".onnx".len());
    let Some((file, kind)) = end.map(|end| named.split_at(end)) else {
        return Err(CliError::usage(format!("--depth-model: expected FILE.onnx:KIND, found `{named}`")).hint(hint));
    };
    let Some(kind) = kind.strip_prefix(':').filter(|kind| !kind.is_empty()) else {
        let missing = format!("--depth-model: `{file}` needs its kind: FILE.onnx:KIND, with {KINDS}");
        return Err(CliError::usage(missing).hint(hint));
    };
    let kind = kind
        .parse()
        .map_err(|_| CliError::usage(format!("--depth-model: unknown kind `{kind}`, expected {KINDS}")).hint(hint))?;
    Ok((file, kind))
}

/// Loads a network, in a process of its own.
pub(crate) fn open(settings: &Settings, named: &str) -> Result<DepthNetwork, CliError> {
    let (file, kind) = parts(named)?;
    let size = settings.fly.depth_model_size.get()?.map(|size| (size.0, size.1));
    let place = Place::this_program(Bounds::DEPTH)
        .map_err(|error| CliError::internal("cannot tell where this program is").because(&error))?;
    DepthNetwork::open(Path::new(file), DepthOptions { kind, size }, &place).map_err(|error| {
        let hint = match error {
            NetworkError::NotBuilt => "cargo install --path crates/cli --features onnx",
            NetworkError::Read(_) => "give a readable ONNX file",
            _ => "docs/guide/obstacles.md, \"A depth network\", lists what is supported",
        };
        CliError::usage(format!("cannot load the depth network `{file}`")).because(&error).hint(hint)
    })
}
