//! Exit codes (listed for users in README.md).

use spf_core::pilot::Outcome;
use std::process::ExitCode;

/// How the command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Reached, and verified where there is truth.
    Success = 0,
    /// Something that should not happen.
    Internal = 1,
    /// Usage or configuration.
    Usage = 2,
    /// Not found, timeout, or believed reached but not verified.
    NotReached = 3,
    /// The craft touched something.
    Collision = 4,
    /// Operator, envelope, geofence or battery.
    Aborted = 5,
    /// Replies, video or link gave out.
    Failed = 6,
}

impl Exit {
    /// The exit code of a flight.
    pub(crate) fn of(outcome: Outcome, verified: Option<bool>) -> Self {
        match outcome {
            Outcome::Reached if verified == Some(false) => Self::NotReached,
            Outcome::Reached => Self::Success,
            Outcome::NotFound | Outcome::Timeout => Self::NotReached,
            Outcome::Collision => Self::Collision,
            Outcome::Aborted => Self::Aborted,
            Outcome::Failed => Self::Failed,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
