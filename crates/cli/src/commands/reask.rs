//! `spf replay --vlm`: sends the queries of a flight to another model.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use spf_flight::log::FlightHeader;
use spf_flight::reask::{Asker, Pointed, Question, ReplyPair, Responder, questions};
use spf_media::jpeg::Jpeg;
use spf_record::log::LogReader;
use spf_scene::{Lighting, SceneLook, Weather};

use super::load_scene;
use super::log::{unreadable, unreplayable};
use super::vlm::{Pace, oracle_named, pointing};
use crate::args::Replay;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// Quality of the images: captions stay sharp.
const QUALITY: u8 = 90;

/// The output of `--json`.
#[derive(Serialize)]
struct Printed<'a> {
    flight: &'a str,
    now: &'a str,
    opinions: &'a [ReplyPair],
}

/// Sends the queries and compares the replies.
pub(super) fn reask(args: &Replay, vlm: &str, printer: &Printer) -> Result<Exit, CliError> {
    let reader = LogReader::open(&args.file).map_err(|error| unreadable(&args.file, &error))?;
    let (head, questions) = questions(reader).map_err(|error| unreplayable(&args.file, &error))?;
    let settings = Settings::of(&args.settings, printer)?;
    let (name, responder) = responder(&settings, vlm)?;
    let mut asker = stage_of(&head).and_then(|loaded| {
        Asker::new(&head, Arc::new(loaded), &name, responder)
            .map_err(|error| CliError::usage("cannot query a VLM about this flight").because(&error))
    })?;
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out)
            .map_err(|error| CliError::usage(format!("cannot use the folder `{}`", out.display())).because(&error))?;
    }
    let mut opinions = Vec::new();
    for question in &questions {
        let opinion = asker.ask(question);
        if let Some(out) = &args.out {
            write_image(out, &asker, question, &opinion, &head.vlm)?;
        }
        if !args.json {
            printer.result(&line(&opinion));
        }
        opinions.push(opinion);
    }
    let printed = Printed { flight: &head.vlm, now: &name, opinions: &opinions };
    if args.json {
        let text = serde_json::to_string(&printed).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
        printer.data(&text);
    } else {
        printer.result(&summary(&printed));
    }
    Ok(Exit::Success)
}

/// The model that is queried.
fn responder(settings: &Settings, vlm: &str) -> Result<(String, Responder), CliError> {
    if vlm == "oracle" || vlm.starts_with("oracle:") {
        let (name, errors) = oracle_named(vlm, |expected, near| settings.fly.vlm.wrong(expected, near))?;
        return Ok((name, Responder::Oracle(Box::new(errors))));
    }
    if vlm.starts_with("replay:") {
        return Err(CliError::usage(format!("`{vlm}` can only replay its own flight")).hint("for example oracle:poor or gemini"));
    }
    let pointing = pointing(settings, None, Pace::None)?;
    Ok((pointing.name, Responder::Other(pointing.vlm_factory)))
}

fn stage_of(head: &FlightHeader) -> Result<spf_flight::sim::LoadedScene, CliError> {
    let Some(sim) = &head.sim else {
        return Err(CliError::usage("the flight was not simulated").hint("its camera frames cannot be rendered again"));
    };
    let lighting = Lighting::ALL.into_iter().find(|light| light.name() == sim.light);
    let weather = Weather::ALL.into_iter().find(|weather| weather.name() == sim.weather);
    load_scene(&sim.scene, &SceneLook { lighting, weather })
}

fn write_image(out: &Path, asker: &Asker, question: &Question, opinion: &ReplyPair, then: &str) -> Result<(), CliError> {
    let image = asker.image(question, opinion, then);
    let path = out.join(format!("{:04}.jpg", opinion.query.0));
    let jpeg = Jpeg::encode(&image, QUALITY).map_err(|error| CliError::internal("cannot render the image").because(&error))?;
    std::fs::write(&path, jpeg.bytes())
        .map_err(|error| CliError::internal(format!("cannot write `{}`", path.display())).because(&error))
}

fn line(opinion: &ReplyPair) -> String {
    let words = |pointed: &Option<Pointed>, none: &str| pointed.as_ref().map_or(none.to_owned(), Pointed::words);
    let apart = opinion.apart.map_or(String::new(), |apart| format!("; {:.1} % apart", 100.0 * apart));
    let failed = opinion.failed.as_deref().unwrap_or("no reply");
    let (then, now) = (words(&opinion.then, "no reply in time"), words(&opinion.now, failed));
    format!("query {:>3}, frame {:>5}: {then} | {now}{apart}", opinion.query.0, opinion.frame)
}

fn summary(printed: &Printed<'_>) -> String {
    let Printed { flight, now, opinions } = printed;
    let mut apart: Vec<f64> = opinions.iter().filter_map(|opinion| opinion.apart).collect();
    apart.sort_by(f64::total_cmp);
    let median = apart
        .get(apart.len() / 2)
        .map_or(String::new(), |median| format!(" ({:.1} % of the image width apart, median)", 100.0 * median));
    let answers = opinions.iter().filter_map(|opinion| opinion.then.as_ref().zip(opinion.now.as_ref()));
    let same_label = answers.clone().filter(|(a, b)| a.point.is_some() && b.point.is_some() && a.depth == b.depth).count();
    let same = answers.filter(|(a, b)| a.status == b.status).count();
    let failed = opinions.iter().filter(|opinion| opinion.failed.is_some()).count();
    let failed = if failed > 0 { format!(" ({failed} without a reply)") } else { String::new() };
    let costs: Vec<f64> = opinions.iter().filter_map(|opinion| opinion.cost_usd).collect();
    let cost = if costs.is_empty() { String::new() } else { format!("; ${:.4}", costs.iter().sum::<f64>()) };
    format!(
        "{flight} | {now}: {} queries{failed}; same status in {same}, a point from both in {}{median}, same depth label in \
         {same_label}{cost}",
        opinions.len(),
        apart.len(),
    )
}
