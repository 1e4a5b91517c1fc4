//! Where objects stand, as the truth alone knows it.

use spf_core::geometry::{EnuPosition, Pose};
use spf_core::tags::Tagged;

/// Where an object stands, for the truth alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Middle of its bounds, world frame.
    pub centre: EnuPosition,
    /// Height, metres.
    pub height: f64,
    /// Larger horizontal side, metres.
    pub width: f64,
}

/// An object as the truth sees it: tags, and where it stands when that is known.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// Its tags.
    pub tags: &'a Tagged,
    /// Its place; without one, words of order, size and relation do not narrow the truth.
    pub place: Option<Place>,
}

/// Where the person who speaks looks from: the start of the flight.
pub type Viewpoint = Pose;
