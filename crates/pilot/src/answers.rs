//! The answers on which a flight has decided: how many, which of them led on, and which were refused.

use spf_core::motion::MotionEstimate;
use spf_envelope::Limits;

use crate::event::{Ending, Outcome};
use crate::policy::Output;
use crate::progress::Progress;
use crate::refused::{IN_A_ROW, Refused, named};
use crate::settings::{Counted, PilotSettings};

/// The decisions of a flight that count against its limits.
#[derive(Debug, Default)]
pub(crate) struct Answers {
    decisions: u32,
    /// Those before the current instruction.
    earlier: u32,
    progress: Progress,
    pub(crate) refused: Refused,
}

impl Answers {
    /// Counts a decision, which is made here. What became of the motion of the one before is known now.
    pub(crate) fn decided(&mut self, known: &MotionEstimate) {
        self.decisions += 1;
        self.progress.answered(known.position);
        self.refused.answered(known.position, known.attitude.heading);
    }

    /// Number of decisions so far.
    pub(crate) fn decisions(&self) -> u32 {
        self.decisions
    }

    /// Takes what the policy makes of an answer. Returns why the flight ends instead, if a limit has refused too many before it.
    pub(crate) fn take(&mut self, output: &Output, limits: &Limits) -> Option<Ending> {
        self.progress.read(&output.reading);
        self.refused.ends(&output.step).map(|limit| refusal(&named(limit, limits)))
    }

    /// Why no further answer is asked for, if a limit has refused the motion of too many, with the last one, which is over.
    pub(crate) fn refusal(&self, known: &MotionEstimate, limits: &Limits) -> Option<Ending> {
        let limit = self.refused.over(known.position, known.attitude.heading)?;
        Some(refusal(&named(limit, limits)))
    }

    /// The limit on decisions in words, if it is reached.
    pub(crate) fn spent(&self, settings: &PilotSettings) -> Option<String> {
        let (counted, which) = match settings.counted {
            Counted::All => (self.decisions - self.earlier, ""),
            Counted::WithoutProgress => (self.progress.since(), " without progress"),
        };
        let limit = settings.max_decisions;
        (counted >= limit).then(|| format!("the limit of {limit} decisions{which} was reached"))
    }

    /// Another instruction is flown: where the craft was for the one before is no progress of this one.
    pub(crate) fn begin_anew(&mut self) {
        self.progress = Progress::default();
        self.refused.reset();
    }

    /// Decisions count afresh.
    pub(crate) fn count_anew(&mut self) {
        self.earlier = self.decisions;
    }
}

/// The end of a flight whose motion this limit refuses.
fn refusal(limit: &str) -> Ending {
    Ending::new(Outcome::Aborted, format!("{limit} refused the motion of {IN_A_ROW} answers in a row"))
}
