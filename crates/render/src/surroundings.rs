//! The surroundings of the frame: a wider, coarser view for computing the fraction of each silhouette inside the frame.

use std::collections::BTreeMap;

use spf_core::camera::{Camera, Distortion};
use spf_scene::geometry::ObjectId;

use crate::RenderedImage;

/// Width of the view as a multiple of the camera's.
const WIDE: f64 = 2.5;
/// Size of that view, pixels.
const SIZE: (u32, u32) = (320, 240);

/// A wider view around a camera's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    camera: Camera,
    /// Which of its pixels lie inside the frame.
    inside: Vec<bool>,
}

impl Surroundings {
    /// The wider view around the frame of `camera`, which may have lens distortion.
    #[must_use]
    pub fn of(camera: &Camera) -> Self {
        let wide = widened(camera);
        let inside = if camera.distortion.is_none() { straight(camera, &wide) } else { through_lens(camera, &wide) };
        Self { camera: wide, inside }
    }

    /// The wide camera with which to render ids and openings, at the pose of the frame's camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Fraction of each object's silhouette inside the frame, 0..=1, computed from that image; openings from their own ids.
    /// Objects outside the wide view are not listed.
    #[must_use]
    pub fn fractions(&self, image: &RenderedImage) -> BTreeMap<ObjectId, f32> {
        let channels = || [image.ids.as_deref(), image.opening_ids.as_deref()].into_iter().flatten();
        let most = channels().flatten().max().copied().unwrap_or(0);
        let mut counts = vec![(0u32, 0u32); usize::from(most) + 1];
        for ids in channels() {
            for (id, inside) in ids.iter().zip(&self.inside) {
                let count = &mut counts[usize::from(*id)];
                count.0 += 1;
                count.1 += u32::from(*inside);
            }
        }
        let seen = counts.iter().enumerate().skip(1).filter(|(_, (all, _))| *all > 0);
        seen.map(|(id, (all, inside))| (id as ObjectId, *inside as f32 / *all as f32)).collect()
    }
}

fn widened(camera: &Camera) -> Camera {
    let (w, h) = (f64::from(SIZE.0), f64::from(SIZE.1));
    Camera {
        width: SIZE.0,
        height: SIZE.1,
        fx: camera.fx * w / f64::from(camera.width) / WIDE,
        fy: camera.fy * h / f64::from(camera.height) / WIDE,
        cx: 0.5 * w,
        cy: 0.5 * h,
        distortion: Distortion::default(),
        tilt: camera.tilt,
    }
}

/// The frame of a pinhole camera is a rectangle of tangents.
fn straight(camera: &Camera, wide: &Camera) -> Vec<bool> {
    let inside = |size: u32, centre: f64, focal: f64, low: f64, high: f64| -> Vec<bool> {
        (0..size).map(|i| (low..=high).contains(&((f64::from(i) + 0.5 - centre) / focal))).collect()
    };
    let (left, right) = (-camera.cx / camera.fx, (f64::from(camera.width) - camera.cx) / camera.fx);
    let (top, bottom) = (-camera.cy / camera.fy, (f64::from(camera.height) - camera.cy) / camera.fy);
    let columns = inside(wide.width, wide.cx, wide.fx, left, right);
    let rows = inside(wide.height, wide.cy, wide.fy, top, bottom);
    rows.iter().flat_map(|row| columns.iter().map(move |column| *row && *column)).collect()
}

/// With a lens the frame is the region that the lens projects into it.
fn through_lens(camera: &Camera, wide: &Camera) -> Vec<bool> {
    let inside = |(x, y): (u32, u32)| {
        let right = (f64::from(x) + 0.5 - wide.cx) / wide.fx;
        let down = (f64::from(y) + 0.5 - wide.cy) / wide.fy;
        let within = |fraction: f64| (0.0..=1.0).contains(&fraction);
        camera.project(right, 1.0, -down).is_some_and(|point| within(point.u) && within(point.v))
    };
    (0..wide.height).flat_map(|y| (0..wide.width).map(move |x| (x, y))).map(inside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image whose left half is object 1 and whose right half is 2.
    fn halves(camera: &Camera) -> RenderedImage {
        let ids = (0..camera.width * camera.height).map(|i| if i % camera.width < camera.width / 2 { 1 } else { 2 }).collect();
        RenderedImage { width: camera.width, height: camera.height, ids: Some(ids), ..RenderedImage::default() }
    }

    #[test]
    fn the_frame_fills_its_fraction_of_the_view() {
        let around = Surroundings::of(&Camera::quad());
        let fractions = around.fractions(&halves(around.camera()));
        assert_eq!(fractions.keys().copied().collect::<Vec<_>>(), [1, 2]);
        for fraction in fractions.values() {
            assert!((f64::from(*fraction) - 1.0 / (WIDE * WIDE)).abs() < 1e-6, "{fraction}");
        }
        // The Tello's principal point lies 22 pixels left of the middle: more of the frame is to its right.
        let around = Surroundings::of(&Camera::tello());
        let fractions = around.fractions(&halves(around.camera()));
        assert!(fractions[&2] > fractions[&1] + 0.005, "{fractions:?}");
    }

    #[test]
    fn a_lens_that_bends_nothing_leaves_the_frame_where_it_was() {
        let camera = Camera::tello();
        let mut lens = camera;
        lens.distortion.k1 = 1e-12;
        assert_eq!(Surroundings::of(&lens).inside, Surroundings::of(&camera).inside);
        // Barrel distortion widens the view.
        lens.distortion.k1 = -0.3;
        let count = |camera: &Camera| Surroundings::of(camera).inside.iter().filter(|inside| **inside).count();
        assert!(count(&lens) > count(&camera) + 100);
    }
}
