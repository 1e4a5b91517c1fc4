//! A VLM in a world whose clock is not that of its answers.

use spf_core::query::QueryKind;
use spf_core::time::Duration;

use crate::{Answer, ImageSpec, QueryImage, QueryRequest, Vlm};

/// Time given to an answer for which nobody waits.
const UNHURRIED: Duration = Duration::from_secs(86_400);

/// A VLM with a latency of its own choosing: a person or a program takes its time while the simulation stands still.
pub struct Paced {
    vlm: Box<dyn Vlm>,
    latency: Option<Duration>,
    unhurried: bool,
}

impl Paced {
    /// Every answer counts as having taken `latency`, if given. `unhurried`: the answer itself may take a day, instead of
    /// the time left to the query.
    #[must_use]
    pub fn new(vlm: Box<dyn Vlm>, latency: Option<Duration>, unhurried: bool) -> Self {
        Self { vlm, latency, unhurried }
    }
}

impl Vlm for Paced {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.vlm.image_spec(camera)
    }

    fn temperature(&self) -> Option<f64> {
        self.vlm.temperature()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let mut request = request.clone();
        if self.unhurried {
            request.time_left = UNHURRIED;
        }
        let mut answer = self.vlm.answer(&request, image);
        // A detector behind the same interface is not the VLM.
        if !matches!(request.query.kind, QueryKind::Detect { .. }) {
            answer.latency = self.latency.unwrap_or(answer.latency);
        }
        answer
    }
}
