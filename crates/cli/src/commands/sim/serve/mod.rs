//! `spf sim serve`: exposes the simulator over the interfaces of real systems.

mod airsim;
mod mavlink;
mod rtsp;
mod tello;
mod vlm;

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use spf_serve::truth::SharedInstruction;
use spf_serve::vlm::OnboardCamera;

use crate::args::Serve;
use crate::commands::fly::signals::interrupts;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Polling interval for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Runs the requested servers until Ctrl-C.
pub(super) fn serve(args: &Serve, printer: &Printer) -> Result<Exit, CliError> {
    if args.vlm.is_none() && !args.tello && args.mavlink.is_none() && !args.airsim {
        return Err(CliError::usage("nothing to serve").hint("use --tello, --mavlink or --airsim, and --vlm"));
    }
    if args.rtsp.is_some() && !args.tello && args.mavlink.is_none() {
        return Err(CliError::usage("--rtsp sends the view of a craft, and none is served").hint("add --tello or --mavlink"));
    }
    let interrupts = interrupts()?;
    let _airsim = args.airsim.then(|| airsim::start(args, printer)).transpose()?;
    let shared_instruction =
        SharedInstruction::new(Mutex::new(Some(args.instruction.clone()).filter(|text| text != vlm::FROM_PROMPT)));
    let onboard = args.vlm.as_ref().map(|_| Arc::new(OnboardCamera::default()));
    let service = args.tello.then(|| tello::start(args, onboard.clone(), shared_instruction.clone(), printer)).transpose()?;
    let vehicle = args.mavlink.as_deref();
    let vehicle = vehicle.map(|name| mavlink::start(args, name, shared_instruction.clone(), printer)).transpose()?;
    let flown = match (&service, &vehicle) {
        (Some(service), _) => Some((service.world().clone(), service.start_time())),
        (None, Some(vehicle)) => Some((vehicle.world().clone(), vehicle.start_time())),
        (None, None) => None,
    };
    let seen = flown.clone().zip(args.rtsp.as_deref());
    let _camera = seen.map(|(flown, listen)| rtsp::start(args, listen, flown, onboard.clone(), printer)).transpose()?;
    let flown = flown.zip(onboard).map(|((world, _), onboard)| vlm::Flown { world, onboard, shared_instruction });
    let _endpoint = args.vlm.as_deref().map(|oracle| vlm::start(args, oracle, flown, printer)).transpose()?;
    while interrupts.load(Ordering::Relaxed) == 0 {
        std::thread::sleep(LOOK);
    }
    if let Some(service) = &service {
        tello::print_video_stats(service, printer);
    }
    Ok(Exit::Success)
}
