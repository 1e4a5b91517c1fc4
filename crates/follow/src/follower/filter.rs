//! Where a followed target is and how it moves: an extended Kalman filter.

use spf_core::geometry::{EnuPosition, EnuVelocity, wrap_angle};
use spf_core::time::Time;

use spf_core::direction::Direction;

/// East and north of the target, metres; its velocity east and north, m/s; the logarithm of its size in the image at 1 m.
const STATES: usize = 5;
/// Index of the latter.
const LN_SIZE: usize = 4;
/// Spectral density of the target's acceleration, m²/s³: a walker that turns and stops.
const ACCELERATION: f64 = 0.6;
/// Random walk of the target's size (a person who turns), 1/s.
const SIZE: f64 = 0.004;
/// Speeds above this are no walker's, m/s.
const FASTEST: f64 = 2.5;
/// Standard deviations of a track: bearing of the box's centre, radians, and the logarithm of its scale.
const BEARING_SD: f64 = 0.02;
const SCALE_SD: f64 = 0.02;
/// Fraction of the difference by which an elevation moves the target's height. It does not move the range: a range from the
/// elevation would be that of a box whose middle stays at one height above the ground, which it does not where an edge of the image
/// cuts the box off.
const HEIGHT_GAIN: f64 = 0.3;
/// Standard deviations of a reply's target at first: logarithm of the range, and speed, m/s.
const FIRST_RANGE_SD: f64 = 0.3;
const FIRST_SPEED_SD: f64 = 0.7;
/// Nearer than this no bearing is defined, metres.
const NEAREST: f64 = 0.3;

/// The filter of one target.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    at: Time,
    x: [f64; STATES],
    p: [[f64; STATES]; STATES],
    /// Height of the target, metres.
    up: f64,
}

impl Filter {
    /// A target in this direction from `eye`, `range` metres away, that may walk anywhere.
    pub(super) fn new(at: Time, eye: EnuPosition, direction: Direction, range: f64) -> Self {
        let place = direction.place(eye, range);
        let x = [place.east, place.north, 0.0, 0.0, libm::log(range.max(NEAREST))];
        let mut p = [[0.0; STATES]; STATES];
        // Along the line of sight, and across it.
        let along = direction.unit();
        let (along_var, across_var) = (square(FIRST_RANGE_SD * range), square(2.0 * BEARING_SD * range));
        for row in 0..2 {
            for column in 0..2 {
                p[row][column] = (along_var - across_var) * along[row] * along[column];
            }
            p[row][row] += across_var;
        }
        p[2][2] = square(FIRST_SPEED_SD);
        p[3][3] = p[2][2];
        let mut filter = Self { at, x, p, up: place.up };
        filter.begin_size(eye, 1.0);
        filter
    }

    /// When the state holds.
    pub(super) fn at(&self) -> Time {
        self.at
    }

    /// The target's position at `time`, if it walks on; where it was last seen if not.
    pub(super) fn position(&self, time: Time, walks_on: bool) -> EnuPosition {
        let t = if walks_on { time.since(self.at).as_secs_f64() } else { 0.0 };
        EnuPosition { east: self.x[0] + self.x[2] * t, north: self.x[1] + self.x[3] * t, up: self.up }
    }

    /// The target's velocity.
    pub(super) fn velocity(&self) -> EnuVelocity {
        EnuVelocity { east: self.x[2], north: self.x[3], up: 0.0 }
    }

    /// Logarithm of the range from `eye`, and its variance.
    pub(super) fn log_range(&self, eye: EnuPosition) -> (f64, f64) {
        let Sight { range, .. } = self.sight(eye);
        let h = self.range_row(eye);
        (libm::log(range), self.variance(&h))
    }

    /// The direction from `eye`.
    pub(super) fn direction(&self, eye: EnuPosition) -> Direction {
        let Sight { east, north, up, level, .. } = self.sight(eye);
        Direction { bearing: libm::atan2(east, north), elevation: libm::atan2(up, level) }
    }

    /// Advances the state.
    pub(super) fn advance(&mut self, to: Time) {
        let t = to.since(self.at).as_secs_f64();
        if t <= 0.0 {
            return;
        }
        self.at = to;
        for (place, speed) in [(0, 2), (1, 3)] {
            self.x[place] += self.x[speed] * t;
            // P = F P Fᵀ, one position at a time.
            for column in 0..STATES {
                self.p[place][column] += t * self.p[speed][column];
            }
            for row in 0..STATES {
                self.p[row][place] += t * self.p[row][speed];
            }
            self.p[place][place] += ACCELERATION * t * t * t / 3.0;
            self.p[place][speed] += ACCELERATION * t * t / 2.0;
            self.p[speed][place] += ACCELERATION * t * t / 2.0;
            self.p[speed][speed] += ACCELERATION * t;
        }
        self.p[LN_SIZE][LN_SIZE] += SIZE * t;
    }

    /// Takes a track's box at the time of the state.
    pub(super) fn track(&mut self, eye: EnuPosition, direction: Direction, scale: f64) {
        self.look(eye, direction);
        let Sight { range, .. } = self.sight(eye);
        let mut h = self.range_row(eye).map(|x| -x);
        h[LN_SIZE] = 1.0;
        self.correct(&h, libm::log(scale) - (self.x[LN_SIZE] - libm::log(range)), square(SCALE_SD));
        self.bound();
    }

    /// Takes a bearing and an elevation at the time of the state.
    pub(super) fn look(&mut self, eye: EnuPosition, direction: Direction) {
        let Sight { east, north, level, .. } = self.sight(eye);
        let expected = self.direction(eye);
        let mut h = [0.0; STATES];
        (h[0], h[1]) = (north / square(level), -east / square(level));
        self.correct(&h, wrap_angle(direction.bearing - expected.bearing), square(BEARING_SD));
        self.bound();
    }

    /// Takes an elevation of the target's middle.
    pub(super) fn raise(&mut self, eye: EnuPosition, elevation: f64) {
        let Sight { level, .. } = self.sight(eye);
        self.up += HEIGHT_GAIN * (eye.up + level * libm::tan(elevation) - self.up);
    }

    /// Takes the height of the target's middle.
    pub(super) fn set_height(&mut self, up: f64) {
        self.up = up;
    }

    /// Corrects the range by this much in its logarithm, which has this variance.
    pub(super) fn range(&mut self, eye: EnuPosition, error: f64, variance: f64) {
        let h = self.range_row(eye);
        self.correct(&h, error, variance);
        self.bound();
    }

    /// Begins to measure the size anew: a track of another box, which is this many times as large as at its own start.
    pub(super) fn begin_size(&mut self, eye: EnuPosition, scale: f64) {
        let h = self.range_row(eye);
        let Sight { range, .. } = self.sight(eye);
        self.x[LN_SIZE] = libm::log(scale) + libm::log(range);
        let row: [f64; STATES] = core::array::from_fn(|column| (0..LN_SIZE).map(|k| h[k] * self.p[k][column]).sum());
        for (column, value) in row.iter().enumerate().take(LN_SIZE) {
            self.p[LN_SIZE][column] = *value;
            self.p[column][LN_SIZE] = *value;
        }
        self.p[LN_SIZE][LN_SIZE] = (0..LN_SIZE).map(|k| row[k] * h[k]).sum::<f64>() + square(SCALE_SD);
    }

    fn sight(&self, eye: EnuPosition) -> Sight {
        let (east, north, up) = (self.x[0] - eye.east, self.x[1] - eye.north, self.up - eye.up);
        let level = libm::hypot(east, north).max(NEAREST);
        Sight { east, north, up, level, range: libm::hypot(level, up) }
    }

    /// Derivative of the range's logarithm by the state.
    fn range_row(&self, eye: EnuPosition) -> [f64; STATES] {
        let Sight { east, north, range, .. } = self.sight(eye);
        let mut h = [0.0; STATES];
        (h[0], h[1]) = (east / square(range), north / square(range));
        h
    }

    fn variance(&self, h: &[f64; STATES]) -> f64 {
        (0..STATES).map(|row| h[row] * (0..STATES).map(|column| self.p[row][column] * h[column]).sum::<f64>()).sum()
    }

    /// The measurement update by one number: `h` is its derivative by the state.
    fn correct(&mut self, h: &[f64; STATES], error: f64, variance: f64) {
        let ph: [f64; STATES] = core::array::from_fn(|row| (0..STATES).map(|column| self.p[row][column] * h[column]).sum());
        let total = (0..STATES).map(|row| h[row] * ph[row]).sum::<f64>() + variance;
        if !(total > 0.0 && error.is_finite()) {
            return;
        }
        for row in 0..STATES {
            self.x[row] += ph[row] / total * error;
            for column in 0..STATES {
                self.p[row][column] -= ph[row] * ph[column] / total;
            }
        }
    }

    fn bound(&mut self) {
        let speed = libm::hypot(self.x[2], self.x[3]);
        if speed > FASTEST {
            self.x[2] *= FASTEST / speed;
            self.x[3] *= FASTEST / speed;
        }
    }
}

/// The target as seen from the eye, metres; `level` is horizontal.
struct Sight {
    east: f64,
    north: f64,
    up: f64,
    level: f64,
    range: f64,
}

fn square(x: f64) -> f64 {
    x * x
}
