//! `spf sim`: the embedded simulator by itself.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use spf_core::geometry::Pose;
use spf_media::{frame::Rgb, png};
use spf_sim::model::{CraftKind, Model};
use spf_sim::render::{Channels, Picture};

use crate::args::Render;
use crate::commands::{load_stage, parse_pose};
use crate::error::{CliError, nearest};
use crate::exit::Exit;
use crate::printer::Printer;

/// Sides of a picture, pixels.
const SIZES: std::ops::RangeInclusive<u32> = 16..=8192;

/// Draws a scene from a pose.
pub(crate) fn render(args: &Render, printer: &Printer) -> Result<Exit, CliError> {
    let pose = args.pose.as_deref().map(parse_pose).transpose();
    let pose = pose.map_err(|expected| {
        CliError::usage(format!("--pose: `{}` is not {expected}", args.pose.as_deref().unwrap_or_default()))
            .hint("for example --pose 0,0,3,90,-10: the origin, 3 m up, looking east and 10 degrees down")
    })?;
    let size = args.size.as_deref().map(parse_size).transpose()?;
    let kind = args.drone_model.as_deref().map(parse_kind).transpose()?;
    let legend = args.ids.as_ref().map(|path| path.with_extension("json"));
    distinct(args, legend.as_ref())?;
    let stage = load_stage(&args.scene)?;
    let kind = kind.unwrap_or(stage.scene.default_craft);
    let pose = pose.unwrap_or_else(|| above_start(stage.scene.start, kind));
    let camera = kind.camera();
    let camera = size.map_or(camera, |(width, height)| camera.resized(width, height));
    let channels = Channels { rgb: true, depth: args.depth.is_some(), ids: args.ids.is_some(), ..Channels::default() };
    let picture = stage.renderer.render(&camera, &pose, channels);
    let mut written = vec![args.output.as_path()];
    write(&args.output, &colour(&picture)?)?;
    if let (Some(path), Some(depth)) = (&args.depth, &picture.depth) {
        let centimetres: Vec<u16> = depth.iter().map(|metres| centimetres(*metres)).collect();
        write(path, &grey(&picture, &centimetres)?)?;
        written.push(path);
    }
    if let (Some(path), Some(ids), Some(legend)) = (&args.ids, &picture.ids, &legend) {
        write(path, &grey(&picture, ids)?)?;
        write(legend, format!("{:#}\n", stage.scene.legend_json()).as_bytes())?;
        written.extend([path.as_path(), legend.as_path()]);
    }
    for path in written {
        printer.result(&path.display().to_string());
    }
    Ok(Exit::Success)
}

/// No picture is to overwrite another.
fn distinct(args: &Render, legend: Option<&PathBuf>) -> Result<(), CliError> {
    let paths: Vec<&PathBuf> =
        [Some(&args.output), args.depth.as_ref(), args.ids.as_ref(), legend].into_iter().flatten().collect();
    match paths.iter().enumerate().find(|(index, path)| paths[..*index].contains(path)) {
        None => Ok(()),
        Some((_, path)) => Err(CliError::usage(format!("`{}` would be written twice", path.display()))
            .hint("give picture, depth and ids a file each; the legend of the ids takes their name with `.json`")),
    }
}

/// The start is on the ground; a picture from there shows mostly ground.
fn above_start(mut start: Pose, kind: CraftKind) -> Pose {
    start.position.up += Model::of(kind).craft.take_off_height;
    start
}

/// 16-bit depth: 0 is none or beyond 655 m.
fn centimetres(metres: f32) -> u16 {
    let centimetres = (metres * 100.0).round();
    if (1.0..=65_535.0).contains(&centimetres) { centimetres as u16 } else { 0 }
}

fn colour(picture: &Picture) -> Result<Vec<u8>, CliError> {
    let data = picture.rgb.clone().unwrap_or_default();
    let rgb = Rgb::from_raw(picture.width, picture.height, data)
        .map_err(|error| CliError::internal("no picture was drawn").because(&error))?;
    png::encode(&rgb).map_err(|error| CliError::internal("the picture cannot be encoded").because(&error))
}

fn grey(picture: &Picture, pixels: &[u16]) -> Result<Vec<u8>, CliError> {
    png::encode_grey16(picture.width, picture.height, pixels)
        .map_err(|error| CliError::internal("the picture cannot be encoded").because(&error))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    std::fs::write(path, bytes).map_err(|error| {
        let what = format!("cannot write `{}`", path.display());
        match error.kind() {
            // A full disk is nobody's wrong usage; a folder that is not there is.
            ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::IsADirectory | ErrorKind::PermissionDenied => {
                CliError::usage(what).because(&error).hint("name a file in a folder that exists and can be written to")
            }
            _ => CliError::internal(what).because(&error),
        }
    })
}

fn parse_size(text: &str) -> Result<(u32, u32), CliError> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse::<u32>().ok()?, h.parse::<u32>().ok()?)));
    sides.filter(|(w, h)| SIZES.contains(w) && SIZES.contains(h)).ok_or_else(|| {
        CliError::usage(format!("--size: `{text}` is not a size"))
            .hint("WIDTHxHEIGHT in pixels, each from 16 to 8192, for example 960x720")
    })
}

fn parse_kind(text: &str) -> Result<CraftKind, CliError> {
    CraftKind::from_name(text).ok_or_else(|| {
        let error = CliError::usage(format!("--drone-model: `{text}` is not quad or tello"));
        match nearest(text, ["quad", "tello"]) {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error.hint("the camera of this craft is used: quad or tello"),
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
