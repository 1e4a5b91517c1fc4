//! Variables of the environment, and of `.env` in the working directory below it: keys of vendors.

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::Error;

/// The variables of `.env`, if there is one; none without.
///
/// # Errors
/// A usage error if it cannot be read, or a line is invalid.
pub fn dotenv() -> Result<BTreeMap<String, String>, Error> {
    let mut variables = BTreeMap::new();
    if Path::new(".env").exists() {
        let text = spf_input::read_text(Path::new(".env")).map_err(|error| Error::usage("cannot read .env").because(&error))?;
        for line in dotenvy::from_read_iter(text.as_bytes()) {
            // The error would quote the line, and with it perhaps a key.
            let (name, value) = line.map_err(|_| {
                Error::usage("invalid line in .env").hint("use NAME=value, one per line; quote values with spaces")
            })?;
            variables.insert(name, value);
        }
    }
    Ok(variables)
}

/// Looks up other variables, such as vendors' keys; the environment overrides `.env`.
///
/// # Errors
/// As of [`dotenv`].
pub fn variables() -> Result<impl Fn(&str) -> Option<String>, Error> {
    let dotenv = dotenv()?;
    Ok(move |name: &str| environment(name).or_else(|| dotenv.get(name).cloned()))
}

/// Looks up a variable in the environment alone.
#[must_use]
pub fn environment(name: &str) -> Option<String> {
    std::env::var(name).ok()
}
