//! Who may ask: programs, and pages of the server itself; neither pages of other sites nor a name that others control.

use std::net::{IpAddr, SocketAddr};

use http::header::{HOST, HeaderName, ORIGIN};
use http::uri::Authority;
use http::{HeaderMap, Method};

/// Set by browsers on requests to this machine, and out of a page's control.
const FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
const FETCH_DEST: HeaderName = HeaderName::from_static("sec-fetch-dest");

/// Why a request was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// DNS rebinding: a page of another site can point its own host name here, but not an IP address.
    #[error("invalid Host header: use the server's IP address (or localhost), as in http://127.0.0.1:PORT, not another name")]
    Host,
    /// A page of another site.
    #[error("cross-origin request refused: a page of another site may not use this server")]
    Origin,
}

/// Why an origin cannot be allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an origin has the form SCHEME://HOST[:PORT], such as https://app.foxglove.dev, not `{0}`")]
pub struct OriginError(String);

/// The access rules of a server.
#[derive(Clone, Debug)]
pub struct Access {
    loopback: bool,
    encrypted: bool,
    origins: Vec<String>,
}

impl Access {
    /// The rules of a server that listens on `address`: requests name its IP address or `localhost`, and those of a
    /// browser come from its own pages.
    #[must_use]
    pub fn at(address: SocketAddr) -> Self {
        Self { loopback: address.ip().is_loopback(), encrypted: false, origins: Vec::new() }
    }

    /// The rules of a server that speaks TLS: its own pages do as well.
    #[must_use]
    pub fn encrypted(self) -> Self {
        Self { encrypted: true, ..self }
    }

    /// Allows pages of another origin, `SCHEME://HOST[:PORT]`.
    ///
    /// # Errors
    /// [`OriginError`] if it does not have this form; `null`, the origin of any sandboxed page, is none.
    pub fn allowing(mut self, origin: &str) -> Result<Self, OriginError> {
        let wrong = || OriginError(origin.chars().filter(|c| !c.is_control()).take(80).collect());
        let (scheme, rest) = origin.split_once("://").ok_or_else(wrong)?;
        let letters = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-');
        // A page from a file, as desktop programs show, has no host.
        let host = rest.is_empty() && scheme == "file"
            || !rest.is_empty() && rest.parse::<Authority>().is_ok_and(|a| !a.as_str().contains(['@', '*']));
        if !letters(scheme) || !host {
            return Err(wrong());
        }
        self.origins.push(origin.to_ascii_lowercase());
        Ok(self)
    }

    /// Checks the headers of a request.
    ///
    /// # Errors
    /// [`Refusal`] if its sender may not ask.
    pub fn check(&self, method: &Method, headers: &HeaderMap) -> Result<(), Refusal> {
        let host = single(headers, &HOST).ok_or(Refusal::Host)?;
        let authority: Authority = host.parse().map_err(|_| Refusal::Host)?;
        // A user name in it is nobody's habit.
        if !self.is_own(authority.host()) || host.contains('@') {
            return Err(Refusal::Host);
        }
        if headers.contains_key(ORIGIN) {
            let origin = single(headers, &ORIGIN).ok_or(Refusal::Origin)?;
            return if self.is_own_page(origin, host) { Ok(()) } else { Err(Refusal::Origin) };
        }
        // Without an origin: a program, a browser that opens an address, or a page of another site that includes
        // something of ours, as an image.
        let Some(site) = headers.get(FETCH_SITE) else { return Ok(()) };
        let opened = *method == Method::GET && headers.get(FETCH_DEST).is_some_and(|dest| dest == "document");
        if site == "same-origin" || site == "none" || opened { Ok(()) } else { Err(Refusal::Origin) }
    }

    fn is_own_page(&self, origin: &str, host: &str) -> bool {
        let plain = origin.strip_prefix("http://").filter(|_| !self.encrypted);
        let from = plain.or_else(|| origin.strip_prefix("https://"));
        from.is_some_and(|from| from.eq_ignore_ascii_case(host))
            || self.origins.iter().any(|allowed| allowed.eq_ignore_ascii_case(origin))
    }

    fn is_own(&self, host: &str) -> bool {
        if host.eq_ignore_ascii_case("localhost") {
            return true;
        }
        let bare = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
        let own = |address: IpAddr| if self.loopback { address.is_loopback() } else { !address.is_unspecified() };
        bare.parse().is_ok_and(own)
    }
}

/// A header that occurs once and is text.
fn single<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use http::HeaderValue;
    use proptest::prelude::*;

    fn access(loopback: bool) -> Access {
        Access::at(if loopback { "127.0.0.1:8000" } else { "0.0.0.0:8000" }.parse().unwrap())
    }

    fn headers(list: &[(&'static str, &str)]) -> HeaderMap {
        list.iter().map(|(name, value)| (HeaderName::from_static(name), HeaderValue::from_str(value).unwrap())).collect()
    }

    fn check(loopback: bool, list: &[(&'static str, &str)]) -> Result<(), Refusal> {
        access(loopback).check(&Method::GET, &headers(list))
    }

    #[test]
    fn only_addresses_of_this_machine_are_hosts() {
        for host in ["127.0.0.1:8000", "localhost:8000", "LOCALHOST", "[::1]:8000", "127.0.0.2"] {
            assert_eq!(check(true, &[("host", host)]), Ok(()), "{host}");
        }
        for host in [
            "rebound.example:8000",
            "192.168.0.7:8000",
            "0.0.0.0:8000",
            "localhost.example",
            "127.0.0.1.example",
            "127.0.0.1.",
            "evil.example@127.0.0.1",
            "",
            "a b",
            "[::2]:1",
        ] {
            assert_eq!(check(true, &[("host", host)]), Err(Refusal::Host), "{host}");
        }
        assert_eq!(check(true, &[]), Err(Refusal::Host));
        // When listening on all addresses, access is by IP address only, never by name.
        assert_eq!(check(false, &[("host", "192.168.0.7:8000")]), Ok(()));
        for host in ["rebound.example:8000", "0.0.0.0:8000"] {
            assert_eq!(check(false, &[("host", host)]), Err(Refusal::Host), "{host}");
        }
    }

    #[test]
    fn only_its_own_pages_may_ask() {
        let from = |origin: &str| check(true, &[("host", "127.0.0.1:8000"), ("origin", origin)]);
        assert_eq!(from("http://127.0.0.1:8000"), Ok(()));
        for origin in
            ["http://127.0.0.1:8001", "http://localhost:8000", "https://evil.example", "null", "", "127.0.0.1:8000", "file://"]
        {
            assert_eq!(from(origin), Err(Refusal::Origin), "{origin}");
        }
        let mut twice = headers(&[("host", "127.0.0.1:8000"), ("origin", "http://127.0.0.1:8000")]);
        twice.append(ORIGIN, HeaderValue::from_static("https://evil.example"));
        assert_eq!(access(true).check(&Method::GET, &twice), Err(Refusal::Origin));
    }

    #[test]
    fn what_a_page_of_another_site_includes_is_refused_without_an_origin_too() {
        let asked = |method: &Method, site: &str, dest: &str| {
            let list = [("host", "127.0.0.1:8000"), ("sec-fetch-site", site), ("sec-fetch-dest", dest)];
            access(true).check(method, &headers(&list)).is_ok()
        };
        let get = |site: &str, dest: &str| asked(&Method::GET, site, dest);
        assert!(get("none", "document") && get("same-origin", "image") && get("cross-site", "document"));
        assert!(!get("cross-site", "image") && !get("same-site", "script") && !get("cross-site", "iframe"));
        assert!(!asked(&Method::POST, "cross-site", "document"));
    }

    #[test]
    fn a_named_origin_may_ask_and_no_other() {
        let with = |origin: &str| access(true).allowing(origin);
        let access = with("https://app.foxglove.dev").unwrap().allowing("file://").unwrap();
        let from = |origin: &str| access.check(&Method::GET, &headers(&[("host", "127.0.0.1:8765"), ("origin", origin)]));
        for origin in ["https://app.foxglove.dev", "file://", "http://127.0.0.1:8765"] {
            assert_eq!(from(origin), Ok(()), "{origin}");
        }
        for origin in ["http://app.foxglove.dev", "https://app.foxglove.dev.evil.example", "https://app.foxglove.dev:444", "null"]
        {
            assert_eq!(from(origin), Err(Refusal::Origin), "{origin}");
        }
        for wrong in ["null", "*", "", "https://", "https://*", "app.foxglove.dev", "https://a b", "https://u@h", "://h"] {
            assert!(with(wrong).is_err(), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn a_name_is_never_let_in(name in "[a-z0-9.-]{1,20}", loopback in any::<bool>()) {
            prop_assume!(name != "localhost" && name.parse::<IpAddr>().is_err());
            prop_assert!(check(loopback, &[("host", &name)]).is_err());
        }

        #[test]
        fn no_headers_let_a_foreign_origin_in(origin in "[ -~]{0,30}", host in "(127\\.0\\.0\\.1|localhost|[ -~]{0,15})(:[0-9]{1,4})?",
            site in prop::sample::select(vec!["none", "same-origin", "cross-site"]), loopback in any::<bool>()) {
            prop_assume!(!origin.to_ascii_lowercase().ends_with(&format!("://{}", host.to_ascii_lowercase())));
            let list = [("host", host.as_str()), ("origin", origin.as_str()), ("sec-fetch-site", site)];
            prop_assert!(check(loopback, &list).is_err());
        }
    }
}
