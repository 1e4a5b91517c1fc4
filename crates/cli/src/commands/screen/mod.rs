//! `spf screen`: games and simulators that are flown through their window.

mod calibrate;
mod list;
mod preview;

use spf_screen::Display;
use spf_screen::profile::{Profile, ProfileError};

use crate::args::Screen;
use crate::commands::display::failed;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Runs one of the commands.
pub(crate) fn screen(command: &Screen, printer: &Printer) -> Result<Exit, CliError> {
    match command {
        Screen::List => list::list(printer),
        Screen::Calibrate(args) => calibrate::calibrate(args, printer),
        Screen::Preview(args) => preview::preview(args, printer),
    }
}

fn display() -> Result<Display, CliError> {
    Display::open(None).map_err(|error| failed(&error))
}

fn profile(name: &str) -> Result<Profile, CliError> {
    Profile::open(name).map_err(|error| {
        let failure = CliError::usage(format!("cannot use the profile `{name}`")).because(&error);
        match error {
            ProfileError::Unknown { .. } => failure.hint("`spf screen list` lists the shipped profiles"),
            _ => failure.hint("docs/guide/games.md explains each key of a profile"),
        }
    })
}
