//! `spf sim render`: an image of a scene from a pose.

use std::path::PathBuf;

use spf_core::geometry::{Attitude, BodyDisplacement, Pose, wrap_angle};
use spf_core::time::Time;
use spf_media::jpeg::EncodeError;
use spf_media::png;
use spf_render::effects::SimCamera;
use spf_render::{Channels, RenderedImage};
use spf_scene::Scene;

use super::{above_start, centimetres, conditions, parse_effects, parse_kind, parse_size, write};
use crate::args::Render;
use crate::commands::{load_scene, parse_pose};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Renders a scene from a pose.
pub(super) fn render(args: &Render, printer: &Printer) -> Result<Exit, CliError> {
    let pose = args.pose.as_deref().map(parse_pose).transpose();
    let pose = pose.map_err(|expected| {
        CliError::usage(format!("--pose: expected {expected}, found `{}`", args.pose.as_deref().unwrap_or_default()))
            .hint("for example --pose 0,0,3,90,-10: the origin, 3 m up, looking east and 10 degrees down")
    })?;
    let size = args.size.as_deref().map(parse_size).transpose()?;
    let kind = args.drone_model.as_deref().map(parse_kind).transpose()?;
    let legend = args.ids.as_ref().map(|path| path.with_extension("json"));
    let effects = args.camera_effects.as_deref().map(parse_effects).transpose()?.unwrap_or_default();
    let motion = args.moving.as_deref().map(parse_motion).transpose()?.unwrap_or_default();
    distinct(args, legend.as_ref())?;
    let conditions = conditions(&args.conditions)?;
    let loaded = load_scene(&args.scene, &conditions)?;
    let kind = kind.unwrap_or(loaded.scene.default_craft);
    let pose = pose.unwrap_or_else(|| above_start(loaded.scene.start, kind));
    warn_outside(&loaded.scene, pose, printer);
    let camera = size.map_or(kind.camera(), |(width, height)| kind.camera().resized(width, height));
    let sim_camera = SimCamera::new(camera, effects, 0);
    let shot = sim_camera.shot(CAPTURE, |at| Some(motion.pose(&pose, at)));
    let shot = shot.ok_or_else(|| CliError::internal("cannot compute the motion blur: a pose is missing"))?;
    let photograph = sim_camera.photograph(&shot, None, |camera, pose, image| {
        loaded.render_into(camera, &loaded.initial_snapshot(*pose), Channels::RGB, image);
    });
    let channels = Channels { depth: args.depth.is_some(), ids: args.ids.is_some(), ..Channels::default() };
    let mut image = RenderedImage::default();
    sim_camera.look(sim_camera.camera(), &mut image, |camera, image| {
        loaded.render_into(camera, &loaded.initial_snapshot(pose), channels, image);
    });
    let mut written = vec![args.output.as_path()];
    write(&args.output, &encoded(png::encode(&photograph))?)?;
    if let (Some(path), Some(depth)) = (&args.depth, &image.depth) {
        let centimetres: Vec<u16> = depth.iter().map(|metres| centimetres(*metres)).collect();
        write(path, &grey(&image, &centimetres)?)?;
        written.push(path);
    }
    if let (Some(path), Some(ids), Some(legend)) = (&args.ids, &image.ids, &legend) {
        write(path, &grey(&image, ids)?)?;
        write(legend, format!("{:#}\n", loaded.scene.legend_json()).as_bytes())?;
        written.extend([path.as_path(), legend.as_path()]);
    }
    for path in written {
        printer.result(&path.display().to_string());
    }
    Ok(Exit::Success)
}

/// An image from outside shows little but the sky: most likely a mistaken coordinate.
fn warn_outside(scene: &Scene, pose: Pose, printer: &Printer) {
    if !scene.bounds.contains(pose.position) {
        let (min, max) = (scene.bounds.min, scene.bounds.max);
        printer.log(&format!(
            "warning: the pose is outside {}: east {:.0} to {:.0} m, north {:.0} to {:.0} m, up {:.0} to {:.0} m",
            scene.name, min.east, max.east, min.north, max.north, min.up, max.up
        ));
    }
}

/// No image may overwrite another.
fn distinct(args: &Render, legend: Option<&PathBuf>) -> Result<(), CliError> {
    let paths: Vec<&PathBuf> =
        [Some(&args.output), args.depth.as_ref(), args.ids.as_ref(), legend].into_iter().flatten().collect();
    match paths.iter().enumerate().find(|(index, path)| paths[..*index].contains(path)) {
        None => Ok(()),
        Some((_, path)) => Err(CliError::usage(format!("`{}` is given for two outputs", path.display()))
            .hint("use a different file for the image, depth and IDs; the ID legend is written next to the IDs, as `.json`")),
    }
}

fn grey(image: &RenderedImage, pixels: &[u16]) -> Result<Vec<u8>, CliError> {
    encoded(png::encode_grey16(image.width, image.height, pixels))
}

fn encoded(file: Result<Vec<u8>, EncodeError>) -> Result<Vec<u8>, CliError> {
    file.map_err(|error| CliError::internal("cannot encode the image").because(&error))
}

/// A time at which a complete exposure is available.
const CAPTURE: Time = Time::from_millis(1000);

/// A steady motion, for motion blur.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    /// Metres per second along the body.
    along: BodyDisplacement,
    /// Radians per second, clockwise.
    yaw: f64,
}

impl Motion {
    /// Pose of the craft at `at`, if its pose at the capture is `pose`.
    fn pose(&self, pose: &Pose, at: Time) -> Pose {
        let seconds = at.as_secs_f64() - CAPTURE.as_secs_f64();
        let BodyDisplacement { right, forward, up } = self.along;
        let moved = BodyDisplacement { right: right * seconds, forward: forward * seconds, up: up * seconds };
        let heading = wrap_angle(pose.attitude.heading + self.yaw * seconds);
        Pose { position: pose.position.displaced(moved, pose.attitude.heading), attitude: Attitude { heading, ..pose.attitude } }
    }
}

/// `forward,right,up,yaw`; omitted values are 0.
fn parse_motion(text: &str) -> Result<Motion, CliError> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.len() <= 4 && numbers.iter().all(|number: &f64| number.abs() <= 1000.0));
    let Some(numbers) = numbers else {
        return Err(CliError::usage(format!("--moving: expected a velocity, found `{text}`"))
            .hint("forward,right,up,yaw in m/s and degrees/s, for example --moving 3,0,0,90"));
    };
    let number = |index: usize| numbers.get(index).copied().unwrap_or(0.0);
    let along = BodyDisplacement { forward: number(0), right: number(1), up: number(2) };
    Ok(Motion { along, yaw: number(3).to_radians() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_motion_is_finite_or_refused(text in "[-+0-9.,einfa ]{0,40}|.{0,40}") {
            if let Ok(motion) = parse_motion(&text) {
                let pose = motion.pose(&Pose::default(), Time::ZERO);
                prop_assert!(pose.position.east.is_finite() && pose.attitude.heading.abs() <= core::f64::consts::PI);
            }
        }
    }
}
