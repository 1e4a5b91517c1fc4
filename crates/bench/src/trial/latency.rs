//! Reply latencies set by the bench.

use spf_core::query::QueryKind;
use spf_core::rng::RandomStream;
use spf_core::time::duration_from_secs;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Vlm};

/// Maximum latency in a VLM name, seconds.
const LONGEST_S: f64 = 600.0;

/// Splits a VLM name into name and fixed latency in seconds: `oracle:default@3s`. Only an oracle's latency can be
/// fixed; for models an address follows `@`.
#[must_use]
pub fn split_latency(name: &str) -> (&str, Option<f64>) {
    let fixed = name.rsplit_once('@').filter(|(oracle, _)| *oracle == "oracle" || oracle.starts_with("oracle:"));
    let split = fixed.and_then(|(oracle, text)| {
        let seconds: f64 = text.strip_suffix('s')?.parse().ok()?;
        (0.0..=LONGEST_S).contains(&seconds).then_some((oracle, Some(seconds)))
    });
    split.unwrap_or((name, None))
}

/// A VLM with modified reply times. Detectors are not affected.
pub(super) struct Timed {
    pub(super) vlm: Box<dyn Vlm>,
    /// Fixed latency of every reply, seconds; `None` for the original one.
    pub(super) fixed: Option<f64>,
    /// Range of the additional delay, seconds, sampled per query.
    pub(super) delay: Option<[f64; 2]>,
    pub(super) seed: u64,
}

impl Vlm for Timed {
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
        let mut answer = self.vlm.answer(request, image);
        if matches!(request.query.kind, QueryKind::Detect { .. }) {
            return answer;
        }
        if let Some(seconds) = self.fixed {
            answer.latency = duration_from_secs(seconds);
        }
        if let Some([least, most]) = self.delay {
            let fraction = RandomStream::new(self.seed, "bench delay", &[request.query.id.0]).uniform();
            answer.latency += duration_from_secs(least + (most - least) * fraction);
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oracles_name_may_fix_its_latency() {
        assert_eq!(split_latency("oracle:default@3s"), ("oracle:default", Some(3.0)));
        assert_eq!(split_latency("oracle@0.5s"), ("oracle", Some(0.5)));
        for whole in ["oracle:default", "oracle@3", "oracle@-1s", "oracle@NaNs", "gemini@http://host:1/v1s", "vllm@3s"] {
            assert_eq!(split_latency(whole), (whole, None));
        }
    }
}
