//! Text overlay of the annotated video: instruction, time and decision.

use spf_core::query::{ImagePoint, Mark};

use super::canvas::{Canvas, Colour, Point, Rect};
use super::text::TextStyle;
use crate::frame::Rgb;

/// Texts on translucent bars at the upper and lower edges. Empty texts take no space; a long line continues on a second one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hud<'a> {
    /// At the top left, such as the instruction.
    pub title: &'a str,
    /// At the top right, such as flight time and phase.
    pub status: &'a str,
    /// Lines at the bottom, top to bottom, such as the last decision and the craft's telemetry.
    pub lines: &'a [&'a str],
    /// An image at the upper right, below the bar, such as a map.
    pub corner: Option<&'a Rgb>,
}

/// Draws marks, the waypoint with its caption, and a [`Hud`] over them. Captions are placed between the bars of the overlay
/// without overlapping; a caption without room is omitted.
pub fn annotate(image: &mut Rgb, marks: &[Mark], waypoint: Option<(ImagePoint, &str)>, hud: &Hud<'_>) {
    annotate_canvas(&mut Canvas::new(image), marks, waypoint, hud);
}

fn annotate_canvas(canvas: &mut Canvas<'_>, marks: &[Mark], waypoint: Option<(ImagePoint, &str)>, hud: &Hud<'_>) {
    canvas.keep_captions_in(hud.free_area(canvas));
    if let Some(area) = hud.corner_area(canvas) {
        canvas.keep_captions_off(area);
    }
    // The caption of the waypoint is the more important one and is placed first; the ring is drawn over the marks.
    for mark in marks {
        canvas.mark_without_caption(mark);
    }
    if let Some((at, caption)) = waypoint {
        canvas.waypoint(at, caption, Colour::WAYPOINT);
    }
    for mark in marks {
        canvas.caption_of(mark);
    }
    hud.draw(canvas);
}

/// Draws a [`Hud`] on an image.
pub fn draw_hud(image: &mut Rgb, hud: &Hud<'_>) {
    hud.draw(&mut Canvas::new(image));
}

impl Hud<'_> {
    fn style(canvas: &Canvas<'_>) -> (TextStyle, f64, f64) {
        let style = TextStyle::outlined(16.0 * canvas.unit());
        let (_, height) = style.measure("");
        (style, height, (height / 4.0).round())
    }

    fn shown_lines(&self, canvas: &Canvas<'_>) -> Vec<String> {
        let (style, _, pad) = Self::style(canvas);
        // More than two lines for one text would hide the image.
        self.lines
            .iter()
            .flat_map(|line| {
                let mut lines = style.wrapped(line, canvas.width() - 2.0 * pad);
                if lines.len() > 2 {
                    let rest = lines.split_off(1).join(" ");
                    lines.push(style.fitted(&rest, canvas.width() - 2.0 * pad));
                }
                lines
            })
            .collect()
    }

    /// The image between the bars.
    fn free_area(&self, canvas: &Canvas<'_>) -> Rect {
        let (_, height, pad) = Self::style(canvas);
        let headed = !self.title.is_empty() || !self.status.is_empty();
        let block = self.shown_lines(canvas).len() as f64 * height;
        Rect {
            left: 0.0,
            top: if headed { height + 2.0 * pad } else { 0.0 },
            right: canvas.width(),
            bottom: canvas.height() - if block > 0.0 { block + 2.0 * pad } else { 0.0 },
        }
    }

    /// Where the image in the corner is drawn; `None` without one, and if it does not fit.
    fn corner_area(&self, canvas: &Canvas<'_>) -> Option<Rect> {
        let corner = self.corner?;
        let (free, pad) = (self.free_area(canvas), (4.0 * canvas.unit()).round());
        let (left, top) = (free.right - f64::from(corner.width()) - pad, free.top.ceil() + pad);
        let area = Rect { left, top, right: free.right - pad, bottom: top + f64::from(corner.height()) };
        (area.left >= 0.0 && area.bottom <= free.bottom).then_some(area)
    }

    fn draw(&self, canvas: &mut Canvas<'_>) {
        if let Some((area, corner)) = self.corner_area(canvas).zip(self.corner) {
            canvas.paste(Point::new(area.left, area.top), corner);
            canvas.frame(area, canvas.unit(), Colour::INK);
        }
        let (style, height, pad) = Self::style(canvas);
        let (right, bottom) = (canvas.width(), canvas.height());
        let ground = Colour::INK.with_opacity(130);
        let free = self.free_area(canvas);
        if free.top > 0.0 {
            canvas.fill(Rect { left: 0.0, top: 0.0, right, bottom: free.top }, ground);
            let (status_width, _) = style.measure(self.status);
            let room = right - status_width - 4.0 * pad;
            canvas.text(Point::new(pad, pad), &style.fitted(self.title, room), style);
            canvas.text(Point::new(right - status_width - pad, pad), self.status, style);
        }
        if free.bottom < bottom {
            canvas.fill(Rect { left: 0.0, top: free.bottom, right, bottom }, ground);
            let mut y = free.bottom + pad;
            for line in self.shown_lines(canvas) {
                canvas.text(Point::new(pad, y), &line, style);
                y += height;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_core::query::ImageBox;

    use super::*;

    proptest! {
        /// Overlapping text is unreadable: no caption touches another one or a bar.
        #[test]
        fn no_text_is_on_another(
            corners in prop::collection::vec((0.0..1.0_f64, 0.0..1.0_f64, 0.0..0.5_f64, 0.0..0.5_f64), 0..12),
            (u, v) in (-0.2..1.2_f64, -0.2..1.2_f64),
            lines in 0..4_usize,
        ) {
            let boxes: Vec<Mark> = corners
                .iter()
                .map(|&(left, top, width, height)| Mark::Box {
                    area: ImageBox { left, top, right: left + width, bottom: top + height },
                    label: "grey street lamp 5".to_owned(),
                })
                .collect();
            let mut image = Rgb::new(640, 480);
            let mut canvas = Canvas::new(&mut image);
            let hud = Hud { title: "Fly to the taxi", status: "12.0 s  flying", lines: &["height 2.4 m"; 4][..lines], ..Hud::default() };
            let free = hud.free_area(&canvas);
            annotate_canvas(&mut canvas, &boxes, Some((ImagePoint { u, v }, "2.2 m")), &hud);
            let captions = canvas.captions();
            prop_assert!(!captions.is_empty());
            for (index, caption) in captions.iter().enumerate() {
                prop_assert!(caption.top >= free.top && caption.bottom <= free.bottom, "{caption:?} outside {free:?}");
                prop_assert!(captions[..index].iter().all(|other| !other.overlaps(caption)), "{caption:?} on {captions:?}");
            }
        }
    }

    #[test]
    fn an_empty_hud_leaves_the_image_alone() {
        let mut image = Rgb::filled(320, 240, [90, 120, 150]);
        draw_hud(&mut image, &Hud { lines: &["", ""], ..Hud::default() });
        assert_eq!(image, Rgb::filled(320, 240, [90, 120, 150]));
    }

    #[test]
    fn bars_hug_the_edges_and_leave_the_middle_alone() {
        let mut image = Rgb::filled(640, 480, [90, 120, 150]);
        draw_hud(&mut image, &Hud { title: "Fly to the red crane", status: "12.3 s", lines: &["one", "two"], ..Hud::default() });
        // 16 px of text and 4 px above and below: rows 0..24 and 480 - 40..480.
        for (y, touched) in [(0, true), (23, true), (24, false), (300, false), (439, false), (440, true), (479, true)] {
            assert_eq!(image.pixel(320, y) != Some([90, 120, 150]), touched, "row {y}");
        }
    }
}
