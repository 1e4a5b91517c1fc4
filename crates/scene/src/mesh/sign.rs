//! Signs with letters.

use glam::Vec3;
use serde::{Deserialize, Deserializer};
use spf_media::marks::{Glyph, glyph};

use super::{Generator, Metres, Sketch, Slots, Surface};

/// Depth of the letters in front of their board, metres.
const RELIEF: f32 = 0.004;

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

/// A board with a text that is read from the front. With posts its position is on the ground, otherwise at its lower
/// edge.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sign {
    text: Text,
    /// Height of a line of text; capitals fill about six tenths of it.
    letter: Metres,
    /// Whether both sides show the text.
    #[serde(default)]
    double: bool,
    /// Height of the posts.
    posts: Option<Metres>,
    #[serde(default = "usual_thickness")]
    thickness: Metres,
}

const fn usual_thickness() -> Metres {
    Metres(0.03)
}

impl Generator for Sign {
    fn slots(&self) -> Slots {
        &[("board", "cab_white"), ("letter", "black_trim"), ("rim", "black_trim"), ("post", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (line, thick) = (self.letter.0, self.thickness.0);
        let count = self.text.0.iter().map(|l| l.chars().count()).max().unwrap_or(1);
        let (width, height) = (line * (0.5 * count as f32 + 0.5), line * (self.text.0.len() as f32 + 0.3));
        let foot = self.posts.map_or(0.0, |p| p.0);
        let rim = 0.05 * line;
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
                sketch.on("post").rod(back, back + Vec3::Z * (foot + 0.9 * height), 0.025, 0.025, 10);
            }
        }
        let mut letters = Sketch::default();
        for (i, text) in self.text.0.iter().enumerate() {
            let bottom = foot + height - line * (i as f32 + 1.15);
            write(letters.on("letter"), text, Vec3::new(0.0, 0.5 * thick, bottom), line);
        }
        sketch.append(&letters, 0.0, Vec3::ZERO);
        if self.double {
            sketch.append(&letters, core::f64::consts::PI, Vec3::ZERO);
        }
    }
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
}
