//! `--detector`: selects the object detector for obstacle mode.

use std::path::PathBuf;

use spf_detect::published::{Published, Role};
use spf_detect::{Bounds, Detector, NetworkError, Place};
use spf_flight::detector::{DetectorPlan, model_detects};
use spf_flight::sim::{VlmFactory, oracle_factory};
use spf_oracle::DETECTOR_LATENCY;

use crate::commands::model;
use crate::commands::vlm::{Pointing, oracle_named};
use crate::error::CliError;
use crate::settings::Settings;

/// The configured detector of a flight with this VLM, and the VLM with a sentence about both; `None` if there is none.
pub(crate) fn combine(settings: &Settings, pointing: Pointing) -> Result<(Pointing, Option<DetectorPlan>), CliError> {
    let Some(name) = settings.fly.detector.text() else { return Ok((pointing, None)) };
    let Detecting { name, vlm_factory, sentence } = detecting(settings, name)?;
    let sentence = format!("{} {sentence}", pointing.sentence);
    Ok((Pointing { sentence, ..pointing }, Some(DetectorPlan { name, factory: Some(vlm_factory) })))
}

/// The configured detector of the bench's trials; `None` for the simulated one. Its latency is that of the simulated one, so that trials do
/// not depend on the machine.
pub(crate) fn in_the_bench(settings: &Settings) -> Result<Option<DetectorPlan>, CliError> {
    let Some(name) = settings.fly.detector.text() else { return Ok(None) };
    if !is_network(name) {
        return Err(settings.fly.detector.wrong("nanodet or FILE.onnx: the trial's own oracle is the simulated detector", None));
    }
    let detector = open(name)?;
    let name = detector.name().to_owned();
    Ok(Some(DetectorPlan { name, factory: Some(model_detects(detector, Some(DETECTOR_LATENCY))) }))
}

/// A detector.
struct Detecting {
    name: String,
    vlm_factory: VlmFactory,
    sentence: String,
}

/// Whether a name refers to a neural network: to a file, or to a published one.
fn is_network(name: &str) -> bool {
    name.to_ascii_lowercase().ends_with(".onnx") || Published::named(name).is_some()
}

fn detecting(settings: &Settings, name: &str) -> Result<Detecting, CliError> {
    if is_network(name) {
        let detector = open(name)?;
        let (width, height) = detector.input();
        let (name, classes) = (detector.name().to_owned(), detector.classes().len());
        let sentence = format!("Detector: {name}, {classes} classes, {width}×{height} pixels.");
        return Ok(Detecting { name, vlm_factory: model_detects(detector, None), sentence });
    }
    let expected = "nanodet, FILE.onnx, oracle, oracle:NAME or oracle:FILE";
    let (name, errors) = oracle_named(name, |_, near| settings.fly.detector.wrong(expected, near))?;
    let sentence = format!("Detector: {name}, which reads the simulator's ID images and simulates the COCO classes.");
    Ok(Detecting { vlm_factory: oracle_factory(name.clone(), errors), name, sentence })
}

/// Loads the model of a file, or a published one, in a process of its own.
pub(crate) fn open(name: &str) -> Result<Detector, CliError> {
    let published = model::published(name, |role| role == Role::Detector).transpose()?;
    let path = published.map_or_else(|| PathBuf::from(name), |(_, path)| path);
    let place = Place::this_program(Bounds::default())
        .map_err(|error| CliError::internal("cannot tell where this program is").because(&error))?;
    Detector::open(&path, &place).map_err(|error| {
        let hint = match error {
            NetworkError::NotBuilt => model::WITH_ONNX,
            NetworkError::Read(_) => "give a readable ONNX file",
            _ => "docs/guide/detector.md lists the supported models and how to export them",
        };
        CliError::usage(format!("cannot load the detector `{name}`")).because(&error).hint(hint)
    })
}

/// The configured detector, if it is a neural network.
///
/// # Errors
/// A usage error for a name that is no detector's.
pub(crate) fn network(settings: &Settings) -> Result<Option<&str>, CliError> {
    match settings.fly.detector.text() {
        Some(name) if is_network(name) => Ok(Some(name)),
        Some(name) => detecting(settings, name).map(|_| None),
        None => Ok(None),
    }
}
