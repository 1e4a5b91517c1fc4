//! What a question took: time in parts, tokens, bytes, money.

use serde::{Deserialize, Serialize};

/// What one question took, all its requests together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// Requests sent for it, retries, hedges and fallbacks included; 0 for the oracle.
    pub requests: u32,
    /// Bytes of the last request's body.
    pub bytes_sent: u64,
    /// Where the time went, of the request that answered.
    pub parts: Parts,
    /// Tokens of every request that told them.
    pub tokens: Tokens,
    /// Cost in US dollars, by the table's prices; none where no price is known.
    pub cost_usd: Option<f64>,
}

/// Where the time of a request went, seconds from its beginning; none for what was not reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parts {
    /// The image drawn and encoded.
    pub encoded_s: Option<f64>,
    /// The request's last piece taken by the connection; the operating system may hold some of it still.
    #[serde(default)]
    pub uploaded_s: Option<f64>,
    /// The answer's head there.
    pub head_s: Option<f64>,
    /// The first piece of the answer's text there.
    pub first_text_s: Option<f64>,
    /// The answer complete.
    pub complete_s: Option<f64>,
}

impl Parts {
    /// What each part took, seconds: encoding, upload (with connecting and what was asked before in vain), waiting for the first
    /// text, the rest of the answer; none for what was not reached.
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

/// Tokens as the vendor counted them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tokens {
    /// Read, cached ones included.
    pub input: u64,
    /// Of those, read from a cache.
    pub cached: u64,
    /// Written, without thinking.
    pub output: u64,
    /// Thought.
    pub thinking: u64,
    /// True when a stream was cut before its count came, so that these are guesses.
    pub estimated: bool,
}

impl Tokens {
    /// Nothing was counted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.input == 0 && self.output == 0 && self.thinking == 0
    }

    /// Adds another request's.
    pub fn add(&mut self, other: &Self) {
        self.input += other.input;
        self.cached += other.cached;
        self.output += other.output;
        self.thinking += other.thinking;
        self.estimated |= other.estimated;
    }
}

impl Account {
    /// Adds what another request of the same question took; the parts stay those of the one that answered.
    pub fn add(&mut self, other: &Self) {
        self.requests += other.requests;
        self.bytes_sent = self.bytes_sent.max(other.bytes_sent);
        self.tokens.add(&other.tokens);
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
    fn parts_are_told_one_after_the_other() {
        let parts = Parts {
            encoded_s: Some(0.25),
            uploaded_s: Some(0.5),
            head_s: Some(0.75),
            first_text_s: Some(1.5),
            complete_s: Some(2.0),
        };
        assert_eq!(parts.durations(), [Some(0.25), Some(0.25), Some(1.0), Some(0.5)]);
        assert_eq!(Parts { first_text_s: None, complete_s: None, ..parts }.durations(), [Some(0.25), Some(0.25), None, None]);
        // Recordings from before uploads were noted.
        let old: Parts = serde_json::from_str(r#"{"encoded_s":0.1,"head_s":0.2,"first_text_s":0.3,"complete_s":0.4}"#).unwrap();
        assert_eq!(old.uploaded_s, None);
    }
}
