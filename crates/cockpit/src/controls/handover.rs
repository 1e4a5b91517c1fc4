//! Who has the controls: they are asked for, and handed over by consent.

use std::time::{Duration, Instant};

use serde_json::json;
use spf_pilot::OperatorEvent;

use super::Inner;
use crate::hub::{Hub, json};

/// A page that was refused may ask again after this time.
const ASK_AGAIN: Duration = Duration::from_secs(30);

impl Inner {
    /// Makes a page the one that flies.
    pub(super) fn give(&mut self, number: u64) {
        let Some(page) = self.pages.get_mut(&number) else { return };
        let fresh = page.session.is_none();
        if fresh && let Ok((id, secret)) = self.keys.session() {
            page.session = Some(id);
            drop(page.to_page.try_send(json(&json!({"type": "session", "session": secret}))));
        }
        (page.heard, page.forgiven) = (Instant::now(), Duration::ZERO);
        self.last_session = page.session;
        (self.pilot, self.asking, self.armed) = (Some(number), None, None);
        self.found(number, Instant::now());
    }

    /// Tells every page of the controls what it may do.
    pub(super) fn tell_roles(&self) {
        let (pilot, asking, watching) = (self.pilot, self.asking, self.pages.len());
        let lost = self.lost.is_some();
        for (number, page) in &self.pages {
            let flies = pilot == Some(*number);
            let role = json!({
                "type": "role", "pilot": flies, "someone": pilot.is_some() && !lost, "pages": watching,
                "asked": asking.filter(|_| flies), "asking": asking == Some(*number), "arms": flies && self.assistant.is_some(),
            });
            drop(page.to_page.try_send(json(&role)));
        }
    }

    /// A page asks for the controls.
    pub(super) fn ask(&mut self, number: u64, now: Instant) -> Result<String, String> {
        if self.pilot == Some(number) {
            return Ok("you fly".to_owned());
        }
        let known = self.pages.get(&number).is_some_and(|page| page.session.is_some());
        if known && (self.pilot.is_none() || self.lost.is_some()) {
            // What the new pilot does not know of must not go on, but for a landing.
            self.send(OperatorEvent::Left);
            self.give(number);
            self.tell_roles();
            return Ok("you fly: the other page is gone".to_owned());
        }
        if self.pilot.is_none() {
            return Err("open the address that the terminal shows, with what follows the `#`".to_owned());
        }
        match self.asking {
            Some(asking) if asking == number => return Ok("asked: the pilot must agree".to_owned()),
            Some(_) => return Err("another page asks for the controls already".to_owned()),
            None => {}
        }
        let refused = self.pages.get(&number).and_then(|page| page.refused);
        if refused.is_some_and(|at| now.duration_since(at) < ASK_AGAIN) {
            return Err("the pilot keeps the controls: ask again in half a minute".to_owned());
        }
        self.asking = Some(number);
        self.tell_roles();
        Ok("asked: the pilot must agree".to_owned())
    }

    /// The page that flies answers the one that asks.
    pub(super) fn answer(&mut self, hub: &Hub, page: u64, yes: bool, now: Instant) -> Result<String, String> {
        let Some(asking) = self.asking.take_if(|asking| *asking == page) else {
            return Err("that page no longer asks for the controls".to_owned());
        };
        if yes {
            // What the new pilot does not know of must not go on, but for a landing.
            self.send(OperatorEvent::Left);
            self.give(asking);
            hub.say("the controls were handed over", "info");
        }
        if let Some(page) = self.pages.get_mut(&asking).filter(|_| !yes) {
            page.refused = Some(now);
        }
        self.tell_roles();
        Ok(if yes { "handed over" } else { "kept" }.to_owned())
    }
}
