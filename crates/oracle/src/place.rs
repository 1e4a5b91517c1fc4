//! Object positions, for the ground truth only.

use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::tags::Tagged;

use super::language::item::Item;

/// Position and size of an object, for the ground truth only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Middle of its bounds, world frame.
    pub centre: EnuPosition,
    /// Height, metres.
    pub height: f64,
    /// Larger horizontal side, metres.
    pub width: f64,
}

/// An object as used by the ground truth: its tags, and its position if known.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// Its tags.
    pub tags: &'a Tagged,
    /// Its position; without it, ordinals, sizes and relations do not narrow the result.
    pub place: Option<Place>,
}

/// The user's viewpoint: the start of the flight.
pub type Viewpoint = Pose;

impl<'a> Placed<'a> {
    /// The object as a candidate: right and forward of the viewpoint in metres, horizontal position as bearing in
    /// radians.
    pub(crate) fn seen_from(&self, from: Option<Viewpoint>) -> Item<'a> {
        let tags = self.tags;
        let Some(place) = self.place else {
            return Item { tags, across: None, half: 0.0, range: None, size: None, height: None, position: None, weight: 0.0 };
        };
        let origin = from.unwrap_or_default();
        let away = origin.position.displacement_to(place.centre, origin.attitude.heading);
        let range = libm::hypot(away.right, away.forward);
        let seen = from.is_some();
        Item {
            tags,
            across: seen.then(|| wrap_angle(libm::atan2(away.right, away.forward))),
            half: libm::atan2(0.5 * place.width, range),
            range: seen.then_some(range),
            size: Some(place.width * place.height),
            height: Some(place.height),
            position: Some([away.right, away.forward, away.up]),
            weight: place.width * place.height,
        }
    }
}
