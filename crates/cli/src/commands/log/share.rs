//! `spf log share`: one file of a flight that may be sent to somebody else.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use spf_flight::log::Channel;
use spf_flight::replay::Report;
use spf_flight::share::{LeftOut, Opened, Pictures, ShareError, Shared, SourceEnd, check, share as make};
use spf_record::log::LogReader;

use super::{spare, unreplayable, warn_truncated};
use crate::args::Share;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line};

/// The log in a flight's folder.
const LOG: &str = "flight.mcap";
/// Names of users and computers that name nobody, and would be taken out of instructions.
const NOBODY: [&str; 12] =
    ["root", "user", "admin", "pilot", "drone", "home", "ubuntu", "debian", "raspberrypi", "localhost", "runner", "guest"];

/// Writes the file, reads it back, and tells what is in it.
pub(super) fn share(args: &Share, printer: &Printer) -> Result<Exit, CliError> {
    let log = log_of(&args.flight)?;
    let output = args.output.clone().unwrap_or_else(|| named_after(&log));
    spare(&output, args.overwrite)?;
    let pictures = if args.pictures { Pictures::Kept } else { Pictures::LeftOut };
    let known = known_words(std::env::vars_os());
    if output.canonicalize().is_ok_and(|output| log.canonicalize().is_ok_and(|log| log == output)) {
        return Err(CliError::usage(format!("`{}` is the flight itself", output.display()))
            .hint("what is left out would be lost: name another file with -o FILE"));
    }
    printer.log(&format!("reading {} …", log.display()));
    let shared = write(&log, &output, pictures, &known)?;
    if shared.mark.source == SourceEnd::Truncated {
        warn_truncated(&log, printer);
    }
    // What was written, and not what was to be written, is what the receiver gets.
    let file = LogReader::open(&output).map_err(|error| super::unreadable(&output, &error))?;
    match check(file) {
        Ok(opened) => {
            tell(&output, &shared, &opened.head.instruction, printer);
            printer.result(&decided_again(&opened));
        }
        Err(error) => {
            tell(&output, &shared, "", printer);
            printer.result(&format!("the receiver cannot make the decisions again: {}", in_full(&error)));
        }
    }
    files_beside(&log, printer);
    let output = output.display();
    printer.result(&format!("read what it tells before you send it: spf log cat {output} /flight /operator /reply"));
    Ok(Exit::Success)
}

/// The log of a flight: the file itself, or the one in its folder.
fn log_of(flight: &Path) -> Result<PathBuf, CliError> {
    let hint = "give the folder of a recorded flight, such as flights/001-fly-to-the-red-crane, or its flight.mcap";
    let there = flight
        .metadata()
        .map_err(|error| CliError::usage(format!("cannot find the flight `{}`", flight.display())).because(&error).hint(hint))?;
    if !there.is_dir() {
        return Ok(flight.to_owned());
    }
    let log = flight.join(LOG);
    if log.is_file() {
        return Ok(log);
    }
    Err(CliError::usage(format!("`{}` is not a flight: it has no {LOG}", flight.display())).hint(hint))
}

/// The file for a log if no other is named: in the working directory, by the number of the flight's folder. The rest of that name is
/// the instruction as it was given.
fn named_after(log: &Path) -> PathBuf {
    let log = std::path::absolute(log).unwrap_or_else(|_| log.to_owned());
    let folder = log.parent().and_then(Path::file_name).filter(|_| log.file_name().is_some_and(|name| name == LOG));
    let number = folder.map(|name| name.to_string_lossy()).and_then(|name| {
        let digits = name.split('-').next().unwrap_or_default();
        (!digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit())).then(|| digits.to_owned())
    });
    format!("{}-shared.mcap", number.as_deref().unwrap_or("flight")).into()
}

/// Words that this computer and its user are known by: values of variables that hold keys, and names.
fn known_words(variables: impl Iterator<Item = (OsString, OsString)>) -> Vec<String> {
    let mut known = BTreeSet::new();
    for (name, value) in variables {
        let (Some(name), Some(value)) = (name.to_str(), value.to_str()) else { continue };
        let secret = ["KEY", "TOKEN", "SECRET", "PASSW"].iter().any(|part| name.contains(part)) && value.len() >= 8;
        let named = matches!(name, "USER" | "LOGNAME" | "USERNAME" | "HOSTNAME" | "COMPUTERNAME");
        let home = matches!(name, "HOME" | "USERPROFILE").then(|| value.rsplit(['/', '\\']).next()).flatten();
        let word = if secret || named { Some(value) } else { home };
        known.extend(word.map(str::to_owned).filter(|word| word.len() >= 3 && !NOBODY.contains(&word.to_lowercase().as_str())));
    }
    known.into_iter().collect()
}

/// Writes the shared log beside its place, and moves it there once it is whole.
fn write(log: &Path, output: &Path, pictures: Pictures, known: &[String]) -> Result<Shared, CliError> {
    let mut part = output.to_owned().into_os_string();
    part.push(".part");
    let part = PathBuf::from(part);
    let unwritten =
        |error: &dyn std::error::Error| CliError::internal(format!("cannot write `{}`", output.display())).because(error);
    let file = File::create_new(&part).map_err(|error| {
        let error = unwritten(&error);
        if part.exists() {
            error.hint(format!("`{}` is in the way: another run, or one that was killed", part.display()))
        } else {
            error
        }
    })?;
    let made = make(|| LogReader::open(log), BufWriter::new(file), pictures, known).map_err(|error| match &error {
        ShareError::Log(error) => unreplayable(log, error),
        ShareError::Message { .. } => CliError::usage(format!("cannot share `{}`", log.display()))
            .because(&error)
            .hint("the log is damaged, or was written by another version of spf"),
        ShareError::Already => CliError::usage(format!("cannot share `{}`", log.display())).because(&error),
        error => unwritten(error),
    });
    let moved = made.and_then(|(shared, mut file)| {
        let moved = file.flush().and_then(|()| file.get_ref().sync_all()).and_then(|()| std::fs::rename(&part, output));
        moved.map(|()| shared).map_err(|error| unwritten(&error))
    });
    // A part is useless; a failure to remove it adds nothing to the error.
    moved.inspect_err(|_| drop(std::fs::remove_file(&part)))
}

fn tell(output: &Path, shared: &Shared, instruction: &str, printer: &Printer) {
    let bytes = output.metadata().map_or(0, |data| data.len());
    let messages: u64 = shared.kept.values().sum();
    printer.result(&format!("{}: {}, {messages} messages", output.display(), size(bytes)));
    printer.result(&format!("kept: the instruction, \"{}\"", one_line(instruction)));
    let topics = |counts: &BTreeMap<String, u64>| {
        counts.iter().map(|(topic, count)| format!("{} {count}", one_line(topic))).collect::<Vec<_>>().join(", ")
    };
    printer.result(&format!("messages kept: {}", topics(&shared.kept)));
    if !shared.dropped.is_empty() {
        printer.result(&format!("messages left out: {}", topics(&shared.dropped)));
    }
    for left_out in &shared.mark.left_out {
        let asked =
            if *left_out == LeftOut::Pictures { " (--pictures keeps them: who was filmed can be seen on them)" } else { "" };
        printer.result(&format!("left out: {}{asked}", left_out.words()));
    }
    if shared.kept.contains_key(Channel::Image.name()) {
        printer.result("kept: camera images, with everybody and every place on them");
    }
    if shared.kept.contains_key(Channel::Depth.name()) {
        printer.result("kept: depth images, which show the shapes of what was around, but no colours");
    }
    printer.result("positions are metres from the start: no global position is in it, but the shape of the path is");
}

/// Tells which other files of the folder are not in it.
fn files_beside(log: &Path, printer: &Printer) {
    let beside = ["decisions.jsonl", "queries.jsonl", "summary.json", "vlm.jsonl", "video.mp4", "trajectory.svg"];
    let there: Vec<&str> = beside.into_iter().filter(|name| log.with_file_name(name).is_file()).collect();
    if !there.is_empty() {
        printer.result(&format!("not in it: {}", there.join(", ")));
    }
}

/// The result of making the decisions again.
pub(super) fn decided_again(opened: &Opened) -> String {
    let Report { outputs, differences, .. } = &opened.report;
    let found = match differences.len() {
        0 => "no difference".to_owned(),
        1 => "1 difference".to_owned(),
        many => format!("{many} differences"),
    };
    let until =
        opened.gap.map_or(String::new(), |at| format!(" up to {at}, where the disk was too slow and messages are missing"));
    format!("the pilot's decisions made again from it: {found} in {outputs} outputs{until}")
}

/// A size in kB or MB.
pub(super) fn size(bytes: u64) -> String {
    if bytes < 1_000_000 { format!("{} kB", bytes.div_ceil(1000)) } else { format!("{:.1} MB", bytes as f64 / 1e6) }
}

/// An error with its causes, on one line.
fn in_full(error: &dyn std::error::Error) -> String {
    std::iter::successors(Some(error), |error| error.source()).map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_names_of_the_environment_are_known() {
        let variables = [
            ("GEMINI_API_KEY", "an-own-key"),
            ("USER", "wendelin"),
            ("HOME", "/home/wendel"),
            ("LOGNAME", "pilot"),
            ("PATH", "/usr/bin"),
            ("A_KEY", "short"),
        ];
        let known = known_words(variables.into_iter().map(|(name, value)| (name.into(), value.into())));
        assert_eq!(known, ["an-own-key", "wendel", "wendelin"]);
    }

    #[test]
    fn the_file_is_named_after_the_flight() {
        assert_eq!(named_after(Path::new("flights/001-x/flight.mcap")), PathBuf::from("001-shared.mcap"));
        assert_eq!(named_after(Path::new("flights/wendelin/flight.mcap")), PathBuf::from("flight-shared.mcap"));
        assert_eq!(named_after(Path::new("logs/mine.mcap")), PathBuf::from("flight-shared.mcap"));
    }
}
