//! `spf bench ask`: trials whose questions somebody answers.

use std::io::BufRead as _;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use serde_json::json;
use spf_api::bench::{method, tasks};
use spf_bench::run::asked::{Asked, Line, lines, said, write};
use spf_bench::run::{Plan, Progress, RunOptions, Shard, read_records, run as run_plan, shell_word};
use spf_bench::stats::Rate;
use spf_bench::table::words;
use spf_bench::trial::{Method, Networks, Record, VlmUnderTest};
use spf_flight::sim::VlmFactory;
use spf_flight::words::counted;
use spf_pilot::{PilotSettings, Preset};
use spf_vlm::VlmError;
use spf_vlm::folder::{FolderOptions, OPEN, Points, QuestionFolder};
use spf_vlm::service::RunEnd;

use super::store_error;
use crate::args::BenchAsk;
use crate::commands::fly::signals::interrupts;
use crate::commands::vlm::{LATENCY_S, failure, listed, service};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table};
use crate::settings::Settings;

/// Longest name of whoever answers, characters.
const LONGEST_NAME: usize = 80;
/// Trials under way at the same time, unless said otherwise: their questions can be answered in any order.
const JOBS: u16 = 4;
/// JPEG quality of the pictures, as programs of the user's own get them.
const QUALITY: u8 = 90;

/// Flies the trials with the answers that are there, and waits for the others.
pub(super) fn ask(args: &BenchAsk, printer: &mut Printer) -> Result<Exit, CliError> {
    let settings = Settings::of(&args.settings, printer)?;
    let who = args.who.trim();
    if who.is_empty() || who.chars().count() > LONGEST_NAME || who.chars().any(char::is_control) {
        return Err(CliError::usage(format!("--who must be a name of 1 to {LONGEST_NAME} characters on one line"))
            .hint("--who 'Ada Lovelace'"));
    }
    let (tasks, files) = tasks(args.suite.as_deref(), &args.task, "spf bench ask DIR --suite paper --who NAME")?;
    let own = args.suite.as_deref().and_then(spf_bench::task::suite).map_or("spf", |suite| suite.methods);
    let methods = listed(args.method.as_deref().unwrap_or(own)).into_iter().map(method).collect::<Result<Vec<_>, _>>()?;
    if let Some(blind) = methods.iter().find(|method| !method.uses_vlm()) {
        return Err(CliError::usage(format!("the method `{}` asks nothing", blind.name())).hint("--method spf"));
    }
    if methods.is_empty() {
        return Err(CliError::usage("no method given").hint("--method spf"));
    }
    let latency = latency(&settings)?;
    let name = format!("asked:{who}");
    let options = FolderOptions {
        name: name.clone(),
        points: match args.points.as_str() {
            "thousandths" => Points::Thousandths,
            "yx-thousandths" => Points::YxThousandths,
            _ => Points::Pixels,
        },
        long_side: settings.vlm.image_long_side.get()?,
        quality: settings.vlm.jpeg_quality.get()?.unwrap_or(QUALITY),
        waits: !args.no_wait,
    };
    // Answers are answers to questions that were asked in this way.
    let asking = format!("{options:?} {latency}").replace("waits: false", "waits: true");
    let voice = printer.voice();
    let typed = if args.terminal { Some(typed()?) } else { None };
    let folder = QuestionFolder::new(&args.folder, options, Arc::new(move |text| voice.log(text)), typed);
    let asked = Asked::new(folder, who.to_owned());
    let plan = plan(args, tasks, methods, name, latency);
    let head = plan.head(Shard::WHOLE, &asking);
    let jobs = if args.terminal { 1 } else { args.jobs.unwrap_or(JOBS) };
    let options = RunOptions { jobs: jobs.into(), videos: false, command: command(args, latency), files, asked: Some(asked) };
    let service = service(None, &interrupts()?, printer)?;
    let mut begun = false;
    let ended = run_plan(&plan, &head, &args.folder, &options, &service, &mut |progress, record| {
        if !begun {
            begun = true;
            let done = progress.done;
            let before = if done > 0 { format!("; flown already: {done}") } else { String::new() };
            printer.log(&format!("{} to be {}{before}.", counted(progress.of as u64, "trial"), said(who)));
        }
        if let Some(record) = record {
            printer.log(&flown(record, progress));
        }
    });
    let ended = ended.map_err(|error| store_error(&error))?;
    let records = read_records(&args.folder).map_err(|error| store_error(&error))?;
    write(&args.folder, who, &head.trials, &records).map_err(|error| store_error(&error))?;
    if ended.stopped {
        return stopped(args, service.ended(), ended, printer);
    }
    show(args, who, &records, printer);
    Ok(Exit::Success)
}

/// What an answer counts as in the flight's time, seconds.
fn latency(settings: &Settings) -> Result<f64, CliError> {
    let latency = settings.vlm.latency_s.get()?.unwrap_or(LATENCY_S);
    let most = PilotSettings::preset(Preset::Default).reply_timeout.as_secs_f64();
    if latency >= most {
        return Err(CliError::usage(format!("--vlm-latency {latency}: a pilot waits no longer than {most} s for an answer"))
            .hint("whoever answers may take any time, whatever it counts as: --vlm-latency 1.5"));
    }
    Ok(latency)
}

fn plan(args: &BenchAsk, tasks: Vec<Arc<spf_bench::task::Task>>, methods: Vec<Method>, name: String, latency: f64) -> Plan {
    // Each trial gets questions of its own when it is flown.
    let vlm_factory: VlmFactory = Arc::new(|_, _| Err("these questions are asked by `spf bench ask` only".into()));
    let pointers = vec![VlmUnderTest { name, vlm_factory, latency: Some(latency) }];
    Plan { tasks, methods, pointers, trials: args.trials, seed: args.seed, max_cost_usd: None, networks: Networks::default() }
}

/// The lines that are typed, read by one thread for the life of the process.
fn typed() -> Result<Receiver<String>, CliError> {
    let (send, lines) = channel();
    let read = move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if send.send(line).is_err() {
                return;
            }
        }
    };
    let started = std::thread::Builder::new().name("typed".to_owned()).spawn(read);
    started.map(|_| lines).map_err(|error| CliError::internal("cannot read what you type").because(&error))
}

/// A flown trial in a line.
fn flown(record: &Record, progress: Progress) -> String {
    let Progress { done, of, .. } = progress;
    if let Some(why) = &record.error {
        return format!("{done} of {of}: cannot fly {}: {why}", record.run_id);
    }
    let ended = record.flight.as_ref().map_or_else(String::new, |flight| spf_flight::words::outcome(flight.outcome).to_owned());
    let verified = if record.scores.strict { "verified" } else { "not verified" };
    let touched = if record.scores.collided { ", something was touched" } else { "" };
    format!("{done} of {of}: {}: {ended}, {verified}{touched}", record.run_id)
}

/// The end of a run of which trials are missing.
fn stopped(
    args: &BenchAsk,
    end: Option<RunEnd>,
    Progress { done, of, .. }: Progress,
    printer: &Printer,
) -> Result<Exit, CliError> {
    let kept = format!("{done} of {of} trials are done; every answer is kept, and the same command goes on");
    if let Some(RunEnd::Refused { error: error @ VlmError::Folder { .. }, .. }) = &end {
        return Err(CliError::usage("cannot go on with the questions and answers").because(error).hint(format!(
            "use the program and the settings that wrote them; or, to ask anew from there, delete this question, all later ones and \
             their answers, and log.jsonl beside them\n{kept}"
        )));
    }
    if let Some(error) = end.as_ref().and_then(|end| failure(end, &kept)) {
        return Err(error);
    }
    let open = args.folder.join(OPEN);
    printer.log(&format!("{kept}; {} lists the open questions", open.display()));
    Ok(Exit::Aborted)
}

fn show(args: &BenchAsk, who: &str, records: &[Record], printer: &Printer) {
    let found = lines(records);
    if printer.is_json() {
        return printer.data(&found.iter().map(json_of).collect::<serde_json::Value>().to_string());
    }
    let head = ["TASK", "METHOD", "REPORTED DONE", "VERIFIED", "TOUCHED", "QUESTIONS", "SECONDS"].map(str::to_owned).to_vec();
    let row = |line: &Line| {
        let rates = [line.reached, line.verified, line.touched].map(|rate| format!("{}/{}", rate.hits, rate.of));
        let seconds = line.seconds.map_or_else(|| "–".to_owned(), |seconds| format!("{seconds:.1}"));
        let figures = vec![format!("{:.1}", line.questions), seconds];
        [vec![line.task.clone(), line.method.clone()], rates.to_vec(), figures].concat()
    };
    printer.result(&table(&std::iter::once(head).chain(found.iter().map(row)).collect::<Vec<_>>()));
    let verified = records.iter().map(|record| record.scores.strict).collect::<Rate>();
    printer.result(&format!("\nverified {}, {}", words(verified), said(who)));
    printer.result(&args.folder.join("index.html").display().to_string());
}

fn json_of(line: &Line) -> serde_json::Value {
    json!({
        "answered_by": line.who, "task": line.task, "method": line.method, "trials": line.verified.of,
        "reached": line.reached.hits, "verified": line.verified.hits, "touched": line.touched.hits,
        "questions": line.questions, "seconds": line.seconds,
    })
}

/// The command for the same rows.
fn command(args: &BenchAsk, latency: f64) -> String {
    let mut text = format!("spf bench ask {}", shell_word(&args.folder.display().to_string()));
    let mut give = |name: &str, value: &str| text.push_str(&format!(" {name} {}", shell_word(value)));
    give("--who", args.who.trim());
    args.suite.iter().for_each(|suite| give("--suite", suite));
    args.task.iter().for_each(|task| give("--task", task));
    args.method.iter().for_each(|method| give("--method", method));
    give("--vlm-latency", &latency.to_string());
    give("--points", &args.points);
    give("--trials", &args.trials.to_string());
    give("--seed", &args.seed.to_string());
    args.settings.file().iter().for_each(|file| give("--config", &file.display().to_string()));
    text
}
