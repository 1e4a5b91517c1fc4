//! `spf fly --drone` with any drone but the embedded simulator.

use std::time::Instant;

use spf_api::reading::Reader;
use spf_camera::WithCamera;
use spf_core::craft::Craft;
use spf_core::time::Duration;
use spf_drone::Drone;
use spf_drone::driver::{ConnectError, Connected, Target};
use spf_drone::mavlink::settings::GimbalUse;
use spf_drone::options::Options;
use spf_envelope::Limits;
use spf_flight::flight::Site;
use spf_flight::real::Real;
use spf_flight::site::Clock;
use spf_motion::executor::Motion;
use spf_vlm::Vlm;
use spf_vlm::check::{USUAL_CAMERA, Verdict, check};

use super::aboard::Aboard;
use super::settings::{fence, limits, options};
use crate::args::CameraArgs;
use crate::commands::camera;
use crate::commands::vlm::{self, Pace, Pointing, advice, is_human};
use crate::error::CliError;
use crate::printer::Printer;
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

/// Connects, and prepares the craft.
pub(super) fn board(
    camera: &CameraArgs,
    settings: &Settings,
    target: &dyn Target,
    other_camera: Option<&str>,
    pointing: &Pointing,
    printer: &Printer,
) -> Result<Aboard, CliError> {
    let mut options = options(settings)?;
    // A video that nobody looks at would take from the radio link what the commands need.
    options.tello.own_video = other_camera.is_none();
    let flies_moves = target.motion(&options) == Some(Motion::Manoeuvres);
    let limits = limits(settings, target.limits())?;
    options.mavlink.fence = fence(settings, &limits)?;
    if options.mavlink.fence.is_some() && !target.takes_fence() {
        return Err(
            CliError::usage("this drone takes no fence").hint("mavlink.upload_fence is for PX4 and ArduPilot (--drone mavlink)")
        );
    }
    check_program(pointing, printer)?;
    let start = Instant::now();
    let seen = other_camera.map(|url| camera::open(url, camera, options.tello, start, printer)).transpose()?;
    let camera_px = seen.as_ref().map_or(USUAL_CAMERA, |(_, optics)| (optics.width, optics.height));
    check_vlm(settings, pointing, camera_px, printer)?;
    let recorded = seen.as_ref().map_or(Ok(None), |(camera, _)| camera::recording(camera, target.is_simulated()))?;
    let Connected { drone, warning, .. } = connect(target, &options, start, printer)?;
    let drone: Box<dyn Drone> = match seen {
        Some((camera, optics)) => Box::new(WithCamera::new(drone, camera, optics)),
        None => drone,
    };
    let capabilities = drone.capabilities();
    if flies_moves && !capabilities.manoeuvres {
        return Err(CliError::usage("this Tello does not support --tello-motion go")
            .hint("its firmware has SDK 1.3, which cannot abort a move; update it in the Tello app, or use --tello-motion rc"));
    }
    let bounds = format!(
        "Limits: {} m above and {} m from the take-off point, {} m/s (--max-altitude, --max-distance, --max-speed).",
        limits.max_altitude,
        limits.max_distance,
        (limits.max_speed * 1e3).round() / 1e3
    );
    let mut announcements = vec![bounds, warning];
    if capabilities.ranges {
        announcements
            .push("Sensors around the drone measure ranges: they feed brake and map (docs/guide/obstacles.md).".to_owned());
    }
    if capabilities.gimbal.is_some() {
        announcements.push(
            "The drone reports the tilt of its gimbal, which is used instead of --camera-tilt (mavlink.gimbal = \"off\")."
                .to_owned(),
        );
    } else if settings.mavlink.gimbal.get()?.is_some_and(|pitch| pitch.0 != GimbalUse::Off) {
        return Err(CliError::usage("mavlink.gimbal: the drone reports no gimbal")
            .hint("`spf doctor` shows the tilt of a gimbal that reports"));
    }
    announcements.extend(recorded.map(str::to_owned));
    let (craft, has_ranges, frames) = (capabilities.craft, capabilities.ranges, Some(drone.frames()));
    #[cfg(all(debug_assertions, unix))]
    let drone = super::drill::around(drone);
    let clock = if target.runs_in_lockstep(&options) { Clock::Virtual } else { Clock::WallSince(start) };
    let site = Site::Real(Real { drone, clock });
    let (place, drawn) = (String::new(), String::new());
    Ok(Aboard {
        site,
        craft,
        limits,
        has_ranges,
        flies_moves,
        place,
        drawn,
        announcements,
        reader: Reader::of_model(),
        chosen: None,
        height: None,
        frames,
    })
}

/// How a drone returns by itself after its instruction, if the envelope clears it.
pub(super) fn returning(limits: &Limits, craft: &Craft) -> Result<String, CliError> {
    let height = limits.check_return(craft).map_err(|refusal| {
        CliError::usage(refusal.to_string())
            .hint("`spf doctor` shows what a drone does to return; --at-end land lands where it is")
    })?;
    Ok(format!("After the instruction the drone returns by itself, at up to {height:.0} m, and lands (--at-end)."))
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
