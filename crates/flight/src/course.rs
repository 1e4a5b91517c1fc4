//! The course of a flight, as its summary tells it.

use spf_core::time::Time;
use spf_pilot::{Action, Ending, Event, Note, OperatorEvent, Outcome, Pilot};

use crate::log::FlightHeader;
use crate::run::Observer;
use crate::site::Judge;
use crate::summary::Summary;

/// Maximum number of instructions of a flight that are kept.
const MOST_INSTRUCTIONS: usize = 100;

/// The course of a flight as seen by its judge: instructions and ending.
pub(crate) struct Course {
    /// The instructions so far; the last one is the current one.
    instructions: Vec<String>,
    /// Whether an answer to the current one was that it is fulfilled.
    said_done: bool,
    judge: Box<dyn Judge>,
    settled: Option<Settled>,
}

/// The outcome.
struct Settled {
    at: Time,
    instructions: Vec<String>,
    said_done: bool,
    ending: Ending,
}

impl Observer for Course {
    fn event(&mut self, now: Time, event: &Event) {
        self.judge.event(now, event);
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        self.judge.action(now, action, pilot);
        match action {
            Action::Finished(ending) => {
                self.judge.settle(now, self.instructions.last().map_or("", String::as_str));
                let (instructions, said_done) = (self.instructions.clone(), self.said_done);
                self.settled = Some(Settled { at: now, instructions, said_done, ending: ending.clone() });
            }
            Action::Note(Note::Decision(decision)) => self.said_done |= decision.reading.is_done(),
            // One that was given again, as after a correction, is still the same.
            Action::Note(Note::Operator(OperatorEvent::Instruction(text))) if self.instructions.last() != Some(text) => {
                if self.instructions.len() >= MOST_INSTRUCTIONS {
                    // The first one names the flight.
                    self.instructions.remove(1);
                }
                self.instructions.push(text.clone());
                self.said_done = false;
            }
            _ => {}
        }
    }

    fn time(&mut self, now: Time, pilot: &Pilot) {
        self.judge.time(now, pilot);
    }
}

impl Course {
    /// The course of a flight that begins with this instruction.
    pub(crate) fn new(instruction: &str, judge: Box<dyn Judge>) -> Self {
        Self { instructions: vec![instruction.to_owned()], said_done: false, judge, settled: None }
    }

    /// What is known at the end.
    pub(crate) fn summary(self, head: &FlightHeader, seed: u64, pilot: &Pilot) -> Summary {
        let Settled { at, instructions: mut earlier_instructions, said_done, ending } = self.settled.unwrap_or_else(|| Settled {
            at: Time::ZERO,
            instructions: self.instructions,
            said_done: false,
            ending: Ending { outcome: Outcome::Failed, cause: "the flight ended without an outcome".to_owned() },
        });
        let mut summary = Summary {
            format: 1,
            instruction: earlier_instructions.pop().unwrap_or_default(),
            earlier_instructions,
            outcome: ending.outcome,
            cause: ending.cause,
            verified: None,
            verified_by: None,
            not_read: Vec::new(),
            completion_time_s: pilot.first_motion().map(|first| at.since(first).as_secs_f64()),
            finished_at_s: at.as_secs_f64(),
            path_length_m: 0.0,
            decisions: pilot.decisions(),
            final_distance_m: None,
            collisions: None,
            touched: Vec::new(),
            followed: None,
            targets: Vec::new(),
            target_in_view: None,
            seed,
            vlm: head.vlm.clone(),
            detector: head.detector.clone(),
            depth_model: head.depth_model.clone(),
            preset: head.preset,
            policy: head.policy.clone(),
            settings: head.settings,
            scene: String::new(),
            light: String::new(),
            weather: String::new(),
            drone: head.drone.clone(),
            drone_model: String::new(),
            wind: None,
            battery: None,
            camera_effects: None,
            late_replies: pilot.late_replies(),
            glass_to_decision: None,
            not_recorded: Vec::new(),
            prompt: None,
            vlm_use: None,
        };
        self.judge.tell(&mut summary);
        summary.tell_truth(said_done);
        summary
    }
}
