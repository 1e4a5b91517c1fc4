//! `spf bench list`: suites, and tasks in files and folders.

use std::path::{Path, PathBuf};

use spf_bench::task::{SUITES, TaskFile};

use crate::args::BenchList;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Lists the built-in suites, or the given tasks.
pub(super) fn list(args: &BenchList, printer: &Printer) -> Result<Exit, CliError> {
    if args.tasks.is_empty() {
        return suites(printer);
    }
    for path in &args.tasks {
        if path.is_dir() {
            let files = files(path)?;
            printer.result(&format!("{}: {} task files", path.display(), files.len()));
            files.iter().try_for_each(|file| line(file, printer))?;
        } else {
            line(path, printer)?;
        }
    }
    Ok(Exit::Success)
}

fn suites(printer: &Printer) -> Result<Exit, CliError> {
    for suite in SUITES {
        printer.result(&format!("{}: {}", suite.name, suite.description));
        let tasks = suite.tasks().map_err(|error| CliError::internal("invalid built-in task").because(&error))?;
        for task in tasks {
            printer.result(&format!("  {:30} {:18} {}", task.id, task.category.words(), task.instruction));
        }
    }
    Ok(Exit::Success)
}

/// The task files of a folder, by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
    let unreadable =
        |error: std::io::Error| CliError::usage(format!("cannot read the folder `{}`", folder.display())).because(&error);
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let mut files: Vec<PathBuf> =
        entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>().map_err(unreadable)?;
    files.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    if files.is_empty() {
        return Err(CliError::usage(format!("no task file (.toml) in the folder `{}`", folder.display())));
    }
    Ok(files)
}

/// One task: its id, what it is, its instruction.
fn line(path: &Path, printer: &Printer) -> Result<(), CliError> {
    let name = path.display().to_string();
    let file = TaskFile::load(&name).map_err(|error| CliError::usage(format!("invalid task `{name}`")).because(&error))?;
    let (id, kind, instruction) = match &file {
        TaskFile::Own(task) => (&task.id, task.category.words().to_owned(), Some(&task.instruction)),
        TaskFile::Foreign(task) => {
            let kind = format!("{} {}", task.benchmark.name(), task.scene);
            (&task.id, kind, task.wordings.first().map(|wording| &wording.instruction))
        }
    };
    // Instructions of others may have several lines.
    let words = instruction.map(|words| words.split_whitespace().collect::<Vec<_>>().join(" ")).unwrap_or_default();
    printer.result(&format!("  {id:30} {kind:18} {words}"));
    Ok(())
}
