//! Lens distortion: slightly wider pinhole images, resampled to those of the lens.
//!
//! The mapping is computed once per camera. Colour is interpolated between four pixels; ids and depth use the nearest,
//! since an id between two objects is meaningless. Depth along the optical axis is not affected by the lens.

use rayon::prelude::*;
use spf_core::camera::{Camera, Distortion};
use spf_core::query::ImagePoint;

use crate::{MAX_SIDE, RenderedImage};

/// The named lenses: published calibrations of a Tello's video at 960×720, and a generic wide-angle lens.
const CALIBRATED: [(&str, [f64; 8]); 3] = [
    // fx, fy, cx, cy, k1, k2, p1, p2: `camera_info.yaml` of tello_ros.
    ("tello_ros", [921.2, 919.0, 459.9, 351.2, -0.033, 0.105, 0.0013, -0.0066]),
    // `ost.yaml` of tello-ros2.
    ("tello_ros2", [919.4, 911.9, 459.7, 323.6, -0.042, 0.049, -0.023, -0.004]),
    // The node of a ROS course.
    ("tello_course", [897.1, 902.3, 453.9, 355.0, -0.013, -0.019, 0.001, -0.005]),
];

/// Barrel distortion of a cheap wide-angle lens: a line along the edge of the `quad` image bows by a tenth.
const WIDE: Distortion = Distortion { k1: -0.1, k2: 0.01, p1: 0.0, p2: 0.0 };

/// Tangent of the maximum rendered angle off the axis.
const FARTHEST: f64 = 5.0;
/// Maximum width and height of the pinhole image, as a multiple of the lens image.
const LARGEST: f64 = 3.0;

/// The lens of a simulated camera.
#[derive(Clone, Debug, PartialEq)]
pub enum Lens {
    /// A published calibration, by name; it replaces the intrinsics and keeps the mount tilt.
    Calibrated(&'static str),
    /// The generic wide-angle lens, added to the craft's own camera.
    Wide,
    /// These distortion coefficients, added to the craft's own camera.
    Distorted(Distortion),
}

impl Lens {
    /// Names of all lenses.
    #[must_use]
    pub fn names() -> Vec<&'static str> {
        CALIBRATED.iter().map(|(name, _)| *name).chain(["wide"]).collect()
    }

    /// The lens with this name; `None` if unknown.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        if name == "wide" {
            return Some(Self::Wide);
        }
        CALIBRATED.iter().find(|(known, _)| *known == name).map(|(known, _)| Self::Calibrated(known))
    }

    /// The camera with this lens, at the size of `camera`.
    #[must_use]
    pub fn on(&self, camera: &Camera) -> Camera {
        match self {
            Self::Calibrated(name) => {
                let Some((_, figures)) = CALIBRATED.iter().find(|(known, _)| known == name) else { return *camera };
                let [fx, fy, cx, cy, k1, k2, p1, p2] = *figures;
                let distortion = Distortion { k1, k2, p1, p2 };
                let calibrated = Camera { width: 960, height: 720, fx, fy, cx, cy, distortion, tilt: camera.tilt };
                calibrated.resized(camera.width, camera.height)
            }
            Self::Wide => Camera { distortion: WIDE, ..*camera },
            Self::Distorted(distortion) => Camera { distortion: *distortion, ..*camera },
        }
    }
}

impl std::fmt::Display for Lens {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Calibrated(name) => f.write_str(name),
            Self::Wide => f.write_str("wide"),
            Self::Distorted(d) => write!(f, "{}:{}:{}:{}", d.k1, d.k2, d.p1, d.p2),
        }
    }
}

/// Source of one pixel of the lens image.
#[derive(Clone, Copy, Debug)]
struct Source {
    /// Index of the upper left of four pixels of the pinhole image; [`NOWHERE`] where the lens shows nothing.
    upper_left: u32,
    /// Offset from its centre, 1/256 pixel.
    right: u8,
    down: u8,
}

const NOWHERE: u32 = u32::MAX;

/// The mapping of one camera.
#[derive(Debug)]
pub(super) struct Remap {
    /// The camera with the lens.
    pub(super) camera: Camera,
    /// The pinhole camera that is rendered.
    pub(super) pinhole: Camera,
    sources: Vec<Source>,
}

impl Remap {
    /// The mapping of a camera, whose size is at most [`MAX_SIDE`] per side.
    pub(super) fn new(camera: &Camera) -> Self {
        let camera = Camera { width: camera.width.min(MAX_SIDE), height: camera.height.min(MAX_SIDE), ..*camera };
        let (w, h) = (camera.width as usize, camera.height as usize);
        let rays: Vec<Option<(f64, f64)>> = (0..w * h).into_par_iter().map(|i| ray(&camera, i % w, i / w)).collect();
        let pinhole = pinhole(&camera, &rays);
        let sources = rays.into_par_iter().map(|ray| source(&pinhole, ray)).collect();
        Self { camera, pinhole, sources }
    }

    /// Distorts every channel of the pinhole image.
    pub(super) fn bend(&self, from: &RenderedImage, to: &mut RenderedImage) {
        (to.width, to.height) = (self.camera.width, self.camera.height);
        to.depth = from.depth.as_ref().map(|channel| self.nearest(channel, to.depth.take()));
        to.ids = from.ids.as_ref().map(|channel| self.nearest(channel, to.ids.take()));
        to.piece_ids = from.piece_ids.as_ref().map(|channel| self.nearest(channel, to.piece_ids.take()));
        to.opening_ids = from.opening_ids.as_ref().map(|channel| self.nearest(channel, to.opening_ids.take()));
        to.opening_depth = from.opening_depth.as_ref().map(|channel| self.nearest(channel, to.opening_depth.take()));
        to.rgb = from.rgb.as_ref().map(|channel| self.blended(channel, to.rgb.take()));
    }

    fn nearest<T: Copy + Default + Send + Sync>(&self, from: &[T], memory: Option<Vec<T>>) -> Vec<T> {
        let width = self.pinhole.width as usize;
        let mut to = memory.unwrap_or_default();
        to.clear();
        self.sources
            .par_iter()
            .map(|source| {
                if source.upper_left == NOWHERE {
                    return T::default();
                }
                let (right, down) = (usize::from(source.right >= 128), usize::from(source.down >= 128));
                from[source.upper_left as usize + right + down * width]
            })
            .collect_into_vec(&mut to);
        to
    }

    /// Interpolates between four pixels, in integers of 1/65536.
    fn blended(&self, from: &[u8], memory: Option<Vec<u8>>) -> Vec<u8> {
        let width = self.pinhole.width as usize;
        let mut to = memory.unwrap_or_default();
        to.resize(self.sources.len() * 3, 0);
        to.par_chunks_exact_mut(3).zip(&self.sources).for_each(|(pixel, source)| {
            if source.upper_left == NOWHERE {
                pixel.fill(0);
                return;
            }
            let (right, down) = (u32::from(source.right), u32::from(source.down));
            let weights = [(256 - right) * (256 - down), right * (256 - down), (256 - right) * down, right * down];
            let first = source.upper_left as usize;
            let corners = [first, first + 1, first + width, first + width + 1];
            for (channel, out) in pixel.iter_mut().enumerate() {
                let sum: u32 =
                    corners.iter().zip(weights).map(|(corner, weight)| u32::from(from[corner * 3 + channel]) * weight).sum();
                *out = ((sum + 32_768) >> 16) as u8;
            }
        });
        to
    }
}

/// The direction of a pixel's centre, metres right and down at a distance of one metre; `None` if no direction leads to
/// the pixel.
fn ray(camera: &Camera, x: usize, y: usize) -> Option<(f64, f64)> {
    let (w, h) = (f64::from(camera.width), f64::from(camera.height));
    let point = ImagePoint { u: (x as f64 + 0.5) / w, v: (y as f64 + 0.5) / h };
    let ray = camera.ray(point);
    if ray.right.abs() > FARTHEST || ray.up.abs() > FARTHEST {
        return None;
    }
    let back = camera.project(ray.right, 1.0, ray.up)?;
    let off = ((back.u - point.u) * w).abs().max(((back.v - point.v) * h).abs());
    (off < 0.01).then_some((ray.right, -ray.up))
}

/// The undistorted camera whose image contains all of these directions, with the lens's resolution at the centre unless
/// that would be too large.
fn pinhole(camera: &Camera, rays: &[Option<(f64, f64)>]) -> Camera {
    let seen = || rays.iter().flatten();
    let range = |pick: fn(&(f64, f64)) -> f64| seen().map(pick).fold((0.0, 0.0), |(a, b): (f64, f64), t| (a.min(t), b.max(t)));
    let axis = |size: u32, focal: f64, (low, high): (f64, f64)| {
        let largest = (LARGEST * f64::from(size)).min(f64::from(MAX_SIDE) - 4.0);
        let focal = focal.min(largest / (high - low).max(1e-9));
        // Two pixels on each side, for the neighbours of the outermost ones.
        let (before, after) = (2.0 - low * focal, 2.0 + high * focal);
        (libm::ceil(before + after) as u32, focal, before)
    };
    let (width, fx, cx) = axis(camera.width, camera.fx, range(|ray| ray.0));
    let (height, fy, cy) = axis(camera.height, camera.fy, range(|ray| ray.1));
    Camera { width, height, fx, fy, cx, cy, distortion: Distortion::default(), tilt: camera.tilt }
}

fn source(pinhole: &Camera, ray: Option<(f64, f64)>) -> Source {
    let nowhere = Source { upper_left: NOWHERE, right: 0, down: 0 };
    let Some((right, down)) = ray else { return nowhere };
    // In pixels between centres, in steps of 1/256.
    let x = libm::floor((right * pinhole.fx + pinhole.cx - 0.5) * 256.0) as i64;
    let y = libm::floor((down * pinhole.fy + pinhole.cy - 0.5) * 256.0) as i64;
    let (column, row) = (x >> 8, y >> 8);
    let (w, h) = (i64::from(pinhole.width), i64::from(pinhole.height));
    if !(0..w - 1).contains(&column) || !(0..h - 1).contains(&row) {
        return nowhere;
    }
    Source { upper_left: (row * w + column) as u32, right: (x & 255) as u8, down: (y & 255) as u8 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pinhole image that encodes the position of each pixel: red across, green down, ids and depth in steps.
    fn ruler(camera: &Camera) -> RenderedImage {
        let (w, h) = (camera.width, camera.height);
        let pixels = || (0..h).flat_map(move |y| (0..w).map(move |x| (x, y)));
        RenderedImage {
            width: w,
            height: h,
            rgb: Some(pixels().flat_map(|(x, y)| [(x * 255 / w) as u8, (y * 255 / h) as u8, 0]).collect()),
            depth: Some(pixels().map(|(x, _)| x as f32).collect()),
            ids: Some(pixels().map(|(_, y)| y as u16).collect()),
            ..RenderedImage::default()
        }
    }

    fn bent(camera: &Camera) -> (Remap, RenderedImage) {
        let remap = Remap::new(camera);
        let mut image = RenderedImage::default();
        remap.bend(&ruler(&remap.pinhole), &mut image);
        (remap, image)
    }

    #[test]
    fn a_pixel_shows_what_its_ray_points_at() {
        for lens in Lens::names() {
            let camera = Lens::named(lens).unwrap().on(&Camera::tello()).resized(240, 180);
            let (remap, image) = bent(&camera);
            let (depth, ids) = (image.depth.unwrap(), image.ids.unwrap());
            for (x, y) in [(0, 0), (239, 0), (0, 179), (239, 179), (120, 90), (17, 160)] {
                let point = ImagePoint { u: (f64::from(x) + 0.5) / 240.0, v: (f64::from(y) + 0.5) / 180.0 };
                let ray = camera.ray(point);
                let column = libm::floor(ray.right * remap.pinhole.fx + remap.pinhole.cx);
                let row = libm::floor(-ray.up * remap.pinhole.fy + remap.pinhole.cy);
                let at = (y * 240 + x) as usize;
                assert!((f64::from(depth[at]) - column).abs() <= 1.0, "{lens} {x} {y}: {} {column}", depth[at]);
                assert!((f64::from(ids[at]) - row).abs() <= 1.0, "{lens} {x} {y}: {} {row}", ids[at]);
            }
        }
    }

    #[test]
    fn a_barrel_lens_sees_farther_to_the_corners() {
        let plain = Camera::quad();
        let camera = Lens::Wide.on(&plain);
        let remap = Remap::new(&camera);
        assert!(remap.pinhole.width > plain.width + 100 && remap.pinhole.height > plain.height + 60);
        assert!(remap.sources.iter().all(|source| source.upper_left != NOWHERE));
        // Same resolution in the middle as the lens itself.
        assert_eq!((remap.pinhole.fx, remap.pinhole.fy), (plain.fx, plain.fy));
    }

    /// A lens whose polynomial folds back within the image shows nothing beyond, instead of the same things twice.
    #[test]
    fn beyond_the_fold_there_is_nothing() {
        let fold = Distortion { k1: -0.4, ..Distortion::default() };
        let (remap, image) = bent(&Lens::Distorted(fold).on(&Camera::quad()).resized(96, 72));
        assert_eq!(remap.sources[0].upper_left, NOWHERE);
        assert_eq!(image.rgb.unwrap()[..3], [0, 0, 0]);
        assert_ne!(remap.sources[36 * 96 + 48].upper_left, NOWHERE);
    }

    #[test]
    fn absurd_lenses_keep_to_a_bounded_image() {
        for (k1, k2, p1) in [(9.0, 0.0, 0.0), (-9.0, 0.0, 0.0), (0.0, -9.0, 3.0), (-0.3, 0.02, 0.0), (1e300, 0.0, 0.0)] {
            let camera = Lens::Distorted(Distortion { k1, k2, p1, p2: 0.0 }).on(&Camera::quad()).resized(64, 48);
            let (remap, _) = bent(&camera);
            assert!(remap.pinhole.width <= 3 * 64 + 4 && remap.pinhole.height <= 3 * 48 + 4, "{k1}");
        }
    }
}
