//! Common parts of the charts: scales, marks, axes. Colours and line styles are in the page's style sheet, so that
//! charts follow its light or dark theme.

use maud::{Markup, html};
use spf_record::drawing::thinned;

/// Number of mark shapes, which distinguish methods in addition to colour.
const SHAPES: usize = 6;
/// Number of colours in the style sheet.
const COLOURS: usize = 8;

/// Maps values to chart coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) values: [f64; 2],
    pub(super) places: [f64; 2],
}

impl Scale {
    pub(super) fn at(self, value: f64) -> f64 {
        let [low, high] = self.values;
        let fraction = if high > low { (value - low) / (high - low) } else { 0.5 };
        self.places[0] + fraction * (self.places[1] - self.places[0])
    }

    /// About `count` round values along it.
    pub(super) fn ticks(self, count: f64) -> Vec<f64> {
        let [low, high] = self.values;
        let rough = (high - low) / count;
        if !(rough > 0.0 && rough.is_finite()) {
            return vec![low];
        }
        let power = libm::pow(10.0, libm::floor(libm::log10(rough)));
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|by| by * power).find(|step| *step >= rough * 0.999).unwrap_or(power);
        let first = libm::ceil(low / step - 1e-9);
        (0..64).map(|i| (first + f64::from(i)) * step).take_while(|tick| *tick <= high + 1e-9 * step).collect()
    }
}

/// Formats a coordinate with one decimal, without trailing zeros or a negative zero.
pub(super) fn n(value: f64) -> String {
    let tenths = (10.0 * value).round() / 10.0 + 0.0;
    if tenths == 0.0 { "0".to_owned() } else { tenths.to_string() }
}

/// CSS class of a method's colour.
pub(super) fn colour(method: usize) -> String {
    format!("c{}", method % COLOURS)
}

/// CSS class of a VLM's dash pattern.
pub(super) fn dashes(vlm: usize) -> String {
    format!("d{}", vlm % 4)
}

/// A mark at a position, filled or outlined.
pub(super) fn mark(method: usize, [x, y]: [f64; 2], size: f64, filled: bool, title: &str) -> Markup {
    let class = format!("{} {}", colour(method), if filled { "mark" } else { "mark hollow" });
    let corner = |dx: f64, dy: f64| format!("{} {}", n(x + dx * size), n(y + dy * size));
    let path =
        |corners: &[(f64, f64)]| format!("M{}Z", corners.iter().map(|(dx, dy)| corner(*dx, *dy)).collect::<Vec<_>>().join("L"));
    let shape = match method % SHAPES {
        0 => None,
        1 => Some(path(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)])),
        2 => Some(path(&[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)])),
        3 => Some(path(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)])),
        4 => Some(path(&[(0.0, 1.2), (1.1, -0.8), (-1.1, -0.8)])),
        _ => Some(path(&[(-0.5, -1.2), (0.5, -1.2), (0.5, 1.2), (-0.5, 1.2)])),
    };
    html! {
        @match shape {
            None => circle class=(class) cx=(n(x)) cy=(n(y)) r=(n(size)) { title { (title) } },
            Some(d) => path class=(class) d=(d) { title { (title) } },
        }
    }
}

/// A straight line of a class.
pub(super) fn line(class: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> Markup {
    html! { line class=(class) x1=(n(x1)) y1=(n(y1)) x2=(n(x2)) y2=(n(y2)) {} }
}

/// A text; `anchor` is `start`, `middle` or `end`.
pub(super) fn text(anchor: &str, [x, y]: [f64; 2], words: &str) -> Markup {
    html! { text text-anchor=(anchor) x=(n(x)) y=(n(y)) { (words) } }
}

/// A path through points, [thinned].
pub(super) fn through(places: impl Iterator<Item = [f64; 2]>) -> String {
    let corners: Vec<String> = thinned(places).iter().map(|[x, y]| format!("{} {}", n(*x), n(*y))).collect();
    if corners.is_empty() { String::new() } else { format!("M{}", corners.join("L")) }
}

/// Simplifies a path with tolerance `off` (Douglas and Peucker 1973).
pub(super) fn simplified(places: &[[f64; 2]], off: f64) -> Vec<[f64; 2]> {
    let mut stays = vec![false; places.len()];
    let mut spans = Vec::new();
    if let Some(last) = places.len().checked_sub(1) {
        (stays[0], stays[last]) = (true, true);
        spans.push((0, last));
    }
    while let Some((from, to)) = spans.pop() {
        let farthest = (from + 1..to).map(|i| (i, distance(places[i], places[from], places[to])));
        let Some((i, far)) = farthest.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if far > off {
            stays[i] = true;
            spans.extend([(from, i), (i, to)]);
        }
    }
    places.iter().zip(stays).filter_map(|(place, stays)| stays.then_some(*place)).collect()
}

/// Distance of a point from a line segment.
fn distance([x, y]: [f64; 2], [ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let square = dx * dx + dy * dy;
    let fraction = if square > 0.0 { (((x - ax) * dx + (y - ay) * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
    libm::hypot(x - ax - fraction * dx, y - ay - fraction * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        let scale = |values| Scale { values, places: [0.0, 100.0] };
        assert_eq!(scale([0.0, 100.0]).ticks(5.0), [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        assert_eq!(scale([0.0, 7.3]).ticks(4.0), [0.0, 2.0, 4.0, 6.0]);
        assert_eq!(scale([3.0, 3.0]).ticks(4.0), [3.0]);
        assert_eq!((scale([0.0, 4.0]).at(1.0), scale([2.0, 2.0]).at(2.0)), (25.0, 50.0));
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([n(1.0), n(-0.04), n(12.345), n(-7.25)], ["1", "0", "12.3", "-7.3"]);
        assert_eq!(through([[0.0, 0.0], [0.1, 0.1], [3.0, 1.0], [3.2, 1.0]].into_iter()), "M0 0L3 1L3.2 1");
        assert_eq!(through(std::iter::empty()), "");
        let bent = [[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [2.1, 1.0], [2.0, 2.0], [2.0, 2.0]];
        assert_eq!(simplified(&bent, 0.3), [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]);
        assert_eq!(simplified(&bent[..1], 0.3).len(), 1);
    }
}
