//! `spf tello`: commands for a Tello.

mod rescue;

use std::time::Instant;

use spf_drone::driver::Connected;
use spf_drone::tello::TelloMotion;
use spf_drone::tello::driver::DRIVER;
use spf_drone::tello::sticks::Calibration;
use spf_flight::calibrate::{CalibrateError, calibrate};

use super::fly::real;
use super::fly::settings::options;
use super::fly::signals::flight_interrupts;
use crate::args::{Calibrate, Tello};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::{DroneName, Settings};

/// Runs the command.
pub(crate) fn tello(command: &Tello, printer: &Printer) -> Result<Exit, CliError> {
    match command {
        Tello::Calibrate(args) => measure(args, printer),
        Tello::Status(args) => rescue::status(args, printer),
        Tello::Land(args) => rescue::land(args, printer),
        Tello::Stop(args) => rescue::stop(args, printer),
    }
}

fn measure(args: &Calibrate, printer: &Printer) -> Result<Exit, CliError> {
    let settings = Settings::of(&args.settings, printer)?;
    let target = match settings.fly.drone.or_default()? {
        DroneName::Sim => (DRIVER.target)(""),
        DroneName::Real(driver, target) => Some(target).filter(|_| driver.scheme == DRIVER.scheme),
    };
    let target = target.ok_or_else(|| settings.fly.drone.wrong(DRIVER.form, None))?;
    let mut options = options(&settings)?;
    // Full stick as commanded by `rc`.
    options.tello.motion = TelloMotion::Rc;
    let interrupts = flight_interrupts(true)?;
    let start = Instant::now();
    let Connected { drone, warning, .. } = real::connect(target.as_ref(), &options, start, printer)?;
    printer.log("Measuring for about 45 s: leave 3 m of free space ahead and 2 m above.");
    printer.log(&warning);
    match calibrate(drone, options.tello.calibration, start, interrupts) {
        Ok(measured) => {
            printer.result(&table(&measured));
            Ok(Exit::Success)
        }
        Err(error @ CalibrateError::Ended(_)) => {
            printer.log(&format!("calibration incomplete: {error}"));
            Ok(Exit::Aborted)
        }
        Err(error) => Err(CliError::internal("cannot calibrate the drone").because(&error)),
    }
}

/// Lines for `spf.toml`.
fn table(measured: &Calibration) -> String {
    let Calibration { speed, climb, sink, yaw_rate } = measured;
    let yaw = yaw_rate.to_degrees();
    format!("[tello]\nspeed_m_s = {speed:.2}\nclimb_m_s = {climb:.2}\nsink_m_s = {sink:.2}\nyaw_deg_s = {yaw:.1}")
}
