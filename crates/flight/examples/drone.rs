//! A drone of one's own (`toy/mod.rs`), flown by the library with nothing else touched: pilot, policy, envelope and log are those of
//! every flight. Who points is a few lines that look for red.
//!
//! `cargo run -p spf-flight --example drone`

#![allow(clippy::print_stdout, reason = "an example's output")]

mod toy;

use std::sync::Arc;

use spf_core::time::Duration;
use spf_flight::flight::{self, FlightError, FlightPlan, Flown, Site};
use spf_flight::real::Real;
use spf_flight::site::Clock;
use spf_vlm::{Account, Answer, Asked, QueryImage, Vlm, VlmError};

/// Points at what is red in the picture, and says how far a ball of a metre is that looks so large.
struct SeesRed;

impl SeesRed {
    fn look(picture: &mut dyn QueryImage) -> Result<String, VlmError> {
        let pixels = picture.pixels()?;
        let (width, height) = (f64::from(pixels.width()), f64::from(pixels.height()));
        let (mut red, mut x, mut y) = (0.0, 0.0, 0.0);
        for (at, pixel) in pixels.data().chunks_exact(3).enumerate() {
            if pixel[0] > 180 && pixel[1] < 80 {
                red += 1.0;
                x += (at as f64 % width) / width;
                y += (at as f64 / width).floor() / height;
            }
        }
        if red < 4.0 {
            return Ok(
                r#"{"status":"not_visible","look":"right","stage":null,"point":null,"depth":null,"target":null}"#.to_owned()
            );
        }
        // Radius 0.5 m, and a picture about as wide as the ball's distance: some 0.9 widths to the focal length.
        let range = 0.5 * 0.9 * width / (red / core::f64::consts::PI).sqrt();
        // Depth labels count the logarithm of range: 1 at 1 m, 10 at 100 m.
        let (depth, status) = (1.0 + 4.5 * range.max(1.0).log10(), if range < 2.0 { "done" } else { "navigating" });
        let (x, y, depth) = (1000.0 * x / red, 1000.0 * y / red, depth.round());
        Ok(format!(r#"{{"status":"{status}","look":null,"stage":1,"point":[{y:.0},{x:.0}],"depth":{depth},"target":"ball"}}"#))
    }
}

impl Vlm for SeesRed {
    fn name(&self) -> &str {
        "red"
    }

    fn answer(&mut self, _asked: &Asked<'_>, picture: &mut dyn QueryImage) -> Answer {
        let (latency, model) = (Duration::from_millis(300), "red".to_owned());
        Answer { text: Self::look(picture), latency, model, account: Account::default() }
    }
}

/// Flies to the ball, as fast as the machine can.
pub(crate) fn fly() -> Result<Flown, FlightError> {
    let site = Site::Real(Real { drone: Box::<toy::Toy>::default(), clock: Clock::Virtual });
    let plan = FlightPlan::new(site, "fly to the red ball", "red", Arc::new(|_, _| Ok(Box::new(SeesRed))));
    flight::fly(plan, &mut [])
}

fn main() -> Result<(), FlightError> {
    let summary = fly()?.summary;
    println!("{:?} ({}) after {} decisions", summary.outcome, summary.cause, summary.decisions);
    Ok(())
}
