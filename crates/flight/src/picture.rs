//! Where the pictures that a VLM is shown come from.

use spf_core::query::Query;
use spf_vlm::Picture;

/// A camera whose frames can be had as pictures for a while after their capture.
pub trait PictureSource: Send {
    /// The picture a query is about, made when it is first looked at.
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a>;
}
