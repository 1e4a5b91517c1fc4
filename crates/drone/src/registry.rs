//! The available drivers, and how their craft are named on the command line.

use std::error::Error;
use std::time::Instant;

use crate::driver::{Connected, Driver, Target};
use crate::options::Options;
use crate::{airsim, mavlink, screen, tello};

/// The drivers, one row each.
pub static DRIVERS: &[Driver] = &[tello::driver::DRIVER, mavlink::driver::DRIVER, airsim::driver::DRIVER, screen::driver::DRIVER];

/// An unknown drone name.
#[derive(Debug, thiserror::Error)]
#[error("unknown drone `{word}`: use {}", Self::forms())]
pub struct UnknownDrone {
    /// The name.
    pub word: String,
}

impl UnknownDrone {
    fn forms() -> String {
        alternatives(&forms())
    }
}

/// The forms of the names of all drivers' craft, such as `tello[@ADDRESS]`.
#[must_use]
pub fn forms() -> Vec<&'static str> {
    DRIVERS.iter().map(|driver| driver.form).collect()
}

/// The words as a list of alternatives: `a`, `a or b`, `a, b or c`.
#[must_use]
pub fn alternatives(words: &[&str]) -> String {
    match words {
        [first @ .., before, last] => [first, &[&format!("{before} or {last}")]].concat().join(", "),
        _ => words.concat(),
    }
}

/// Parses a name such as `tello@192.168.10.1`.
///
/// # Errors
/// [`UnknownDrone`] if no driver has this name or its address is invalid.
pub fn named(word: &str) -> Result<(&'static Driver, Box<dyn Target>), UnknownDrone> {
    let (scheme, rest) = word.split_at(word.find(['@', ':']).unwrap_or(word.len()));
    let driver = DRIVERS.iter().find(|driver| driver.scheme == scheme);
    let found = driver.and_then(|driver| Some((driver, (driver.target)(rest)?)));
    found.ok_or_else(|| UnknownDrone { word: word.to_owned() })
}

/// Connects to the craft with this name. `start` is flight time zero.
///
/// ```no_run
/// use std::time::Instant;
///
/// use spf_drone::options::Options;
/// use spf_drone::registry;
///
/// let connected = registry::connect("tello@192.168.10.1", &Options::default(), Instant::now())?;
/// println!("{}", connected.drone.name());
/// # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
/// ```
///
/// # Errors
/// [`UnknownDrone`] and [`ConnectError`](crate::driver::ConnectError).
pub fn connect(word: &str, options: &Options, start: Instant) -> Result<Connected, Box<dyn Error + Send + Sync>> {
    let (_, target) = named(word)?;
    Ok(target.connect(options, start)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drone_is_found_by_its_scheme_and_an_address_that_is_one() {
        for word in ["tello", "tello@192.168.10.1", "tello@[::1]:8889", "tello@127.0.0.1:40000"] {
            assert_eq!(named(word).map(|(driver, _)| driver.scheme).map_err(|error| error.to_string()), Ok("tello"));
        }
        for word in ["", "sim", "telo", "tello@", "tello@nowhere", "tello:192.168.10.1", "@192.168.10.1"] {
            let error = named(word).err().unwrap().to_string();
            assert!(error.starts_with(&format!("unknown drone `{word}`: ")) && error.contains("tello[@ADDRESS]"), "{error}");
        }
    }

    #[test]
    fn alternatives_read_well_whatever_their_number() {
        assert_eq!(alternatives(&[]), "");
        assert_eq!(alternatives(&["tello[@ADDRESS]"]), "tello[@ADDRESS]");
        assert_eq!(alternatives(&["tello[@ADDRESS]", "toy"]), "tello[@ADDRESS] or toy");
        assert_eq!(alternatives(&["sim", "tello[@ADDRESS]", "toy"]), "sim, tello[@ADDRESS] or toy");
        assert_eq!(alternatives(&["sim", "a", "b:PORT", "c"]), "sim, a, b:PORT or c");
    }

    #[test]
    fn no_two_drivers_have_one_scheme() {
        for (index, driver) in DRIVERS.iter().enumerate() {
            assert!(DRIVERS[..index].iter().all(|other| other.scheme != driver.scheme), "{}", driver.scheme);
            assert!(driver.form.starts_with(driver.scheme) && (driver.target)("").is_some(), "{}", driver.scheme);
        }
    }
}
