//! `spf cockpit`: flights that are instructed from the page, and recorded ones to look at.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use super::fly::real::eyes;
use super::fly::signals::interrupts;
use super::fly::{flight, instruction_reader, page};
use crate::args::Cockpit;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::{COCKPIT, DroneName, Settings};

/// How often a wait looks at Ctrl-C.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Serves the page until Ctrl-C.
pub(crate) fn cockpit(args: &Cockpit, printer: &Printer) -> Result<Exit, CliError> {
    let interrupts = interrupts()?;
    let mut settings = with_cockpit(args, printer)?;
    let address = settings.fly.cockpit.or_default()?;
    if let Some(folder) = &args.view {
        return view(address, folder, &interrupts, printer);
    }
    if let DroneName::Real(_, target) = settings.fly.drone.or_default()? {
        eyes(&args.flight.camera, &settings, target.as_ref())?;
    }
    let cockpit = page::open(address, Path::new(page::FLIGHTS), "", printer)?;
    let mut exit = Exit::Success;
    loop {
        let (read, about) = instruction_reader(&settings)?;
        printer.log("Waiting for an instruction from the page. Ctrl-C ends.");
        let stopped = || interrupts.load(Ordering::Relaxed) > 0;
        let Some(instruction) = cockpit.wait_for_instruction(&about, read, stopped) else { return Ok(exit) };
        let flown = flight(&args.flight(instruction), settings, Some(&cockpit), Printer::new(args.flight.json));
        match flown {
            Ok(code) => exit = code,
            Err(error) => {
                let told = format!("error: {error}");
                printer.log(&told);
                cockpit.refuse(&told);
            }
        }
        settings = with_cockpit(args, printer)?;
    }
}

/// The settings, with an address for the page.
fn with_cockpit(args: &Cockpit, printer: &Printer) -> Result<Settings, CliError> {
    let mut settings = Settings::of(&args.flight.settings, printer)?;
    settings.fly.cockpit.default_to(COCKPIT);
    Ok(settings)
}

/// Serves recorded flights alone.
fn view(address: std::net::SocketAddr, folder: &Path, interrupts: &AtomicU32, printer: &Printer) -> Result<Exit, CliError> {
    if !folder.is_dir() {
        return Err(CliError::usage(format!("--view: no folder `{}`", folder.display()))
            .hint("`spf fly` records flights in the folder `flights`"));
    }
    if !address.ip().is_loopback() {
        return Err(CliError::usage("--view is for this machine only: recorded flights contain prompts")
            .hint("use an address of the form 127.0.0.1:PORT"));
    }
    let _cockpit = page::open(address, folder, "flights", printer)?;
    printer.log("Ctrl-C ends.");
    while interrupts.load(Ordering::Relaxed) == 0 {
        std::thread::sleep(LOOK_UP);
    }
    Ok(Exit::Success)
}
