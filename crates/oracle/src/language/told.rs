//! Objects given as data in place of words.

use spf_core::detection::Appearance;

/// Takes the place of the words of a phrase.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Told {
    /// Ids of the objects that count.
    pub(crate) objects: Vec<u16>,
    /// The same, and those of earlier stages for which they may be mistaken.
    pub(crate) among: Vec<u16>,
    /// How they appear in a list of detections.
    pub(crate) appearances: Vec<Appearance>,
}
