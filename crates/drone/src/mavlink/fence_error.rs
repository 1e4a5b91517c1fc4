//! Why a fence could not be replaced.

use spf_mavlink::fence::{FenceError, MOST};

/// Why the fence is not in force.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FencingError {
    /// The autopilot does not announce that it takes one.
    #[error("the autopilot does not take a fence over the mission protocol")]
    Unsupported,
    /// The vehicle is in the air.
    #[error("the vehicle is in the air, where a new fence might begin a failsafe")]
    InTheAir,
    /// Where the vehicle is on the globe is unknown.
    #[error(
        "the vehicle has not told where its position counts from (GPS_GLOBAL_ORIGIN) and its home (HOME_POSITION), so that metres cannot \
         be turned into latitudes and longitudes"
    )]
    NoHome,
    /// Its parameters make a fence of points do nothing, or could not be read.
    #[error("the autopilot would do nothing at such a fence, or does not tell: set {0}")]
    NoAction(&'static str),
    /// The fence that it has could not be read, so that it could not be put back.
    #[error("the fence that the autopilot has could not be read, so that it could not be put back: nothing was changed")]
    Unknown,
    /// It failed, and the vehicle has its former fence again.
    #[error("the autopilot has its former fence again")]
    PutBack(#[source] Box<Self>),
    /// It failed, and so did putting the former fence back.
    #[error(
        "putting its former fence back failed, too: what fence the autopilot has is unknown, look at it with a ground station"
    )]
    Lost(#[source] Box<Self>),
    /// More corners than fit.
    #[error("the fence has more than {MOST} corners")]
    TooLarge,
    /// The transfer failed.
    #[error("the fence could not be sent")]
    Transfer(#[source] FenceError),
    /// It was accepted, and is another one when it is read back.
    #[error("the fence that was read back is not the one that was sent")]
    Different,
    /// It could not be read back.
    #[error("the fence was accepted, and could not be read back")]
    Unread,
    /// The vehicle does not say that it is in force.
    #[error("the fence was accepted, and the vehicle does not report that it is in force")]
    NotInForce,
}
