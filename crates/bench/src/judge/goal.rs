//! Evaluates one goal over time.

use std::collections::{BTreeSet, VecDeque};

use glam::DVec2;
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::time::Time;
use spf_flight::sim::WorldSnapshot;
use spf_scene::Aabb;
use spf_scene::geometry::ObjectId;

use super::geometry::{crossing, inside, vector};
use super::sight::JudgeCamera;
use super::{JudgeInput, nearest};
use crate::task::{GoalKind, centre};

/// A goal and its state.
pub(super) struct Watch {
    kind: GoalKind,
    targets: Vec<ObjectId>,
    /// Excluded objects: those that met the previous goal.
    spent: Vec<ObjectId>,
    /// Objects already reached or flown through.
    passed: BTreeSet<ObjectId>,
    /// Position and direction of the last opening crossed.
    crossed: Option<(glam::DVec3, glam::DVec3)>,
    /// Angle flown around a target, or yawed: current, minimum and maximum.
    turned: [f64; 3],
    /// Where the craft came above the target.
    entered: Option<EnuPosition>,
    /// Samples of the window for following: time, and whether near and in view.
    kept: VecDeque<(Time, bool)>,
}

impl Watch {
    pub(super) fn new(kind: GoalKind, targets: Vec<ObjectId>) -> Self {
        Self {
            kind,
            targets,
            spent: Vec::new(),
            passed: BTreeSet::new(),
            crossed: None,
            turned: [0.0; 3],
            entered: None,
            kept: VecDeque::new(),
        }
    }

    pub(super) fn targets(&self) -> &[ObjectId] {
        &self.targets
    }

    pub(super) fn is_momentary(&self) -> bool {
        self.kind.is_momentary()
    }

    /// Whether a single instant determines if it is met.
    pub(super) fn forgets(&self) -> bool {
        matches!(self.kind, GoalKind::Reach { .. })
    }

    /// The objects it was met with, for a following goal that excludes them.
    pub(super) fn met_with(&self) -> Vec<ObjectId> {
        self.passed.iter().copied().chain(self.spent.iter().copied()).collect()
    }

    /// Starts after another goal was met with these objects.
    pub(super) fn begin(&mut self, met_with: Vec<ObjectId>) {
        self.spent = met_with;
    }

    /// Whether it is met now.
    pub(super) fn look(&mut self, shown: &JudgeInput<'_>, sight: &mut JudgeCamera) -> bool {
        match self.kind {
            GoalKind::Reach { other, up_share } => self.reach(shown, sight, other, up_share),
            GoalKind::Visit { count } => {
                let here = self.clear_within(shown, sight, shown.radius, |id| !self.passed.contains(&id));
                self.passed.extend(here);
                self.passed.len() >= count
            }
            GoalKind::Through { count, beyond } => self.through(shown, count, beyond),
            GoalKind::Around { angle, within } => self.around(shown, angle, within),
            GoalKind::Over => self.over(shown),
            GoalKind::Behind { within } => self.behind(shown, within),
            GoalKind::Scan { angle } => self.scan(shown, angle),
            GoalKind::Follow { within, fraction, window } => self.follow(shown, sight, within, fraction, window),
        }
    }

    /// Whether it counts as met by the paper's rules, if it is the last one; `met`: whether it is by its own.
    pub(super) fn is_scored_by_paper(&self, met: bool, shown: &JudgeInput<'_>, sight: &mut JudgeCamera) -> bool {
        let is_at = |id| {
            let snapshot = shown.snapshot;
            let distance = shown.loaded.distance_to(id, &snapshot.actors, snapshot.pose.position);
            distance.is_some_and(|distance| (shown.nearest..=shown.radius).contains(&distance))
        };
        match self.kind {
            GoalKind::Reach { .. } => met && self.passed.iter().any(|id| is_at(*id)),
            GoalKind::Follow { .. } => met || !self.clear_within(shown, sight, shown.radius, is_at).is_empty(),
            _ => met,
        }
    }

    /// Targets that count, are within this many metres and clearly visible. Renders only if one is near enough.
    fn clear_within(
        &self,
        shown: &JudgeInput<'_>,
        sight: &mut JudgeCamera,
        within: f64,
        counts: impl Fn(ObjectId) -> bool,
    ) -> Vec<ObjectId> {
        let snapshot = shown.snapshot;
        let distance = |id: &ObjectId| shown.loaded.distance_to(*id, &snapshot.actors, snapshot.pose.position);
        let near = |id: &&ObjectId| counts(**id) && distance(id).is_some_and(|distance| distance <= within);
        let near: Vec<ObjectId> = self.targets.iter().filter(near).copied().collect();
        if near.is_empty() {
            return near;
        }
        let clear = sight.clearly(shown.loaded, snapshot, &near);
        near.into_iter().filter(|id| clear.contains(id)).collect()
    }

    fn reach(&mut self, shown: &JudgeInput<'_>, sight: &mut JudgeCamera, other: bool, up_share: f64) -> bool {
        let is_high = |id| {
            let least = bounds(shown, id).map_or(f64::MIN, |b| b.min.up + up_share * (b.max.up - b.min.up));
            up_share == 0.0 || shown.snapshot.pose.position.up >= least
        };
        let counts = |id| !(other && self.spent.contains(&id)) && is_high(id);
        let here = self.clear_within(shown, sight, shown.radius, counts);
        self.passed = here.iter().copied().collect();
        !here.is_empty()
    }

    fn through(&mut self, shown: &JudgeInput<'_>, count: Option<usize>, beyond: f64) -> bool {
        let to = shown.snapshot.pose.position;
        if let Some(from) = shown.before.map(|before| before.pose.position) {
            for &opening in &self.targets {
                if let Some(at) = crossing(shown.loaded, opening, from, to) {
                    self.passed.insert(opening);
                    self.crossed = Some((at, (vector(to) - vector(from)).normalize_or_zero()));
                }
            }
        }
        let wanted = count.unwrap_or(self.targets.len()).min(self.targets.len());
        let on = self.crossed.map_or(0.0, |(at, direction)| (vector(to) - at).dot(direction));
        !self.passed.is_empty() && self.passed.len() >= wanted && on >= beyond
    }

    fn around(&mut self, shown: &JudgeInput<'_>, angle: f64, within: f64) -> bool {
        let Some((id, distance)) = nearest(shown.loaded, &self.targets, shown.snapshot) else { return false };
        if let Some((bounds, before)) = bounds(shown, id).zip(shown.before)
            && distance <= within
        {
            let bearing = |at: EnuPosition| {
                let away = on_map(at) - on_map(centre(&bounds));
                libm::atan2(away.x, away.y)
            };
            self.turned[0] += wrap_angle(bearing(shown.snapshot.pose.position) - bearing(before.pose.position));
        }
        self.turned[0].abs() >= angle
    }

    fn over(&mut self, shown: &JudgeInput<'_>) -> bool {
        let at = shown.snapshot.pose.position;
        let objects = || self.targets.iter().filter_map(|id| shown.loaded.scene.object(*id));
        let above = objects().any(|object| {
            let top = shown.loaded.bounds(object, &shown.snapshot.actors).max.up;
            // A mast on its roof does not make the way over the roof a way past it.
            let highest_here = shown.loaded.collider.ground_below(EnuPosition { up: top + 0.1, ..at });
            let is_above = highest_here.is_some_and(|surface| surface.object == object.id && surface.up <= at.up);
            (at.up >= top || is_above) && inside(&shown.loaded.outline(object, &shown.snapshot.actors), at)
        });
        if above {
            self.entered.get_or_insert(at);
            return false;
        }
        let Some(entered) = self.entered.take() else { return false };
        // Across, not in and out over a corner: at least half of the shorter side.
        let lesser = objects().map(|object| {
            let Aabb { min, max } = shown.loaded.bounds(object, &shown.snapshot.actors);
            (max.east - min.east).min(max.north - min.north)
        });
        entered.horizontal_distance(at) >= 0.5 * lesser.fold(f64::MAX, f64::min)
    }

    fn behind(&self, shown: &JudgeInput<'_>, within: f64) -> bool {
        let Some((id, distance)) = nearest(shown.loaded, &self.targets, shown.snapshot) else { return false };
        let Some(bounds) = bounds(shown, id) else { return false };
        let middle = on_map(centre(&bounds));
        let away = (middle - on_map(shown.start.position)).normalize_or_zero();
        let beyond = on_map(shown.snapshot.pose.position) - middle;
        let half = DVec2::new(bounds.max.east - bounds.min.east, bounds.max.north - bounds.min.north) * 0.5;
        // Extent of the box from its centre along a direction.
        let reach = |direction: DVec2| half.dot(direction.abs());
        beyond.dot(away) >= reach(away) && beyond.perp_dot(away).abs() <= reach(away.perp()) && distance <= within
    }

    fn scan(&mut self, shown: &JudgeInput<'_>, angle: f64) -> bool {
        if let Some(before) = shown.before {
            let [now, least, most] = &mut self.turned;
            *now += wrap_angle(shown.snapshot.pose.attitude.heading - before.pose.attitude.heading);
            *least = least.min(*now);
            *most = most.max(*now);
        }
        self.turned[2] - self.turned[1] + shown.field >= angle
    }

    fn follow(&mut self, shown: &JudgeInput<'_>, sight: &mut JudgeCamera, within: f64, fraction: f64, window: f64) -> bool {
        let kept = !self.clear_within(shown, sight, within, |_| true).is_empty();
        self.kept.push_back((shown.at, kept));
        let gone = |at: Time| shown.at.since(at).as_secs_f64();
        // The oldest sample kept is the last one at least a window ago.
        while self.kept.get(1).is_some_and(|(at, _)| gone(*at) >= window) {
            self.kept.pop_front();
        }
        let whole = self.kept.front().is_some_and(|(at, _)| gone(*at) >= window);
        let near = self.kept.iter().filter(|(_, kept)| *kept).count();
        whole && near as f64 >= fraction * self.kept.len() as f64
    }
}

fn on_map(at: EnuPosition) -> DVec2 {
    DVec2::new(at.east, at.north)
}

fn bounds(shown: &JudgeInput<'_>, id: ObjectId) -> Option<Aabb> {
    let snapshot: &WorldSnapshot = shown.snapshot;
    shown.loaded.scene.object(id).map(|object| shown.loaded.bounds(object, &snapshot.actors))
}
