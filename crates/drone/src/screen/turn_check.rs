//! Whether the craft turns as far as the profile says: what the pictures show of whole turns, against what was commanded.
//!
//! From picture to picture the two differ by dead time and lag; over a whole turn, from rest to rest, they must not. One turn that
//! differs may have other reasons, such as a craft that is pushed; several in a row that do so alike are a wrong profile.

use spf_core::time::{Duration, Time};

/// A turn is over when none was commanded for so long: by then the craft has come to rest.
const REST: Duration = Duration::from_millis(700);
/// A turn between two pictures that counts as none, radians.
const NONE: f64 = 1e-3;
/// Smaller turns tell too little, radians.
const LEAST: f64 = 0.25;
/// How many turns in a row have to differ, and by which fraction.
const TURNS: usize = 3;
const DIFFERENT: f64 = 0.3;
/// More is a mistake of the picture.
const MOST: f64 = 20.0;

/// Compares whole turns.
#[derive(Debug, Default)]
pub(super) struct TurnCheck {
    /// Sum of the commanded turns at the last picture, radians.
    commanded: f64,
    turning: Option<Turning>,
    /// What the pictures showed of each of the last turns, as a fraction of what was commanded.
    shown: Vec<f64>,
    said: bool,
}

#[derive(Debug)]
struct Turning {
    asked: f64,
    turned: f64,
    /// When a turn was commanded last.
    last: Time,
    /// Whether every picture told.
    seen: bool,
}

impl TurnCheck {
    /// Takes a picture into account: the sum of all commanded turns, and the turn since the last picture in excess of what was commanded, if
    /// it told; radians. Returns once what the pictures show of the turns as a fraction of what was commanded, if that is wrong.
    pub(super) fn add(&mut self, now: Time, commanded: f64, more: Option<f64>) -> Option<f64> {
        let asked = commanded - std::mem::replace(&mut self.commanded, commanded);
        if asked.abs() > NONE {
            let fresh = Turning { asked: 0.0, turned: 0.0, last: now, seen: true };
            self.turning.get_or_insert(fresh).last = now;
        }
        let turning = self.turning.as_mut()?;
        turning.asked += asked;
        turning.turned += asked + more.unwrap_or(0.0);
        turning.seen &= more.is_some();
        if now.since(turning.last) < REST {
            return None;
        }
        let Turning { asked, turned, seen, .. } = self.turning.take()?;
        let shown = turned / asked;
        // Also false for what is no number. Of a turn to and fro, the sum is small.
        let counts = seen && asked.abs() >= LEAST && shown.abs() <= MOST;
        if !counts || self.said {
            return None;
        }
        self.shown.push(shown);
        if self.shown.len() > TURNS {
            self.shown.remove(0);
        }
        let all = |is_wrong: fn(f64) -> bool| self.shown.len() == TURNS && self.shown.iter().all(|shown| is_wrong(*shown));
        self.said = all(|shown| shown > 1.0 + DIFFERENT) || all(|shown| shown < 1.0 - DIFFERENT);
        self.said.then(|| self.shown.iter().sum::<f64>() / TURNS as f64)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Turns by 0.6 rad in 1 s, with pauses of 1 s, of which the pictures show a part 0.2 s later. What is returned after each picture.
    fn turns(parts: &[f64], unseen: Option<usize>) -> Vec<f64> {
        let mut check = TurnCheck::default();
        let (mut commanded, mut ms, mut found) = (0.0, 0, Vec::new());
        for (turn, part) in parts.iter().enumerate() {
            for picture in 0..40 {
                let asked = if picture < 20 { 0.03 } else { 0.0 };
                let shown = if (4..24).contains(&picture) { part * 0.03 } else { 0.0 };
                commanded += asked;
                ms += 50;
                let more = (unseen != Some(turn) || picture != 9).then_some(shown - asked);
                found.extend(check.add(Time::from_millis(ms), commanded, more));
            }
        }
        found
    }

    #[test]
    fn a_wrong_rate_is_told_once_after_three_turns_and_a_right_one_never() {
        let told = turns(&[0.5; 8], None);
        assert!(told.len() == 1 && (told[0] - 0.5).abs() < 1e-6, "{told:?}");
        assert!(turns(&[2.4; 2], None).is_empty());
        assert!((turns(&[2.4; 3], None)[0] - 2.4).abs() < 1e-6);
        // The wrong way round.
        assert!((turns(&[-1.0; 3], None)[0] + 1.0).abs() < 1e-6);
        assert!(turns(&[0.8, 1.2, 1.25, 0.75, 1.0, 0.9], None).is_empty());
        // One too far and one too short have no common reason.
        assert!(turns(&[0.5, 1.6, 0.5, 1.6, 0.5, 1.6], None).is_empty());
        // A turn that was not seen throughout does not count.
        assert!(turns(&[0.5; 3], Some(1)).is_empty());
    }

    proptest! {
        #[test]
        fn any_numbers_are_told_at_most_once(steps in proptest::collection::vec((0_u64..2000, any::<f64>(), proptest::option::of(any::<f64>())), 0..60)) {
            let mut check = TurnCheck::default();
            let (mut ms, mut told) = (0, 0);
            for (step, commanded, more) in steps {
                ms += step;
                if let Some(shown) = check.add(Time::from_millis(ms), commanded, more) {
                    told += 1;
                    prop_assert!(shown.is_finite());
                }
            }
            prop_assert!(told <= 1);
        }
    }
}
