//! The simulator's craft: seen by its own camera, or while another camera sees.

use std::sync::Arc;
use std::time::Instant;

use spf_camera::WithCamera;
use spf_core::craft::CraftKind;
use spf_drone::Drone;
use spf_flight::flight::Site;
use spf_flight::real::Real;
use spf_flight::sim::{LoadedScene, Simulated};
use spf_flight::site::Clock;
use spf_flight::world::Script;
use spf_scene::SceneLook;
use spf_sim::model::Model;

use super::aboard::Aboard;
use super::said::Said;
use super::settings::{flight_conditions, limits, options};
use crate::args::CameraArgs;
use crate::commands::vlm::Pace;
use crate::commands::{camera, load_scene};
use crate::error::CliError;
use crate::printer::Printer;
use crate::settings::Settings;
use spf_api::reading::Reader;

/// The scene, as the settings light it, and the craft in it.
fn scene(settings: &Settings) -> Result<(Arc<LoadedScene>, CraftKind), CliError> {
    let look = SceneLook { lighting: settings.fly.light.get()?, weather: settings.fly.weather.get()? };
    let loaded = load_scene(settings.fly.scene.text_or_default(), &look)?;
    let kind = settings.fly.drone_model.get()?.unwrap_or(loaded.scene.default_craft);
    Ok((Arc::new(loaded), kind))
}

/// The craft at its start.
fn site(settings: &Settings, loaded: Arc<LoadedScene>, kind: CraftKind, realtime: bool) -> Result<Simulated, CliError> {
    Ok(Simulated {
        start: settings.fly.start.get()?,
        kind,
        flight_conditions: flight_conditions(settings)?,
        seed: settings.fly.seed.or_default()?,
        realtime,
        ..Simulated::new(loaded, settings.fly.scene.text_or_default())
    })
}

/// The craft in a scene with ground truth; an instruction is read as it was `said`.
pub(super) fn board(
    settings: &Settings,
    said: &Said<'_>,
    pace: Pace,
    is_oracle: bool,
    script: &Script,
) -> Result<Aboard, CliError> {
    let (loaded, kind) = scene(settings)?;
    let limits = limits(settings, loaded.limits(kind))?;
    let realtime = pace == Pace::Wall;
    let site = site(settings, loaded.clone(), kind, realtime)?;
    let reader = if is_oracle { Reader::of_oracle(&loaded, site.start) } else { Reader::of_model() };
    let (mut announcements, chosen) = if is_oracle { said.read(&loaded, site.start)? } else { (Vec::new(), None) };
    for (at, text) in script.instructions() {
        announcements.extend(reader.scripted(at, text)?);
    }
    Ok(Aboard {
        craft: Model::of(kind).craft,
        limits,
        has_ranges: false,
        flies_moves: false,
        place: format!(" in {}, craft {}", loaded.scene.name, kind.name()),
        drawn: format!(", seed {}", site.seed),
        announcements,
        reader,
        chosen,
        height: Some(site.start.unwrap_or(site.loaded.scene.start).position.up),
        frames: None,
        site: Site::Simulated(site),
    })
}

/// The craft on the wall clock, as the camera is. Nothing is verified: where its target is, only the camera sees.
pub(super) fn at_the_desk(camera: &CameraArgs, settings: &Settings, url: &str, printer: &Printer) -> Result<Aboard, CliError> {
    let (loaded, kind) = scene(settings)?;
    let limits = limits(settings, loaded.limits(kind))?;
    let craft = site(settings, loaded.clone(), kind, true)?.craft();
    let craft = craft.map_err(|error| CliError::usage("cannot start here").because(&error))?;
    let start = Instant::now();
    let (camera, optics) = camera::open(url, camera, options(settings)?.tello, start, printer)?;
    let recorded = camera::recording(&camera, true)?;
    let drone = WithCamera::new(craft, camera, optics);
    let unseen = format!(
        "The camera does not move: the craft flies in {}, which is not seen. Nothing is verified, and no collision is counted.",
        loaded.scene.name
    );
    Ok(Aboard {
        craft: drone.capabilities().craft,
        limits,
        has_ranges: false,
        flies_moves: false,
        place: format!(", craft {} of the simulator", kind.name()),
        drawn: String::new(),
        announcements: [unseen].into_iter().chain(recorded.map(str::to_owned)).collect(),
        reader: Reader::of_model(),
        chosen: None,
        height: None,
        frames: Some(drone.frames()),
        site: Site::Real(Real { drone: Box::new(drone), clock: Clock::WallSince(start) }),
    })
}
