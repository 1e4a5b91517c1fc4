//! `spf tello status`, `land` and `stop`: a Tello that another program left in the air.

use spf_drone::driver::ConnectError;
use spf_drone::tello::driver::{DRIVER, command_port, explained};
use spf_drone::tello::rescue::{Landed, Rescue};

use crate::args::TelloAddress;
use crate::commands::fly::settings::options;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

fn connect(args: &TelloAddress, printer: &Printer) -> Result<Rescue, CliError> {
    let settings = Settings::of(args, printer)?;
    // The simulator, the default for flights, has no state outside a flight.
    let name = settings.fly.drone.text().filter(|name| *name != "sim").unwrap_or(DRIVER.scheme);
    let drone = command_port(name).ok_or_else(|| settings.fly.drone.wrong(DRIVER.form, None))?;
    Rescue::connect(drone, &options(&settings)?.tello).map_err(|error| {
        let error = explained(drone.ip(), error);
        let failed = CliError::failed(error.to_string());
        let ConnectError { source, hint, .. } = error;
        let failed = failed.because(&*source);
        match hint {
            Some(hint) => failed.hint(hint),
            None => failed,
        }
    })
}

fn unsent(error: &std::io::Error) -> CliError {
    CliError::failed("cannot send to the Tello").because(error)
}

/// Prints the state.
pub(super) fn status(args: &TelloAddress, printer: &Printer) -> Result<Exit, CliError> {
    let rescue = connect(args, printer)?;
    let Some((state, flying)) = rescue.state() else {
        return Err(CliError::failed("the Tello replies, but no state arrives")
            .hint("another program may hold the state port; a firewall may block it. `spf tello land` works without it"));
    };
    let unit = |value: Option<i32>, unit: &str| value.map_or("unknown".to_owned(), |value| format!("{value} {unit}"));
    printer.result(if flying { "in the air" } else { "on the ground" });
    printer.result(&rescue.firmware.to_string());
    printer.result(&format!("battery {}", unit(state.battery.map(i32::from), "%")));
    printer.result(&format!("height above take-off point {}", unit(state.height, "cm")));
    printer.result(&format!("distance to the surface below {}", unit(state.tof, "cm")));
    printer.result(&format!("temperature {}", unit(state.temperature.map(|[_, high]| high), "°C")));
    Ok(Exit::Success)
}

/// Lands it, and waits for the landing.
pub(super) fn land(args: &TelloAddress, printer: &Printer) -> Result<Exit, CliError> {
    let rescue = connect(args, printer)?;
    printer.log("landing …");
    match rescue.land().map_err(|error| unsent(&error))? {
        Landed::Seen => {
            printer.result("on the ground, motors off");
            Ok(Exit::Success)
        }
        Landed::Airborne => Err(CliError::failed("the Tello still seems to be in the air")
            .hint("catch it from below and turn it over: its motors then stop")),
        Landed::Unseen => Err(CliError::failed("`land` was sent for 10 s, but no state arrives, so its effect is unknown")
            .hint("check the drone visually")),
    }
}

/// Commands zero velocity.
pub(super) fn stop(args: &TelloAddress, printer: &Printer) -> Result<Exit, CliError> {
    connect(args, printer)?.hold().map_err(|error| unsent(&error))?;
    printer.result("zero velocity: it hovers, and lands by itself after 15 s; `spf tello land` lands it now");
    Ok(Exit::Success)
}
