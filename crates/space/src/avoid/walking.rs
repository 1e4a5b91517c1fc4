//! Persons who walk: two replies that list the same person give a velocity, and that where they are about to walk.

use std::collections::VecDeque;

use super::{is_person, same_name};
use crate::viewpoint::{Obstacle, Viewpoint};
use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::lift::range_of_label;
use spf_core::panel::Panel;
use spf_core::query::ImageBox;
use spf_core::reply::ObstacleBox;
use spf_core::time::{Duration, Time};

/// Sightings this old no longer tell how somebody walks; where nobody has been seen for as long as the second, nobody is
/// expected.
const PERSON_COUNTS: Duration = Duration::from_secs(8);
const EXPECTED: Duration = Duration::from_secs(4);
/// A walk is compared over this time as well, which is longer than that between two fast answers.
const LONGER: Duration = Duration::from_secs(4);
/// Two sightings less than this apart tell more about the boxes than about the walk.
const APART: Duration = Duration::from_millis(700);
/// Speed from which a person walks, m/s, and the highest that is believed.
const WALKS: f64 = 0.3;
const FASTEST: f64 = 2.0;
/// Shortest displacement that is more than the errors of boxes, metres, and as a fraction of the range.
const LEAST: f64 = 0.3;
const LEAST_FRACTION: f64 = 0.12;
/// That fraction where only the width of the boxes is known, which swings with every step.
const LEAST_BY_WIDTH: f64 = 0.25;
/// A person of the same name farther away than this, or than they can have walked since, is somebody else, metres.
const SAME: f64 = 3.0;
/// How far ahead of the frame a walk is extended: the reply's latency and the time until the next one acts.
pub const AHEAD_OF_FRAME: Duration = Duration::from_millis(3500);
/// Number of places along that walk.
const PLACES: u32 = 7;

/// How a person walks over the ground, metres per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Walk {
    /// Eastward.
    pub east: f64,
    /// Northward.
    pub north: f64,
}

impl Walk {
    /// How fast the person comes nearer to `at`, being at `from`, m/s; negative if they walk away.
    #[must_use]
    pub fn closing(self, from: EnuPosition, at: EnuPosition) -> f64 {
        let (east, north) = (at.east - from.east, at.north - from.north);
        (self.east * east + self.north * north) / libm::hypot(east, north).max(1e-6)
    }

    fn after(self, from: EnuPosition, time: Duration) -> EnuPosition {
        let seconds = time.as_secs_f64();
        EnuPosition { east: from.east + self.east * seconds, north: from.north + self.north * seconds, up: from.up }
    }
}

/// What is known of how a person moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Motion {
    /// Nothing: they have been listed once.
    #[default]
    Unknown,
    /// They walk.
    Walks(Walk),
    /// They stand.
    Stands,
    /// They do not walk across the line of sight; whether they walk along it their boxes do not tell, since the image cuts them off.
    StaysAbeam,
}

/// One sighting of a person.
#[derive(Clone, Copy, Debug)]
struct Spotted {
    captured: Time,
    pose: Pose,
    area: ImageBox,
    depth: u8,
    panel: Panel,
}

/// A person, by the sightings of the last seconds.
#[derive(Clone, Debug)]
struct Person {
    name: String,
    seen: VecDeque<Spotted>,
    motion: Motion,
}

/// The persons listed in the last seconds, and how they walk.
#[derive(Clone, Debug, Default)]
pub struct Walkers(Vec<Person>);

impl Walkers {
    /// Takes the boxes of a reply about the frame of `camera` taken at `pose`.
    pub fn observe(&mut self, camera: &Camera, pose: Pose, captured: Time, boxes: &[ObstacleBox]) {
        for person in &mut self.0 {
            person.seen.retain(|seen| seen.captured + PERSON_COUNTS >= captured);
        }
        self.0.retain(|person| !person.seen.is_empty());
        let mut taken = vec![false; self.0.len()];
        for listed in boxes.iter().filter(|listed| is_person(&listed.name)) {
            let panel = Panel::new(camera, pose, listed.area, listed.depth);
            let seen = Spotted { captured, pose, area: listed.area, depth: listed.depth, panel };
            let apart = |person: &Person| {
                let last = person.seen.back()?;
                let walked = FASTEST * captured.since(last.captured).as_secs_f64();
                let gap = last.gap(&seen);
                (same_name(&person.name, &listed.name) && last.captured < captured && gap < SAME.max(walked)).then_some(gap)
            };
            let known = (0..taken.len()).filter(|&index| !taken[index]);
            let nearest = known.filter_map(|index| Some((apart(&self.0[index])?, index))).min_by(|a, b| a.0.total_cmp(&b.0));
            match nearest {
                Some((_, index)) => {
                    taken[index] = true;
                    self.0[index].add(seen);
                }
                None => self.0.push(Person { name: listed.name.clone(), seen: VecDeque::from([seen]), motion: Motion::Unknown }),
            }
        }
    }

    /// How a person listed in the last reply moves.
    #[must_use]
    pub fn motion_of(&self, listed: &ObstacleBox) -> Motion {
        self.0.iter().find(|person| person.is(listed)).map_or(Motion::Unknown, |person| person.motion)
    }

    /// The places where each person who walks may be within 3.5 s after a view, save the one of the box `except`: their box as it would
    /// be seen from where the camera would have moved instead of them.
    pub fn ahead(&self, at: &Viewpoint, except: Option<&ObstacleBox>) -> impl Iterator<Item = Obstacle> {
        let walks = move |person: &Person| {
            let (Motion::Walks(walk), last) = (person.motion, person.seen.back()?) else { return None };
            let since = at.captured.since(last.captured);
            let is_expected = since <= EXPECTED && except.is_none_or(|except| !person.is(except));
            is_expected.then(|| (person.name.clone(), *last, walk, since))
        };
        let (captured, camera) = (at.captured, at.camera);
        self.0.iter().filter_map(walks).flat_map(move |(name, last, walk, since)| {
            (1..=PLACES).map(move |nth| {
                let position = walk.after(last.pose.position, since + AHEAD_OF_FRAME * nth / PLACES);
                let from = Viewpoint { camera, captured, pose: Pose { position, ..last.pose } };
                Obstacle { from, listed: ObstacleBox { area: last.area, depth: last.depth, name: name.clone() } }
            })
        })
    }
}

impl Person {
    fn is(&self, listed: &ObstacleBox) -> bool {
        same_name(&self.name, &listed.name)
            && self.seen.back().is_some_and(|seen| seen.area == listed.area && seen.depth == listed.depth)
    }

    /// Takes a sighting, and compares it with the last one before that is far enough away, and with one some seconds older: the
    /// first shows who has just begun to walk, the second who walks slowly.
    fn add(&mut self, seen: Spotted) {
        let earlier = |apart: Duration| self.seen.iter().filter(move |before| before.captured + apart <= seen.captured);
        let before = earlier(APART).next_back();
        let longer = earlier(APART).find(|before| before.captured + LONGER >= seen.captured);
        self.motion = match (before.map(|before| motion_between(before, &seen)), longer.map(|first| motion_between(first, &seen)))
        {
            (None, _) => Motion::Unknown,
            (Some(motion), None) => motion,
            (Some(one), Some(other)) => nearer_of(one, other, &seen),
        };
        self.seen.push_back(seen);
    }
}

/// Of two estimates of a person's motion that which brings them nearer to the craft.
fn nearer_of(one: Motion, other: Motion, seen: &Spotted) -> Motion {
    let closing = |walk: Walk| walk.closing(seen.panel.middle(), seen.pose.position);
    match (one, other) {
        (Motion::Walks(a), Motion::Walks(b)) => Motion::Walks(if closing(a) >= closing(b) { a } else { b }),
        (Motion::Walks(walk), _) | (_, Motion::Walks(walk)) => Motion::Walks(walk),
        (Motion::StaysAbeam, _) | (_, Motion::StaysAbeam) => Motion::StaysAbeam,
        _ => Motion::Stands,
    }
}

impl Spotted {
    /// Distance over ground to another sighting, beyond what the error of its range explains, metres.
    fn gap(&self, other: &Self) -> f64 {
        let at = other.pose.position;
        let (mine, theirs) = (self.panel.middle(), other.panel.middle());
        // Labels are a third of the range apart: at the same range, only the direction counts.
        let across = wrap_angle(at.bearing_to(mine) - at.bearing_to(theirs)).abs();
        let range = range_of_label(f64::from(other.depth));
        let along = (at.horizontal_distance(mine) - range).abs() - 0.5 * range;
        libm::hypot(across * range, along.max(0.0))
    }

    /// Height and width of the box; `None` if an edge of the image cuts it off.
    fn sizes(&self) -> [Option<f64>; 2] {
        let ImageBox { left, top, right, bottom } = self.area;
        [(top, bottom), (left, right)]
            .map(|(low, high)| (low > ImageBox::CUT && high < 1.0 - ImageBox::CUT && low < high).then_some(high - low))
    }

    fn bearing(&self) -> f64 {
        self.pose.position.bearing_to(self.panel.middle())
    }
}

/// The motion from one sighting to another. The size of a box tells how much nearer a person has come far better than two depth
/// labels; where it is cut off, only the walk across the line of sight is known.
fn motion_between(first: &Spotted, last: &Spotted) -> Motion {
    let elapsed = last.captured.since(first.captured).as_secs_f64();
    let (label_first, label_last) = (range_of_label(f64::from(first.depth)), range_of_label(f64::from(last.depth)));
    let [tall, wide] = [0, 1].map(|axis| first.sizes()[axis].zip(last.sizes()[axis]));
    // Who walks swings arms and legs, so the height comes first.
    let (ratio, least) = match (tall, wide) {
        (Some((before, after)), _) => (Some(after / before), LEAST_FRACTION),
        (None, Some((before, after))) => (Some(after / before), LEAST_BY_WIDTH),
        (None, None) => (None, LEAST_FRACTION),
    };
    let (range_first, range_last) = ratio.map_or((label_first, label_last), |ratio| {
        // Both labels, brought to the last range.
        let range = libm::sqrt(label_last * label_first / ratio);
        (range * ratio, range)
    });
    let place = |seen: &Spotted, range: f64| {
        let (sin, cos) = (libm::sin(seen.bearing()), libm::cos(seen.bearing()));
        (seen.pose.position.east + range * sin, seen.pose.position.north + range * cos)
    };
    let (from, to) = (place(first, range_first), place(last, range_last));
    let (mut east, mut north) = (to.0 - from.0, to.1 - from.1);
    if ratio.is_none() {
        let (sin, cos) = (libm::sin(last.bearing()), libm::cos(last.bearing()));
        let along = east * sin + north * cos;
        (east, north) = (east - along * sin, north - along * cos);
    }
    let length = libm::hypot(east, north);
    let speed = length / elapsed;
    if length < LEAST.max(least * range_last) || speed < WALKS {
        // Who turns while they come has no wider a box.
        return if tall.is_some() { Motion::Stands } else { Motion::StaysAbeam };
    }
    let scale = speed.min(FASTEST) / length;
    Motion::Walks(Walk { east: east * scale, north: north * scale })
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::Attitude;
    use spf_core::lift::label_of_range;

    const HALF_WIDTH: f64 = 0.03;

    /// The box of a person whose middle is at this place in the frame taken at `pose`, 1.7 m tall.
    fn listed(camera: &Camera, pose: Pose, east: f64, north: f64) -> ObstacleBox {
        let at = EnuPosition { east, north, up: pose.position.up };
        let ahead = pose.position.displacement_to(at, pose.attitude.heading);
        let middle = camera.project(ahead.right, ahead.forward, 0.0).expect("it is ahead");
        let half = 0.5 * 1.7 / ahead.forward / (2.0 * libm::tan(camera.half_fov().1));
        let (top, bottom) = ((middle.v - half).max(0.0), (middle.v + half).min(1.0));
        let area = ImageBox { left: (middle.u - HALF_WIDTH).max(0.0), top, right: (middle.u + HALF_WIDTH).min(1.0), bottom };
        ObstacleBox { area, depth: label_of_range(ahead.length()), name: "person in red".to_owned() }
    }

    fn at(millis: u64) -> Time {
        Time::from_millis(millis)
    }

    fn pose(east: f64, heading: f64) -> Pose {
        let position = EnuPosition { east, north: 0.0, up: 1.4 };
        Pose { position, attitude: Attitude { heading, ..Attitude::default() } }
    }

    #[test]
    fn two_replies_tell_how_a_person_walks_whatever_the_craft_does() {
        let camera = Camera::quad();
        // Westwards at 0.8 m/s, across the path, while the craft moves aside and turns.
        let mut walkers = Walkers::default();
        let (first, last) = (pose(0.0, 0.0), pose(0.6, 0.2));
        walkers.observe(&camera, first, at(0), &[listed(&camera, first, 2.0, 6.0)]);
        let again = listed(&camera, last, 0.4, 6.0);
        walkers.observe(&camera, last, at(2000), std::slice::from_ref(&again));
        let Motion::Walks(walk) = walkers.motion_of(&again) else { panic!("they walk") };
        assert!((walk.east + 0.8).abs() < 0.35 && walk.north.abs() < 0.35, "{walk:?}");
        // They are about to pass in front of a craft at the origin, 6 m away, and not to come nearer.
        let here = EnuPosition { east: 0.4, north: 6.0, up: 0.0 };
        assert!(walk.closing(here, EnuPosition::default()).abs() < 0.4);
        let view = |pose, millis| Viewpoint { camera, pose, captured: at(millis) };
        let places: Vec<_> = walkers.ahead(&view(last, 2000), None).collect();
        let [.., farthest] = &places[..] else { panic!("nobody walks") };
        let (from, to) = (view(last, 2000).place_of(&again), farthest.from.place_of(&farthest.listed));
        assert!((to.east - from.east + 2.8).abs() < 1.2 && (to.north - from.north).abs() < 1.2, "{from:?} {to:?}");
        assert_eq!((places.len(), farthest.listed.name.as_str()), (7, "person in red"));
        // What is known of the walk ends with what is known of the person.
        walkers.observe(&camera, last, at(7000), &[]);
        assert_eq!(walkers.ahead(&view(last, 7000), None).count(), 0);
    }

    #[test]
    fn who_comes_straight_on_is_seen_by_the_height_of_the_box_though_the_label_stays() {
        let camera = Camera::quad();
        let mut walkers = Walkers::default();
        let there = pose(0.0, 0.0);
        let (before, after) = (listed(&camera, there, 0.0, 5.6), listed(&camera, there, 0.0, 4.2));
        let after = ObstacleBox { depth: before.depth, ..after };
        walkers.observe(&camera, there, at(0), &[before]);
        walkers.observe(&camera, there, at(2000), std::slice::from_ref(&after));
        let Motion::Walks(walk) = walkers.motion_of(&after) else { panic!("they walk") };
        let from = EnuPosition { north: 4.2, ..EnuPosition::default() };
        assert!((walk.closing(from, EnuPosition::default()) - 0.7).abs() < 0.2, "{walk:?}");
    }

    #[test]
    fn who_stands_does_not_walk_whatever_the_label_says() {
        let camera = Camera::quad();
        let mut walkers = Walkers::default();
        let (first, last) = (pose(0.0, 0.0), pose(1.0, -0.3));
        let once = listed(&camera, first, 1.0, 5.0);
        walkers.observe(&camera, first, at(0), std::slice::from_ref(&once));
        assert_eq!(walkers.motion_of(&once), Motion::Unknown);
        // The craft moves and turns, and the label is off by one.
        let seen = listed(&camera, last, 1.0, 5.0);
        let seen = ObstacleBox { depth: seen.depth - 1, ..seen };
        walkers.observe(&camera, last, at(1500), std::slice::from_ref(&seen));
        assert_eq!(walkers.motion_of(&seen), Motion::Stands);
        assert_eq!(walkers.ahead(&Viewpoint { camera, pose: last, captured: at(1500) }, None).count(), 0);
    }
}
