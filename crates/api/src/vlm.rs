//! VLMs by their names, as on the program's command line: the oracle, a model of the table, a recording.

use std::path::Path;
use std::sync::Arc;

use spf_bench::trial::split_latency;
use spf_flight::sim::{VlmFactory, oracle_factory};
use spf_oracle::ErrorFile;
use spf_vlm::cassette::Replay;
use spf_vlm::exec::EXEC;
use spf_vlm::human::HUMAN;
use spf_vlm::setup::{self, AUTO, Access, Name, SetupError};
use spf_vlm::table::{SelectError, Table};
use spf_vlm::{RequestOptions, Vlm as _, today};

use crate::environment::{environment, variables};
use crate::error::{Error, nearest};
use crate::files::read;

/// Latency of people, programs and functions in virtual time, seconds: the oracle's median.
pub const LATENCY_S: f64 = 1.5;

/// What a name may be, for messages.
pub(crate) const NAMES: &str = "`spf vlm list` lists the models; oracle, oracle:NAME and oracle:FILE stand in for one";

/// A VLM for flights in the simulator.
pub(crate) struct Named {
    /// Its name in logs.
    pub(crate) name: String,
    /// Creates it.
    pub(crate) vlm_factory: VlmFactory,
    /// Whether it is the oracle, whose reading of an instruction is known before the flight.
    pub(crate) is_oracle: bool,
    /// Whether it can be expected to list obstacles when it is asked to.
    pub(crate) lists_boxes: bool,
}

/// The VLM of a name. `limits_cost`: the flight has a limit of its cost, so that the price of a model must be known.
pub(crate) fn named(name: &str, limits_cost: bool) -> Result<Named, Error> {
    match name.split_once(':') {
        None if name == "oracle" => oracle(name),
        Some(("oracle", _)) => oracle(name),
        Some(("replay", file)) => replay(file),
        _ if name == HUMAN || name.starts_with(EXEC) => Err(Error::usage(format!("`{name}` is for the program alone"))
            .hint(format!("give a function that answers, or run: spf fly --vlm '{name}'"))),
        _ => model(name, limits_cost),
    }
}

fn oracle(name: &str) -> Result<Named, Error> {
    let (name, errors) = oracle_named(name, |expected, _| Error::usage(format!("unknown VLM `{name}`: expected {expected}")))?;
    let vlm_factory = oracle_factory(name.clone(), errors);
    Ok(Named { name, vlm_factory, is_oracle: true, lists_boxes: true })
}

fn replay(file: &str) -> Result<Named, Error> {
    let replay = Replay::open(Path::new(file)).map_err(|error| not_replayed(file, &error))?;
    let name = replay.name().to_owned();
    Ok(Named { name, vlm_factory: Arc::new(move |_, _| Ok(Box::new(replay.clone()))), is_oracle: false, lists_boxes: true })
}

/// The error for a recording of replies that cannot be used.
#[must_use]
pub fn not_replayed(file: &str, error: &dyn std::error::Error) -> Error {
    Error::usage(format!("cannot replay the recording `{file}`"))
        .because(error)
        .hint("create a recording with --vlm-record FILE (docs/guide/vlm.md)")
}

fn model(name: &str, limits_cost: bool) -> Result<Named, Error> {
    let (table, variables) = (Table::shipped(), variables()?);
    let refuse = |error: &SetupError| refused(&table, name, error, NAMES);
    let access = Access { keys: &variables, places: &environment, send_to: &[] };
    let choice = setup::choose(&table, name, &variables).map_err(|error| refuse(&error))?;
    if limits_cost && choice.model.price_on(&today()).is_none() {
        return Err(price_unknown(name));
    }
    let remote = setup::remote(&table, &[Name::from(name)], access, RequestOptions::default()).map_err(|error| refuse(&error))?;
    remote.warm();
    let shown = if name == AUTO { choice.model.vendor.name.clone() } else { name.to_owned() };
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(Box::new(remote.clone())));
    Ok(Named { name: shown, vlm_factory, is_oracle: false, lists_boxes: choice.model.lists_boxes })
}

/// The error for a limit of cost with a model whose price is not known.
#[must_use]
pub fn price_unknown(name: &str) -> Error {
    Error::usage(format!("--max-cost requires a known price, and `{name}` has none"))
        .hint("give its price with --vlm-price IN,OUT or --vlm-models (docs/guide/vlm.md); use 0 for a local model")
}

/// The oracle's name and error file; `wrong` creates the error for another name, from the expected forms and a
/// similar name.
///
/// # Errors
/// A usage error for an unknown name, an unreadable or an invalid error file.
pub fn oracle_named(name: &str, wrong: impl FnOnce(&str, Option<&str>) -> Error) -> Result<(String, ErrorFile), Error> {
    if let (oracle, Some(seconds)) = split_latency(name)
        && oracle.starts_with("oracle")
    {
        return Err(Error::usage(format!("`{name}`: only `spf bench` takes a latency in the name"))
            .hint(format!("spf fly --vlm {oracle} --vlm-latency {seconds}")));
    }
    let errors = match name.split_once(':') {
        None if name == "oracle" => ErrorFile::named("default"),
        Some(("oracle", which)) if which.contains(['/', '.']) && !which.starts_with(GULLIBLE) => {
            ErrorFile::from_toml(&read(Path::new(which), "error")?)
        }
        Some(("oracle", which)) => ErrorFile::named(which),
        other => {
            let near = nearest(other.map_or(name, |(scheme, _)| scheme), ["oracle"]);
            return Err(wrong("oracle, oracle:NAME or oracle:FILE", near));
        }
    };
    let errors = errors.map_err(|error| {
        let which = name.split_once(':').map_or("", |(_, which)| which);
        let hint = match nearest(which, ErrorFile::shipped().iter().copied()) {
            _ if which.starts_with(GULLIBLE) => "docs/explanation/oracle.md describes this stand-in".to_owned(),
            Some(near) if near != which => format!("did you mean `oracle:{near}`?"),
            _ => "the path of an error file must contain a `/` or a `.`; docs/explanation/oracle.md lists its keys".to_owned(),
        };
        Error::usage(format!("invalid oracle `{name}`")).because(&error).hint(hint)
    })?;
    Ok((name.to_owned(), errors))
}

/// What begins the name of a stand-in that obeys signs.
const GULLIBLE: &str = "gullible";

/// The complete name of a model of which only the model's own part, or only its series, is given: `VENDOR#MODEL`, or the vendor.
fn complete_name(table: &Table, name: &str) -> Option<String> {
    let last = |id: &str| id.rsplit('/').next().unwrap_or(id).to_ascii_lowercase();
    let series = |id: &str| {
        let last = last(id);
        last[..last.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(last.len())].to_owned()
    };
    if let Some(row) = table.models().iter().find(|row| last(&row.id) == last(name)) {
        return Some(format!("{}#{}", row.vendor, row.id));
    }
    let wanted = Some(series(name)).filter(|wanted| wanted.len() >= 3)?;
    let row = table.models().iter().find(|row| series(&row.id) == wanted)?;
    if !name.contains(|c: char| c.is_ascii_digit()) {
        return Some(row.vendor.clone());
    }
    // Who serves the models of others names them by their maker too.
    let maker = row.id.rsplit_once('/').filter(|_| !name.contains('/')).map_or(String::new(), |(maker, _)| format!("{maker}/"));
    Some(format!("{}#{maker}{name}", row.vendor))
}

/// The error for a model that cannot be used, with a hint; `otherwise` is the hint where nothing better is known.
#[must_use]
pub fn refused(table: &Table, name: &str, error: &SetupError, otherwise: &str) -> Error {
    let failure = Error::usage(format!("cannot use the VLM `{name}`")).because(error);
    match error {
        SetupError::Select(SelectError::Unknown { name: vendor, known }) => {
            // On a server of one's own, no vendor is needed.
            if let Some((_, url)) = name.split_once("@http") {
                let model = name.split('@').next().unwrap_or_default().trim_start_matches('#');
                return failure.hint(format!("the server comes first: `--vlm http{url}#{model}`"));
            }
            let name = vendor;
            if name.starts_with("oracle") {
                return failure.hint(
                    "the oracle answers in the simulator only: spf fly --vlm oracle, spf ground --dataset, spf sim serve --vlm",
                );
            }
            if let Some(complete) = complete_name(table, name) {
                return failure.hint(format!("a vendor comes first: `--vlm {complete}`"));
            }
            let words = known.iter().map(String::as_str).chain(["oracle", AUTO]);
            match nearest(name, words) {
                Some(near) => failure.hint(format!("did you mean `{near}`? `spf vlm list` lists all")),
                None => failure.hint(format!("use oracle, {AUTO}, {}, or a server URL: see `spf vlm list`", known.join(", "))),
            }
        }
        SetupError::Select(SelectError::NoModel { .. }) if name.starts_with("http") => failure.hint(format!("use {name}#MODEL")),
        SetupError::Select(SelectError::NoModel { vendor }) => failure.hint(format!("use --vlm {vendor}#MODEL")),
        SetupError::SecretInUrl => {
            Error::usage("invalid URL of the VLM").because(error).hint("set API keys in the environment (docs/guide/vlm.md)")
        }
        SetupError::Select(SelectError::Retired { successor, .. }) => {
            let vendor = name.split(['#', '@']).next().unwrap_or(name);
            failure.hint(format!("use --vlm {vendor}#{successor}"))
        }
        SetupError::KeyElsewhere { variable, server, .. } => failure.hint(format!(
            "if that server may have the key, add --send-key-to {server}; to query it without a key, unset {variable}"
        )),
        SetupError::KeyInClear { .. } => failure.hint("use the URL with https://"),
        SetupError::UrlFromFile { variable } => {
            let vendor = name.split(['#', '@']).next().unwrap_or(name);
            failure.hint(format!("remove it from .env and export {variable} in the environment, or use --vlm {vendor}@URL"))
        }
        SetupError::NoKey { variables, page, .. } => {
            let page = page.as_deref().map_or(String::new(), |page| format!("; create a key at {page}"));
            failure.hint(format!("set {} in the environment or in .env{page}", variables.join(" or ")))
        }
        SetupError::NoKeyAtAll { variables } => {
            failure.hint(format!("set one of {} in the environment or in .env", variables.join(", ")))
        }
        SetupError::Url(_) | SetupError::Select(SelectError::Url(_)) => {
            failure.hint("use NAME[#MODEL]@http://host:port/v1, or http://host:port/v1#MODEL")
        }
        _ => failure.hint(otherwise),
    }
}
