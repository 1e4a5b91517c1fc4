//! `spf vlm trial NAME,…`: calibration dots, pointing questions and flights of models, on one page.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use spf_bench::ground::ask::{AnswererKind, AskOptions, Ended, MakeVlm, Plan as Questions};
use spf_bench::ground::measure::{Measures, grades, report};
use spf_bench::ground::source::{self, Source};
use spf_bench::ground::{AnswerRow, Answerer};
use spf_bench::run::{Plan, RunManifest, RunOptions, Shard, read_records, run as run_plan, shell_word};
use spf_bench::task::{Task, suite};
use spf_bench::trial::{Method, Networks, Record, VlmUnderTest};
use spf_bench::tryout::{DotCheck, EchoRow, Findings, echo, page};
use spf_core::prompt::{PromptKind, PromptText};
use spf_core::time::duration_from_secs;
use spf_flight::sim::VlmFactory;
use spf_vlm::check::{USUAL_CAMERA, Verdict, check as ask_dots};
use spf_vlm::exec::EXEC;
use spf_vlm::service::{Fate, RunEnd, Service};
use spf_vlm::{Cancel, Paced, Vlm};

use super::LATENCY_S;
use super::served::{dollars, failure, service, stoppable};
use super::{Estimate, agreed, exec, is_human, listed, remote};
use crate::args::{Dataset, VlmTrial};
use crate::commands::bench::store_error;
use crate::commands::fly::signals::interrupts;
use crate::commands::ground::folder::{Folder, Head, is_answered};
use crate::commands::sim::{dataset::generate, write};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table as columns};
use crate::settings::Settings;

/// Scenes of the questions: one of each set.
const SCENES: &str = "city,office";
/// In the endpoint's refusals of images that are not its own camera's.
const ENDPOINT: [&str; 3] = ["frame in the last", "frames of the last", "camera's aspect ratio"];
/// Version of the folder's files.
const FORMAT: u32 = 1;

const STOPPED: &str = "stopped; repeat the command to continue";

/// A VLM on trial.
#[derive(Clone)]
struct Candidate {
    name: String,
    make: MakeVlm,
    pointer: VlmUnderTest,
}

/// A trial under way.
struct Trial<'a> {
    args: &'a VlmTrial,
    settings: &'a Settings,
    candidates: &'a [Candidate],
    max_cost: Option<f64>,
    /// Shared by questions and flights.
    service: &'a Arc<Service>,
    stop: &'a Arc<AtomicU32>,
}

/// Tries the models.
pub(crate) fn trial(args: &VlmTrial, printer: &mut Printer) -> Result<Exit, CliError> {
    let mut settings = Settings::of(&args.settings, printer)?;
    settings.fly.vlm.argument("NAME", &args.names);
    let max_cost = settings.fly.max_cost_usd.get()?;
    let names = listed(&args.names);
    let (candidates, sentences) = candidates(&settings, &names)?;
    std::fs::create_dir_all(&args.output)
        .map_err(|error| CliError::usage(format!("cannot use the folder `{}`", args.output.display())).because(&error))?;
    sentences.iter().for_each(|sentence| printer.log(sentence));
    let mut estimates = Vec::new();
    for name in &names {
        estimates.extend(Estimate::of_questions(&settings, name, args.questions as usize + 3 + echo::IMAGES * echo::VIEWS)?);
        estimates.extend(Estimate::of_flights(&settings, name, args.flights as usize, &[])?);
    }
    if !agreed(&estimates, args.yes, max_cost.is_some(), printer)? {
        return Ok(Exit::Aborted);
    }
    let stop = interrupts()?;
    let service = service(max_cost, &stop, printer)?;
    let trial = Trial { args, settings: &settings, candidates: &candidates, max_cost, service: &service, stop: &stop };
    let dots = trial.dots(printer)?;
    if trial.stopped() {
        printer.log(STOPPED);
        return Ok(Exit::Aborted);
    }
    service.charge(spent_on(&dots));
    let answering = answering(&candidates, &dots)?;
    let trial = Trial { candidates: &answering, ..trial };
    let (source, answerers, rows) = trial.questions(spent_on(&dots), printer)?;
    let spent = spent_on(&dots) + rows.iter().filter_map(|row| row.account.cost_usd).sum::<f64>();
    let records = trial.flights(spent, printer)?;
    let spent = spent + records.iter().filter_map(|record| record.cost_usd).sum::<f64>();
    let echoes = trial.echoes(&source, spent, printer)?;
    let findings = trial.findings(&dots, &source, &answerers, (&rows, &echoes), &records)?;
    trial.report(&findings, printer)?;
    let total: f64 = findings.iter().filter_map(Findings::cost_usd).sum();
    let end = service.ended();
    if stop.load(Ordering::Relaxed) > 0 {
        printer.log(STOPPED);
        return Ok(Exit::Aborted);
    }
    let kept = "what was answered and flown is kept; the same command does the rest";
    if let Some(error) = end.as_ref().and_then(|end| failure(end, kept)) {
        return Err(error);
    }
    if max_cost.is_some_and(|most| total >= most) || matches!(end, Some(RunEnd::Spent { .. })) {
        printer.log("the --max-cost limit is reached; raise it and repeat the command to continue");
        return Ok(Exit::Aborted);
    }
    let silent = findings.iter().all(|found| found.pointing.failed == found.pointing.questions);
    Ok(if silent { Exit::Failed } else { Exit::Success })
}

/// The VLMs, and sentences about them for the user.
fn candidates(settings: &Settings, names: &[&str]) -> Result<(Vec<Candidate>, Vec<String>), CliError> {
    let (mut candidates, mut sentences): (Vec<Candidate>, Vec<String>) = (Vec::new(), Vec::new());
    for name in names {
        if name.starts_with("oracle") || name.starts_with("replay:") || is_human(name) {
            return Err(CliError::usage(format!("`{name}` cannot be tried: it is not a model"))
                .hint("give models (see `spf vlm list`) or exec:COMMAND; `spf ground --dataset` evaluates the oracle"));
        }
        if candidates.iter().any(|candidate| candidate.name == *name) {
            return Err(CliError::usage(format!("`{name}` is given twice")).hint("give each VLM once"));
        }
        let set = settings.vlm.latency_s.get()?;
        let (make, latency): (MakeVlm, Option<f64>) = if name.starts_with(EXEC) {
            let exec = exec(settings, name)?;
            (Arc::new(move || Box::new(Paced::new(Box::new(exec.clone()), None, true))), set.or(Some(LATENCY_S)))
        } else {
            let chosen = remote(settings, name, None)?;
            sentences.push(chosen.sentence);
            (Arc::new(move || Box::new(chosen.remote.clone())), set)
        };
        let flown = make.clone();
        let vlm_factory: VlmFactory =
            Arc::new(move |_, _| Ok(Box::new(Paced::new(flown(), latency.map(duration_from_secs), false)) as Box<dyn Vlm>));
        let pointer = VlmUnderTest { name: (*name).to_owned(), vlm_factory, latency };
        candidates.push(Candidate { name: (*name).to_owned(), make, pointer });
    }
    match candidates.is_empty() {
        true => Err(CliError::usage("no VLM given").hint("spf vlm trial gemini")),
        false => Ok((candidates, sentences)),
    }
}

/// Those that replied to the dots: whoever did not is asked nothing more.
fn answering(candidates: &[Candidate], dots: &[DotCheck]) -> Result<Vec<Candidate>, CliError> {
    let silent = |name: &str| dots.iter().find(|dots| dots.vlm == name && dots.silent);
    let answering: Vec<Candidate> = candidates.iter().filter(|candidate| silent(&candidate.name).is_none()).cloned().collect();
    let Some(dots) = candidates.first().and_then(|first| silent(&first.name)).filter(|_| answering.is_empty()) else {
        return Ok(answering);
    };
    let error = CliError::failed(format!("{}: {}", dots.vlm, dots.words));
    Err(if ENDPOINT.iter().any(|refusal| dots.words.contains(refusal)) {
        error.hint("`spf sim serve --vlm` answers only about frames of its own camera; try a model, or exec:COMMAND")
    } else {
        error.hint("`spf vlm check` explains a wrong key, model or server; nothing more was sent")
    })
}

fn spent_on(dots: &[DotCheck]) -> f64 {
    dots.iter().filter_map(|dots| dots.account.cost_usd).sum()
}

fn spent_on_echoes(rows: &[EchoRow]) -> f64 {
    rows.iter().filter_map(|row| row.account.cost_usd).sum()
}

impl Trial<'_> {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed) > 0
    }

    /// Sends the calibration dots to those that have not pointed at them.
    fn dots(&self, printer: &Printer) -> Result<Vec<DotCheck>, CliError> {
        let path = self.args.output.join("dots.json");
        let mut all: Vec<DotCheck> =
            std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        for candidate in self.candidates {
            let over = self.max_cost.is_some_and(|most| spent_on(&all) >= most);
            if self.stopped() || over || all.iter().any(|dots| dots.vlm == candidate.name && dots.good) {
                continue;
            }
            all.retain(|dots| dots.vlm != candidate.name);
            // Whoever does not reply to them is not waited for.
            let service = Service::impatient();
            stoppable(&service, self.stop)?;
            let mut vlm = service.guard((candidate.make)(), &Fate::default());
            let check = ask_dots(&mut vlm, self.settings.reply_timeout()?, USUAL_CAMERA);
            if self.stopped() {
                break;
            }
            let words = match &check.verdict {
                Verdict::Good(worst) => format!("good: within {:.1} % of the width", 100.0 * worst),
                Verdict::Other(_) => "points in unexpected coordinates (see `spf vlm check`)".to_owned(),
                Verdict::Astray(worst) => format!("off by {:.0} % of the width", 100.0 * worst),
                Verdict::Unreadable(reason) => format!("not readable: {reason}"),
                Verdict::Failed(error) => format!("no reply: {error}"),
            };
            printer.log(&format!("{}: calibration dots: {words}", candidate.name));
            all.push(DotCheck {
                vlm: candidate.name.clone(),
                good: matches!(check.verdict, Verdict::Good(_)),
                silent: matches!(check.verdict, Verdict::Failed(_)),
                words,
                latencies_s: check.pointed.iter().map(|pointed| pointed.answer.latency.as_secs_f64()).collect(),
                account: check.account,
            });
            write(&path, json(&all)?.as_bytes())?;
        }
        Ok(all)
    }

    /// Asks the pointing questions that are not answered.
    fn questions(&self, spent: f64, printer: &mut Printer) -> Result<(Source, Vec<Answerer>, Vec<AnswerRow>), CliError> {
        let path = self.args.output.join("data");
        generate(&self.dataset(&path), self.stop, printer)?;
        printer.end_live();
        let source = source::open(&path).map_err(|error| CliError::internal("cannot read the questions").because(&error))?;
        let prompt = PromptText::shipped(PromptKind::Point);
        let answerer = |candidate: &Candidate| {
            let (make, service) = (candidate.make.clone(), self.service.clone());
            let guarded: MakeVlm = Arc::new(move || Box::new(service.guard(make(), &Fate::default())));
            Answerer { name: candidate.name.clone(), kind: AnswererKind::Model(guarded, prompt.clone()) }
        };
        let answerers: Vec<Answerer> = self.candidates.iter().map(answerer).collect();
        let head = Head {
            format: FORMAT,
            dataset: "data".into(),
            avoid: false,
            close_up: false,
            seed: self.args.seed,
            questions: format!("{:016x}", source.digest),
            digests: answerers.iter().map(|answerer| (answerer.name.clone(), answerer.kind.digest())).collect(),
        };
        let out = self.args.output.join("pointing");
        let (mut folder, mut rows) = Folder::open(&out, &head, out.exists(), false)?;
        let keys: BTreeSet<&str> = source.items.iter().map(|item| item.key.as_str()).collect();
        let named = |row: &AnswerRow| (row.answerer.clone(), row.item.clone());
        let before: BTreeSet<_> =
            rows.iter().filter(|row| is_answered(row) && keys.contains(row.item.as_str())).map(named).collect();
        let answered: f64 = rows.iter().filter_map(|row| row.account.cost_usd).sum();
        self.service.charge(answered);
        let spent = spent + answered;
        let plan = Questions {
            items: &source.items,
            answerers: &answerers,
            options: AskOptions { avoid: false, close_up: false, time: self.settings.reply_timeout()? },
            parallel: usize::from(self.args.parallel),
            per_minute: None,
            max_cost: self.max_cost,
        };
        let mut done = before.len() as u64;
        printer.start_count("questions", plan.questions() as u64, done);
        let ended: Result<Ended, CliError> = plan.run(&before, spent, self.stop, |row| {
            // What the service failed at is no answer of the model.
            if self.service.is_ended() && !is_answered(&row) {
                return Ok(());
            }
            folder.push(&row)?;
            rows.push(row);
            done += 1;
            printer.count_with(done, &dollars(self.service, None));
            Ok(())
        });
        printer.end_live();
        ended?;
        Ok((source, answerers, rows))
    }

    /// Shows parts of images one after the other to those that have not seen them, with the history that a flight would have.
    fn echoes(&self, source: &Source, spent: f64, printer: &Printer) -> Result<Vec<EchoRow>, CliError> {
        let path = self.args.output.join("echoes.json");
        let mut all: Vec<EchoRow> =
            std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        self.service.charge(spent_on_echoes(&all));
        let (prompt, time) = (PromptText::shipped(PromptKind::Point), self.settings.reply_timeout()?);
        for candidate in self.candidates {
            for shown in echo::shown(&source.items) {
                let is_shown = |row: &EchoRow| row.vlm == candidate.name && row.item == shown.0.key;
                let over = self.max_cost.is_some_and(|most| spent + spent_on_echoes(&all) >= most);
                if self.stopped() || self.service.is_ended() || over || all.iter().any(is_shown) {
                    continue;
                }
                let mut vlm = self.service.guard((candidate.make)(), &Fate::default());
                let rows = echo::ask(&candidate.name, &mut vlm, shown, time, &prompt, &Cancel::default());
                let rows = rows.map_err(|error| CliError::internal("cannot show parts of an image").because(&error))?;
                if self.stopped() || self.service.is_ended() {
                    break;
                }
                all.extend(rows);
                write(&path, json(&all)?.as_bytes())?;
            }
            let own: Vec<EchoRow> = all.iter().filter(|row| row.vlm == candidate.name).cloned().collect();
            let rate = echo::repeated(&own);
            printer.log(&format!("{}: repeats its last point {} of {} times", candidate.name, rate.hits, rate.of));
        }
        Ok(all)
    }

    fn dataset(&self, path: &Path) -> Dataset {
        Dataset {
            scene: SCENES.to_owned(),
            conditions: crate::args::ConditionArgs { light: None, weather: None },
            count: self.args.questions,
            output: path.to_owned(),
            seed: self.args.seed,
            absent: 0.15,
            look_alikes: 0.25,
            // Down to √ = 10 px: small targets are what pointing is about.
            min_pixels: 100,
            size: None,
            drone_model: None,
            camera_effects: None,
            images: "jpeg:90".to_owned(),
            resume: path.join("dataset.json").exists(),
            overwrite: false,
        }
    }

    /// Flies what is not flown, until the limit of the cost.
    fn flights(&self, spent: f64, printer: &mut Printer) -> Result<Vec<Record>, CliError> {
        let folder = self.args.output.join("flights");
        let flights = self.args.flights as usize;
        let there = || read_records(&folder).unwrap_or_default();
        let over = |spent: f64| self.max_cost.is_some_and(|most| spent >= most);
        let unfinished = RunManifest::read(&folder).ok().flatten().map_or(0.0, |made| made.unfinished_usd);
        let before = unfinished + there().iter().filter_map(|record| record.cost_usd).sum::<f64>();
        self.service.charge(before);
        if flights == 0 || self.service.is_ended() || over(spent + before) {
            return Ok(there());
        }
        let method = Method::of_name("spf").ok_or_else(|| CliError::internal("the method spf is missing"))?;
        let plan = Plan {
            tasks: spread(flights)?,
            methods: vec![method],
            pointers: self.candidates.iter().map(|candidate| candidate.pointer.clone()).collect(),
            trials: 1,
            seed: self.args.seed,
            max_cost_usd: None,
            networks: Networks::default(),
        };
        let head = plan.head(Shard::WHOLE, &self.args.names);
        let (jobs, command) = (usize::from(self.args.parallel), self.command());
        let options = RunOptions { jobs, videos: false, command, files: BTreeMap::new(), asked: None };
        let mut begun = false;
        let ended = run_plan(&plan, &head, &folder, &options, self.service, &mut |progress, _| {
            if !core::mem::replace(&mut begun, true) {
                printer.start_count("flights", progress.of as u64, progress.done as u64);
            }
            printer.count_with(progress.done as u64, &dollars(self.service, None));
        });
        printer.end_live();
        ended.map_err(|error| store_error(&error))?;
        Ok(there())
    }

    fn command(&self) -> String {
        let args = self.args;
        let mut words = vec!["spf vlm trial".to_owned(), shell_word(&args.names)];
        words.push(format!("--questions {} --flights {} --seed {}", args.questions, args.flights, args.seed));
        words.extend(args.settings.text("--max-cost").map(|cost| format!("--max-cost {cost}")));
        words.join(" ")
    }

    fn findings(
        &self,
        dots: &[DotCheck],
        source: &Source,
        answerers: &[Answerer],
        (rows, echoes): (&[AnswerRow], &[EchoRow]),
        records: &[Record],
    ) -> Result<Vec<Findings>, CliError> {
        let grades = grades(&source.items, answerers, rows, false)
            .map_err(|error| CliError::internal("cannot evaluate the replies").because(&error))?;
        let report = report(&source.items, answerers, &grades);
        let one = |(number, candidate): (usize, &Candidate)| {
            let own = |record: &&Record| {
                let id = spf_bench::trial::run_id(&record.task, &record.method, &candidate.name, self.args.seed);
                record.run_id == id
            };
            let dots = dots.iter().find(|dots| dots.vlm == candidate.name).cloned();
            let measures: Measures = report.measures[number].clone();
            let records = records.iter().filter(own).cloned().collect();
            Findings::of(&candidate.name, dots, &source.items, measures, &grades.by_answerer[number], echoes, records)
        };
        Ok(self.candidates.iter().enumerate().map(one).collect())
    }

    /// Writes the page and its figures, and prints the most important ones.
    fn report(&self, findings: &[Findings], printer: &Printer) -> Result<(), CliError> {
        let latency = self.candidates.iter().find_map(|candidate| Some((candidate, candidate.pointer.latency?)));
        let latency = latency.map(|(candidate, seconds)| {
            format!("In flights with {}, every reply is assumed to take {seconds} s.", candidate.name)
        });
        let questions = format!(
            "{} pointing questions about images of the scenes {} from the simulator, and {} flights of the paper suite in it, one for each of several \
             tasks spread over the suite. No image is of the real world.",
            self.args.questions,
            SCENES.replace(',', " and "),
            self.args.flights
        );
        let notes: Vec<String> = std::iter::once(questions).chain(latency).collect();
        let out = self.args.output.join("index.html");
        write(&out, page(findings, &self.command(), &notes).as_bytes())?;
        write(&self.args.output.join("trial.json"), json(&findings)?.as_bytes())?;
        let head = ["VLM", "DOTS", "HITS", "ECHO", "UNREADABLE", "DONE AT GOAL", "FALSE DONE", "P50 S", "COST $"];
        let head = head.map(str::to_owned).to_vec();
        let row = |found: &Findings| {
            let hits = found.pointing.hits.map_or("–".to_owned(), |hits| format!("{:.0} %", 100.0 * hits.value));
            let rate = |rate: spf_bench::stats::Rate| format!("{} of {}", rate.hits, rate.of);
            let latency = found.pointing.latency_p50_s.map_or("–".to_owned(), |latency| format!("{:.2}", latency.value));
            vec![
                found.vlm.clone(),
                found.dots.as_ref().map_or("–", |dots| if dots.good { "good" } else { "BAD" }).to_owned(),
                hits,
                rate(found.echo),
                found.pointing.unreadable.to_string(),
                rate(found.flights.strict),
                rate(found.flights.false_done),
                latency,
                found.cost_usd().map_or("?".to_owned(), |cost| format!("{cost:.4}")),
            ]
        };
        printer.result(&columns(&std::iter::once(head).chain(findings.iter().map(row)).collect::<Vec<_>>()));
        printer.result(&out.display().to_string());
        Ok(())
    }
}

/// So many tasks of the paper suite, evenly spread over it.
fn spread(count: usize) -> Result<Vec<Arc<Task>>, CliError> {
    let invalid = || CliError::internal("invalid built-in task");
    let tasks = suite("paper").ok_or_else(invalid)?.tasks().map_err(|error| invalid().because(&error))?;
    let number = tasks.len();
    Ok((0..count.min(number)).map(|index| tasks[index * number / count.min(number)].clone()).collect())
}

fn json(value: &impl serde::Serialize) -> Result<String, CliError> {
    let text = serde_json::to_string_pretty(value).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
    Ok(format!("{text}\n"))
}
