//! What is flown instead of the straight step, and for how long: detours, and turns towards what has not been observed.

use spf_space::avoid::{PassingSide, Side};

/// Maximum consecutive turns towards paths along the image edges; the second only towards the other edge.
pub(super) const TURNS_FIRST: u32 = 2;

/// Turns flown instead of the step itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TurnedFirst {
    /// Whether the last one was to the right.
    pub(super) right: bool,
    /// Number in a row.
    pub(super) turns: u32,
}

/// Number of clear paths in a row after which a detour is over.
const DETOUR_OVER: u32 = 2;

/// A detour under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DetourSide {
    pub(super) keep: Option<PassingSide>,
    /// Clear paths in a row.
    clear: u32,
}

impl DetourSide {
    /// The side on which the obstacle is being passed.
    pub(super) fn side(&self) -> Option<Side> {
        self.keep.map(|keep| keep.side)
    }

    pub(super) fn clear(&mut self) {
        self.clear += 1;
        if self.clear >= DETOUR_OVER {
            self.keep = None;
        }
    }

    /// A path around has been found on this side; `None` if it leads over or under.
    pub(super) fn shifted(&mut self, side: Option<Side>) {
        self.clear = 0;
        let Some(side) = side else { return };
        self.keep = match self.keep {
            Some(keep) if keep.side == side => Some(keep),
            // It changes sides once; a craft that did so at every answer would get nowhere.
            Some(_) => Some(PassingSide { side, strict: true }),
            None => Some(PassingSide { side, strict: false }),
        };
    }
}
