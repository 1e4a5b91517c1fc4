//! Whether the picture answers to the keys.
//!
//! A game that is paused, frozen or dead shows the same picture, and so does one that hovers. They are told apart by a motion key:
//! a picture that does not change although one has been held for a while is no live one. A key that is down half of the time
//! counts half. A craft that is pushed against a wall looks the same, and is treated the same.

use spf_core::time::{Duration, Time};
use spf_media::Rgb;

/// Time for which a key must have been held without a change of the picture. With the dead time of the controls, less than a second.
const HELD: f64 = 0.6;
/// Every how many pixels the picture is looked at, in both directions.
const STEP: usize = 3;
/// Levels by which a pixel has changed.
const LEVELS: u8 = 6;
/// Fraction of the pixels looked at that makes a change: a blinking cursor or a clock is none.
const CHANGED: f64 = 0.001;

/// Fraction of full deflection from which on pictures are counted, for how long, seconds, and the fraction of looks with a change from
/// which on every look is one.
const PUSHED: f64 = 0.3;
const COUNTED: f64 = 2.0;
const ALL: f64 = 0.85;

/// Tells a picture that no longer answers.
#[derive(Debug, Default)]
pub(super) struct Stillness {
    before: Option<Rgb>,
    last: Option<Time>,
    /// For how long keys have been held since the picture changed, seconds.
    held: f64,
    /// How often it has changed.
    changes: u64,
}

/// Counts the pictures that a game draws, while it is pushed: at rest it may draw the same again.
#[derive(Debug, Default)]
pub(super) struct Drawn {
    last: Option<Time>,
    looked: f64,
    looks: u32,
    changes: u32,
}

impl Drawn {
    /// Takes the next look, and whether the picture had changed. After [`COUNTED`] seconds in which the craft was pushed: the pictures
    /// per second, or `None` in it if nearly every look saw another, so that there are at least as many as looks.
    pub(super) fn add(&mut self, now: Time, pushed: f64, changed: bool) -> Option<Option<f64>> {
        let passed = self.last.replace(now).map_or(Duration::ZERO, |last| now.since(last)).as_secs_f64();
        if pushed < PUSHED || passed > 0.25 || passed == 0.0 {
            return None;
        }
        self.looked += passed;
        self.looks += 1;
        self.changes += u32::from(changed);
        if self.looked < COUNTED {
            return None;
        }
        let Self { looked, looks, changes, .. } = core::mem::take(self);
        self.last = Some(now);
        // Without any change it is frozen, or at a wall.
        (changes > 0).then(|| (f64::from(changes) < ALL * f64::from(looks)).then(|| f64::from(changes) / looked))
    }
}

impl Stillness {
    /// Takes the next picture. `pushed`: fraction of full deflection by which the craft was to move one dead time ago. Returns whether
    /// the picture has stopped to answer; that ends with its next change.
    pub(super) fn is_frozen(&mut self, now: Time, image: &Rgb, pushed: f64) -> bool {
        let passed = self.last.replace(now).map_or(Duration::ZERO, |last| now.since(last)).as_secs_f64();
        let same = self.before.as_ref().is_some_and(|before| !differ(before, image));
        if !same {
            self.before = Some(image.clone());
            self.held = 0.0;
            self.changes += 1;
        } else if pushed.is_finite() {
            // A gap between two pictures tells nothing.
            self.held += pushed.clamp(0.0, 1.0) * passed.min(0.25);
        }
        // A sum of intervals.
        self.held > HELD - 1e-6
    }

    /// How often the picture has changed.
    pub(super) fn changes(&self) -> u64 {
        self.changes
    }
}

/// Whether two pictures differ in more than instruments.
fn differ(a: &Rgb, b: &Rgb) -> bool {
    if (a.width(), a.height()) != (b.width(), b.height()) {
        return true;
    }
    let row = a.width() as usize * 3;
    let (mut changed, mut looked) = (0_u32, 0_u32);
    for (a, b) in a.data().chunks_exact(row.max(1)).zip(b.data().chunks_exact(row.max(1))).step_by(STEP) {
        for (a, b) in a.as_chunks::<3>().0.iter().zip(b.as_chunks::<3>().0).step_by(STEP) {
            looked += 1;
            changed += u32::from(a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) >= LEVELS));
        }
    }
    f64::from(changed) > CHANGED * f64::from(looked)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(level: u8) -> Rgb {
        Rgb::filled(192, 144, [level; 3])
    }

    /// Whether it counts as frozen after each picture, one every 50 ms.
    fn frozen(pictures: &[(u8, f64)]) -> Vec<bool> {
        let mut stillness = Stillness::default();
        let each = pictures.iter().enumerate();
        each.map(|(n, (level, pushed))| stillness.is_frozen(Time::from_millis(50 * n as u64), &image(*level), *pushed)).collect()
    }

    #[test]
    fn a_held_key_without_an_answer_is_seen_within_a_second_and_an_answer_ends_it() {
        // By hand: the first picture is new; 0.6 s are 12 intervals of 50 ms.
        let mut pictures = vec![(7, 1.0); 14];
        pictures.push((90, 1.0));
        let frozen = frozen(&pictures);
        assert_eq!(frozen.iter().position(|frozen| *frozen), Some(12));
        assert!(frozen[13] && !frozen[14]);
    }

    #[test]
    fn a_hovering_craft_is_not_frozen_and_a_slow_one_is_later() {
        assert!(frozen(&[(7, 0.0); 200]).iter().all(|frozen| !frozen));
        assert_eq!(frozen(&[(7, 0.25); 200]).iter().position(|frozen| *frozen), Some(48));
    }

    #[test]
    fn pictures_are_counted_in_motion_alone() {
        // One look each 50 ms; of a game with 15 pictures per second three of four looks see another.
        let counted = |pushed: f64, changed: fn(u64) -> bool| {
            let mut drawn = Drawn::default();
            (0..=45).find_map(|n| drawn.add(Time::from_millis(50 * n), pushed, changed(n)))
        };
        let slow = counted(1.0, |n| n % 4 != 0).unwrap().unwrap();
        assert!((slow - 15.0).abs() < 0.6, "{slow}");
        assert_eq!(counted(1.0, |_| true), Some(None));
        assert_eq!((counted(1.0, |_| false), counted(0.1, |n| n % 4 != 0)), (None, None));
    }

    #[test]
    fn a_blinking_cursor_is_no_answer_and_another_size_is() {
        let mut blinking = image(7);
        blinking.set_pixel(30, 30, [255; 3]);
        assert!(!differ(&image(7), &blinking) && differ(&image(7), &image(13)) && differ(&image(7), &Rgb::new(9, 9)));
    }
}
