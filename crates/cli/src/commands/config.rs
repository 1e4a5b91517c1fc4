//! `spf config`: shows the effective settings and their sources.

use std::path::Path;

use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// Prints every key with its value, source and description, as a valid TOML configuration.
pub(crate) fn show(file: Option<&Path>, printer: &Printer) -> Result<Exit, CliError> {
    let settings = Settings::load(file, printer)?;
    let mut section = "";
    for row in settings.rows() {
        let (key, value, origin) = (row.key(), row.shown(), row.origin());
        if key.table != section {
            if !section.is_empty() {
                printer.data("");
            }
            printer.data(&format!("[{}]", key.table));
            section = key.table;
        }
        let written = match value {
            "true" | "false" => value.to_owned(),
            _ if is_toml_number(value) => value.to_owned(),
            _ => quoted(value),
        };
        printer.data(&format!("{:<34} # {origin}; {}: {}", format!("{} = {written}", key.field), key.env, row.meaning()));
    }
    Ok(Exit::Success)
}

/// Whether a value may be written without quotes; a folder `007` may not.
fn is_toml_number(value: &str) -> bool {
    let bare = value.strip_prefix('-').unwrap_or(value);
    let (whole, fraction) = bare.split_once('.').map_or((bare, None), |(whole, fraction)| (whole, Some(fraction)));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    digits(whole) && (whole == "0" || !whole.starts_with('0')) && fraction.is_none_or(digits)
}

/// The value on one line, since the source follows it.
fn quoted(value: &str) -> String {
    let escaped = |letter: char| match letter {
        '"' | '\\' => format!("\\{letter}"),
        _ if letter.is_control() => format!("\\u{:04X}", u32::from(letter)),
        _ => letter.to_string(),
    };
    format!("\"{}\"", value.chars().map(escaped).collect::<String>())
}
