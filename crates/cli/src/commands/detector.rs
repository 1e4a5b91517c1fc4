//! `--detector`: who lists what is in the picture, in obstacle mode.

use spf_core::pilot::PilotSettings;
use spf_flight::detector::with_detector;
use spf_flight::sim::{PolicyKind, oracle_points};

use crate::commands::vlm::{Pointing, oracle_named};
use crate::error::CliError;
use crate::settings::Settings;

/// The detector of a flight without `--detector` whose policy wants one, where a model points.
const DEFAULT: &str = "oracle";

/// The policy and settings of a flight with the detector that the settings name; with none they are as they were.
pub(crate) fn manner(
    settings: &Settings,
    policy: PolicyKind,
    method: PilotSettings,
) -> Result<(PolicyKind, PilotSettings), CliError> {
    let named = settings.get("fly.detector").is_some();
    if !named && policy != PolicyKind::SpfDetector {
        return Ok((policy, method));
    }
    if !matches!(policy, PolicyKind::Spf | PolicyKind::SpfDetector) {
        return Err(CliError::usage(format!("the policy {} has no obstacle mode with a detector", policy.name()))
            .hint("--detector goes with --policy spf; typefly has lists of its own"));
    }
    Ok((PolicyKind::SpfDetector, PilotSettings { avoid: true, ..method }))
}

/// Who points, with the detector beside them, and its name; none where the policy has no use for one.
pub(crate) fn beside(
    settings: &Settings,
    policy: PolicyKind,
    pointing: Pointing,
) -> Result<(Pointing, Option<String>), CliError> {
    if policy != PolicyKind::SpfDetector {
        return Ok((pointing, None));
    }
    let name = match settings.get("fly.detector") {
        Some(name) => name,
        // An oracle that points lists from the same look.
        None if pointing.name.split(':').next() == Some("oracle") => return Ok((pointing.clone(), Some(pointing.name))),
        None => DEFAULT,
    };
    let (name, errors) = oracle_named(name, |expected, near| settings.wrong_word("fly.detector", expected, near))?;
    let sentence =
        format!("{} {name} detects: it reads the simulator's id pictures and knows COCO's classes.", pointing.sentence);
    let who = with_detector(pointing.who, oracle_points(name.clone(), errors));
    Ok((Pointing { who, sentence, ..pointing }, Some(name)))
}
