//! Checks of a game before a flight: profile, display, keys, picture. Nothing is pressed.

use std::time::Instant;

use spf_core::time::Duration;
use spf_screen::profile::{Profile, ProfileError};
use spf_screen::{Display, Eye, Gamepad, Hands, Hidden};

use super::craft::first_picture;
use super::settings::ScreenSettings;
use crate::examine::{Check, Finding};

/// How long pictures are taken.
const WATCHED: Duration = Duration::from_secs(2);
/// Pictures per second in flight.
const RATE: f64 = 20.0;

/// Checks a game.
pub(super) fn examine(profile: &Result<Profile, ProfileError>, settings: &ScreenSettings) -> Vec<Check> {
    let bad = |what, found: String, advice| vec![Check::new(what, Finding::Bad, found, Some(advice))];
    let profile = match profile {
        Ok(profile) => profile,
        Err(error) => return bad("profile", error.to_string(), "`spf screen list` lists the shipped profiles"),
    };
    let mut checks = vec![Check::new("profile", Finding::Good, profile.source.clone(), None)];
    let display = match Display::open(settings.display.as_deref()) {
        Ok(display) => display,
        Err(error) => {
            checks.extend(bad("display", error.to_string(), "run it in the session that shows the game"));
            return checks;
        }
    };
    match Hands::open(&display, &profile.window.name()).and_then(|mut hands| hands.check(&profile.keys())) {
        Ok(()) => checks.push(Check::new("keys", Finding::Good, "the keyboard has every key of the profile", None)),
        Err(error) => checks.extend(bad("keys", error.to_string(), "start the game, or see `spf screen list`")),
    }
    if profile.has_sticks() {
        match Gamepad::check() {
            Ok(()) => {
                checks.push(Check::new("gamepad", Finding::Good, "one can be made; it is there during a flight alone", None))
            }
            Err(error) => checks.extend(bad("gamepad", error.to_string(), "docs/guide/games.md tells what a gamepad needs")),
        }
    }
    checks.push(picture(Eye::new(display, profile.target())));
    checks
}

fn picture(mut eye: Eye) -> Check {
    let advice = "put the window where nothing covers it; `spf screen preview` shows what is captured";
    let bad = |found: String| Check::new("picture", Finding::Bad, found, Some(advice));
    let image = match first_picture(&mut eye) {
        Ok(Ok(image)) => image,
        Ok(Err(hidden)) => {
            let advice = match hidden {
                Hidden::Gone(_) => "start the game; `spf screen list` shows the titles and classes of all windows",
                Hidden::Minimised => "restore the window, or change to its desktop",
                _ => advice,
            };
            return Check::new("picture", Finding::Bad, hidden.to_string(), Some(advice));
        }
        Err(error) => return bad(error.to_string()),
    };
    let (begun, mut taken, mut longest) = (Instant::now(), 0_u32, Duration::ZERO);
    while begun.elapsed() < WATCHED {
        let before = Instant::now();
        taken += u32::from(matches!(eye.look(), Ok(Ok(_))));
        longest = longest.max(before.elapsed());
        std::thread::sleep(Duration::from_secs_f64(1.0 / RATE).saturating_sub(before.elapsed()));
    }
    let rate = f64::from(taken) / begun.elapsed().as_secs_f64();
    let finding = if rate < 5.0 {
        Finding::Bad
    } else if rate < 0.75 * RATE {
        Finding::Warning
    } else {
        Finding::Good
    };
    let ms = longest.as_secs_f64() * 1e3;
    let text = format!("{}×{}, {rate:.1} pictures/s, up to {ms:.0} ms each", image.width(), image.height());
    Check::new("picture", finding, text, Some("close programs that use the processor, or make the game's window smaller"))
}
