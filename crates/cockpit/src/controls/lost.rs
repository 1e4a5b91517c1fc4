//! Watches over the page that flies, and over its flight if it is lost.

use std::time::{Duration, Instant};

use serde_json::json;
use spf_pilot::OperatorEvent;

use super::{CHECK, Controls, Inner, LOST_AFTER};
use crate::hub::json;

/// A flight that only a lost page controls lands after this time of holding.
const LAND_AFTER: Duration = Duration::from_secs(20);
/// A check that is later than this does not count the time against the page: its answers waited for the same thread.
const LATE: Duration = Duration::from_millis(250);

/// What was done about a lost page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lost {
    Noticed,
    Left,
    Abandoned,
}

impl Controls {
    /// Watches over the page that flies. Returns a new secret to print, if the one-time address was used and its page is gone.
    pub(crate) fn check(&self, now: Instant) -> Option<String> {
        let mut inner = self.inner();
        inner.forgive(now);
        if let Some(pilot) = inner.pilot
            && inner.lost.is_none()
            && inner.pages.get(&pilot).is_none_or(|page| now.duration_since(page.heard) >= LOST_AFTER + page.forgiven)
        {
            inner.lost = Some((now, Lost::Noticed));
            inner.tell_roles();
        }
        let (since, done) = inner.lost?;
        let away = now.duration_since(since);
        let only = inner.flight.as_ref().is_some_and(|flight| flight.only);
        let next = match done {
            // A page that is loaded anew is back by then.
            Lost::Noticed if only && (inner.pilot.is_some() || away >= LOST_AFTER) => Some((Lost::Left, OperatorEvent::Left)),
            Lost::Left if away >= LAND_AFTER => Some((Lost::Abandoned, OperatorEvent::Abandoned)),
            _ => None,
        };
        // On the ground nobody waits for a page.
        let grounded = next.is_some() && self.pointing.is_on_ground();
        let next = next.map(|next| if grounded { (Lost::Abandoned, OperatorEvent::Abandoned) } else { next });
        if let Some((done, event)) = next {
            inner.lost = Some((since, done));
            // What the pilot makes of it, it tells itself: a landing goes on.
            let what = match done {
                _ if grounded => ": the drone does not take off",
                Lost::Abandoned => " for 20 s",
                _ => "",
            };
            self.hub.say(&format!("connection to the pilot's page lost{what}"), "warning");
            inner.send(event);
        }
        if inner.pilot.is_none() { inner.keys.renew(away) } else { None }
    }
}

impl Inner {
    /// The page that flies is lost no longer, and it is told for how long nobody flew if the flight was told to hold.
    pub(super) fn found(&mut self, number: u64, now: Instant) {
        let Some((since, Lost::Left)) = self.lost.take() else { return };
        let Some(page) = self.pages.get(&number) else { return };
        let away = now.saturating_duration_since(since).as_secs_f64();
        drop(page.to_page.try_send(json(&json!({"type": "held", "away": away}))));
    }

    /// Does not count the time in which this thread itself was late, up to as long as a page may be silent.
    fn forgive(&mut self, now: Instant) {
        let late = self.checked.replace(now).map_or(Duration::ZERO, |last| now.duration_since(last));
        if late > LATE {
            for page in self.pages.values_mut() {
                let more = (late - CHECK).min(LOST_AFTER - page.forgiven);
                page.forgiven += more;
            }
        }
    }
}
