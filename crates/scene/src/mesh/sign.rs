//! Signs: words and arrows on a board, or painted on the wall behind them.

use glam::{Vec2, Vec3};
use serde::{Deserialize, Deserializer};
use spf_media::marks::{Glyph, glyph};

use super::{Generator, Metres, Sketch, Slots, Surface};
use crate::sign::Arrow;

/// Depth of the letters in front of their board, metres.
const RELIEF: f32 = 0.004;
/// Height of the row of an arrow, in lines of text.
const ARROW_ROW: f32 = 1.6;
/// Length and height of an arrow, in lines of text; the reverse of one that points up or down.
const ARROW_SIZE: [f32; 2] = [2.1, 1.3];

/// A text of one to four lines of at most 40 printable characters each, separated by `\n`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Text(Vec<String>);

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let lines: Vec<String> = text.split('\n').map(str::to_owned).collect();
        let fits = |line: &String| line.chars().count() <= 40 && line.chars().all(|c| glyph(c).is_some());
        if lines.len() <= 4 && lines.iter().all(fits) && lines.iter().any(|l| !l.trim().is_empty()) {
            Ok(Self(lines))
        } else {
            Err(serde::de::Error::custom(format!(
                "a sign must have one to four lines of at most 40 characters available in the font, not {text:?}"
            )))
        }
    }
}

/// What can be read on the front of an object, in its own frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Writing {
    /// The text, lines separated by `\n`; empty for an arrow alone.
    pub(crate) text: String,
    /// An arrow, as its reader sees it.
    pub(crate) arrow: Option<Arrow>,
    /// The middle of the writing on the front.
    pub(crate) centre: Vec3,
    /// Height of a capital letter, or of the arrow where there is no text, metres.
    pub(crate) letter: f32,
    /// Area of the board, or of the strokes where there is none, square metres.
    pub(crate) area: f32,
    /// Whether the back shows the same.
    pub(crate) double: bool,
}

/// The keys of a sign.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    text: Option<Text>,
    arrow: Option<Arrow>,
    letter: Metres,
    #[serde(default = "yes")]
    board: bool,
    #[serde(default)]
    double: bool,
    posts: Option<Metres>,
    thickness: Option<Metres>,
}

const fn yes() -> bool {
    true
}

/// A board with a text, an arrow or both, read from the front. It stands on its position: on the ground with posts, else as it
/// hangs. Without a board, only the strokes, on a wall behind them.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Raw")]
pub(crate) struct Sign {
    lines: Vec<String>,
    arrow: Option<Arrow>,
    /// Height of a line of text; capitals fill about six tenths of it.
    line: f32,
    board: bool,
    /// Whether the text stands on both sides.
    double: bool,
    /// Height of the posts that carry it.
    posts: Option<f32>,
    thickness: f32,
}

/// Usual thickness of a board, metres.
const THICKNESS: f32 = 0.03;

impl TryFrom<Raw> for Sign {
    type Error = &'static str;

    fn try_from(raw: Raw) -> Result<Self, Self::Error> {
        if raw.text.is_none() && raw.arrow.is_none() {
            return Err("a sign needs `text`, `arrow` or both");
        }
        if !raw.board && (raw.double || raw.posts.is_some() || raw.thickness.is_some()) {
            return Err("a sign without a board cannot have `double`, `posts` or `thickness`");
        }
        Ok(Self {
            lines: raw.text.map_or_else(Vec::new, |text| text.0),
            arrow: raw.arrow,
            line: raw.letter.0,
            board: raw.board,
            double: raw.double,
            posts: raw.posts.map(|posts| posts.0),
            thickness: raw.thickness.map_or(THICKNESS, |thickness| thickness.0),
        })
    }
}

impl Sign {
    /// Width and height of the board, or of the area that one would have.
    fn size(&self) -> Vec2 {
        let count = self.lines.iter().map(|l| l.chars().count()).max().unwrap_or(1);
        let (mut width, mut rows) = (0.5 * count as f32 + 0.5, self.lines.len() as f32 + 0.3);
        if self.arrow.is_some() {
            width = width.max(ARROW_SIZE[0] + 0.5);
            rows +=
                ARROW_ROW + if matches!(self.arrow, Some(Arrow::Up | Arrow::Down)) { ARROW_SIZE[0] - ARROW_SIZE[1] } else { 0.0 };
        }
        Vec2::new(self.line * width, self.line * rows)
    }

    /// Half the depth of the board, which is how far in front of the centre plane the strokes are drawn.
    fn face(&self) -> f32 {
        if self.board { 0.5 * self.thickness } else { 0.0 }
    }

    fn foot(&self) -> f32 {
        self.posts.unwrap_or(0.0)
    }

    /// The letters and the arrow of the front.
    fn strokes(&self) -> Sketch {
        let (height, line) = (self.size().y, self.line);
        let mut strokes = Sketch::default();
        for (i, text) in self.lines.iter().enumerate() {
            let bottom = self.foot() + height - line * (i as f32 + 1.15);
            write(strokes.on("letter"), text, Vec3::new(0.0, self.face(), bottom), line);
        }
        if let Some(arrow) = self.arrow {
            let below = height - line * (self.lines.len() as f32 + 0.15);
            strokes.on("letter").face(&arrow_shape(arrow, Vec3::new(0.0, self.face() + RELIEF, self.foot() + 0.5 * below), line));
        }
        strokes
    }

    fn draw_board(&self, sketch: &mut Sketch) {
        let (line, thick, foot) = (self.line, self.thickness, self.foot());
        let (width, height) = self.size().into();
        let rim = 0.05 * line;
        // Without posts it is nothing but its board.
        let board = if self.posts.is_some() { sketch.part("board") } else { 0 };
        sketch.on("board").block(Vec3::Z * (foot + rim), Vec3::new(width - 2.0 * rim, thick, height - 2.0 * rim));
        let (w, h) = (0.5 * width, height);
        for (low, high) in
            [((-w, 0.0), (w, rim)), ((-w, h - rim), (w, h)), ((-w, rim), (rim - w, h - rim)), ((w - rim, rim), (w, h - rim))]
        {
            let deep = 0.5 * thick + 0.004;
            let corner = |(x, z): (f32, f32), y: f32| Vec3::new(x, y, z + foot);
            sketch.on("rim").cuboid(corner(low, -deep), corner(high, deep));
        }
        if self.posts.is_some() {
            for x in if width > 0.8 { vec![-0.35 * width, 0.35 * width] } else { vec![0.0] } {
                let back = Vec3::new(x, -0.5 * thick - 0.025, 0.0);
                sketch.part("post");
                sketch.on("post").rod(back, back + Vec3::Z * (foot + 0.9 * height), 0.025, 0.025, 10);
            }
        }
        // The letters are on it.
        sketch.resume(board);
    }
}

impl Generator for Sign {
    fn slots(&self) -> Slots {
        &[("board", "cab_white"), ("letter", "black_trim"), ("rim", "black_trim"), ("post", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        if self.board {
            self.draw_board(sketch);
        }
        let strokes = self.strokes();
        sketch.append(&strokes, 0.0, Vec3::ZERO);
        if self.double {
            sketch.append(&strokes, core::f64::consts::PI, Vec3::ZERO);
        }
    }

    fn writing(&self) -> Option<Writing> {
        let size = self.size();
        let area = if self.board { size.x * size.y } else { self.strokes().surfaces.iter().map(Surface::area).sum() };
        Some(Writing {
            text: self.lines.join("\n"),
            arrow: self.arrow,
            centre: Vec3::new(0.0, self.face(), self.foot() + 0.5 * size.y),
            letter: self.line * if self.lines.is_empty() { ARROW_SIZE[1] } else { capital() },
            area,
            double: self.double,
        })
    }
}

/// Height of a capital letter as a fraction of a line.
fn capital() -> f32 {
    glyph('H').map_or(0.6, |glyph| bold(&glyph).into_iter().filter(|row| *row != 0).count() as f32 / glyph.height() as f32)
}

/// The corners of an arrow in a wall that faces forward, about `centre`, counter-clockwise as seen from the front. What its
/// reader
/// has on the left is +x.
fn arrow_shape(arrow: Arrow, centre: Vec3, line: f32) -> Vec<Vec3> {
    let [long, high] = ARROW_SIZE.map(|side| 0.5 * line * side);
    let (shaft, neck) = (0.36 * high, long - 1.2 * high);
    // Along and across the arrow, counter-clockwise with across 90° counter-clockwise of along.
    let corners = [(-long, -shaft), (neck, -shaft), (neck, -high), (long, 0.0), (neck, high), (neck, shaft), (-long, shaft)];
    let (along, across) = match arrow {
        Arrow::Right => (Vec3::NEG_X, Vec3::Z),
        Arrow::Left => (Vec3::X, Vec3::NEG_Z),
        Arrow::Up => (Vec3::Z, Vec3::X),
        Arrow::Down => (Vec3::NEG_Z, Vec3::NEG_X),
    };
    corners.into_iter().map(|(a, b)| centre + along * a + across * b).collect()
}

/// A line of text `height` high, centred about x = 0, on a wall that faces forward; `at` is the middle of its base.
/// Seen from the front, the text runs from +x to −x.
pub(super) fn write(surface: &mut Surface, text: &str, at: Vec3, height: f32) {
    let advance = 0.5 * height;
    let start = 0.5 * advance * text.chars().count() as f32;
    for (i, character) in text.chars().enumerate() {
        let Some(glyph) = glyph(character) else { continue };
        let pixel = height / glyph.height() as f32;
        let left = at.x + start - advance * i as f32;
        for block in blocks(&glyph) {
            let x = |column: u32| left - column as f32 * pixel;
            let z = |row: u32| at.z + height - row as f32 * pixel;
            let at = |column: u32, row: u32| Vec3::new(x(column), at.y + RELIEF, z(row));
            let Block { left, right, top, bottom } = block;
            surface.face(&[at(left, bottom), at(right, bottom), at(right, top), at(left, top)]);
        }
    }
}

/// A rectangle of set pixels: left and top inclusive, right and bottom exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Block {
    left: u32,
    right: u32,
    top: u32,
    bottom: u32,
}

/// The pixels of a glyph as few rectangles: equal runs in successive rows are merged.
fn blocks(glyph: &Glyph<'_>) -> Vec<Block> {
    let mut done: Vec<Block> = Vec::new();
    let mut open: Vec<Block> = Vec::new();
    for (row, bits) in bold(glyph).into_iter().enumerate() {
        let row = row as u32;
        let runs = runs(bits, glyph.width());
        let (kept, ended): (Vec<Block>, Vec<Block>) = open.into_iter().partition(|b| runs.contains(&(b.left, b.right)));
        done.extend(ended);
        let fresh = runs.iter().filter(|&&(left, right)| !kept.iter().any(|b| (b.left, b.right) == (left, right)));
        let fresh = fresh.map(|&(left, right)| Block { left, right, top: row, bottom: row });
        open = kept.iter().copied().chain(fresh).map(|b| Block { bottom: row + 1, ..b }).collect();
    }
    done.extend(open);
    done
}

/// The rows of a glyph with strokes twice as wide: the font's own are a sixteenth of its height, too thin to be read
/// from afar.
fn bold(glyph: &Glyph<'_>) -> Vec<u32> {
    let rows: Vec<u32> = glyph.rows().collect();
    let kept = (1u64 << glyph.width()) - 1;
    let wide = |bits: u32| (-2i32..=2).fold(0u64, |all, by| all | (u64::from(bits) << 2) >> (2 + by)) & kept;
    (0..rows.len())
        .map(|row| rows[row.saturating_sub(2)..(row + 3).min(rows.len())].iter().fold(0, |all, &bits| all | wide(bits) as u32))
        .collect()
}

/// Runs of set pixels in a row, the left pixel in the highest bit: first pixel, and the one after the last.
fn runs(bits: u32, width: u32) -> Vec<(u32, u32)> {
    let set = |column: u32| column < width && bits >> (width - 1 - column) & 1 == 1;
    let starts = (0..width).filter(|&c| set(c) && (c == 0 || !set(c - 1)));
    starts.map(|start| (start, (start..=width).find(|&c| !set(c)).unwrap_or(width))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_cover_each_pixel_of_a_glyph_once() {
        for character in ('!'..='~').chain(['É', 'ö']) {
            let glyph = glyph(character).unwrap();
            let blocks = blocks(&glyph);
            for (row, bits) in bold(&glyph).into_iter().enumerate() {
                for column in 0..glyph.width() {
                    let row = row as u32;
                    let inside = |b: &&Block| (b.left..b.right).contains(&column) && (b.top..b.bottom).contains(&row);
                    let expected = usize::from(bits >> (glyph.width() - 1 - column) & 1 == 1);
                    assert_eq!(blocks.iter().filter(inside).count(), expected, "{character} at {column}, {row}");
                }
            }
            assert!(blocks.len() <= 70, "{character}: {}", blocks.len());
        }
    }

    #[test]
    fn texts_are_bounded() {
        let read = |text: &str| toml::from_str::<Sign>(&format!("text = {text:?}\nletter = 0.2"));
        assert!(read("EXIT").is_ok() && read("A\nB").is_ok());
        for wrong in ["", "   ", "a\nb\nc\nd\ne", "漢", &"x".repeat(41)] {
            assert!(read(wrong).unwrap_err().to_string().contains("one to four lines"), "{wrong:?}");
        }
    }

    #[test]
    fn a_sign_says_something_and_paint_has_no_posts() {
        let read = |keys: &str| toml::from_str::<Sign>(&format!("letter = 0.2\n{keys}")).map_err(|e| e.to_string());
        assert!(read("").unwrap_err().contains("`text`, `arrow` or both"));
        for keys in ["double = true", "posts = 1.0", "thickness = 0.02"] {
            assert!(read(&format!("text = \"A\"\nboard = false\n{keys}")).unwrap_err().contains("without a board"), "{keys}");
        }
        assert!(read("arrow = \"north\"").unwrap_err().contains("unknown variant `north`"));
        let painted = read("arrow = \"up\"\nboard = false").unwrap();
        let slots: Vec<_> = painted.strokes().surfaces.iter().map(|surface| surface.slot).collect();
        assert_eq!((slots, painted.writing().unwrap().text.as_str()), (vec!["letter"], ""));
    }

    #[test]
    fn an_arrow_points_where_its_reader_sees_it_point() {
        // The reader looks along −y: +x is on the left.
        let tip = |arrow| {
            let corners = arrow_shape(arrow, Vec3::ZERO, 1.0);
            let normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]);
            assert!(normal.y > 0.0, "{arrow:?} faces its reader");
            corners[3].round()
        };
        assert_eq!([Arrow::Left, Arrow::Right, Arrow::Up, Arrow::Down].map(tip), [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z]);
    }

    #[test]
    fn capitals_fill_six_tenths_of_a_line() {
        assert!((0.55..0.72).contains(&capital()), "{}", capital());
        let sign: Sign = toml::from_str("text = \"LAND\\nHERE\"\nletter = 0.5\nposts = 1.0").unwrap();
        let writing = sign.writing().unwrap();
        // Four letters of half a line and half a line of margin; two lines and three tenths.
        assert!((writing.area - 0.5 * 2.5 * 0.5 * 2.3).abs() < 1e-5, "{}", writing.area);
        assert!((writing.centre - Vec3::new(0.0, 0.015, 1.0 + 0.575)).length() < 1e-5, "{}", writing.centre);
        assert_eq!(writing.text, "LAND\nHERE");
    }
}
