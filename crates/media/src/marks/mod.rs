//! Marks drawn on an image: those of a query, and the overlay of the annotated video.
//!
//! Sizes scale with the image height, and every stroke has a contrasting outline, so that marks are readable on any
//! background for people and VLMs.

mod canvas;
mod hud;
mod text;

pub use canvas::{Canvas, Colour, Point, Rect};
pub use hud::{Hud, annotate, draw_hud};
pub use text::{Glyph, TextStyle, glyph};

use spf_core::query::{ImageBox, ImagePoint, Mark};

use crate::frame::Rgb;

/// Draws the marks of a query in order, in the candidate colour (boxes: in the obstacle colour).
pub fn draw(image: &mut Rgb, marks: &[Mark]) {
    let mut canvas = Canvas::new(image);
    for mark in marks {
        canvas.mark(mark);
    }
}

/// Draws the waypoint of a decision: a ring with a cross hair and a label beside it (such as `5 · red crane`).
pub fn draw_waypoint(image: &mut Rgb, at: ImagePoint, label: &str, colour: Colour) {
    Canvas::new(image).waypoint(at, label, colour);
}

impl Canvas<'_> {
    /// The canvas position of an image point.
    #[must_use]
    pub fn place(&self, at: ImagePoint) -> Point {
        Point::new(at.u * self.width(), at.v * self.height())
    }

    /// Draws one mark of a query.
    pub fn mark(&mut self, mark: &Mark) {
        self.mark_without_caption(mark);
        self.caption_of(mark);
    }

    fn mark_without_caption(&mut self, mark: &Mark) {
        match mark {
            Mark::Arrow { from, to } => self.arrow(self.place(*from), self.place(*to), Colour::CANDIDATE),
            Mark::Number { at, number } => self.numbered(self.place(*at), *number, Colour::CANDIDATE),
            Mark::Circle { at, radius } => {
                let (centre, unit) = (self.place(*at), self.unit());
                self.edged_ring(centre, radius * self.width(), 2.0 * unit, Colour::CANDIDATE);
            }
            Mark::Box { area, .. } => self.outlined_box(self.place_area(area), Colour::OBSTACLE),
        }
    }

    fn caption_of(&mut self, mark: &Mark) {
        if let Mark::Box { area, label } = mark {
            self.caption(self.place_area(area), label, Colour::OBSTACLE);
        }
    }

    fn place_area(&self, area: &ImageBox) -> Rect {
        let from = self.place(ImagePoint { u: area.left, v: area.top });
        let to = self.place(ImagePoint { u: area.right, v: area.bottom });
        Rect { left: from.x, top: from.y, right: to.x, bottom: to.y }
    }

    /// A ring with a cross hair that leaves the centre free, and a label to its lower right (kept inside the image).
    pub fn waypoint(&mut self, at: ImagePoint, label: &str, colour: Colour) {
        let (centre, unit) = (self.place(at), self.unit());
        let (radius, width) = (11.0 * unit, 2.2 * unit);
        for (stroke, width) in [(Colour::INK, width + 2.0 * unit), (colour, width)] {
            self.ring(centre, radius, width, stroke);
            for (x, y) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                let (inner, outer) = (radius * 0.55, radius * 1.55);
                self.line(centre.shifted(x * inner, y * inner), centre.shifted(x * outer, y * outer), width, stroke);
            }
        }
        self.disc(centre, 1.5 * unit, colour);
        if !label.is_empty() && centre.x.is_finite() && centre.y.is_finite() {
            let style = TextStyle::plain(16.0 * unit, Colour::WHITE);
            let (width, height) = style.measure(label);
            // Beside the ring, on the other side at the edge of the image.
            let x =
                if centre.x + radius * 1.8 + width + 6.0 > self.width() { -(radius * 1.8 + width + 6.0) } else { radius * 1.8 };
            let y = if centre.y + radius + height > self.height() { -(radius + height) } else { radius * 0.4 };
            self.label(centre.shifted(x, y), label, style, Colour::INK.with_opacity(170));
        }
    }

    /// An arrow whose tip is at `to`.
    pub fn arrow(&mut self, from: Point, to: Point, colour: Colour) {
        let unit = self.unit();
        let (run_x, run_y) = (to.x - from.x, to.y - from.y);
        let length = (run_x * run_x + run_y * run_y).sqrt();
        // A NaN length fails the comparison as well.
        if !(length > 1e-6 && length.is_finite()) {
            return;
        }
        let (along_x, along_y) = (run_x / length, run_y / length);
        let head = (14.0 * unit).min(length);
        for (stroke, edge) in [(Colour::INK, 1.2 * unit), (colour, 0.0)] {
            let back = head + edge;
            let neck = to.shifted(-along_x * head * 0.8, -along_y * head * 0.8);
            self.line(from, neck, 3.0 * unit + 2.0 * edge, stroke);
            let tip = to.shifted(along_x * edge * 1.8, along_y * edge * 1.8);
            let side = |sign: f64| {
                let half = sign * (head * 0.5 + edge * 1.4);
                to.shifted(-along_x * back - along_y * half, -along_y * back + along_x * half)
            };
            self.triangle([tip, side(1.0), side(-1.0)], stroke);
        }
    }

    /// A disc with a number in it.
    pub fn numbered(&mut self, centre: Point, number: u32, colour: Colour) {
        let unit = self.unit();
        let text = number.to_string();
        let style = TextStyle::plain(16.0 * unit, Colour::INK);
        let (width, height) = style.measure(&text);
        let radius = (width * 0.5 + 3.0 * unit).max(height * 0.62);
        self.disc(centre, radius + 1.5 * unit, Colour::INK);
        self.disc(centre, radius, colour);
        self.text(centre.shifted(-width / 2.0, -height / 2.0), &text, style);
    }

    fn outlined_box(&mut self, area: Rect, colour: Colour) {
        let unit = self.unit();
        self.frame(area, 4.0 * unit, Colour::INK.with_opacity(200));
        self.frame(area, 2.0 * unit, colour);
    }

    /// The caption of a rectangle: above it, or inside if there is no room above.
    fn caption(&mut self, area: Rect, caption: &str, colour: Colour) {
        let unit = self.unit();
        let finite = [area.left, area.top].iter().all(|edge| edge.is_finite());
        if !caption.is_empty() && finite {
            let style = TextStyle::plain(16.0 * unit, Colour::INK);
            let (_, height) = style.measure(caption);
            let above = area.top - height - 3.0 * unit;
            self.label(Point::new(area.left - unit, if above < 0.0 { area.top } else { above }), caption, style, colour);
        }
    }

    fn edged_ring(&mut self, centre: Point, radius: f64, width: f64, colour: Colour) {
        self.ring(centre, radius, width * 2.0, Colour::INK.with_opacity(200));
        self.ring(centre, radius, width, colour);
    }
}
