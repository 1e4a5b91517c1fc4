//! `spf bench report`.

use std::path::PathBuf;

use spf_bench::contrast::MethodPair;
use spf_bench::report::{ReportError, Source, write};

use super::store_error;
use crate::args::BenchReport;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Writes the report on folders of results.
pub(super) fn report(args: &BenchReport, printer: &Printer) -> Result<Exit, CliError> {
    let output = output(args)?;
    let pairs = args.pairs.iter().map(|words| pair(words)).collect::<Result<Vec<_>, _>>()?;
    let is_again = |(number, one): (usize, &MethodPair)| pairs.iter().take(number).any(|other| one.is_same(other));
    if let Some(again) = pairs.iter().enumerate().find(|&pair| is_again(pair)).map(|(_, pair)| pair) {
        return Err(CliError::usage(format!("--pairs: `{}` and `{}` are compared twice", again.first, again.second))
            .hint("name each pair once: every comparison counts in the correction"));
    }
    let source = Source::read(&args.folders).and_then(|source| source.comparing(pairs)).map_err(|error| refused(&error))?;
    for plan in source.missing() {
        let folders: Vec<String> = plan.folders.iter().map(|folder| folder.display().to_string()).collect();
        printer.log(&format!("{} of {} trials are missing in {}", plan.trials.len(), plan.of, folders.join(", ")));
    }
    std::fs::create_dir_all(&output)
        .map_err(|error| CliError::usage(format!("cannot create the folder `{}`", output.display())).because(&error))?;
    printer.log("rendering charts and maps …");
    let page = write(&source, &output).map_err(|error| refused(&error))?;
    printer.result(&page.display().to_string());
    Ok(Exit::Success)
}

/// Two methods with a colon in between.
fn pair(words: &str) -> Result<MethodPair, CliError> {
    match words.split_once(':') {
        Some((first, second)) if !first.is_empty() && !second.is_empty() && !second.contains(':') && first != second => {
            Ok(MethodPair { first: first.to_owned(), second: second.to_owned() })
        }
        _ => Err(CliError::usage(format!("--pairs: `{words}` is not a pair of methods"))
            .hint("give two methods with a colon in between: --pairs spf-avoid:spf,spf-default:spf-avoid")),
    }
}

/// The output folder: beside the results of a single folder.
fn output(args: &BenchReport) -> Result<PathBuf, CliError> {
    match (&args.output, args.folders.as_slice()) {
        (Some(output), _) => Ok(output.clone()),
        (None, [folder]) => Ok(folder.join("report")),
        _ => Err(CliError::usage("a report on several folders needs an output folder").hint("set it with -o DIR")),
    }
}

fn refused(error: &ReportError) -> CliError {
    let failed = CliError::usage("cannot create the report").because(error);
    match error {
        ReportError::Store(error) => store_error(error),
        ReportError::NoResults { .. } => failed.hint("give a folder written by `spf bench run -o DIR`"),
        ReportError::Empty { .. } => failed.hint("repeat the command that started the run to resume it"),
        ReportError::Stranger { .. } => failed.hint(
            "the folder contains rows of other runs; rerun this run with -o and a separate \
            folder",
        ),
        ReportError::NotFlown { .. } => failed.hint("--pairs compares methods of the folders given"),
        ReportError::Twice { .. } => failed.hint("give only one of the two folders; merged results already contain the shards"),
        _ => CliError::internal("cannot write the report").because(error),
    }
}
