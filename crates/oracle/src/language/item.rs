//! Candidate objects for a phrase.

use spf_core::tags::Tagged;

/// A candidate object with its known position: in a percept in the image; in the ground truth in the world, as seen
/// from the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item<'a> {
    /// Its tags.
    pub(crate) tags: &'a Tagged,
    /// Horizontal position, in any unit that increases to the right; `None` if unknown.
    pub(crate) across: Option<f64>,
    /// Half its width in the same unit.
    pub(crate) half: f64,
    /// Range, metres.
    pub(crate) range: Option<f64>,
    /// Size: in an image the mask's area times range², in the world its width.
    pub(crate) size: Option<f64>,
    /// Height, metres.
    pub(crate) height: Option<f64>,
    /// Position in metres: right, forward, up; in an image computed from the range.
    pub(crate) position: Option<[f64; 3]>,
    /// Tie-breaker: larger wins.
    pub(crate) weight: f64,
}
