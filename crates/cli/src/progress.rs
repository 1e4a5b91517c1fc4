//! What a person sees while it flies: one live line, and a line a decision.

use spf_core::pilot::{Action, Note, OperatorEvent, Pilot};
use spf_core::time::{Duration, Time};
use spf_flight::run::Observer;
use spf_flight::words;

use crate::printer::Printer;

/// The live line changes this often at most, in flight time: a lockstep flight runs a hundred times as fast as one can read.
const LIVE_EVERY: Duration = Duration::from_millis(200);

/// Prints a flight's progress.
pub(crate) struct Progress<'a> {
    printer: &'a Printer,
    shown: Time,
    flown: f64,
    at: Option<spf_core::geometry::EnuPosition>,
}

impl<'a> Progress<'a> {
    pub(crate) fn new(printer: &'a Printer) -> Self {
        Self { printer, shown: Time::ZERO, flown: 0.0, at: None }
    }

    fn note(&self, now: Time, note: &Note) {
        let at = format!("{:6.1} s ", now.as_secs_f64());
        match note {
            Note::Phase(phase) => self.printer.say(&format!("{at} {}", words::phase(*phase))),
            Note::Decision(decision) => {
                let line = words::decision(decision);
                self.printer.say(&format!("{at} {:>2}. {line}  [flown {:.1} m]", decision.number, self.flown));
            }
            Note::Envelope(cause) => self.printer.say(&format!("{at} envelope: {cause}")),
            Note::QueryFailed { reason, .. } => self.printer.say(&format!("{at} no usable answer: {reason}")),
            Note::LateReply(id) => self.printer.say(&format!("{at} answer {} came too late and moves nothing", id.0)),
            // A held key repeats its setpoint ten times a second; the phase says enough.
            Note::Operator(OperatorEvent::Setpoint(_)) | Note::OperatorIgnored(OperatorEvent::Setpoint(_), _) => {}
            Note::Operator(event) => self.printer.say(&format!("{at} operator: {}", operator(event))),
            Note::OperatorIgnored(event, why) => self.printer.say(&format!("{at} operator: {} ignored: {why}", operator(event))),
        }
    }
}

fn operator(event: &OperatorEvent) -> String {
    match event {
        OperatorEvent::Hold => "hold".to_owned(),
        OperatorEvent::Resume => "resume".to_owned(),
        OperatorEvent::Setpoint(_) => "setpoint".to_owned(),
        OperatorEvent::Instruction(text) => format!("new instruction \"{text}\""),
        OperatorEvent::Land => "land".to_owned(),
        OperatorEvent::Stop => "stop the motors".to_owned(),
    }
}

impl Observer for Progress<'_> {
    fn action(&mut self, now: Time, action: &Action, _pilot: &Pilot) {
        if let Action::Note(note) = action {
            self.note(now, note);
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
        self.printer.live(&format!(
            "{:6.1} s  {}  decision {}  flown {:.1} m  height {:.1} m",
            now.as_secs_f64(),
            words::phase(pilot.phase()),
            pilot.decisions(),
            self.flown,
            position.up,
        ));
    }
}
