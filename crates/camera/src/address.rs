//! Addresses of cameras, such as `rtsp://admin:secret@192.168.1.64/stream1` or `udp-rtp://:5600`.
//!
//! Passwords are kept apart from the address and are never printed: not by `Display`, not by `Debug`, and not by errors.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::str::FromStr;

use percent_encoding::percent_decode_str;

/// The forms of a camera's address, for help texts and errors.
pub const FORMS: &[&str] = &[
    "rtsp://HOST/PATH",
    "rtsp+udp://HOST/PATH",
    "udp-rtp://[HOST]:PORT",
    "udp-ts://[HOST]:PORT",
    "http://HOST/PATH",
    "file:VIDEO",
];

/// Longest address, bytes.
const LONGEST: usize = 2048;

/// Where a camera is found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CameraUrl {
    /// An RTSP server with H.264 or JPEG video.
    Rtsp {
        /// The server and the stream.
        server: Server,
        /// How RTP packets travel.
        transport: Transport,
    },
    /// H.264 in RTP packets that are sent to this machine by UDP.
    UdpRtp(SocketAddr),
    /// H.264 in an MPEG transport stream that is sent to this machine by UDP.
    UdpTs(SocketAddr),
    /// A server that sends JPEG images in one endless HTTP response.
    Mjpeg(Server),
    /// A video file, played in real time.
    File(PathBuf),
}

/// Transport of the RTP packets of an RTSP stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Within the RTSP connection: nothing is lost, but a loss in the network delays what follows.
    Tcp,
    /// UDP: what is lost stays lost.
    Udp,
}

/// A server with a user name and a password, if needed.
#[derive(Clone, PartialEq, Eq)]
pub struct Server {
    /// Scheme, host, port, path and query, without user name and password.
    pub url: String,
    /// User name and password.
    pub credentials: Option<Credentials>,
}

/// A user name and a password. Neither is printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Credentials {
    /// User name.
    pub user: String,
    /// Password; empty if there is none.
    pub password: String,
}

impl CameraUrl {
    /// User name and password, if the address has some.
    #[must_use]
    pub fn credentials_mut(&mut self) -> Option<&mut Credentials> {
        match self {
            Self::Rtsp { server, .. } | Self::Mjpeg(server) => server.credentials.as_mut(),
            Self::UdpRtp(_) | Self::UdpTs(_) | Self::File(_) => None,
        }
    }
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Credentials(…)")
    }
}

impl fmt::Display for Server {
    /// The query of some cameras contains a password (`?user=admin&pwd=…`), and the path of others does
    /// (`/user=admin_password=…`), so these are hidden too.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (before, query) = match self.url.split_once('?') {
            Some((before, query)) => (before, Some(query)),
            None => (self.url.as_str(), None),
        };
        let (scheme, rest) = before.split_once("://").unwrap_or(("", before));
        write!(f, "{scheme}://")?;
        if self.credentials.is_some() {
            f.write_str("…@")?;
        }
        let lower = rest.to_ascii_lowercase();
        match rest.find('/') {
            Some(path) if ["pass", "pwd"].iter().any(|word| lower[path..].contains(word)) => write!(f, "{}/…", &rest[..path])?,
            _ => f.write_str(rest)?,
        }
        if query.is_some() {
            f.write_str("?…")?;
        }
        Ok(())
    }
}

impl fmt::Debug for Server {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Server({self})")
    }
}

impl fmt::Display for CameraUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rtsp { server, transport: Transport::Tcp } | Self::Mjpeg(server) => server.fmt(f),
            Self::Rtsp { server, transport: Transport::Udp } => {
                let text = server.to_string();
                write!(f, "rtsp+udp{}", text.strip_prefix("rtsp").unwrap_or(&text))
            }
            Self::UdpRtp(address) => write!(f, "udp-rtp://{address}"),
            Self::UdpTs(address) => write!(f, "udp-ts://{address}"),
            Self::File(path) => write!(f, "file:{}", path.display()),
        }
    }
}

/// Why a camera's address was rejected. The texts do not quote it, since it may contain a password.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AddressError {
    /// No scheme, or an unknown one.
    #[error("a camera's address has one of the forms {}", forms())]
    Scheme,
    /// No host.
    #[error("the host is missing: SCHEME://HOST/PATH")]
    NoHost,
    /// An invalid port.
    #[error("the port is not a number from 1 to 65535")]
    Port,
    /// The port of a UDP stream is missing.
    #[error("the port is missing: for example udp-rtp://:5600")]
    NoPort,
    /// The address at which UDP is received must be an IP address.
    #[error("the address at which UDP packets are received must be an IP address of this machine, a multicast group, or empty")]
    NotIp,
    /// UDP streams have no path.
    #[error("nothing may follow the port of a UDP stream")]
    Path,
    /// A file without a name.
    #[error("the name of the file is missing: file:VIDEO")]
    NoFile,
    /// Spaces and control characters.
    #[error("an address contains no spaces and no control characters: write them as %20 and so on")]
    Character,
    /// Characters of a user name or password that end the host.
    #[error("in a user name or password, write # as %23, / as %2F, ? as %3F and @ as %40; in a path, @ as %40")]
    Reserved,
    /// Too long.
    #[error("the address is longer than {LONGEST} characters")]
    Long,
}

fn forms() -> String {
    FORMS.join(", ")
}

impl FromStr for CameraUrl {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        if text.len() > LONGEST {
            return Err(AddressError::Long);
        }
        // A file's name may contain anything.
        if let Some(path) = text.strip_prefix("file:") {
            return if path.is_empty() { Err(AddressError::NoFile) } else { Ok(Self::File(PathBuf::from(path))) };
        }
        let (scheme, rest) = text.split_once("://").ok_or(AddressError::Scheme)?;
        if rest.chars().any(|letter| letter.is_whitespace() || letter.is_control()) {
            return Err(AddressError::Character);
        }
        match scheme {
            "udp-rtp" => udp(rest).map(Self::UdpRtp),
            "udp-ts" => udp(rest).map(Self::UdpTs),
            "rtsp" | "rtsp+udp" => {
                let transport = if scheme == "rtsp" { Transport::Tcp } else { Transport::Udp };
                Ok(Self::Rtsp { server: server("rtsp", rest)?, transport })
            }
            "http" | "https" => server(scheme, rest).map(Self::Mjpeg),
            _ => Err(AddressError::Scheme),
        }
    }
}

/// `[HOST]:PORT` of a UDP stream.
fn udp(rest: &str) -> Result<SocketAddr, AddressError> {
    if rest.contains(['/', '?', '#']) {
        return Err(AddressError::Path);
    }
    // The colon of `[::1]` is no separator.
    let (host, port) = match rest.rsplit_once(':') {
        Some((host, port)) if !port.ends_with(']') => (host, port),
        _ => return Err(AddressError::NoPort),
    };
    let port = port_number(port)?;
    let host = host.strip_prefix('@').unwrap_or(host);
    if host.is_empty() {
        return Ok(SocketAddr::new(IpAddr::V4(Ipv4Addr::UNSPECIFIED), port));
    }
    let host = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    host.parse::<IpAddr>().map(|ip| SocketAddr::new(ip, port)).map_err(|_| AddressError::NotIp)
}

fn port_number(text: &str) -> Result<u16, AddressError> {
    // `u16::from_str` accepts a plus sign.
    let digits = text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|port| digits && *port > 0).ok_or(AddressError::Port)
}

/// `[USER[:PASSWORD]@]HOST[:PORT][/PATH][?QUERY]`.
fn server(scheme: &str, rest: &str) -> Result<Server, AddressError> {
    let end = rest.find(['/', '?']).unwrap_or(rest.len());
    let (authority, tail) = rest.split_at(end);
    // Else a part of a password would pass for a host or a path, and be shown.
    if rest.contains('#') || (tail.contains('@') && !authority.contains('@')) {
        return Err(AddressError::Reserved);
    }
    // A password may contain an unescaped `@`; a host cannot.
    let (credentials, host) = match authority.rsplit_once('@') {
        Some((before, host)) => (Some(credentials(before)), host),
        None => (None, authority),
    };
    let (name, port) = match host.rsplit_once(':') {
        Some((name, port)) if !port.ends_with(']') => (name, Some(port_number(port)?)),
        _ => (host, None),
    };
    let letter = |letter: char| letter.is_ascii_alphanumeric() || "-._~[]:%".contains(letter) || !letter.is_ascii();
    if name.is_empty() || !name.chars().all(letter) {
        return Err(AddressError::NoHost);
    }
    let port = port.map_or(String::new(), |port| format!(":{port}"));
    let tail = if tail.starts_with('?') { format!("/{tail}") } else { tail.to_owned() };
    Ok(Server { url: format!("{scheme}://{name}{port}{tail}"), credentials })
}

fn credentials(text: &str) -> Credentials {
    let (user, password) = text.split_once(':').unwrap_or((text, ""));
    let plain = |text: &str| percent_decode_str(text).decode_utf8_lossy().into_owned();
    Credentials { user: plain(user), password: plain(password) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> Result<CameraUrl, AddressError> {
        text.parse()
    }

    #[test]
    fn addresses_are_read() {
        let any = |port| SocketAddr::from(([0, 0, 0, 0], port));
        assert_eq!(read("udp-rtp://:5600"), Ok(CameraUrl::UdpRtp(any(5600))));
        assert_eq!(read("udp-ts://@:1234"), Ok(CameraUrl::UdpTs(any(1234))));
        assert_eq!(read("udp-rtp://239.1.2.3:5600"), Ok(CameraUrl::UdpRtp("239.1.2.3:5600".parse().unwrap())));
        assert_eq!(read("udp-ts://[::1]:9"), Ok(CameraUrl::UdpTs("[::1]:9".parse().unwrap())));
        assert_eq!(read("file:my film.mp4"), Ok(CameraUrl::File("my film.mp4".into())));
        let Ok(CameraUrl::Mjpeg(server)) = read("http://us%65r:pa%3Ass@w@cam.local:8080?channel=1") else { panic!() };
        assert_eq!(server.url, "http://cam.local:8080/?channel=1");
        let credentials = server.credentials.unwrap();
        assert_eq!((credentials.user.as_str(), credentials.password.as_str()), ("user", "pa:ss@w"));
        let Ok(CameraUrl::Rtsp { server, transport }) = read("rtsp+udp://a:b@10.0.0.2/live") else { panic!() };
        assert_eq!(
            (server.url.as_str(), server.credentials.is_some(), transport),
            ("rtsp://10.0.0.2/live", true, Transport::Udp)
        );
        let Ok(CameraUrl::Mjpeg(server)) = read("https://[fe80::1]/mjpeg") else { panic!() };
        assert_eq!((server.url.as_str(), server.credentials), ("https://[fe80::1]/mjpeg", None));
    }

    #[test]
    fn wrong_addresses_are_refused() {
        for (text, error) in [
            ("", AddressError::Scheme),
            ("192.168.1.64", AddressError::Scheme),
            ("ftp://host/x", AddressError::Scheme),
            ("rtsp://admin:2024#secret@192.168.1.64/s", AddressError::Reserved),
            ("rtsp://admin:12/34@192.168.1.64/s", AddressError::Reserved),
            ("http://admin?x@192.168.1.64/s", AddressError::Reserved),
            ("http:///mjpeg", AddressError::NoHost),
            ("http://user:password@/mjpeg", AddressError::NoHost),
            ("http://host:port/", AddressError::Port),
            ("http://host:+80/", AddressError::Port),
            ("udp-rtp://:0", AddressError::Port),
            ("udp-rtp://5600", AddressError::NoPort),
            ("udp-rtp://[::1]", AddressError::NoPort),
            ("udp-rtp://camera:5600", AddressError::NotIp),
            ("udp-ts://:5600/stream", AddressError::Path),
            ("file:", AddressError::NoFile),
            ("http://host/a b", AddressError::Character),
        ] {
            assert_eq!(read(text), Err(error), "{text}");
        }
        assert_eq!(read(&format!("http://host/{}", "x".repeat(LONGEST))), Err(AddressError::Long));
    }

    proptest! {
        #[test]
        fn no_password_is_ever_printed(
            scheme in "(http|https|rtsp|rtsp\\+udp|udp-rtp|ftp|)", user in "[a-z]{0,6}", secret in "[A-Z0-9]{8,12}",
            host in "(cam|10\\.0\\.0\\.1|\\[::1\\]|)", tail in "(:80|:x|:0|)(/[a-z]{0,5}|/user=x_passWord=|)(\\?pwd=|)",
        ) {
            let query = if tail.ends_with('=') { secret.as_str() } else { "" };
            match read(&format!("{scheme}://{user}:{secret}@{host}{tail}{query}")) {
                Ok(url) => {
                    prop_assert!(!url.to_string().contains(&secret), "{}", url);
                    let shown = format!("{url:?}");
                    prop_assert!(!shown.contains(&secret), "{}", shown);
                }
                Err(error) => {
                    let shown = format!("{error} {error:?}");
                    prop_assert!(!shown.contains(&secret), "{}", shown);
                }
            }
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,60}", scheme in "(file:|udp-rtp://|http://|rtsp://|)") {
            drop(read(&format!("{scheme}{text}")));
        }

        #[test]
        fn what_is_printed_is_read_again(port in 1..u16::MAX, ts in any::<bool>()) {
            let address = SocketAddr::from(([10, 0, 0, 1], port));
            let url = if ts { CameraUrl::UdpTs(address) } else { CameraUrl::UdpRtp(address) };
            prop_assert_eq!(read(&url.to_string()), Ok(url));
        }
    }
}
