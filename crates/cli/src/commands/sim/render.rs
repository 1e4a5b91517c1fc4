//! `spf sim render`: a picture of a scene from a pose.

use std::path::PathBuf;

use spf_media::png;
use spf_sim::render::{Channels, Picture};

use super::{above_start, colour, conditions, parse_kind, parse_size, write};
use crate::args::Render;
use crate::commands::{load_stage, parse_pose};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Draws a scene from a pose.
pub(super) fn render(args: &Render, printer: &Printer) -> Result<Exit, CliError> {
    let pose = args.pose.as_deref().map(parse_pose).transpose();
    let pose = pose.map_err(|expected| {
        CliError::usage(format!("--pose: `{}` is not {expected}", args.pose.as_deref().unwrap_or_default()))
            .hint("for example --pose 0,0,3,90,-10: the origin, 3 m up, looking east and 10 degrees down")
    })?;
    let size = args.size.as_deref().map(parse_size).transpose()?;
    let kind = args.drone_model.as_deref().map(parse_kind).transpose()?;
    let legend = args.ids.as_ref().map(|path| path.with_extension("json"));
    distinct(args, legend.as_ref())?;
    let conditions = conditions(&args.conditions)?;
    let stage = load_stage(&args.scene, &conditions)?;
    let kind = kind.unwrap_or(stage.scene.default_craft);
    let pose = pose.unwrap_or_else(|| above_start(stage.scene.start, kind));
    let camera = kind.camera();
    let camera = size.map_or(camera, |(width, height)| camera.resized(width, height));
    let channels = Channels { rgb: true, depth: args.depth.is_some(), ids: args.ids.is_some(), ..Channels::default() };
    let picture = stage.render(&camera, &stage.beginning(pose), channels);
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

/// 16-bit depth: 0 is none or beyond 655 m.
fn centimetres(metres: f32) -> u16 {
    let centimetres = (metres * 100.0).round();
    if (1.0..=65_535.0).contains(&centimetres) { centimetres as u16 } else { 0 }
}

fn grey(picture: &Picture, pixels: &[u16]) -> Result<Vec<u8>, CliError> {
    png::encode_grey16(picture.width, picture.height, pixels)
        .map_err(|error| CliError::internal("the picture cannot be encoded").because(&error))
}
