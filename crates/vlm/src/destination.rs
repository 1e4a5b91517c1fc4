//! Where an API key may be sent: to its vendor over TLS, and elsewhere only where a person said so.

use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

use reqwest::Url;

use crate::table::Table;

/// A server that a person allows a key to be sent to: `HOST` (the standard port of http or https) or `HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyHost {
    host: String,
    port: Option<u16>,
}

/// Why a text is not a [`KeyHost`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected HOST or HOST:PORT, as in proxy.example or 10.0.0.2:8000, without http:// and without a path")]
pub struct KeyHostError;

impl FromStr for KeyHost {
    type Err = KeyHostError;

    fn from_str(text: &str) -> Result<Self, KeyHostError> {
        // Parsed as in a URL, so that the same host is written the same way.
        let url = Url::parse(&format!("ftp://{}/", text.trim())).map_err(|_| KeyHostError)?;
        let bare = url.path() == "/" && url.query().is_none() && url.fragment().is_none() && url.username().is_empty();
        let host = url.host_str().filter(|host| bare && url.password().is_none() && !host.is_empty() && !host.contains('*'));
        // The standard port of the scheme used here counts as not given.
        let port = url.port().or_else(|| text.trim().ends_with(":21").then_some(21));
        Ok(Self { host: host.ok_or(KeyHostError)?.to_ascii_lowercase(), port })
    }
}

impl fmt::Display for KeyHost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.port {
            Some(port) => write!(f, "{}:{port}", self.host),
            None => f.write_str(&self.host),
        }
    }
}

impl KeyHost {
    /// The server of a URL, as [`FromStr`] reads it.
    pub(crate) fn of(url: &Url) -> Self {
        Self { host: url.host_str().unwrap_or_default().to_ascii_lowercase(), port: url.port() }
    }

    fn is(&self, url: &Url) -> bool {
        self.host == url.host_str().unwrap_or_default().to_ascii_lowercase() && url.port() == self.port
    }
}

/// Who chose the URL of a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChosenBy {
    /// A person, on the command line or in the environment.
    Person,
    /// A table of models, or a file of the working directory.
    File,
}

/// What happens to a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KeyUse {
    /// It is sent.
    Send,
    /// The server is on this machine and the key is not its own: the request is sent without it.
    Withhold,
    /// The server is another one, or the connection is readable by others: nothing may be sent.
    Refuse,
}

/// Whether the key in `variable` may be sent to `url`.
///
/// A key belongs to the vendors of the built-in table that use its variable. It is sent to a vendor's host over TLS; one
/// for servers on this machine (`VLLM_API_KEY`) also to a server on this machine whose URL was not chosen by a file.
/// Everything else requires an entry in `allowed`.
pub(crate) fn key_use(variable: &str, url: &Url, by: ChosenBy, allowed: &[KeyHost]) -> KeyUse {
    let table = Table::shipped();
    let homes: Vec<Option<Url>> = table
        .vendors()
        .iter()
        .filter(|vendor| vendor.keys.iter().any(|key| key == variable))
        .map(|vendor| Url::parse(&vendor.base_url).ok())
        .collect();
    let same = |home: &Url| home.host_str() == url.host_str() && home.port_or_known_default() == url.port_or_known_default();
    let vendors_own = url.scheme() == "https" && homes.iter().flatten().any(|home| home.scheme() == "https" && same(home));
    // Vendors without a server of their own, and those whose server is on this machine.
    let for_here = !homes.is_empty() && homes.iter().all(|home| home.as_ref().is_none_or(is_here));
    let here = is_here(url);
    let own_here = for_here && here && (by == ChosenBy::Person || homes.iter().flatten().any(same));
    if vendors_own || own_here || allowed.iter().any(|host| host.is(url)) {
        KeyUse::Send
    } else if here {
        KeyUse::Withhold
    } else {
        KeyUse::Refuse
    }
}

/// Whether a server is on this machine: `localhost` or a loopback address.
pub(crate) fn is_here(url: &Url) -> bool {
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    host == "localhost" || host.ends_with(".localhost") || host.parse().is_ok_and(|address: IpAddr| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn used(variable: &str, url: &str, allowed: &[&str]) -> KeyUse {
        let allowed: Vec<KeyHost> = allowed.iter().map(|host| host.parse().unwrap()).collect();
        key_use(variable, &Url::parse(url).unwrap(), ChosenBy::Person, &allowed)
    }

    #[test]
    fn a_vendors_key_goes_to_that_vendor_over_tls() {
        for (variable, url) in [
            ("OPENAI_API_KEY", "https://api.openai.com/v1"),
            ("OPENAI_API_KEY", "https://API.OpenAI.com:443/other"),
            ("GEMINI_API_KEY", "https://generativelanguage.googleapis.com/v1beta"),
            ("VLLM_API_KEY", "http://localhost:8000/v1"),
            ("VLLM_API_KEY", "http://127.0.0.1:9000/v1"),
            ("OPENAI_COMPATIBLE_API_KEY", "http://[::1]:9000/v1"),
        ] {
            assert_eq!(used(variable, url, &[]), KeyUse::Send, "{variable} {url}");
        }
        for (variable, url) in [
            ("OPENAI_API_KEY", "http://api.openai.com/v1"),
            ("OPENAI_API_KEY", "https://api.openai.com:8443/v1"),
            ("OPENAI_API_KEY", "https://api.openai.com./v1"),
            ("OPENAI_API_KEY", "https://api.openai.com.evil.example/v1"),
            ("OPENAI_API_KEY", "https://generativelanguage.googleapis.com/v1beta"),
            ("GEMINI_API_KEY", "https://api.openai.com/v1"),
            ("VLLM_API_KEY", "https://api.openai.com/v1"),
            ("OPENAI_COMPATIBLE_API_KEY", "https://evil.example/v1"),
            ("AWS_SECRET_ACCESS_KEY", "https://evil.example/v1"),
        ] {
            assert_eq!(used(variable, url, &[]), KeyUse::Refuse, "{variable} {url}");
        }
    }

    #[test]
    fn a_server_on_this_machine_gets_only_its_own_key() {
        for variable in ["OPENAI_API_KEY", "GOOGLE_API_KEY", "AWS_SECRET_ACCESS_KEY"] {
            assert_eq!(used(variable, "http://127.0.0.1:8080/v1", &[]), KeyUse::Withhold, "{variable}");
        }
        let by_file = |url: &str| key_use("VLLM_API_KEY", &Url::parse(url).unwrap(), ChosenBy::File, &[]);
        assert_eq!((by_file("http://localhost:8000/v1"), by_file("http://localhost:6666/v1")), (KeyUse::Send, KeyUse::Withhold));
    }

    #[test]
    fn a_person_can_allow_a_server_and_only_that_one() {
        let url = "http://10.0.0.2:8000/v1";
        assert_eq!(used("OPENAI_API_KEY", url, &["10.0.0.2:8000"]), KeyUse::Send);
        assert_eq!(used("OPENAI_API_KEY", "https://proxy.example/v1", &["h", "Proxy.Example"]), KeyUse::Send);
        for other in ["10.0.0.2", "10.0.0.2:8001", "10.0.0.3:8000", "proxy.example"] {
            assert_eq!(used("OPENAI_API_KEY", url, &[other]), KeyUse::Refuse, "{other}");
        }
        assert_eq!(used("OPENAI_API_KEY", "https://proxy.example:444/v1", &["proxy.example"]), KeyUse::Refuse);
        assert_eq!(used("OPENAI_API_KEY", "http://127.0.0.1:8080/v1", &["127.0.0.1:8080"]), KeyUse::Send);
    }

    #[test]
    fn what_is_no_host_is_refused() {
        for wrong in ["", "http://h", "h/path", "h:x", "u@h", "*", "*.example", "h?x", "a b", "h:99999"] {
            assert_eq!(wrong.parse::<KeyHost>(), Err(KeyHostError), "{wrong}");
        }
        for (right, shown) in [("Proxy.Example", "proxy.example"), ("[::1]:8000", "[::1]:8000"), ("h:21", "h:21")] {
            assert_eq!(right.parse::<KeyHost>().unwrap().to_string(), shown);
        }
    }

    proptest! {
        #[test]
        fn no_other_host_gets_a_key(host in "[a-z0-9-]{1,12}(\\.[a-z0-9-]{1,12}){0,3}", port in prop::option::of(1_u16..), tls in any::<bool>(),
            variable in prop::sample::select(vec!["OPENAI_API_KEY", "GOOGLE_API_KEY", "ANTHROPIC_API_KEY", "OPENROUTER_API_KEY", "VLLM_API_KEY"])) {
            let port = port.map_or(String::new(), |port| format!(":{port}"));
            let scheme = if tls { "https" } else { "http" };
            if let Ok(url) = Url::parse(&format!("{scheme}://{host}{port}/v1")) {
                prop_assert!(is_here(&url) || key_use(variable, &url, ChosenBy::Person, &[]) == KeyUse::Refuse);
            }
        }
    }
}
