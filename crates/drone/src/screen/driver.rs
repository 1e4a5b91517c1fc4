//! The registration of the driver of games.

use std::time::Instant;

use spf_core::craft::Craft;
use spf_envelope::Limits;
use spf_screen::profile::{Profile, ProfileError};
use spf_screen::{Hidden, ScreenError};

use super::craft::{ConnectError, ScreenCraft, craft_of};
use super::doctor;
use crate::driver::{self, Driver, Target};
use crate::examine::Check;
use crate::options::Options;

/// The profile of a name without one.
const USUAL: &str = "spf-window";

/// Warning before take-off.
const WARNING: &str = "Keys and mouse of this display are used for the game as long as its window has the focus: do not type. \
Clicking on another window releases all keys, and the craft holds until resume (T) gives the focus back. Position and height are \
reckoned from the keys alone.";

/// Warning before take-off of a craft whose window is not known to this program.
const UNSEEN_FOCUS: &str = "A gamepad flies the game, and every program may listen to it: close other games. Whether the game has the \
focus is not told by the desktop's portal, so that a click on another window does not stop the craft: the keys of this terminal do. \
Position and height are reckoned from the sticks alone.";

/// The driver.
pub const DRIVER: Driver = Driver {
    scheme: "screen",
    form: "screen[:PROFILE]",
    about: "a game or simulator through its window, by a shipped profile or the path of one; see docs/guide/games.md",
    target: |rest| {
        let name = if rest.is_empty() { USUAL } else { rest.strip_prefix(':').filter(|name| !name.is_empty())? };
        Some(Box::new(NamedScreen { name: name.to_owned(), profile: Profile::open(name) }))
    },
};

/// A game, by the name of its profile.
struct NamedScreen {
    name: String,
    profile: Result<Profile, ProfileError>,
}

impl Target for NamedScreen {
    fn craft(&self) -> Craft {
        // Without a profile there is no flight.
        self.profile.as_ref().map_or_else(|_| Craft::quad(), craft_of)
    }

    fn limits(&self) -> Limits {
        let limits = Limits::for_craft(&self.craft());
        match &self.profile {
            Ok(profile) => {
                let part = &profile.craft;
                Limits { max_altitude: part.max_altitude_m, max_distance: part.max_distance_m, ..limits }
            }
            Err(_) => limits,
        }
    }

    fn connect(&self, options: &Options, start: Instant) -> Result<driver::Connected, driver::ConnectError> {
        let profile = self.profile.as_ref().map_err(refused)?;
        let drone = ScreenCraft::connect("screen", profile, &options.screen, start).map_err(explained)?;
        let name = &self.name;
        let window = if profile.window.portal {
            "what the desktop's portal shows".to_owned()
        } else {
            format!("the window with {}", profile.window.name())
        };
        let summary = format!("Connected to {window} (profile {name}). Source: {}.", profile.source);
        let warning = if profile.window.portal { UNSEEN_FOCUS } else { WARNING };
        Ok(driver::Connected { drone: Box::new(drone), summary, warning: warning.to_owned() })
    }

    fn examine(&self, options: &Options) -> Vec<Check> {
        doctor::examine(&self.profile, &options.screen)
    }
}

fn refused(error: &ProfileError) -> driver::ConnectError {
    let hint = match error {
        ProfileError::Unknown { .. } => "`spf screen list` lists the shipped profiles",
        _ => "docs/guide/games.md explains each key of a profile",
    };
    driver::ConnectError { craft: "the game", source: error.to_string().into(), hint: Some(hint.to_owned()) }
}

fn explained(error: ConnectError) -> driver::ConnectError {
    let hint = match &error {
        ConnectError::Screen(ScreenError::NoDisplay { .. }) => {
            Some("run it in the session that shows the game; `echo $DISPLAY` there names the display")
        }
        ConnectError::Screen(ScreenError::NoKey(_)) => {
            Some("set the keyboard's layout, or name the key by its code in a profile of your own (`#25`; `xev` shows it)")
        }
        ConnectError::Screen(ScreenError::SameKey(..)) => Some("give each its own key in a profile of your own"),
        ConnectError::Screen(ScreenError::Ambiguous { .. }) => {
            Some("close the others, or give more of the title, or the class, in a profile of your own")
        }
        ConnectError::Screen(ScreenError::NoWindow(_)) | ConnectError::Hidden(Hidden::Gone(_)) => {
            Some("start the game; `spf screen list` shows the titles and classes of all windows")
        }
        ConnectError::Screen(ScreenError::Failed(_)) | ConnectError::Hidden(_) => {
            Some("start the game, and put its window where nothing covers it; `spf screen list` shows what does")
        }
        ConnectError::Screen(ScreenError::Portal(_)) => Some("docs/guide/games.md tells what the portal needs"),
        ConnectError::Screen(ScreenError::NoGamepad(_)) => Some("docs/guide/games.md tells what a gamepad needs"),
        ConnectError::NoFocus => Some("click on the game's window, or close what holds the keyboard (menus, screen locks)"),
        _ => None,
    };
    driver::ConnectError { craft: "the game", source: error.into(), hint: hint.map(str::to_owned) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_named_and_a_wrong_one_is_refused_before_anything_is_pressed() {
        assert!((DRIVER.target)("").is_some() && (DRIVER.target)(":luanti").is_some());
        assert!((DRIVER.target)(":").is_none() && (DRIVER.target)("@luanti").is_none());
        let target = (DRIVER.target)(":lunati").unwrap();
        let error = target.connect(&Options::default(), Instant::now()).err().unwrap();
        assert!(error.source.to_string().contains("no profile `lunati`"), "{}", error.source);
    }

    #[test]
    fn the_craft_is_that_of_the_profile() {
        let target = (DRIVER.target)(":luanti").unwrap();
        let (craft, limits) = (target.craft(), target.limits());
        // 4 m/s at full deflection, of which three quarters are used to cruise.
        assert!((craft.cruise_speed - 3.0).abs() < 1e-9 && (craft.yaw_rate.to_degrees() - 45.0).abs() < 1e-9);
        assert_eq!((limits.max_altitude, limits.take_off_checks), (120.0, false));
        assert!(limits.check().is_ok());
    }
}
