//! Creates a model client from its name and the environment.

use reqwest::Url;
use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderName, HeaderValue};

use crate::backend::Backend;
use crate::client::Endpoint;
use crate::day::today;
use crate::destination::{ChosenBy, KeyUse, is_here, key_use};
use crate::key::ApiKey;
use crate::remote::{Remote, RequestOptions};
use crate::table::{Auth, Choice, Model, SelectError, Table};
use crate::transport::{Transport, TransportError};

pub use crate::destination::{KeyHost, KeyHostError};

/// Looks up variables.
pub type Variables<'a> = &'a dyn Fn(&str) -> Option<String>;

/// Where keys come from, and what a person said about where they go.
#[derive(Clone, Copy)]
pub struct Access<'a> {
    /// Looks up keys, in the environment or `.env`.
    pub keys: Variables<'a>,
    /// Looks up URLs of servers, in the environment alone: a file of the working directory must not choose who receives a
    /// key.
    pub places: Variables<'a>,
    /// Servers to which keys may be sent.
    pub send_to: &'a [KeyHost],
}

impl<'a> Access<'a> {
    /// Keys and URLs of the same source, and no other servers.
    #[must_use]
    pub fn of(variables: Variables<'a>) -> Self {
        Self { keys: variables, places: variables, send_to: &[] }
    }
}

/// The name of a model, and where it comes from.
#[derive(Clone, Copy, Debug)]
pub struct Name<'a> {
    /// `NAME[#MODEL][@URL]`.
    pub text: &'a str,
    /// Whether it comes from a file in the working directory rather than from the command line or the environment.
    pub from_file: bool,
}

impl<'a> From<&'a str> for Name<'a> {
    fn from(text: &'a str) -> Self {
        Self { text, from_file: false }
    }
}

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
    /// A key that would be sent to another server than its vendor's, or readable by others.
    #[error("the key in {variable} is not sent to {server}{}: {server} is not the vendor's server", if *plain { " over http" } else { "" })]
    KeyElsewhere {
        /// The variable that holds the key.
        variable: String,
        /// The server.
        server: KeyHost,
        /// Whether the connection is not encrypted.
        plain: bool,
    },
    /// The vendor's own server, without encryption.
    #[error("the key in {variable} is not sent to {server} over http, where others can read it")]
    KeyInClear {
        /// The variable that holds the key.
        variable: String,
        /// The server.
        server: KeyHost,
    },
    /// A URL variable that stands in a file of the working directory.
    #[error("`.env` sets {variable}, but a file in the working directory cannot set where an API key is sent")]
    UrlFromFile {
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
pub fn remote(table: &Table, names: &[Name<'_>], access: Access<'_>, strategy: RequestOptions) -> Result<Remote, SetupError> {
    let backends = names.iter().map(|name| backend(table, *name, access, strategy)).collect::<Result<Vec<_>, _>>()?;
    let name = names.first().map_or(AUTO, |name| name.text);
    Ok(Remote::new(name.to_owned(), backends, strategy, Transport::start()?))
}

fn backend(table: &Table, name: Name<'_>, access: Access<'_>, strategy: RequestOptions) -> Result<Backend, SetupError> {
    let mut choice = choose(table, name.text, access.keys)?;
    if let Some(price) = strategy.price {
        choice.model.price = vec![price.into()];
    }
    let endpoint = endpoint(&choice, name.from_file, access)?;
    let model = if strategy.greedy { choice.model.greedy() } else { choice.model };
    Ok(Backend::new(choice.name, model, endpoint))
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

/// The base URL: of the name, else of the vendor's variable, else of the table; and who chose it.
fn base_url(choice: &Choice, from_file: bool, access: Access<'_>) -> Result<(String, ChosenBy), SetupError> {
    let vendor = &choice.model.vendor;
    let found = |variables: Variables<'_>, name: &str| variables(name).filter(|url| !url.trim().is_empty());
    let (base, by) = match (&choice.url, &vendor.base_url_env) {
        (Some(url), _) => (url.clone(), if from_file { ChosenBy::File } else { ChosenBy::Person }),
        (None, Some(variable)) => match found(access.places, variable) {
            Some(url) => (url, ChosenBy::Person),
            None if found(access.keys, variable).is_some() => {
                return Err(SetupError::UrlFromFile { variable: variable.clone() });
            }
            None => (vendor.base_url.clone(), ChosenBy::File),
        },
        (None, None) => (vendor.base_url.clone(), ChosenBy::File),
    };
    Ok((base.trim().trim_end_matches('/').to_owned(), by))
}

/// A server's base URL, and the key sent to it.
struct Destination {
    base: String,
    url: Url,
    key: Option<(String, ApiKey)>,
    /// A key that is set, but not sent, and its variable. It is masked in responses all the same: a server can have it from
    /// elsewhere.
    withheld: Option<(String, ApiKey)>,
}

fn destination(choice: &Choice, from_file: bool, access: Access<'_>) -> Result<Destination, SetupError> {
    let vendor = &choice.model.vendor;
    let (base, by) = base_url(choice, from_file, access)?;
    let url = Url::parse(&base).ok().filter(|url| matches!(url.scheme(), "http" | "https") && url.host_str().is_some());
    let Some(url) = url else { return Err(SetupError::Url(base)) };
    if !url.username().is_empty() || url.password().is_some() || url.query().is_some() {
        return Err(SetupError::SecretInUrl);
    }
    let Some((variable, key)) = key(&vendor.keys, access.keys) else {
        // A server on this machine is not the vendor's, and needs no key of theirs.
        if vendor.key_needed && !is_here(&url) {
            let (title, variables, page) = (vendor.title.clone(), vendor.keys.clone(), vendor.key_page.clone());
            return Err(SetupError::NoKey { title, variables, page });
        }
        return Ok(Destination { base, url, key: None, withheld: None });
    };
    match key_use(&variable, &url, by, access.send_to) {
        KeyUse::Send => Ok(Destination { base, url, key: Some((variable, key)), withheld: None }),
        KeyUse::Withhold => Ok(Destination { base, url, key: None, withheld: Some((variable, key)) }),
        KeyUse::Refuse => {
            let server = KeyHost::of(&url);
            let own =
                Url::parse(&vendor.base_url).is_ok_and(|home| home.scheme() == "https" && home.host_str() == url.host_str());
            Err(match own && url.scheme() == "http" {
                true => SetupError::KeyInClear { variable, server },
                false => SetupError::KeyElsewhere { variable, server, plain: url.scheme() == "http" },
            })
        }
    }
}

/// Whether the server of this model is on this machine: `localhost` or a loopback address.
#[must_use]
pub fn is_local(choice: &Choice, access: Access<'_>) -> bool {
    base_url(choice, false, access).is_ok_and(|(base, _)| Url::parse(&base).is_ok_and(|url| is_here(&url)))
}

/// The variable of a key that is set but not sent, and the server, which is on this machine; `None` if there is none.
///
/// # Errors
/// [`SetupError`] if the model cannot be used.
pub fn withheld_key(table: &Table, name: Name<'_>, access: Access<'_>) -> Result<Option<(String, KeyHost)>, SetupError> {
    let choice = choose(table, name.text, access.keys)?;
    let Destination { url, withheld, .. } = destination(&choice, name.from_file, access)?;
    Ok(withheld.map(|(variable, _)| (variable, KeyHost::of(&url))))
}

fn endpoint(choice: &Choice, from_file: bool, access: Access<'_>) -> Result<Endpoint, SetupError> {
    let vendor = &choice.model.vendor;
    let Destination { base, url, key, withheld } = destination(choice, from_file, access)?;
    let host = url.host_str().unwrap_or_default().to_owned() + &url.port().map_or(String::new(), |port| format!(":{port}"));
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
    Ok(Endpoint { host, base, headers, wire, key: key.or(withheld).map(|(_, key)| key), reports_cost })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_on_this_machine_is_local() {
        let local = |name: &str| is_local(&Table::shipped().select(name, "2026-11-22").unwrap(), Access::of(&|_| None));
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
