//! `spf fly --drone` with any drone but the embedded simulator.

use std::sync::Arc;
use std::time::Instant;

use spf_camera::WithCamera;
use spf_cockpit::Cockpit;
use spf_core::time::Duration;
use spf_drone::Drone;
use spf_drone::driver::{ConnectError, Connected, Target};
use spf_drone::mavlink::settings::GimbalUse;
use spf_drone::options::Options;
use spf_envelope::{BrakeLimits, Limits};
use spf_flight::flight::{FlightPlan, Site};
use spf_flight::real::Real;
use spf_flight::site::Clock;
use spf_motion::executor::Motion;
use spf_pilot::{AtEnd, PilotSettings, QueryTiming};
use spf_vlm::Vlm;
use spf_vlm::check::{USUAL_CAMERA, Verdict, check};

use super::manual::Manual;
use super::settings::{check_map, fence, limits, method, method_words, options, preset_and_policy, prompt, script};
use super::signals::flight_interrupts;
use super::{Ready, no_keys, page, sentence};
use crate::args::{CameraArgs, Fly};
use crate::commands::vlm::{self, Pace, Pointing, advice, is_human};
use crate::commands::{camera, depth_model, detector};
use crate::error::CliError;
use crate::printer::{Printer, one_line};
use crate::settings::Settings;

/// How long a program that answers must have run before take-off: one that lacks a part that it needs has ended by then.
const PROGRAM_RUNS: Duration = Duration::from_secs(2);
/// Why the oracle is refused before connecting.
pub(crate) const NO_ORACLE: &str = "the oracle reads the simulator's own images; a real drone needs a VLM";

/// The camera in the place of the drone's own, which it may lack.
pub(crate) fn eyes<'a>(args: &'a CameraArgs, settings: &Settings, target: &dyn Target) -> Result<Option<&'a str>, CliError> {
    let other = camera::instead_of(args, settings.fly.drone.text_or_default())?;
    if other.is_none() && !target.has_camera() {
        return Err(CliError::usage("this drone sends no video of its own: --camera is missing").hint(CAMERA_EXAMPLE));
    }
    Ok(other)
}

/// How a camera is given for a drone that has none of its own.
pub(crate) const CAMERA_EXAMPLE: &str =
    "for example --camera rtsp://192.168.1.64/stream1 --camera-fov 78 (docs/guide/cameras.md lists the addresses of cameras)";

/// Connects, and prepares the flight.
pub(super) fn ready(
    args: &Fly,
    settings: &Settings,
    instruction: &str,
    target: &dyn Target,
    cockpit: Option<&Cockpit>,
    printer: &Printer,
) -> Result<Ready, CliError> {
    let (preset, policy) = preset_and_policy(settings)?;
    let mut method = detector::with_detector(settings, policy, method(settings, preset, Pace::Wall)?)?;
    let prompt = prompt(settings, policy)?;
    let mut options = options(settings)?;
    let mut announcements = Vec::new();
    let other_camera = eyes(&args.flight.camera, settings, target)?;
    if let Some(url) = other_camera
        && !target.is_simulated()
    {
        camera::refuse_endless(url)?;
    }
    // A video that nobody looks at would take from the radio link what the commands need.
    options.tello.own_video = other_camera.is_none();
    let own = target.motion(&options) == Some(Motion::Manoeuvres);
    if own {
        // Whatever the settings: a later answer could not change the end of a move that the drone flies by itself.
        (method.motion, method.think) = (Motion::Manoeuvres, QueryTiming::Stop);
    }
    if settings.fly.depth_sensor.or_default()?.0.is_some() {
        return Err(CliError::usage("--depth-sensor is for the simulated craft").hint("no driver reads a depth sensor yet"));
    }
    let mut limits = limits(settings, target.limits())?;
    options.mavlink.fence = fence(settings, &limits)?;
    if options.mavlink.fence.is_some() && !target.takes_fence() {
        return Err(
            CliError::usage("this drone takes no fence").hint("--upload-fence is for PX4 and ArduPilot (--drone mavlink)")
        );
    }
    let script = args.flight.world.events.as_deref().map(script).transpose()?.unwrap_or_default();
    let max_cost_usd = settings.fly.max_cost_usd.get()?;
    let pointing = page::pointing(cockpit, settings, prompt.clone(), Pace::Wall)?;
    if pointing.is_oracle {
        return Err(
            CliError::usage(NO_ORACLE).hint("`spf vlm list` lists the models, and docs/guide/vlm.md describes how to choose one")
        );
    }
    let attended = !settings.fly.unattended.is_on()?;
    if attended && !Manual::is_possible() && cockpit.is_none() {
        return Err(no_keys());
    }
    if attended && settings.fly.at_end.get()?.is_none() {
        method.at_end = AtEnd::Hover;
    }
    check_program(&pointing, printer)?;
    let (pointing, detector) = detector::combine(settings, pointing)?;
    let interrupts = flight_interrupts(true)?;
    let start = Instant::now();
    let seen = other_camera.map(|url| camera::open(url, &args.flight.camera, options.tello, start, printer)).transpose()?;
    let camera_px = seen.as_ref().map_or(USUAL_CAMERA, |(_, optics)| (optics.width, optics.height));
    check_vlm(settings, &pointing, camera_px, printer)?;
    let recorded = seen.as_ref().map_or(Ok(None), |(camera, _)| camera::recording(camera, target.is_simulated()))?;
    let Connected { drone, warning, .. } = connect(target, &options, start, printer)?;
    let drone: Box<dyn Drone> = match seen {
        Some((camera, optics)) => Box::new(WithCamera::new(drone, camera, optics)),
        None => drone,
    };
    if own && !drone.capabilities().manoeuvres {
        return Err(CliError::usage("this Tello does not support --tello-motion go")
            .hint("its firmware has SDK 1.3, which cannot abort a move; update it in the Tello app, or use --tello-motion rc"));
    }
    if drone.capabilities().ranges {
        feel_around(settings, &mut method, &mut limits)?;
        announcements.push("Sensors around the drone measure ranges: they feed brake and map (--brake, --map).".to_owned());
    } else {
        check_map(settings, &method)?;
    }
    if drone.capabilities().gimbal.is_some() {
        announcements
            .push("The drone reports the tilt of its gimbal, which is used instead of --camera-tilt (--gimbal off).".to_owned());
    } else if settings.mavlink.gimbal.get()?.is_some_and(|pitch| pitch.0 != GimbalUse::Off) {
        return Err(
            CliError::usage("--gimbal: the drone reports no gimbal").hint("`spf doctor` shows the tilt of a gimbal that reports")
        );
    }
    if method.at_end == AtEnd::Return {
        let height = limits.check_return(&drone.capabilities().craft).map_err(|refusal| {
            CliError::usage(refusal.to_string())
                .hint("`spf doctor` shows what a drone does to return; --at-end land lands where it is")
        })?;
        announcements
            .push(format!("After the instruction the drone returns by itself, at up to {height:.0} m, and lands (--at-end)."));
    }
    let flying = format!("Flying \"{}\", {}.", one_line(instruction), method_words(settings, policy, &method),);
    let bounds = format!(
        "Limits: {} m above and {} m from the take-off point, {} m/s (--max-altitude, --max-distance, --max-speed).",
        limits.max_altitude,
        limits.max_distance,
        (limits.max_speed * 1e3).round() / 1e3
    );
    let (craft, camera) = (limits.capped(&drone.capabilities().craft), Some(drone.frames()));
    #[cfg(all(debug_assertions, unix))]
    let drone = super::drill::around(drone);
    let site = Site::Real(Real { drone, clock: Clock::WallSince(start) });
    announcements.splice(0..0, [flying, sentence(&pointing.sentence, &craft), bounds, warning]);
    announcements.extend(recorded.map(str::to_owned));
    if !attended {
        announcements
            .push("Unattended: no keyboard control. Only Ctrl-C, SIGTERM and the safety envelope land the drone.".to_owned());
    }
    if method.at_end == AtEnd::Hover {
        // Who answers by typing lines can type no instruction.
        let also = if is_human(&pointing.name) && cockpit.is_none() { "" } else { " and accepts a new instruction" };
        announcements.push(format!("After the instruction the drone hovers for up to 60 s{also} (--at-end)."));
    }
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
        ..FlightPlan::new(site, instruction, &pointing.name, pointing.vlm_factory)
    };
    Ok(Ready { plan, announcements, by_hand: Some(craft), reader: None, attended, camera })
}

/// Brake and map for a drone whose sensors measure ranges around it, unless the settings say otherwise.
fn feel_around(settings: &Settings, method: &mut PilotSettings, limits: &mut Limits) -> Result<(), CliError> {
    if limits.brake.is_none() && settings.fly.brake.or_default()?.or(true) {
        limits.brake = Some(BrakeLimits::without_sensor());
    }
    let can_guide = method.think == QueryTiming::Continuous && method.motion == Motion::Blended;
    method.guidance.map = settings.fly.map.or_default()?.or(can_guide);
    Ok(())
}

/// Connects, and describes the craft.
pub(crate) fn connect(target: &dyn Target, options: &Options, start: Instant, printer: &Printer) -> Result<Connected, CliError> {
    let connected = target.connect(options, start).map_err(|error| {
        let failure = CliError::failed(error.to_string());
        let ConnectError { source, hint, .. } = error;
        let failure = failure.because(&*source);
        match hint {
            Some(hint) => failure.hint(hint),
            None => failure,
        }
    })?;
    printer.log(&connected.summary);
    Ok(connected)
}

/// A program that lacks a part that it needs ends at once: that is no discovery for the air, also with --no-vlm-check.
fn check_program(pointing: &Pointing, printer: &Printer) -> Result<(), CliError> {
    let Some(program) = &pointing.program else { return Ok(()) };
    printer.log(&format!("Waiting until the program that answers has run for {} s …", PROGRAM_RUNS.as_secs()));
    match program.ends_within(PROGRAM_RUNS) {
        None => Ok(()),
        Some(error) => Err(CliError::failed("the program that answers does not run; take-off cancelled")
            .because(&error)
            .hint("start it by itself: it may lack a module or a file")),
    }
}

/// A VLM that points inaccurately is detected on the ground, in images of the size and shape of the flight's.
fn check_vlm(settings: &Settings, pointing: &Pointing, camera_px: (u32, u32), printer: &Printer) -> Result<(), CliError> {
    // A recording has no answer to images of a dot, and a person is not examined.
    let recorded = settings.fly.vlm.text().is_some_and(|name| name.starts_with("replay:") || is_human(name));
    if recorded || !settings.fly.vlm_check.is_on()? {
        return Ok(());
    }
    printer.log("Checking the VLM with three images of a dot …");
    let time = settings.reply_timeout()?;
    // The images of a dot are no part of a recorded flight.
    let mut unrecorded = settings.clone();
    unrecorded.vlm.record = Settings::default().vlm.record;
    let factory = match settings.vlm.record.text() {
        Some(_) => vlm::pointing(&unrecorded, None, Pace::Wall)?.vlm_factory,
        None => pointing.vlm_factory.clone(),
    };
    let mut vlm: Box<dyn Vlm> = factory(None, 0).map_err(|error| CliError::usage("cannot query the VLM").because(&*error))?;
    match check(vlm.as_mut(), time, camera_px).verdict {
        Verdict::Good(worst) => {
            printer.log(&format!("{} responds and points within {:.1} % of the image width.", pointing.name, 100.0 * worst));
            Ok(())
        }
        Verdict::Failed(error) if error.is_of_stand_in() => {
            Err(CliError::failed("the VLM cannot be checked; take-off cancelled").because(&error).hint(advice(&error)))
        }
        Verdict::Failed(error) => {
            Err(CliError::failed("the VLM does not respond; take-off cancelled").because(&error).hint(advice(&error)))
        }
        _ => Err(CliError::failed(format!("{} points inaccurately; take-off cancelled", pointing.name))
            .hint(format!("`spf vlm check {}` shows details; --no-vlm-check skips this check", pointing.name))),
    }
}
