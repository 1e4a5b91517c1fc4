//! `spf bench show`: repeats one trial and records its files.

use std::path::Path;
use std::sync::Arc;

use spf_api::bench::task_of;
use spf_bench::measures::Navigation;
use spf_bench::trial::{Method, Trial, draw, run_id};
use spf_flight::recorder::RecordPlan;
use spf_oracle::ErrorFile;
use spf_record::out_dir::OutDir;

use super::{foreign, networks, pointer};
use crate::args::BenchShow;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// Flies a trial again, or shows the task of a file.
pub(super) fn show(args: &BenchShow, printer: &Printer) -> Result<Exit, CliError> {
    if foreign::is_file(&args.run_id) {
        return foreign::show(args, printer);
    }
    let mut settings = Settings::of(&args.settings, printer)?;
    let trial = trial(args, &mut settings)?;
    let drawn = draw(&trial.task, trial.seed).map_err(|error| CliError::usage("cannot set up the trial").because(&error))?;
    let out = OutDir::create(args.output.as_deref(), &args.run_id).map_err(|error| {
        CliError::usage("cannot create the output folder").because(&error).hint("give a new or empty folder with -o DIR")
    })?;
    printer.log(&format!("Flying {} in {}: \"{}\"", args.run_id, drawn.scene, trial.task.instruction));
    let record = trial.fly(&drawn, Some(RecordPlan { out: out.clone(), video: !args.no_video, view: None })).record;
    if let Some(why) = &record.error {
        return Err(CliError::internal(format!("cannot fly the trial: {why}")));
    }
    let scores = &record.scores;
    let yes = |is: bool| if is { "yes" } else { "no" };
    printer.result(&format!("strict {}, paper {}", yes(scores.strict), yes(scores.paper)));
    printer.result(&format!("goals met {} of {}, collided {}", record.goals_met, record.goals, yes(scores.collided)));
    if let Some(navigation) = record.navigation() {
        printer.result(&measures(&navigation));
    }
    if let Some(flight) = &record.flight {
        printer.result(&format!("{}: {}", spf_flight::words::outcome(flight.outcome), flight.cause));
    }
    printer.result(&out.path().display().to_string());
    Ok(Exit::Success)
}

/// The measures of navigation that the lines above do not say: SR is `strict`, CR is `collided`.
fn measures(navigation: &Navigation) -> String {
    let Navigation { success: _, oracle_success, error_m, spl, ndtw, sdtw, collided: _ } = navigation;
    let within = if *oracle_success { "yes" } else { "no" };
    let error = error_m.map_or_else(String::new, |metres| format!(", NE {metres:.1} m"));
    format!("OSR {within}{error}, SPL {spl:.2}, nDTW {ndtw:.2}, SDTW {sdtw:.2}")
}

fn trial(args: &BenchShow, settings: &mut Settings) -> Result<Trial, CliError> {
    let wrong = || {
        CliError::usage(format!("`{}` is not the name of a trial", args.run_id))
            .hint("use task/method/vlm/seed, the `run_id` of its row in results.jsonl")
    };
    let parts: Vec<&str> = args.run_id.split('/').collect();
    let [task, method, vlm, seed] = parts.try_into().map_err(|_| wrong())?;
    let seed: u64 = seed.parse().map_err(|_| wrong())?;
    let method = Method::of_name(method).ok_or_else(wrong)?;
    let task = Arc::new(task_of(args.task.as_deref().unwrap_or(task))?);
    let pointer = if method.uses_vlm() { Some(pointer(settings, &name_of(args, vlm)?)?) } else { None };
    let trial = Trial { task, method, pointer, seed, max_cost_usd: None, networks: networks(settings, &args.settings)? };
    if trial.run_id() == args.run_id {
        return Ok(trial);
    }
    Err(CliError::usage(format!("these options give the trial {}, not {}", trial.run_id(), args.run_id)).hint(
        "use the same \
        --task, --vlm, --detector and --depth-model as in the run",
    ))
}

/// The VLM: the given name, or the built-in oracle with the name in the trial's name.
fn name_of(args: &BenchShow, part: &str) -> Result<String, CliError> {
    if let Some(name) = &args.vlm {
        return Ok(name.clone());
    }
    // The last part may be a fixed latency.
    let latency = part.rsplit_once('-').map(|(_, seconds)| format!("@{seconds}"));
    // `oracle:gullible@0.5`: the probability follows the name.
    for kind in ["gullible-frame", "gullible-quoted", "gullible"] {
        if let Some(chance) = part.strip_prefix(&format!("oracle-{kind}-")) {
            let (chance, latency) = chance.split_once('-').map_or((chance, None), |(chance, latency)| (chance, Some(latency)));
            let latency = latency.map_or(String::new(), |latency| format!("@{latency}"));
            return Ok(format!("oracle:{kind}@{chance}{latency}"));
        }
    }
    let shipped = ErrorFile::shipped().into_iter().map(|name| format!("oracle:{name}")).chain(["oracle".to_owned()]);
    let mut oracles = shipped.flat_map(|name| [Some(name.clone()), latency.as_ref().map(|latency| name + latency)]).flatten();
    let same = |name: &String| run_id("", "", name, 0) == run_id("", "", part, 0);
    let found = oracles.find(same);
    found.ok_or_else(|| {
        CliError::usage(format!("unknown VLM: `{part}` is not a built-in oracle"))
            .hint(format!("add --vlm: spf bench show {} --vlm NAME", Path::new(&args.run_id).display()))
    })
}
