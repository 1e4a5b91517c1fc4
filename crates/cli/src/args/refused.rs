//! Command lines that do not parse: the parser's message, with the flag that was probably meant and what a flag takes.

use std::ffi::OsString;

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, CommandFactory};

use spf_api::error::nearest;

use super::Cli;

/// The parser's `error` about the command `line`, with what is known of the flags that it names.
pub(crate) fn explained(mut error: clap::Error, line: &[OsString]) -> clap::Error {
    let mut program = Cli::command();
    program.build();
    let mut command = meant(program, line);
    match error.kind() {
        ErrorKind::UnknownArgument => {
            if let Some(ContextValue::String(flag)) = error.get(ContextKind::InvalidArg)
                && let Some(meant) = with_word(&command, flag)
            {
                error.insert(ContextKind::SuggestedArg, ContextValue::String(meant));
                error.insert(ContextKind::Usage, ContextValue::StyledStr(command.render_usage()));
            }
        }
        ErrorKind::InvalidValue => {
            if matches!(error.get(ContextKind::InvalidValue), Some(ContextValue::String(value)) if value.is_empty())
                && let Some(ContextValue::String(flag)) = error.get(ContextKind::InvalidArg)
                && let Some(takes) = help(&command, flag)
            {
                error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(takes)]));
            }
        }
        ErrorKind::InvalidSubcommand => {
            if error.get(ContextKind::SuggestedSubcommand).is_none()
                && let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand)
                && let Some(near) = nearest(word, command.get_subcommands().map(Command::get_name))
            {
                error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![near.to_owned()]));
            }
        }
        _ => {}
    }
    error
}

/// A hint beside the message, where there is one to give.
pub(crate) fn hint(error: &clap::Error, line: &[OsString]) -> Option<&'static str> {
    let words = line.iter().skip(2).take_while(|word| !word.to_string_lossy().starts_with('-')).count();
    (error.kind() == ErrorKind::UnknownArgument && line.get(1).is_some_and(|word| word == "fly") && words > 1)
        .then_some("hint: put the instruction in quotes: spf fly \"go to the lake\"")
}

/// The subcommand that a line names, or as much of it as there is.
fn meant(mut command: Command, line: &[OsString]) -> Command {
    for word in line.iter().skip(1) {
        match command.find_subcommand(word) {
            Some(found) => command = found.clone(),
            None if word.to_string_lossy().starts_with('-') => {}
            None => break,
        }
    }
    command
}

/// The one flag of `command` of whose words, separated by hyphens, `flag` is one: `--max-speed` for `--speed`, but not
/// `--no-video` for `--video`.
fn with_word(command: &Command, flag: &str) -> Option<String> {
    let word = flag.strip_prefix("--")?;
    let has_it = |long: &&str| !long.starts_with("no-") && long.split('-').any(|part| part == word);
    let mut found = command.get_arguments().filter(|arg| !arg.is_hide_set()).filter_map(clap::Arg::get_long).filter(has_it);
    let first = found.next()?;
    found.next().is_none().then(|| format!("--{first}"))
}

/// What the help says of `flag`, which the parser names with its value: `--track <SWITCH>`.
fn help(command: &Command, flag: &str) -> Option<String> {
    let long = flag.split(' ').next()?.strip_prefix("--")?;
    let arg = command.get_arguments().find(|arg| arg.get_long() == Some(long))?;
    let help = arg.get_help()?.to_string();
    Some(format!("{flag}: {help}"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    fn message(line: &str) -> String {
        let line: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        explained(Cli::try_parse_from(&line).unwrap_err(), &line).to_string()
    }

    #[test]
    fn the_flag_with_the_word_is_meant_where_there_is_only_one() {
        let meant = message("spf fly x --speed 1");
        assert!(meant.contains("'--max-speed'") && meant.contains("Usage: spf fly [OPTIONS]"), "{meant}");
        // Two flags have this word: the parser's own guess stands.
        assert!(!message("spf fly x --model m").contains("'--drone-model'"));
        assert!(message("spf fly x --sceen city").contains("'--scene'"));
        assert!(!message("spf fly x --check").contains("'--no-vlm-check'"));
    }

    #[test]
    fn a_misspelt_command_is_recognised() {
        for (line, meant) in
            [("spf fyl x", "fly"), ("spf bnech run", "bench"), ("spf log exprot x", "export"), ("spf sim scens", "scenes")]
        {
            let message = message(line);
            assert!(message.contains(&format!("similar subcommand exists: '{meant}'")), "{message}");
        }
        assert!(!message("spf qqqqqqq").contains("similar"));
    }

    #[test]
    fn a_flag_without_its_value_says_what_it_takes() {
        let message = message("spf fly x --track");
        assert!(message.contains("--track <SWITCH>: When a reply follows somebody, stay with them"), "{message}");
    }
}
