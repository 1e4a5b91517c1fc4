//! The map: outlines, path, decisions, waypoints, scale bar, north arrow.

use spf_core::geometry::EnuPosition;

use super::svg::{Svg, escaped};
use super::{DecisionMark, Outline, TrajectoryInput, colours, figure, round_step};

/// Half the height of the largest symbol, that of the target, in image units.
const SIGN: f64 = 11.0;
/// Distance between two numbers that can be read, image units.
const APART: f64 = 13.0;

/// Transforms metres to image coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    /// Image units per metre.
    scale: f64,
    /// World coordinates of the centre.
    east: f64,
    north: f64,
}

impl Extent {
    /// A view of width `width` that shows path, decisions, waypoints and target with a margin, at least 12 m wide; the
    /// whole scene if there is nothing else.
    pub(super) fn fitting(input: &TrajectoryInput, left: f64, top: f64, width: f64) -> Self {
        let flown = input.path.iter().chain(&input.known_path).map(|(_, at)| *at);
        let marked = input.marked.iter().flat_map(|place| place.ends);
        let decided = input.decisions.iter().filter_map(|decision| decision.waypoint).chain(input.target).chain(marked);
        let mut points: Vec<[f64; 2]> = flown.chain(decided).map(|at| [at.east, at.north]).collect();
        if points.is_empty() {
            points = input.outlines.iter().flat_map(|outline| outline.polygons.iter().flatten().copied()).collect();
        }
        let range = |axis: usize| {
            let values = || points.iter().map(|point| point[axis]);
            let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            if low <= high { (low, high) } else { (0.0, 0.0) }
        };
        let ((west, east), (south, north)) = (range(0), range(1));
        let (wide, high) = ((east - west).max(12.0) * 1.3, (north - south).max(12.0) * 1.3);
        // The aspect ratio is limited; longer extents get empty margins.
        let height = width * (high / wide).clamp(0.5, 0.95);
        Self {
            left,
            top,
            width,
            height,
            scale: (width / wide).min(height / high),
            east: f64::midpoint(west, east),
            north: f64::midpoint(south, north),
        }
    }

    /// Lower edge in the image.
    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    fn place(&self, [east, north]: [f64; 2]) -> [f64; 2] {
        [
            self.left + self.width / 2.0 + (east - self.east) * self.scale,
            self.top + self.height / 2.0 - (north - self.north) * self.scale,
        ]
    }

    fn position(&self, at: EnuPosition) -> [f64; 2] {
        self.place([at.east, at.north])
    }

    fn shows(&self, [low_x, low_y]: [f64; 2], [high_x, high_y]: [f64; 2]) -> bool {
        high_x > self.left && low_x < self.left + self.width && high_y > self.top && low_y < self.bottom()
    }
}

/// Draws the map.
pub(super) fn draw(svg: &mut Svg, input: &TrajectoryInput, view: &Extent) {
    let Extent { left, top, width, height, .. } = *view;
    let area = format!("x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" rx=\"6\"");
    svg.raw(&format!("<clipPath id=\"map\"><rect {area}/></clipPath>\n<rect {area} fill=\"#f4f6f3\"/>\n"));
    svg.open("g", "clip-path=\"url(#map)\"");
    for outline in &input.outlines {
        draw_outline(svg, outline, view);
    }
    let ends = [input.path.first(), input.path.last()].into_iter().flatten().map(|(_, at)| *at);
    let signs: Vec<_> = ends.chain(input.target).map(|at| view.position(at)).collect();
    for outline in &input.outlines {
        draw_name(svg, outline, view, &signs);
    }
    for decision in &input.decisions {
        if let Some(waypoint) = decision.waypoint {
            let (from, to) = (view.position(decision.position), view.position(waypoint));
            svg.line(from, to, colours::WAYPOINT, 1.1, "stroke-dasharray=\"4 3\" opacity=\"0.75\"");
            waypoint_sign(svg, to[0], to[1]);
        }
    }
    if let Some(target) = input.target {
        let [x, y] = view.position(target);
        target_sign(svg, x, y);
    }
    for place in &input.marked {
        let [from, to] = place.ends.map(|end| view.position(end));
        marked_sign(svg, from, to, &place.label);
        let halo = "paint-order=\"stroke\" stroke=\"#ffffff\" stroke-width=\"3\"";
        let style = format!("font-size=\"12\" font-weight=\"600\" fill=\"{}\" {halo}", colours::MARKED);
        let middle = [f64::midpoint(from[0], to[0]), f64::midpoint(from[1], to[1])];
        svg.text(middle[0] + 6.0, middle[1] - 6.0, "start", &style, &place.number.to_string());
    }
    let known: Vec<_> = input.known_path.iter().map(|(_, at)| view.position(*at)).collect();
    if !known.is_empty() {
        let style = format!("stroke=\"{}\" stroke-width=\"1.8\" stroke-dasharray=\"5 3\"", colours::KNOWN);
        svg.polyline(&known, &style);
    }
    let path: Vec<_> = input.path.iter().map(|(_, at)| view.position(*at)).collect();
    for (colour, wide) in [("#ffffff", 6.0), (colours::PATH, 3.0)] {
        let round = "stroke-linejoin=\"round\" stroke-linecap=\"round\"";
        svg.polyline(&path, &format!("stroke=\"{colour}\" stroke-width=\"{wide}\" {round}"));
    }
    decision_signs(svg, input, |decision| view.position(decision.position));
    // On top, so that they can be seen where decisions crowd.
    if let (Some(first), Some(last)) = (path.first(), path.last()) {
        start_sign(svg, first[0], first[1]);
        end_sign(svg, last[0], last[1]);
    }
    svg.close();
    svg.raw(&format!("<rect {area} fill=\"none\" stroke=\"#b9c2cc\"/>\n"));
    draw_scale(svg, view);
    draw_north(svg, view.left + view.width - 26.0, view.top + 34.0);
}

fn draw_outline(svg: &mut Svg, outline: &Outline, view: &Extent) {
    let [red, green, blue] = outline.colour;
    let mut shape = String::new();
    for polygon in outline.polygons.iter().filter(|polygon| polygon.len() >= 3) {
        let Some((low, high)) = bounds(polygon.iter().map(|&point| view.place(point))) else { continue };
        if view.shows(low, high) {
            let points: Vec<_> = polygon
                .iter()
                .map(|&point| {
                    let [x, y] = view.place(point);
                    format!("{x:.1} {y:.1}")
                })
                .collect();
            shape.push_str(&format!("M{}Z", points.join("L")));
        }
    }
    if !shape.is_empty() {
        // The stroke is the fill colour, darker by a third, so that pale objects on pale ground are visible.
        let dark = |channel: u8| u16::from(channel) * 2 / 3;
        svg.raw(&format!(
            "<path d=\"{shape}\" fill=\"rgb({red},{green},{blue})\" fill-opacity=\"0.55\" stroke=\"rgb({},{},{})\" \
             stroke-width=\"0.8\" stroke-opacity=\"0.7\"><title>{}</title></path>\n",
            dark(red),
            dark(green),
            dark(blue),
            escaped(&outline.name)
        ));
    }
}

/// Labels objects that are large enough on the map; below a symbol that would cover the name.
fn draw_name(svg: &mut Svg, outline: &Outline, view: &Extent, signs: &[[f64; 2]]) {
    let Some((low, high)) = bounds(outline.polygons.iter().flatten().map(|&point| view.place(point))) else { return };
    let needed = outline.name.chars().count() as f64 * 6.4 + 6.0;
    let [x, mut y] = [f64::midpoint(low[0], high[0]), f64::midpoint(low[1], high[1])];
    let covering = signs.iter().filter(|sign| (sign[0] - x).abs() < needed / 2.0 + SIGN && (sign[1] - y).abs() < SIGN + 6.0);
    if let Some(lowest) = covering.map(|sign| sign[1]).max_by(f64::total_cmp) {
        y = lowest + SIGN + 8.0;
    }
    let inside = view.shows([x - needed / 2.0, y - 6.0], [x + needed / 2.0, y + 6.0]);
    let filling = high[0] - low[0] > view.width && high[1] - low[1] > view.height;
    if inside && !filling && high[0] - low[0] >= needed && high[1] - low[1] >= 14.0 {
        let halo = "paint-order=\"stroke\" stroke=\"#ffffff\" stroke-width=\"2.5\" stroke-opacity=\"0.8\"";
        svg.text(x, y + 4.0, "middle", &format!("font-size=\"11\" fill=\"#45505c\" {halo}"), &outline.name);
    }
}

/// Minimum and maximum coordinates; `None` without points.
fn bounds(points: impl Iterator<Item = [f64; 2]>) -> Option<([f64; 2], [f64; 2])> {
    points.fold(None, |known, [x, y]| {
        let ([low_x, low_y], [high_x, high_y]) = known.unwrap_or(([x, y], [x, y]));
        Some(([low_x.min(x), low_y.min(y)], [high_x.max(x), high_y.max(y)]))
    })
}

fn draw_scale(svg: &mut Svg, view: &Extent) {
    let step = round_step(view.width / view.scale, 6.0);
    let length = step * view.scale;
    let (x, y) = (view.left + 16.0, view.bottom() - 16.0);
    let plate = format!("width=\"{:.1}\" height=\"30\" rx=\"4\" fill=\"#ffffff\" fill-opacity=\"0.85\"", length + 16.0);
    svg.raw(&format!("<rect x=\"{:.1}\" y=\"{:.1}\" {plate}/>\n", x - 8.0, y - 22.0));
    for (from, to) in [([x, y], [x + length, y]), ([x, y - 5.0], [x, y + 1.0]), ([x + length, y - 5.0], [x + length, y + 1.0])] {
        svg.line(from, to, colours::TEXT, 2.0, "");
    }
    let text = format!("{} m", figure(step, step));
    svg.text(x + length / 2.0, y - 6.0, "middle", &format!("font-size=\"12\" fill=\"{}\"", colours::TEXT), &text);
}

fn draw_north(svg: &mut Svg, x: f64, y: f64) {
    svg.raw(&format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"20\" fill=\"#ffffff\" fill-opacity=\"0.85\"/>\n"));
    svg.raw(&format!("<path d=\"M{x:.1} {:.1}l6 16l-6 -4l-6 4z\" fill=\"{}\"/>\n", y - 4.0, colours::TEXT));
    svg.text(x, y - 6.5, "middle", &format!("font-size=\"11\" font-weight=\"600\" fill=\"{}\"", colours::TEXT), "N");
}

pub(super) fn start_sign(svg: &mut Svg, x: f64, y: f64) {
    let style = format!("fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"2\"", colours::START);
    svg.raw(&format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7\" {style}><title>start</title></circle>\n"));
}

pub(super) fn end_sign(svg: &mut Svg, x: f64, y: f64) {
    let style = format!("fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"2\"", colours::PATH);
    let (left, top) = (x - 6.5, y - 6.5);
    svg.raw(&format!("<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"13\" height=\"13\" {style}><title>end</title></rect>\n"));
}

/// The decisions at their places, with their numbers where there is room; a dot where not. Of those that would overlap the earliest has
/// its number, since it is more informative.
pub(super) fn decision_signs(svg: &mut Svg, input: &TrajectoryInput, place: impl Fn(&DecisionMark) -> [f64; 2]) {
    let mut numbered: Vec<[f64; 2]> = Vec::new();
    let mut signs = Vec::new();
    for (number, decision) in (1..).zip(&input.decisions) {
        let [x, y] = place(decision);
        if x.is_finite() && y.is_finite() {
            let has_room = numbered.iter().all(|[a, b]| (x - a).hypot(y - b) >= APART);
            if has_room {
                numbered.push([x, y]);
            }
            signs.push((has_room, x, y, number, format!("{number}: {} ({})", decision.label, decision.time)));
        }
    }
    for (_, x, y, _, title) in signs.iter().filter(|sign| !sign.0) {
        svg.raw(&format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{}\"><title>{}</title></circle>\n",
            colours::DECISION,
            escaped(title)
        ));
    }
    for (_, x, y, number, title) in signs.iter().filter(|sign| sign.0) {
        decision_sign(svg, *x, *y, *number, title);
    }
}

pub(super) fn decision_sign(svg: &mut Svg, x: f64, y: f64, number: usize, title: &str) {
    svg.open("g", "font-weight=\"600\"");
    svg.raw(&format!("<title>{}</title>\n", escaped(title)));
    let style = format!("fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1.2\"", colours::DECISION);
    svg.raw(&format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7.5\" {style}/>\n"));
    svg.text(x, y + 3.1, "middle", "font-size=\"8.5\" fill=\"#ffffff\"", &number.to_string());
    svg.close();
}

pub(super) fn waypoint_sign(svg: &mut Svg, x: f64, y: f64) {
    for (dx, dy) in [(4.0, 4.0), (4.0, -4.0)] {
        svg.line([x - dx, y - dy], [x + dx, y + dy], colours::WAYPOINT, 1.8, "stroke-linecap=\"round\"");
    }
}

/// A place to keep away from; a wall has no thickness, and is drawn thick enough to be seen.
pub(super) fn marked_sign(svg: &mut Svg, from: [f64; 2], to: [f64; 2], title: &str) {
    svg.open("g", "");
    if !title.is_empty() {
        svg.raw(&format!("<title>{}</title>\n", escaped(title)));
    }
    svg.line(from, to, "#ffffff", 7.0, "stroke-linecap=\"round\"");
    svg.line(from, to, colours::MARKED, 4.5, "stroke-linecap=\"round\"");
    svg.close();
}

pub(super) fn target_sign(svg: &mut Svg, x: f64, y: f64) {
    for (radius, fill) in [(9.0, "none"), (3.0, colours::TARGET)] {
        let style = format!("fill=\"{fill}\" stroke=\"{}\" stroke-width=\"2.5\"", colours::TARGET);
        svg.raw(&format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {style}><title>target's nearest surface</title></circle>\n"
        ));
    }
}
