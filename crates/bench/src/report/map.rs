//! Maps of flown paths: one per sampled start, with all methods, over the ground plan.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::ground::Ground;
use super::source::Source;
use super::svg::{Scale, colour, dashes, mark, n, simplified, through};
use crate::trial::{FlownPath, Record};

/// Size of a map.
const WIDTH: f64 = 320.0;
const HEIGHT: f64 = 240.0;
/// Minimum extent of the world shown, metres.
const LEAST_M: f64 = 8.0;
/// Tolerance for simplifying paths, map units.
const OFF: f64 = 0.4;
/// Lengths of the scale bar, metres.
const BARS: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0];

/// Task, seed and scene of a sampled start.
type Key<'a> = (&'a str, &'a str, &'a str);

/// All trials of one task from one start in one scene.
pub(super) struct TrialMap {
    pub(super) task: String,
    pub(super) seed: String,
    pub(super) scene: String,
    /// Indices of its rows in the report.
    pub(super) rows: Vec<usize>,
    start: [f64; 2],
    targets: Vec<String>,
    view: Extent,
    ground: Option<Ground>,
}

/// The part of the world that a map shows.
#[derive(Clone, Copy, Debug)]
struct Extent {
    east: Scale,
    north: Scale,
    /// Map units per metre.
    scale: f64,
}

impl Extent {
    /// A view that contains the given positions, with a margin.
    fn of(places: impl Iterator<Item = [f64; 2]> + Clone) -> Self {
        let range = |axis: usize| {
            let values = places.clone().map(|place| place[axis]);
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            if low <= high { (0.5 * (low + high), high - low) } else { (0.0, 0.0) }
        };
        let ((east, wide), (north, high)) = (range(0), range(1));
        let scale = (WIDTH / (1.25 * wide).max(LEAST_M)).min(HEIGHT / (1.25 * high).max(LEAST_M));
        let (half_wide, half_high) = (0.5 * WIDTH / scale, 0.5 * HEIGHT / scale);
        Self {
            east: Scale { values: [east - half_wide, east + half_wide], places: [0.0, WIDTH] },
            north: Scale { values: [north - half_high, north + half_high], places: [HEIGHT, 0.0] },
            scale,
        }
    }

    fn at(&self, [east, north]: [f64; 2]) -> [f64; 2] {
        [self.east.at(east), self.north.at(north)]
    }

    /// Polygons as one path; those outside or smaller than a dot are omitted.
    fn outlines(&self, polygons: &[Vec<[f64; 2]>]) -> String {
        let shown = polygons.iter().filter_map(|polygon| {
            let places: Vec<[f64; 2]> = polygon.iter().map(|corner| self.at(*corner)).collect();
            let range = |axis: usize| {
                let values = places.iter().map(|place| place[axis]);
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
            };
            let ((left, right), (top, bottom)) = (range(0), range(1));
            let within = right > 0.0 && left < WIDTH && bottom > 0.0 && top < HEIGHT;
            (within && (right - left).max(bottom - top) >= 0.6).then(|| format!("{}Z", through(places.into_iter())))
        });
        shown.collect()
    }

    /// A scale bar with a round length, at most a third of the width.
    fn bar(&self) -> Markup {
        let metres = BARS.into_iter().rev().find(|metres| metres * self.scale <= WIDTH / 3.0).unwrap_or(BARS[0]);
        let [left, bottom] = [8.0, HEIGHT - 8.0];
        html! {
            path class="bar" d=(format!("M{left} {}V{bottom}H{}V{}", bottom - 4.0, n(left + metres * self.scale), bottom - 4.0)) {}
            text x=(n(left + 3.0)) y=(n(bottom - 6.0)) { (format!("{metres} m")) }
        }
    }
}

impl TrialMap {
    /// The sampled starts with a known path, by task and seed in order of appearance.
    pub(super) fn all(source: &Source) -> Vec<Self> {
        let mut groups: Vec<(Key<'_>, Vec<usize>)> = Vec::new();
        let mut places: BTreeMap<Key<'_>, usize> = BTreeMap::new();
        for (row, record) in source.records.iter().enumerate() {
            if path(source, record).is_none() {
                continue;
            }
            let key = (record.task.as_str(), seed(record), record.scene_id.as_str());
            let place = *places.entry(key).or_insert_with(|| {
                groups.push((key, Vec::new()));
                groups.len() - 1
            });
            groups[place].1.push(row);
        }
        groups.into_iter().map(|(key, rows)| Self::new(source, key, rows)).collect()
    }

    fn new(source: &Source, (task, seed, scene): Key<'_>, rows: Vec<usize>) -> Self {
        let records = rows.iter().filter_map(|row| source.records.get(*row));
        let paths: Vec<&FlownPath> = records.clone().filter_map(|record| path(source, record)).collect();
        let mut targets: Vec<String> = paths.iter().flat_map(|path| path.targets.iter().flatten().cloned()).collect();
        targets.sort();
        targets.dedup();
        let start = records.clone().map(|record| record.start_pose.position).next().unwrap_or_default();
        let ground = Ground::load(scene, &targets);
        let marks = ground.iter().flat_map(|ground| ground.marks.iter().map(|(at, _)| *at));
        let flown = paths.iter().flat_map(|path| path.places.iter().map(|place| [place[0], place[1]]));
        // With many possible targets, those far from every path should not make the map small.
        let flown_view = Extent::of(flown.clone().chain([[start.east, start.north]]));
        let near = marks.filter(|at| targets.len() < 4 || is_near(&flown_view, *at));
        let view = Extent::of(flown.chain(near).chain([[start.east, start.north]]));
        let (task, seed, scene) = (task.to_owned(), seed.to_owned(), scene.to_owned());
        Self { task, seed, scene, rows, start: [start.east, start.north], targets, view, ground }
    }

    /// Whether the scene could be loaded.
    pub(super) fn has_ground(&self) -> bool {
        self.ground.is_some()
    }

    /// Keys of the task's targets.
    pub(super) fn targets(&self) -> &[String] {
        &self.targets
    }

    /// The plan with an id, once for all maps of the start.
    pub(super) fn plan(&self, id: &str) -> Markup {
        let ground = self.ground.clone().unwrap_or_default();
        html! {
            g id=(id) {
                path class="solid" d=(self.view.outlines(&ground.solid)) {}
                path class="goal" d=(self.view.outlines(&ground.targets)) {}
                @for (at, key) in &ground.marks {
                    @let [x, y] = self.view.at(*at);
                    @if (0.0..=WIDTH).contains(&x) && (0.0..=HEIGHT).contains(&y) {
                        circle class="goal-mark" cx=(n(x)) cy=(n(y)) r="6" { title { (key) } }
                    }
                }
                (self.view.bar())
            }
        }
    }

    /// A map of the paths of some of its rows, over the plan with that id.
    pub(super) fn map(&self, source: &Source, rows: &[usize], plan: &str) -> Markup {
        let [x, y] = self.view.at(self.start);
        let records = rows.iter().filter_map(|row| source.records.get(*row));
        let label = format!("Top-down trajectories in {} with seed {}", self.task, self.seed);
        html! {
            svg class="map" viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label=(label) {
                use href=(format!("#{plan}")) {}
                @for record in records { (self.curve(source, record)) }
                path class="start" d=(format!("M{0} {2}L{1} {3}M{1} {2}L{0} {3}", n(x - 4.0), n(x + 4.0), n(y - 4.0), n(y + 4.0))) {}
            }
        }
    }

    fn curve(&self, source: &Source, record: &Record) -> Markup {
        let (Some(arm), Some(flown_path)) = (source.arms.iter().find(|arm| arm.flew(record)), path(source, record)) else {
            return html! {};
        };
        let places: Vec<[f64; 2]> = flown_path.places.iter().map(|place| self.view.at([place[0], place[1]])).collect();
        let end = places.last().copied();
        let class = format!("way {} {}", colour(arm.colour), dashes(arm.dash));
        let done = record.scores.strict;
        html! {
            path class=(class) d=(through(simplified(&places, OFF).into_iter())) {}
            @if let Some(end) = end {
                (mark(arm.colour, end, 3.4, done, &format!("{}: {}", arm.name(), if done { "success" } else { "failure" })))
            }
        }
    }
}

/// The path of a row, if it is known and not empty.
pub(super) fn path<'a>(source: &'a Source, record: &Record) -> Option<&'a FlownPath> {
    source.paths.get(&record.run_id).filter(|path| !path.places.is_empty())
}

/// The seed of a row, from its name.
pub(super) fn seed(record: &Record) -> &str {
    record.run_id.rsplit('/').next().unwrap_or_default()
}

fn is_near(view: &Extent, at: [f64; 2]) -> bool {
    let [x, y] = view.at(at);
    (-WIDTH..=2.0 * WIDTH).contains(&x) && (-HEIGHT..=2.0 * HEIGHT).contains(&y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_holds_its_places_and_keeps_angles() {
        let places = [[0.0, 0.0], [100.0, 20.0]];
        let view = Extent::of(places.into_iter());
        assert!(places.iter().all(|at| {
            let [x, y] = view.at(*at);
            (0.0..=WIDTH).contains(&x) && (0.0..=HEIGHT).contains(&y)
        }));
        // North is up, with equal scales in both directions.
        let [[x, y], [right, up]] = [view.at([0.0, 0.0]), view.at([1.0, 1.0])];
        assert!((right - x - (y - up)).abs() < 1e-9 && right > x);
        // Something is shown even with no place, or only one.
        assert!(Extent::of(std::iter::empty()).scale.is_finite() && Extent::of([[5.0, 5.0]].into_iter()).scale > 0.0);
    }
}
