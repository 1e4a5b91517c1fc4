//! The virtual PX4 or ArduPilot.

use std::sync::Arc;

use spf_mavlink::modes::Autopilot;
use spf_mavlink::url::MavlinkUrl;
use spf_serve::fault::FaultPlan;
use spf_serve::mavlink::{Equipment, VehiclePlan, VehicleServerError, VehicleService};
use spf_serve::tello::FaultSource;
use spf_serve::truth::SharedInstruction;

use super::tello::{flight_conditions, start_pose, truth};
use crate::args::Serve;
use crate::commands::load_scene;
use crate::commands::sim::conditions;
use crate::error::CliError;
use crate::printer::Printer;

/// Where the simulators of both autopilots are reached: PX4 sends to the ports of an offboard program and of a ground station,
/// ArduPilot listens on TCP, and its MAVProxy sends to the ground station.
const PX4_LINKS: &str = "udpout:127.0.0.1:14540,udpout:127.0.0.1:14550";
const ARDUPILOT_LINKS: &str = "tcpin:127.0.0.1:5760,udpout:127.0.0.1:14550";

/// Starts it; it flies until the result is dropped. `instruction` is the one by which its flights are judged.
pub(super) fn start(
    args: &Serve,
    name: &str,
    instruction: SharedInstruction,
    printer: &Printer,
) -> Result<VehicleService, CliError> {
    let autopilot = match name {
        "px4" => Autopilot::Px4,
        "ardupilot" => Autopilot::ArduPilot,
        _ => return Err(CliError::usage(format!("--mavlink: expected px4 or ardupilot, found `{name}`"))),
    };
    let usual = if autopilot == Autopilot::Px4 { PX4_LINKS } else { ARDUPILOT_LINKS };
    let text = args.mavlink_link.as_deref().unwrap_or(usual);
    let links: Vec<MavlinkUrl> = text
        .split(',')
        .map(|url| url.trim().parse())
        .collect::<Result<_, _>>()
        .map_err(|error| CliError::usage("--mavlink-link: not an address").because(&error))?;
    let parameters = args.mavlink_param.iter().map(|text| parameter(text)).collect::<Result<_, _>>()?;
    let loaded = load_scene(args.scene.as_deref().unwrap_or("city"), &conditions(&args.conditions)?)?;
    let plan = VehiclePlan {
        autopilot,
        links: links.clone(),
        parameters,
        start: start_pose(args)?,
        flight_conditions: flight_conditions(args)?,
        seed: args.seed,
        equipment: equipment(&args.mavlink_equipment)?,
        faults: args.fault.clone().map_or_else(|| FaultSource::Plan(FaultPlan::default()), FaultSource::File),
        instruction,
        truth: truth(args)?,
        loaded: Arc::new(loaded),
    };
    let scene = plan.loaded.scene.name.clone();
    let service = VehicleService::start(plan).map_err(|error| refused(&error))?;
    for (link, bound) in links.iter().zip(service.bound()) {
        printer.result(&format!("mavlink@{}", address_of_client(link, *bound)));
        if bound.is_some_and(|at| !at.ip().is_loopback()) && !matches!(link, MavlinkUrl::UdpOut(_)) {
            printer.log("warning: anyone who can reach this address can fly it");
        }
    }
    printer.log(&format!(
        "Serving a simulated {} in {scene} on {}. Stop with Ctrl-C.",
        autopilot.name(),
        links.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    ));
    Ok(service)
}

/// How `spf fly` reaches it.
fn address_of_client(link: &MavlinkUrl, bound: Option<std::net::SocketAddr>) -> String {
    match link {
        MavlinkUrl::UdpOut(at) => MavlinkUrl::UdpIn(at.clone()).to_string(),
        MavlinkUrl::UdpIn(at) => bound.map_or_else(|| format!("udpout:{at}"), |bound| format!("udpout:{bound}")),
        MavlinkUrl::TcpIn(at) | MavlinkUrl::TcpOut(at) => {
            bound.map_or_else(|| format!("tcpout:{at}"), |bound| format!("tcpout:{bound}"))
        }
        MavlinkUrl::Serial { .. } => link.to_string(),
    }
}

/// What it carries, from a list of names.
fn equipment(names: &[String]) -> Result<Equipment, CliError> {
    let mut equipment = Equipment::default();
    for name in names {
        match name.as_str() {
            "ranges" => equipment.ranges = true,
            "gimbal" => equipment.gimbal = true,
            _ => return Err(CliError::usage(format!("--mavlink-equipment: expected ranges or gimbal, found `{name}`"))),
        }
    }
    Ok(equipment)
}

fn parameter(text: &str) -> Result<(String, f64), CliError> {
    let parsed = text.split_once('=').and_then(|(name, value)| Some((name.to_owned(), value.parse().ok()?)));
    parsed.ok_or_else(|| CliError::usage(format!("--mavlink-param: expected NAME=NUMBER, found `{text}`")))
}

fn refused(error: &VehicleServerError) -> CliError {
    let failure = CliError::usage("cannot serve the vehicle").because(error);
    match error {
        VehicleServerError::Bind { .. } => {
            failure.hint("another simulator, or a ground station, may use that port; --mavlink-link gives others")
        }
        VehicleServerError::Thread(_) => CliError::internal("cannot serve the vehicle").because(error),
        _ => failure,
    }
}
