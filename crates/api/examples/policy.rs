//! A custom policy, flown in the simulator: a square of three metres. It sends no query; a policy that does answers a
//! frame with `Step::Ask` and a reply with a move.
//!
//! `cargo run -p spf-api --example policy`

#![allow(clippy::print_stdout, reason = "an example's output")]

use std::error::Error;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use spf_core::primitives::Primitives;
use spf_core::prompt::PromptKind;
use spf_flight::flight::{self, FlightPlan, Flown, Site};
use spf_flight::pilot::{PolicyMaker, PolicyParts};
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;
use spf_pilot::policy::{Move, Output, Policy, PolicyEvent, Step};

/// Flies sides until there are four.
struct Square {
    sides: u32,
}

impl Policy for Square {
    fn name(&self) -> &'static str {
        "square"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let step = match event {
            // An instruction, the first or an operator's new one, restarts the policy.
            PolicyEvent::Instruction(_) => {
                self.sides = 0;
                Step::Look
            }
            PolicyEvent::Frame(_) if self.sides == 4 => Step::Done,
            PolicyEvent::Frame(_) => {
                self.sides += 1;
                let primitives = Primitives { yaw: FRAC_PI_2, forward: 3.0, ..Primitives::default() };
                Step::Move(Move { primitives, anchor: None, then_rest: true, looks: false })
            }
            _ => Step::Wait,
        };
        step.into()
    }
}

/// Number of sides to fly.
pub(crate) fn square(sides: u32) -> impl Policy {
    Square { sides }
}

/// Creates a policy for each flight.
struct Squares;

impl PolicyMaker for Squares {
    fn name(&self) -> &str {
        "square"
    }

    fn prompt(&self) -> PromptKind {
        // Unused: the policy sends no query.
        PromptKind::Point
    }

    fn policy(&self, _parts: PolicyParts) -> Box<dyn Policy> {
        Box::new(square(0))
    }
}

/// Flies it over the plaza of the city.
pub(crate) fn fly() -> Result<Flown, Box<dyn Error>> {
    let site = Site::Simulated(Simulated::new(Arc::new(LoadedScene::load("city")?), "city"));
    let vlm_factory = oracle_factory("oracle".to_owned(), ErrorFile::default());
    let plan = FlightPlan { policy: Arc::new(Squares), ..FlightPlan::new(site, "fly a square", "oracle", vlm_factory) };
    Ok(flight::fly(plan, &mut [])?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let summary = fly()?.summary;
    println!("{:?} after {:.1} m", summary.outcome, summary.path_length_m);
    Ok(())
}
