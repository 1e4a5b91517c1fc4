//! Progress display during a flight: one live line, and a line per decision.

use std::collections::BTreeMap;

use spf_core::time::{Duration, Time};
use spf_envelope::Cause;
use spf_flight::run::Observer;
use spf_flight::words;
use spf_pilot::{Action, Note, OperatorEvent, Phase, Pilot};

use crate::background::{Line, Lines};
use crate::printer::one_line;

/// Minimum interval of live line updates, in flight time: a lockstep flight runs far faster than one can read.
const LIVE_EVERY: Duration = Duration::from_millis(200);

/// A limit that applies again within this time is not printed again: near an obstacle it comes and goes with each measurement.
const SAME_LIMIT: Duration = Duration::from_secs(5);

/// Prints a flight's progress.
pub(crate) struct Progress {
    lines: Lines,
    shown: Time,
    flown: f64,
    at: Option<spf_core::geometry::EnuPosition>,
    limits: LastLimits,
    control: Control,
}

/// How the user controls a drone in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Control {
    /// By single keys.
    Keys,
    /// By typed lines: the user is the VLM.
    Lines,
    /// Not at all, except by signals.
    None,
}

/// When each limit of the envelope applied last.
#[derive(Default)]
struct LastLimits(BTreeMap<Cause, Time>);

impl LastLimits {
    /// Takes what the envelope does now; whether that needs no line: a limit of a rate, or a limit again a moment later.
    fn hides(&mut self, now: Time, cause: Cause) -> bool {
        let is_limit = cause.is_boundary() || matches!(cause, Cause::FloorLimit | Cause::Person);
        let is_again = is_limit && self.0.insert(cause, now).is_some_and(|at| now.since(at) < SAME_LIMIT);
        cause.is_rate() || is_again
    }
}

impl Progress {
    pub(crate) fn new(lines: Lines, control: Control) -> Self {
        Self { lines, shown: Time::ZERO, flown: 0.0, at: None, limits: LastLimits::default(), control }
    }

    fn note(&mut self, now: Time, note: &Note) {
        let line = match note {
            Note::Phase(Phase::Hovering) => {
                let may = match self.control {
                    Control::Keys => ": Enter opens a prompt for a new instruction, L lands, the arrow keys fly",
                    Control::Lines => ": type `land` and press Enter to land now",
                    Control::None => "",
                };
                format!("hovering for up to 60 s{may}")
            }
            Note::Phase(phase) => words::phase(*phase).to_owned(),
            Note::Decision(decision) => {
                format!("{:>2}. {}  [flown {:.1} m]", decision.number, words::decision(decision), self.flown)
            }
            Note::Envelope(cause) if self.limits.hides(now, *cause) => {
                tracing::debug!(at = now.as_secs_f64(), %cause, "envelope");
                return;
            }
            Note::Envelope(cause) => format!("envelope: {cause}"),
            Note::QueryFailed { reason, .. } => format!("no usable reply: {reason}"),
            Note::Around(around) => words::around(around),
            Note::Limited(why) => (*why).to_owned(),
            Note::LateReply(id) => format!("the reply to query {} came too late and is ignored", id.0),
            // A held key repeats its setpoint ten times per second; the phase is shown instead.
            Note::Operator(OperatorEvent::Setpoint(_)) | Note::OperatorIgnored(OperatorEvent::Setpoint(_), _) => return,
            Note::LetGo(news) => words::let_go(*news).to_owned(),
            Note::Operator(event) => format!("operator: {}", words::operator(event)),
            Note::OperatorIgnored(event, why) => format!("operator: {} ignored: {why}", words::operator(event)),
        };
        self.lines.send(Line::Say(format!("{:6.1} s  {}", now.as_secs_f64(), one_line(&line))));
    }
}

impl Observer for Progress {
    fn action(&mut self, now: Time, action: &Action, _pilot: &Pilot) {
        let at = now.as_secs_f64();
        match action {
            Action::Note(note) => self.note(now, note),
            Action::Ask(query) => tracing::debug!(at, query = query.id.0, frame = query.frame.0, "query"),
            Action::Track(start) => tracing::debug!(at, query = start.id.0, frame = start.frame.0, "track"),
            Action::Untrack => tracing::debug!(at, "no track"),
            Action::Cancel(id) => tracing::debug!(at, query = id.0, "query cancelled"),
            Action::Command(command) => tracing::trace!(at, command = ?command.get(), "to the craft"),
            Action::Finished(ending) => tracing::debug!(at, outcome = words::outcome(ending.outcome), "finished"),
        }
    }

    fn time(&mut self, now: Time, pilot: &Pilot) {
        if now.since(self.shown) < LIVE_EVERY {
            return;
        }
        self.shown = now;
        let position = pilot.known_pose(now).position;
        self.flown += self.at.map_or(0.0, |last| last.distance(position));
        self.at = Some(position);
        self.lines.send(Line::Live(format!(
            "{:6.1} s  {}  decision {}  flown {:.1} m  height {:.1} m",
            now.as_secs_f64(),
            words::phase(pilot.phase()),
            pilot.decisions(),
            self.flown,
            position.up,
        )));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_applies_again_soon_is_not_printed_again() {
        let mut last = LastLimits::default();
        let mut hides = |seconds: u64, cause| last.hides(Time::from_millis(seconds * 1000), cause);
        assert!(!hides(0, Cause::Obstacle));
        assert!(hides(4, Cause::Obstacle));
        assert!(!hides(5, Cause::FloorLimit));
        assert!(hides(6, Cause::Obstacle));
        assert!(hides(7, Cause::FloorLimit));
        assert!(!hides(11, Cause::Obstacle));
        // A craft at its cruise speed.
        assert!(hides(20, Cause::SpeedLimit));
        assert!(!hides(21, Cause::FrozenFrame));
        assert!(!hides(22, Cause::FrozenFrame));
    }
}
