//! The AirSim without Unreal.

use std::net::SocketAddr;
use std::sync::Arc;

use spf_serve::airsim::{AirSimError, AirSimPlan, AirSimServer, Settings};

use crate::args::Serve;
use crate::commands::load_scene;
use crate::commands::sim::conditions;
use crate::error::CliError;
use crate::printer::Printer;

/// Starts it; it serves until the result is dropped.
pub(super) fn start(args: &Serve, printer: &Printer) -> Result<AirSimServer, CliError> {
    let listen: SocketAddr = args.airsim_listen.parse().map_err(|_| {
        CliError::usage(format!("--airsim-listen: expected an address and a port, found `{}`", args.airsim_listen))
            .hint("--airsim-listen 127.0.0.1:41451")
    })?;
    let settings = args.airsim_settings.as_deref().map(|path| {
        Settings::load(path)
            .map_err(|error| CliError::usage(format!("--airsim-settings: cannot use `{}`", path.display())).because(&error))
    });
    let settings = settings.transpose()?.unwrap_or_default();
    let loaded = Arc::new(load_scene(args.scene.as_deref().unwrap_or("city"), &conditions(&args.conditions)?)?);
    let scene = loaded.scene.name.clone();
    let names: Vec<String> = settings.vehicles.iter().map(|vehicle| vehicle.name.clone()).collect();
    let plan = AirSimPlan { loaded, settings, listen, seed: args.seed, paused: args.airsim_paused };
    let server = AirSimServer::start(plan).map_err(|error| {
        let failure = CliError::usage("cannot serve an AirSim").because(&error);
        match error {
            AirSimError::Listen { .. } => {
                failure.hint("another AirSim may use that port; --airsim-listen 127.0.0.1:0 picks a free one")
            }
            _ => failure,
        }
    })?;
    let address = server.address();
    printer.result(&format!("airsim@{address}"));
    printer.log(&format!(
        "Serving an AirSim in {scene} on {address}, vehicles: {}. Clients: airsim.MultirotorClient(port={}). Stop with Ctrl-C.",
        names.join(", "),
        address.port(),
    ));
    if !address.ip().is_loopback() {
        printer.log("warning: anyone who can reach this address can fly it");
    }
    Ok(server)
}
