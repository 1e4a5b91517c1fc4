//! `spf completions` and `spf man`: what shells and `man` read, made from the arguments.

use clap::CommandFactory;
use clap_complete::{Shell, generate};

use crate::args::{Cli, Completions, Man};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Prints the script of a shell.
pub(crate) fn completions(args: &Completions, printer: &Printer) -> Result<Exit, CliError> {
    printer.data(script(args.shell).trim_end());
    Ok(Exit::Success)
}

fn script(shell: Shell) -> String {
    let mut script = Vec::new();
    generate(shell, &mut Cli::command(), "spf", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// Writes the pages.
pub(crate) fn man(args: &Man, printer: &Printer) -> Result<Exit, CliError> {
    let folder = &args.folder;
    std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(Cli::command(), folder)).map_err(|error| {
        CliError::usage(format!("cannot write the manual to `{}`", folder.display()))
            .because(&error)
            .hint("give a folder that can be written: spf man ~/.local/share/man/man1")
    })?;
    printer.result(&folder.join("spf.1").display().to_string());
    Ok(Exit::Success)
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    #[test]
    fn every_shell_completes_every_command_the_flags_and_their_words() {
        for shell in Shell::value_variants() {
            let script = script(*shell);
            for command in Cli::command().get_subcommands() {
                assert!(script.contains(command.get_name()), "{shell}: {}", command.get_name());
            }
            assert!(script.contains("depth-sensor") && script.contains("paper"), "{shell}");
        }
    }
}
