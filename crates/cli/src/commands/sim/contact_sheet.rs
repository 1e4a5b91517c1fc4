//! The contact sheet: thumbnails of scenes under every light and weather, and of variants, in one image.

use spf_media::frame::Rgb;
use spf_media::marks::{Canvas, Colour, Point, TextStyle};
use spf_media::resize::resize;
use spf_render::Channels;
use spf_scene::{Lighting, SceneLook, Weather};

use crate::commands::load_scene;
use crate::error::CliError;

/// A small image.
const THUMB: (u32, u32) = (240, 180);
/// Rendered at this multiple of the size and scaled down.
const FINER: u32 = 2;
/// Spacing between thumbnails, and around a scene's block.
const GAP: u32 = 4;
const MARGIN: u32 = 16;
/// Height of a block's title.
const TITLE: u32 = 26;
/// Blocks side by side.
const COLUMNS: u32 = 2;
const PAPER: [u8; 3] = [22, 25, 31];

/// A variant of a scene is shown once, under its own conditions.
const SINGLE: (u32, u32) = (288, 216);
/// Variants side by side if there is nothing else on the sheet.
const SINGLES: u32 = 4;

/// One block per scene, one row per weather, one column per light; below them one image per variant (`city@17`).
/// `progress` receives each name before rendering.
pub(super) fn draw(names: &[String], mut progress: impl FnMut(&str)) -> Result<Rgb, CliError> {
    let (variants, scenes): (Vec<&String>, Vec<&String>) = names.iter().partition(|name| is_variant(name));
    let (lights, weathers) = (Lighting::ALL.len() as u32, Weather::ALL.len() as u32);
    let block = (lights * (THUMB.0 + GAP) - GAP + MARGIN, TITLE + weathers * (THUMB.1 + GAP) - GAP + MARGIN);
    let (step, count) = ((SINGLE.0 + GAP, SINGLE.1 + GAP), scenes.len() as u32);
    let columns = count.min(COLUMNS);
    let width = if count > 0 { columns * block.0 } else { SINGLES.min(variants.len() as u32) * step.0 - GAP + MARGIN };
    let singles = ((width - MARGIN + GAP) / step.0).max(1);
    let (blocks, rows) = (count.div_ceil(COLUMNS) * block.1, (variants.len() as u32).div_ceil(singles));
    let below = if rows > 0 { rows * step.1 - GAP + MARGIN } else { 0 };
    let mut sheet = Rgb::filled(width + MARGIN, MARGIN + blocks + below, PAPER);
    for (index, name) in (0..).zip(scenes) {
        progress(&format!("Rendering {name} in every light and weather."));
        let corner = (MARGIN + index % COLUMNS * block.0, MARGIN + index / COLUMNS * block.1);
        draw_block(&mut sheet, name, corner, block.0 - MARGIN)?;
    }
    for (index, name) in (0..).zip(variants) {
        progress(&format!("Rendering {name}."));
        let at = (MARGIN + index % singles * step.0, MARGIN + blocks + index / singles * step.1);
        let (_, image) = thumb(name, &SceneLook::default(), SINGLE)?;
        paste(&mut sheet, &image, at);
        label(&mut sheet, name, (at.0, at.1 + SINGLE.1 - 16));
    }
    Ok(sheet)
}

/// Whether a scene's name has a seed.
fn is_variant(name: &str) -> bool {
    name.rsplit_once('@').is_some_and(|(_, seed)| !seed.is_empty() && seed.bytes().all(|b| b.is_ascii_digit()))
}

/// A scene under every light and weather, below its title.
fn draw_block(sheet: &mut Rgb, name: &str, corner: (u32, u32), width: u32) -> Result<(), CliError> {
    for (row, weather) in (0..).zip(Weather::ALL) {
        for (column, lighting) in (0..).zip(Lighting::ALL) {
            let conditions = SceneLook { lighting: Some(lighting), weather: Some(weather) };
            let at = (corner.0 + column * (THUMB.0 + GAP), corner.1 + TITLE + row * (THUMB.1 + GAP));
            let (title, image) = thumb(name, &conditions, THUMB)?;
            paste(sheet, &image, at);
            label(sheet, &format!("{}, {}", lighting.name(), weather.name()), (at.0, at.1 + THUMB.1 - 16));
            if (row, column) == (0, 0) {
                let style = TextStyle::plain(16.0, Colour::WHITE);
                Canvas::new(sheet).text(point(corner), &style.fitted(&title, f64::from(width)), style);
            }
        }
    }
    Ok(())
}

fn label(sheet: &mut Rgb, words: &str, at: (u32, u32)) {
    let small = TextStyle::plain(12.0, Colour::WHITE);
    Canvas::new(sheet).label(point(at), words, small, Colour::INK.with_opacity(150));
}

fn point((x, y): (u32, u32)) -> Point {
    Point::new(f64::from(x), f64::from(y))
}

/// A scene's title and its preview under these conditions.
fn thumb(name: &str, conditions: &SceneLook, (width, height): (u32, u32)) -> Result<(String, Rgb), CliError> {
    let loaded = load_scene(name, conditions)?;
    let scene = &loaded.scene;
    let camera = scene.default_craft.camera().resized(width * FINER, height * FINER);
    let image = loaded.render(&camera, &loaded.initial_snapshot(scene.preview), Channels::RGB);
    let rgb = Rgb::from_raw(image.width, image.height, image.rgb.unwrap_or_default())
        .map_err(|error| CliError::internal("cannot render the image").because(&error))?;
    let title = if scene.description.is_empty() { scene.name.clone() } else { format!("{}: {}", scene.name, scene.description) };
    Ok((title, resize(&rgb, width, height)))
}

/// Copies an image into another, with its upper left corner at a position.
fn paste(sheet: &mut Rgb, image: &Rgb, (left, top): (u32, u32)) {
    let (width, row) = (sheet.width() as usize * 3, image.width() as usize * 3);
    let data = sheet.data_mut();
    for (y, line) in (top as usize..).zip(image.data().chunks_exact(row)) {
        let start = y * width + left as usize * 3;
        data[start..start + row].copy_from_slice(line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variant_is_known_by_its_seed() {
        assert!(is_variant("city@17") && is_variant("a@b/yard.toml@0"));
        assert!(!is_variant("city") && !is_variant("a@b/yard.toml") && !is_variant("city@"));
    }

    #[test]
    fn an_image_is_pasted_where_it_belongs() {
        let mut sheet = Rgb::new(6, 5);
        paste(&mut sheet, &Rgb::filled(2, 3, [9; 3]), (3, 1));
        for (x, y, value) in [(3, 1, 9), (4, 3, 9), (2, 1, 0), (5, 3, 0), (3, 0, 0), (4, 4, 0)] {
            assert_eq!(sheet.pixel(x, y), Some([value; 3]), "{x} {y}");
        }
    }
}
