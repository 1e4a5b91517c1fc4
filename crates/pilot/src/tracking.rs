//! Has the target's box tracked from one answer to the next.

use super::{Action, Pilot, Waiting};
use crate::policy::{Output, Step};
use spf_core::query::QueryId;
use spf_core::reply::Status;
use spf_core::time::Time;
use spf_core::track::{TrackReport, TrackStart};

/// The track that was asked for.
#[derive(Debug, Default)]
pub(super) struct Tracking {
    id: Option<QueryId>,
    last: Option<TrackReport>,
}

impl Pilot {
    /// The last report on the track that was asked for last; `None` without one. For recording.
    #[must_use]
    pub fn track(&self) -> Option<&TrackReport> {
        self.tracking.last.as_ref()
    }

    /// Asks for a track of the box that a reply gives, or ends it where the reply shows no target.
    pub(super) fn track_reply(&mut self, waiting: &Waiting, output: &Output) {
        if !self.settings.guidance.track {
            return;
        }
        let step = &output.step;
        self.follow_reply(waiting, output);
        self.remember_boxes(waiting, &output.reading);
        self.remember_free(waiting, output);
        let Some(reply) = output.reading.reply.as_ref().filter(|_| !matches!(step, Step::Reject(_))) else { return };
        match reply.target_box.filter(|_| reply.status.leads_to_a_point()) {
            Some(area) => {
                self.tracking = Tracking { id: Some(waiting.query.id), last: None };
                self.outbox.push_back(Action::Track(TrackStart { id: waiting.query.id, frame: waiting.view.frame.id, area }));
            }
            None if reply.status == Status::NotVisible && !matches!(step, Step::Keep | Step::Look) => self.untrack(),
            None => {}
        }
    }

    /// Ends the track, if there is one.
    pub(super) fn untrack(&mut self) {
        if self.tracking.id.is_some() {
            self.tracking = Tracking::default();
            self.lose_target();
            self.outbox.push_back(Action::Untrack);
        }
    }

    /// Takes a report on the track; those on earlier tracks, and older ones, are ignored.
    pub(super) fn track_report(&mut self, now: Time, report: TrackReport) {
        // A camera clock that runs ahead must not make all its later frames look old.
        let report = TrackReport { captured: report.captured.min(now), ..report };
        let is_newer = self.tracking.last.is_none_or(|last| last.captured < report.captured);
        if self.tracking.id == Some(report.id) && is_newer && report.is_sound() {
            self.tracking.last = Some(report);
            self.follow_report(now, &report);
        }
    }
}
