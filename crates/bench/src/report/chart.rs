//! Charts: success by method, by error level and latency, and completion times.

use maud::{Markup, html};
use spf_record::drawing::shortened;

use super::arm::{Arm, Sums};
use super::curve::{Curve, Levels};
use super::source::Source;
use super::svg::{Scale, colour, dashes, line, mark, n, text, through};
use crate::stats::Rate;
use crate::table::words;

const WIDTH: f64 = 720.0;
/// Space for names to the left of a chart with one row per arm.
const NAMES: f64 = 210.0;
/// Height of a row.
const ROW: f64 = 26.0;
/// Letters of a name that fit left of a chart.
const LETTERS: usize = 30;
/// Height of the area of a curve.
const HEIGHT: f64 = 240.0;
/// Space around a curve: left, right, above.
const AROUND: [f64; 3] = [52.0, 30.0, 14.0];
/// Distance of the marks of two methods at one level.
const BESIDE: f64 = 9.0;

fn svg(height: f64, label: &str, drawing: &Markup) -> Markup {
    html! {
        svg class="chart" viewBox=(format!("0 0 {WIDTH} {}", n(height))) role="img" aria-label=(label) { (drawing) }
    }
}

/// Success of every arm by both scorings.
pub(super) fn overview(source: &Source) -> Markup {
    let rows: Vec<(&Arm, Sums)> = source.arms.iter().map(|arm| (arm, Sums::of(source.of_arm(arm)))).collect();
    let scale = Scale { values: [0.0, 100.0], places: [NAMES, WIDTH - 30.0] };
    let bottom = 8.0 + ROW * rows.len() as f64;
    let drawing = html! {
        @for tick in scale.ticks(5.0) {
            (line("grid", [scale.at(tick), 4.0], [scale.at(tick), bottom]))
            (text("middle", [scale.at(tick), bottom + 16.0], &format!("{tick:.0} %")))
        }
        @for ((arm, sums), row) in rows.iter().zip(0_u32..) {
            @let y = 8.0 + ROW * (f64::from(row) + 0.5);
            (text("end", [NAMES - 12.0, y + 4.0], &shortened(&arm.name(), LETTERS)))
            (lying(scale, y - 4.5, arm, sums.strict, true, "strict"))
            (lying(scale, y + 5.5, arm, sums.paper, false, "paper"))
        }
    };
    svg(bottom + 24.0, "Success rate of each method with its confidence interval", &drawing)
}

fn lying(scale: Scale, y: f64, arm: &Arm, rate: Rate, filled: bool, what: &str) -> Markup {
    let Some(e) = rate.estimate() else { return html! {} };
    let x = |fraction: f64| scale.at(100.0 * fraction);
    html! {
        (line(&format!("whisker {}", colour(arm.colour)), [x(e.low), y], [x(e.high), y]))
        (mark(arm.colour, [x(e.value), y], 4.0, filled, &format!("{}, {what}: {}", arm.name(), words(rate))))
    }
}

/// The plot area of a curve: 0 to 100 % upwards, and its horizontal axis.
struct Area {
    x: Scale,
    y: Scale,
}

impl Area {
    fn new(values: [f64; 2]) -> Self {
        let [left, right, top] = AROUND;
        let y = Scale { values: [0.0, 100.0], places: [top + HEIGHT, top] };
        Self { x: Scale { values, places: [left, WIDTH - right] }, y }
    }

    fn bottom(&self) -> f64 {
        self.y.places[0]
    }

    fn frame(&self) -> Markup {
        let [left, right] = self.x.places;
        html! {
            @for tick in self.y.ticks(5.0) {
                (line("grid", [left, self.y.at(tick)], [right, self.y.at(tick)]))
                (text("end", [left - 7.0, self.y.at(tick) + 4.0], &format!("{tick:.0} %")))
            }
        }
    }

    fn curve(&self, curve: &Curve<'_>, aside: f64) -> Markup {
        let place = |x: f64, fraction: f64| [self.x.at(x) + aside, self.y.at(100.0 * fraction)];
        let class = colour(curve.arm.colour);
        let points = || curve.points.iter().filter_map(|point| Some((point, point.rate.estimate()?)));
        let joined = points().filter(|(point, _)| point.joined).map(|(point, e)| place(point.x, e.value));
        html! {
            path class=(format!("curve {class}")) d=(through(joined)) {}
            @for (point, e) in points() {
                (line(&format!("whisker {class}"), place(point.x, e.low), place(point.x, e.high)))
                (mark(curve.arm.colour, place(point.x, e.value), 4.5, true,
                    &format!("{} · {}: {}", curve.arm.method, point.vlm, words(point.rate))))
            }
        }
    }
}

/// Success over the oracle's levels of errors.
pub(super) fn levels(levels: &Levels<'_>) -> Markup {
    let count = levels.names.len() as f64;
    let area = Area::new([-0.5, count - 0.5]);
    let most = (110.0 / count).max(7.0) as usize;
    let middle = 0.5 * (levels.curves.len() as f64 - 1.0);
    let drawing = html! {
        (area.frame())
        @for (name, x) in levels.names.iter().zip(0_u32..) {
            (text("middle", [area.x.at(f64::from(x)), area.bottom() + 18.0], &shortened(name, most)))
        }
        @for (arm, rate) in &levels.blind {
            @if let Some(e) = rate.estimate() {
                @let y = area.y.at(100.0 * e.value);
                g { (line(&format!("level {}", colour(arm.colour)), [area.x.places[0], y], [area.x.places[1], y]))
                    title { (format!("{}: {}", arm.name(), words(*rate))) } }
            }
        }
        @for (curve, number) in levels.curves.iter().zip(0_u32..) {
            (area.curve(curve, BESIDE * (f64::from(number) - middle)))
        }
    };
    svg(area.bottom() + 28.0, "Success rate by oracle error level", &drawing)
}

/// Success rate by latency.
pub(super) fn latencies(curves: &[Curve<'_>]) -> Markup {
    let most = curves.iter().flat_map(|curve| &curve.points).map(|point| point.x).fold(0.0, f64::max);
    let area = Area::new([0.0, 1.05 * most]);
    let drawing = html! {
        (area.frame())
        @for tick in area.x.ticks(6.0) {
            (text("middle", [area.x.at(tick), area.bottom() + 18.0], &format!("{} s", n(tick))))
        }
        @for curve in curves { (area.curve(curve, 0.0)) }
    };
    svg(area.bottom() + 28.0, "Success rate by reply latency", &drawing)
}

/// Completion times of the successes, with quartiles.
pub(super) fn times(source: &Source) -> Markup {
    let rows: Vec<(&Arm, Sums)> = source.arms.iter().map(|arm| (arm, Sums::of(source.of_arm(arm)))).collect();
    let longest = rows.iter().flat_map(|(_, sums)| &sums.times).copied().fold(0.0, f64::max);
    let scale = Scale { values: [0.0, 1.02 * longest.max(1.0)], places: [NAMES, WIDTH - 30.0] };
    let bottom = 8.0 + ROW * rows.len() as f64;
    let drawing = html! {
        @for tick in scale.ticks(7.0) {
            (line("grid", [scale.at(tick), 4.0], [scale.at(tick), bottom]))
            (text("middle", [scale.at(tick), bottom + 16.0], &format!("{} s", n(tick))))
        }
        @for ((arm, sums), row) in rows.iter().zip(0_u32..) {
            @let y = 8.0 + ROW * (f64::from(row) + 0.5);
            (text("end", [NAMES - 12.0, y + 4.0], &shortened(&format!("{} ({})", arm.name(), sums.times.len()), LETTERS)))
            (strip(scale, y, arm, sums))
        }
    };
    svg(bottom + 24.0, "Completion times of successes", &drawing)
}

fn strip(scale: Scale, y: f64, arm: &Arm, sums: &Sums) -> Markup {
    let class = colour(arm.colour);
    html! {
        @if let Some([low, middle, high]) = sums.quartiles() {
            rect class=(format!("box {class}")) x=(n(scale.at(low))) y=(n(y - 7.0)) height="14"
                width=(n(scale.at(high) - scale.at(low))) {}
            @for seconds in &sums.times {
                circle class=(format!("dot {class}")) cx=(n(scale.at(*seconds))) cy=(n(y)) r="2.6" {}
            }
            g { (line(&format!("median {class}"), [scale.at(middle), y - 9.0], [scale.at(middle), y + 9.0]))
                title { (format!("{}: median {middle:.1} s", arm.name())) } }
        }
    }
}

/// Legend of colours, marks and dashes, for charts by method and maps by arm.
pub(super) fn legend(source: &Source, by_arm: bool) -> Markup {
    let mut shown: Vec<&Arm> = Vec::new();
    for arm in &source.arms {
        if by_arm || !shown.iter().any(|known| known.method == arm.method) {
            shown.push(arm);
        }
    }
    html! {
        p class="legend" {
            @for arm in shown {
                span {
                    svg viewBox="0 0 34 14" width="34" height="14" aria-hidden="true" {
                        @if by_arm {
                            (line(&format!("way {} {}", colour(arm.colour), dashes(arm.dash)), [1.0, 7.0], [33.0, 7.0]))
                        }
                        (mark(arm.colour, [17.0, 7.0], 4.0, true, ""))
                    }
                    (if by_arm { arm.name() } else { arm.method.clone() })
                }
            }
        }
    }
}
