//! Resources used by a query: time, tokens, bytes, cost.

use serde::{Deserialize, Serialize};

/// Resources used by one query, over all its requests.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Usage {
    /// HTTP requests, including retries, hedged requests and fallbacks; 0 for the oracle.
    pub requests: u32,
    /// Bytes of the last request's body.
    pub bytes_sent: u64,
    /// Timing of the request that was answered.
    pub parts: StageTimes,
    /// Tokens over all requests that reported them.
    pub tokens: Tokens,
    /// Cost in US dollars, according to the price table; `None` if no price is known.
    pub cost_usd: Option<f64>,
    /// The model that was asked for, if a vendor let another one answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked_model: Option<String>,
}

/// Timing of a request, seconds from its start; `None` for stages not reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// The image was rendered and encoded.
    pub encoded_s: Option<f64>,
    /// The connection accepted the last part of the request; the operating system may still buffer some of it.
    pub uploaded_s: Option<f64>,
    /// The response headers arrived.
    pub head_s: Option<f64>,
    /// The first part of the reply text arrived.
    pub first_text_s: Option<f64>,
    /// The reply was complete.
    pub complete_s: Option<f64>,
}

impl StageTimes {
    /// Duration of each part, seconds: encoding, upload (including connecting and earlier failed attempts), time to
    /// first text, rest of the reply; `None` for stages not reached.
    #[must_use]
    pub fn durations(&self) -> [Option<f64>; 4] {
        let between = |from: Option<f64>, to: Option<f64>| Some((to? - from?).max(0.0));
        [
            self.encoded_s,
            between(self.encoded_s, self.uploaded_s),
            between(self.uploaded_s, self.first_text_s),
            between(self.first_text_s, self.complete_s),
        ]
    }
}

/// Token counts, as reported by the vendor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tokens {
    /// Input tokens, including cached ones.
    pub input: u64,
    /// Input tokens read from a cache.
    pub cached: u64,
    /// Output tokens, without reasoning.
    pub output: u64,
    /// Reasoning tokens.
    pub thinking: u64,
    /// True if a stream was cut off before it reported its counts, so that these are estimates.
    pub estimated: bool,
}

impl Tokens {
    /// True if no tokens were counted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.input == 0 && self.output == 0 && self.thinking == 0
    }

    /// Adds the tokens of another request.
    pub fn add(&mut self, other: &Self) {
        self.input += other.input;
        self.cached += other.cached;
        self.output += other.output;
        self.thinking += other.thinking;
        self.estimated |= other.estimated;
    }
}

impl Usage {
    /// Adds another request of the same query; the timing stays that of the request that was answered.
    pub fn add(&mut self, other: &Self) {
        self.requests += other.requests;
        self.bytes_sent = self.bytes_sent.max(other.bytes_sent);
        self.tokens.add(&other.tokens);
        if other.asked_model.is_some() {
            self.asked_model.clone_from(&other.asked_model);
        }
        self.cost_usd = match (self.cost_usd, other.cost_usd) {
            (Some(a), Some(b)) => Some(a + b),
            (a, b) => a.or(b),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_carried_out_one_after_the_other() {
        let parts = StageTimes {
            encoded_s: Some(0.25),
            uploaded_s: Some(0.5),
            head_s: Some(0.75),
            first_text_s: Some(1.5),
            complete_s: Some(2.0),
        };
        assert_eq!(parts.durations(), [Some(0.25), Some(0.25), Some(1.0), Some(0.5)]);
        assert_eq!(
            StageTimes { first_text_s: None, complete_s: None, ..parts }.durations(),
            [Some(0.25), Some(0.25), None, None]
        );
        // Recordings made before upload times were recorded.
        let old: StageTimes =
            serde_json::from_str(r#"{"encoded_s":0.1,"head_s":0.2,"first_text_s":0.3,"complete_s":0.4}"#).unwrap();
        assert_eq!(old.uploaded_s, None);
    }
}
