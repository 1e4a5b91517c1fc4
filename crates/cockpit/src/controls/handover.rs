//! Who has the controls: they are asked for, and handed over by consent.

use std::time::{Duration, Instant};

use serde_json::json;
use spf_pilot::OperatorEvent;

use super::{Controls, Inner};
use crate::hub::json;

/// A page that was refused may ask again after this time.
const ASK_AGAIN: Duration = Duration::from_secs(30);

impl Controls {
    /// Makes a page the one that flies.
    pub(super) fn give(&self, inner: &mut Inner, number: u64) {
        let Some(page) = inner.pages.get_mut(&number) else { return };
        let fresh = page.session.is_none();
        if fresh && let Ok((id, secret)) = inner.keys.session() {
            page.session = Some(id);
            drop(page.to_page.try_send(json(&json!({"type": "session", "session": secret}))));
        }
        (page.heard, page.forgiven) = (Instant::now(), Duration::ZERO);
        inner.last_session = page.session;
        (inner.pilot, inner.asking, inner.armed) = (Some(number), None, None);
        inner.found(number, Instant::now());
    }

    /// Tells every page of the controls what it may do.
    pub(super) fn tell_roles(&self, inner: &mut Inner) {
        let (pilot, asking, watching) = (inner.pilot, inner.asking, inner.pages.len());
        let lost = inner.lost.is_some();
        for (number, page) in &inner.pages {
            let flies = pilot == Some(*number);
            let role = json!({
                "type": "role", "pilot": flies, "someone": pilot.is_some() && !lost, "pages": watching,
                "asked": asking.filter(|_| flies), "asking": asking == Some(*number),
            });
            drop(page.to_page.try_send(json(&role)));
        }
    }

    pub(super) fn ask(&self, inner: &mut Inner, number: u64, now: Instant) -> Result<String, String> {
        if inner.pilot == Some(number) {
            return Ok("you fly".to_owned());
        }
        let known = inner.pages.get(&number).is_some_and(|page| page.session.is_some());
        if known && (inner.pilot.is_none() || inner.lost.is_some()) {
            // What the new pilot does not know of must not go on, but for a landing.
            inner.send(OperatorEvent::Left);
            self.give(inner, number);
            self.tell_roles(inner);
            return Ok("you fly: the other page is gone".to_owned());
        }
        if inner.pilot.is_none() {
            return Err("open the address that the terminal shows, with what follows the `#`".to_owned());
        }
        match inner.asking {
            Some(asking) if asking == number => return Ok("asked: the pilot must agree".to_owned()),
            Some(_) => return Err("another page asks for the controls already".to_owned()),
            None => {}
        }
        let refused = inner.pages.get(&number).and_then(|page| page.refused);
        if refused.is_some_and(|at| now.duration_since(at) < ASK_AGAIN) {
            return Err("the pilot keeps the controls: ask again in half a minute".to_owned());
        }
        inner.asking = Some(number);
        self.tell_roles(inner);
        Ok("asked: the pilot must agree".to_owned())
    }

    pub(super) fn answer(&self, inner: &mut Inner, page: u64, yes: bool, now: Instant) -> Result<String, String> {
        let Some(asking) = inner.asking.take_if(|asking| *asking == page) else {
            return Err("that page no longer asks for the controls".to_owned());
        };
        if yes {
            // What the new pilot does not know of must not go on, but for a landing.
            inner.send(OperatorEvent::Left);
            self.give(inner, asking);
            self.say("the controls were handed over", "info");
        }
        if let Some(page) = inner.pages.get_mut(&asking).filter(|_| !yes) {
            page.refused = Some(now);
        }
        self.tell_roles(inner);
        Ok(if yes { "handed over" } else { "kept" }.to_owned())
    }
}
