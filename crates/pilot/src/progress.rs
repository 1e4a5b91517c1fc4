//! Progress of a flight: whether its answers lead anywhere.

use spf_core::geometry::EnuPosition;
use spf_core::reply::Status;

use crate::policy::Reading;

/// A place at least this far from all earlier ones is a new one, metres: more than a position drifts while the craft hovers.
const NEW: f64 = 1.0;

/// The answers since the last progress. A craft makes progress that comes where it has not been for this stage of the instruction,
/// that enters a later stage, and that follows somebody. Back and forth is none, and neither is a turn: a search ends by itself.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    /// Where the craft was at answers, each at least [`NEW`] from the others: no more than there were answers.
    places: Vec<EnuPosition>,
    stage: u32,
    since: u32,
}

impl Progress {
    /// Takes an answer that has come while the craft is here.
    pub(crate) fn answered(&mut self, at: EnuPosition) {
        self.since = self.since.saturating_add(1);
        if self.places.iter().all(|place| place.distance(at) >= NEW) {
            self.places.push(at);
            self.since = 0;
        }
    }

    /// Takes what an answer says.
    pub(crate) fn read(&mut self, reading: &Reading) {
        let Some(reply) = &reading.reply else { return };
        let stage = reply.stage.unwrap_or(0);
        if stage > self.stage {
            // Its way may lead back.
            *self = Self { stage, ..Self::default() };
        } else if reply.status == Status::Following {
            self.since = 0;
        }
    }

    /// Number of answers since the last progress.
    pub(crate) fn since(&self) -> u32 {
        self.since
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::reply::Reply;

    fn at(north: f64) -> EnuPosition {
        EnuPosition { north, ..EnuPosition::default() }
    }

    fn says(status: Status, stage: Option<u32>) -> Reading {
        Reading { reply: Some(Reply { stage, ..Reply::new(status) }), ..Reading::default() }
    }

    #[test]
    fn a_long_way_is_progress_and_back_and_forth_is_none() {
        let mut progress = Progress::default();
        for metres in 0..200 {
            progress.answered(at(f64::from(metres)));
            assert_eq!(progress.since(), 0);
        }
        for answer in 1..=40 {
            progress.answered(at(if answer % 2 == 0 { 199.0 } else { 150.0 }));
            assert_eq!(progress.since(), answer);
        }
    }

    #[test]
    fn small_steps_add_up() {
        let mut progress = Progress::default();
        let most = (0..100).map(|step| {
            progress.answered(at(0.16 * f64::from(step)));
            progress.since()
        });
        assert_eq!(most.max(), Some(6));
    }

    #[test]
    fn a_later_stage_begins_anew_and_an_earlier_one_does_not() {
        let mut progress = Progress::default();
        let mut all = [1, 1, 2, 1, 2].map(|stage| {
            progress.answered(at(0.0));
            progress.read(&says(Status::Navigating, Some(stage)));
            progress.since()
        });
        assert_eq!(all, [0, 0, 0, 0, 1], "the place is new to each stage");
        progress.answered(at(5.0));
        all = [0; 5].map(|_| {
            progress.answered(at(0.0));
            progress.read(&says(Status::Following, Some(2)));
            progress.since()
        });
        assert_eq!(all, [0; 5], "beside somebody who stands");
    }
}
