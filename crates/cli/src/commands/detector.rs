//! `--detector`: selects the object detector for obstacle mode.

use std::path::Path;

use spf_core::pilot::PilotSettings;
use spf_detect::{Bounds, Detector, NetworkError, Place};
use spf_flight::detector::{model_detects, with_detector};
use spf_flight::policy::PolicyKind;
use spf_flight::sim::{VlmFactory, oracle_factory};

use crate::commands::vlm::{Pointing, oracle_named};
use crate::error::CliError;
use crate::settings::Settings;

/// The default detector of a flight with a model, if the policy needs one.
const DEFAULT: &str = "oracle";

/// The policy and settings of a flight with the configured detector; unchanged if there is none.
pub(crate) fn policy_and_settings(
    settings: &Settings,
    policy: PolicyKind,
    method: PilotSettings,
) -> Result<(PolicyKind, PilotSettings), CliError> {
    let named = settings.fly.detector.text().is_some();
    if !named && !policy.has_detector() {
        return Ok((policy, method));
    }
    let Some(policy) = policy.with_detector() else {
        return Err(CliError::usage(format!("the policy {} does not support --detector", policy.name()))
            .hint("--detector requires --policy spf; typefly has its own detector"));
    };
    Ok((policy, PilotSettings { avoid: true, ..method }))
}

/// The VLM combined with the detector, and the detector's name; `None` if the policy does not use one.
pub(crate) fn combine(
    settings: &Settings,
    policy: PolicyKind,
    pointing: Pointing,
) -> Result<(Pointing, Option<String>), CliError> {
    if !policy.has_detector() {
        return Ok((pointing, None));
    }
    let name = match settings.fly.detector.text() {
        Some(name) => name,
        // If the oracle is also the VLM, its lists come from the same percept.
        None if pointing.name.split(':').next() == Some("oracle") => return Ok((pointing.clone(), Some(pointing.name))),
        None => DEFAULT,
    };
    let Detecting { name, vlm_factory, sentence } = detecting(settings, name)?;
    let (vlm_factory, sentence) = (with_detector(pointing.vlm_factory, vlm_factory), format!("{} {sentence}", pointing.sentence));
    Ok((Pointing { vlm_factory, sentence, ..pointing }, Some(name)))
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
