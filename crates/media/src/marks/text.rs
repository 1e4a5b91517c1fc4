//! Text in the bitmap font Spleen, in the next smaller size available.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use super::canvas::{Canvas, Colour, Point, Rect};

/// One size of the font, decoded once.
struct Size {
    width: u32,
    height: u32,
    /// A glyph is one word of bits per row, with the left pixel in the highest bit.
    glyphs: BTreeMap<char, Vec<u32>>,
}

static SIZES: LazyLock<Vec<Size>> = LazyLock::new(|| {
    let files: [&[u8]; 5] = [
        spleen_font::FONT_6X12,
        spleen_font::FONT_8X16,
        spleen_font::FONT_12X24,
        spleen_font::FONT_16X32,
        spleen_font::FONT_32X64,
    ];
    files.into_iter().map(|file| Size::decode(file).expect("the embedded font files are valid")).collect()
});

impl Size {
    /// Decodes a PC screen font, version 1 or 2, with its Unicode table. The font crate's own reader (version 0.2) uses
    /// the mode of a version 1 file, such as the 8×16 one, as its glyph height, so it cannot be used.
    fn decode(file: &[u8]) -> Option<Self> {
        let word = |index: usize| file.get(index * 4..index * 4 + 4)?.try_into().ok().map(u32::from_le_bytes);
        let second = file.starts_with(&[0x72, 0xb5, 0x4a, 0x86]);
        let (start, count, length, height, width) = match *file {
            [0x36, 0x04, mode, height, ..] => {
                (4, if mode & 1 == 1 { 512 } else { 256 }, usize::from(height), u32::from(height), 8)
            }
            _ if second => (word(2)? as usize, word(4)? as usize, word(5)? as usize, word(6)?, word(7)?),
            _ => return None,
        };
        let bytes_a_row = width.div_ceil(8) as usize;
        let rows = |index: usize| -> Option<Vec<u32>> {
            let glyph = file.get(start + index * length..start + (index + 1) * length)?;
            let row = |bytes: &[u8]| bytes.iter().fold(0, |bits, &byte| bits << 8 | u32::from(byte));
            Some(glyph.chunks_exact(bytes_a_row).map(|bytes| row(bytes) >> (bytes_a_row as u32 * 8 - width)).collect())
        };
        let table = file.get(start + count * length..)?;
        let mut glyphs = BTreeMap::new();
        let lists = if second { unicode_of_version_2(table) } else { unicode_of_version_1(table) };
        for (index, characters) in lists.into_iter().enumerate().take(count) {
            for character in characters {
                glyphs.insert(character, rows(index)?);
            }
        }
        Some(Self { width, height, glyphs })
    }

    /// The rows of a character, of a similar one, or of the question mark.
    fn glyph(&self, character: char) -> &[u32] {
        let alike = match character {
            '→' => '>',
            '←' => '<',
            '↑' => '^',
            '↓' => 'v',
            '…' => '.',
            '–' | '—' | '−' | '‐' => '-',
            '‘' | '’' => '\'',
            '“' | '”' => '"',
            _ => '?',
        };
        [character, alike].iter().find_map(|c| self.glyphs.get(c)).map_or(&[], Vec::as_slice)
    }
}

/// The characters of each glyph: UTF-16 units, each list ended by 0xffff; sequences after 0xfffe are ignored.
fn unicode_of_version_1(table: &[u8]) -> Vec<Vec<char>> {
    let units: Vec<u16> = table.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    let single = |list: &[u16]| list.split(|&unit| unit == 0xfffe).next().unwrap_or_default().to_vec();
    units.split(|&unit| unit == 0xffff).map(|list| char::decode_utf16(single(list)).filter_map(Result::ok).collect()).collect()
}

/// The characters of each glyph: UTF-8, each list ended by 0xff; sequences after 0xfe are ignored.
fn unicode_of_version_2(table: &[u8]) -> Vec<Vec<char>> {
    table
        .split(|&byte| byte == 0xff)
        .map(|list| {
            let single = list.split(|&byte| byte == 0xfe).next().unwrap_or_default();
            String::from_utf8_lossy(single).chars().collect()
        })
        .collect()
}

/// A character in the font's largest size, for letters that are not rendered as pixels of an image (such as meshes).
#[derive(Clone, Copy, Debug)]
pub struct Glyph<'a> {
    width: u32,
    rows: &'a [u32],
}

impl<'a> Glyph<'a> {
    /// Width, pixels; at most 32.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.rows.len() as u32
    }

    /// One word of bits per row from the top; the left pixel is bit `width − 1`.
    pub fn rows(&self) -> impl Iterator<Item = u32> + 'a {
        self.rows.iter().copied()
    }
}

/// The largest glyph of a character, 32×64; `None` if the font lacks it.
#[must_use]
pub fn glyph(character: char) -> Option<Glyph<'static>> {
    let size = &SIZES[SIZES.len() - 1];
    size.glyphs.get(&character).map(|rows| Glyph { width: size.width, rows })
}

/// A style of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextStyle {
    /// Requested line height, pixels; the font has 12, 16, 24, 32 and 64.
    pub height: f64,
    /// Colour of the letters.
    pub colour: Colour,
    /// Colour of the outline, if any.
    pub outline: Option<Colour>,
}

impl TextStyle {
    /// White letters with a dark outline, `height` pixels high.
    #[must_use]
    pub const fn outlined(height: f64) -> Self {
        Self { height, colour: Colour::WHITE, outline: Some(Colour::INK) }
    }

    /// Letters without an outline.
    #[must_use]
    pub const fn plain(height: f64, colour: Colour) -> Self {
        Self { height, colour, outline: None }
    }

    fn size(&self) -> &'static Size {
        SIZES.iter().rev().find(|size| f64::from(size.height) <= self.height).unwrap_or(&SIZES[0])
    }

    /// Width and height of one line of `text`, pixels.
    #[must_use]
    pub fn measure(&self, text: &str) -> (f64, f64) {
        let size = self.size();
        (text.chars().count() as f64 * f64::from(size.width), f64::from(size.height))
    }

    /// `text`, truncated with two dots if it is wider than `width` pixels.
    #[must_use]
    pub fn fitted(&self, text: &str, width: f64) -> String {
        let room = (width / f64::from(self.size().width)).max(0.0) as usize;
        if text.chars().count() <= room {
            return text.to_owned();
        }
        // Two dots: not every size of the font has an ellipsis.
        text.chars().take(room.saturating_sub(2)).chain("..".chars().take(room)).collect()
    }
}

impl TextStyle {
    /// The text in lines of at most `width` pixels, broken between words; its spaces are kept if it fits into one line. A word that
    /// is longer than a line is split.
    #[must_use]
    pub fn wrapped(&self, text: &str, width: f64) -> Vec<String> {
        if !text.trim().is_empty() && self.measure(text).0 <= width {
            return vec![text.to_owned()];
        }
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            match lines.last_mut() {
                Some(line) if self.measure(line).0 + self.measure(" ").0 + self.measure(word).0 <= width => {
                    line.push(' ');
                    line.push_str(word);
                }
                _ => lines.push(self.fitted(word, width)),
            }
        }
        lines
    }
}

impl Canvas<'_> {
    /// Draws one line of text with its upper left corner at `at`, rounded to whole pixels. Control characters are drawn
    /// as spaces, missing ones as `?`.
    pub fn text(&mut self, at: Point, text: &str, style: TextStyle) {
        // Outside these bounds nothing of a line is visible, and `as` below is exact.
        if !(at.x.abs() < 1e6 && at.y.abs() < 1e6) {
            return;
        }
        let (x, y) = (at.x.round() as i64, at.y.round() as i64);
        let size = style.size();
        if let Some(outline) = style.outline {
            let reach = if size.height >= 24 { 2 } else { 1 };
            for (dx, dy) in outline_offsets(reach) {
                self.line_of_text(x + dx, y + dy, text, size, outline);
            }
        }
        self.line_of_text(x, y, text, size, style.colour);
    }

    /// Text on a background of colour `plate` with its upper left corner at `at`, moved into the image and off other
    /// labels of this canvas. Returns the background's area, or `None` if there is no room left and nothing is drawn.
    pub fn label(&mut self, at: Point, text: &str, style: TextStyle, plate: Colour) -> Option<Rect> {
        let pad = (style.height / 6.0).round().max(2.0);
        let text = style.fitted(text, self.width() - 2.0 * pad);
        let (width, height) = style.measure(&text);
        let (right, bottom) = (at.x + width + 2.0 * pad, at.y + height + pad);
        let area = self.reserve(Rect { left: at.x, top: at.y, right, bottom })?;
        self.fill(area, plate);
        self.text(Point::new(area.left + pad, area.top + (pad / 2.0).floor()), &text, style);
        Some(area)
    }

    fn line_of_text(&mut self, left: i64, top: i64, text: &str, size: &Size, colour: Colour) {
        let mut left = left;
        for character in text.chars() {
            if left > i64::from(self.width() as u32) {
                break;
            }
            let character = if character.is_control() { ' ' } else { character };
            for (row, bits) in (top..).zip(size.glyph(character)) {
                for column in 0..i64::from(size.width) {
                    if bits >> (i64::from(size.width) - 1 - column) & 1 == 1
                        && let (Ok(x), Ok(y)) = (u32::try_from(left + column), u32::try_from(row))
                    {
                        self.blend(x, y, colour, 255);
                    }
                }
            }
            left += i64::from(size.width);
        }
    }
}

/// The offsets at which the outline of a letter is drawn.
fn outline_offsets(reach: i64) -> impl Iterator<Item = (i64, i64)> {
    (-reach..=reach)
        .flat_map(move |dy| (-reach..=reach).map(move |dx| (dx, dy)))
        .filter(move |(dx, dy)| (dx, dy) != (&0, &0) && dx * dx + dy * dy <= reach * reach + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Rgb;

    #[test]
    fn sizes_are_those_of_the_font() {
        for (size, width, height) in
            [(5.0, 6.0, 12.0), (16.0, 8.0, 16.0), (23.9, 8.0, 16.0), (24.0, 12.0, 24.0), (99.0, 32.0, 64.0)]
        {
            assert_eq!(TextStyle::outlined(size).measure("abc"), (3.0 * width, height));
        }
    }

    #[test]
    fn every_character_our_texts_use_is_in_the_font() {
        let missing =
            |size: &Size, text: &str| text.chars().filter(|&c| size.glyph(c) == size.glyph('?') && c != '?').collect::<String>();
        for size in SIZES.iter() {
            assert_eq!(missing(size, "abcXYZ0189.,:;/%°±²·+-→←↑↓…—#()éü"), "", "{}×{}", size.width, size.height);
        }
    }

    #[test]
    fn long_text_is_cut_with_dots() {
        let style = TextStyle::outlined(16.0);
        assert_eq!(style.fitted("to the red crane", 80.0), "to the r..");
        assert_eq!(style.fitted("to the red crane", 128.0), "to the red crane");
        assert_eq!(style.fitted("to", 3.0), "");
        assert_eq!(style.fitted("to", f64::NAN), "");
    }

    #[test]
    fn lines_break_between_words() {
        let style = TextStyle::outlined(16.0);
        assert_eq!(style.wrapped("to the red  crane", 80.0), ["to the red", "crane"]);
        assert_eq!(style.wrapped("unfathomably far", 80.0), ["unfathom..", "far"]);
        assert_eq!(style.wrapped("  ", 80.0), Vec::<String>::new());
    }

    #[test]
    fn a_capital_i_is_a_stem() {
        let mut image = Rgb::new(16, 24);
        Canvas::new(&mut image).text(Point::new(4.0, 4.0), "I", TextStyle::plain(16.0, Colour::WHITE));
        let rows: Vec<usize> = (0..24).map(|y| (0..16).filter(|&x| image.pixel(x, y) == Some([255; 3])).count()).collect();
        let inked = rows.iter().filter(|&&row| row > 0).count();
        assert!((9..=11).contains(&inked), "{rows:?}");
        assert!(rows.iter().filter(|&&row| row == 2 || row == 1).count() >= 6, "{rows:?}");
    }
}
