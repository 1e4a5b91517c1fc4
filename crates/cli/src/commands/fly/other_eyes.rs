//! `spf fly --drone sim --camera`: the simulator moves, a camera sees. For trying a camera and a VLM at the desk.

use std::sync::Arc;
use std::time::Instant;

use spf_camera::WithCamera;
use spf_cockpit::Cockpit;
use spf_flight::flight::{FlightPlan, Site};
use spf_flight::real::Real;
use spf_flight::sim::Simulated;
use spf_flight::site::Clock;
use spf_pilot::AtEnd;
use spf_scene::SceneLook;

use super::settings::{check_map, flight_conditions, limits, method, method_words, options, preset_and_policy, prompt, script};
use super::signals::flight_interrupts;
use super::{Ready, page, sentence};
use crate::args::Fly;
use crate::commands::vlm::Pace;
use crate::commands::{camera, depth_model, detector, load_scene};
use crate::error::CliError;
use crate::printer::{Printer, one_line};
use crate::settings::Settings;

/// Prepares the flight. It runs on the wall clock, as the camera does, and nothing in it is verified: where its target is, only the
/// camera sees.
pub(super) fn ready(
    args: &Fly,
    settings: &Settings,
    instruction: &str,
    url: &str,
    cockpit: Option<&Cockpit>,
    printer: &Printer,
) -> Result<Ready, CliError> {
    let (preset, policy) = preset_and_policy(settings)?;
    let mut method = detector::with_detector(settings, policy, method(settings, preset, Pace::Wall)?)?;
    check_map(settings, &method)?;
    if cockpit.is_some() && settings.fly.at_end.get()?.is_none() {
        method.at_end = AtEnd::Hover;
    }
    if settings.fly.depth_sensor.or_default()?.0.is_some() {
        return Err(CliError::usage("--depth-sensor measures in the simulated scene, which the camera does not see")
            .hint("leave out --depth-sensor, or --camera"));
    }
    let prompt = prompt(settings, policy)?;
    let pointing = page::pointing(cockpit, settings, prompt.clone(), Pace::Wall)?;
    if pointing.is_oracle {
        return Err(CliError::usage("the oracle reads the simulator's own images; what a camera sees needs a VLM")
            .hint("choose one with --vlm; `spf vlm list` lists them"));
    }
    let (pointing, detector) = detector::combine(settings, pointing)?;
    let script = args.flight.world.events.as_deref().map(script).transpose()?.unwrap_or_default();
    let conditions = SceneLook { lighting: settings.fly.light.get()?, weather: settings.fly.weather.get()? };
    let scene = settings.fly.scene.text_or_default();
    let loaded = Arc::new(load_scene(scene, &conditions)?);
    let kind = settings.fly.drone_model.get()?.unwrap_or(loaded.scene.default_craft);
    let limits = limits(settings, loaded.limits(kind))?;
    let site = Simulated {
        start: settings.fly.start.get()?,
        kind,
        flight_conditions: flight_conditions(settings)?,
        seed: settings.fly.seed.or_default()?,
        realtime: true,
        ..Simulated::new(loaded.clone(), scene)
    };
    let craft = site.craft().map_err(|error| CliError::usage("cannot start here").because(&error))?;
    let max_cost_usd = settings.fly.max_cost_usd.get()?;
    let interrupts = flight_interrupts(false)?;
    let start = Instant::now();
    let (camera, optics) = camera::open(url, &args.flight.camera, options(settings)?.tello, start, printer)?;
    let recorded = camera::recording(&camera, true)?;
    let drone = WithCamera::new(craft, camera, optics);
    let (by_hand, frames) = (limits.capped(&spf_drone::Drone::capabilities(&drone).craft), spf_drone::Drone::frames(&drone));
    let flying = format!(
        "Flying \"{}\", craft {} of the simulator, {}.",
        one_line(instruction),
        kind.name(),
        method_words(settings, policy, &method),
    );
    let mut announcements = vec![
        flying,
        format!(
            "The camera does not move: the craft flies in {}, which is not seen. Nothing is verified, and no collision is counted.",
            loaded.scene.name
        ),
        sentence(&pointing.sentence, &by_hand),
    ];
    announcements.extend(recorded.map(str::to_owned));
    let depth_network = depth_model::plan(settings)?.map(|(plan, sentence)| {
        announcements.push(sentence);
        plan
    });
    let plan = FlightPlan {
        policy: Arc::new(policy),
        preset,
        settings: method,
        limits,
        detector,
        depth_network,
        prompt,
        max_cost_usd,
        script,
        interrupts,
        ..FlightPlan::new(
            Site::Real(Real { drone: Box::new(drone), clock: Clock::WallSince(start) }),
            instruction,
            &pointing.name,
            pointing.vlm_factory,
        )
    };
    Ok(Ready { plan, announcements, by_hand: Some(by_hand), reader: None, attended: false, camera: Some(frames) })
}
