//! How far the craft has come, from picture to picture.

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::geometry::Attitude;

use super::over_ground::{Moved, moved};
use super::response::Sample;
use crate::screen::flow::Pair;
use crate::screen::turning::turn;

/// How far a tilt may be wrong after a picture that did not tell, radians.
const UNSEEN: f64 = 0.1;
/// Tilts between two pictures in which a craft begins to gain speed, radians.
const TILTS: [f64; 3] = [0.1, 0.2, 0.3];

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
    samples: Vec<Sample>,
    /// When each picture was taken, and whether it told something.
    told: Vec<(f64, bool)>,
    last_step: f64,
}

impl Watch {
    /// With the first picture at this time, seconds.
    pub(super) fn new(quantity: Quantity, height: f64, at: f64) -> Self {
        Self { quantity, height, expected: Moved::default(), samples: vec![(at, 0.0)], told: Vec::new(), last_step: 0.0 }
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
    }

    /// Notes that the picture has not changed up to a time, seconds.
    pub(super) fn rests(&mut self, at: f64) {
        let Moved { pitch, roll, tilt_sd, .. } = self.expected;
        (self.last_step, self.expected) = (0.0, Moved { pitch, roll, tilt_sd, ..Moved::default() });
        self.samples.push((at, self.total()));
    }

    fn way(&mut self, camera: &Camera, pairs: &[Pair], tilted: Attitude) -> Option<f64> {
        let expected = Moved { turned: tilted.heading, pitched: tilted.pitch, rolled: tilted.roll, ..self.expected };
        let Some(found) = moved(camera, pairs, &expected) else {
            // The change is not repeated: it would add up over several pictures without ground.
            self.expected = Moved { pitched: 0.0, rolled: 0.0, ..expected.next() }.blurred(UNSEEN);
            return None;
        };
        self.expected = found.next();
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
