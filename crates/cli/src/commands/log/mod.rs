//! `spf log`: tools for flight logs.

mod cat;
pub(super) mod differences;
mod export;
mod info;
mod open;
mod repair;
mod share;
mod video;

use std::path::Path;

use spf_flight::replay::ReplayError;
use spf_record::log::ReadError;

use crate::args::Log;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Runs one of the log commands.
pub(crate) fn log(command: &Log, printer: &Printer) -> Result<Exit, CliError> {
    match command {
        Log::Info(args) => info::info(args, printer),
        Log::Cat(args) => cat::cat(args, printer),
        Log::Export(args) => export::export(args, printer),
        Log::Video(args) => video::video(args, printer),
        Log::Repair(args) => repair::repair(args, printer),
        Log::Share(args) => share::share(args, printer),
        Log::Open(args) => open::open(args, printer),
    }
}

/// Refuses an output file that exists, unless it is to be replaced.
fn spare(output: &Path, overwrite: bool) -> Result<(), CliError> {
    if overwrite || output.symlink_metadata().is_err() {
        return Ok(());
    }
    Err(CliError::usage(format!("--output: `{}` exists", output.display()))
        .hint("use --overwrite to replace it, or another file with -o FILE"))
}

/// The error for a log that cannot be read.
pub(crate) fn unreadable(path: &Path, error: &ReadError) -> CliError {
    if matches!(error, ReadError::Broken(_)) && !begins_as_log(path) {
        return CliError::usage(format!("`{}` is not a log", path.display())).hint("give the flight.mcap in a flight's folder");
    }
    let unreadable_log = CliError::usage(format!("cannot read the flight log `{}`", path.display())).because(error);
    match error {
        ReadError::Format(_) => unreadable_log.hint("it was written by a later version of spf: use that version"),
        _ if path.extension().is_none_or(|kind| kind != "mcap") => {
            unreadable_log.hint("give the flight.mcap in a flight's folder")
        }
        ReadError::Read(_) => unreadable_log.hint("give the flight.mcap in a flight's folder"),
        _ => unreadable_log.hint(format!("`spf log repair {}` recovers the readable part of a flight log", path.display())),
    }
}

/// Whether a file begins as every MCAP file does (MCAP specification, "Magic").
fn begins_as_log(path: &Path) -> bool {
    let mut magic = [0; 8];
    let read = std::fs::File::open(path).and_then(|mut file| std::io::Read::read_exact(&mut file, &mut magic));
    read.is_ok() && magic == *b"\x89MCAP0\r\n"
}

/// The error for a log that cannot be replayed.
pub(crate) fn unreplayable(path: &Path, error: &ReplayError) -> CliError {
    match error {
        ReplayError::Read(source) => unreadable(path, source),
        _ => CliError::usage(format!("cannot replay `{}`", path.display()))
            .because(error)
            .hint("only flight logs written by spf can be replayed: flight.mcap in a flight's folder"),
    }
}

/// Warns that a log is truncated; everything before its end is available.
pub(crate) fn warn_truncated(path: &Path, printer: &Printer) {
    let path = path.display();
    printer.log(&format!(
        "warning: `{path}` is incomplete: its flight is still running, or the log was truncated; after the flight, \
         `spf log repair {path}` completes it"
    ));
}
