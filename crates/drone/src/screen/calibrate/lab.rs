//! Presses a key of a game, and watches what it does.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_media::Rgb;
use spf_screen::duty::Pulses;
use spf_screen::picture::Pictures;
use spf_screen::profile::{Key, Profile, Step};
use spf_screen::{Display, Eye, Hands, ScreenError};

use super::CalibrateError;
use super::response::{is_steady, median};
use super::watch::{Quantity, Watch};
use crate::abandon::{self, EmergencyLand};
use crate::screen::craft::first_picture;
use crate::screen::flow::Flow;
use crate::screen::settings::ScreenSettings;

/// How often keys are looked after, and how often a new picture is looked for.
const TICK: Duration = Duration::from_millis(4);
const LOOK: Duration = Duration::from_millis(16);
/// Least time between two pictures that are taken into account, seconds.
const PERIOD: f64 = 0.045;
/// A picture that has not changed for so long shows a craft at rest, seconds.
const UNCHANGED: f64 = 0.25;
/// How long the craft is watched before the key, seconds.
const BEFORE: f64 = 0.4;
/// A key is held until the craft has flown steadily for `STEADY`, and for `MORE` after that, within these bounds, seconds.
const SHORTEST: f64 = 1.2;
const STEADY: f64 = 1.0;
const MORE: f64 = 0.6;
const LONGEST: f64 = 5.0;
/// A key that shows no motion for so long is released, seconds.
const QUIET: f64 = 1.0;
/// How much faster than the profile says a craft may be of which the picture tells nothing.
const FASTER: f64 = 1.5;
/// How long a craft is left to come to rest that was brought back unseen, seconds.
const UNTIL_REST_UNSEEN: f64 = 1.5;
/// Longest time until the craft rests after the key, seconds.
const UNTIL_REST: f64 = 5.0;
/// The time in which a craft at rest comes nowhere, and what is nowhere, as a fraction of the greatest way in such a time.
const REST: f64 = 0.5;
const NOWHERE: f64 = 0.04;
/// Interval between two motions of the mouse.
const MOUSE: Duration = Duration::from_millis(20);
/// How long a second Ctrl-C waits for the keys to be released.
const RELEASING: Duration = Duration::from_secs(1);

/// What is done.
#[derive(Clone, Copy, Debug)]
pub(super) enum Press {
    /// A key is down for this part of the time.
    Key(Key, f64),
    /// The mouse is moved by so many pixels, fifty times a second.
    Mouse(i16),
}

/// What a press did.
#[derive(Debug)]
pub(super) struct Leg {
    pub(super) watch: Watch,
    /// When the press began, when the craft flew steadily, and when the press ended, seconds.
    pub(super) down: f64,
    pub(super) steady: f64,
    pub(super) up: f64,
    /// Whether it did fly steadily.
    pub(super) is_steady: bool,
    /// Pixels by which the mouse was moved.
    pub(super) pixels: i64,
}

/// Bounds of a press.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Free space, metres: a way is at most half of it, for the craft needs some to stop.
    pub(super) room: f64,
    /// Speed by the profile, m/s, which bounds the way of which the picture tells nothing; 0 for a turn.
    pub(super) rate: f64,
    /// Lowest height of the camera, metres.
    pub(super) floor: f64,
    /// How long the key is held, seconds, instead of until the craft flies steadily.
    pub(super) hold: Option<f64>,
}

impl Bounds {
    /// Whether it may have come too far: by the way that the picture tells, and by what it may have flown since the picture told something last,
    /// seconds ago.
    fn is_far(&self, way: f64, quiet: f64) -> bool {
        way.abs() + FASTER * self.rate * quiet > 0.5 * self.room
    }
}

/// Releases the keys when the program ends without running destructors.
#[derive(Default)]
struct Keeper {
    stopped: AtomicBool,
    released: AtomicBool,
}

impl EmergencyLand for Keeper {
    fn abandon(&self) {
        self.stopped.store(true, Ordering::Relaxed);
        let begun = Instant::now();
        while !self.released.load(Ordering::Relaxed) && begun.elapsed() < RELEASING {
            std::thread::sleep(TICK);
        }
    }
}

/// A game with its keys and its picture.
pub(super) struct Lab<'a> {
    hands: Hands,
    eye: Eye,
    flow: Flow,
    pictures: Pictures,
    last: Option<Rgb>,
    profile: Profile,
    stop: &'a dyn Fn() -> bool,
    keeper: Arc<Keeper>,
    /// Time zero of all times.
    start: Instant,
}

impl Drop for Lab<'_> {
    fn drop(&mut self) {
        self.hands.release_all();
        self.keeper.released.store(true, Ordering::Relaxed);
    }
}

impl<'a> Lab<'a> {
    /// Asks for the focus of the profile's window. No key is pressed.
    pub(super) fn open(profile: &Profile, settings: &ScreenSettings, stop: &'a dyn Fn() -> bool) -> Result<Self, CalibrateError> {
        let display = Display::open(settings.display.as_deref())?;
        let mut hands = Hands::open(&display, &profile.window.name())?;
        hands.check(&profile.keys())?;
        if !hands.activate()? {
            return Err(ScreenError::NoFocus.into());
        }
        let mut eye = Eye::new(display, profile.target());
        first_picture(&mut eye)??;
        let keeper = Arc::new(Keeper::default());
        abandon::register(&(keeper.clone() as Arc<dyn EmergencyLand>));
        let (flow, pictures) = (Flow::new(profile.camera.masks.clone()), Pictures::new(&profile.camera.masks));
        Ok(Self { hands, eye, flow, pictures, last: None, profile: profile.clone(), stop, keeper, start: Instant::now() })
    }

    /// Presses the keys of a take-off or a landing. The latter is not ended by the first Ctrl-C.
    pub(super) fn steps<'s>(&mut self, steps: impl IntoIterator<Item = &'s Step>, is_end: bool) -> Result<(), CalibrateError> {
        // What has failed may have left a key down.
        self.hands.release_all();
        for step in steps {
            let begun = Instant::now();
            while begun.elapsed().as_secs_f64() < step.for_s {
                self.check(is_end)?;
                if let Some(key) = step.hold {
                    self.hands.set(key, true)?;
                }
                std::thread::sleep(TICK);
            }
            self.hands.release_all();
        }
        Ok(())
    }

    /// Holds the opposite key for as long as another one was held of which the picture told nothing.
    pub(super) fn back(&mut self, key: Key, for_s: f64) -> Result<(), CalibrateError> {
        let step = |hold, for_s| Step { hold, push: None, for_s };
        self.steps(&[step(Some(key), for_s), step(None, UNTIL_REST_UNSEEN)], false)
    }

    /// Whether it may go on.
    fn check(&mut self, is_end: bool) -> Result<(), CalibrateError> {
        let is_over = self.keeper.stopped.load(Ordering::Relaxed) || (!is_end && (self.stop)());
        let result = if is_over {
            Err(CalibrateError::Interrupted)
        } else if self.hands.has_focus()? {
            Ok(())
        } else {
            Err(ScreenError::NoFocus.into())
        };
        if result.is_err() {
            self.hands.release_all();
        }
        result
    }

    /// Presses something, and watches from rest to rest.
    pub(super) fn leg(&mut self, press: Press, quantity: Quantity, height: f64, bounds: Bounds) -> Result<Leg, CalibrateError> {
        self.flow.forget();
        self.last = None;
        let now = self.now();
        let mut leg = Leg {
            watch: Watch::new(quantity, height, now),
            down: f64::INFINITY,
            steady: 0.0,
            up: 0.0,
            is_steady: false,
            pixels: 0,
        };
        self.picture(&mut leg.watch)?;
        self.wait(now + BEFORE, &mut leg.watch)?;
        leg.down = self.now();
        leg.watch.begins(leg.down);
        leg.up = self.hold(press, &mut leg, bounds)?;
        self.hands.release_all();
        let patience = leg.up + UNTIL_REST;
        let mut greatest = 0.0_f64;
        loop {
            self.wait(self.now() + 0.1, &mut leg.watch)?;
            greatest = greatest.max(leg.watch.lately(REST).abs());
            let rests = leg.watch.lately(REST).abs() <= NOWHERE * greatest;
            if (rests && self.now() > leg.up + REST + 0.3) || self.now() > patience {
                return Ok(leg);
            }
        }
    }

    /// Holds a key, or moves the mouse; when that ended.
    fn hold(&mut self, press: Press, leg: &mut Leg, bounds: Bounds) -> Result<f64, CalibrateError> {
        let mut pulses = Pulses::new(self.profile.controls.pulse_hz);
        let (begun, mut looked, mut moved) = (Instant::now(), Instant::now(), None::<Instant>);
        let mut end = bounds.hold.unwrap_or(LONGEST);
        loop {
            self.check(false)?;
            let held = begun.elapsed().as_secs_f64();
            let quiet = self.now() - leg.watch.news();
            let is_far = leg.watch.is_way() && bounds.is_far(leg.watch.total(), quiet) || leg.watch.height() < bounds.floor;
            if held >= end || is_far || quiet > QUIET {
                let up = self.now();
                if !leg.is_steady {
                    // The best that there is.
                    leg.steady = up - (0.4 * held).min(STEADY);
                    leg.is_steady = bounds.hold.is_some() && is_steady(leg.watch.samples(), STEADY);
                }
                return Ok(up);
            }
            match press {
                Press::Key(key, part) => {
                    let now = Time::ZERO + begun.elapsed();
                    pulses.set(now, part);
                    self.hands.set(key, part >= 1.0 || pulses.level(now) != 0)?;
                }
                Press::Mouse(pixels) => {
                    if moved.is_none_or(|moved| moved.elapsed() >= MOUSE) {
                        moved = Some(Instant::now());
                        self.hands.turn(pixels)?;
                        leg.pixels += i64::from(pixels);
                    }
                }
            }
            if looked.elapsed() >= LOOK {
                looked = Instant::now();
                self.picture(&mut leg.watch)?;
                if bounds.hold.is_none() && !leg.is_steady && held >= SHORTEST && is_steady(leg.watch.samples(), STEADY) {
                    // In the first half it may still have gained speed.
                    (leg.is_steady, leg.steady) = (true, self.now() - 0.5 * STEADY);
                    end = held + MORE;
                }
            }
            std::thread::sleep(TICK);
        }
    }

    /// New pictures of the game per second while something is pressed for a time, seconds, and then something else for as long; no more
    /// than are looked at.
    pub(super) fn pictures_per_s(&mut self, press: Press, back: Press, for_s: f64) -> Result<f64, CalibrateError> {
        let mut new = Vec::new();
        for press in [press, back] {
            let (mut last, mut moved, begun) = (None, None::<Instant>, Instant::now());
            while begun.elapsed().as_secs_f64() < for_s {
                self.check(false)?;
                match press {
                    Press::Key(key, _) => self.hands.set(key, true)?,
                    Press::Mouse(pixels) if moved.is_none_or(|moved| moved.elapsed() >= MOUSE) => {
                        moved = Some(Instant::now());
                        self.hands.turn(pixels)?;
                    }
                    Press::Mouse(_) => {}
                }
                let shown = self.eye.look()??;
                if last.replace(shown.image.clone()).is_none_or(|last| last != shown.image) {
                    new.push(begun.elapsed().as_secs_f64());
                }
                std::thread::sleep(TICK);
            }
            self.hands.release_all();
        }
        // The median: at the start and the end the craft may rest.
        let steps: Vec<f64> = new.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
        Ok(median(steps).map_or(0.0, |step| 1.0 / step))
    }

    fn wait(&mut self, until: f64, watch: &mut Watch) -> Result<(), CalibrateError> {
        while self.now() < until {
            self.check(false)?;
            self.picture(watch)?;
            std::thread::sleep(LOOK);
        }
        Ok(())
    }

    /// Takes a picture, if there is a new one.
    fn picture(&mut self, watch: &mut Watch) -> Result<(), CalibrateError> {
        let (last, _) = watch.samples().last().copied().unwrap_or_default();
        if self.last.is_some() && self.now() < last + PERIOD {
            return Ok(());
        }
        let shown = self.eye.look()??;
        let at = shown.at.saturating_duration_since(self.start).as_secs_f64();
        let image = self.pictures.finish(shown.image);
        if self.last.as_ref() == Some(&image) {
            // A game that draws seldom, or one in which nothing moves.
            if at > last + UNCHANGED {
                watch.rests(at);
            }
            return Ok(());
        }
        let camera = self.profile.optics((image.width(), image.height()));
        let (pairs, tilted) = self.flow.pairs_by(&image, &camera, &watch.expected_turns());
        if self.last.is_some() {
            watch.add(at, &camera, &pairs, tilted);
        }
        self.last = Some(image);
        Ok(())
    }

    fn now(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_seen_counts_as_flown_fast() {
        let bounds = Bounds { room: 30.0, rate: 4.0, floor: 0.0, hold: None };
        // By hand: half of the room are 15 m. 1 s unseen counts 6 m.
        assert!(!bounds.is_far(-8.9, 1.0) && bounds.is_far(-9.1, 1.0) && !bounds.is_far(14.9, 0.0) && bounds.is_far(0.0, 2.51));
        // A small room ends a hold before a picture without news does.
        assert!(Bounds { room: 10.0, ..bounds }.is_far(0.0, 0.9 * QUIET));
    }
}
