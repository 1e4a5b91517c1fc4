//! The queries that wait for a reply.

use std::collections::BTreeMap;

use crate::policy::{Step, View};
use crate::settings::PilotSettings;
use spf_core::geometry::{Pose, wrap_angle};
use spf_core::query::{Query, QueryId, QueryKind};
use spf_core::time::{Duration, Time};

/// Maximum number of open queries; further ones are cancelled at once.
const QUERIES_AT_ONCE: usize = 8;
/// The next query of a craft that flies on waits until its image differs from the last one by one of these: metres, radians (5°); or
/// for this long after the last answer.
const MOVED: f64 = 0.3;
const TURNED: f64 = 5.0 / 180.0 * core::f64::consts::PI;
const WAITED: Duration = Duration::from_secs(2);
/// Minimum reply timeout: a query that expires as it is sent would be repeated forever.
const LEAST_TIMEOUT: Duration = Duration::from_millis(100);

/// An open query, and the view that it is about.
#[derive(Clone, Debug)]
pub(crate) struct Asked {
    pub(crate) query: Box<Query>,
    pub(crate) view: View,
    pub(crate) at: Time,
    /// Part of its streamed reply has already decided; the rest is not a second decision.
    pub(crate) has_decided: bool,
}

/// The open queries.
#[derive(Debug, Default)]
pub(crate) struct Queries {
    open: BTreeMap<QueryId, Asked>,
    /// How many were sent for the current instruction.
    sent: u32,
    /// Replies that arrived for queries already cancelled.
    late: u32,
    /// From where the image of the last query was taken, and when that query was closed.
    last: Option<(Pose, Time)>,
}

impl Queries {
    pub(crate) fn is_empty(&self) -> bool {
        self.open.is_empty()
    }

    /// Replies that arrived for queries already cancelled.
    pub(crate) fn late(&self) -> u32 {
        self.late
    }

    /// When the first of them expires.
    pub(crate) fn deadline(&self) -> Option<Time> {
        self.open.values().map(|asked| asked.query.deadline).min()
    }

    /// Capture time of the oldest frame that one of them is about.
    pub(crate) fn oldest_capture(&self) -> Option<Time> {
        self.open.values().map(|asked| asked.view.frame.captured).min()
    }

    /// The limit on queries in words, if it is reached.
    pub(crate) fn spent(&self, settings: &PilotSettings) -> Option<String> {
        let limit = settings.max_queries.filter(|limit| self.sent >= *limit)?;
        Some(format!("the limit of {limit} queries was reached"))
    }

    /// Queries count afresh.
    pub(crate) fn count_anew(&mut self) {
        self.sent = 0;
    }

    /// Opens a query about a view, and gives it its deadline; `None` if too many are open, or were sent: of several about one
    /// frame, the limit may permit only the first ones.
    pub(crate) fn open(&mut self, now: Time, mut query: Box<Query>, view: View, settings: &PilotSettings) -> Option<Box<Query>> {
        if self.open.len() >= QUERIES_AT_ONCE || self.spent(settings).is_some() {
            return None;
        }
        self.sent += 1;
        self.last = Some((view.pose, now));
        query.deadline = now + settings.reply_timeout.max(LEAST_TIMEOUT);
        self.open.insert(query.id, Asked { query: query.clone(), view, at: now, has_decided: false });
        Some(query)
    }

    pub(crate) fn get(&self, id: QueryId) -> Option<&Asked> {
        self.open.get(&id)
    }

    /// Whether an image taken at `pose` shows a craft that flies on anything new.
    pub(crate) fn is_news(&self, now: Time, pose: Pose) -> bool {
        self.last.is_none_or(|(last, closed)| {
            last.position.distance(pose.position) >= MOVED
                || wrap_angle(pose.attitude.heading - last.attitude.heading).abs() >= TURNED
                || now.since(closed) >= WAITED
        })
    }

    /// Closes the query to which a reply, or its failure, has come. `None`, and counted, if it had been cancelled.
    pub(crate) fn close(&mut self, now: Time, id: QueryId) -> Option<Asked> {
        let asked = self.open.remove(&id);
        if let Some((_, closed)) = self.last.as_mut().filter(|_| asked.is_some()) {
            *closed = now;
        }
        self.late += u32::from(asked.is_none());
        asked
    }

    /// Takes out a query whose deadline has passed.
    pub(crate) fn expired(&mut self, now: Time) -> Option<(QueryId, Asked)> {
        let id = self.open.iter().find(|(_, asked)| asked.query.deadline <= now).map(|(id, _)| *id)?;
        self.cancel(id).map(|asked| (id, asked))
    }

    /// Those of which this is true.
    pub(crate) fn which(&self, is_one: impl Fn(&Asked) -> bool) -> Vec<QueryId> {
        self.open.iter().filter(|(_, asked)| is_one(asked)).map(|(id, _)| *id).collect()
    }

    /// Takes a query out; `None` if it is not open any more.
    pub(crate) fn cancel(&mut self, id: QueryId) -> Option<Asked> {
        self.open.remove(&id)
    }

    /// Takes out all of them.
    pub(crate) fn take_all(&mut self) -> impl Iterator<Item = QueryId> + use<> {
        core::mem::take(&mut self.open).into_keys()
    }

    /// Notes that part of a streamed reply has led to this step. Returns whether that is a decision, and the first of its query.
    pub(crate) fn decides_early(&mut self, id: QueryId, step: &Step) -> bool {
        self.open
            .get_mut(&id)
            .is_some_and(|asked| decides(step, &asked.query) && !core::mem::replace(&mut asked.has_decided, true))
    }
}

/// Whether a step ends a decision. Further queries and waiting do not, and neither does a list of detections, on which
/// no model decided.
pub(crate) fn decides(step: &Step, query: &Query) -> bool {
    !matches!(step, Step::Ask(_) | Step::Wait) && !matches!(query.kind, QueryKind::Detect { .. })
}
