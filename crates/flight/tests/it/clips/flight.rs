//! The flights of the clips: which target, from where, and along which path.

use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::rng::RandomStream;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_flight::sim::WorldSnapshot;
use spf_media::track::PixelBox;
use spf_scene::actors::{ActorPlace, Traffic};
use spf_scene::geometry::ObjectId;

use super::kinds::{Condition, IMAGES, Number};
use super::stage::{Sight, Stage, Target, around};

/// Time between two images.
pub(super) const INTERVAL: Duration = Duration::from_millis(100);
/// Flights that are drawn until one suits: at so many times, and each time so many.
const ROUNDS: usize = 8;
const TRIES: usize = 150;
/// Moments at which a flight is looked at, besides its start.
const SAMPLES: u32 = 20;
/// The narrowest target, pixels.
const NARROWEST: f64 = 24.0;
/// What a target is not: nobody would point at it.
const NO_TARGETS: [&str; 8] = ["ground", "floor", "ceiling", "water", "wall", "opening", "wood", "window"];

/// The camera of all clips: that of the simulator's craft, 480 pixels wide.
pub(super) fn camera() -> Camera {
    Camera::from_fov(480, 360, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 5.0_f64.to_radians())
}

/// A path near a target, with the nose kept on it, not quite.
struct Path {
    /// Metres from the target at the start, and how fast that grows, per second.
    range: f64,
    growth: f64,
    /// Radians from north in which the craft is, seen from the target; how far it goes to and fro, and how fast.
    bearing: f64,
    swing: f64,
    pace: f64,
    /// Metres above the middle of the target.
    above: f64,
    /// How far the nose turns off the target, radians.
    nose: f64,
    /// How much of a walker's way the craft goes along, 0 to 1.
    follows: f64,
    /// Least height over the ground below the target.
    lowest: f64,
}

impl Path {
    fn draw(random: &mut RandomStream, number: &Number, size: f64, length: f64, ground: f64, least: f64) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
        // From 24 to 140 pixels, small ones as often as large ones; people to 70, who then fill the height.
        let largest = if number.walks { 70.0 } else { 140.0 };
        let pixels = NARROWEST * libm::pow(largest / NARROWEST, between(0.0, 1.0));
        let range = (camera().fx * size / pixels).max(least);
        // At most 2 m/s to the side.
        let pace = between(0.3, 0.7);
        let widest = if number.condition == Condition::Hidden { 0.9 } else { 0.45 };
        Self {
            range,
            growth: between(-0.08, 0.04).max(-1.5 / range),
            bearing: between(0.0, core::f64::consts::TAU),
            swing: between(0.05, widest).min(2.0 / (range * pace)),
            pace,
            above: between(-0.3, 0.8).min(0.2 * length),
            nose: between(2.0, 10.0).to_radians(),
            follows: if number.walks { between(0.0, 1.0) } else { 0.0 },
            lowest: ground + 0.7,
        }
    }

    /// The pose `time` seconds after the start. The target was at `from` then, and is at `now`.
    fn pose(&self, from: EnuPosition, now: EnuPosition, time: f64) -> Pose {
        let about = from.towards(now, self.follows);
        let bearing = self.bearing + self.swing * libm::sin(self.pace * time);
        let range = self.range * libm::exp(self.growth * time);
        let (east, north) = (about.east + range * libm::sin(bearing), about.north + range * libm::cos(bearing));
        let position = EnuPosition { east, north, up: (about.up + self.above).max(self.lowest) };
        let ahead = libm::atan2(now.east - east, now.north - north);
        let heading = ahead + self.nose * libm::sin(1.1 * time + self.bearing);
        Pose { position, attitude: Attitude { heading: spf_core::geometry::wrap_angle(heading), ..Attitude::default() } }
    }
}

/// A clip that is ready to be filmed.
pub(super) struct Flight {
    /// The target.
    pub(super) id: ObjectId,
    traffic: Arc<Traffic>,
    path: Path,
    from: Time,
    start: EnuPosition,
}

impl Flight {
    /// Draws flights until one suits; `None` if none does.
    pub(super) fn draw(stage: &Stage, number: &Number) -> Option<Self> {
        let mut random = RandomStream::new(number.seed, "clip", &[number.index as u64]);
        let targets = targets(stage, number);
        (0..ROUNDS).find_map(|_| {
            let from = Time::ZERO + duration_from_secs(if number.walks { 1.0 + 40.0 * random.uniform() } else { 1.0 });
            // A shutter is open a little longer than the clip lasts.
            let traffic = Arc::new(stage.traffic(number.index as u64, from + Duration::from_millis(8200)));
            (0..TRIES).find_map(|_| {
                let id = *targets.get(random.below(targets.len()))?;
                Self::new(stage, number, (id, from, traffic.clone()), &mut random).filter(|flight| flight.suits(stage, number))
            })
        })
    }

    fn new(
        stage: &Stage,
        number: &Number,
        (id, from, traffic): (ObjectId, Time, Arc<Traffic>),
        random: &mut RandomStream,
    ) -> Option<Self> {
        let object = stage.loaded.scene.object(id)?;
        let bounds = |at: Time| traffic.places_at(at).map(|actors| stage.loaded.bounds(object, &actors));
        let (first, last) = (bounds(from)?, bounds(from + INTERVAL * IMAGES as u32)?);
        let [start, end] = [&first, &last].map(|bounds| bounds.min.towards(bounds.max, 0.5));
        if number.walks && end.horizontal_distance(start) < 1.2 {
            return None;
        }
        let across = (first.max.east - first.min.east).max(first.max.north - first.min.north);
        let high = first.max.up - first.min.up;
        let size = if number.walks { 0.5 } else { across.min(high) };
        let least = if number.walks { 1.5 } else { 0.6 * across + 0.8 };
        let path = Path::draw(random, number, size, high, first.min.up, least);
        let flight = Self { id, traffic, path, from, start };
        flight.is_free(stage, number).then_some(flight)
    }

    /// Where the target is: the middle of its box.
    fn middle(&self, stage: &Stage, actors: &[ActorPlace]) -> Option<EnuPosition> {
        let bounds = stage.loaded.bounds(stage.loaded.scene.object(self.id)?, actors);
        Some(bounds.min.towards(bounds.max, 0.5))
    }

    /// The world a number of seconds after the start.
    pub(super) fn at(&self, stage: &Stage, time: Time) -> Option<WorldSnapshot> {
        let actors = self.traffic.places_at(time)?;
        // A person's box sways with the gait; the craft does not.
        let now = EnuPosition { up: self.start.up, ..self.middle(stage, &actors)? };
        let passed = time.as_secs_f64() - self.from.as_secs_f64();
        Some(WorldSnapshot { pose: self.path.pose(self.start, now, passed), actors })
    }

    /// The time of an image.
    pub(super) fn time(&self, seconds: f64) -> Time {
        self.from + duration_from_secs(seconds)
    }

    /// The worlds at some times of the clip, evenly spaced.
    fn samples<'a>(&'a self, stage: &'a Stage, count: u32) -> impl Iterator<Item = WorldSnapshot> + 'a {
        (0..=count).filter_map(move |sample| self.at(stage, self.time(7.9 * f64::from(sample) / f64::from(count))))
    }

    /// Whether the way is free, and the line of sight at the start; in a clip in which the target is to be hidden, whether that
    /// line is blocked for a while, and free at the end.
    fn is_free(&self, stage: &Stage, number: &Number) -> bool {
        let collider = &stage.loaded.collider;
        let (mut run, mut longest, mut last) = (0, 0, false);
        for (sample, snapshot) in self.samples(stage, SAMPLES).enumerate() {
            let eye = snapshot.pose.position;
            let Some(middle) = self.middle(stage, &snapshot.actors) else { return false };
            last = collider.segment_blocked(eye, middle).is_some_and(|object| object != self.id);
            if collider.contact(eye, 0.35).is_some() || sample == 0 && last {
                return false;
            }
            run = if last { run + 1 } else { 0 };
            longest = longest.max(run);
        }
        number.condition != Condition::Hidden || longest >= 2 && !last
    }

    /// Whether the target is well in view at the start, and the clip is of its kind.
    fn suits(&self, stage: &Stage, number: &Number) -> bool {
        let target = Target::new(stage, self.id);
        let Some(first) = self.at(stage, self.from) else { return false };
        if !begins_well(&target.sight(stage, &camera(), &first).0, number.walks) {
            return false;
        }
        let small = camera().resized(160, 120);
        if number.condition == Condition::Hidden {
            let sights: Vec<Sight> =
                self.samples(stage, SAMPLES).map(|snapshot| target.sight(stage, &small, &snapshot).0).collect();
            let hidden = sights.windows(2).any(|two| two.iter().all(|sight| sight.share < 0.5));
            return hidden && sights.last().is_some_and(|last| last.is_whole(&small));
        }
        let Some(least) = number.condition.least_clutter() else { return true };
        let clutter = self.samples(stage, 5).map(|snapshot| {
            let (sight, ids) = target.sight(stage, &small, &snapshot);
            let shares = sight.whole.map(|area| around(&ids, &small, &area)).unwrap_or_default();
            let of_kind = shares.iter().filter(|(id, _)| {
                let object = stage.loaded.scene.object(**id);
                **id != self.id && object.is_some_and(|object| number.condition.clutters(object))
            });
            of_kind.map(|(_, share)| share).sum::<f64>()
        });
        clutter.sum::<f64>() >= 6.0 * least
    }
}

/// Whether a target is large enough at the start, not too large, and hardly hidden.
fn begins_well(sight: &Sight, walks: bool) -> bool {
    let Some(PixelBox { left, top, right, bottom }) = sight.visible else { return false };
    let (width, height) = (right - left, bottom - top);
    let fills = sight.pixels > 0.4 * width * height || walks && sight.pixels > 0.3 * width * height;
    sight.share >= 0.8 && fills && width.min(height) >= NARROWEST && width < 200.0 && !sight.is_cut(&camera())
}

fn targets(stage: &Stage, number: &Number) -> Vec<ObjectId> {
    let scene = &stage.loaded.scene;
    let walker = |id: ObjectId| stage.loaded.cast.of_object(id).is_some();
    let suits = |object: &&spf_scene::Object| {
        let is_person = object.tags.kind == "person";
        if number.walks {
            return is_person && walker(object.id);
        }
        !object.opening && !walker(object.id) && !NO_TARGETS.contains(&object.tags.kind.as_str())
    };
    scene.objects.iter().filter(suits).map(|object| object.id).collect()
}
