//! A model that follows a script, and fails from some time on.

use spf_core::query::QueryKind;
use spf_core::time::{Duration, Time};
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use super::faults::ModelFault;

/// Flies along a circle, or finds nothing.
pub(crate) struct Scripted {
    /// Whether it never sees the target.
    pub(crate) searching: bool,
    /// Start and kind of its failure.
    pub(crate) fault: Option<(Time, ModelFault)>,
}

const CIRCLE: &str = r#"{"status":"navigating","target":"door","point":[500,800],"depth":4,"boxes":[]}"#;
const SEARCH: &str = r#"{"status":"not_visible","look":"right"}"#;
const LIE: &str = r#"{"status":"navigating","target":"door","point":[200,20],"depth":10,"boxes":[]}"#;
const LATENCY: Duration = Duration::from_millis(1200);

impl Vlm for Scripted {
    fn name(&self) -> &str {
        "scripted"
    }

    fn image_spec(&self, _camera: (u32, u32)) -> ImageSpec {
        ImageSpec::default()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, _image: &mut dyn QueryImage) -> Answer {
        assert!(matches!(request.query.kind, QueryKind::Point { .. }));
        let usual = if self.searching { SEARCH } else { CIRCLE };
        // A query is answered at its deadline less the time left.
        let now = request.query.deadline - request.time_left;
        let host = || "model.example".to_owned();
        let vendor = |status, message: &str| {
            let (code, message) = (None, message.to_owned());
            Err(VlmError::Vendor { host: host(), status, code, message, retry_after: None })
        };
        let (text, latency) = match self.fault.filter(|(from, _)| now >= *from).map(|(_, fault)| fault) {
            None => (Ok(usual.to_owned()), LATENCY),
            Some(ModelFault::Silent) => (Ok(usual.to_owned()), Duration::from_secs(10_000)),
            Some(ModelFault::RateLimit) => (vendor(429, "slow down"), LATENCY),
            Some(ModelFault::Unavailable) => (vendor(503, "overloaded"), LATENCY),
            Some(ModelFault::Refusal) => (Ok("I can't help with flying a drone at people.".to_owned()), LATENCY),
            Some(ModelFault::Lie) => (Ok(LIE.to_owned()), LATENCY),
            Some(ModelFault::Late) => (Ok(usual.to_owned()), Duration::from_secs(15)),
            Some(ModelFault::Malformed) => (Ok(usual.split_at(usual.len() / 2).0.to_owned()), LATENCY),
        };
        Answer { text, latency, model: "scripted".to_owned(), account: Usage::default() }
    }
}
