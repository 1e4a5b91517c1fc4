//! How old an order is: it names the beat that its page had seen when it was given.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// An order given on a beat that was sent longer ago than this is dropped.
const OLD: Duration = Duration::from_secs(1);
/// Maximum number of beats remembered, a minute of them: what is older is too old whatever its age.
const TICKS_KEPT: usize = 240;

/// Why an order is dropped.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(super) enum Stale {
    #[error("it arrived {:.1} s late", .0.as_secs_f64())]
    Late(Duration),
    #[error("a later order arrived before it")]
    Overtaken,
    #[error("its page has seen no beat of this connection, or too long ago")]
    Unseen,
}

/// The beats sent to one page, and the newest order that came back.
#[derive(Debug, Default)]
pub(super) struct Ticks {
    sent: VecDeque<Instant>,
    /// Number of the last beat sent, from 1.
    last: u64,
    /// The newest order so far: its number, and the beat that it names.
    newest: (u64, u64),
}

impl Ticks {
    /// The number of a beat that is sent now.
    pub(super) fn beat(&mut self, now: Instant) -> u64 {
        if self.sent.len() >= TICKS_KEPT {
            self.sent.pop_front();
        }
        self.sent.push_back(now);
        self.last += 1;
        self.last
    }

    /// When a beat was sent; `None` if it was not, or long ago.
    fn sent_at(&self, tick: u64) -> Option<Instant> {
        let back = usize::try_from(self.last.checked_sub(tick)?).ok()?;
        self.sent.get(self.sent.len().checked_sub(back + 1)?).copied()
    }

    /// Judges an order by its number and the beat that it names, and remembers it as the newest one if it is.
    pub(super) fn judge(&mut self, id: u64, tick: Option<u64>, now: Instant) -> Result<(), Stale> {
        let (newest_id, newest_tick) = self.newest;
        let seen = tick.and_then(|tick| Some((tick, self.sent_at(tick)?)));
        if let Some((tick, _)) = seen {
            self.newest = (newest_id.max(id), newest_tick.max(tick));
        }
        let (tick, at) = seen.ok_or(Stale::Unseen)?;
        let age = now.saturating_duration_since(at);
        if age > OLD {
            Err(Stale::Late(age))
        } else if id <= newest_id || tick < newest_tick {
            Err(Stale::Overtaken)
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn an_order_counts_for_a_second_after_the_beat_that_its_page_has_seen() {
        let (mut ticks, began) = (Ticks::default(), Instant::now());
        assert_eq!(ticks.judge(1, Some(0), began), Err(Stale::Unseen));
        assert_eq!((ticks.beat(began), ticks.beat(began + ms(250))), (1, 2));
        assert_eq!(ticks.judge(2, Some(1), began + ms(1000)), Ok(()));
        assert_eq!(ticks.judge(3, Some(1), began + ms(1001)), Err(Stale::Late(ms(1001))));
        assert_eq!(ticks.judge(4, Some(2), began + ms(1001)), Ok(()));
        assert_eq!(ticks.judge(4, Some(2), began + ms(1002)), Err(Stale::Overtaken), "the same once more");
        assert_eq!(ticks.judge(5, Some(1), began + ms(900)), Err(Stale::Overtaken), "given on an earlier beat");
        assert_eq!(ticks.judge(6, Some(3), began + ms(1002)), Err(Stale::Unseen), "not sent yet");
        assert_eq!(ticks.judge(7, None, began + ms(1002)), Err(Stale::Unseen));
        assert_eq!(ticks.judge(8, Some(2), began + ms(1003)), Ok(()));
    }

    proptest! {
        #[test]
        fn whatever_a_page_names_only_a_fresh_beat_counts(
            orders in proptest::collection::vec((any::<u64>(), proptest::option::of(0..2000_u64), 0..400_u64), 1..400),
        ) {
            let (mut ticks, began, mut now) = (Ticks::default(), Instant::now(), 0);
            let (mut sent, mut last): (Vec<u64>, Option<(u64, u64)>) = (Vec::new(), None);
            for (id, tick, later) in orders {
                now += later;
                sent.push(now);
                prop_assert_eq!(ticks.beat(began + ms(now)), sent.len() as u64);
                if ticks.judge(id, tick, began + ms(now)).is_ok() {
                    let tick = tick.unwrap();
                    let at = sent[usize::try_from(tick).unwrap() - 1];
                    prop_assert!(now - at <= 1000);
                    prop_assert!(last.is_none_or(|(before, seen)| id > before && tick >= seen));
                    last = Some((id, tick));
                }
            }
            prop_assert!(ticks.sent.len() <= TICKS_KEPT);
        }
    }
}
