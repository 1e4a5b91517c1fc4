//! `spf sim`: direct use of the embedded simulator.

mod contact_sheet;
pub(crate) mod dataset;
mod objects;
mod render;
mod say;
mod scenes;
mod serve;
mod view;
mod window;

use std::io::ErrorKind;
use std::path::Path;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_drone::registry::alternatives;
use spf_media::{frame::Rgb, png};
use spf_render::RenderedImage;
use spf_render::effects::{Effects, EffectsError};
use spf_scene::{Lighting, SceneLook, Weather};
use spf_sim::model::Model;

use crate::args::{ConditionArgs, Sim};
use crate::error::{CliError, nearest};
use crate::exit::Exit;
use crate::printer::Printer;

/// Sides of an image, pixels.
const SIZES: std::ops::RangeInclusive<u32> = 16..=8192;

/// Runs one of the simulator commands.
pub(crate) fn sim(command: &Sim, printer: &mut Printer) -> Result<Exit, CliError> {
    match command {
        Sim::Render(args) => render::render(args, printer),
        Sim::Scenes(args) => scenes::scenes(args, printer),
        Sim::View(args) => view::view(args, printer),
        Sim::Window(args) => window::window(args, printer),
        Sim::Serve(args) => serve::serve(args, printer),
        Sim::Dataset(args) => dataset::dataset(args, printer),
    }
}

/// The start is on the ground; an image from there shows mostly ground.
pub(super) fn above_start(mut start: Pose, kind: CraftKind) -> Pose {
    start.position.up += Model::of(kind).craft.take_off_height;
    start
}

/// The colour image as a PNG file.
pub(super) fn colour(image: &RenderedImage) -> Result<Vec<u8>, CliError> {
    let data = image.rgb.clone().unwrap_or_default();
    let rgb = Rgb::from_raw(image.width, image.height, data)
        .map_err(|error| CliError::internal("cannot render the image").because(&error))?;
    png::encode(&rgb).map_err(|error| CliError::internal("cannot encode the image").because(&error))
}

/// Writes a file, with its path in errors.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    std::fs::write(path, bytes).map_err(|error| {
        let what = format!("cannot write `{}`", path.display());
        match error.kind() {
            // A full disk is not a usage error; a missing folder is.
            ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::IsADirectory | ErrorKind::PermissionDenied => {
                CliError::usage(what).because(&error).hint("give a file in an existing, writable folder")
            }
            _ => CliError::internal(what).because(&error),
        }
    })
}

/// 16-bit depth: 0 is none or beyond 655 m.
pub(super) fn centimetres(metres: f32) -> u16 {
    let centimetres = (metres * 100.0).round();
    if (1.0..=65_535.0).contains(&centimetres) { centimetres as u16 } else { 0 }
}

/// A list of camera effects.
pub(super) fn parse_effects(text: &str) -> Result<Effects, CliError> {
    text.parse().map_err(|error: EffectsError| {
        CliError::usage(format!("--camera-effects: expected a list of camera effects, found `{text}`")).because(&error).hint(
            "for example --camera-effects blur=20,noise=5,lens=wide,exposure=-1,compression=jpeg:30 (docs/reference/camera-effects.md)",
        )
    })
}

/// `WIDTHxHEIGHT`.
pub(super) fn parse_size(text: &str) -> Result<(u32, u32), CliError> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse::<u32>().ok()?, h.parse::<u32>().ok()?)));
    sides.filter(|(w, h)| SIZES.contains(w) && SIZES.contains(h)).ok_or_else(|| {
        CliError::usage(format!("--size: expected an image size, found `{text}`"))
            .hint("WIDTHxHEIGHT in pixels, each from 16 to 8192, for example 960x720")
    })
}

/// Requested light and weather.
pub(super) fn conditions(args: &ConditionArgs) -> Result<SceneLook, CliError> {
    let lighting = args.light.as_deref().map(|text| choice("--light", text, &Lighting::ALL.map(|l| (l.name(), l))));
    let weather = args.weather.as_deref().map(|text| choice("--weather", text, &Weather::ALL.map(|w| (w.name(), w))));
    Ok(SceneLook { lighting: lighting.transpose()?, weather: weather.transpose()? })
}

/// One of some words.
fn choice<T: Copy>(flag: &str, text: &str, words: &[(&str, T)]) -> Result<T, CliError> {
    words.iter().find(|(word, _)| *word == text).map(|(_, choice)| *choice).ok_or_else(|| {
        let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        let error = CliError::usage(format!("{flag}: expected {}, found `{text}`", alternatives(&known)));
        match nearest(text, known) {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error.hint("omit it to use the scene's own"),
        }
    })
}

/// `quad` or `tello`.
pub(super) fn parse_kind(text: &str) -> Result<CraftKind, CliError> {
    CraftKind::from_name(text).ok_or_else(|| {
        let error = CliError::usage(format!("--drone-model: expected quad or tello, found `{text}`"));
        match nearest(text, ["quad", "tello"]) {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error.hint("use quad or tello"),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_size_is_in_range_or_refused(text in "[0-9]{0,12}[xX]{0,2}[0-9]{0,12}|.{0,20}") {
            if let Ok((width, height)) = parse_size(&text) {
                prop_assert!(SIZES.contains(&width) && SIZES.contains(&height));
            }
        }

        #[test]
        fn a_size_reads_back(width in SIZES, height in SIZES) {
            prop_assert_eq!(parse_size(&format!("{width}x{height}")).ok(), Some((width, height)));
        }
    }
}
