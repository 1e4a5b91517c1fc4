//! What is known of distances in a frame, and what the network says at these places.

use spf_core::camera::Camera;
use spf_core::depth::CameraAxes;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::query::ImagePoint;
use spf_core::ranges::{RangeRay, RangeScan};

use super::MonoDepth;
use super::fit::Sample;

/// Nearer than this nothing is used, metres.
const NEAREST: f64 = 0.3;
/// The ground is used up to this distance along the optical axis, metres, and from this slope of the ray downwards (5°): beyond, the
/// error of the pitch is as large as the angle.
const GROUND_REACH: f64 = 15.0;
const GROUND_SLOPE: f64 = 0.0875;
/// Number of cells of the ground that are used.
const GROUND_CELLS: usize = 400;
/// A wider beam tells nothing of a place in the image, radians.
const BEAM: f64 = 0.6;

/// A scan of range sensors, with the pose of the craft when it was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct PastScan {
    /// The scan.
    pub scan: RangeScan,
    /// Pose of the craft.
    pub pose: Pose,
}

/// What is known of distances when a frame was captured.
#[derive(Clone, Copy, Debug)]
pub struct Clues<'a> {
    /// Pose of the camera.
    pub pose: Pose,
    /// Scans of range sensors at about that time.
    pub scans: &'a [PastScan],
    /// Height of the camera above level ground, metres, if it is known.
    pub height: Option<f64>,
}

/// Samples of a source, and the standard deviation of the logarithm of a scale that they share.
pub(super) struct Samples {
    pub(super) samples: Vec<Sample>,
    pub(super) common: f64,
}

impl Clues<'_> {
    fn axes(&self, estimate: &MonoDepth) -> CameraAxes {
        CameraAxes::new(&estimate.camera, self.pose)
    }

    /// Cells below the horizon, as if all of them showed level ground.
    pub(super) fn by_ground(&self, estimate: &MonoDepth) -> Samples {
        let height = self.height.filter(|height| height.is_finite() && *height >= NEAREST);
        let Some(height) = height else { return Samples { samples: Vec::new(), common: f64::INFINITY } };
        let axes = CameraAxes::new(&estimate.camera, Pose { position: EnuPosition::default(), ..self.pose });
        let mut slopes = Vec::new();
        let mut cells = Vec::new();
        for index in 0..estimate.values.len() {
            let Some(value) = estimate.value(index) else { continue };
            let at = centre(&estimate.camera, index);
            let ray = estimate.camera.ray(at);
            let along = axes.place(ray.right, 1.0, ray.up);
            let level = along.horizontal_distance(EnuPosition::default());
            let depth = height / -along.up;
            if -along.up > GROUND_SLOPE * level && (NEAREST..GROUND_REACH).contains(&depth) {
                slopes.push(libm::atan2(-along.up, level));
                cells.push(Sample { value, depth });
            }
        }
        let step = cells.len().div_ceil(GROUND_CELLS).max(1);
        let samples: Vec<Sample> = cells.into_iter().step_by(step).collect();
        slopes.sort_by(f64::total_cmp);
        let slope = slopes.get(slopes.len() / 2).copied().unwrap_or(1.0);
        let common = libm::hypot(GROUND_SD.0 / height + GROUND_SD.1, PITCH_SD / (libm::sin(slope) * libm::cos(slope)));
        Samples { samples, common }
    }

    /// What range sensors have hit in view.
    pub(super) fn by_ranges(&self, estimate: &MonoDepth) -> Samples {
        let axes = self.axes(estimate);
        let camera = &estimate.camera;
        let of_ray = |pose: Pose, ray: &RangeRay| {
            ray.metres.filter(|metres| *metres >= NEAREST)?;
            let end = ray.end(pose, 0.0);
            let (depth, at) = in_image(&axes, camera, end)?;
            // Whatever was hit is the nearest thing within the beam.
            let radius = 0.5 * ray.width * camera.fx;
            let value = nearest(estimate, at, radius)?;
            Some(Sample { value, depth })
        };
        let rays = self.scans.iter().flat_map(|past| past.scan.rays.iter().map(|ray| (past.pose, ray)));
        let samples = rays.filter(|(_, ray)| ray.is_valid() && ray.width <= BEAM).filter_map(|(pose, ray)| of_ray(pose, ray));
        Samples { samples: samples.collect(), common: RANGE_SD }
    }
}

/// Standard deviations, as in `following::standing`: of the height above the ground, metres and as a fraction of it; and of the
/// camera's pitch, radians.
const GROUND_SD: (f64, f64) = (0.2, 0.05);
const PITCH_SD: f64 = 0.02;
/// Standard deviation of the logarithm of a measured range: that the beam has hit something beside what the cell shows.
const RANGE_SD: f64 = 0.1;

/// Depth along the optical axis, and place in the image, of a place in the world.
fn in_image(axes: &CameraAxes, camera: &Camera, place: EnuPosition) -> Option<(f64, ImagePoint)> {
    let seen = axes.look(place);
    let at = camera.project(seen.right, seen.forward, seen.up).filter(|at| at.is_in_image())?;
    (seen.forward >= NEAREST).then_some((seen.forward, at))
}

fn centre(camera: &Camera, index: usize) -> ImagePoint {
    let (width, height) = (camera.width.max(1) as usize, camera.height.max(1));
    let place = |i: usize, of: f64| (i as f64 + 0.5) / of;
    ImagePoint { u: place(index % width, width as f64), v: place(index / width, f64::from(height)) }
}

/// The values within `radius` cells of a place, smallest first.
fn values(estimate: &MonoDepth, at: ImagePoint, radius: f64) -> Vec<f64> {
    let (width, height) = (estimate.camera.width as usize, estimate.camera.height as usize);
    let range = |x: f64, size: usize| {
        let middle = x * size as f64;
        let first = (middle - radius).max(0.0) as usize;
        first..=((middle + radius).max(0.0) as usize).min(size.saturating_sub(1))
    };
    let mut found: Vec<f64> =
        range(at.v, height).flat_map(|y| range(at.u, width).filter_map(move |x| estimate.value(y * width + x))).collect();
    found.sort_by(f64::total_cmp);
    found
}

/// The value of what is nearest around a place: the tenth of the values that is nearest counts as noise.
fn nearest(estimate: &MonoDepth, at: ImagePoint, radius: f64) -> Option<f64> {
    let mut found = values(estimate, at, radius.min(f64::from(estimate.camera.width)));
    if estimate.kind == super::DepthKind::Disparity {
        found.reverse();
    }
    found.get(found.len() / 10).copied()
}
