//! How far the craft has come, from picture to picture.

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::geometry::Attitude;

use super::over_ground::{Moved, moved, tilted};
use super::response::Sample;
use crate::screen::flow::Pair;
use crate::screen::turning::turn;

/// How far a tilt may be wrong after a picture that did not tell, radians.
const UNSEEN: f64 = 0.1;
/// Tilts between two pictures in which a craft begins to gain speed, radians.
const TILTS: [f64; 3] = [0.1, 0.2, 0.3];

/// Time over which a motion is looked at, seconds, and the least one in it: radians, and heights above the ground. Less is noise.
const LATELY: f64 = 0.5;
const LEAST: f64 = 0.01;
/// Least change of the tilt between two pictures that tells of a motion, radians.
const LEAST_TILT: f64 = 0.01;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// The turn, radians clockwise.
    Turn,
    /// The way forward, metres.
    Forward,
    /// The way to the right, metres.
    Right,
    /// The way up, metres.
    Up,
}

/// Watches a craft that begins at rest and level.
#[derive(Debug)]
pub(super) struct Watch {
    quantity: Quantity,
    /// Of the camera above the ground, metres.
    height: f64,
    expected: Moved,
    /// Whether it still rests, level: the key has not been pressed yet.
    rests: bool,
    /// When the picture told of a motion last, seconds: at the earliest when the key was pressed.
    news: f64,
    /// Whether the picture has changed since then.
    has_changed: bool,
    samples: Vec<Sample>,
    /// When each picture was taken, and whether it told something.
    told: Vec<(f64, bool)>,
    last_step: f64,
}

impl Watch {
    /// With the first picture at this time, seconds.
    pub(super) fn new(quantity: Quantity, height: f64, at: f64) -> Self {
        Self {
            quantity,
            height,
            expected: Moved::default(),
            rests: true,
            news: at,
            has_changed: false,
            samples: vec![(at, 0.0)],
            told: Vec::new(),
            last_step: 0.0,
        }
    }

    /// Takes the next picture into account: the places of points in the last one and in this one, and by about how much it has tilted.
    pub(super) fn add(&mut self, at: f64, camera: &Camera, pairs: &[Pair], tilted: Attitude) {
        let step = match self.quantity {
            Quantity::Turn => turn(camera, pairs, Setpoint::HOLD, None).map(|turned| turned.angle),
            _ => self.way(camera, pairs, tilted),
        };
        self.told.push((at, step.is_some()));
        // What was not seen is taken to be as it was.
        self.last_step = step.unwrap_or(self.last_step);
        let before = self.samples.last().map_or(0.0, |(_, way)| *way);
        self.samples.push((at, before + self.last_step));
        self.has_changed = true;
        if (step.is_some() && self.lately(LATELY).abs() > LEAST * self.unit()) || self.tilts() {
            self.news = at;
        }
    }

    /// From now on it may move and tilt.
    pub(super) fn begins(&mut self, at: f64) {
        (self.rests, self.news, self.has_changed) = (false, at, false);
    }

    /// When the picture told of a motion last, seconds; the time of the key, if it has not yet.
    pub(super) fn news(&self) -> f64 {
        self.news
    }

    /// Whether the picture has changed at all since the key.
    pub(super) fn has_changed(&self) -> bool {
        self.has_changed
    }

    /// What a motion is measured by: a radian, or the height.
    fn unit(&self) -> f64 {
        if self.is_way() { self.height } else { 1.0 }
    }

    /// Whether the craft tilted between the last two pictures, as it does when it gains speed.
    fn tilts(&self) -> bool {
        self.is_way() && self.expected.pitched.abs().max(self.expected.rolled.abs()) > LEAST_TILT
    }

    /// Notes that the picture has not changed up to a time, seconds.
    pub(super) fn rests(&mut self, at: f64) {
        let Moved { pitch, roll, tilt_sd, .. } = self.expected;
        (self.last_step, self.expected) = (0.0, Moved { pitch, roll, tilt_sd, ..Moved::default() });
        self.samples.push((at, self.total()));
    }

    fn way(&mut self, camera: &Camera, pairs: &[Pair], turned: Attitude) -> Option<f64> {
        let expected = Moved { turned: turned.heading, pitched: turned.pitch, rolled: turned.roll, ..self.expected };
        let Some(found) = moved(camera, pairs, &expected) else {
            // A craft that lifts its nose sees little ground for a while, but other things, which tell how it tilts. What they do not
            // tell is not repeated: it would add up over several pictures.
            let blind = || Moved { pitched: 0.0, rolled: 0.0, ..self.expected }.blurred(UNSEEN);
            self.expected = tilted(camera, pairs, &expected).map_or_else(blind, |found| found.next());
            return None;
        };
        // A picture in which nothing moves tells nothing of the tilt, and what is wrong of it would add up.
        self.expected = if self.rests { Moved::default() } else { found.next() };
        let step = match self.quantity {
            Quantity::Forward => found.forward,
            Quantity::Right => found.right,
            Quantity::Up | Quantity::Turn => found.up,
        };
        let way = step * self.height;
        if self.quantity == Quantity::Up {
            self.height += way;
        }
        Some(way)
    }

    pub(super) fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// How far it has come.
    pub(super) fn total(&self) -> f64 {
        self.samples.last().map_or(0.0, |(_, way)| *way)
    }

    /// Height of the camera above the ground, metres.
    pub(super) fn height(&self) -> f64 {
        self.height
    }

    /// Whether a way is measured, and not a turn.
    pub(super) fn is_way(&self) -> bool {
        self.quantity != Quantity::Turn
    }

    /// The changes of attitude that are to be expected until the next picture, the likeliest first: a craft tilts suddenly when it gains
    /// speed.
    pub(super) fn expected_turns(&self) -> Vec<Attitude> {
        let Moved { turned, pitched, rolled, .. } = self.expected;
        let likeliest = match self.quantity {
            Quantity::Turn => Attitude { heading: self.last_step, ..Attitude::default() },
            _ => Attitude { heading: turned, pitch: pitched, roll: rolled },
        };
        let tilts = TILTS.iter().flat_map(|tilt| [*tilt, -tilt]);
        let tilted = tilts.filter_map(|tilt| match self.quantity {
            Quantity::Forward => Some(Attitude { pitch: tilt, ..Attitude::default() }),
            Quantity::Right => Some(Attitude { roll: tilt, ..Attitude::default() }),
            Quantity::Turn | Quantity::Up => None,
        });
        [likeliest].into_iter().chain(tilted).collect()
    }

    /// How far it came in the time before the last picture, seconds.
    pub(super) fn lately(&self, time: f64) -> f64 {
        let Some((now, way)) = self.samples.last() else { return 0.0 };
        let before = self.samples.iter().rev().find(|(at, _)| *at <= now - time);
        before.map_or(*way, |(_, before)| way - before)
    }

    /// Whether most pictures between two times told something.
    pub(super) fn is_seen(&self, from: f64, to: f64) -> bool {
        let between = || self.told.iter().filter(|(at, _)| (from..=to).contains(at));
        let blind = between().filter(|(_, told)| !told).count();
        between().count() >= 5 && 4 * blind < between().count()
    }
}

#[cfg(test)]
mod tests {
    use spf_core::query::ImagePoint;

    use super::*;

    #[test]
    fn a_picture_without_structure_or_change_is_no_news_and_a_turn_is() {
        let camera = Camera::quad();
        let mut watch = Watch::new(Quantity::Turn, 3.0, 0.0);
        watch.begins(0.4);
        watch.rests(0.7);
        assert!(watch.news() == 0.4 && !watch.has_changed());
        watch.add(0.8, &camera, &[], Attitude::default());
        assert!(watch.news() == 0.4 && watch.has_changed());
        // What stays in its place, as an instrument does, tells of no motion either.
        let still: Vec<Pair> = (0..40_u32).map(|n| ImagePoint { u: f64::from(n) / 41.0, v: 0.3 }).map(|at| (at, at)).collect();
        watch.add(0.9, &camera, &still, Attitude::default());
        assert_eq!(watch.news(), 0.4);
        let turned: Vec<Pair> = still.iter().map(|(from, _)| (*from, ImagePoint { u: from.u - 0.02, ..*from })).collect();
        watch.add(1.0, &camera, &turned, Attitude::default());
        assert_eq!(watch.news(), 1.0);
        // A way that goes on unseen is reckoned, but no news.
        watch.add(1.1, &camera, &[], Attitude::default());
        assert!(watch.news() == 1.0 && watch.lately(0.05).abs() > 0.01);
    }
}
