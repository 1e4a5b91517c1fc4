//! The address of a vehicle of a simulator: `HOST[:PORT][/VEHICLE]`.

use std::fmt;
use std::net::Ipv6Addr;
use std::str::FromStr;

use super::wire::PORT;

/// Longest name of a vehicle, bytes.
const LONGEST_NAME: usize = 128;

/// Where a simulator listens, and which of its vehicles is meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Name or address of the machine; an IPv6 address without its brackets.
    pub host: String,
    /// TCP port.
    pub port: u16,
    /// Name of the vehicle; empty for the simulator's first.
    pub vehicle: String,
}

impl Default for Address {
    /// The first vehicle of a simulator on this machine.
    fn default() -> Self {
        Self { host: "127.0.0.1".to_owned(), port: PORT, vehicle: String::new() }
    }
}

impl Address {
    /// Whether it is one of this machine.
    #[must_use]
    pub fn is_here(&self) -> bool {
        self.host == "localhost" || self.host.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback())
    }

    /// Host and port.
    #[must_use]
    pub fn server(&self) -> String {
        if self.host.contains(':') { format!("[{}]:{}", self.host, self.port) } else { format!("{}:{}", self.host, self.port) }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.server())?;
        if self.vehicle.is_empty() { Ok(()) } else { write!(f, "/{}", self.vehicle) }
    }
}

/// What is no address of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected HOST[:PORT][/VEHICLE], such as 127.0.0.1:41451/Drone1")]
pub struct NoAddress;

impl FromStr for Address {
    type Err = NoAddress;

    fn from_str(text: &str) -> Result<Self, NoAddress> {
        let (server, vehicle) = match text.split_once('/') {
            Some((server, vehicle)) => (server, Some(vehicle)),
            None => (text, None),
        };
        let is_name = |name: &str| !name.is_empty() && name.len() <= LONGEST_NAME && !name.chars().any(char::is_control);
        let vehicle = vehicle.map_or(Ok(""), |name| if is_name(name) { Ok(name) } else { Err(NoAddress) })?;
        let (host, port) = if let Some(rest) = server.strip_prefix('[') {
            let (host, rest) = rest.split_once(']').ok_or(NoAddress)?;
            host.parse::<Ipv6Addr>().map_err(|_| NoAddress)?;
            (host, if rest.is_empty() { None } else { Some(rest.strip_prefix(':').ok_or(NoAddress)?) })
        } else if server.parse::<Ipv6Addr>().is_ok() {
            (server, None)
        } else {
            server.split_once(':').map_or((server, None), |(host, port)| (host, Some(port)))
        };
        let is_host = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_' | ':');
        if host.is_empty() || !host.chars().all(is_host) {
            return Err(NoAddress);
        }
        let port = port.map_or(Ok(PORT), |port| port.parse().ok().filter(|port| *port > 0).ok_or(NoAddress))?;
        Ok(Self { host: host.to_owned(), port, vehicle: vehicle.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn host_port_and_vehicle_are_told_apart() {
        let of = |text: &str| text.parse::<Address>().map(|at| (at.host, at.port, at.vehicle));
        let is = |host: &str, port, vehicle: &str| Ok((host.to_owned(), port, vehicle.to_owned()));
        assert_eq!(of("127.0.0.1"), is("127.0.0.1", PORT, ""));
        assert_eq!(of("sim.local:5000"), is("sim.local", 5000, ""));
        assert_eq!(of("sim/Drone 1"), is("sim", PORT, "Drone 1"));
        assert_eq!(of("[::1]:9/a/b"), is("::1", 9, "a/b"));
        assert_eq!(of("::1"), is("::1", PORT, ""));
        let wrong = ["", ":1", "/a", "a:", "a:0", "a:70000", "a/", "a b", "[::1", "[x]:1", "[::1]9", "a:1:2", "a/b\n", "a@b"];
        for wrong in wrong {
            assert_eq!(of(wrong), Err(NoAddress), "{wrong}");
        }
        let here = ["127.0.0.1", "127.3.4.5:1", "localhost/a", "[::1]:7"].map(|text| text.parse::<Address>().unwrap().is_here());
        assert_eq!(here, [true; 4]);
        assert!(!"192.168.0.9".parse::<Address>().unwrap().is_here());
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused_and_what_is_read_is_written_as_it_was(text in "\\PC{0,40}") {
            if let Ok(address) = text.parse::<Address>() {
                prop_assert_eq!(address.to_string().parse::<Address>(), Ok(address));
            }
        }
    }
}
