//! Plot of height over time.

use spf_core::geometry::EnuPosition;
use spf_core::time::Time;

use super::map::decision_signs;
use super::svg::Svg;
use super::{TrajectoryInput, colours, figure, round_step};

/// Draws the plot into `[left, top, width, height]`; draws nothing without a path.
pub(super) fn draw(svg: &mut Svg, input: &TrajectoryInput, [left, top, width, height]: [f64; 4]) {
    let points = || input.path.iter().chain(&input.known_path);
    if points().next().is_none() {
        return;
    }
    let last = points().map(|(time, _)| time.as_secs_f64()).fold(0.0, f64::max).max(1.0);
    let lowest = points().map(|(_, at)| at.up).fold(0.0, f64::min);
    let highest = points().map(|(_, at)| at.up).fold(lowest + 1.0, f64::max);
    let step = round_step(highest - lowest, 5.0);
    let (lowest, highest) = ((lowest / step).floor() * step, (highest / step).ceil() * step);
    let place = |seconds: f64, up: f64| [left + width * seconds / last, top + height * (highest - up) / (highest - lowest)];

    let faint = format!("font-size=\"12\" fill=\"{}\"", colours::FAINT);
    let mut line = lowest;
    while line <= highest + step / 2.0 {
        let [x, y] = place(0.0, line);
        svg.line([x, y], [left + width, y], colours::GRID, 1.0, "");
        svg.text(x - 8.0, y + 4.0, "end", &faint, &figure(line, step));
        line += step;
    }
    let step = round_step(last, 10.0);
    let mut seconds = 0.0;
    while seconds <= last + 1e-9 {
        let [x, _] = place(seconds, lowest);
        svg.line([x, top], [x, top + height], colours::GRID, 1.0, "");
        svg.text(x, top + height + 18.0, "middle", &faint, &figure(seconds, step));
        seconds += step;
    }
    svg.text(left + width, top + height + 38.0, "end", &faint, "flight time, s");
    svg.text(left - 34.0, top - 12.0, "start", &faint, "height, m");

    let curve = |path: &[(Time, EnuPosition)]| -> Vec<[f64; 2]> {
        path.iter().map(|(time, at)| place(time.as_secs_f64(), at.up)).collect()
    };
    if !input.known_path.is_empty() {
        let style = format!("stroke=\"{}\" stroke-width=\"1.5\" stroke-dasharray=\"5 3\"", colours::KNOWN);
        svg.polyline(&curve(&input.known_path), &style);
    }
    let style = format!("stroke=\"{}\" stroke-width=\"2.5\" stroke-linejoin=\"round\"", colours::PATH);
    svg.polyline(&curve(&input.path), &style);
    // On the curve: a decision's own position is that of its frame, which is older.
    let path = if input.path.is_empty() { &input.known_path } else { &input.path };
    decision_signs(svg, input, |decision| {
        let later = path.partition_point(|(time, _)| *time < decision.time).min(path.len() - 1);
        place(decision.time.as_secs_f64().min(last), path[later].1.up)
    });
}
