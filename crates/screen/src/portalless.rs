//! What stands in for the portal in a build without the feature `screen-native`.

use std::convert::Infallible;

use crate::area::Region;
use crate::picture::Shown;
use crate::{Hidden, ScreenError};

/// A stream that the user has chosen.
#[derive(Debug)]
pub(crate) struct Stream(Infallible);

impl Stream {
    /// Fails.
    pub(crate) fn open() -> Result<Self, ScreenError> {
        Err(ScreenError::Portal("it needs a build with the feature `screen-native`".to_owned()))
    }

    /// The newest picture.
    pub(crate) fn look(&self, _region: &Region) -> Result<Result<Shown, Hidden>, ScreenError> {
        match self.0 {}
    }
}
