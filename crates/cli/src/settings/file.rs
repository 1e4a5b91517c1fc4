//! Settings from `spf.toml`.

use std::fmt::Display;
use std::path::Path;

use toml::de::{DeTable, DeValue};

use super::Settings;
use super::setting::Origin;
use crate::error::{CliError, nearest};
use crate::printer::one_line;

impl Settings {
    pub(super) fn read_file(&mut self, path: &Path) -> Result<(), CliError> {
        let shown = path.display();
        let text = spf_input::read_text(path)
            .map_err(|error| CliError::usage(format!("cannot read the configuration file `{shown}`")).because(&error))
            .map_err(|error| error.hint("give a readable file with --config, or omit it to use ./spf.toml"))?;
        self.read_text(path, &text)
    }

    /// Applies the values of a configuration file.
    pub(super) fn read_text(&mut self, path: &Path, text: &str) -> Result<(), CliError> {
        let shown = path.display();
        let table = DeTable::parse(text).map_err(|error| {
            let line = error.span().map_or(1, |span| line_of(text, span.start));
            CliError::usage(format!("{shown}:{line}: {}", error.message()))
                .hint("the file is TOML, for example:\n[fly]\nscene = \"city\"")
        })?;
        for (section, entries) in table.get_ref() {
            let DeValue::Table(entries) = entries.get_ref() else {
                return Err(self.unknown_key(&shown, line_of(text, section.span().start), section.get_ref()));
            };
            for (name, value) in entries {
                let line = line_of(text, name.span().start);
                let full = format!("{}.{}", section.get_ref(), name.get_ref());
                let Some(row) = self.rows_mut().into_iter().find(|row| row.key().name == full) else {
                    return Err(match (self.switched(&full), value.get_ref()) {
                        (Some(key), DeValue::Boolean(no)) => CliError::usage(format!("{shown}:{line}: unknown key `{full}`"))
                            .hint(format!("write `{name} = {}`", !no, name = key.rsplit('.').next().unwrap_or(key))),
                        _ => self.unknown_key(&shown, line, &full),
                    });
                };
                let value = match value.get_ref() {
                    DeValue::String(text) => text.clone().into_owned(),
                    DeValue::Integer(number) => number.to_string(),
                    DeValue::Float(number) => number.to_string(),
                    DeValue::Boolean(value) => value.to_string(),
                    DeValue::Datetime(_) | DeValue::Array(_) | DeValue::Table(_) => {
                        return Err(CliError::usage(format!(
                            "{shown}:{line}: `{full}` must be a string, a number, true or false"
                        ))
                        .hint(row.hint()));
                    }
                };
                row.key().refuse_file(&format!("{shown}:{line}"), &value)?;
                row.set(value, Origin::File(path.to_owned(), line));
            }
        }
        Ok(())
    }

    /// The key that a name after a flag means: `fly.video` for `fly.no_video`, as in `--no-video`.
    fn switched(&self, full: &str) -> Option<&'static str> {
        let (section, name) = full.split_once('.')?;
        let meant = format!("{section}.{}", name.strip_prefix("no_")?);
        self.rows().iter().map(|row| row.key().name).find(|known| *known == meant)
    }

    fn unknown_key(&self, path: &impl Display, line: usize, full: &str) -> CliError {
        let hint = match nearest(full, self.rows().iter().map(|row| row.key().name)) {
            Some(near) => format!("did you mean `{near}`? `spf config show` lists every key"),
            None => "`spf config show` lists every key".to_owned(),
        };
        CliError::usage(format!("{path}:{line}: unknown key `{}`", one_line(full))).hint(hint)
    }
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|byte| **byte == b'\n').count()
}
