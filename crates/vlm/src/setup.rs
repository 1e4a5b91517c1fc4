//! Creates a model client from its name and the environment.

use std::net::IpAddr;

use reqwest::Url;
use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderName, HeaderValue};

use crate::backend::Backend;
use crate::client::Endpoint;
use crate::day::today;
use crate::key::ApiKey;
use crate::remote::{Remote, Strategy};
use crate::table::{Auth, Choice, Model, SelectError, Table};
use crate::transport::{Transport, TransportError};

/// Looks up variables, in the environment or `.env`.
pub type Variables<'a> = &'a dyn Fn(&str) -> Option<String>;

/// Why a model cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SetupError {
    /// No such model.
    #[error(transparent)]
    Select(#[from] SelectError),
    /// No API key.
    #[error("no API key set for {title}")]
    NoKey {
        /// The vendor's title.
        title: String,
        /// Variables that can hold it.
        variables: Vec<String>,
        /// Web page for obtaining one.
        page: Option<String>,
    },
    /// No vendor has a key.
    #[error("no API key set for any vendor")]
    NoKeyAtAll {
        /// Variables that can hold one.
        variables: Vec<String>,
    },
    /// A key that is not valid in an HTTP header.
    #[error("the API key in {variable} contains invalid characters")]
    BadKey {
        /// The variable.
        variable: String,
    },
    /// An invalid address.
    #[error("invalid server URL `{0}`")]
    Url(String),
    /// An address with a user name, a password or a query, which could not be kept secret.
    #[error("URLs are stored in logs, so they must not contain a user name, a password or a query")]
    SecretInUrl,
    /// An invalid header in the table.
    #[error("invalid header `{0}` in the table of models")]
    Header(String),
    /// The HTTP client could not be created.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// The name for the first vendor with a key.
pub const AUTO: &str = "auto";

/// Creates a client for the models with these names, in order of use.
///
/// # Errors
/// [`SetupError`] if one of them cannot be used.
pub fn remote(table: &Table, names: &[&str], variables: Variables<'_>, strategy: Strategy) -> Result<Remote, SetupError> {
    let backends = names.iter().map(|name| backend(table, name, variables, strategy)).collect::<Result<Vec<_>, _>>()?;
    let name = names.first().copied().unwrap_or(AUTO);
    Ok(Remote::new(name.to_owned(), backends, strategy, Transport::start()?))
}

fn backend(table: &Table, name: &str, variables: Variables<'_>, strategy: Strategy) -> Result<Backend, SetupError> {
    let mut choice = choose(table, name, variables)?;
    if let Some(price) = strategy.price {
        choice.model.price = vec![price.into()];
    }
    let endpoint = endpoint(&choice, variables)?;
    Ok(Backend::new(choice.name, choice.model, endpoint))
}

/// The model for a name; `auto` is the first vendor of the table with a key.
///
/// # Errors
/// [`SetupError`] if there is none.
pub fn choose(table: &Table, name: &str, variables: Variables<'_>) -> Result<Choice, SetupError> {
    if name != AUTO {
        return Ok(table.select(name, &today())?);
    }
    let needing = || table.vendors().iter().filter(|vendor| vendor.key_needed);
    match needing().find(|vendor| key(&vendor.keys, variables).is_some()) {
        Some(vendor) => Ok(table.select(&vendor.name, &today())?),
        None => Err(SetupError::NoKeyAtAll { variables: needing().flat_map(|vendor| vendor.keys.clone()).collect() }),
    }
}

/// The first variable that holds a key.
fn key(names: &[String], variables: Variables<'_>) -> Option<(String, ApiKey)> {
    names.iter().find_map(|name| Some((name.clone(), ApiKey::new(&variables(name)?)?)))
}

/// Whether a key for this model is set, or none is needed.
#[must_use]
pub fn has_key(model: &Model, variables: Variables<'_>) -> bool {
    !model.vendor.key_needed || key(&model.vendor.keys, variables).is_some()
}

/// The base URL: of the name, else of the vendor's variable, else of the vendor.
fn base_url(choice: &Choice, variables: Variables<'_>) -> String {
    let vendor = &choice.model.vendor;
    let elsewhere = vendor.base_url_env.as_deref().and_then(variables).filter(|url| !url.trim().is_empty());
    let base = choice.url.clone().or(elsewhere).unwrap_or_else(|| vendor.base_url.clone());
    base.trim().trim_end_matches('/').to_owned()
}

/// Whether the server of this model is on this machine: `localhost` or a loopback address.
#[must_use]
pub fn is_local(choice: &Choice, variables: Variables<'_>) -> bool {
    let Ok(url) = Url::parse(&base_url(choice, variables)) else { return false };
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    host == "localhost" || host.ends_with(".localhost") || host.parse().is_ok_and(|address: IpAddr| address.is_loopback())
}

fn endpoint(choice: &Choice, variables: Variables<'_>) -> Result<Endpoint, SetupError> {
    let vendor = &choice.model.vendor;
    let base = base_url(choice, variables);
    let url = Url::parse(&base).ok().filter(|url| matches!(url.scheme(), "http" | "https") && url.host_str().is_some());
    let Some(url) = url else { return Err(SetupError::Url(base)) };
    if !url.username().is_empty() || url.password().is_some() || url.query().is_some() {
        return Err(SetupError::SecretInUrl);
    }
    let host = url.host_str().unwrap_or_default().to_owned() + &url.port().map_or(String::new(), |port| format!(":{port}"));
    let key = key(&vendor.keys, variables);
    if key.is_none() && vendor.key_needed {
        let (title, variables, page) = (vendor.title.clone(), vendor.keys.clone(), vendor.key_page.clone());
        return Err(SetupError::NoKey { title, variables, page });
    }
    let mut headers = HeaderMap::new();
    for (name, value) in &vendor.headers {
        let wrong = || SetupError::Header(name.clone());
        let (header, value) = (HeaderName::try_from(name.as_str()), HeaderValue::try_from(value.as_str()));
        headers.insert(header.map_err(|_| wrong())?, value.map_err(|_| wrong())?);
    }
    if let Some((variable, key)) = &key {
        let (name, text) = match vendor.auth {
            Auth::Bearer => (AUTHORIZATION, format!("Bearer {}", key.reveal())),
            Auth::XApiKey => (HeaderName::from_static("x-api-key"), key.reveal().to_owned()),
            Auth::XGoogApiKey => (HeaderName::from_static("x-goog-api-key"), key.reveal().to_owned()),
        };
        let mut value = HeaderValue::try_from(text).map_err(|_| SetupError::BadKey { variable: variable.clone() })?;
        value.set_sensitive(true);
        headers.insert(name, value);
    }
    let (wire, reports_cost) = (choice.model.wire, vendor.reports_cost);
    Ok(Endpoint { host, base, headers, wire, key: key.map(|(_, key)| key), reports_cost })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_on_this_machine_is_local() {
        let local = |name: &str| is_local(&Table::shipped().select(name, "2026-11-22").unwrap(), &|_| None);
        for name in
            ["ollama", "http://localhost:1/v1#m", "http://127.0.0.1:1/v1#m", "http://[::1]:1/v1#m", "gemini@http://127.0.0.1:1"]
        {
            assert!(local(name), "{name}");
        }
        for name in ["gemini", "http://localhost.example/v1#m", "http://192.168.0.2:1/v1#m", "ollama@http://10.0.0.2:1/v1"] {
            assert!(!local(name), "{name}");
        }
    }
}
