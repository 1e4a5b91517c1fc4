//! The service behind a run of many flights or questions.
//!
//! What a service fails at says nothing about a model: no credit, a wrong key, an overloaded server, a dead network. A run that
//! counted it would end with a wrong number. A [`Service`] is shared by all queries of a run. It waits out what may pass, ends the
//! run at what does not, counts the money of the whole run, and ends every wait at once when the run is stopped. The time is that
//! of a [`RunClock`], so that a test can wait for hours.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::Builder;
use std::time::Instant;

use spf_core::time::Duration;

use crate::error::Trouble;
use crate::{Answer, Cancel, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

/// How long a run waits for a service that does not answer.
pub const PATIENCE: Duration = Duration::from_secs(2 * 60 * 60);
/// The first wait; each further one is twice as long, up to the longest.
const FIRST_WAIT: Duration = Duration::from_secs(5);
const LONGEST_WAIT: Duration = Duration::from_secs(5 * 60);
/// How often a request that was refused is sent again to a model that has answered others: some refuse an image now and then.
const REFUSED_TRIES: u32 = 3;
/// How often a wait looks whether it is over.
const LOOK_UP: Duration = Duration::from_millis(50);

/// The clock of a run.
pub trait RunClock: Send + Sync {
    /// The time since a fixed instant.
    fn now(&self) -> Duration;

    /// Waits for this time, and returns early once `is_over`.
    fn wait(&self, time: Duration, is_over: &dyn Fn() -> bool);
}

/// The machine's clock.
#[derive(Clone, Copy, Debug)]
pub struct WallClock(Instant);

impl Default for WallClock {
    fn default() -> Self {
        Self(Instant::now())
    }
}

impl RunClock for WallClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }

    fn wait(&self, time: Duration, is_over: &dyn Fn() -> bool) {
        let until = Instant::now() + time;
        while !is_over() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            std::thread::sleep(left.min(LOOK_UP));
        }
    }
}

/// A wait for a service that does not answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Wait {
    /// The VLM.
    pub vlm: String,
    /// Its last failure.
    pub error: VlmError,
    /// How long it has not answered.
    pub failing: Duration,
    /// When it is asked again.
    pub pause: Duration,
    /// How long it may go on failing before the run ends.
    pub left: Duration,
}

/// Why a run ended before all was done.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RunEnd {
    /// It was stopped.
    Stopped,
    /// Its cost limit was reached.
    Spent {
        /// Cost so far, US dollars.
        spent: f64,
        /// Cost limit, US dollars.
        limit: f64,
    },
    /// A service refuses, and will go on refusing.
    Refused {
        /// The VLM.
        vlm: String,
        /// Its reason.
        error: VlmError,
    },
    /// A service has not answered for too long, or asks to wait for too long.
    Down {
        /// The VLM.
        vlm: String,
        /// Its last failure.
        error: VlmError,
        /// How long it has not answered.
        failing: Duration,
    },
    /// No query of a whole flight was answered.
    Unanswered {
        /// The VLM.
        vlm: String,
        /// The last failure.
        error: VlmError,
    },
}

/// What is told of each wait.
type OnWait = Box<dyn Fn(&Wait) + Send + Sync>;

/// The service behind a run, shared by all its queries.
pub struct Service {
    clock: Arc<dyn RunClock>,
    patience: Duration,
    max_cost_usd: Option<f64>,
    on_wait: OnWait,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    spent_usd: f64,
    /// VLMs that do not answer at present.
    outages: BTreeMap<String, Outage>,
    /// VLMs that have answered.
    answered: BTreeSet<String>,
    /// The queries that are being answered.
    open: BTreeMap<u64, Cancel>,
    number: u64,
    ended: Option<RunEnd>,
}

/// A VLM does not answer.
struct Outage {
    since: Duration,
    waits: u32,
    /// Nothing is asked before.
    until: Duration,
}

/// What follows from an answer.
enum Next {
    /// It is used.
    Use,
    /// The query is asked again.
    Again,
    /// The run has ended, or the flight will be flown again later.
    End,
}

impl Service {
    /// A service of which nothing is known yet. No query is sent once `max_cost_usd` US dollars are spent. `on_wait` is told of
    /// each wait, on the thread that waits.
    #[must_use]
    pub fn new(
        clock: Arc<dyn RunClock>,
        max_cost_usd: Option<f64>,
        on_wait: impl Fn(&Wait) + Send + Sync + 'static,
    ) -> Arc<Self> {
        let on_wait = Box::new(on_wait);
        Arc::new(Self { clock, patience: PATIENCE, max_cost_usd, on_wait, state: Mutex::default() })
    }

    /// A service that is not waited for: whatever it fails at ends the run.
    #[must_use]
    pub fn impatient() -> Arc<Self> {
        let (clock, on_wait) = (Arc::new(WallClock::default()), Box::new(|_: &Wait| {}));
        Arc::new(Self { clock, patience: Duration::ZERO, max_cost_usd: None, on_wait, state: Mutex::default() })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // The contents are consistent between calls.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stops the run as soon as `signals` is not zero.
    ///
    /// # Errors
    /// [`std::io::Error`] if no thread can be started.
    pub fn stop_on(self: &Arc<Self>, signals: Arc<AtomicU32>) -> std::io::Result<()> {
        let service = Arc::downgrade(self);
        let watch = move || {
            while let Some(service) = Weak::upgrade(&service) {
                if signals.load(Ordering::Relaxed) > 0 {
                    return service.stop();
                }
                drop(service);
                std::thread::sleep(LOOK_UP);
            }
        };
        Builder::new().name("stop".to_owned()).spawn(watch).map(drop)
    }

    /// Stops the run: open queries are cancelled, waits end, and nothing is asked any more.
    pub fn stop(&self) {
        self.end(RunEnd::Stopped);
    }

    /// Ends the run; the first reason counts.
    pub fn end(&self, end: RunEnd) {
        let mut state = self.state();
        state.ended.get_or_insert(end);
        state.open.values().for_each(Cancel::cancel);
    }

    /// Why the run ended early; `None` while it goes on, and if it was complete.
    #[must_use]
    pub fn ended(&self) -> Option<RunEnd> {
        self.state().ended.clone()
    }

    /// Whether the run ended early.
    #[must_use]
    pub fn is_ended(&self) -> bool {
        self.state().ended.is_some()
    }

    /// Adds a cost that the queries of this service do not have, such as that of an earlier part of the run, US dollars.
    pub fn charge(&self, usd: f64) {
        self.state().spent_usd += usd;
    }

    /// Cost so far, US dollars.
    #[must_use]
    pub fn spent_usd(&self) -> f64 {
        self.state().spent_usd
    }

    /// The cost limit, US dollars.
    #[must_use]
    pub fn max_cost_usd(&self) -> Option<f64> {
        self.max_cost_usd
    }

    /// A VLM whose queries belong to the run, and to the flight of `fate`.
    #[must_use]
    pub fn guard(self: &Arc<Self>, vlm: Box<dyn Vlm>, fate: &Fate) -> Guarded {
        Guarded { vlm, service: self.clone(), fate: fate.clone() }
    }

    /// Waits until a VLM may be asked; false if the run has ended.
    fn await_turn(&self, vlm: &str, cancel: &Cancel) -> bool {
        loop {
            let pause = {
                let mut state = self.state();
                if let Some(limit) = self.max_cost_usd.filter(|limit| state.spent_usd >= *limit) {
                    let spent = state.spent_usd;
                    state.ended.get_or_insert(RunEnd::Spent { spent, limit });
                    state.open.values().for_each(Cancel::cancel);
                }
                if state.ended.is_some() {
                    return false;
                }
                state.outages.get(vlm).map_or(Duration::ZERO, |outage| outage.until.saturating_sub(self.clock.now()))
            };
            // Whoever asked no longer waits, and is told so by the VLM.
            if pause.is_zero() || cancel.is_cancelled() {
                return true;
            }
            self.clock.wait(pause, &|| self.is_ended() || cancel.is_cancelled());
        }
    }

    fn begin(&self, cancel: &Cancel) -> u64 {
        let mut state = self.state();
        state.number += 1;
        let number = state.number;
        state.open.insert(number, cancel.clone());
        // It may have ended since the turn came.
        if state.ended.is_some() {
            cancel.cancel();
        }
        number
    }

    /// Takes the answer to the open query with this number.
    fn take(&self, number: u64, vlm: &str, answer: &Answer) -> Next {
        let mut state = self.state();
        state.open.remove(&number);
        state.spent_usd += answer.account.cost_usd.unwrap_or(0.0);
        let error = match &answer.text {
            Ok(_) => {
                state.outages.remove(vlm);
                state.answered.insert(vlm.to_owned());
                return Next::Use;
            }
            Err(_) if state.ended.is_some() => return Next::End,
            // The flight ends here, and the others go on.
            Err(VlmError::Postponed) => return Next::End,
            Err(VlmError::Cancelled) => return Next::Use,
            Err(error) => error,
        };
        let waits = state.outages.get(vlm).map_or(0, |outage| outage.waits);
        let passes = match error.trouble() {
            Some(Trouble::Passing) => true,
            Some(Trouble::Lasting) => error.code() == "bad_request" && state.answered.contains(vlm) && waits < REFUSED_TRIES,
            // A dead connection begins or ends as one that is only slow.
            None if waits > 0 && error.is_late() => true,
            None => {
                state.outages.remove(vlm);
                return Next::Use;
            }
        };
        let vlm = vlm.to_owned();
        if !passes {
            state.ended.get_or_insert(RunEnd::Refused { vlm, error: error.clone() });
            state.open.values().for_each(Cancel::cancel);
            return Next::End;
        }
        let now = self.clock.now();
        let outage = state.outages.entry(vlm.clone()).or_insert(Outage { since: now, waits: 0, until: now });
        if outage.waits > 0 && outage.until > now {
            // Another query found out before, and waits.
            return Next::Again;
        }
        let failing = now.saturating_sub(outage.since);
        let left = self.patience.saturating_sub(failing);
        let asked = error.retry_after().unwrap_or_default();
        if left.is_zero() || asked > left {
            state.ended.get_or_insert(RunEnd::Down { vlm, error: error.clone(), failing });
            state.open.values().for_each(Cancel::cancel);
            return Next::End;
        }
        let pause = FIRST_WAIT.saturating_mul(1 << outage.waits.min(16)).min(LONGEST_WAIT).max(asked).min(left);
        outage.waits += 1;
        outage.until = now + pause;
        drop(state);
        (self.on_wait)(&Wait { vlm, error: error.clone(), failing, pause, left });
        Next::Again
    }
}

/// What became of the queries of one flight.
#[derive(Clone, Debug, Default)]
pub struct Fate {
    lost: Arc<AtomicU32>,
    told: Arc<Mutex<Told>>,
}

#[derive(Debug, Default)]
struct Told {
    answered: bool,
    last: Option<VlmError>,
    cost_usd: f64,
}

impl Fate {
    fn told(&self) -> MutexGuard<'_, Told> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts queries that the end of the run took away from the flight, whose result is then none.
    #[must_use]
    pub fn lost(&self) -> &Arc<AtomicU32> {
        &self.lost
    }

    /// The last failure, if no query was answered although the model said nothing that would be its own doing.
    #[must_use]
    pub fn unanswered(&self) -> Option<VlmError> {
        let told = self.told();
        told.last.clone().filter(|error| !told.answered && !error.is_models_own())
    }

    /// Cost of its queries, US dollars.
    #[must_use]
    pub fn cost_usd(&self) -> f64 {
        self.told().cost_usd
    }
}

/// A VLM whose queries belong to a run.
pub struct Guarded {
    vlm: Box<dyn Vlm>,
    service: Arc<Service>,
    fate: Fate,
}

impl Guarded {
    /// The answer of a run that has ended.
    fn lose(&self, text: Result<String, VlmError>, account: Usage) -> Answer {
        self.fate.lost.fetch_add(1, Ordering::Relaxed);
        Answer { text, latency: Duration::ZERO, model: self.vlm.name().to_owned(), account }
    }
}

impl Vlm for Guarded {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.vlm.image_spec(camera)
    }

    fn temperature(&self) -> Option<f64> {
        self.vlm.temperature()
    }

    /// The time that passes before the last request counts nowhere: it is the service's.
    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let mut before = Usage::default();
        loop {
            if !self.service.await_turn(self.vlm.name(), &request.cancel) {
                return self.lose(Err(VlmError::Cancelled), before);
            }
            let number = self.service.begin(&request.cancel);
            let mut answer = self.vlm.answer(request, image);
            let next = self.service.take(number, self.vlm.name(), &answer);
            self.fate.told().cost_usd += answer.account.cost_usd.unwrap_or(0.0);
            let parts = answer.account.parts;
            answer.account.add(&before);
            match next {
                Next::Use => {
                    let mut told = self.fate.told();
                    match &answer.text {
                        Ok(_) => told.answered = true,
                        Err(error) => told.last = Some(error.clone()),
                    }
                    drop(told);
                    answer.account.parts = parts;
                    return answer;
                }
                Next::Again => before = answer.account,
                Next::End => return self.lose(answer.text, answer.account),
            }
        }
    }
}

#[cfg(test)]
mod tests;
