//! What the simulator tells of one frame, and what the oracle makes of one object in it.

use std::collections::BTreeMap;

use libm::sqrt;
use spf_core::camera::Camera;
use spf_core::geometry::Attitude;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::Look;
use spf_core::sign::SignView;
use spf_core::tags::{PieceTag, Tagged};

/// Size at which the visible pixels of an object are counted unless the query names another (`docs/explanation/oracle.md`).
pub const SIZE_SENT: (u32, u32) = (960, 720);

/// The images of one frame, and two properties that they do not contain.
#[derive(Clone, Copy, Debug)]
pub struct GroundTruthView<'a> {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Object id per pixel, in rows from the upper left; 0 for none.
    pub ids: &'a [u16],
    /// Distance along the optical axis, metres; 0 for none.
    pub depth: &'a [f32],
    /// Named part of an object per pixel, its place in `pieces` from 1; 0 for none. Empty if no part has a name.
    pub piece_ids: &'a [u16],
    /// The named parts of the scene's objects.
    pub pieces: &'a [PieceTag],
    /// Openings (gates, tunnel entrances, holes), which hide nothing; empty if the scene has none.
    pub opening_ids: &'a [u16],
    /// Distance to the opening's surface along the optical axis, metres.
    pub opening_depth: &'a [f32],
    /// The camera that took them.
    pub camera: &'a Camera,
    /// The camera's attitude when it took them, of which only pitch and roll count: what is level in the image.
    pub attitude: Attitude,
    /// Fraction of an object's silhouette inside the frame, 0..=1; 1 for objects not listed.
    pub in_frame: &'a BTreeMap<u16, f32>,
    /// Light on an object, 0 dark ..= 1 daylight; daylight for objects not listed.
    pub light: &'a BTreeMap<u16, f32>,
    /// What is written on objects, whether or not they are in the image. Only a stand-in that obeys signs reads it.
    pub signs: &'a [SignView],
}

/// A visible object as perceived by the oracle.
#[derive(Clone, Debug, PartialEq)]
pub struct PerceivedObject {
    /// Its id in the id image: that of its tags, unless it is taken for something else.
    pub(super) id: u16,
    /// Its tags.
    pub tags: Tagged,
    /// Visible pixels of the frame.
    pub area: u64,
    /// Smallest rectangle around the visible pixels.
    pub bounds: ImageBox,
    /// The middle of its main part, or else the deepest pixel of its mask, without noise.
    pub deepest: ImagePoint,
    /// The point given in replies: `deepest` with noise.
    pub point: ImagePoint,
    /// Straight-line distance to the surface at `deepest`, with noise, metres; infinite if there is none.
    pub range: f64,
    /// Distance to its nearest visible surface, with the same noise, metres, which decides on arrival.
    pub nearest: f64,
    /// Distance to the surface visible at `deepest` in the ordinary image, metres: for an opening, what is behind it.
    pub beyond: f64,
    /// Whether it counts as in view: tall enough and enough of it inside the frame, or a large part of the image.
    pub in_view: bool,
    /// Whether it is so in view that one may say to have reached it: enough of it inside the frame, or most of what one sees.
    pub clearly: bool,
    /// The edge of the image that cuts off most of it.
    pub cut: Option<Look>,
    /// Square root of its visible pixels at [`SIZE_SENT`], reduced by darkness.
    pub(super) size: f64,
    /// Uniform random number that decides whether it is noticed.
    pub(super) luck: f64,
}

/// Straight-line distance per metre of depth along the optical axis, at an image point of the distorted image.
pub(super) fn stretch(camera: &Camera, at: ImagePoint) -> f64 {
    let ray = camera.ray(at);
    sqrt(1.0 + ray.right * ray.right + ray.up * ray.up)
}

/// Metres right and up per metre along the optical axis, without correcting lens distortion, which a human viewer would not
/// correct either.
pub(super) fn slopes(camera: &Camera, at: ImagePoint) -> (f64, f64) {
    let right = (at.u * f64::from(camera.width) - camera.cx) / camera.fx;
    let up = (camera.cy - at.v * f64::from(camera.height)) / camera.fy;
    (right, up)
}

#[cfg(test)]
impl PerceivedObject {
    /// The same object with another random number for being noticed.
    pub(super) fn redraw(&mut self, luck: f64) {
        self.luck = luck;
    }
}
