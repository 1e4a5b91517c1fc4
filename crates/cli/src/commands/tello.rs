//! `spf tello`: a Tello itself.

use std::time::Instant;

use spf_drone::tello::TelloSettings;
use spf_drone::tello::sticks::Calibration;
use spf_flight::calibrate::{CalibrateError, calibrate};

use super::fly::settings::{tello as drone_of, tello_settings};
use super::fly::{interrupts, real};
use crate::args::{Calibrate, Tello};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// Does what is asked for.
pub(crate) fn tello(command: &Tello, printer: &Printer) -> Result<Exit, CliError> {
    match command {
        Tello::Calibrate(args) => measure(args, printer),
    }
}

fn measure(args: &Calibrate, printer: &Printer) -> Result<Exit, CliError> {
    let mut settings = Settings::load(args.config.as_deref())?;
    settings.flag("fly.drone", "--drone", args.drone.clone());
    let drone = drone_of(&settings)?.unwrap_or(TelloSettings::default().drone);
    let tello = tello_settings(&settings, drone)?;
    let interrupts = interrupts()?;
    let start = Instant::now();
    let connected = real::connect(&tello, start, printer)?;
    printer.say("Measuring for some 45 s: keep 3 m ahead and 2 m above free.");
    printer.say(real::WARNING);
    match calibrate(connected, tello.calibration, start, interrupts) {
        Ok(measured) => {
            printer.result(&table(&measured));
            Ok(Exit::Success)
        }
        Err(error @ CalibrateError::Ended(_)) => {
            printer.say(&format!("nothing is printed: {error}"));
            Ok(Exit::Aborted)
        }
        Err(error) => Err(CliError::internal("the drone cannot be measured").because(&error)),
    }
}

/// Lines for `spf.toml`.
fn table(measured: &Calibration) -> String {
    let Calibration { speed, climb, sink, yaw_rate } = measured;
    let yaw = yaw_rate.to_degrees();
    format!("[tello]\nspeed_m_s = {speed:.2}\nclimb_m_s = {climb:.2}\nsink_m_s = {sink:.2}\nyaw_deg_s = {yaw:.1}")
}
