//! The trajectory image of a flight, `trajectory.svg`: a map over the scene's outlines, and a plot of height over time.

mod height;
mod map;
mod svg;

use spf_core::geometry::EnuPosition;
use spf_core::time::Time;

use crate::drawing::shortened;
use svg::Svg;

/// Outline of an object seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Name, shown where there is room, and as a tooltip.
    pub name: String,
    /// Fill colour: red, green, blue.
    pub colour: [u8; 3],
    /// Rings of points, metres east and north.
    pub polygons: Vec<Vec<[f64; 2]>>,
}

/// A decision on the map and in the height plot; numbered from 1 in the order given.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionMark {
    /// Time of the decision.
    pub time: Time,
    /// Position of the craft.
    pub position: EnuPosition,
    /// Its waypoint, if any.
    pub waypoint: Option<EnuPosition>,
    /// Tooltip text.
    pub label: String,
}

/// A place that the operator has marked to keep away from, seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedPlace {
    /// Its number, as it was shown to the operator.
    pub number: u32,
    /// The ends of the wall that it is.
    pub ends: [EnuPosition; 2],
    /// Tooltip text, such as when it was in force.
    pub label: String,
}

/// The contents of the trajectory image. Points with non-finite coordinates are omitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrajectoryInput {
    /// Title, such as the instruction.
    pub title: String,
    /// Line below the title, such as outcome, time and distance.
    pub outcome: String,
    /// The scene, lowest objects first.
    pub outlines: Vec<Outline>,
    /// Path of the craft, in order of time: the true path if available, else the estimated one.
    pub path: Vec<(Time, EnuPosition)>,
    /// The estimated path, if different; drawn dashed.
    pub known_path: Vec<(Time, EnuPosition)>,
    /// The decisions.
    pub decisions: Vec<DecisionMark>,
    /// Position of the instruction's target, if ground truth is available.
    pub target: Option<EnuPosition>,
    /// Places that were marked to keep away from.
    pub marked: Vec<MarkedPlace>,
}

/// Width of the image, in its own units (pixels at normal size).
const WIDTH: f64 = 1000.0;
/// Margin left, right and below the plots.
const MARGIN: f64 = 46.0;
/// Height of the height plot.
const HEIGHT_PLOT: f64 = 170.0;

/// Colours, distinguishable with red-green colour blindness.
mod colours {
    pub(super) const PATH: &str = "#0b62d6";
    pub(super) const KNOWN: &str = "#6d7f99";
    pub(super) const DECISION: &str = "#1b2a41";
    pub(super) const WAYPOINT: &str = "#d81b60";
    pub(super) const TARGET: &str = "#f59e0b";
    pub(super) const MARKED: &str = "#b3261e";
    pub(super) const START: &str = "#0f9d6b";
    pub(super) const TEXT: &str = "#1b2430";
    pub(super) const FAINT: &str = "#6b7684";
    pub(super) const GRID: &str = "#dfe4ea";
}

/// Renders the image. Equal inputs give equal bytes.
#[must_use]
pub fn trajectory_svg(input: &TrajectoryInput) -> String {
    let input = finite(input);
    let view = map::Extent::fitting(&input, MARGIN, 92.0, WIDTH - 2.0 * MARGIN);
    let legend_top = view.bottom() + 26.0;
    let height_top = legend_top + 40.0;
    let mut svg = Svg::new(WIDTH, height_top + HEIGHT_PLOT + 52.0);
    svg.text(
        MARGIN,
        40.0,
        "start",
        &format!("font-size=\"22\" font-weight=\"600\" fill=\"{}\"", colours::TEXT),
        &shortened(&input.title, 76),
    );
    svg.text(MARGIN, 68.0, "start", &format!("font-size=\"15\" fill=\"{}\"", colours::FAINT), &shortened(&input.outcome, 118));
    map::draw(&mut svg, &input, &view);
    legend(&mut svg, &input, legend_top);
    height::draw(&mut svg, &input, [MARGIN, height_top, WIDTH - 2.0 * MARGIN, HEIGHT_PLOT]);
    svg.finish()
}

/// The input without points that cannot be plotted.
fn finite(input: &TrajectoryInput) -> TrajectoryInput {
    // 100 km exceeds any flight, and keeps all numbers in the image short.
    let placed = |at: &EnuPosition| [at.east, at.north, at.up].iter().all(|metres| metres.abs() < 1e5);
    let mut input = input.clone();
    input.path.retain(|(_, at)| placed(at));
    input.known_path.retain(|(_, at)| placed(at));
    for decision in &mut input.decisions {
        if !placed(&decision.position) {
            // Kept for its number, but not plotted.
            decision.position = EnuPosition { east: f64::NAN, north: f64::NAN, up: f64::NAN };
            decision.waypoint = None;
        }
        decision.waypoint = decision.waypoint.filter(placed);
    }
    input.target = input.target.filter(placed);
    input.marked.retain(|place| place.ends.iter().all(placed));
    for outline in &mut input.outlines {
        for polygon in &mut outline.polygons {
            polygon.retain(|point| point.iter().all(|metres| metres.abs() < 1e5));
        }
    }
    input
}

/// One row that explains the symbols used.
fn legend(svg: &mut Svg, input: &TrajectoryInput, y: f64) {
    let mut x = MARGIN;
    let mut entry = |svg: &mut Svg, name: &str, sign: &dyn Fn(&mut Svg, f64)| {
        sign(svg, x + 11.0);
        svg.text(x + 28.0, y + 4.5, "start", &format!("font-size=\"13\" fill=\"{}\"", colours::TEXT), name);
        x += 28.0 + name.chars().count() as f64 * 7.4 + 22.0;
    };
    if !input.path.is_empty() {
        entry(svg, "start", &|svg, x| map::start_sign(svg, x, y));
        entry(svg, "end", &|svg, x| map::end_sign(svg, x, y));
        entry(svg, "flown", &|svg, x| svg.line([x - 11.0, y], [x + 11.0, y], colours::PATH, 3.0, ""));
    }
    if !input.known_path.is_empty() {
        entry(svg, "estimated position", &|svg, x| {
            svg.line([x - 11.0, y], [x + 11.0, y], colours::KNOWN, 1.8, "stroke-dasharray=\"5 3\"");
        });
    }
    if !input.decisions.is_empty() {
        entry(svg, "decision", &|svg, x| map::decision_sign(svg, x, y, 1, ""));
    }
    if input.decisions.iter().any(|decision| decision.waypoint.is_some()) {
        entry(svg, "commanded waypoint", &|svg, x| map::waypoint_sign(svg, x, y));
    }
    if input.target.is_some() {
        entry(svg, "target's nearest surface", &|svg, x| map::target_sign(svg, x, y));
    }
    if !input.marked.is_empty() {
        entry(svg, "keep away", &|svg, x| map::marked_sign(svg, [x - 11.0, y], [x + 11.0, y], ""));
    }
}

/// A round step (1, 2 or 5 times a power of ten) that divides `extent` into at most `most` parts.
fn round_step(extent: f64, most: f64) -> f64 {
    let mut step = 1e-3;
    for factor in [2.0, 2.5, 2.0].into_iter().cycle().take(36) {
        if extent / step <= most {
            break;
        }
        step *= factor;
    }
    step
}

/// Formats a length or time with as many decimals as the step needs.
fn figure(value: f64, step: f64) -> String {
    if step < 0.1 {
        format!("{value:.2}")
    } else if step < 1.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.0}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        for (extent, most, expected) in
            [(10.0, 5.0, 2.0), (99.0, 5.0, 20.0), (100.0, 4.0, 50.0), (0.9, 5.0, 0.2), (0.0, 5.0, 0.001)]
        {
            let step = round_step(extent, most);
            assert!((step - expected).abs() < expected * 1e-9, "{extent} {most}: {step}");
        }
    }
}
