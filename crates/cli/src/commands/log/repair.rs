//! `spf log repair`: repairs a truncated log.

use spf_record::log::{ReadError, RepairError};

use super::unreadable;
use crate::args::Repair;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Repairs a log in place.
pub(super) fn repair(args: &Repair, printer: &Printer) -> Result<Exit, CliError> {
    let path = args.file.display();
    let repaired = spf_record::log::repair(&args.file).map_err(|error| match &error {
        RepairError::Nothing { source: source @ ReadError::Read(_), .. } => unreadable(&args.file, source),
        RepairError::Nothing { .. } => {
            CliError::usage(format!("cannot repair `{path}`")).because(&error).hint("give the flight.mcap in a flight's folder")
        }
        _ => CliError::internal(format!("cannot repair `{path}`")).because(&error),
    })?;
    let (messages, until) = (repaired.messages, repaired.until);
    printer.result(&match repaired.trouble {
        None => format!("`{path}` is complete: {messages} messages up to {until}"),
        Some(trouble) => format!("repaired `{path}` ({trouble}): {messages} messages up to {until} recovered"),
    });
    Ok(Exit::Success)
}
