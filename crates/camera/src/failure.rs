//! Why nothing is received, and what to do.

use std::io::ErrorKind;

use crate::film::FilmError;

/// Why a source failed. The texts contain neither passwords nor addresses of servers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum SourceError {
    /// The connection was closed.
    #[error("the camera closed the connection")]
    Ended,
    /// One image by HTTP, not a stream of them.
    #[error("the server sends one image, and ends")]
    Still,
    /// Nothing arrives.
    #[error("no images for {0} s")]
    Silent(u64),
    /// The socket at which packets are to arrive.
    #[error("cannot receive at {address}: {error}")]
    Socket {
        /// Address of this machine, or a multicast group.
        address: std::net::SocketAddr,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// Another codec.
    #[error("the video is {0}, which cannot be decoded")]
    Codec(String),
    /// H.264 that the decoder does not know.
    #[error("the video is H.264, {0}, which cannot be decoded")]
    Profile(String),
    /// Packets of another kind than the address says.
    #[error("{packets} packets arrived, but they seem to be {what}")]
    Packets {
        /// How many.
        packets: u64,
        /// What they seem to be.
        what: String,
        /// What to do.
        hint: String,
    },
    /// Not a stream of images.
    #[error("the server sends {}, not a stream of JPEG images", if .0.is_empty() { "something unnamed".to_owned() } else { format!("`{}`", .0) })]
    NoImages(String),
    /// The server's answer.
    #[error("the server answers {}{}", .code, if .reason.is_empty() { String::new() } else { format!(" ({})", .reason) })]
    Status {
        /// The number, as in RFC 9110 and RFC 7826.
        code: u16,
        /// What it stands for.
        reason: &'static str,
    },
    /// User name or password.
    #[error("{}", if *.given { "the server refuses the user name or the password" } else { "the server asks for a user name and a password" })]
    Refused {
        /// Whether they were sent.
        given: bool,
    },
    /// Another server, to which the first one redirects, asks for user name and password.
    #[error("it redirects to another server, to which the password is not sent")]
    Elsewhere,
    /// The connection.
    #[error("{why}")]
    Connection {
        /// What failed.
        why: String,
        /// What to do.
        hint: &'static str,
    },
    /// A file that cannot be read.
    #[error("cannot read the video: {0}")]
    File(std::io::Error),
    /// A device of this machine.
    #[allow(dead_code, reason = "Video4Linux is not there")]
    #[error("{}: {why}", path.display())]
    Device {
        /// Its file.
        path: std::path::PathBuf,
        /// Why, and what to do.
        why: String,
        /// Whether it may pass by itself, such as when it is plugged in again.
        passes: bool,
    },
    /// A Tello.
    #[error("{why}")]
    Tello {
        /// Why, and what to do.
        why: String,
        /// Whether somebody flies it, so that it must be left alone.
        flies: bool,
    },
    /// A pipeline that cannot be built.
    #[cfg(feature = "gstreamer")]
    #[error("the pipeline cannot be used: {0}")]
    Pipeline(String),
    /// What this program, as it was built, cannot receive.
    #[error("{0}")]
    #[allow(dead_code, reason = "a program with GStreamer, on Linux, lacks nothing")]
    Missing(&'static str),
    /// A file that cannot be decoded.
    #[error(transparent)]
    Film(#[from] FilmError),
}

/// What helps if a server does not answer.
const UNREACHABLE: &str = "check the address, that camera and this machine are in the same network (`ping HOST`), that the camera is on, \
                           and that no firewall is between them";
/// What makes H.264 decodable.
const DECODABLE: &str = "set the camera or its encoder to the profile Baseline, Main or High, not interlaced, with 8 bits and the colours \
                         4:2:0: with ffmpeg `-pix_fmt yuv420p`, with GStreamer `video/x-raw,format=I420` before x264enc";

impl SourceError {
    /// A failure of the connection by the system's error.
    pub(crate) fn connection(why: String, error: Option<&std::io::Error>) -> Self {
        let lower = why.to_ascii_lowercase();
        let hint = match error.map(std::io::Error::kind) {
            _ if lower.contains("lookup address") || lower.contains("resolve") => {
                "no machine is known by this name: check it, or write the camera's IP address, which its router or its app shows"
            }
            _ if lower.contains("certificate") => {
                "this machine does not trust the camera's certificate, which most cameras sign themselves: use http:// in a network of \
                 your own"
            }
            _ if lower.contains("framing error") || lower.contains("invalid http") => {
                "what answers there speaks another language: check scheme and port (RTSP: 554 unless the camera says otherwise)"
            }
            Some(ErrorKind::ConnectionRefused) => {
                "nothing listens at this port of that machine: check the port (RTSP: 554 unless the camera says otherwise), and whether \
                 the camera's stream or server is switched on"
            }
            Some(
                ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::UnexpectedEof | ErrorKind::BrokenPipe,
            ) => {
                "the camera broke the connection off: it may have restarted, or allow fewer viewers: close other programs that watch it"
            }
            Some(ErrorKind::PermissionDenied) => "a firewall or a rule of this machine forbids the connection",
            _ => UNREACHABLE,
        };
        Self::Connection { why, hint }
    }

    /// No answer in time.
    pub(crate) fn no_answer() -> Self {
        Self::Connection { why: "no answer in time".to_owned(), hint: UNREACHABLE }
    }

    /// Whether to try again late, and not to wait for it before a flight: many cameras lock an account after some wrong passwords, and
    /// what cannot be decoded stays so. A server that is starting does not know its streams yet, an interface gets its address later,
    /// and a sender is set right: these are tried again soon.
    pub(crate) fn waits_long(&self) -> bool {
        match self {
            Self::Codec(_)
            | Self::Profile(_)
            | Self::NoImages(_)
            | Self::Refused { .. }
            | Self::Elsewhere
            | Self::File(_)
            | Self::Film(_)
            | Self::Missing(_) => true,
            Self::Status { code, .. } => matches!(code, 401 | 403),
            #[cfg(feature = "gstreamer")]
            Self::Pipeline(_) => true,
            Self::Device { passes, .. } => !passes,
            Self::Tello { flies, .. } => *flies,
            _ => false,
        }
    }

    /// Whether it is what is sent that cannot be read, not the way to it.
    pub(crate) fn is_of_content(&self) -> bool {
        matches!(self, Self::Codec(_) | Self::Profile(_) | Self::Packets { .. })
    }

    /// What to do; `None` if the text says so.
    pub(crate) fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Ended => {
                "it may have restarted, or allow fewer viewers: close other programs that watch it; or try the address with ffplay or VLC"
                    .to_owned()
            }
            Self::Still => {
                "this is the address of a still image, which is too slow to fly by: look for that of the MJPEG stream, or use the camera's \
                 rtsp:// address"
                    .to_owned()
            }
            Self::Silent(_) => {
                "it is connected, but sends nothing: restart the camera, and see whether ffplay or VLC shows its images".to_owned()
            }
            Self::Socket { address, error } => socket(*address, error),
            Self::Codec(codec) if codec.starts_with("H.26") => {
                "set the camera to H.264 or MJPEG (in its web page, under video or encoding; its second stream often is H.264), or let \
                 ffmpeg convert it: `ffmpeg -i ADDRESS -c:v libx264 -tune zerolatency -pix_fmt yuv420p -g 15 -f rtp rtp://127.0.0.1:5600`, \
                 received by udp-rtp://:5600"
                    .to_owned()
            }
            Self::Codec(_) => "set the camera to H.264 or MJPEG, in its web page, under video or encoding".to_owned(),
            Self::Profile(_) => DECODABLE.to_owned(),
            Self::Packets { hint, .. } => hint.clone(),
            Self::NoImages(kind) => no_images(kind),
            Self::Status { code, .. } => status(*code).to_owned(),
            Self::Refused { given: true } => {
                "check both, case included; many cameras lock an account for some minutes after wrong passwords, and some have a separate \
                 account for streams"
                    .to_owned()
            }
            Self::Refused { given: false } => {
                "write the user name into the address (rtsp://USER@HOST/PATH), and the password into the environment variable \
                 CAMERA_PASSWORD"
                    .to_owned()
            }
            Self::Elsewhere => {
                "give that address: `curl -sv ADDRESS` shows it in the line `Location`, and the camera's settings may name it".to_owned()
            }
            Self::Connection { hint, .. } => (*hint).to_owned(),
            Self::File(error) => match error.kind() {
                ErrorKind::NotFound => "check the name; a relative one begins in the present folder".to_owned(),
                ErrorKind::PermissionDenied => "the file may not be read by this user: `ls -l` shows who may".to_owned(),
                _ => return None,
            },
            Self::Film(error) => return error.hint().map(str::to_owned),
            _ => return None,
        })
    }
}

fn socket(address: std::net::SocketAddr, error: &std::io::Error) -> String {
    let port = address.port();
    match error.kind() {
        ErrorKind::AddrInUse => format!(
            "another program receives at this port: `ss -ulpn 'sport = :{port}'` names it; end it, or let the camera send to another port"
        ),
        ErrorKind::AddrNotAvailable => format!(
            "{} is no address of this machine (`ip address` lists them), which is where packets arrive, not whence they come: leave it \
             out, as in udp-rtp://:{port}",
            address.ip()
        ),
        ErrorKind::PermissionDenied => {
            "ports below 1024 are reserved: let the camera send to another one, such as 5600".to_owned()
        }
        _ if address.ip().is_multicast() => "this machine needs an interface in a network that has multicast".to_owned(),
        _ => "check the address and the port".to_owned(),
    }
}

fn no_images(kind: &str) -> String {
    if kind.starts_with("text/") {
        "this is a page for people: give the address of the stream itself, such as http://HOST/video or http://HOST/mjpg/video.mjpg; the \
         camera's manual names it, or the address of the image in the page's source"
    } else if kind.starts_with("video/") || kind.starts_with("application/") {
        "films and HLS are not read by HTTP: look for an MJPEG address of the camera, or use its rtsp:// address"
    } else {
        "look for an MJPEG address of the camera, or use its rtsp:// address"
    }
    .to_owned()
}

/// What a number stands for: in RTSP (RFC 2326, section 7.1.1), else as in HTTP; empty if unknown.
pub(crate) fn reason(code: u16) -> &'static str {
    match code {
        453 => "Not Enough Bandwidth",
        454 => "Session Not Found",
        459 => "Aggregate Operation Not Allowed",
        461 => "Unsupported Transport",
        505 => "Version Not Supported",
        _ => reqwest::StatusCode::from_u16(code).ok().and_then(|code| code.canonical_reason()).unwrap_or_default(),
    }
}

fn status(code: u16) -> &'static str {
    match code {
        301..=399 => {
            "the stream has moved: open the address with another program, such as curl, and use the one to which it leads"
        }
        403 => {
            "this account may not see the stream, or the camera has locked it after wrong passwords: look into the camera's user list"
        }
        404 | 454 => {
            "the camera is there, but has no such stream: check the path; its manual, its web page or an ONVIF program names it"
        }
        405 | 406 | 415 | 459 | 501 | 505 => "the server is there, but is of another kind: check scheme, port and path",
        461 => "the server does not send this way: use rtsp+udp:// in the place of rtsp://, or the other way round",
        429 | 453 => "the camera refuses more viewers: close other programs that watch it, and wait a minute",
        503 => "the camera is busy or just starting, or refuses more viewers: close other programs that watch it, and try again",
        500 | 502 | 504 => "the server itself fails: restart the camera, or look into the log of what serves its stream",
        400 => "the server does not understand the request: check scheme, port and path",
        _ => "try the address with another program, such as ffplay or VLC",
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::io;

    use super::*;

    #[test]
    fn each_failure_has_its_own_advice() {
        let address = "0.0.0.0:5600".parse().unwrap();
        let socket = |kind: ErrorKind| SourceError::Socket { address, error: kind.into() };
        let connection = |kind: ErrorKind| SourceError::connection("it failed".to_owned(), Some(&io::Error::from(kind)));
        let status = |code| SourceError::Status { code, reason: reason(code) };
        let all = [
            (SourceError::Ended, "fewer viewers", false),
            (SourceError::Still, "a still image", false),
            (SourceError::Silent(5), "sends nothing", false),
            (socket(ErrorKind::AddrInUse), "`ss -ulpn 'sport = :5600'` names it", false),
            (socket(ErrorKind::AddrNotAvailable), "no address of this machine", false),
            (socket(ErrorKind::PermissionDenied), "below 1024", false),
            (SourceError::Codec("H.265".to_owned()), "libx264", true),
            (SourceError::Codec("vp8".to_owned()), "web page", true),
            (SourceError::Profile("interlaced".to_owned()), "yuv420p", true),
            (SourceError::NoImages("text/html".to_owned()), "a page for people", true),
            (SourceError::NoImages("video/mp4".to_owned()), "films and HLS", true),
            (SourceError::NoImages(String::new()), "MJPEG address", true),
            (status(302), "has moved", false),
            (status(400), "does not understand", false),
            (status(403), "may not see", true),
            (status(404), "no such stream", false),
            (status(406), "of another kind", false),
            (status(429), "wait a minute", false),
            (status(461), "rtsp+udp://", false),
            (status(500), "itself fails", false),
            (status(503), "busy or just starting", false),
            (SourceError::Refused { given: true }, "case included", true),
            (SourceError::Refused { given: false }, "CAMERA_PASSWORD", true),
            (SourceError::Elsewhere, "give that address", true),
            (connection(ErrorKind::ConnectionRefused), "nothing listens", false),
            (connection(ErrorKind::ConnectionReset), "broke the connection off", false),
            (SourceError::connection("failed to lookup address information".to_owned(), None), "no machine is known", false),
            (SourceError::connection("invalid peer certificate: UnknownIssuer".to_owned(), None), "does not trust", false),
            (SourceError::connection("RTSP framing error: x".to_owned(), None), "another language", false),
            (connection(ErrorKind::HostUnreachable), "`ping HOST`", false),
            (SourceError::File(ErrorKind::NotFound.into()), "check the name", true),
            (SourceError::File(ErrorKind::PermissionDenied.into()), "`ls -l`", true),
        ];
        let mut hints = BTreeSet::new();
        for (error, expected, waits_long) in &all {
            let hint = error.hint().unwrap();
            assert!(hint.contains(expected), "{error}: {hint}");
            assert_eq!(error.waits_long(), *waits_long, "{error}");
            hints.insert(hint);
        }
        assert_eq!(hints.len(), all.len(), "none stands for two");
        assert_eq!(status(503).to_string(), "the server answers 503 (Service Unavailable)");
        assert_eq!(status(299).to_string(), "the server answers 299");
    }
}
