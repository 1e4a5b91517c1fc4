//! Addresses of cameras, such as `rtsp://admin:secret@192.168.1.64/stream1` or `udp-rtp://:5600`.
//!
//! Passwords are kept apart from the address and are never printed: not by `Display`, not by `Debug`, and not by errors.

mod suggestion;

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::str::FromStr;

use percent_encoding::percent_decode_str;
use spf_drone::tello::driver::command_port;

pub use suggestion::suggestion;

/// The forms of a camera's address, for help texts and errors.
pub const FORMS: &[&str] = &[
    "rtsp://HOST/PATH",
    "rtsp+udp://HOST/PATH",
    "udp-rtp://[HOST]:PORT",
    "udp-ts://[HOST]:PORT",
    "http://HOST/PATH",
    "v4l2:/dev/videoN[?size=WxH&fps=N]",
    "file:VIDEO[?loop=true]",
    "tello[@ADDRESS]",
    "gstreamer:PIPELINE",
];

/// What follows the name of a video that is played again and again.
const REPEATED: &str = "?loop=true";

/// Longest address, bytes.
const LONGEST: usize = 2048;
/// Longest side of the images of a local camera, pixels, and its most images per second.
const SIDE: u32 = 8192;
const RATE: u32 = 240;

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
    /// A camera of this machine, by Video4Linux.
    V4l2(LocalCamera),
    /// A video file, played in real time.
    File {
        /// The file.
        path: PathBuf,
        /// Whether it begins again after its end.
        repeats: bool,
    },
    /// The video of a DJI/Ryze Tello, whose command port this is.
    Tello(SocketAddr),
    /// What a pipeline of GStreamer gives.
    Gstreamer(Pipeline),
}

/// A camera of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocalCamera {
    /// Its device file, such as `/dev/video0`.
    pub path: PathBuf,
    /// Width and height of its images, pixels, unless any will do.
    pub size: Option<(u32, u32)>,
    /// Images per second, unless any number will do.
    pub rate: Option<u32>,
}

/// A pipeline of GStreamer, in the language of `gst-launch-1.0`. It is not printed, since it may contain passwords.
#[derive(Clone, PartialEq, Eq)]
pub struct Pipeline(pub String);

impl fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Pipeline(…)")
    }
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
            Self::UdpRtp(_) | Self::UdpTs(_) | Self::V4l2(_) | Self::File { .. } | Self::Tello(_) | Self::Gstreamer(_) => None,
        }
    }

    /// Whether a text has the form of a camera's address, valid or not, so that it is not the name of a file.
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        let schemes = ["file:", "v4l2:", "gstreamer:"];
        text.contains("://")
            || schemes.iter().any(|scheme| text.starts_with(scheme))
            || text == "tello"
            || text.starts_with("tello@")
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
            Self::V4l2(LocalCamera { path, size, rate }) => {
                write!(f, "v4l2:{}", path.display())?;
                let size = size.map(|(width, height)| format!("size={width}x{height}"));
                let wanted: Vec<String> = size.into_iter().chain(rate.map(|rate| format!("fps={rate}"))).collect();
                if wanted.is_empty() { Ok(()) } else { write!(f, "?{}", wanted.join("&")) }
            }
            Self::File { path, repeats } => write!(f, "file:{}{}", path.display(), if *repeats { REPEATED } else { "" }),
            Self::Tello(address) => write!(f, "tello@{address}"),
            Self::Gstreamer(_) => f.write_str("gstreamer:…"),
        }
    }
}

/// Why a camera's address was rejected. The texts do not quote it, since it may contain a password.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AddressError {
    /// No scheme, or an unknown one.
    #[error("it begins with none of the schemes that cameras have")]
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
    /// A file with a host.
    #[error("a file has no host: file:VIDEO, or file:/FOLDER/VIDEO")]
    FileHost,
    /// A local camera without a device file.
    #[error("the device is missing: for example v4l2:/dev/video0 (`ls /dev/video*` lists them)")]
    NoDevice,
    /// What may follow the device file of a local camera.
    #[error("after the device only the size and the rate may follow: v4l2:/dev/video0?size=1280x720&fps=30")]
    Mode,
    /// What may follow the name of a file.
    #[error("after the name of the file only ?loop=true may follow")]
    Repeats,
    /// The address of a Tello.
    #[error("the address of a Tello is an IP address: tello@192.168.10.1")]
    NoTello,
    /// An empty pipeline.
    #[error("the pipeline is missing: for example gstreamer:videotestsrc")]
    NoPipeline,
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

impl FromStr for CameraUrl {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        if text.len() > LONGEST {
            return Err(AddressError::Long);
        }
        // A file's name may contain anything.
        if let Some(path) = text.strip_prefix("file:") {
            return file(path);
        }
        if let Some(rest) = text.strip_prefix("v4l2:") {
            return local(rest).map(Self::V4l2);
        }
        if let Some(pipeline) = text.strip_prefix("gstreamer:") {
            let pipeline = pipeline.trim();
            return if pipeline.is_empty() {
                Err(AddressError::NoPipeline)
            } else {
                Ok(Self::Gstreamer(Pipeline(pipeline.to_owned())))
            };
        }
        if text == "tello" || text.starts_with("tello@") {
            return command_port(text).map(Self::Tello).ok_or(AddressError::NoTello);
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

/// `VIDEO[?loop=true]`.
fn file(text: &str) -> Result<CameraUrl, AddressError> {
    let (path, repeats) = match text.rsplit_once("?loop=") {
        Some((path, "true")) => (path, true),
        Some((path, "false")) => (path, false),
        Some(_) => return Err(AddressError::Repeats),
        None => (text, false),
    };
    // `file:///home/me/film.mp4` is spelled like an address of the web.
    let path = match path.strip_prefix("//") {
        Some(absolute) if absolute.starts_with('/') => &absolute[absolute.bytes().take_while(|byte| *byte == b'/').count() - 1..],
        Some(_) => return Err(AddressError::FileHost),
        None => path,
    };
    if path.is_empty() { Err(AddressError::NoFile) } else { Ok(CameraUrl::File { path: PathBuf::from(path), repeats }) }
}

/// `DEVICE[?size=WIDTHxHEIGHT&fps=RATE]`.
fn local(text: &str) -> Result<LocalCamera, AddressError> {
    let (path, query) = text.split_once('?').unwrap_or((text, ""));
    // `v4l2:///dev/video0` is spelled like an address of the web.
    let path = path.strip_prefix("//").filter(|path| path.starts_with('/')).unwrap_or(path);
    if path.is_empty() {
        return Err(AddressError::NoDevice);
    }
    let mut camera = LocalCamera { path: PathBuf::from(path), size: None, rate: None };
    for part in query.split('&').filter(|part| !part.is_empty()) {
        match part.split_once('=') {
            Some(("size", value)) if camera.size.is_none() => {
                let (width, height) = value.split_once('x').ok_or(AddressError::Mode)?;
                camera.size = Some((number(width, SIDE)?, number(height, SIDE)?));
            }
            Some(("fps", value)) if camera.rate.is_none() => camera.rate = Some(number(value, RATE)?),
            _ => return Err(AddressError::Mode),
        }
    }
    Ok(camera)
}

/// A number from 1 to `most`.
fn number(text: &str, most: u32) -> Result<u32, AddressError> {
    let digits = text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|number| digits && (1..=most).contains(number)).ok_or(AddressError::Mode)
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
mod tests;
