//! `spf tello status`, `land` and `stop`: a Tello that another program left in the air.

use spf_drone::driver;
use spf_drone::tello::ConnectError;
use spf_drone::tello::driver::{DRIVER, command_port, explained};
use spf_drone::tello::rescue::{COMMAND_WAIT, LANDING_TIME, Landed, PLACE_WAIT, Place, Rescue, STATE_WAIT};

use crate::args::TelloAddress;
use crate::commands::fly::settings::options;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

fn connect(args: &TelloAddress, printer: &Printer) -> Result<Rescue, CliError> {
    let settings = Settings::of(&args.settings, printer)?;
    // The simulator, the default for flights, has no state outside a flight.
    let name = settings.fly.drone.text().filter(|name| *name != "sim").unwrap_or(DRIVER.scheme);
    let drone = command_port(name).ok_or_else(|| settings.fly.drone.wrong(DRIVER.form, None))?;
    printer.log(&format!("waiting for up to {} s until the Tello at {} answers …", COMMAND_WAIT.as_secs(), drone.ip()));
    Rescue::connect(drone, &options(&settings)?.tello).map_err(|error| {
        let error = explained(drone.ip(), error);
        let failed = CliError::failed(error.to_string());
        let driver::ConnectError { source, hint, .. } = error;
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

/// Prints the state. Where its state does not tell where it is, this is a failure: nobody should go near it, or fly it, on a guess.
pub(super) fn status(args: &TelloAddress, printer: &Printer) -> Result<Exit, CliError> {
    let rescue = connect(args, printer)?;
    printer.log(&format!("waiting for up to {} s for its state …", STATE_WAIT.as_secs()));
    let state = rescue.state().map_err(|error| {
        let hint = match &error {
            ConnectError::InUse { .. } => "close the program that flies or watches it",
            ConnectError::NoState { .. } => "a firewall may block it",
            _ => "its firmware may write its state in another form",
        };
        unknown().because(&error).hint(format!("look where it is; {hint}. `spf tello land` works without its state"))
    })?;
    printer.log(&format!("waiting for up to {} s for its state to show whether its motors turn …", PLACE_WAIT.as_secs()));
    let place = rescue.place(&state);
    let unit = |value: Option<i32>, unit: &str| value.map_or("unknown".to_owned(), |value| format!("{value} {unit}"));
    printer.result(match place {
        Place::Airborne => "in the air",
        Place::MotorsOn => "close to the ground, with its motors on",
        Place::Grounded => "on the ground",
        Place::Unknown => "unknown whether on the ground or in the air",
    });
    printer.result(&rescue.firmware.to_string());
    printer.result(&format!("battery {}", unit(state.battery.map(i32::from), "%")));
    printer.result(&format!("height above take-off point {}", unit(state.height, "cm")));
    printer.result(&format!("distance to the surface below {}", unit(state.tof, "cm")));
    printer.result(&format!("temperature {}", unit(state.temperature.map(|[_, high]| high), "°C")));
    if place == Place::Unknown {
        let missing = state.missing();
        let why = if missing.is_empty() {
            "its state changed too little, or came too rarely, to show it".to_owned()
        } else {
            format!("its state does not tell, or not in a form that can be read: {}", missing.join(", "))
        };
        return Err(unknown().because(&std::io::Error::other(why)).hint("look where it is; `spf tello land` lands it"));
    }
    Ok(Exit::Success)
}

fn unknown() -> CliError {
    CliError::failed("it is unknown whether the Tello is on the ground or in the air")
}

/// Lands it, and waits for the landing.
pub(super) fn land(args: &TelloAddress, printer: &Printer) -> Result<Exit, CliError> {
    let rescue = connect(args, printer)?;
    printer.log(&format!("landing; waiting for up to {} s until its state shows the motors off …", LANDING_TIME.as_secs()));
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
