//! Curves of success by the oracle's error level and by latency. Only measured values become points.

use super::arm::{Arm, Sums};
use super::source::Source;
use crate::stats::Rate;

/// Built-in error levels in order; other error files differ in how they read depth and are listed beside them.
pub(super) const LEVELS: [&str; 3] = ["perfect", "default", "poor"];
/// Median latencies closer than this are equal, seconds: random samples differ as much.
const APART_S: f64 = 0.3;

/// A method's points.
pub(super) struct Curve<'a> {
    /// The first arm of the method: its name and colour.
    pub(super) arm: &'a Arm,
    pub(super) points: Vec<Point>,
}

/// One arm of a curve.
pub(super) struct Point {
    /// Position on the axis: the level's index, or seconds.
    pub(super) x: f64,
    pub(super) vlm: String,
    pub(super) rate: Rate,
    /// Whether it is connected by a line.
    pub(super) joined: bool,
}

/// Success over levels.
pub(super) struct Levels<'a> {
    /// Names along the axis.
    pub(super) names: Vec<String>,
    pub(super) curves: Vec<Curve<'a>>,
    /// The rate of the blind control, which has no level.
    pub(super) blind: Vec<(&'a Arm, Rate)>,
}

/// Success by error level; `None` with fewer than two levels.
pub(super) fn levels(source: &Source) -> Option<Levels<'_>> {
    let found = |level: &str| source.arms.iter().any(|arm| arm.level() == Some(level));
    let mut names: Vec<String> = LEVELS.into_iter().filter(|level| found(level)).map(str::to_owned).collect();
    for level in source.arms.iter().filter_map(Arm::level) {
        if !names.iter().any(|name| name == level) {
            names.push(level.to_owned());
        }
    }
    if names.len() < 2 {
        return None;
    }
    let point = |arm: &Arm| {
        let x = names.iter().position(|name| Some(name.as_str()) == arm.level())?;
        let rate = Sums::of(source.of_arm(arm)).strict;
        Some(Point { x: x as f64, vlm: arm.vlm.clone(), rate, joined: LEVELS.contains(&arm.level()?) })
    };
    let curves = curves(source, &point);
    let blind = source.arms.iter().filter(|arm| arm.is_blind());
    let blind = blind.map(|arm| (arm, Sums::of(source.of_arm(arm)).strict)).collect();
    Some(Levels { curves, blind, names })
}

/// Success by latency, for methods flown with several latencies; `None` if there is none.
pub(super) fn latencies(source: &Source) -> Option<Vec<Curve<'_>>> {
    let point = |arm: &Arm| {
        let sums = Sums::of(source.of_arm(arm));
        Some(Point { x: sums.latency_s?, vlm: arm.vlm.clone(), rate: sums.strict, joined: true })
    };
    let mut curves = curves(source, &point);
    curves.retain(|curve| {
        let (first, last) = (curve.points.first(), curve.points.last());
        first.zip(last).is_some_and(|(first, last)| last.x - first.x >= APART_S)
    });
    (!curves.is_empty()).then_some(curves)
}

/// Points by method, from left to right.
fn curves<'a>(source: &'a Source, point: &dyn Fn(&Arm) -> Option<Point>) -> Vec<Curve<'a>> {
    let mut curves: Vec<Curve<'a>> = Vec::new();
    for arm in source.arms.iter().filter(|arm| !arm.is_blind()) {
        let Some(point) = point(arm) else { continue };
        match curves.iter_mut().find(|curve| curve.arm.method == arm.method) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { arm, points: vec![point] }),
        }
    }
    curves.iter_mut().for_each(|curve| curve.points.sort_by(|a, b| a.x.total_cmp(&b.x)));
    curves
}
