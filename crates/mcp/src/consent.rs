//! Whether an assistant may move a real craft: only after the operator has armed it, for some minutes and one flight.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The longest consent.
pub const LONGEST: Duration = Duration::from_secs(30 * 60);

/// What an operator has to do, for an assistant to pass on.
const HOW: &str = "this is a real drone, and nobody has armed the assistant. Tell the operator: press `Arm the assistant` in the \
                   cockpit (start the server with --cockpit, best opened on another device), or type `spf mcp arm` in a terminal. \
                   An arming holds for some minutes and one flight. `look`, `status`, `hold`, `land` and `stop` need none";

/// How far the operator's consent reaches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Given {
    None,
    /// For one flight that has not begun.
    Armed {
        until: Instant,
    },
    /// For the flight that is under way.
    Used {
        until: Instant,
    },
}

/// The operator's consent.
#[derive(Debug)]
pub struct Consent {
    /// `None` for a simulated craft, which needs none.
    given: Option<Mutex<Given>>,
}

impl Consent {
    /// The consent that a craft needs: a `real` one starts without any.
    #[must_use]
    pub fn new(real: bool) -> Self {
        Self { given: real.then(|| Mutex::new(Given::None)) }
    }

    fn given(&self) -> Option<MutexGuard<'_, Given>> {
        // Consistent between calls.
        self.given.as_ref().map(|given| given.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The operator arms the assistant for a time, half an hour at most: for one flight, which is the one under way if there is one.
    pub fn arm(&self, time: Duration, in_flight: bool, now: Instant) {
        if let Some(mut given) = self.given() {
            let until = now + time.min(LONGEST);
            *given = if in_flight { Given::Used { until } } else { Given::Armed { until } };
        }
    }

    /// The operator takes it back, or it was used up.
    pub fn revoke(&self) {
        if let Some(mut given) = self.given() {
            *given = Given::None;
        }
    }

    /// Whether a flight may begin, or the one under way go on; `true` for a simulated craft.
    #[must_use]
    pub fn is_armed(&self, now: Instant) -> bool {
        let Some(given) = self.given() else { return true };
        matches!(*given, Given::Armed { until } | Given::Used { until } if now < until)
    }

    /// Takes the consent for a flight that begins.
    ///
    /// # Errors
    /// What the operator must do first.
    pub fn begin(&self, now: Instant) -> Result<(), String> {
        let Some(mut given) = self.given() else { return Ok(()) };
        match *given {
            Given::Armed { until } if now < until => {
                *given = Given::Used { until };
                Ok(())
            }
            _ => Err(HOW.to_owned()),
        }
    }

    /// Whether the flight under way may be told more.
    ///
    /// # Errors
    /// What the operator must do first.
    pub fn go_on(&self, now: Instant) -> Result<(), String> {
        let Some(given) = self.given() else { return Ok(()) };
        match *given {
            Given::Used { until } if now < until => Ok(()),
            _ => Err(HOW.to_owned()),
        }
    }

    /// Whether the flight under way had a consent whose time is over. Told once.
    pub fn runs_out(&self, now: Instant) -> bool {
        let Some(mut given) = self.given() else { return false };
        let over = matches!(*given, Given::Used { until } if now >= until);
        if over {
            *given = Given::None;
        }
        over
    }

    /// The flight did not take place: its consent is for another one.
    pub fn give_back(&self) {
        if let Some(mut given) = self.given()
            && let Given::Used { until } = *given
        {
            *given = Given::Armed { until };
        }
    }

    /// The flight is over, and its consent with it.
    pub fn end(&self) {
        if let Some(mut given) = self.given()
            && let Given::Used { .. } = *given
        {
            *given = Given::None;
        }
    }

    /// In words, for a status.
    pub fn words(&self, now: Instant) -> String {
        let Some(given) = self.given() else { return "not needed: the craft is simulated".to_owned() };
        let left = |until: Instant| until.saturating_duration_since(now).as_secs();
        match *given {
            Given::Armed { until } if now < until => format!("armed for one flight, for {} s", left(until)),
            Given::Used { until } if now < until => format!("armed for this flight, for {} s", left(until)),
            _ => "not armed: the operator must arm the assistant before `fly`, `point` and `take_off`".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);

    #[test]
    fn a_consent_is_for_one_flight_and_some_minutes() {
        let (consent, now) = (Consent::new(true), Instant::now());
        assert!(consent.begin(now).unwrap_err().contains("spf mcp arm"));
        assert!(consent.go_on(now).is_err());
        consent.arm(5 * MINUTE, false, now);
        assert!(consent.go_on(now).is_err(), "no flight has begun");
        consent.begin(now).unwrap();
        consent.go_on(now + 4 * MINUTE).unwrap();
        assert!(consent.begin(now).is_err(), "one flight");
        assert!(!consent.runs_out(now + 4 * MINUTE));
        assert!(
            consent.go_on(now + 5 * MINUTE).is_err() && consent.runs_out(now + 5 * MINUTE) && !consent.runs_out(now + 5 * MINUTE)
        );
        consent.arm(5 * MINUTE, false, now);
        assert!(consent.begin(now + 5 * MINUTE).is_err(), "too late");
        consent.arm(MINUTE, true, now);
        consent.go_on(now).unwrap();
        assert!(consent.begin(now).is_err(), "for the flight under way");
    }

    #[test]
    fn a_consent_ends_with_its_flight_and_by_the_operator() {
        let (consent, now) = (Consent::new(true), Instant::now());
        consent.arm(MINUTE, false, now);
        consent.end();
        consent.begin(now).unwrap();
        consent.end();
        assert!(consent.begin(now).is_err() && consent.go_on(now).is_err());
        consent.arm(MINUTE, false, now);
        consent.begin(now).unwrap();
        consent.give_back();
        consent.begin(now).unwrap();
        consent.arm(MINUTE, false, now);
        consent.revoke();
        assert!(consent.begin(now).is_err());
        consent.arm(Duration::from_secs(86_400), false, now);
        assert!(consent.begin(now + LONGEST).is_err(), "half an hour at most");
    }

    #[test]
    fn a_simulated_craft_needs_none() {
        let consent = Consent::new(false);
        consent.begin(Instant::now()).unwrap();
        consent.revoke();
        consent.go_on(Instant::now()).unwrap();
    }
}
