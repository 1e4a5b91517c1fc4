//! Access control: only pages served by this server, addressed by IP and not by a host name that others control.

use std::net::IpAddr;

use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};
use axum::http::uri::Authority;

/// Why a request was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Refusal {
    /// DNS rebinding: a page of another site can point its own host name here, but not an IP address.
    #[error("invalid Host header: open the page as http://127.0.0.1:PORT, not by another name")]
    Host,
    /// A page of another site.
    #[error("cross-origin request refused")]
    Origin,
}

/// Checks the headers of a request. `loopback`: the server only listens on a loopback address.
pub(super) fn check(headers: &HeaderMap, loopback: bool) -> Result<(), Refusal> {
    let host = single(headers, &HOST).ok_or(Refusal::Host)?;
    let authority: Authority = host.parse().map_err(|_| Refusal::Host)?;
    if !is_own(authority.host(), loopback) {
        return Err(Refusal::Host);
    }
    if !headers.contains_key(ORIGIN) {
        // Not sent by programs, nor by browsers loading the page itself.
        return Ok(());
    }
    let origin = single(headers, &ORIGIN).ok_or(Refusal::Origin)?;
    let from = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://")).ok_or(Refusal::Origin)?;
    if from.eq_ignore_ascii_case(host) { Ok(()) } else { Err(Refusal::Origin) }
}

/// A header that occurs once and is text.
fn single<'a>(headers: &'a HeaderMap, name: &axum::http::HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(value)
}

fn is_own(host: &str, loopback: bool) -> bool {
    if host.eq_ignore_ascii_case("localhost") {
        return true;
    }
    let bare = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    bare.parse::<IpAddr>().is_ok_and(|address| !loopback || address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;
    use proptest::prelude::*;

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, HeaderValue::from_str(host).unwrap());
        if let Some(origin) = origin {
            headers.insert(ORIGIN, HeaderValue::from_str(origin).unwrap());
        }
        headers
    }

    #[test]
    fn only_addresses_of_this_machine_are_hosts() {
        for host in ["127.0.0.1:8000", "localhost:8000", "LOCALHOST", "[::1]:8000", "127.0.0.2"] {
            assert_eq!(check(&headers(host, None), true), Ok(()), "{host}");
        }
        for host in ["rebound.example:8000", "192.168.0.7:8000", "localhost.example", "127.0.0.1.example", "", "a b", "[::2]:1"] {
            assert_eq!(check(&headers(host, None), true), Err(Refusal::Host), "{host}");
        }
        assert_eq!(check(&HeaderMap::new(), true), Err(Refusal::Host));
        // When listening on all addresses, access is by IP address only, never by name.
        assert_eq!(check(&headers("192.168.0.7:8000", None), false), Ok(()));
        assert_eq!(check(&headers("rebound.example:8000", None), false), Err(Refusal::Host));
    }

    #[test]
    fn only_its_own_pages_may_connect() {
        let from = |origin: &str| check(&headers("127.0.0.1:8000", Some(origin)), true);
        assert_eq!(from("http://127.0.0.1:8000"), Ok(()));
        for origin in ["http://127.0.0.1:8001", "http://localhost:8000", "https://evil.example", "null", "", "127.0.0.1:8000"] {
            assert_eq!(from(origin), Err(Refusal::Origin), "{origin}");
        }
        let mut twice = headers("127.0.0.1:8000", Some("http://127.0.0.1:8000"));
        twice.append(ORIGIN, HeaderValue::from_static("https://evil.example"));
        assert_eq!(check(&twice, true), Err(Refusal::Origin));
    }

    proptest! {
        #[test]
        fn a_name_is_never_let_in(name in "[a-z0-9.-]{1,20}", loopback in any::<bool>()) {
            prop_assume!(name != "localhost" && name.parse::<IpAddr>().is_err());
            prop_assert!(check(&headers(&name, None), loopback).is_err());
        }
    }
}
