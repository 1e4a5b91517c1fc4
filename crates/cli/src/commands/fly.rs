//! `spf fly`: creates a flight from settings, and reports its result and exit code.

mod aboard;
#[cfg(all(debug_assertions, unix))]
mod drill;
mod manual;
pub(crate) mod opening;
pub(crate) mod page;
pub(crate) mod real;
pub(crate) mod refusal;
mod said;
pub(crate) mod settings;
pub(crate) mod signals;
mod simulated;

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::channel;

#[cfg(feature = "mcp")]
pub(crate) use spf_api::flight::not_started as flight_error;
use spf_api::flight::{checked_instruction, not_started, out_dir};
use spf_api::reading::{Given, Reader};
use spf_bench::run::shell_word;
use spf_cockpit::{Cockpit, ReadInstruction};
use spf_core::craft::Craft;
use spf_drone::frames::Frames;
use spf_envelope::Cause;
use spf_flight::flight::FlightPlan;
use spf_flight::frame_age::GlassToDecision;
use spf_flight::keys::HELP;
use spf_flight::recorder::RecordPlan;
use spf_flight::run::Observer;
use spf_flight::summary::{Summary, Touch, VerifiedBy, in_seconds};
use spf_flight::words;
use spf_pilot::Outcome;
use spf_record::live::Live;
use spf_scene::SceneLook;

use self::manual::Manual;
use crate::args::Fly;
use crate::background::PrintThread;
use crate::commands::load_scene;
use crate::commands::vlm::{console, is_human};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, quoted};
use crate::progress::{Control, Progress};
use crate::settings::{DroneName, Settings};

/// Flies an instruction.
pub(crate) fn fly(args: &Fly, printer: Printer) -> Result<Exit, CliError> {
    let settings = Settings::of(&args.flight.settings, &printer)?;
    let address = settings.fly.cockpit.get()?;
    let cockpit = address.map(|address| page::open(address, Path::new(page::FLIGHTS), "", &printer)).transpose()?;
    flight(args, settings, cockpit.as_ref(), printer)
}

/// Flies an instruction with these settings; a cockpit shows and controls the flight.
pub(crate) fn flight(args: &Fly, mut settings: Settings, cockpit: Option<&Cockpit>, printer: Printer) -> Result<Exit, CliError> {
    let instruction = checked_instruction(&args.instruction)?;
    let ready = opening::ready(args, &mut settings, instruction, Others::cockpit(cockpit), &printer)?;
    take_off(ready, &settings, cockpit, printer)
}

/// How the settings' VLM reads an instruction before a flight: what was understood, or why nothing was; and what waits for one.
pub(crate) fn instruction_reader(settings: &Settings) -> Result<(ReadInstruction, String), CliError> {
    let is_sim = matches!(settings.fly.drone.or_default()?, DroneName::Sim);
    let vlm = settings.fly.vlm.text_or_default();
    let conditions = SceneLook { lighting: settings.fly.light.get()?, weather: settings.fly.weather.get()? };
    let scene = settings.fly.scene.text_or_default();
    let loaded = is_sim.then(|| load_scene(scene, &conditions).map(Arc::new)).transpose()?;
    let about = loaded.as_ref().map_or_else(
        // Without its address, which is not for spectators.
        || format!("drone {}", settings.fly.drone.text_or_default().split([':', '@', '#']).next().unwrap_or_default()),
        |loaded| format!("simulated craft in {}", loaded.scene.name),
    );
    let start = settings.fly.start.get()?;
    let is_oracle = vlm == "oracle" || vlm.starts_with("oracle:");
    let reader = loaded.filter(|_| is_oracle).map_or_else(Reader::of_model, |loaded| Reader::of_oracle(&loaded, start));
    Ok((page::read_by(reader), about))
}

/// Who watches and controls a flight besides the terminal.
#[derive(Clone, Copy, Default)]
pub(crate) struct Others<'a> {
    pub(crate) cockpit: Option<&'a Cockpit>,
    pub(crate) assistant: Option<Assistant<'a>>,
}

/// An assistant that calls tools.
#[derive(Clone, Copy)]
pub(crate) struct Assistant<'a> {
    /// Where it points.
    pub(crate) pointing: &'a Arc<spf_flight::pointing::Pointing>,
    /// Whether it has given an instruction; else it points.
    pub(crate) has_instructed: bool,
}

impl<'a> Others<'a> {
    fn cockpit(cockpit: Option<&'a Cockpit>) -> Self {
        Self { cockpit, ..Self::default() }
    }

    fn is_any(self) -> bool {
        self.cockpit.is_some() || self.assistant.is_some()
    }

    /// Whether somebody points, and no instruction was given.
    fn points(self) -> bool {
        self.assistant.is_some_and(|assistant| !assistant.has_instructed)
    }

    /// How an instruction was given; `None` if there is none to be read.
    fn given(self, realtime: bool) -> Option<Given> {
        match self.assistant {
            Some(assistant) => assistant.has_instructed.then_some(Given::ByAssistant),
            None => Some(Given::for_flight(self.cockpit.is_some(), realtime)),
        }
    }
}

/// A prepared flight.
pub(crate) struct Ready {
    /// The plan, without recording and operator.
    pub(crate) plan: FlightPlan,
    /// Messages before take-off.
    pub(crate) announcements: Vec<String>,
    /// The craft for manual flight; `None` in virtual time.
    pub(crate) by_hand: Option<Craft>,
    /// Checks the instructions given in flight.
    pub(crate) reader: Reader,
    /// Whether take-off requires an operator at the keys.
    attended: bool,
    /// The camera whose video statistics are reported at the end.
    camera: Option<Arc<dyn Frames>>,
}

/// Flies, reports the result, and writes the files.
fn take_off(ready: Ready, settings: &Settings, cockpit: Option<&Cockpit>, mut printer: Printer) -> Result<Exit, CliError> {
    let Ready { plan, announcements, by_hand, reader, attended, camera } = ready;
    // A flight on the wall clock never waits for a terminal.
    let paced = by_hand.is_some();
    let view = settings.fly.live.get()?.map(|address| live_view(address, settings.fly.live_origin.get()?)).transpose()?;
    let out = out_dir(settings.fly.out.text().map(Path::new), &plan.instruction)?;
    // Who types answers types no keys: standard input is read by lines, orders to the drone included.
    let typing = is_human(&plan.vlm) && cockpit.is_none();
    let unattended = settings.fly.unattended.is_on()?;
    if let Some(cockpit) = cockpit
        && !page::wait_for_pilot(cockpit, &plan.interrupts, &printer)
    {
        out.give_back();
        return Err(CliError::aborted("ended before take-off: nobody opened the page"));
    }
    let (send, inputs) = channel();
    let manual = match by_hand {
        Some(craft) if !typing && !unattended => Manual::start(craft, reader.clone(), send.clone()),
        _ => Manual::none(),
    };
    if let (Some(cockpit), Some(craft)) = (cockpit, by_hand) {
        cockpit.begin(page::controls(send, craft, reader, !manual.is_on()));
    }
    let somebody = manual.is_on() || cockpit.is_some();
    let operator = if typing { console() } else { somebody.then_some(inputs) };
    if attended && !manual.is_on() && !typing && cockpit.is_none() {
        out.give_back();
        return Err(no_keys());
    }
    let record = RecordPlan { out: out.clone(), video: settings.fly.video.is_on()?, view: view.as_ref().map(Live::sender) };
    let plan = FlightPlan { record: Some(record), operator, ..plan };
    printer.start_live();
    announcements.iter().for_each(|line| printer.log(line));
    if let Some(view) = &view {
        print_live_address(view, &printer);
    }
    if manual.is_on() {
        printer.log(HELP);
    }
    let (talk, lines) = PrintThread::start(printer, paced);
    let control = match manual.is_on() {
        true => Control::Keys,
        false if typing => Control::Lines,
        false => Control::None,
    };
    let mut progress = Progress::new(lines, control);
    let mut instruments = cockpit.map(Cockpit::instruments);
    let mut observers: Vec<&mut dyn Observer> = vec![&mut progress];
    if let Some(instruments) = &mut instruments {
        observers.push(instruments);
    }
    let flown = spf_flight::flight::fly(plan, &mut observers);
    drop(manual);
    drop(progress);
    let mut printer = talk.finish();
    printer.end_live();
    let flown = flown.map_err(|error| {
        out.give_back();
        not_started(&error)
    })?;
    for problem in &flown.recording_problems {
        printer.log(&format!("warning: recording failed: {problem}"));
    }
    if let Some(camera) = camera {
        let tally = camera.tally();
        printer.log(&format!(
            "video: {} frames decoded, {} gaps, {} skipped until a key frame, {} rejected, {} unusable, \
             {} superseded by newer ones",
            tally.decoded, tally.video.gaps, tally.video.skipped, tally.refused, tally.unusable, tally.superseded
        ));
    }
    if let Some(cockpit) = cockpit {
        cockpit.end(&page::end(&flown, result(&flown.summary), out.path()));
    }
    report(&flown.summary, out.path(), &printer);
    let exit = Exit::of(flown.summary.outcome, flown.summary.verified);
    // A script that reads the files must not mistake them for complete.
    Ok(if exit == Exit::Success && !flown.recording_problems.is_empty() { Exit::Internal } else { exit })
}

/// Why a real drone does not take off without an operator.
fn no_keys() -> CliError {
    CliError::usage("take-off refused: no terminal, so no keyboard control of the drone").hint(
        "run the command in a terminal (not through a pipe), or pass --unattended: then only Ctrl-C, SIGTERM and the safety envelope \
         land the drone",
    )
}

/// Starts the live view, if requested.
fn live_view(address: SocketAddr, origin: Option<String>) -> Result<Live, CliError> {
    let origins: Vec<String> = origin.into_iter().collect();
    Live::bind(address, "spf", spf_flight::log::topics(), &origins).map_err(|error| {
        CliError::usage(format!("cannot start the live view on {address}"))
            .because(&error)
            .hint("--live=127.0.0.1:0 picks a free port")
    })
}

fn print_live_address(view: &Live, printer: &Printer) {
    let address = view.address();
    printer.log(&format!("Live view: open a Foxglove WebSocket connection to ws://{address}"));
    if !address.ip().is_loopback() {
        printer.log("warning: anyone who can reach this address can watch the flight");
    }
}

fn report(summary: &Summary, out_dir: &Path, printer: &Printer) {
    if printer.is_json() {
        // The summary, and the folder of the files.
        let mut printed = in_seconds(summary);
        printed["out_dir"] = out_dir.display().to_string().into();
        printer.data(&printed.to_string());
        return;
    }
    result(summary).iter().for_each(|line| printer.result(line));
    printer.result(&format!("files: {}", out_dir.display()));
    hints(summary).iter().for_each(|hint| printer.log(hint));
}

/// What may help where a flight did not end as wished.
fn hints(summary: &Summary) -> Vec<String> {
    let mut hints = Vec::new();
    let settings = &summary.settings;
    // A real flight has neither scene nor ground truth.
    let is_simulated = !summary.scene.is_empty();
    if summary.collisions > Some(0) && is_simulated && !settings.method.measures_view() {
        let sensor =
            "hint: `--depth-sensor on` lets the simulated craft see obstacles and fly around them (docs/guide/obstacles.md)";
        hints.push(sensor.to_owned());
    }
    if summary.targets.is_empty() && is_simulated && names_a_target(&summary.instruction) {
        let none = "hint: the simulator found no target for this instruction in the scene; `spf sim scenes NAME --objects` lists its objects";
        hints.push(none.to_owned());
    }
    if summary.outcome == Outcome::Timeout && summary.is_at_target() {
        let near = "hint: `near_m` of [fly] (SPF_NEAR_M) sets from which distance the VLM is told to say done";
        hints.push(near.to_owned());
    }
    let follows = summary.followed.is_some() && settings.follow_time.is_none();
    match summary.outcome {
        Outcome::Timeout if follows => {
            let time = "hint: following ends by a limit alone; `--follow-time 30` ends it as reached (docs/guide/track.md)";
            hints.push(time.to_owned());
        }
        Outcome::Timeout if summary.cause.contains(" decisions was reached") => {
            hints.push(format!("hint: `--max-decisions {}` permits more decisions", settings.max_decisions.saturating_mul(3)));
        }
        Outcome::Timeout if summary.cause.contains(" decisions without progress was reached") => {
            let more = settings.max_decisions.saturating_mul(3);
            hints.push(format!("hint: `--max-decisions {more}` permits more answers that lead nowhere new (docs/guide/fly.md)"));
        }
        Outcome::Timeout if summary.cause.contains(" queries was reached") => {
            let more = settings.max_queries.unwrap_or_default().saturating_mul(3);
            hints.push(format!("hint: `--max-queries {more}` permits more queries"));
        }
        Outcome::Aborted if summary.cause.contains(" refused the motion of ") => hints.extend(widened(&summary.cause)),
        Outcome::Timeout => {
            let seconds = 3.0 * settings.max_time.as_secs_f64();
            hints.push(format!("hint: `--max-time {seconds:.0}` permits a longer flight"));
        }
        Outcome::Failed if summary.cause.contains(&Cause::FailedReplies.to_string()) && is_model(&summary.vlm) => {
            // A program's name is a command with its arguments.
            let name = shell_word(&summary.vlm);
            hints.push(format!("hint: `spf vlm check {name}` sends the model some test images, and says what is wrong"));
        }
        Outcome::Reached if summary.verified == Some(false) && errs_on_purpose(&summary.vlm) => hints.push(
            "hint: this stand-in for a model errs on purpose, as models do; `--vlm oracle:perfect` does not (docs/explanation/oracle.md)"
                .to_owned(),
        ),
        _ => {}
    }
    hints
}

/// Whether the last step goes to something: "turn around" has no target that a scene could lack.
fn names_a_target(instruction: &str) -> bool {
    let read = spf_oracle::language::parse(instruction, &BTreeSet::new());
    read.clauses.last().is_none_or(|step| !step.target.is_empty())
}

/// How the limit that refused the motion may be widened.
fn widened(cause: &str) -> Option<String> {
    let flags = [
        ("the maximum height", "`--max-altitude M` sets another maximum height"),
        ("the maximum distance", "`--max-distance M` sets another maximum distance"),
        ("the geofence", "draw a wider `--geofence`"),
    ];
    let (_, how) = flags.into_iter().find(|(limit, _)| cause.starts_with(limit))?;
    Some(format!("hint: if it is safe to fly farther, {how}; else start nearer to the target, or name another"))
}

/// Whether this is a model, or a program that stands for one.
fn is_model(vlm: &str) -> bool {
    !vlm.starts_with("oracle") && !is_human(vlm)
}

/// Whether this is an oracle with errors.
fn errs_on_purpose(vlm: &str) -> bool {
    vlm.starts_with("oracle") && vlm != "oracle:perfect"
}

/// The result of a flight in words.
pub(crate) fn result(summary: &Summary) -> Vec<String> {
    // The verdict is about a reported arrival; for a flight that gave up or was ended it would be meaningless.
    let is_reached = summary.outcome == Outcome::Reached;
    let by = match summary.verified_by {
        Some(VerifiedBy::Task) => "by ground truth",
        _ => "by the oracle's reading of your words",
    };
    let verified = match summary.verified.filter(|_| is_reached) {
        Some(true) => format!(", verified {by}"),
        Some(false) => format!(", NOT verified {by}"),
        // What a simulator could check, it does not; a real flight has nobody to check it.
        None if is_reached && !summary.scene.is_empty() && summary.followed.is_none() => {
            ", NOT checked (only whether a flight ends at its target is)".to_owned()
        }
        None => String::new(),
    };
    let except = match summary.outcome {
        Outcome::Reached if !summary.not_read.is_empty() => {
            let were = if summary.not_read.len() == 1 { "was" } else { "were" };
            format!(", except {}, which {were} not understood", quoted(&summary.not_read))
        }
        _ => String::new(),
    };
    let mut lines = vec![format!("{}{verified}: {}{except}", words::outcome(summary.outcome), summary.cause)];
    if let Some(followed) = &summary.followed {
        lines.push(followed.words());
    }
    let time = summary.completion_time_s.map_or("no motion".to_owned(), |time| format!("{time:.1} s from first motion"));
    // Past an opening or around something a flight does not end at its target.
    let distance = summary.final_distance_m.filter(|_| !is_reached || summary.verified.is_some());
    let distance = distance.map_or(String::new(), |metres| format!(", {metres:.1} m from the target's surface"));
    let touched: Vec<String> = summary.touched.iter().map(Touch::words).collect();
    let touched = if touched.is_empty() { String::new() } else { format!(" (with {})", touched.join(", ")) };
    lines.push(format!(
        "{time}, {:.1} m flown, {}, {}{touched}{distance}",
        summary.path_length_m,
        words::counted(summary.decisions, "decision"),
        summary.collisions.map_or_else(|| "contacts unknown".to_owned(), |number| words::counted(number, "collision")),
    ));
    if let Some(GlassToDecision { median_s, worst_s }) = summary.glass_to_decision {
        lines.push(format!("frame-to-decision latency: median {median_s:.2} s, worst {worst_s:.2} s"));
    }
    if let Some(used) = &summary.vlm_use {
        lines.push(words::vlm_use(used));
    }
    lines
}
