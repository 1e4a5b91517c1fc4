//! Grades models on a dataset.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Serialize;
use spf_bench::ground::ask::{AnswererKind, AskOptions, Ended, Plan};
use spf_bench::ground::measure::{Report, grades, report};
use spf_bench::ground::signs::{self, ObedienceRow, obedience};
use spf_bench::ground::source::{self, Source};
use spf_bench::ground::{AnswerRow, Answerer, page, table};
use spf_oracle::ErrorFile;

use super::folder::{Folder, Head, is_answered};
use super::{answerers, is_oracle};
use crate::args::Ground;
use crate::commands::fly::signals::interrupts;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table as columns};
use crate::settings::Settings;

/// Version of the folder's files.
const FORMAT: u32 = 2;

/// Output of `--json`, and content of `report.json`.
#[derive(Serialize)]
struct Printed<'a> {
    dataset: &'a Path,
    form: &'static str,
    complete: bool,
    #[serde(flatten)]
    report: &'a Report,
    /// Who obeyed the signs of a dataset of signs.
    #[serde(skip_serializing_if = "<[ObedienceRow]>::is_empty")]
    obedience: &'a [ObedienceRow],
}

/// Grades on the dataset at `path`; `usual_output` is where to without `--output`, if not a folder named after the dataset.
pub(super) fn grade(
    args: &Ground,
    path: &Path,
    usual_output: Option<&Path>,
    settings: &Settings,
    options: AskOptions,
    printer: &mut Printer,
) -> Result<Exit, CliError> {
    let max_cost = settings.fly.max_cost_usd.get()?;
    let mut source = source::open(path).map_err(|error| {
        CliError::usage(format!("cannot read the dataset `{}`", path.display()))
            .because(&error)
            .hint("docs/guide/grounding.md lists the supported formats")
    })?;
    source.items.truncate(args.count.unwrap_or(usize::MAX));
    let (answerers, sentences) = all_answerers(args, settings, &source)?;
    let out = args.output.clone().or_else(|| usual_output.map(Path::to_owned)).unwrap_or_else(|| default_folder(path));
    source.check_masks().map_err(|error| {
        CliError::usage(format!("cannot evaluate on the dataset `{}`", path.display()))
            .because(&error)
            .hint("fix the mask, or remove its row")
    })?;
    let head = Head {
        format: FORMAT,
        dataset: path.to_owned(),
        avoid: args.avoid,
        close_up: args.close_up,
        seed: args.seed,
        questions: format!("{:016x}", source.digest),
        digests: answerers.iter().map(|answerer| (answerer.name.clone(), answerer.kind.digest())).collect(),
    };
    let (mut folder, mut rows) = Folder::open(&out, &head, args.resume, args.overwrite)?;
    let plan = Plan {
        items: &source.items,
        answerers: &answerers,
        options,
        parallel: usize::from(args.parallel),
        per_minute: args.rate,
        max_cost,
    };
    sentences.iter().for_each(|sentence| printer.log(sentence));
    let ended = ask(&plan, &mut folder, &mut rows, printer)?;
    let grades = grades(&source.items, &answerers, &rows, args.avoid).map_err(|error| {
        CliError::usage("cannot evaluate the replies")
            .because(&error)
            .hint("the dataset is incomplete: create or download it again")
    })?;
    let report = report(&source.items, &answerers, &grades);
    let complete = ended == Ended::Complete;
    let obeyed = obedience(&source.items, &answerers, &rows);
    let printed = Printed { dataset: path, form: source.form, complete, report: &report, obedience: &obeyed };
    let json = serde_json::to_string_pretty(&printed).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
    folder.write("report.json", &format!("{json}\n"))?;
    let title = format!("Pointing on {}", path.display());
    let page = page::page(&title, &note(&source, &answerers), &source.items, &report, &grades);
    let page = folder.write("index.html", &page)?;
    if args.json {
        printer.data(&json);
    }
    if !obeyed.is_empty() {
        printer.result(&format!("{}\n", columns(&signs::rows(&obeyed))));
    }
    tell(&report, &source, &answerers, &page, printer);
    let silent = |answerer: &Answerer| !rows.iter().any(|row| row.answerer == answerer.name && is_answered(row));
    let mut models = answerers.iter().filter(|answerer| matches!(answerer.kind, AnswererKind::Model(..))).peekable();
    let unanswered = models.peek().is_some() && models.all(silent);
    Ok(match ended {
        Ended::Complete if unanswered => {
            printer.log("no model answered any question; --resume retries them");
            Exit::Failed
        }
        Ended::Complete => Exit::Success,
        Ended::Stopped => {
            printer.log("stopped; repeat the command with --resume to continue");
            Exit::Aborted
        }
        Ended::Spent => {
            printer.log("the --max-cost limit is reached; raise it and use --resume to continue");
            Exit::Aborted
        }
    })
}

/// The centre baseline, the oracle if the dataset has ID images, and the named VLMs.
fn all_answerers(args: &Ground, settings: &Settings, source: &Source) -> Result<(Vec<Answerer>, Vec<String>), CliError> {
    let (named, sentences) = answerers(args, settings)?;
    let simulated = source.items.iter().any(|item| item.sim.is_some());
    if !simulated && named.iter().any(is_oracle) {
        let only_default = args.settings.text("--vlm").is_none();
        let error = CliError::usage("the oracle cannot read these images: it needs a dataset from `spf sim dataset`");
        return Err(if only_default {
            error.hint("set a model with --vlm (see `spf vlm list`)")
        } else {
            error.hint("remove it from --vlm")
        });
    }
    let mut all = vec![Answerer::centre()];
    if simulated && !named.iter().any(is_oracle) {
        let errors =
            ErrorFile::named("default").map_err(|error| CliError::internal("cannot create the oracle").because(&error))?;
        all.push(Answerer { name: "oracle".to_owned(), kind: AnswererKind::Oracle(Box::new(errors), args.seed) });
    }
    all.extend(named);
    Ok((all, sentences))
}

/// `grounding/NAME`, after the dataset's folder or file.
fn default_folder(dataset: &Path) -> PathBuf {
    let name = dataset.canonicalize().ok().and_then(|path| path.file_stem().map(ToOwned::to_owned));
    Path::new("grounding").join(name.unwrap_or_else(|| "dataset".into()))
}

/// Sends the questions that were not answered before.
fn ask(plan: &Plan<'_>, folder: &mut Folder, rows: &mut Vec<AnswerRow>, printer: &mut Printer) -> Result<Ended, CliError> {
    let named = |row: &AnswerRow| (row.answerer.clone(), row.item.clone());
    let keys: BTreeSet<&str> = plan.items.iter().map(|item| item.key.as_str()).collect();
    let before: BTreeSet<_> = rows.iter().filter(|row| is_answered(row) && keys.contains(row.item.as_str())).map(named).collect();
    let spent: f64 = rows.iter().filter_map(|row| row.account.cost_usd).sum();
    let total = plan.questions() as u64;
    let there = plan.answerers.iter().flat_map(|answerer| {
        plan.items.iter().filter(|item| answerer.sees(item)).map(|item| (answerer.name.clone(), item.key.clone()))
    });
    let mut done = there.filter(|question| before.contains(question)).count() as u64;
    if done > 0 {
        printer.log(&format!("{done} of {total} questions already answered"));
    }
    let stop = interrupts()?;
    printer.start_count("queries", total, done);
    let ended = plan.run(&before, spent, &stop, |row| {
        folder.push(&row)?;
        rows.push(row);
        done += 1;
        printer.count(done);
        Ok::<(), CliError>(())
    });
    printer.end_live();
    ended
}

/// Notes needed to interpret the figures.
fn note(source: &Source, answerers: &[Answerer]) -> String {
    let oracle = answerers.iter().any(is_oracle);
    let about =
        if oracle { "\nThe oracle reads the simulator's ID and depth images: its results are not VLM results." } else { "" };
    format!("The images are {}. The baseline `centre` always points at the image centre.{about}", source.form)
}

fn tell(report: &Report, source: &Source, answerers: &[Answerer], page: &Path, printer: &Printer) {
    printer.result(&format!("{}.\n{}\n", table::about(report), note(source, answerers)));
    printer.result(&columns(&table::figures(report)));
    if !report.comparisons.is_empty() {
        printer.result("");
        printer.result(&columns(&table::comparisons(report)));
    }
    printer.result(&format!("\n{}", page.display()));
}
