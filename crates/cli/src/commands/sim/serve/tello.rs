//! The virtual Tello.

use std::fs::File;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::Arc;

use spf_core::geometry::Pose;
use spf_flight::sim::FlightConditions;
use spf_serve::fault::FaultPlan;
use spf_serve::tello::{FaultSource, Firmware, ServerError, TelloPlan, TelloService, VideoQuality};
use spf_serve::truth::{SharedInstruction, truth_file};
use spf_serve::vlm::OnboardCamera;
use spf_sim::wind::WindError;

use crate::args::Serve;
use crate::commands::sim::{conditions, parse_effects};
use crate::commands::{load_scene, parse_pose};
use crate::error::CliError;
use crate::printer::Printer;

/// A Tello's command port.
const PORT: u16 = 8889;
/// Starts it; it flies until the result is dropped. `onboard` receives its camera images, and `instruction` is the one
/// by which its flights are judged.
pub(super) fn start(
    args: &Serve,
    onboard: Option<Arc<OnboardCamera>>,
    instruction: SharedInstruction,
    printer: &Printer,
) -> Result<TelloService, CliError> {
    let plan = TelloPlan { onboard, instruction, ..plan(args)? };
    let (listen, scene) = (plan.listen, plan.loaded.scene.name.clone());
    let service = TelloService::start(plan).map_err(|error| refused(&error, listen))?;
    let address = service.address();
    printer.result(&format!("tello@{address}"));
    printer.log(&format!(
        "Serving a simulated Tello (SDK {}) in {scene}: send commands to UDP {address}; state and video go to the client that \
            sends `command`. Stop with Ctrl-C.",
        args.sdk,
    ));
    if !address.ip().is_loopback() {
        printer.log("warning: anyone who can reach this address can fly it");
    }
    Ok(service)
}

/// Statistics of the video sent.
pub(super) fn print_video_stats(service: &TelloService, printer: &Printer) {
    let tally = service.tally();
    if tally.frames > 0 {
        printer.log(&format!("video: {} frames, {:.1} per second, {} late", tally.frames, tally.rate(), tally.late));
    }
}

fn wrong(flag: &str, value: &str, expected: &str) -> CliError {
    CliError::usage(format!("{flag}: expected {expected}, found `{value}`"))
}

/// Where the served drone starts; `None` for the scene's start.
pub(super) fn start_pose(args: &Serve) -> Result<Option<Pose>, CliError> {
    args.start.as_deref().map(|text| parse_pose(text).map_err(|expected| wrong("--start", text, &expected))).transpose()
}

/// Charge, wind and camera effects of the served drone.
pub(super) fn flight_conditions(args: &Serve) -> Result<FlightConditions, CliError> {
    let mut flight_conditions = FlightConditions { battery: args.battery, ..FlightConditions::default() };
    if !(0.0..=1.0).contains(&args.battery) {
        return Err(wrong("--battery", &args.battery.to_string(), "a charge from 0 to 1"));
    }
    if let Some(wind) = &args.wind {
        flight_conditions.wind =
            wind.parse().map_err(|error: WindError| wrong("--wind", wind, "a wind such as 3,from=270,gust=1").because(&error))?;
    }
    if let Some(effects) = &args.camera_effects {
        flight_conditions.effects = parse_effects(effects)?;
    }
    Ok(flight_conditions)
}

/// The file for the judge's results, if one was named.
pub(super) fn truth(args: &Serve) -> Result<Option<File>, CliError> {
    let open = |path: &Path| {
        truth_file(path).map_err(|error| CliError::usage(format!("cannot write `{}`", path.display())).because(&error))
    };
    args.truth.as_deref().map(open).transpose()
}

fn plan(args: &Serve) -> Result<TelloPlan, CliError> {
    let listen = address(&args.listen).ok_or_else(|| {
        wrong("--listen", &args.listen, "an address")
            .hint("use an IPv4 address of this machine, such as 127.0.0.1 or 127.0.0.1:8889")
    })?;
    let firmware = Firmware::from_name(&args.sdk).ok_or_else(|| wrong("--sdk", &args.sdk, "1.3, 2.0 or 3.0"))?;
    let quality = VideoQuality::from_name(&args.quality).ok_or_else(|| {
        wrong("--quality", &args.quality, &format!("one of {}", VideoQuality::NAMES.join(", ")))
            .hint("auto adapts the quality to this machine")
    })?;
    Ok(TelloPlan {
        start: start_pose(args)?,
        flight_conditions: flight_conditions(args)?,
        seed: args.seed,
        listen,
        firmware,
        quality,
        faults: args.fault.clone().map_or_else(|| FaultSource::Plan(FaultPlan::default()), FaultSource::File),
        instruction: SharedInstruction::default(),
        onboard: None,
        truth: truth(args)?,
        loaded: Arc::new(load_scene(args.scene.as_deref().unwrap_or("office"), &conditions(&args.conditions)?)?),
    })
}

fn address(text: &str) -> Option<SocketAddr> {
    text.parse().ok().or_else(|| text.parse::<IpAddr>().ok().map(|ip| SocketAddr::new(ip, PORT)))
}

fn refused(error: &ServerError, listen: SocketAddr) -> CliError {
    let failure = CliError::usage("cannot serve the Tello").because(error);
    match error {
        ServerError::Bind { .. } => failure.hint(format!(
            "check that {} is an address of this machine and that port {} is free; on most machines --listen 127.0.0.2 works too",
            listen.ip(),
            listen.port()
        )),
        ServerError::Thread(_) => CliError::internal("cannot serve the Tello").because(error),
        _ => failure.hint("docs/guide/tello.md describes the format of fault files"),
    }
}
