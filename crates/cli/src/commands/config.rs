//! `spf config`: what is in force, and from where.

use std::path::Path;

use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// Prints every key with its value, origin and meaning, as TOML that could be a configuration file.
pub(crate) fn show(file: Option<&Path>, printer: &Printer) -> Result<Exit, CliError> {
    let settings = Settings::load(file)?;
    let mut section = "";
    for (key, value, origin) in settings.rows() {
        let (table, name) = key.name.split_once('.').unwrap_or(("", key.name));
        if table != section {
            if !section.is_empty() {
                printer.data("");
            }
            printer.data(&format!("[{table}]"));
            section = table;
        }
        let quoted = match value {
            "true" | "false" => value.to_owned(),
            _ if value.parse::<f64>().is_ok_and(f64::is_finite) => value.to_owned(),
            _ => toml::Value::String(value.to_owned()).to_string(),
        };
        printer.data(&format!("{:<34} # {origin}; {}: {}", format!("{name} = {quoted}"), key.env, key.doc));
    }
    Ok(Exit::Success)
}
