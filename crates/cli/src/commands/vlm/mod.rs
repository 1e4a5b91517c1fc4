//! Creates the VLM: the oracle, a vision-language model of the table, or a recording of one.

mod check;
mod estimate;
mod list;
mod own;
mod served;
mod trial;

use std::path::Path;
use std::sync::Arc;

pub(crate) use spf_api::vlm::{LATENCY_S, oracle_named};
use spf_api::vlm::{not_replayed, price_unknown};
use spf_bench::trial::split_latency;
use spf_core::camera::Camera;
use spf_core::prompt::PromptText;
use spf_core::time::Duration;
use spf_flight::sim::{SimWorld, VlmFactory, oracle_factory};
use spf_oracle::{ErrorFile, Obedience, Per};
use spf_vlm::cassette::{Recording, Replay};
use spf_vlm::exec::Exec;
use spf_vlm::human::HUMAN;
use spf_vlm::setup::{self, AUTO, Access, Name, SetupError};
use spf_vlm::table::Table;
use spf_vlm::{Remote, RequestOptions, Vlm, today};

pub(crate) use check::{advice, check};
pub(crate) use estimate::{Estimate, agreed};
pub(crate) use list::list;
pub(crate) use own::{Pace, console, exec, is_human, listed, paced};
pub(crate) use served::{dollars, failure, service};
pub(crate) use trial::trial;

use crate::commands::read;
use crate::error::CliError;
use crate::settings::{Row, Settings, environment, variables};

/// The VLM of a flight.
#[derive(Clone)]
pub(crate) struct Pointing {
    /// The name as given.
    pub(crate) name: String,
    /// Creates it.
    pub(crate) vlm_factory: VlmFactory,
    /// Whether it is the oracle, whose reading of an instruction is known before the flight.
    pub(crate) is_oracle: bool,
    /// A sentence about it for the user.
    pub(crate) sentence: String,
    /// Its latency in virtual time, if it is fixed.
    pub(crate) latency: Option<Duration>,
    /// The program that answers in place of a model, if one does.
    pub(crate) program: Option<Exec>,
    /// Whether it can be expected to list obstacles when it is asked to: a person who points does not, a program may have been
    /// written without it, and some families of models only point.
    pub(crate) lists_boxes: bool,
}

/// The VLM selected by the settings, in a world with this clock.
pub(crate) fn pointing(settings: &Settings, prompt: Option<Arc<PromptText>>, pace: Pace) -> Result<Pointing, CliError> {
    let name = settings.fly.vlm.text_or_default();
    let pointing = match name.split_once(':') {
        None if name == "oracle" => paced(settings, oracle(settings, name)?, pace),
        None if name == HUMAN => paced(settings, own::human()?, pace),
        Some(("oracle", _)) => paced(settings, oracle(settings, name)?, pace),
        Some(("exec", _)) => paced(settings, own::program(settings, name)?, pace),
        Some(("replay", file)) => replay(file),
        _ => return Ok(and_recorded(settings, paced(settings, model(settings, name, prompt)?, pace)?)),
    }?;
    let idle = [&settings.vlm.fallback as &dyn Row, &settings.vlm.hedge_s]
        .into_iter()
        .filter(|row| !row.shown().is_empty())
        .map(|row| row.key().name)
        .collect::<Vec<_>>()
        .join(" and ");
    let sentence = match idle.as_str() {
        "" => pointing.sentence,
        idle => format!("{} Ignored, because no model is queried: {idle}.", pointing.sentence),
    };
    Ok(and_recorded(settings, Pointing { sentence, ..pointing }))
}

/// The same, with its replies recorded if the settings require it.
fn and_recorded(settings: &Settings, pointing: Pointing) -> Pointing {
    match settings.vlm.record.text() {
        Some(path) => recorded(pointing, path.to_owned()),
        None => pointing,
    }
}

/// The replies of a recording, under the name of the recorded VLM.
fn replay(file: &str) -> Result<Pointing, CliError> {
    let replay = Replay::open(Path::new(file)).map_err(|error| not_replayed(file, &error))?;
    let name = replay.name().to_owned();
    let sentence = format!("VLM: replies of {name}, replayed from {file}.");
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(Box::new(replay.clone())));
    Ok(Pointing { name, vlm_factory, is_oracle: false, sentence, latency: None, program: None, lists_boxes: true })
}

/// The same, with its replies recorded in a file.
fn recorded(pointing: Pointing, path: String) -> Pointing {
    let vlm_factory = pointing.vlm_factory;
    let record = move |world: Option<&SimWorld>, seed| {
        let camera = world.map_or(Camera::tello(), |world| *world.camera());
        let vlm = vlm_factory(world, seed)?;
        let recording = Recording::new(vlm, Path::new(&path), (camera.width, camera.height))?;
        Ok(Box::new(recording) as Box<dyn Vlm>)
    };
    Pointing { vlm_factory: Arc::new(record), ..pointing }
}

/// Says that an oracle is no VLM, and what else a reader of its results must know.
pub(crate) fn oracle_sentence(name: &str, errors: &ErrorFile) -> String {
    let reads = format!("{name} reads the simulator's own ID and depth images and is not a real VLM.");
    let Some(Obedience { chance, per, quoted }) = errors.obeys else { return reads };
    let drawn = if per == Per::Sign { "drawn once for each sign of a flight" } else { "drawn for each sign in each frame" };
    let memory = if quoted { ", and does not obey text quoted in its history" } else { "" };
    format!(
        "{reads} It obeys legible signs in the scene with probability {chance}, {drawn}{memory}: this shows what follows if a model is \
         fooled, not whether one is."
    )
}

/// What must be said of a VLM of the bench that obeys signs; `None` for others.
pub(crate) fn obeying(name: &str) -> Option<String> {
    let (vlm, _) = split_latency(name);
    let errors = ErrorFile::named(vlm.strip_prefix("oracle:")?).ok()?;
    errors.obeys.map(|_| oracle_sentence(vlm, &errors))
}

fn oracle(settings: &Settings, name: &str) -> Result<Pointing, CliError> {
    let (name, errors) = oracle_named(name, |expected, near| settings.fly.vlm.wrong(expected, near))?;
    Ok(Pointing {
        sentence: match errors.obeys {
            None => format!("VLM: {name}, which reads the simulator's own ID and depth images and is not a real VLM."),
            Some(_) => format!("VLM: {}", oracle_sentence(&name, &errors)),
        },
        name: name.clone(),
        vlm_factory: oracle_factory(name, errors),
        is_oracle: true,
        latency: None,
        program: None,
        lists_boxes: true,
    })
}

/// The table of models, with the user's own rows.
pub(crate) fn table(settings: &Settings) -> Result<Table, CliError> {
    let table = Table::shipped();
    let Some(path) = settings.vlm.models.text() else { return Ok(table) };
    table.extended(&read(Path::new(path), "models")?).map_err(|error| {
        CliError::usage(format!("invalid models file `{path}`")).because(&error).hint("docs/guide/vlm.md describes its format")
    })
}

/// A model that can be queried.
pub(crate) struct Chosen {
    /// The name as given, or that of the vendor selected by `auto`.
    pub(crate) name: String,
    /// Its client.
    pub(crate) remote: Remote,
    /// A sentence about it for the user.
    pub(crate) sentence: String,
    /// Whether it lists obstacles with boxes, according to the table.
    pub(crate) lists_boxes: bool,
}

/// A model of the table, for a flight.
fn model(settings: &Settings, name: &str, prompt: Option<Arc<PromptText>>) -> Result<Pointing, CliError> {
    let Chosen { name, remote, sentence, lists_boxes } = remote(settings, name, prompt)?;
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(Box::new(remote.clone())));
    Ok(Pointing { name, vlm_factory, is_oracle: false, sentence, latency: None, program: None, lists_boxes })
}

/// The built-in prompt that asks as the paper does.
const PAPER: &str = "paper";

/// How a flight's queries are sent.
fn request_options(settings: &Settings) -> Result<RequestOptions, CliError> {
    Ok(RequestOptions {
        hedge: settings.vlm.hedge_s.get()?,
        long_side: settings.vlm.image_long_side.get()?,
        quality: settings.vlm.jpeg_quality.get()?,
        price: settings.vlm.price.get()?,
        greedy: settings.fly.prompt.text().is_some_and(|prompt| prompt == PAPER),
    })
}

/// A model of the table.
pub(crate) fn remote(settings: &Settings, name: &str, prompt: Option<Arc<PromptText>>) -> Result<Chosen, CliError> {
    let table = table(settings)?;
    let variables = variables()?;
    let send_to = settings.vlm.send_key_to.get()?.unwrap_or_default();
    let access = Access { keys: &variables, places: &environment, send_to: &send_to };
    let first = Name { text: name, from_file: settings.fly.vlm.is_from_file() };
    let second = settings.vlm.fallback.text().map(|text| Name { text, from_file: settings.vlm.fallback.is_from_file() });
    let names: Vec<Name<'_>> = [Some(first), second].into_iter().flatten().collect();
    let strategy = request_options(settings)?;
    let today = today();
    let mut chosen = Vec::new();
    // What a fallback leaves out is refused.
    let mut lists_boxes = None;
    let mut auto = String::new();
    for &full in &names {
        let name = full.text;
        let choice = setup::choose(&table, name, &variables).map_err(|error| refused(settings, name, &error))?;
        let model = &choice.model;
        lists_boxes.get_or_insert(model.lists_boxes);
        if auto.is_empty() {
            auto.clone_from(&model.vendor.name);
        }
        let place = choice.url.as_deref().map_or(String::new(), |url| format!(" at {url}"));
        let assumed = if model.assumed {
            " (not in the table: its coordinate convention is assumed; check it with `spf vlm check`)"
        } else {
            ""
        };
        if settings.fly.max_cost_usd.text().is_some() && model.price_on(&today).is_none() && strategy.price.is_none() {
            return Err(price_unknown(name));
        }
        let ends = model.ends_soon(&today).map_or(String::new(), |(day, successor, left)| {
            let then = successor.map_or(String::new(), |successor| format!("; its successor is {successor}"));
            format!(" (warning: it will be retired on {day}, in {left} days{then})")
        });
        let sent = if setup::is_local(&choice, access) { "" } else { "; images are sent to its server and may incur costs" };
        let withheld = setup::withheld_key(&table, full, access).map_err(|error| refused(settings, name, &error))?;
        let withheld = withheld.map_or(String::new(), |(variable, server)| {
            format!("; the key in {variable} is not sent to this server (to send it: --send-key-to {server})")
        });
        chosen.push(format!("{} from {}{place}{assumed}{ends}{sent}{withheld}", model.id, model.vendor.title));
    }
    let remote = setup::remote(&table, &names, access, strategy).map_err(|error| refused(settings, name, &error))?;
    let remote = match prompt {
        Some(prompt) => remote.with_prompt(prompt),
        None => remote,
    };
    remote.warm();
    let steps_in = chosen.get(1).map_or(String::new(), |second| format!(" Fallback: {second}."));
    let name = if *name == *AUTO { auto } else { name.to_owned() };
    Ok(Chosen { name, remote, sentence: format!("VLM: {}.{steps_in}", chosen[0]), lists_boxes: lists_boxes.unwrap_or(true) })
}

/// The error for a model that cannot be used, with a hint.
pub(crate) fn refused(settings: &Settings, name: &str, error: &SetupError) -> CliError {
    let table = table(settings).unwrap_or_else(|_| Table::shipped());
    spf_api::vlm::refused(&table, name, error, &settings.fly.vlm.hint())
}
