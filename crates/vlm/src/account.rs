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
    /// The picture drawn and encoded.
    pub encoded_s: Option<f64>,
    /// The request sent and the answer's head there.
    pub head_s: Option<f64>,
    /// The first piece of the answer's text there.
    pub first_text_s: Option<f64>,
    /// The answer complete.
    pub complete_s: Option<f64>,
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
