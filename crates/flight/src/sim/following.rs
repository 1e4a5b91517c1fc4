//! How long a flight followed its target, by ground truth. An instruction to follow has no end of its own: the flight ends by a
//! limit or by the operator, and its outcome does not say whether anything was followed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::time::Time;
use spf_pilot::PilotSettings;
use spf_scene::geometry::ObjectId;

use super::loaded_scene::{LoadedScene, WorldSnapshot};

/// The target counts as followed within this multiple of the scene's success radius, or this much beyond the distance that the craft
/// keeps, metres …
const WITHIN: f64 = 2.0;
const BEYOND_KEPT: f64 = 0.5;
/// … and the instruction as fulfilled if it was for this fraction …
const SHARE: f64 = 2.0 / 3.0;
/// … of the last seconds, or of the time after which following ends as reached, if that is shorter.
const WINDOW_S: f64 = 20.0;
/// Time between two samples, seconds.
const STEP_S: f64 = 0.5;

/// How long the target of an instruction to follow was followed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Followed {
    /// Whether the instruction counts as fulfilled: for two thirds of the last seconds the craft was near the target.
    pub fulfilled: bool,
    /// How many last seconds: 20, or the time after which following ends as reached, if that is shorter.
    pub window_s: f64,
    /// Distance from the target's surface within which it counts as followed, metres.
    pub within_m: f64,
    /// Time within this distance, seconds.
    pub near_s: f64,
    /// Time since the craft was first that near, seconds; 0 if it never was.
    pub since_first_s: f64,
}

impl Followed {
    /// In words, one line.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { fulfilled, window_s, within_m, near_s, since_first_s } = self;
        if *since_first_s == 0.0 {
            return format!("followed: never within {within_m} m of the target; not fulfilled");
        }
        let percent = 100.0 * near_s / since_first_s;
        let verdict = if *fulfilled { "fulfilled" } else { "not fulfilled" };
        format!(
            "followed: within {within_m} m of the target for {near_s:.0} of the {since_first_s:.0} s since it was first that near \
             ({percent:.0} %); {verdict} (two thirds of the last {window_s:.0} s count)"
        )
    }
}

/// The states of the world during an instruction, twice a second.
#[derive(Default)]
pub(super) struct Course(Vec<(Time, WorldSnapshot)>);

impl Course {
    /// Forgets what was before a new instruction.
    pub(super) fn restart(&mut self) {
        self.0.clear();
    }

    /// Adds the state at `now` if the last one is old enough.
    pub(super) fn note(&mut self, now: Time, world: impl FnOnce() -> WorldSnapshot) {
        if self.0.last().is_none_or(|(last, _)| now.since(*last).as_secs_f64() >= STEP_S) {
            self.0.push((now, world()));
        }
    }

    /// Flight time in seconds and the distance to the nearest of these objects then, metres.
    pub(super) fn distances(&self, loaded: &LoadedScene, objects: &[ObjectId]) -> Vec<(f64, f64)> {
        let distance = |at: &WorldSnapshot| {
            let distance = |id: &ObjectId| loaded.distance_to(*id, &at.actors, at.pose.position);
            objects.iter().filter_map(distance).fold(f64::INFINITY, f64::min)
        };
        self.0.iter().map(|(at, world)| (at.as_secs_f64(), distance(world))).collect()
    }
}

/// How long a target at these distances was followed by a craft with these settings, in a scene with this success radius.
pub(super) fn followed(distances: &[(f64, f64)], success_radius: f64, settings: &PilotSettings) -> Followed {
    // Whoever keeps a distance is near at that distance.
    let kept = settings.keeps().map_or(0.0, |keep| keep + BEYOND_KEPT);
    let within_m = (WITHIN * success_radius).max(kept);
    let window_s = settings.follow_time.map_or(WINDOW_S, |time| time.as_secs_f64().min(WINDOW_S));
    let samples: Vec<(f64, bool)> = distances.iter().map(|(at, metres)| (*at, *metres <= within_m)).collect();
    rate(&samples, within_m, window_s)
}

/// Samples as flight time and whether the target was near.
fn rate(samples: &[(f64, bool)], within_m: f64, window_s: f64) -> Followed {
    let end = samples.last().map_or(0.0, |(at, _)| *at);
    let first = samples.iter().find(|(_, near)| *near).map_or(end, |(at, _)| *at);
    // Each sample stands for the time up to the next one.
    let near_s = samples.windows(2).filter(|pair| pair[0].1).map(|pair| pair[1].0 - pair[0].0).sum();
    let recent: Vec<&(f64, bool)> = samples.iter().filter(|(at, _)| end - at <= window_s).collect();
    let is_whole = samples.first().is_some_and(|(at, _)| end - at >= window_s);
    let kept = recent.iter().filter(|(_, near)| *near).count();
    let fulfilled = is_whole && kept as f64 >= SHARE * recent.len() as f64;
    Followed { fulfilled, window_s, within_m, near_s, since_first_s: end - first }
}

#[cfg(test)]
mod tests {
    use spf_core::time::duration_from_secs;
    use spf_pilot::Preset;

    use super::*;

    fn of(near: impl Fn(f64) -> bool, seconds: u32) -> Followed {
        let samples: Vec<(f64, bool)> = (0..=2 * seconds).map(|step| f64::from(step) * STEP_S).map(|at| (at, near(at))).collect();
        rate(&samples, 10.0, WINDOW_S)
    }

    /// In an office 2 m count as near, and a craft with a tracker keeps 2.5 m.
    #[test]
    fn the_distance_that_is_kept_is_near() {
        let distances: Vec<(f64, f64)> = (0..60).map(|step| (f64::from(step) * STEP_S, 2.6)).collect();
        let mut settings = PilotSettings::preset(Preset::Default);
        assert!(!followed(&distances, 1.0, &settings).fulfilled);
        settings.track = true;
        let judged = followed(&distances, 1.0, &settings);
        assert_eq!((judged.fulfilled, judged.within_m, judged.window_s), (true, 3.0, 20.0));
        assert_eq!(followed(&distances, 5.0, &settings).within_m, 10.0);
        // A following that ends after 15 s is judged by those.
        settings.follow_time = Some(duration_from_secs(15.0));
        let judged = followed(&distances[..32], 1.0, &settings);
        assert!(judged.fulfilled && judged.words().ends_with("(two thirds of the last 15 s count)"), "{}", judged.words());
    }

    #[test]
    fn two_thirds_of_the_last_seconds_are_required() {
        let all = of(|at| at >= 10.0, 60);
        assert_eq!((all.fulfilled, all.near_s, all.since_first_s), (true, 50.0, 50.0));
        let lost = of(|at| (10.0..50.0).contains(&at), 60);
        assert_eq!((lost.fulfilled, lost.near_s, lost.since_first_s), (false, 40.0, 50.0));
        assert!(
            lost.words().contains("for 40 of the 50 s since it was first that near (80 %); not fulfilled"),
            "{}",
            lost.words()
        );
        assert!(of(|at| !(50.0..55.0).contains(&at), 60).fulfilled);
        // Too short to say, and never there.
        assert!(!of(|_| true, 15).fulfilled);
        let never = of(|_| false, 60);
        assert_eq!(never.words(), "followed: never within 10 m of the target; not fulfilled");
        assert_eq!(rate(&[], 2.0, WINDOW_S).near_s, 0.0);
    }
}
