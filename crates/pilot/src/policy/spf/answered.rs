//! A reply that can be used, with what decides on it.

use super::asking::OpenQuery;
use super::rules::Rules;
use crate::policy::View;
use spf_core::reply::Reply;
use spf_space::Obstacle;

/// A usable reply, with the query that it answers, under the method of the flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answered<'a> {
    pub(super) rules: Rules,
    pub(super) query: OpenQuery,
    pub(super) reply: &'a Reply,
    /// What a step must keep clear of.
    pub(super) obstacles: &'a [Obstacle],
}

impl Answered<'_> {
    /// The view that the query was about.
    pub(super) fn view(&self) -> &View {
        &self.query.view
    }
}
