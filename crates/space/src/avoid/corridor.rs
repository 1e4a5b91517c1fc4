//! [`Corridor`]: how far straight paths are clear of what a reply and the views before it show.

use spf_core::geometry::EnuPosition;
use spf_core::lift::{Lifting, lower};
use spf_core::query::ImagePoint;

use super::solid::Solid;
use super::{Path, axes, solids};
use crate::viewpoint::{Obstacle, Viewpoint};

/// Lengths that are tried of a path.
const LENGTHS: u32 = 8;

/// What straight paths from where an image was taken must keep clear of. The target's place is known from all answers about it, so that
/// the way to it seldom leads along the point of the last one: the path that is flown is the one to be checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Corridor {
    from: Viewpoint,
    solids: Vec<Solid>,
    longest: f64,
}

impl Corridor {
    /// A corridor among `obstacles`, to be kept at `clearance` metres; the box of this view that contains `point` and is called `target`
    /// is none of them. No path is clear for more than `longest` metres.
    #[must_use]
    pub fn new(
        from: &Viewpoint,
        clearance: f64,
        obstacles: &[Obstacle],
        (point, target): (ImagePoint, Option<&str>),
        longest: f64,
    ) -> Self {
        Self { from: *from, solids: solids(from, clearance, obstacles, (point, target)), longest }
    }

    /// How far the straight path towards `to` is clear, metres, at most `most`; `None` if not even for `least`, or for `most` if that is
    /// less.
    #[must_use]
    pub fn clear(&self, to: EnuPosition, least: f64, most: f64) -> Option<f64> {
        let Viewpoint { camera, pose, .. } = &self.from;
        let whole = pose.position.displacement_to(to, pose.attitude.heading);
        let toward = axes(lower(whole, camera, pose.attitude, Lifting::Levelled)).normalize_or_zero();
        let (most, least) = (most.min(self.longest.max(least)), least.min(most));
        let mut lengths = (0..=LENGTHS).map(|nth| most + (least - most) * f64::from(nth) / f64::from(LENGTHS));
        lengths.find(|length| {
            let end = toward * *length;
            !self.solids.iter().any(|solid| solid.blocks(&Path { corner: end, end }))
        })
    }
}
