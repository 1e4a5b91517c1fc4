//! The contact sheet: scenes under every light and weather, small, on one picture.

use spf_media::frame::Rgb;
use spf_media::marks::{Canvas, Colour, Point, TextStyle};
use spf_media::resize::resize;
use spf_sim::render::Channels;
use spf_sim::scene::{Conditions, Lighting, Weather};

use crate::commands::load_stage;
use crate::error::CliError;

/// A small picture.
const THUMB: (u32, u32) = (240, 180);
/// Drawn this many times as large and scaled down.
const FINER: u32 = 2;
/// Between small pictures, and about a scene's block.
const GAP: u32 = 4;
const MARGIN: u32 = 16;
/// Height of a block's title.
const TITLE: u32 = 26;
/// Blocks side by side.
const COLUMNS: u32 = 2;
const PAPER: [u8; 3] = [22, 25, 31];

/// One block a scene, a row a weather, a column a light; `progress` is told each scene before it is drawn.
pub(super) fn draw(names: &[String], mut progress: impl FnMut(&str)) -> Result<Rgb, CliError> {
    let (lights, weathers) = (Lighting::ALL.len() as u32, Weather::ALL.len() as u32);
    let block = (lights * (THUMB.0 + GAP) - GAP + MARGIN, TITLE + weathers * (THUMB.1 + GAP) - GAP + MARGIN);
    let count = names.len() as u32;
    let columns = count.clamp(1, COLUMNS);
    let mut sheet = Rgb::filled(columns * block.0 + MARGIN, count.div_ceil(columns) * block.1 + MARGIN, PAPER);
    for (index, name) in (0..).zip(names) {
        progress(name);
        let corner = (MARGIN + index % columns * block.0, MARGIN + index / columns * block.1);
        for (row, weather) in (0..).zip(Weather::ALL) {
            for (column, lighting) in (0..).zip(Lighting::ALL) {
                let conditions = Conditions { lighting: Some(lighting), weather: Some(weather) };
                let at = (corner.0 + column * (THUMB.0 + GAP), corner.1 + TITLE + row * (THUMB.1 + GAP));
                let (title, thumb) = thumb(name, &conditions)?;
                paste(&mut sheet, &thumb, at);
                let mut canvas = Canvas::new(&mut sheet);
                let place = |(x, y): (u32, u32)| Point::new(f64::from(x), f64::from(y));
                let words = format!("{}, {}", lighting.name(), weather.name());
                let small = TextStyle::plain(12.0, Colour::WHITE);
                canvas.label(place((at.0, at.1 + THUMB.1 - 16)), &words, small, Colour::INK.with_opacity(150));
                if (row, column) == (0, 0) {
                    let style = TextStyle::plain(16.0, Colour::WHITE);
                    canvas.text(place(corner), &style.fitted(&title, f64::from(block.0 - MARGIN)), style);
                }
            }
        }
    }
    Ok(sheet)
}

/// A scene's title and its preview under these conditions.
fn thumb(name: &str, conditions: &Conditions) -> Result<(String, Rgb), CliError> {
    let stage = load_stage(name, conditions)?;
    let scene = &stage.scene;
    let camera = scene.default_craft.camera().resized(THUMB.0 * FINER, THUMB.1 * FINER);
    let picture = stage.render(&camera, &stage.beginning(scene.preview), Channels::RGB);
    let rgb = Rgb::from_raw(picture.width, picture.height, picture.rgb.unwrap_or_default())
        .map_err(|error| CliError::internal("no picture was drawn").because(&error))?;
    let title = if scene.description.is_empty() { scene.name.clone() } else { format!("{}: {}", scene.name, scene.description) };
    Ok((title, resize(&rgb, THUMB.0, THUMB.1)))
}

/// Copies a picture that fits into another, its upper left corner at a place.
fn paste(sheet: &mut Rgb, picture: &Rgb, (left, top): (u32, u32)) {
    let (width, row) = (sheet.width() as usize * 3, picture.width() as usize * 3);
    let data = sheet.data_mut();
    for (y, line) in (top as usize..).zip(picture.data().chunks_exact(row)) {
        let start = y * width + left as usize * 3;
        data[start..start + row].copy_from_slice(line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_pasted_where_it_belongs() {
        let mut sheet = Rgb::new(6, 5);
        paste(&mut sheet, &Rgb::filled(2, 3, [9; 3]), (3, 1));
        for (x, y, value) in [(3, 1, 9), (4, 3, 9), (2, 1, 0), (5, 3, 0), (3, 0, 0), (4, 4, 0)] {
            assert_eq!(sheet.pixel(x, y), Some([value; 3]), "{x} {y}");
        }
    }
}
