//! A minimal SVG writer whose output is always well-formed.

use core::fmt::Write;

use crate::drawing::thinned;

/// An SVG document being written.
#[derive(Debug)]
pub(super) struct Svg {
    text: String,
    open: Vec<&'static str>,
}

impl Svg {
    /// A white document of `width × height`.
    pub(super) fn new(width: f64, height: f64) -> Self {
        let mut svg = Self { text: String::new(), open: Vec::new() };
        svg.raw(&format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" font-family=\"Inter, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        ));
        svg
    }

    /// Writes markup unchanged; external text must go through [`Svg::text`] or [`escaped`].
    pub(super) fn raw(&mut self, markup: &str) {
        self.text.push_str(markup);
    }

    /// Opens an element that stays open until [`Svg::close`].
    pub(super) fn open(&mut self, name: &'static str, attributes: &str) {
        self.raw(&format!("<{name} {attributes}>\n"));
        self.open.push(name);
    }

    /// Closes the element opened last.
    pub(super) fn close(&mut self) {
        if let Some(name) = self.open.pop() {
            self.raw(&format!("</{name}>\n"));
        }
    }

    /// A line of text; `anchor` is `start`, `middle` or `end`.
    pub(super) fn text(&mut self, x: f64, y: f64, anchor: &str, attributes: &str, text: &str) {
        let text = escaped(text);
        self.raw(&format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" {attributes}>{text}</text>\n"));
    }

    /// A straight line.
    pub(super) fn line(&mut self, from: [f64; 2], to: [f64; 2], colour: &str, width: f64, attributes: &str) {
        let ([x1, y1], [x2, y2]) = (from, to);
        self.raw(&format!(
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{colour}\" stroke-width=\"{width}\" {attributes}/>\n"
        ));
    }

    /// A polyline; points closer than half a unit to the previous one are omitted, except for the last.
    pub(super) fn polyline(&mut self, points: &[[f64; 2]], attributes: &str) {
        let mut drawn = String::new();
        for [x, y] in thinned(points.iter().copied()) {
            // Writing to a `String` cannot fail.
            write!(drawn, "{x:.1},{y:.1} ").ok();
        }
        self.raw(&format!("<polyline points=\"{}\" fill=\"none\" {attributes}/>\n", drawn.trim_end()));
    }

    /// The document.
    pub(super) fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.close();
        }
        self.text.push_str("</svg>\n");
        self.text
    }
}

/// `text` escaped for content and attributes; characters not allowed in XML 1.0 are omitted.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\n' | '\r' | '\t' => safe.push(' '),
            '\u{fffe}' | '\u{ffff}' => {}
            other if other.is_control() => {}
            other => safe.push(other),
        }
    }
    safe
}
