//! `spf vlm list`: the known models, their prices, and which of them can be used.

use serde::Serialize;
use spf_vlm::table::{Model, ModelRow, Status, Table};
use spf_vlm::{setup, today};

use super::table;
use crate::args::VlmList;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table as columns};
use crate::settings::{Settings, variables};

/// A row of `--json`.
#[derive(Serialize)]
struct Row<'a> {
    vlm: String,
    vendor: &'a str,
    model: &'a str,
    status: &'static str,
    default: bool,
    paper: bool,
    key_set: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    retires: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    successor: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    usd_per_million_in: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    usd_per_million_out: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    price_as_of: Option<&'a str>,
}

/// Prints the table of models.
pub(crate) fn list(args: &VlmList, printer: &Printer) -> Result<Exit, CliError> {
    let settings = Settings::of(&args.settings, printer)?;
    let (table, variables, today) = (table(&settings)?, variables()?, today());
    let models: Vec<(&ModelRow, Model)> = table.models().iter().filter_map(|row| Some((row, table.row_model(row)?))).collect();
    let key_set = |model: &Model| setup::has_key(model, &variables);
    if args.json {
        let rows: Vec<Row<'_>> = models.iter().map(|(row, model)| json(row, model, key_set(model), &today)).collect();
        let text =
            serde_json::to_string(&rows).map_err(|error| CliError::internal("cannot write the list as JSON").because(&error))?;
        printer.data(&text);
        return Ok(Exit::Success);
    }
    let head = ["vlm", "status", "$/M in", "$/M out", "key", "note"].map(str::to_owned).to_vec();
    let lines = models.iter().map(|(row, model)| line(row, model, key_set(model), &today));
    printer.data(&columns(&[head].into_iter().chain(lines).collect::<Vec<_>>()));
    printer.data(&servers(&table));
    printer.data(&format!(
        "Models and prices as of {}. `spf vlm check NAME` checks that a model responds and points accurately.",
        table.as_of()
    ));
    Ok(Exit::Success)
}

fn name(row: &ModelRow, model: &Model) -> String {
    if is_default(row, model) { row.vendor.clone() } else { format!("{}#{}", row.vendor, row.id) }
}

fn is_default(row: &ModelRow, model: &Model) -> bool {
    model.vendor.default.as_deref() == Some(&row.id)
}

fn json<'a>(row: &'a ModelRow, model: &'a Model, key_set: bool, today: &str) -> Row<'a> {
    let price = model.price_on(today);
    Row {
        vlm: name(row, model),
        vendor: &row.vendor,
        model: &row.id,
        status: row.status.word(),
        default: is_default(row, model),
        paper: row.paper,
        key_set,
        retires: row.retires.as_deref(),
        successor: row.successor.as_deref(),
        usd_per_million_in: price.map(|price| price.input),
        usd_per_million_out: price.map(|price| price.output),
        price_as_of: price.map(|price| price.as_of.as_str()),
    }
}

fn line(row: &ModelRow, model: &Model, key_set: bool, today: &str) -> Vec<String> {
    let price = model.price_on(today);
    let dollars = |amount: Option<f64>| amount.map_or("?".to_owned(), |amount| format!("{amount:.2}"));
    let mut notes = Vec::new();
    if is_default(row, model) {
        notes.push(format!("default: {}", row.id));
    }
    if row.paper {
        notes.push("one of the six in the paper".to_owned());
    }
    match (row.status, &row.retires, &row.successor) {
        (Status::Retired, Some(day), Some(successor)) => notes.push(format!("retired {day}; use {successor}")),
        (_, Some(day), Some(successor)) => notes.push(format!("until {day}; then {successor}")),
        (_, None, Some(successor)) => notes.push(format!("successor: {successor}")),
        _ => {}
    }
    notes.extend(row.note.clone());
    let key = match (model.vendor.key_needed, key_set) {
        (false, _) => "not needed",
        (true, true) => "set",
        (true, false) => "-",
    };
    let (input, output) = (dollars(price.map(|price| price.input)), dollars(price.map(|price| price.output)));
    vec![name(row, model), row.status.word().to_owned(), input, output, key.to_owned(), notes.join("; ")]
}

/// Servers without rows of their own: any model that they have loaded.
fn servers(table: &Table) -> String {
    let local = table.vendors().iter().filter(|vendor| !vendor.key_needed && !vendor.base_url.is_empty());
    let names: Vec<String> = local
        .map(|vendor| {
            let default = vendor.default.as_deref().unwrap_or("none");
            format!("  {}#MODEL at {} [default: {default}]", vendor.name, vendor.base_url)
        })
        .collect();
    format!(
        "\nLocal servers, with any model they serve:\n{}\n  http://host:port/v1#MODEL: any other server with the OpenAI chat \
            API\n",
        names.join("\n")
    )
}
