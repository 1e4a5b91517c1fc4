//! A custom drone (`toy/mod.rs`) flown by the unmodified library: pilot, policy, envelope and log are those of every
//! flight. The VLM is a few lines that look for red.
//!
//! `cargo run -p spf-api --example drone`

#![allow(clippy::print_stdout, reason = "an example's output")]

mod red;
mod toy;

use std::sync::Arc;

use spf_core::time::Duration;
use spf_flight::flight::{self, FlightError, FlightPlan, Flown, Site};
use spf_flight::real::Real;
use spf_flight::sim::VlmFactory;
use spf_flight::site::Clock;
use spf_vlm::{Answer, QueryImage, QueryRequest, Usage, Vlm, VlmError};

/// Points at red in the image, with the depth label of a ball one metre across that appears this large.
struct SeesRed;

impl SeesRed {
    fn look(image: &mut dyn QueryImage) -> Result<String, VlmError> {
        let Some(spot) = red::find(&image.pixels()?) else {
            let reply = r#"{"status":"not_visible","look":"right","stage":null,"point":null,"depth":null,"target":null}"#;
            return Ok(reply.to_owned());
        };
        let (x, y, depth, status) = (1000.0 * spot.u, 1000.0 * spot.v, spot.depth(), spot.status());
        Ok(format!(r#"{{"status":"{status}","look":null,"stage":1,"point":[{y:.0},{x:.0}],"depth":{depth},"target":"ball"}}"#))
    }
}

impl Vlm for SeesRed {
    fn name(&self) -> &str {
        "red"
    }

    fn answer(&mut self, _request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let (latency, model) = (Duration::from_millis(300), "red".to_owned());
        Answer { text: Self::look(image), latency, model, account: Usage::default() }
    }
}

/// Creates a `SeesRed` for each flight.
pub(crate) fn sees_red() -> VlmFactory {
    Arc::new(|_, _| Ok(Box::new(SeesRed)))
}

/// Flies to the ball, as fast as the machine can.
pub(crate) fn fly(vlm: &str, vlm_factory: VlmFactory) -> Result<Flown, FlightError> {
    let site = Site::Real(Real { drone: Box::<toy::Toy>::default(), clock: Clock::Virtual });
    let plan = FlightPlan::new(site, "fly to the red ball", vlm, vlm_factory);
    flight::fly(plan, &mut [])
}

fn main() -> Result<(), FlightError> {
    let summary = fly("red", sees_red())?.summary;
    println!("{:?} ({}) after {} decisions", summary.outcome, summary.cause, summary.decisions);
    Ok(())
}
