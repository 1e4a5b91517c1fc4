//! Whether commands reach the drone. State lines do not tell, since they come from the drone; and an `rc` command has no
//! response. While the drone is flown by setpoints it is therefore asked for its battery charge: whatever it answers, it
//! has heard.

use spf_core::time::{Duration, Time};

/// The question. Every firmware answers it, also in flight, and with a value, which cannot be taken for the response to a
/// motion command.
pub(super) const QUESTION: &str = "battery?";
/// Interval of the questions.
const AGAIN: Duration = Duration::from_millis(500);
/// If no response arrives for this long after the first unanswered question, commands are assumed lost. With
/// 30 % of the datagrams lost in each direction, all six questions of this time are lost once in a minute, which is a hold
/// until the next response.
const SILENCE: Duration = Duration::from_secs(3);

/// The questions and their responses. Sans-IO.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reach {
    next: Option<Time>,
    /// When the first question was sent that has no response yet.
    open: Option<Time>,
}

impl Reach {
    /// Starts over, with the first question one interval later.
    pub(super) fn begin(&mut self, now: Time) {
        *self = Self { next: Some(now + AGAIN), open: None };
    }

    /// Whether a question is due; it then counts as sent.
    pub(super) fn ask(&mut self, now: Time) -> bool {
        let due = self.next.is_some_and(|next| next <= now);
        if due {
            self.next = Some(now + AGAIN);
            self.open.get_or_insert(now);
        }
        due
    }

    /// A response arrived: to this question or to anything else, the drone has heard something.
    pub(super) fn answered(&mut self) {
        self.open = None;
    }

    /// Whether commands do not reach the drone, as far as can be known.
    pub(super) fn is_lost(&self, now: Time) -> bool {
        self.open.is_some_and(|open| now.since(open) >= SILENCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_response_within_three_seconds_of_the_first_open_question_is_enough() {
        let mut reach = Reach::default();
        assert!(!reach.ask(Time::from_millis(10_000)), "nothing is asked before the flight");
        reach.begin(Time::ZERO);
        let asked: Vec<u64> = (0..3000).filter(|ms| reach.ask(Time::from_millis(*ms))).collect();
        assert_eq!(asked, [500, 1000, 1500, 2000, 2500]);
        assert!(!reach.is_lost(Time::from_millis(3499)) && reach.is_lost(Time::from_millis(3500)));
        reach.answered();
        assert!(!reach.is_lost(Time::from_millis(9000)), "no question is open");
    }
}
