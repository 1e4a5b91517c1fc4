//! Settings from the environment, and from `.env` below it.

use std::collections::BTreeMap;
use std::ffi::OsString;

use spf_api::environment::dotenv;
use spf_bench::run::Shard;

use super::Settings;
use super::setting::Origin;
use crate::error::{CliError, nearest};
use crate::printer::one_line;

/// Prefix of the program's variables; other programs may use it too.
const PREFIX: &str = "SPF_";

/// The program's variables that are not keys.
const OTHERS: [&str; 3] = [Shard::COUNT_VARIABLE, "SPF_MCP_TOKEN", "SPF_MODELS"];

impl Settings {
    /// Applies the values of `.env` and of the environment; returns warnings about variables that may be misspelt.
    pub(super) fn read_environment(&mut self) -> Result<Vec<String>, CliError> {
        let dotenv = dotenv()?;
        self.take_variables(&dotenv, |name| std::env::var_os(name))?;
        let environment = std::env::vars_os().filter_map(|(name, _)| name.into_string().ok());
        Ok(self.unknown_variables(dotenv.into_keys(), environment))
    }

    /// Applies the values of `.env` and of the environment.
    pub(super) fn take_variables(
        &mut self,
        dotenv: &BTreeMap<String, String>,
        environment: impl Fn(&str) -> Option<OsString>,
    ) -> Result<(), CliError> {
        for row in self.rows_mut() {
            let key = row.key();
            if let Some(value) = environment(key.env) {
                let value = value
                    .into_string()
                    .map_err(|_| CliError::usage(format!("environment {}: the value is not UTF-8", key.env)).hint(row.hint()))?;
                row.set(value, Origin::Env(key.env));
            } else if let Some(value) = dotenv.get(key.env) {
                key.refuse_file(&format!(".env {}", key.env), value)?;
                row.set(value.clone(), Origin::DotEnv(key.env));
            }
        }
        Ok(())
    }

    /// A warning for each unknown variable with the program's prefix, sorted by name: it may be misspelt, or belong to
    /// another program.
    pub(super) fn unknown_variables(
        &self,
        dotenv: impl IntoIterator<Item = String>,
        environment: impl IntoIterator<Item = String>,
    ) -> Vec<String> {
        let rows = self.rows();
        let known = || rows.iter().map(|row| row.key().env);
        let in_file = dotenv.into_iter().map(|name| (name, ".env"));
        let named: BTreeMap<String, &str> =
            in_file.chain(environment.into_iter().map(|name| (name, "the environment"))).collect();
        let unknown =
            named.into_iter().filter(|(name, _)| name.starts_with(PREFIX) && !known().chain(OTHERS).any(|key| key == name));
        let warning = |(name, place): (String, &str)| {
            let near = nearest(&name, known()).map_or(String::new(), |near| format!("did you mean `{near}`? "));
            let name = one_line(&name);
            format!("warning: unknown variable `{name}` in {place} is ignored: {near}`spf config show` lists every key")
        };
        unknown.map(warning).collect()
    }
}
