//! Settings from command line flags, the topmost layer: the parser's arguments are made from the table of settings.

use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use clap::error::Error;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches, value_parser};

use super::Settings;
use super::argument::argument;
use super::flag::{Flag, Form};
use super::setting::{Origin, Row};

/// The flag of a command that names the configuration file.
const CONFIG: &str = "--config";

/// Which flags a command takes.
pub(crate) trait Takes {
    /// Their names. The order in the help is that of the table.
    const FLAGS: &'static [&'static str];

    /// Whether it takes this one.
    fn takes(flag: &str) -> bool {
        Self::FLAGS.contains(&flag)
    }

    /// The argument of a flag as it stands in this command; it is made for `spf fly`, with a heading.
    fn adapted(_flag: &str, arg: Arg) -> Arg {
        arg.help_heading(None::<&'static str>).hide_short_help(false)
    }
}

/// The flags of a command that set keys, and its configuration file.
#[derive(Debug)]
pub(crate) struct Flags<T> {
    file: Option<PathBuf>,
    /// By the names of the flags.
    given: Vec<(&'static str, String)>,
    takes: PhantomData<T>,
}

impl<T> Clone for Flags<T> {
    fn clone(&self) -> Self {
        Self { file: self.file.clone(), given: self.given.clone(), takes: PhantomData }
    }
}

impl<T> Flags<T> {
    /// The configuration file given.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    /// What was given for a flag.
    pub(crate) fn text(&self, flag: &str) -> Option<&str> {
        self.given.iter().find(|(name, _)| *name == flag).map(|(_, text)| text.as_str())
    }

    /// Applies them.
    pub(super) fn apply(&self, settings: &mut Settings) {
        for row in settings.rows_mut() {
            let Some(flag) = &row.key().flag else { continue };
            if let Some(text) = self.text(flag.name) {
                row.set(text.to_owned(), Origin::Flag(flag.name));
            }
        }
    }
}

impl<T: Takes> Flags<T> {
    /// The rows whose flags the command takes, with the flags.
    fn rows(settings: &Settings) -> impl Iterator<Item = (&dyn Row, &'static Flag)> {
        let rows = settings.rows().into_iter().filter_map(|row| Some((row, row.key().flag.as_ref()?)));
        rows.filter(|(_, flag)| T::takes(flag.name))
    }
}

impl<T: Takes> Args for Flags<T> {
    fn augment_args(command: Command) -> Command {
        let settings = Settings::default();
        let arguments = Self::rows(&settings).map(|(row, flag)| T::adapted(flag.name, argument(flag, row)));
        let command = command.args(arguments);
        let config = Arg::new("config").long("config").value_name("FILE").value_parser(value_parser!(PathBuf));
        let config = config.help("Read this configuration file instead of ./spf.toml");
        command.arg(T::adapted(CONFIG, config.help_heading("Output").hide_short_help(true)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<T: Takes> FromArgMatches for Flags<T> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let settings = Settings::default();
        let given = Self::rows(&settings).filter_map(|(row, flag)| {
            let id = row.key().name;
            // A switch that is absent has a value too.
            let is_given = matches.value_source(id) == Some(ValueSource::CommandLine);
            let text = match flag.form {
                Form::Switch(sets) => sets.to_owned(),
                Form::Value(_) | Form::Optional(..) => matches.get_one::<String>(id)?.clone(),
            };
            is_given.then_some((flag.name, text))
        });
        Ok(Self { file: matches.get_one("config").cloned(), given: given.collect(), takes: PhantomData })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}
