//! What an opening has of the craft, whatever it is.

use std::sync::Arc;

use spf_core::craft::Craft;
use spf_drone::frames::Frames;
use spf_envelope::Limits;
use spf_flight::flight::Site;

use spf_api::reading::Reader;

/// A craft, ready to take off.
pub(super) struct Aboard {
    pub(super) site: Site,
    pub(super) craft: Craft,
    /// The envelope's limits, without the brake.
    pub(super) limits: Limits,
    /// Whether sensors around it measure ranges.
    pub(super) has_ranges: bool,
    /// Whether it flies each move by itself.
    pub(super) flies_moves: bool,
    /// Its place, for the sentence that says what flies.
    pub(super) place: String,
    /// What else is random, for the same sentence.
    pub(super) drawn: String,
    /// Messages before take-off, after that sentence.
    pub(super) announcements: Vec<String>,
    /// An instruction that was chosen instead of the one that was given.
    pub(super) chosen: Option<String>,
    /// Its height at the start, metres; `None` if only the take-off shows it.
    pub(super) height: Option<f64>,
    /// Reads the instructions that are given in flight.
    pub(super) reader: Reader,
    /// The frames of a camera that counts them.
    pub(super) frames: Option<Arc<dyn Frames>>,
}
