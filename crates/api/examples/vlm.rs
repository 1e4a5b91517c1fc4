//! A custom vision-language model: it receives a query and an image, and returns text. This one points at the brightest
//! place in the image.
//!
//! `cargo run -p spf-api --example vlm`

#![allow(clippy::print_stdout, reason = "an example's output")]

use std::error::Error;
use std::sync::Arc;

use spf_core::time::Duration;
use spf_flight::flight::{self, FlightPlan, Flown, Site};
use spf_flight::sim::{LoadedScene, Simulated};
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

/// Counts its queries.
#[derive(Default)]
struct Lightest(u32);

impl Lightest {
    /// A real model would be called here: `request.query.prompt` is its prompt, `image` its image, and
    /// `request.time_left` the time it may take. The common parser reads its text (docs/reference/reply.md).
    fn ask(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Result<String, VlmError> {
        self.0 += 1;
        if self.0 > 3 || request.query.memory.confirming {
            return Ok(r#"{"status":"done","look":null,"stage":null,"point":null,"depth":null,"target":null}"#.to_owned());
        }
        let jpeg = image.jpeg((64, 48), 80)?;
        let small = spf_media::jpeg::decode(&jpeg).map_err(|error| VlmError::Image(error.to_string()))?;
        let light = |(_, pixel): &(usize, &[u8])| pixel.iter().map(|byte| u32::from(*byte)).sum::<u32>();
        let at = small.data().chunks_exact(3).enumerate().max_by_key(light).map_or(0, |(at, _)| at);
        // In the coordinates stated by `image_spec`: [y, x] in thousandths.
        let (x, y) = (1000 * (at % 64) / 64, 1000 * (at / 64) / 48);
        Ok(format!(r#"{{"status":"navigating","look":null,"stage":1,"point":[{y},{x}],"depth":3,"target":"light"}}"#))
    }
}

impl Vlm for Lightest {
    fn name(&self) -> &str {
        "lightest"
    }

    fn image_spec(&self, _camera: (u32, u32)) -> ImageSpec {
        ImageSpec { image_size: Some((64, 48)), ..ImageSpec::default() }
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        // The latency that the flight assumes. A fixed one makes runs repeatable; that of a real model is measured.
        let (latency, model) = (Duration::from_secs(1), "lightest".to_owned());
        Answer { text: self.ask(request, image), latency, model, account: Usage::default() }
    }
}

/// Three steps in the office.
pub(crate) fn fly() -> Result<Flown, Box<dyn Error>> {
    let site = Site::Simulated(Simulated::new(Arc::new(LoadedScene::load("office")?), "office"));
    let plan = FlightPlan::new(site, "fly to the light", "lightest", Arc::new(|_, _| Ok(Box::<Lightest>::default())));
    Ok(flight::fly(plan, &mut [])?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let summary = fly()?.summary;
    println!("{:?} ({}) after {} decisions", summary.outcome, summary.cause, summary.decisions);
    Ok(())
}
