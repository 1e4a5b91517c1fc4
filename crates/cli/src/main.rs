//! The `spf` command: arguments → settings → commands.

mod args;
mod background;
mod commands;
mod error;
mod exit;
mod printer;
mod progress;
mod settings;
mod stalled;

use std::ffi::OsString;
use std::io::IsTerminal;
use std::panic::AssertUnwindSafe;
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

use crate::args::{Cli, Command, Config, Model, Vlm, refused};
use crate::background::LogWriter;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Joins the `--avoid` of `spf fly` with a switch that follows it. The parser wants an equals sign in between, because the
/// instruction may follow instead; the other switches do without.
fn with_avoid_joined(arguments: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    for argument in arguments {
        let flies = joined.iter().any(|word| word == "fly" || word == "cockpit");
        match joined.last_mut() {
            Some(last) if flies && last == "--avoid" && ["on", "off", "auto"].iter().any(|word| argument == *word) => {
                last.push("=");
                last.push(argument);
            }
            _ => joined.push(argument),
        }
    }
    joined
}

fn main() -> ExitCode {
    // The process of a detector's network, which this program starts for itself.
    if std::env::args_os().nth(1).is_some_and(|argument| argument == spf_detect::worker::ARGUMENT) {
        return spf_detect::worker::serve();
    }
    let line = with_avoid_joined(std::env::args_os());
    let cli = match Cli::try_parse_from(&line) {
        Ok(cli) => cli,
        Err(error) => {
            let error = refused::explained(error, &line);
            // Help and version are not errors, and neither is a closed pipe.
            drop(error.print());
            if let Some(hint) = refused::hint(&error, &line) {
                Printer::new(false).log(hint);
            }
            return if error.use_stderr() { Exit::Usage.into() } else { Exit::Success.into() };
        }
    };
    background::start();
    start_log(cli.verbose);
    let printer = Printer::new(cli.command.is_json());
    // A panic has landed the drone while it unwound, and its message is printed; the exit code is still that of an internal error.
    let result = std::panic::catch_unwind(AssertUnwindSafe(|| run(&cli, printer)));
    background::flush();
    match result {
        Ok(Ok(exit)) => exit.into(),
        Err(_) => Exit::Internal.into(),
        Ok(Err(error)) => {
            Printer::new(false).log(&format!("error: {error}"));
            Exit::of_error(&error).into()
        }
    }
}

fn run(cli: &Cli, mut printer: Printer) -> Result<Exit, CliError> {
    match &cli.command {
        Command::Fly(args) => commands::fly::fly(args, printer),
        Command::Cockpit(args) => commands::cockpit::cockpit(args, &printer),
        #[cfg(feature = "mcp")]
        Command::Mcp(args) => commands::mcp::mcp(args, &printer),
        #[cfg(not(feature = "mcp"))]
        Command::Mcp(_) => Err(commands::without_mcp()),
        Command::Doctor(args) => commands::doctor(args, &printer),
        Command::Tello(command) => commands::tello(command, &printer),
        Command::Camera(command) => commands::camera::camera(command, &printer),
        Command::Screen(command) => commands::screen::screen(command, &printer),
        Command::Sim(command) => commands::sim::sim(command, &mut printer),
        Command::Log(command) => commands::log::log(command, &printer),
        Command::Replay(args) => commands::replay::replay(args, &printer),
        Command::Ground(args) => commands::ground::ground(args, &mut printer),
        Command::Track(args) => commands::track(args, &mut printer),
        Command::Vlm(Vlm::List(args)) => commands::vlm::list(args, &printer),
        Command::Vlm(Vlm::Check(args)) => commands::vlm::check(args, &printer),
        Command::Vlm(Vlm::Trial(args)) => commands::vlm::trial(args, &mut printer),
        Command::Model(Model::List(args)) => commands::model::list(args, &printer),
        Command::Model(Model::Get(args)) => commands::model::get(args, &printer),
        Command::Bench(command) => commands::bench::bench(command, &mut printer),
        Command::Config(Config::Show { config }) => commands::config::show(config.as_deref(), &printer),
        Command::Completions(args) => commands::shell::completions(args, &printer),
        Command::Man(args) => commands::shell::man(args, &printer),
    }
}

/// Logs go to standard error: standard output is data.
fn start_log(verbose: u8) {
    let level = match verbose {
        0 => LevelFilter::WARN,
        1 => LevelFilter::DEBUG,
        _ => LevelFilter::TRACE,
    };
    // Levels and modules, as is usual for this variable; there are no spans that a filter could name.
    let requested = std::env::var("RUST_LOG").ok().and_then(|words| words.trim_matches(',').parse::<Targets>().ok());
    let filter = requested.unwrap_or_else(|| Targets::new().with_default(level));
    // Colour only for a terminal: in a file or a journal its codes are noise.
    let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let lines =
        tracing_subscriber::fmt::layer().with_writer(LogWriter).with_ansi(colour).with_target(false).log_internal_errors(false);
    tracing_subscriber::registry().with(lines.with_filter(filter)).init();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_switch_after_avoid_is_its_value_and_an_instruction_is_not() {
        let joined = |line: &str| with_avoid_joined(line.split(' ').map(OsString::from)).join(&OsString::from(" "));
        assert_eq!(joined("spf fly go --avoid off --seed 1"), "spf fly go --avoid=off --seed 1");
        assert_eq!(joined("spf fly --avoid go"), "spf fly --avoid go");
        assert_eq!(joined("spf ground --avoid on go"), "spf ground --avoid on go");
    }
}
