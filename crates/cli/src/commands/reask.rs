//! `spf replay --vlm`: another mind about the frames of a flight.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use spf_flight::log::Head;
use spf_flight::reask::{Asker, Opinion, Question, questions};
use spf_media::jpeg::Jpeg;
use spf_record::log::LogReader;
use spf_sim::scene::{Conditions, Lighting, Weather};

use super::load_stage;
use super::log::unreadable;
use super::replay::unreplayable;
use super::vlm::oracle_named;
use crate::args::Replay;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Quality of the pictures: captions stay sharp.
const QUALITY: u8 = 90;

/// What `--json` prints.
#[derive(Serialize)]
struct Printed<'a> {
    flight: &'a str,
    now: &'a str,
    opinions: &'a [Opinion],
}

/// Asks, and tells where the two point.
pub(super) fn reask(args: &Replay, vlm: &str, printer: &Printer) -> Result<Exit, CliError> {
    let reader = LogReader::open(&args.file).map_err(|error| unreadable(&args.file, &error))?;
    let (head, questions) = questions(reader).map_err(|error| unreplayable(&args.file, &error))?;
    let (name, errors) = oracle_named(vlm, |expected, near| {
        let error = CliError::usage(format!("--vlm: `{vlm}` is not {expected}"));
        match near {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error.hint("oracle:poor, for example (docs/oracle.md)"),
        }
    })?;
    let asker = stage_of(&head).and_then(|stage| {
        Asker::new(&head, Arc::new(stage), &name, errors)
            .map_err(|error| CliError::usage("nobody can be asked about this flight").because(&error))
    })?;
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out)
            .map_err(|error| CliError::usage(format!("cannot use the folder `{}`", out.display())).because(&error))?;
    }
    let mut opinions = Vec::new();
    for question in &questions {
        let opinion = asker.ask(question);
        if let Some(out) = &args.out {
            write_picture(out, &asker, question, &opinion, &head.vlm)?;
        }
        if !args.json {
            printer.result(&line(&opinion));
        }
        opinions.push(opinion);
    }
    let printed = Printed { flight: &head.vlm, now: &name, opinions: &opinions };
    if args.json {
        let text = serde_json::to_string(&printed).map_err(|error| CliError::internal("no JSON can be made").because(&error))?;
        printer.data(&text);
    } else {
        printer.result(&summary(&printed));
    }
    Ok(Exit::Success)
}

fn stage_of(head: &Head) -> Result<spf_flight::sim::Stage, CliError> {
    let Some(sim) = &head.sim else {
        return Err(CliError::usage("the flight was not flown in the simulator").hint("only the oracle can be asked as yet"));
    };
    let lighting = Lighting::ALL.into_iter().find(|light| light.name() == sim.light);
    let weather = Weather::ALL.into_iter().find(|weather| weather.name() == sim.weather);
    load_stage(&sim.scene, &Conditions { lighting, weather })
}

fn write_picture(out: &Path, asker: &Asker, question: &Question, opinion: &Opinion, then: &str) -> Result<(), CliError> {
    let picture = asker.picture(question, opinion, then);
    let path = out.join(format!("{:04}.jpg", opinion.query.0));
    let jpeg = Jpeg::encode(&picture, QUALITY).map_err(|error| CliError::internal("no picture can be made").because(&error))?;
    std::fs::write(&path, jpeg.bytes())
        .map_err(|error| CliError::internal(format!("cannot write `{}`", path.display())).because(&error))
}

fn line(opinion: &Opinion) -> String {
    let words =
        |pointed: &Option<spf_flight::reask::Pointed>| pointed.as_ref().map_or("nothing in time".to_owned(), |p| p.words());
    let apart = opinion.apart.map_or(String::new(), |apart| format!("; {:.1} % apart", 100.0 * apart));
    let (then, now) = (words(&opinion.then), words(&opinion.now));
    format!("query {:>3}, frame {:>5}: {then} | {now}{apart}", opinion.query.0, opinion.frame)
}

fn summary(printed: &Printed<'_>) -> String {
    let Printed { flight, now, opinions } = printed;
    let mut apart: Vec<f64> = opinions.iter().filter_map(|opinion| opinion.apart).collect();
    apart.sort_by(f64::total_cmp);
    let median = apart
        .get(apart.len() / 2)
        .map_or(String::new(), |median| format!(", {:.1} % of the width apart (median)", 100.0 * median));
    let answers = opinions.iter().filter_map(|opinion| opinion.then.as_ref().zip(opinion.now.as_ref()));
    let same_label = answers.clone().filter(|(a, b)| a.point.is_some() && b.point.is_some() && a.depth == b.depth).count();
    let same = answers.filter(|(a, b)| a.status == b.status).count();
    format!(
        "{flight} | {now}: {} questions, the same status in {same}; both point in {}{median}, the same depth label in {same_label}",
        opinions.len(),
        apart.len(),
    )
}
