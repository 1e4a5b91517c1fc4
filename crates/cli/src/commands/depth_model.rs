//! `--depth-model`: the network that estimates the depth of frames.

use std::path::PathBuf;

use spf_core::time::duration_from_secs;
use spf_detect::mono_depth::DepthKind;
use spf_detect::published::Role;
use spf_detect::{Bounds, DepthNetwork, DepthOptions, KINDS, NetworkError, OutputKind, Place};
use spf_flight::depth_network::DepthPlan;

use crate::commands::model;
use crate::error::CliError;
use crate::settings::Settings;

/// Before the error of a stand-in for a network.
const STAND_IN: &str = "stand-in:";

/// Whether the configured network is a stand-in, which only the simulator has.
pub(crate) fn is_stand_in(settings: &Settings) -> bool {
    settings.fly.depth_model.text().is_some_and(|named| named.starts_with(STAND_IN))
}

/// The configured network, opened; `None` without one.
pub(crate) fn plan(settings: &Settings) -> Result<Option<(DepthPlan, String)>, CliError> {
    let Some(named) = settings.fly.depth_model.text() else { return Ok(None) };
    let period = duration_from_secs(1.0 / settings.fly.depth_model_hz.or_default()?);
    if let Some(given) = named.strip_prefix(STAND_IN) {
        let (error, kind) =
            given.strip_suffix(":relative").map_or((given, DepthKind::Metric), |error| (error, DepthKind::Relative));
        let error = error.parse().ok().filter(|error| (0.0..=1.0).contains(error)).ok_or_else(|| {
            CliError::usage(format!("--depth-model: expected a mean relative error from 0 to 1, found `{named}`"))
                .hint("stand-in:0.1, or stand-in:0.1:relative for one whose scale is unknown")
        })?;
        let sentence = format!("Depth: a stand-in for a depth network, with a mean relative error of {:.0} %.", 100.0 * error);
        return Ok(Some((DepthPlan::stand_in(error, kind, period), sentence)));
    }
    let network = open(settings, named)?;
    let (width, height) = network.input();
    let sentence = format!("Depth network: {} ({}), {width}×{height} pixels.", network.name(), network.kind());
    Ok(Some((DepthPlan::onnx(network, period), sentence)))
}

/// The file and what its output means: `FILE.onnx:KIND`.
fn parts(named: &str) -> Result<(PathBuf, OutputKind), CliError> {
    let published = model::published(named, |role| matches!(role, Role::Depth(_))).transpose()?;
    if let Some((Role::Depth(kind), file)) = published {
        return Ok((file, kind));
    }
    let hint = "the kind of output is not in the file, its documentation tells it (docs/guide/obstacles.md): disparity for Depth \
        Anything V2, relative for V3, metric for their metric models, canonical for V3's metric one";
    let end = named.to_ascii_lowercase().rfind(".onnx").map(|at| at + ".onnx".len());
    let Some((file, kind)) = end.map(|end| named.split_at(end)) else {
        return Err(CliError::usage(format!(
            "--depth-model: expected fastdepth, FILE.onnx:KIND, or stand-in:ERROR in the simulator, found `{named}`"
        ))
        .hint(hint));
    };
    let Some(kind) = kind.strip_prefix(':').filter(|kind| !kind.is_empty()) else {
        let missing = format!("--depth-model: `{file}` needs its kind: FILE.onnx:KIND, with {KINDS}");
        return Err(CliError::usage(missing).hint(hint));
    };
    let kind = kind
        .parse()
        .map_err(|_| CliError::usage(format!("--depth-model: unknown kind `{kind}`, expected {KINDS}")).hint(hint))?;
    Ok((PathBuf::from(file), kind))
}

/// Loads a network, in a process of its own.
pub(crate) fn open(settings: &Settings, named: &str) -> Result<DepthNetwork, CliError> {
    let (file, kind) = parts(named)?;
    let size = settings.fly.depth_model_size.get()?.map(|size| (size.0, size.1));
    let place = Place::this_program(Bounds::DEPTH)
        .map_err(|error| CliError::internal("cannot tell where this program is").because(&error))?;
    DepthNetwork::open(&file, DepthOptions { kind, size }, &place).map_err(|error| {
        let hint = match error {
            NetworkError::NotBuilt => model::WITH_ONNX,
            NetworkError::Read(_) => "give a readable ONNX file",
            _ => "docs/guide/obstacles.md, \"A depth network\", lists what is supported",
        };
        CliError::usage(format!("cannot load the depth network `{named}`")).because(&error).hint(hint)
    })
}
