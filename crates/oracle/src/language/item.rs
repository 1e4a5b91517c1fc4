//! Candidate objects for a phrase.

use spf_core::tags::Tagged;

/// An object to choose from, with what is known of where it is. In a percept that is the image; in the truth the world as
/// seen from the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item<'a> {
    /// Its tags.
    pub(crate) tags: &'a Tagged,
    /// Across the image, in any unit that grows to the right; none where nothing tells left from right.
    pub(crate) across: Option<f64>,
    /// Half its width in the same unit.
    pub(crate) half: f64,
    /// Range, metres.
    pub(crate) range: Option<f64>,
    /// Size: in a image the mask's area times range², in the world its width.
    pub(crate) size: Option<f64>,
    /// Height, metres.
    pub(crate) height: Option<f64>,
    /// Position in metres: right, forward, up; in a image from the range.
    pub(crate) position: Option<[f64; 3]>,
    /// Tie-breaker: larger wins.
    pub(crate) weight: f64,
}
