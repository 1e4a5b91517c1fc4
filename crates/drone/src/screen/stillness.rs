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

/// Tells a picture that no longer answers.
#[derive(Debug, Default)]
pub(super) struct Stillness {
    before: Option<Rgb>,
    last: Option<Time>,
    /// For how long keys have been held since the picture changed, seconds.
    held: f64,
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
        } else if pushed.is_finite() {
            // A gap between two pictures tells nothing.
            self.held += pushed.clamp(0.0, 1.0) * passed.min(0.25);
        }
        // A sum of intervals.
        self.held > HELD - 1e-6
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
    fn a_blinking_cursor_is_no_answer_and_another_size_is() {
        let mut blinking = image(7);
        blinking.set_pixel(30, 30, [255; 3]);
        assert!(!differ(&image(7), &blinking) && differ(&image(7), &image(13)) && differ(&image(7), &Rgb::new(9, 9)));
    }
}
