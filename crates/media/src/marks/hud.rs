//! Text overlay of the annotated video: instruction, time and decision.

use super::canvas::{Canvas, Colour, Point, Rect};
use super::text::TextStyle;
use crate::frame::Rgb;

/// Texts on translucent bars at the upper and lower edges. Empty texts take no space; long ones are truncated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hud<'a> {
    /// At the top left, such as the instruction.
    pub title: &'a str,
    /// At the top right, such as flight time and phase.
    pub status: &'a str,
    /// Lines at the bottom, top to bottom, such as the last decision and the craft's telemetry.
    pub lines: &'a [&'a str],
}

/// Draws a [`Hud`] on an image.
pub fn draw_hud(picture: &mut Rgb, hud: &Hud<'_>) {
    let mut canvas = Canvas::new(picture);
    let style = TextStyle::outlined(16.0 * canvas.unit());
    let (_, height) = style.measure("");
    let pad = (height / 4.0).round();
    let (right, bottom) = (canvas.width(), canvas.height());
    let ground = Colour::INK.with_opacity(130);

    if !hud.title.is_empty() || !hud.status.is_empty() {
        canvas.fill(Rect { left: 0.0, top: 0.0, right, bottom: height + 2.0 * pad }, ground);
        let (status_width, _) = style.measure(hud.status);
        let room = right - status_width - 4.0 * pad;
        canvas.text(Point::new(pad, pad), &style.fitted(hud.title, room), style);
        canvas.text(Point::new(right - status_width - pad, pad), hud.status, style);
    }
    let lines = hud.lines.iter().filter(|line| !line.is_empty());
    let block = lines.clone().count() as f64 * height;
    if block > 0.0 {
        let top = bottom - block - 2.0 * pad;
        canvas.fill(Rect { left: 0.0, top, right, bottom }, ground);
        let mut y = top + pad;
        for line in lines {
            canvas.text(Point::new(pad, y), &style.fitted(line, right - 2.0 * pad), style);
            y += height;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_hud_leaves_the_picture_alone() {
        let mut picture = Rgb::filled(320, 240, [90, 120, 150]);
        draw_hud(&mut picture, &Hud { lines: &["", ""], ..Hud::default() });
        assert_eq!(picture, Rgb::filled(320, 240, [90, 120, 150]));
    }

    #[test]
    fn bars_hug_the_edges_and_leave_the_middle_alone() {
        let mut picture = Rgb::filled(640, 480, [90, 120, 150]);
        draw_hud(&mut picture, &Hud { title: "Fly to the red crane", status: "12.3 s", lines: &["one", "two"] });
        // 16 px of text and 4 px above and below: rows 0..24 and 480 - 40..480.
        for (y, touched) in [(0, true), (23, true), (24, false), (300, false), (439, false), (440, true), (479, true)] {
            assert_eq!(picture.pixel(320, y) != Some([90, 120, 150]), touched, "row {y}");
        }
    }
}
