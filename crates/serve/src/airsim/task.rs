//! What a vehicle is asked to do, and the law by which it does it: velocities and a yaw rate every control step.
//!
//! Semantics: AirSim's `MultirotorApiBase.cpp` as read for the guide (`docs/guide/airsim.md`).

use spf_core::geometry::{EnuPosition, EnuVelocity, wrap_angle};
use spf_core::time::{Duration, Time};

/// Speed of take-off, going home and changes of height that are not given one, m/s.
pub(super) const SLOW: f64 = 0.5;
/// Yaw rate per yaw error, 1/s.
const YAW_GAIN: f64 = 1.5;
/// Speed per distance, 1/s: under the craft's dead time and lag of 0.4 s together without overshoot.
const GAIN: f64 = 0.8;
/// Deceleration that is counted on, m/s².
const BRAKING: f64 = 1.5;
/// Distance at which a goal is reached, metres.
const REACHED: f64 = 0.2;
/// Yaw rate at which a turn is over, rad/s.
const AT_REST: f64 = 0.01;
/// Speed above which a direction of travel is a heading, m/s.
const TRAVELLING: f64 = 0.5;
/// Length of a control step.
pub(super) const CONTROL: Duration = Duration::from_millis(20);

/// What becomes of the heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Yaw {
    /// It turns at this rate, rad/s, clockwise.
    Rate(f64),
    /// It goes to this heading, radians.
    Heading(f64),
    /// It goes to the direction of travel plus this, radians.
    Travel(f64),
}

/// What is done.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Motion {
    /// Off the ground, by the craft itself.
    TakeOff,
    /// To the ground, by the craft itself.
    Land,
    /// A velocity until then; with a height, metres up, in place of the vertical part.
    Velocity { velocity: EnuVelocity, height: Option<f64>, until: Time },
    /// Along a path.
    Path(Path),
    /// Turning on the spot, until the error is within this margin, radians.
    Turn { margin: f64, at: EnuPosition },
    /// On the spot until then.
    Stay { at: EnuPosition, until: Time },
}

/// A path and how much of it has been flown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Path {
    points: Vec<EnuPosition>,
    /// Distance from the start to each point.
    lengths: Vec<f64>,
    along: f64,
    speed: f64,
    lookahead: f64,
}

impl Path {
    /// A path from `start` through `points`; `lookahead` in metres, the usual one if negative.
    pub(super) fn new(start: EnuPosition, points: &[EnuPosition], speed: f64, lookahead: f64) -> Self {
        let points: Vec<_> = core::iter::once(start).chain(points.iter().copied()).collect();
        let lengths = points
            .iter()
            .scan((start, 0.0), |(last, sum), point| {
                *sum += last.distance(*point);
                *last = *point;
                Some(*sum)
            })
            .collect();
        let lookahead = if lookahead > 0.0 { lookahead } else { (speed * 0.6).max(0.5) };
        Self { points, lengths, along: 0.0, speed, lookahead }
    }

    /// Its end.
    pub(super) fn end(&self) -> EnuPosition {
        self.points.last().copied().unwrap_or_default()
    }

    fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or_default()
    }

    /// The point this far along.
    fn at(&self, along: f64) -> EnuPosition {
        let next = self.lengths.partition_point(|length| *length < along).min(self.points.len() - 1);
        let Some(before) = next.checked_sub(1) else { return self.points[0] };
        let leg = self.lengths[next] - self.lengths[before];
        let fraction = if leg > 0.0 { ((along - self.lengths[before]) / leg).clamp(0.0, 1.0) } else { 1.0 };
        self.points[before].towards(self.points[next], fraction)
    }

    /// Goes on from `position`; the velocity to fly, or `None` at the end.
    pub(super) fn follow(&mut self, position: EnuPosition) -> Option<EnuVelocity> {
        // Forward only, and never further than the lookahead: where a path crosses itself, the way through it is kept.
        const PIECES: usize = 16;
        let piece = self.lookahead / PIECES as f64;
        let nearest = (0..=PIECES)
            .map(|n| (self.along + n as f64 * piece).min(self.length()))
            .min_by(|a, b| self.at(*a).distance(position).total_cmp(&self.at(*b).distance(position)));
        self.along = nearest.unwrap_or(self.along);
        let left = self.length() - self.along;
        let to_end = position.distance(self.end());
        if left <= self.lookahead && to_end <= REACHED {
            return None;
        }
        let carrot = self.at(self.along + self.lookahead);
        let speed = self.speed.min(braking(left.max(to_end)));
        let distance = position.distance(carrot);
        Some(scaled(position, carrot, if distance > 0.0 { speed / distance } else { 0.0 }))
    }
}

/// The speed from which it can still be stopped within a distance.
fn braking(distance: f64) -> f64 {
    libm::sqrt(2.0 * BRAKING * distance).min(GAIN * distance).max(0.05)
}

fn scaled(from: EnuPosition, to: EnuPosition, factor: f64) -> EnuVelocity {
    EnuVelocity { east: (to.east - from.east) * factor, north: (to.north - from.north) * factor, up: (to.up - from.up) * factor }
}

/// The velocity that holds a position.
pub(super) fn hold(position: EnuPosition, at: EnuPosition) -> EnuVelocity {
    let distance = position.distance(at);
    let factor = if distance > 1e-9 { (GAIN * distance).min(2.0) / distance } else { 0.0 };
    scaled(position, at, factor)
}

/// The vertical speed that holds a height.
pub(super) fn hold_height(up: f64, wanted: f64) -> f64 {
    (GAIN * (wanted - up)).clamp(-2.0, 3.0)
}

impl Yaw {
    /// The yaw rate, rad/s, at this heading, flying at this velocity.
    pub(super) fn rate(self, heading: f64, velocity: EnuVelocity) -> f64 {
        match self {
            Self::Rate(rate) => rate,
            Self::Heading(wanted) => YAW_GAIN * wrap_angle(wanted - heading),
            Self::Travel(offset) if velocity.horizontal_speed() > TRAVELLING => {
                YAW_GAIN * wrap_angle(libm::atan2(velocity.east, velocity.north) + offset - heading)
            }
            Self::Travel(_) => 0.0,
        }
    }

    /// Whether a turn to its heading is over.
    pub(super) fn is_reached(self, heading: f64, yaw_rate: f64, margin: f64) -> bool {
        match self {
            Self::Heading(wanted) => wrap_angle(wanted - heading).abs() <= margin && yaw_rate.abs() <= AT_REST,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flies a path with a body that follows at once, and returns where it was every step.
    fn flown(path: &mut Path, start: EnuPosition) -> Vec<EnuPosition> {
        let mut all = vec![start];
        while let Some(v) = path.follow(all[all.len() - 1]) {
            let p = all[all.len() - 1];
            all.push(EnuPosition { east: p.east + v.east * 0.02, north: p.north + v.north * 0.02, up: p.up + v.up * 0.02 });
            assert!(all.len() < 10_000, "it ends");
        }
        all
    }

    fn at(east: f64, north: f64) -> EnuPosition {
        EnuPosition { east, north, up: 2.0 }
    }

    #[test]
    fn a_path_that_crosses_itself_is_flown_in_order() {
        let corners = [at(10.0, 0.0), at(10.0, 5.0), at(5.0, 5.0), at(5.0, -5.0)];
        let mut path = Path::new(at(0.0, 0.0), &corners, 3.0, -1.0);
        let all = flown(&mut path, at(0.0, 0.0));
        let passes = |corner: &EnuPosition| all.iter().position(|p| p.distance(*corner) < 1.5);
        let order: Vec<_> = corners.iter().map(|corner| passes(corner).expect("every corner is passed")).collect();
        assert!(order.is_sorted(), "{order:?}");
        assert!(all[all.len() - 1].distance(at(5.0, -5.0)) <= REACHED);
    }

    #[test]
    fn no_step_is_faster_than_asked_for() {
        let mut path = Path::new(at(0.0, 0.0), &[at(30.0, 0.0)], 4.0, -1.0);
        let all = flown(&mut path, at(0.0, 0.0));
        assert!(all.windows(2).all(|pair| pair[0].distance(pair[1]) <= 4.0 * 0.02 + 1e-9));
    }

    #[test]
    fn a_turn_goes_the_short_way_round() {
        let yaw = Yaw::Heading((-179_f64).to_radians());
        assert!(yaw.rate(179_f64.to_radians(), EnuVelocity::default()) > 0.0);
        assert!(yaw.is_reached(179_f64.to_radians(), 0.0, 5_f64.to_radians()));
        assert!(!yaw.is_reached(179_f64.to_radians(), 0.1, 5_f64.to_radians()));
    }
}
