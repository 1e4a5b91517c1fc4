//! Following a moving target by its track (`docs/explanation/between-answers.md`).
//!
//! A [`Follower`] estimates where the target is and how it moves, from the bearing and the size of its box in each frame, the
//! craft's own motion, and the range that each reply gives; and it computes the setpoint that keeps a distance to it.
//!
//! The target's velocity is used only while the track is good. Half a second after that the craft does not come nearer any more,
//! and backs off if it is close; it turns to where the target was last seen.

mod filter;

use std::collections::VecDeque;

use filter::Filter;

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::direction::Direction;
use spf_core::geometry::{EnuPosition, EnuVelocity, Pose, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::query::{ImageBox, ImagePoint, QueryId};
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_core::track::{TrackQuality, TrackReport};
use spf_pilot::standing::{self, FEET_TO_SURFACE, IMAGE_EDGE, Reading};
use spf_pilot::steering::{Answer, DEFAULT_KEEP, Steering, TargetEstimate, WayOut};

/// Distances that can be kept, metres: the least is for a target that is only flown to.
const KEEP: (f64, f64) = (0.4, 10.0);
/// Without a good track for this long, the target's velocity is not used any more.
const SURE: Duration = Duration::from_millis(500);
/// Without one for this long, the target is lost.
const LOST: Duration = Duration::from_secs(3);
/// Its last place is worth a look for this long.
const LAST_SEEN: Duration = Duration::from_secs(10);
/// A target that was lost is thought to have walked on for this long.
const WALKED_ON: Duration = Duration::from_secs(2);
/// Without a reply that confirms it, about a frame newer than this, the target is lost whatever its track says.
const CONFIRMED: Duration = Duration::from_secs(15);
/// Ranges are remembered for this long: replies are about older frames.
const RANGES_KEPT: Duration = Duration::from_secs(10);
/// Variance of the logarithm of a label's range: its rounding, and the VLM's error.
const LABEL_VARIANCE: f64 = 0.148 * 0.148 + 0.2 * 0.2;
/// A reply that sees the target farther than this from where the track had it sees another one, radians: 12°.
const ELSEWHERE: f64 = 0.21;
/// A range that a label states up to which a target is beside the craft, metres: label 1.
const BESIDE: f64 = 1.2;
/// Standard deviation of the logarithm of the range that no number of readings removes: a person's stature is the same in all.
const RANGE_FLOOR: f64 = 0.1;
/// Gains: yaw rate per bearing error, closing speed per distance error, climb rate per height error, 1/s.
const YAW_GAIN: f64 = 2.0;
const CLOSING_GAIN: f64 = 0.8;
const CLIMB_GAIN: f64 = 0.8;
/// Closing speed near the target, m/s, and within which multiple of the distance to keep.
const SLOW: f64 = 0.7;
const NEAR: f64 = 1.5;
/// A way aside is flown faster than one straight away, by the reciprocal of this at most.
const LEAST_AWAY: f64 = 0.5;
/// Fastest motion away from a target that was lost, m/s.
const AWAY_LOST: f64 = 0.5;
/// Added to the distance to keep from a target that was lost, metres.
const LOST_MARGIN: f64 = 1.0;
/// The target's centre is kept within this fraction of half of the vertical field of view.
const MIDDLE: f64 = 0.5;
/// The same of a person near the distance to keep.
const UPRIGHT: f64 = 0.1;
/// Within this many times the distance to keep.
const UPRIGHT_WITHIN: f64 = 1.5;
/// Fraction of the distance at which that must hold.
const SOONER: f64 = 0.7;
/// With a bearing error above this, the craft only turns, radians: 45°.
const TURN_FIRST: f64 = core::f64::consts::FRAC_PI_4;

/// A range at an earlier time.
#[derive(Clone, Copy, Debug)]
struct Remembered {
    at: Time,
    log_range: f64,
    direction: Direction,
}

/// Estimates a moving target and keeps a distance to it. See the [module](self).
#[derive(Clone, Debug)]
pub struct Follower {
    camera: Camera,
    keep: f64,
    filter: Option<Filter>,
    history: VecDeque<Remembered>,
    /// The track whose size the filter measures.
    track: Option<QueryId>,
    /// The last label's range, and how many labels in a row have said the same.
    label: (f64, u32),
    /// Whether the last reply sees the target beside the craft. Of a box that the image's edges cut off a tracker measures the
    /// size badly.
    is_beside: bool,
    /// Whether the target is a person, of a person's stature.
    is_person: bool,
    /// When the target was last seen for sure.
    seen: Time,
    /// When the frame of the last good report was taken.
    tracked: Option<Time>,
    /// When the newest frame was taken on which a reply has confirmed it.
    confirmed: Time,
}

impl Follower {
    /// A follower that keeps `keep` metres away, at most 10.
    #[must_use]
    pub fn new(camera: Camera, keep: f64) -> Self {
        let keep = if keep.is_finite() { keep.clamp(KEEP.0, KEEP.1) } else { DEFAULT_KEEP };
        Self {
            camera,
            keep,
            filter: None,
            history: VecDeque::new(),
            track: None,
            label: (0.0, 0),
            is_beside: false,
            is_person: false,
            seen: Time::ZERO,
            tracked: None,
            confirmed: Time::ZERO,
        }
    }

    /// Takes a reply that sees the target.
    pub fn answer(&mut self, answer: &Answer) {
        let Answer { captured, pose, area, range, .. } = *answer;
        let direction = Direction::of_point(&self.camera, pose, centre(area));
        let range = range.max(0.5);
        let fills_image = area.top < IMAGE_EDGE && area.bottom > 1.0 - IMAGE_EDGE;
        if captured >= self.confirmed {
            self.is_beside = range <= BESIDE || fills_image;
        }
        let stature = standing::by_stature(&self.camera, pose, area).filter(|_| answer.is_person);
        let readings = [stature, standing::by_ground(&self.camera, pose, area, FEET_TO_SURFACE)];
        self.label = if self.label.0 == range { (range, self.label.1 + 1) } else { (range, 1) };
        let then = self.history.iter().min_by_key(|kept| kept.at.since(captured).max(captured.since(kept.at))).copied();
        let mut then = then.filter(|kept| kept.at.since(captured).max(captured.since(kept.at)) <= SURE);
        match (&mut self.filter, then) {
            (Some(filter), Some(then)) if wrap_angle(then.direction.bearing - direction.bearing).abs() < ELSEWHERE => {
                // The same correction now as then: growth of the box and own motion connect the two.
                let label = (libm::log(range), LABEL_VARIANCE * f64::from(self.label.1));
                let (ln_range, variance) = fused(label, &readings, then.log_range);
                filter.range(pose.position, ln_range - then.log_range, variance);
            }
            _ => {
                // Another place: what was known of the range before is that of another.
                then = None;
                let (ln_range, _) = fused((libm::log(range), LABEL_VARIANCE), &readings, libm::log(range));
                self.filter = Some(Filter::new(captured, pose.position, direction, libm::exp(ln_range)));
                self.history.clear();
                (self.label.1, self.tracked) = (1, None);
                self.seen = captured;
                self.remember(captured, pose);
            }
        }
        self.is_person = answer.is_person;
        if let Some(filter) = self.filter.as_mut().filter(|_| answer.is_person) {
            let (ln_range, _) = filter.log_range(pose.position);
            let range = then.map_or(ln_range, |then| then.log_range);
            if let Some(up) = standing::middle_of(&self.camera, pose, area, libm::exp(range)) {
                filter.set_height(up);
            }
        }
        self.seen = self.seen.max(captured);
        self.confirmed = self.confirmed.max(captured);
    }

    /// Takes a report on the track, whose frame was taken at `pose`. Older ones than the last are ignored.
    pub fn report(&mut self, report: &TrackReport, pose: Pose) {
        let Some(filter) = &mut self.filter else { return };
        if report.quality != TrackQuality::Good || !report.is_sound() || report.captured <= filter.at() {
            return;
        }
        let direction = Direction::of_point(&self.camera, pose, centre(report.area));
        filter.advance(report.captured);
        if self.track == Some(report.id) {
            filter.track(pose.position, direction, report.scale);
        } else {
            self.track = Some(report.id);
            filter.look(pose.position, direction);
            filter.begin_size(pose.position, report.scale);
        }
        if !self.is_person {
            filter.raise(pose.position, direction.elevation);
        }
        self.seen = self.seen.max(report.captured);
        self.tracked = Some(report.captured);
        self.remember(report.captured, pose);
    }

    fn remember(&mut self, at: Time, pose: Pose) {
        let Some(filter) = &self.filter else { return };
        let (log_range, _) = filter.log_range(pose.position);
        self.history.push_back(Remembered { at, log_range, direction: filter.direction(pose.position) });
        while self.history.front().is_some_and(|first| at.since(first.at) > RANGES_KEPT) {
            self.history.pop_front();
        }
    }

    /// The target at `now`; `None` if it was not seen for 3 s, or no reply has confirmed it for 15 s.
    #[must_use]
    pub fn target(&self, now: Time, from: EnuPosition) -> Option<TargetEstimate> {
        let filter = self.filter.as_ref().filter(|_| now.since(self.seen) <= LOST && now.since(self.confirmed) <= CONFIRMED)?;
        let is_sure = now.since(self.seen) <= SURE;
        let position = filter.position(now, is_sure);
        let velocity = if is_sure { filter.velocity() } else { EnuVelocity::default() };
        let (_, variance) = filter.log_range(from);
        Some(TargetEstimate {
            position,
            velocity,
            range_sd: libm::sqrt(variance.max(0.0) + RANGE_FLOOR * RANGE_FLOOR) * from.distance(position),
            is_sure,
        })
    }

    /// Where the target was last seen, for 10 s; `None` before it has been tracked.
    #[must_use]
    pub fn last_place(&self, now: Time) -> Option<EnuPosition> {
        let filter = self.filter.as_ref().filter(|_| self.tracked.is_some() && now.since(self.seen) <= LAST_SEEN)?;
        Some(filter.position(now, false))
    }

    /// The same, if the target has walked on for a while as it did.
    #[must_use]
    pub fn went_to(&self, now: Time) -> Option<EnuPosition> {
        let filter = self.filter.as_ref().filter(|_| self.tracked.is_some() && now.since(self.seen) <= LAST_SEEN)?;
        Some(filter.position(now.min(filter.at() + WALKED_ON), true))
    }

    /// Whether the target's track is good: without one, replies alone are no guide to a target that moves.
    #[must_use]
    pub fn is_tracked(&self, now: Time) -> bool {
        self.tracked.is_some_and(|tracked| now.since(tracked) <= SURE)
    }

    /// The setpoint that keeps the distance; `None` if the target is lost. `way_out` is where the craft may get away
    /// from it; `None` if it may not, for what lies around it is not known.
    #[must_use]
    pub fn setpoint(&self, now: Time, known: &MotionEstimate, craft: &Craft, way_out: Option<WayOut>) -> Option<Setpoint> {
        let delay = duration_from_secs(craft.dead_time + craft.lag);
        let target = self.target(now, known.position)?;
        let place = self.filter.as_ref()?.position(now + delay, target.is_sure);
        let (east, north) = (place.east - known.position.east, place.north - known.position.north);
        let distance = libm::hypot(east, north);
        if distance < f64::EPSILON {
            return Some(Setpoint::HOLD);
        }
        let off = wrap_angle(libm::atan2(east, north) - known.attitude.heading);
        let yaw_rate = (YAW_GAIN * off).clamp(-craft.yaw_rate, craft.yaw_rate);
        let along = if target.is_sure {
            let recedes = (target.velocity.east * east + target.velocity.north * north) / distance;
            let closing = CLOSING_GAIN * (distance - self.keep);
            let most = if distance < NEAR * self.keep { SLOW } else { craft.cruise_speed };
            (recedes + closing.min(most)).clamp(-craft.cruise_speed, craft.cruise_speed)
        } else {
            (CLOSING_GAIN * (distance - self.keep - LOST_MARGIN)).clamp(-AWAY_LOST, 0.0)
        };
        let along = if off.abs() > TURN_FIRST || self.is_beside && distance > self.keep { along.min(0.0) } else { along };
        // Away from the target in the direction that is free, not in its own.
        let (speed, course) = match way_out {
            _ if along >= 0.0 => (along, off),
            Some(WayOut { bearing, speed }) => {
                let course = wrap_angle(bearing - known.attitude.heading);
                // Beside the straight way the same speed gets the craft less far away.
                let away = -libm::cos(wrap_angle(course - off));
                (speed.min(-along / away.max(LEAST_AWAY)).min(craft.cruise_speed), course)
            }
            None => (0.0, off),
        };
        let (forward, right) = (speed * libm::cos(course), speed * libm::sin(course));
        Some(Setpoint { forward, right, up: self.climb(known, craft, target.position, distance), yaw_rate })
    }

    /// Climb rate that keeps the target near the middle of the image, m/s; at the distance to keep, a person's middle in its middle:
    /// then the image shows all of them.
    fn climb(&self, known: &MotionEstimate, craft: &Craft, target: EnuPosition, distance: f64) -> f64 {
        let axis = -self.camera.tilt;
        let above = target.up - known.position.up;
        let height = |level: f64, part: f64| {
            let most = part * self.camera.half_fov().1;
            let elevation = libm::atan2(above, level);
            let wanted = elevation.clamp(axis - most, axis + most);
            level * (libm::tan(elevation) - libm::tan(wanted))
        };
        // Somewhat nearer, where the craft will be soon: there the target appears higher or lower.
        let mut climb = height((SOONER * distance).max(self.keep).min(distance), MIDDLE);
        if climb == 0.0 && self.is_person && distance < UPRIGHT_WITHIN * self.keep {
            climb = height(self.keep, UPRIGHT);
        }
        (CLIMB_GAIN * climb).clamp(-0.5 * craft.climb_speed, 0.5 * craft.climb_speed)
    }
}

/// A label's range with those by one box: mean and variance of the logarithm. A bound counts if both the others and what was known
/// are farther.
fn fused(label: (f64, f64), readings: &[Option<Reading>], known: f64) -> (f64, f64) {
    readings.iter().flatten().fold(label, |range, reading| {
        let is_idle = reading.is_bound && range.0.max(known) <= reading.ln_range;
        reading.fused_with(range).filter(|_| !is_idle).unwrap_or(range)
    })
}

fn centre(area: ImageBox) -> ImagePoint {
    ImagePoint { u: 0.5 * (area.left + area.right), v: 0.5 * (area.top + area.bottom) }
}

/// Stays with one target after the other, each with a follower of its own.
#[derive(Clone, Debug, Default)]
pub struct StayWith {
    keep: f64,
    follower: Option<Follower>,
}

impl Steering for StayWith {
    fn answer(&mut self, camera: &Camera, answer: &Answer) {
        self.follower.get_or_insert_with(|| Follower::new(*camera, self.keep)).answer(answer);
    }

    fn report(&mut self, report: &TrackReport, pose: Pose) {
        if let Some(follower) = &mut self.follower {
            follower.report(report, pose);
        }
    }

    fn start(&mut self, keep: f64) {
        *self = Self { keep, follower: None };
    }

    fn is_tracked(&self, now: Time) -> bool {
        self.follower.as_ref().is_some_and(|follower| follower.is_tracked(now))
    }

    fn target(&self, now: Time, from: EnuPosition) -> Option<TargetEstimate> {
        self.follower.as_ref()?.target(now, from)
    }

    fn last_place(&self, now: Time) -> Option<EnuPosition> {
        self.follower.as_ref()?.last_place(now)
    }

    fn went_to(&self, now: Time) -> Option<EnuPosition> {
        self.follower.as_ref()?.went_to(now)
    }

    fn setpoint(&self, now: Time, known: &MotionEstimate, craft: &Craft, way_out: Option<WayOut>) -> Option<Setpoint> {
        self.follower.as_ref()?.setpoint(now, known, craft, way_out)
    }
}
