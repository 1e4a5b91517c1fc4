//! When a second request is sent for a query that has had no reply yet.

use std::collections::VecDeque;
use std::str::FromStr;

use spf_core::time::{Duration, duration_from_secs};

/// The longest time that can be given, seconds.
const LONGEST_S: f64 = 600.0;
/// By itself, no second request is sent sooner than this, and not before as many replies are known.
const SOONEST: Duration = Duration::from_secs(4);
const LEAST_REPLIES: usize = 5;
/// The latencies of as many replies count; beyond one and a half times their 95th percentile a request is late.
const KEPT: usize = 100;
const PERCENTILE: f64 = 0.95;
const LATE: f64 = 1.5;
/// Second requests per query that are allowed in the long run, and how many may have been saved up.
const BUDGET: f64 = 0.1;
const SAVED: f64 = 2.0;

/// When a second request is sent. As text: seconds, or `auto`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hedge {
    /// After this time without a reply.
    After(Duration),
    /// Beyond what this model's replies take: after one and a half times the 95th percentile of the last 100 latencies, and at least 4 s;
    /// for at most one query in ten, so that a slow spell does not double the load.
    Auto,
}

impl FromStr for Hedge {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let seconds: f64 = text.parse().map_err(|_| ())?;
        if (0.0..=LONGEST_S).contains(&seconds) { Ok(Self::After(duration_from_secs(seconds))) } else { Err(()) }
    }
}

/// What [`Hedge::Auto`] knows of the replies so far.
#[derive(Clone, Debug)]
pub(crate) struct Replies {
    latencies: VecDeque<Duration>,
    allowed: f64,
}

impl Default for Replies {
    fn default() -> Self {
        Self { latencies: VecDeque::new(), allowed: 1.0 }
    }
}

impl Replies {
    /// A query is sent. After this time it is late; `None` if no second request may be sent for it.
    pub(crate) fn late_after(&mut self) -> Option<Duration> {
        self.allowed = (self.allowed + BUDGET).min(SAVED);
        if self.allowed < 1.0 || self.latencies.len() < LEAST_REPLIES {
            return None;
        }
        let mut sorted: Vec<Duration> = self.latencies.iter().copied().collect();
        sorted.sort_unstable();
        // Nearest rank.
        let rank = (PERCENTILE * sorted.len() as f64).ceil() as usize;
        Some(sorted[rank.clamp(1, sorted.len()) - 1].mul_f64(LATE).max(SOONEST))
    }

    /// A first request was replied to after this time, or had not been after it when the second one was.
    pub(crate) fn replied(&mut self, latency: Duration) {
        self.latencies.push_back(latency);
        if self.latencies.len() > KEPT {
            self.latencies.pop_front();
        }
    }

    /// A second request is sent.
    pub(crate) fn spend(&mut self) {
        self.allowed -= 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: fn(u64) -> Duration = Duration::from_secs;

    fn after(latencies: &[u64]) -> Replies {
        let mut replies = Replies::default();
        latencies.iter().for_each(|&latency| replies.replied(S(latency)));
        replies
    }

    #[test]
    fn late_is_beyond_one_and_a_half_times_the_95th_percentile_and_4_s() {
        assert_eq!(after(&[9; 4]).late_after(), None);
        assert_eq!(after(&[1; 20]).late_after(), Some(S(4)));
        // 19 of 20 are at most 6 s: nearest rank.
        let mut latencies = [2; 20];
        (latencies[3], latencies[7]) = (6, 40);
        assert_eq!(after(&latencies).late_after(), Some(S(9)));
        // Only the last 100 count.
        assert_eq!(after(&[&[300; 50][..], &[4; 100]].concat()).late_after(), Some(S(6)));
    }

    #[test]
    fn one_query_in_ten_may_have_a_second_request() {
        let mut replies = after(&[1; 20]);
        let mut second = 0;
        for _ in 0..200 {
            if replies.late_after().is_some() {
                replies.spend();
                second += 1;
            }
        }
        assert!((20..=22).contains(&second), "{second}");
        // What is not used is saved for two in a row, and no more.
        for _ in 0..100 {
            replies.late_after();
        }
        let mut in_a_row = 0;
        while in_a_row < 5 && replies.late_after().is_some() {
            replies.spend();
            in_a_row += 1;
        }
        assert_eq!(in_a_row, 2);
    }

    #[test]
    fn it_is_read_from_seconds_or_the_word() {
        assert_eq!("2.5".parse(), Ok(Hedge::After(Duration::from_millis(2500))));
        assert_eq!("auto".parse(), Ok(Hedge::Auto));
        for wrong in ["", "-1", "601", "NaN", "inf", "Auto", "2 s"] {
            assert_eq!(wrong.parse::<Hedge>(), Err(()), "{wrong}");
        }
    }
}
