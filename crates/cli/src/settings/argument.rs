//! The parser's argument that a row of the table makes.

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::error::Error;
use clap::{Arg, ArgAction, Command};

use super::flag::{Flag, Form};
use super::setting::Row;

/// The argument of a row's flag, as it stands in `spf fly`.
pub(super) fn argument(flag: &Flag, row: &dyn Row) -> Arg {
    let help = help(flag.form, row);
    let arg = Arg::new(row.key().name).long(flag.name.trim_start_matches("--")).help(help);
    let arg = arg.help_heading(flag.group.0).hide_short_help(!flag.common);
    let taking = |arg: Arg, value| {
        let suggested = Suggested(row.words());
        let arg = arg.value_name(value).value_parser(suggested).hide_possible_values(true);
        if flag.dashed { arg.allow_hyphen_values(true) } else { arg.allow_negative_numbers(true) }
    };
    match flag.form {
        Form::Switch(_) => arg.action(ArgAction::SetTrue),
        Form::Value(value) => taking(arg, value),
        Form::Optional(value, alone) => taking(arg, value).num_args(0..=1).require_equals(true).default_missing_value(alone),
    }
}

/// The help of a flag: its key's meaning, and its default.
fn help(form: Form, row: &dyn Row) -> String {
    let meaning = row.meaning();
    let (meaning, empty) = meaning.split_once("; empty: ").map_or((meaning.as_str(), None), |(text, empty)| (text, Some(empty)));
    let default = Some(row.key().default).filter(|text| !text.is_empty()).or(empty.filter(|text| *text != "none"));
    match form {
        // The values are in the name of the flag.
        Form::Switch(sets) => {
            let meaning = meaning.strip_suffix(&format!(": {}", row.values())).unwrap_or(meaning);
            if sets == "false" { format!("Do not {meaning}") } else { capitalised(meaning) }
        }
        Form::Value(_) | Form::Optional(..) => {
            let default = default.map_or(String::new(), |text| format!(" [default: {text}]"));
            format!("{}{default}", capitalised(meaning))
        }
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// Any text, which is read later, where its origin is known; with the words that a shell may complete.
#[derive(Clone)]
struct Suggested(Vec<&'static str>);

impl TypedValueParser for Suggested {
    type Value = String;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &std::ffi::OsStr) -> Result<String, Error> {
        StringValueParser::new().parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let words = self.0.iter().copied().map(PossibleValue::new);
        if self.0.is_empty() { None } else { Some(Box::new(words)) }
    }
}
