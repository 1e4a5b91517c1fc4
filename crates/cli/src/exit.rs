//! Exit codes (listed for users in README.md).

use spf_pilot::Outcome;
use std::process::ExitCode;

use crate::error::{CliError, ErrorKind};

/// Exit codes of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Success, verified if there is ground truth.
    Success = 0,
    /// Internal error.
    Internal = 1,
    /// Error in usage or configuration.
    Usage = 2,
    /// Not found, timeout, or believed reached but not verified.
    NotReached = 3,
    /// Collision.
    Collision = 4,
    /// Ended by operator, envelope, geofence or battery.
    Aborted = 5,
    /// Failure of replies, video or link.
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

    /// The exit code of an error.
    pub(crate) fn of_error(error: &CliError) -> Self {
        match error.kind() {
            ErrorKind::Usage => Self::Usage,
            ErrorKind::Failed => Self::Failed,
            ErrorKind::Aborted => Self::Aborted,
            ErrorKind::Internal => Self::Internal,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
