//! `--detector`: selects the object detector for obstacle mode.

use std::path::Path;

use spf_detect::{Bounds, Detector, NetworkError, Place};
use spf_flight::detector::{DetectorPlan, model_detects};
use spf_flight::sim::{VlmFactory, oracle_factory};

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

/// A detector.
struct Detecting {
    name: String,
    vlm_factory: VlmFactory,
    sentence: String,
}

/// Whether a name refers to a model file.
fn is_file(name: &str) -> bool {
    name.to_ascii_lowercase().ends_with(".onnx")
}

fn detecting(settings: &Settings, name: &str) -> Result<Detecting, CliError> {
    if is_file(name) {
        let detector = open(name)?;
        let (width, height) = detector.input();
        let (name, classes) = (detector.name().to_owned(), detector.classes().len());
        let sentence = format!("Detector: {name}, {classes} classes, {width}×{height} pixels.");
        return Ok(Detecting { name, vlm_factory: model_detects(detector), sentence });
    }
    let expected = "FILE.onnx, oracle, oracle:NAME or oracle:FILE";
    let (name, errors) = oracle_named(name, |_, near| settings.fly.detector.wrong(expected, near))?;
    let sentence = format!("Detector: {name}, which reads the simulator's ID images and simulates the COCO classes.");
    Ok(Detecting { vlm_factory: oracle_factory(name.clone(), errors), name, sentence })
}

/// Loads the model of a file, in a process of its own.
pub(crate) fn open(path: &str) -> Result<Detector, CliError> {
    let place = Place::this_program(Bounds::default())
        .map_err(|error| CliError::internal("cannot tell where this program is").because(&error))?;
    Detector::open(Path::new(path), &place).map_err(|error| {
        let hint = match error {
            NetworkError::NotBuilt => "cargo install --path crates/cli --features onnx",
            NetworkError::Read(_) => "give a readable ONNX file",
            _ => "docs/guide/detector.md lists the supported models and how to export them",
        };
        CliError::usage(format!("cannot load the detector `{path}`")).because(&error).hint(hint)
    })
}

/// The configured detector, if it is a model file.
pub(crate) fn file(settings: &Settings) -> Option<&str> {
    settings.fly.detector.text().filter(|name| is_file(name))
}
