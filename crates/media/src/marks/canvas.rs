//! Anti-aliased shapes from signed distance.
//!
//! A pixel's coverage is `0.5 − distance` to the outline, clamped to 0..=1: a one-pixel box filter, exact for
//! axis-aligned straight edges. Only basic arithmetic and square roots are used, so results are equal on every machine.

use crate::frame::Rgb;

/// A drawing colour: 8-bit sRGB and opacity (255 is opaque).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour {
    /// Red.
    pub red: u8,
    /// Green.
    pub green: u8,
    /// Blue.
    pub blue: u8,
    /// 0 transparent … 255 opaque.
    pub opacity: u8,
}

impl Colour {
    /// White.
    pub const WHITE: Self = Self::rgb(255, 255, 255);
    /// Nearly black, for outlines and backgrounds.
    pub const INK: Self = Self::rgb(16, 18, 22);
    /// The waypoint of a decision.
    pub const WAYPOINT: Self = Self::rgb(255, 64, 129);
    /// Obstacles and warnings.
    pub const OBSTACLE: Self = Self::rgb(255, 171, 0);
    /// Candidates and everything neutral.
    pub const CANDIDATE: Self = Self::rgb(0, 200, 255);

    /// An opaque colour.
    #[must_use]
    pub const fn rgb(red: u8, green: u8, blue: u8) -> Self {
        Self { red, green, blue, opacity: 255 }
    }

    /// The same colour with this opacity, 0 transparent to 255 opaque.
    #[must_use]
    pub const fn with_opacity(self, opacity: u8) -> Self {
        Self { opacity, ..self }
    }
}

/// A position on the canvas: pixels from the left and upper edge, with pixel centres at halves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Pixels from the left edge.
    pub x: f64,
    /// Pixels from the upper edge.
    pub y: f64,
}

impl Point {
    /// A position.
    #[must_use]
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Moves by `x` to the right and `y` down.
    #[must_use]
    pub fn shifted(self, x: f64, y: f64) -> Self {
        Self::new(self.x + x, self.y + y)
    }

    fn distance(self, other: Self) -> f64 {
        let (x, y) = (self.x - other.x, self.y - other.y);
        (x * x + y * y).sqrt()
    }

    /// Distant positions are clamped to avoid overflow; NaN gives `None`.
    fn bounded(self) -> Option<Self> {
        (!self.x.is_nan() && !self.y.is_nan()).then(|| Self::new(self.x.clamp(-FAR, FAR), self.y.clamp(-FAR, FAR)))
    }
}

/// Ten times the largest image that our codecs accept.
const FAR: f64 = 40_000.0;

/// An axis-aligned rectangle in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Right edge.
    pub right: f64,
    /// Lower edge.
    pub bottom: f64,
}

impl Rect {
    fn bounded(self) -> Option<Self> {
        let (a, b) = (Point::new(self.left, self.top).bounded()?, Point::new(self.right, self.bottom).bounded()?);
        Some(Self { left: a.x.min(b.x), top: a.y.min(b.y), right: a.x.max(b.x), bottom: a.y.max(b.y) })
    }

    /// Whether the two have an area in common.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }

    fn grown(self, by: f64) -> Self {
        Self { left: self.left - by, top: self.top - by, right: self.right + by, bottom: self.bottom + by }
    }
}

/// Draws on an image. Shapes are clipped to it; coordinates may have any value, and NaN draws nothing.
#[derive(Debug)]
pub struct Canvas<'a> {
    image: &'a mut Rgb,
    /// Where captions may be placed.
    room: Rect,
    /// The captions placed so far.
    captions: Vec<Rect>,
}

impl<'a> Canvas<'a> {
    /// A canvas over an image.
    #[must_use]
    pub fn new(image: &'a mut Rgb) -> Self {
        let room = Rect { left: 0.0, top: 0.0, right: f64::from(image.width()), bottom: f64::from(image.height()) };
        Self { image, room, captions: Vec::new() }
    }

    /// Keeps captions within `room`, such as between the bars of an overlay.
    pub(super) fn keep_captions_in(&mut self, room: Rect) {
        self.room = room;
    }

    /// Keeps captions off an area, such as that of an image in a corner.
    pub(super) fn keep_captions_off(&mut self, area: Rect) {
        self.captions.push(area);
    }

    /// An area of a caption's size inside the room that touches no other caption: the nearest one above or below
    /// `wanted`, moved sideways only as far as the room requires. `None` if there is no such area.
    pub(super) fn reserve(&mut self, wanted: Rect) -> Option<Rect> {
        let (width, height) = (wanted.right - wanted.left, wanted.bottom - wanted.top);
        let inside = |place: f64, extent: f64, low: f64, high: f64| place.min(high - extent).max(low).round();
        let left = inside(wanted.left, width, self.room.left, self.room.right);
        let at = |top: f64| {
            let top = inside(top, height, self.room.top, self.room.bottom);
            Rect { left, top, right: left + width, bottom: top + height }
        };
        let first = at(wanted.top);
        // Free areas begin at the lower or end at the upper edge of a caption, one pixel apart.
        let neighbours = self.captions.iter().flat_map(|other| [at(other.bottom + 1.0), at(other.top - height - 1.0)]);
        let away = |area: &Rect| (area.top - first.top).abs();
        let mut candidates: Vec<Rect> = std::iter::once(first).chain(neighbours).collect();
        candidates.sort_by(|a, b| away(a).total_cmp(&away(b)));
        let area = candidates
            .into_iter()
            .find(|area| area.bottom <= self.room.bottom + 0.5 && !self.captions.iter().any(|other| other.overlaps(area)))?;
        self.captions.push(area);
        Some(area)
    }

    /// The areas of the captions placed so far.
    #[cfg(test)]
    pub(super) fn captions(&self) -> &[Rect] {
        &self.captions
    }

    /// Width, pixels.
    #[must_use]
    pub fn width(&self) -> f64 {
        f64::from(self.image.width())
    }

    /// Height, pixels.
    #[must_use]
    pub fn height(&self) -> f64 {
        f64::from(self.image.height())
    }

    /// The unit for strokes and text: 1 px for an image 480 px high, at least 1.
    #[must_use]
    pub fn unit(&self) -> f64 {
        (self.height() / 480.0).max(1.0)
    }

    /// A filled disc.
    pub fn disc(&mut self, centre: Point, radius: f64, colour: Colour) {
        let Some((centre, radius)) = centre.bounded().zip(bounded_length(radius)) else { return };
        self.cover(square(centre, radius), colour, |at| at.distance(centre) - radius);
    }

    /// A circle outline of this width, centred on the radius.
    pub fn ring(&mut self, centre: Point, radius: f64, width: f64, colour: Colour) {
        let Some((centre, radius)) = centre.bounded().zip(bounded_length(radius)) else { return };
        let Some(width) = bounded_length(width) else { return };
        self.cover(square(centre, radius + width / 2.0), colour, |at| (at.distance(centre) - radius).abs() - width / 2.0);
    }

    /// A straight line with round ends, `width` wide.
    pub fn line(&mut self, from: Point, to: Point, width: f64, colour: Colour) {
        let Some((from, to)) = from.bounded().zip(to.bounded()) else { return };
        let Some(width) = bounded_length(width) else { return };
        let (run_x, run_y) = (to.x - from.x, to.y - from.y);
        let squared = run_x * run_x + run_y * run_y;
        let area = Rect { left: from.x, top: from.y, right: to.x, bottom: to.y };
        let Some(area) = area.bounded() else { return };
        self.cover(area.grown(width / 2.0), colour, |at| {
            let along = ((at.x - from.x) * run_x + (at.y - from.y) * run_y) / squared;
            // Zero length makes `along` NaN, for which `clamp` and the comparison below keep the start.
            let along = if along > 0.0 { along.min(1.0) } else { 0.0 };
            at.distance(from.shifted(along * run_x, along * run_y)) - width / 2.0
        });
    }

    /// A filled triangle, corners in either order.
    pub fn triangle(&mut self, corners: [Point; 3], colour: Colour) {
        let [Some(a), Some(b), Some(c)] = corners.map(Point::bounded) else { return };
        let twice_area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        let (b, c) = if twice_area < 0.0 { (c, b) } else { (b, c) };
        let area = Rect {
            left: a.x.min(b.x).min(c.x),
            top: a.y.min(b.y).min(c.y),
            right: a.x.max(b.x).max(c.x),
            bottom: a.y.max(b.y).max(c.y),
        };
        // Distance to the line through an edge, positive outside.
        let beyond = |at: Point, from: Point, to: Point| {
            let length = from.distance(to).max(1e-9);
            ((at.x - from.x) * (to.y - from.y) - (at.y - from.y) * (to.x - from.x)) / length
        };
        self.cover(area, colour, |at| beyond(at, a, b).max(beyond(at, b, c)).max(beyond(at, c, a)));
    }

    /// A filled rectangle.
    pub fn fill(&mut self, area: Rect, colour: Colour) {
        let Some(area) = area.bounded() else { return };
        self.cover(area, colour, |at| (area.left - at.x).max(at.x - area.right).max((area.top - at.y).max(at.y - area.bottom)));
    }

    /// A rectangle's outline, `width` wide, centred on its edges.
    pub fn frame(&mut self, area: Rect, width: f64, colour: Colour) {
        let Some((area, width)) = area.bounded().zip(bounded_length(width)) else { return };
        let corners = [
            Point::new(area.left, area.top),
            Point::new(area.right, area.top),
            Point::new(area.right, area.bottom),
            Point::new(area.left, area.bottom),
        ];
        for side in 0..4 {
            self.line(corners[side], corners[(side + 1) % 4], width, colour);
        }
    }

    /// Copies an image, its upper left corner at `at` (rounded to whole pixels); what is outside is left out.
    pub fn paste(&mut self, at: Point, image: &Rgb) {
        for y in 0..image.height() {
            for x in 0..image.width() {
                let place = Point::new(at.x.round() + f64::from(x), at.y.round() + f64::from(y));
                let inside = place.x >= 0.0 && place.y >= 0.0 && place.x < self.width() && place.y < self.height();
                if let Some(colour) = image.pixel(x, y).filter(|_| inside) {
                    self.image.set_pixel(place.x as u32, place.y as u32, colour);
                }
            }
        }
    }

    /// Blends `colour` into one pixel with coverage `alpha` (0..=255).
    pub(super) fn blend(&mut self, x: u32, y: u32, colour: Colour, alpha: u8) {
        let Some([red, green, blue]) = self.image.pixel(x, y) else { return };
        let weight = (u32::from(colour.opacity) * u32::from(alpha) + 127) / 255;
        let mix = |below: u8, above: u8| ((u32::from(below) * (255 - weight) + u32::from(above) * weight + 127) / 255) as u8;
        self.image.set_pixel(x, y, [mix(red, colour.red), mix(green, colour.green), mix(blue, colour.blue)]);
    }

    /// Blends every pixel within half a pixel of `area` by its distance from the shape.
    fn cover(&mut self, area: Rect, colour: Colour, distance: impl Fn(Point) -> f64) {
        let area = area.grown(1.0);
        // `as` saturates: positions left of or above the image become its first pixel.
        let (left, right) = (area.left.floor() as u32, (area.right.ceil() as u32).min(self.image.width()));
        let (top, bottom) = (area.top.floor() as u32, (area.bottom.ceil() as u32).min(self.image.height()));
        for y in top..bottom {
            for x in left..right {
                let alpha = 0.5 - distance(Point::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                if alpha > 0.0 {
                    self.blend(x, y, colour, (alpha.min(1.0) * 255.0 + 0.5) as u8);
                }
            }
        }
    }
}

fn square(centre: Point, radius: f64) -> Rect {
    Rect { left: centre.x - radius, top: centre.y - radius, right: centre.x + radius, bottom: centre.y + radius }
}

/// A radius or width within bounds; negative values and NaN draw nothing.
fn bounded_length(length: f64) -> Option<f64> {
    (length >= 0.0).then(|| length.min(FAR))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum of the red channel of a white shape on black, in whole pixels.
    fn area(draw: impl Fn(&mut Canvas<'_>)) -> f64 {
        let mut image = Rgb::new(64, 64);
        draw(&mut Canvas::new(&mut image));
        image.data().chunks_exact(3).map(|pixel| f64::from(pixel[0]) / 255.0).sum()
    }

    #[test]
    fn areas_are_those_of_geometry() {
        let centre = Point::new(31.3, 30.8);
        // π·10² = 314.2; ring 2π·20·3 = 377.0; line 30·4 plus two half discs of radius 2 = 132.6; triangle ½·20·30 = 300.
        for (name, drawn, expected) in [
            ("disc", area(|c| c.disc(centre, 10.0, Colour::WHITE)), 314.2),
            ("ring", area(|c| c.ring(centre, 20.0, 3.0, Colour::WHITE)), 377.0),
            ("line", area(|c| c.line(Point::new(10.0, 20.0), Point::new(28.0, 44.0), 4.0, Colour::WHITE)), 132.6),
            (
                "triangle",
                area(|c| c.triangle([Point::new(5.0, 5.0), Point::new(5.0, 35.0), Point::new(25.0, 20.0)], Colour::WHITE)),
                300.0,
            ),
            ("fill", area(|c| c.fill(Rect { left: 4.0, top: 5.0, right: 24.0, bottom: 15.0 }, Colour::WHITE)), 200.0),
        ] {
            assert!((drawn - expected).abs() < expected * 0.015, "{name}: {drawn} instead of {expected}");
        }
    }

    #[test]
    fn half_opacity_mixes_half() {
        let mut image = Rgb::filled(8, 8, [200, 0, 100]);
        let area = Rect { left: 2.0, top: 2.0, right: 6.0, bottom: 6.0 };
        Canvas::new(&mut image).fill(area, Colour::rgb(0, 200, 100).with_opacity(128));
        assert_eq!(image.pixel(3, 3), Some([100, 100, 100]));
        assert_eq!(image.pixel(7, 7), Some([200, 0, 100]));
    }

    #[test]
    fn a_line_without_length_is_a_dot() {
        let dot = area(|c| c.line(Point::new(20.0, 20.0), Point::new(20.0, 20.0), 8.0, Colour::WHITE));
        assert!((dot - 50.3).abs() < 1.0, "{dot}");
    }
}
