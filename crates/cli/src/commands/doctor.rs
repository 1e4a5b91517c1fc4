//! `spf doctor`: checks before a flight.

use std::io::{ErrorKind, Write};
use std::path::Path;

use spf_flight::doctor::{self, Check, Finding};
use spf_media::Rgb;
use spf_scene::SceneLook;
use spf_vlm::setup::has_key;
use spf_vlm::table::VendorRow;

use super::fly::real::{CAMERA_EXAMPLE, NO_ORACLE};
use super::fly::settings::options;
use super::load_scene;
use super::vlm::{Pace, advice, is_human, pointing};
use super::{camera, depth_model, detector};
use crate::args::Doctor;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table};
use crate::settings::{DroneName, Settings, variables};

/// Runs all checks and prints their results with advice.
pub(crate) fn doctor(args: &Doctor, printer: &Printer) -> Result<Exit, CliError> {
    let mut settings = Settings::of(&args.settings, printer)?;
    let mut simulated = None;
    let mut checks = match settings.fly.drone.or_default()? {
        DroneName::Real(_, target) => {
            settings.fly.vlm.default_to(spf_vlm::setup::AUTO);
            let mut checks = Vec::new();
            for check in target.examine(&options(&settings)?) {
                checks.push(seen(check)?);
            }
            if args.camera.url.is_none() && !target.has_camera() {
                let found = "this drone sends no video of its own: a flight needs --camera";
                checks.push(Check::new("camera", Finding::Warning, found, Some(CAMERA_EXAMPLE)));
            }
            if is_oracle(settings.fly.vlm.text_or_default()) {
                checks.push(refused("VLM", &CliError::usage(NO_ORACLE).hint("choose one with --vlm; `spf vlm list` lists them")));
            }
            checks
        }
        DroneName::Sim => {
            simulated = Some(load_scene(settings.fly.scene.text_or_default(), &SceneLook::default())?);
            Vec::new()
        }
    };
    if let Some(url) = &args.camera.url {
        checks.extend(camera::check(url, &args.camera, options(&settings)?.tello)?);
    }
    checks.extend(vlm(&settings)?);
    if simulated.is_some() && settings.fly.vlm.text().is_none_or(|name| name == "oracle") {
        checks.push(stand_in(&settings).unwrap_or_else(|error| refused("VLM", &error)));
    }
    // It renders for seconds: what is wrong in the command is said before.
    if let Some(loaded) = simulated {
        checks.insert(0, doctor::simulator(&loaded));
    }
    if let Some(named) = detector::network(&settings)? {
        checks.push(watch(named)?);
    }
    if let Some(named) = settings.fly.depth_model.text().filter(|_| !depth_model::is_stand_in(&settings)) {
        checks.push(depth(&settings, named)?);
    }
    checks.extend(doctor::disk(Path::new(".")));
    if printer.is_json() {
        let text = serde_json::to_string(&checks)
            .map_err(|error| CliError::internal("cannot write the checks as JSON").because(&error))?;
        printer.data(&text);
    } else {
        printer.result(&table(&checks.iter().map(row).collect::<Vec<_>>()));
    }
    let bad = checks.iter().any(|check| check.finding == Finding::Bad);
    Ok(if bad { Exit::Failed } else { Exit::Success })
}

/// Who answers a simulated flight unless it names a VLM, and which vendors could.
fn stand_in(settings: &Settings) -> Result<Check, CliError> {
    let (models, variables) = (super::vlm::table(settings)?, variables()?);
    let is_usable = |vendor: &VendorRow| {
        let model = models.models().iter().filter(|row| row.vendor == vendor.name).find_map(|row| models.row_model(row));
        vendor.key_needed && model.is_some_and(|model| has_key(&model, &variables))
    };
    let vendors: Vec<&str> =
        models.vendors().iter().filter(|vendor| is_usable(vendor)).map(|vendor| vendor.name.as_str()).collect();
    let keys = if vendors.is_empty() {
        "no vendor's key is set (`spf vlm list` has the vendors)".to_owned()
    } else {
        format!("a key is set for {}: --vlm {}", vendors.join(", "), vendors[0])
    };
    Ok(Check::new("VLM", Finding::Good, format!("the oracle, in place of one; {keys}"), None))
}

fn is_oracle(vlm: &str) -> bool {
    vlm == "oracle" || vlm.starts_with("oracle:")
}

/// The VLM, if it can be tested.
fn vlm(settings: &Settings) -> Result<Option<Check>, CliError> {
    if settings.fly.vlm.text().is_none_or(|name| is_oracle(name) || is_human(name) || name.starts_with("replay:")) {
        return Ok(None);
    }
    let bad = |error: &CliError| Some(refused("VLM", error));
    let pointing = match pointing(settings, None, Pace::None) {
        Ok(pointing) => pointing,
        Err(error) => return Ok(bad(&error)),
    };
    let time = settings.reply_timeout()?;
    match (pointing.vlm_factory)(None, 0) {
        Ok(mut vlm) => Ok(Some(doctor::vlm(&pointing.name, vlm.as_mut(), time, advice))),
        Err(error) => Ok(bad(&CliError::usage("cannot query the VLM").because(&*error))),
    }
}

/// Checks a detector model: whether it can be used, its inference time, and what it sees in a picture of the simulator.
fn watch(named: &str) -> Result<Check, CliError> {
    let model = match detector::open(named) {
        Ok(model) => model,
        Err(error) => return Ok(refused("detector", &error)),
    };
    let loaded = load_scene("office", &SceneLook::default())?;
    let (check, picture) = doctor::detector(&model, &loaded);
    with_picture(check, picture, "its boxes in a test image", "detector.png")
}

/// Checks a depth network: whether it can be used, how fast it is, and what it sees in a picture of the simulator.
fn depth(settings: &Settings, named: &str) -> Result<Check, CliError> {
    let network = match depth_model::open(settings, named) {
        Ok(network) => network,
        Err(error) => return Ok(refused("depth network", &error)),
    };
    let loaded = load_scene("office", &SceneLook::default())?;
    let (check, picture) = doctor::depth_network(&network, &loaded);
    with_picture(check, picture, "its depth of a test image", "depth-model.png")
}

/// A drone's check; what its camera saw is written.
fn seen(check: Check) -> Result<Check, CliError> {
    let picture = check.picture.as_deref().cloned();
    with_picture(check, picture, "what it sees", "camera.png")
}

/// A check that shows a picture, which is written to a new file: never over a file of the user's.
fn with_picture(check: Check, picture: Option<Rgb>, what: &str, name: &str) -> Result<Check, CliError> {
    let Some(picture) = picture else { return Ok(check) };
    let png = spf_media::png::encode(&picture).map_err(|error| CliError::internal("cannot encode a picture").because(&error))?;
    let written = std::fs::File::create_new(name).and_then(|mut file| file.write_all(&png));
    let place = match written {
        Ok(()) => format!("{what}: {name}"),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => format!("{name} exists, and stays as it is"),
        Err(error) => format!("{name} cannot be written: {error}"),
    };
    Ok(Check { found: format!("{}; {place}", check.found), ..check })
}

/// The check result for something unusable.
fn refused(what: &'static str, error: &CliError) -> Check {
    let text = error.to_string();
    let (found, advice) = text.split_once("\n\nhint: ").map_or((text.as_str(), None), |(found, hint)| (found, Some(hint)));
    Check {
        what,
        finding: Finding::Bad,
        found: found.split_whitespace().collect::<Vec<_>>().join(" "),
        advice: advice.map(str::to_owned),
        picture: None,
    }
}

fn row(check: &Check) -> Vec<String> {
    let finding = match check.finding {
        Finding::Good => "ok",
        Finding::Warning => "warn",
        Finding::Bad => "FAIL",
    };
    let advice = check.advice.as_deref().map_or(String::new(), |advice| format!(" → {advice}"));
    vec![finding.to_owned(), check.what.to_owned(), format!("{}{advice}", check.found)]
}
