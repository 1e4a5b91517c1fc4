//! Addresses of MAVLink links, in the spellings of the Rust crate `mavlink`, of pymavlink and of MAVSDK.

use core::fmt;
use core::str::FromStr;

/// Default port at which an offboard program listens for PX4 (`px4-rc.mavlink`).
pub const OFFBOARD_PORT: u16 = 14_540;
/// Default TCP port of ArduPilot's SITL.
pub const SITL_PORT: u16 = 5760;
/// Default rate of a serial port, bits per second (SiK radios).
pub const SERIAL_RATE: u32 = 57_600;

/// A host (an IP address or a name) and a port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HostPort {
    /// IP address without brackets, or a name.
    pub host: String,
    /// The port.
    pub port: u16,
}

impl fmt::Display for HostPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { host, port } = self;
        if host.contains(':') { write!(f, "[{host}]:{port}") } else { write!(f, "{host}:{port}") }
    }
}

/// Where a vehicle is reached.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MavlinkUrl {
    /// Listen on a UDP port; the vehicle sends first.
    UdpIn(HostPort),
    /// Send to a UDP port.
    UdpOut(HostPort),
    /// Connect to a TCP port.
    TcpOut(HostPort),
    /// Listen on a TCP port, for one vehicle.
    TcpIn(HostPort),
    /// A serial port.
    Serial {
        /// Device file.
        path: String,
        /// Bits per second.
        rate: u32,
    },
}

/// An address that is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{text}` is no MAVLink address: use udpin:HOST:PORT, udpout:HOST:PORT, tcpout:HOST:PORT, tcpin:HOST:PORT or \
     serial:DEVICE[:RATE]"
)]
pub struct MavlinkUrlError {
    /// What was given.
    pub text: String,
}

impl Default for MavlinkUrl {
    /// Listening for a PX4 on this machine or in this network.
    fn default() -> Self {
        Self::UdpIn(HostPort { host: "0.0.0.0".to_owned(), port: OFFBOARD_PORT })
    }
}

impl MavlinkUrl {
    /// Whether the link is a radio or cable of low rate, below 115200 bits per second.
    #[must_use]
    pub fn is_slow(&self) -> bool {
        matches!(self, Self::Serial { rate, .. } if *rate < 115_200)
    }
}

impl FromStr for MavlinkUrl {
    type Err = MavlinkUrlError;

    fn from_str(text: &str) -> Result<Self, MavlinkUrlError> {
        parse(text).ok_or_else(|| MavlinkUrlError { text: text.to_owned() })
    }
}

impl fmt::Display for MavlinkUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UdpIn(at) => write!(f, "udpin:{at}"),
            Self::UdpOut(at) => write!(f, "udpout:{at}"),
            Self::TcpOut(at) => write!(f, "tcpout:{at}"),
            Self::TcpIn(at) => write!(f, "tcpin:{at}"),
            Self::Serial { path, rate } => write!(f, "serial:{path}:{rate}"),
        }
    }
}

fn parse(text: &str) -> Option<MavlinkUrl> {
    if text.starts_with('/') {
        return serial(text);
    }
    let (scheme, rest) = text.split_once(':')?;
    let rest = rest.strip_prefix("//").unwrap_or(rest);
    Some(match scheme {
        // MAVSDK's `udp://` and pymavlink's `udp:` listen.
        "udpin" | "udp" => MavlinkUrl::UdpIn(host_port(rest, "0.0.0.0", OFFBOARD_PORT)?),
        "udpout" => MavlinkUrl::UdpOut(host_port(rest, "127.0.0.1", OFFBOARD_PORT).filter(has_port)?),
        "tcpout" | "tcp" => MavlinkUrl::TcpOut(host_port(rest, "127.0.0.1", SITL_PORT).filter(has_port)?),
        "tcpin" => MavlinkUrl::TcpIn(host_port(rest, "0.0.0.0", SITL_PORT)?),
        "serial" => return serial(rest),
        _ => return None,
    })
}

/// A listener on port 0 gets a free one; nobody can be reached there.
fn has_port(at: &HostPort) -> bool {
    at.port != 0
}

/// `HOST:PORT`, `HOST`, `:PORT`, `[IPV6]:PORT`; a missing part has its default.
fn host_port(text: &str, host: &str, port: u16) -> Option<HostPort> {
    let text = text.strip_suffix('/').unwrap_or(text);
    let (name, number) = if let Some(rest) = text.strip_prefix('[') {
        let (name, after) = rest.split_once(']')?;
        name.parse::<std::net::Ipv6Addr>().ok()?;
        (name, if after.is_empty() { None } else { Some(after.strip_prefix(':')?) })
    } else {
        text.split_once(':').map_or((text, None), |(name, number)| (name, Some(number)))
    };
    let is_of_a_name = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_' | ':');
    if name.len() > 253 || !name.chars().all(is_of_a_name) {
        return None;
    }
    let port = number.map_or(Some(port), |number| number.parse().ok())?;
    Some(HostPort { host: if name.is_empty() { host } else { name }.to_owned(), port })
}

/// `DEVICE[:RATE]`; MAVProxy writes a comma.
fn serial(text: &str) -> Option<MavlinkUrl> {
    let (path, rate) = text.rsplit_once([':', ',']).map_or((text, None), |(path, rate)| (path, Some(rate)));
    let rate = rate.map_or(Some(SERIAL_RATE), |rate| rate.parse().ok().filter(|rate| (1200..=4_000_000).contains(rate)))?;
    // Two slashes begin nothing else than what follows a scheme.
    (!path.is_empty() && path.len() <= 4096 && !path.starts_with("//"))
        .then(|| MavlinkUrl::Serial { path: path.to_owned(), rate })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> String {
        text.parse::<MavlinkUrl>().map_or_else(|error| error.to_string(), |url| url.to_string())
    }

    #[test]
    fn every_spelling_of_the_three_libraries_is_read() {
        for (text, meant) in [
            ("udpin:0.0.0.0:14540", "udpin:0.0.0.0:14540"),
            ("udpin://0.0.0.0:14540", "udpin:0.0.0.0:14540"),
            ("udp://:14540", "udpin:0.0.0.0:14540"),
            ("udp:127.0.0.1:14550", "udpin:127.0.0.1:14550"),
            ("udpin:", "udpin:0.0.0.0:14540"),
            ("udpout:10.0.0.2:14550", "udpout:10.0.0.2:14550"),
            ("udpout://drone.local:14550/", "udpout:drone.local:14550"),
            ("tcpout:127.0.0.1:5760", "tcpout:127.0.0.1:5760"),
            ("tcp:127.0.0.1", "tcpout:127.0.0.1:5760"),
            ("tcp://[::1]:5762", "tcpout:[::1]:5762"),
            ("tcpin://0.0.0.0:5760", "tcpin:0.0.0.0:5760"),
            ("serial:/dev/ttyACM0:57600", "serial:/dev/ttyACM0:57600"),
            ("serial:///dev/ttyUSB0:921600", "serial:/dev/ttyUSB0:921600"),
            ("/dev/ttyUSB0", "serial:/dev/ttyUSB0:57600"),
            ("/dev/ttyUSB0,115200", "serial:/dev/ttyUSB0:115200"),
        ] {
            assert_eq!(read(text), meant, "{text}");
        }
    }

    #[test]
    fn what_is_no_address_is_told_with_the_forms() {
        for text in [
            "",
            "tello",
            "udpin",
            "http:1.2.3.4:5",
            "udpout:1.2.3.4:0",
            "udpin:a b:1",
            "tcp:[::g]:1",
            "serial:",
            "serial:/dev/x:9",
        ] {
            assert!(read(text).contains("is no MAVLink address: use udpin:HOST:PORT"), "{text}: {}", read(text));
        }
    }

    proptest! {
        #[test]
        fn what_is_read_is_written_so_that_it_reads_the_same(text in "(udp|udpin|udpout|tcp|tcpin|serial|)(:|://|)[ -~]{0,30}") {
            if let Ok(url) = text.parse::<MavlinkUrl>() {
                prop_assert_eq!(url.to_string().parse(), Ok(url));
            }
        }
    }
}
