//! The craft of an assistant: at most one flight, who may order what, and what happens if nobody says anything any more.
//!
//! Every order ends as an [`OperatorEvent`] in the flight's operator channel, as those of the terminal's keys and of the cockpit do, and
//! so goes through the safety envelope.

mod flight;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

use spf_flight::flight::Flown;
use spf_flight::pointing::{Given, Pointing};
use spf_pilot::{Ending, OperatorEvent, Phase};
use tokio::sync::watch;

pub use self::flight::{Flight, Landed};
use crate::consent::Consent;
use crate::watch::{Newest, Orders, Seen, Watch};

/// The hover at the end of an instruction lasts a minute: before it is over, it becomes a hold if somebody has called.
const HOVERS: Duration = Duration::from_secs(50);
/// A craft that is down is the next flight's once the files of the last one are written: a long film takes seconds.
const CLOSES: Duration = Duration::from_secs(60);
/// How often the deck looks at the time.
const TICK: Duration = Duration::from_millis(100);
/// Calls per second that are carried out in the long run, and at once.
const CALLS_PER_S: f64 = 10.0;
const CALLS_AT_ONCE: f64 = 30.0;
/// The instruction of a flight that begins without one.
pub const POINTED: &str = "fly where the assistant points";

/// How long a craft waits.
#[derive(Clone, Copy, Debug)]
pub struct Patience {
    /// A craft in the air whose assistant is gone holds for so long, and lands: as with a lost cockpit.
    pub lost: Duration,
    /// A craft in the air that flies no instruction, and that nobody asks about any more, lands after so long.
    pub silent: Duration,
    /// After an order to stop the craft holds for so long, and lands.
    pub stopped: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self { lost: Duration::from_secs(20), silent: Duration::from_secs(60), stopped: Duration::from_secs(5) }
    }
}

/// What opens flights: the program, with its settings.
pub trait Hangar: Send + Sync + 'static {
    /// The craft in a few words; in this scene, if not in that of the settings.
    fn craft(&self, scene: Option<&str>) -> String;

    /// Who answers the queries of `fly`, in words; `None` if nobody does, so that only the assistant points.
    fn answers(&self) -> Option<String>;

    /// Whether the craft is real, and moves only after the operator has armed the assistant.
    fn is_real(&self) -> bool;

    /// How an instruction is read, if that is known before the flight. It may take as long as a model does.
    ///
    /// # Errors
    /// Why it cannot be flown.
    fn read(&self, wanted: &Wanted) -> Result<String, String>;

    /// Flies, until the craft is on the ground.
    ///
    /// # Errors
    /// Why the flight could not start.
    fn fly(&self, wanted: Wanted, seat: Seat) -> Result<Flown, String>;
}

/// A flight that is wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// The instruction; `None` for a flight that begins with a hover.
    pub instruction: Option<String>,
    /// The scene, instead of that of the settings.
    pub scene: Option<String>,
}

impl Wanted {
    /// The instruction to be recorded.
    #[must_use]
    pub fn words(&self) -> &str {
        self.instruction.as_deref().unwrap_or(POINTED)
    }
}

/// The assistant's seat in a flight.
pub struct Seat {
    /// Its orders.
    pub operator: Receiver<OperatorEvent>,
    /// Into the same channel, for somebody else, such as a cockpit.
    pub orders: Sender<OperatorEvent>,
    /// Its eyes: an observer of the flight.
    pub watch: Watch,
    /// Where it points: [`spf_flight::pointing::Pointer`]s of the flight's VLM take their answers from here.
    pub pointing: Arc<Pointing>,
    /// Set if the flight was given up while it was prepared: then it must not begin.
    pub given_up: Arc<AtomicBool>,
    /// To be set to the folder of the flight's files.
    pub folder: Arc<OnceLock<PathBuf>>,
}

/// Who is gone, and what was done about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lost {
    Holds(Instant),
    Lands,
}

struct Inner {
    flight: Option<Flight>,
    flights: u64,
    /// The last call of anybody, and when the craft last flew by itself.
    called: Instant,
    idle_since: Instant,
    lost: Option<Lost>,
    /// When the flight was stopped, or its consent ran out: it lands whatever an assistant says.
    stopped: Option<Instant>,
    /// How many orders of somebody else were heeded, and whether the last word was theirs.
    overrides: u32,
    operator_has_it: bool,
    /// How many pages of the cockpit were lost, as far as that was heeded.
    pages_lost: u32,
    /// Whether the landing under way is one of the assistant's own, which it may take back.
    lands_by_us: bool,
    /// When the hover at the end of an instruction began.
    hovers_since: Option<Instant>,
    /// How often something was stopped: what was prepared meanwhile is not flown.
    stops: u64,
    /// Calls that may be carried out at once, and when they were counted.
    calls: (f64, Instant),
}

/// The deck.
pub struct Deck {
    hangar: Arc<dyn Hangar>,
    consent: Consent,
    patience: Patience,
    inner: Mutex<Inner>,
}

/// What a call did, in words, or why nothing was done.
pub type Done = Result<String, String>;

impl Deck {
    /// A deck without a flight. The thread that watches over it ends with it.
    ///
    /// # Errors
    /// The operating system's error if the thread cannot be started.
    pub fn new(hangar: Arc<dyn Hangar>, patience: Patience) -> std::io::Result<Arc<Self>> {
        let now = Instant::now();
        let inner = Inner {
            flight: None,
            flights: 0,
            called: now,
            idle_since: now,
            lost: None,
            stopped: None,
            overrides: 0,
            operator_has_it: false,
            pages_lost: 0,
            lands_by_us: false,
            hovers_since: None,
            stops: 0,
            calls: (CALLS_AT_ONCE, now),
        };
        let deck = Arc::new(Self { consent: Consent::new(hangar.is_real()), hangar, patience, inner: Mutex::new(inner) });
        let watched = Arc::downgrade(&deck);
        Builder::new().name("deck".to_owned()).spawn(move || {
            while let Some(deck) = watched.upgrade() {
                deck.tick(Instant::now());
                drop(deck);
                std::thread::sleep(TICK);
            }
        })?;
        Ok(deck)
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        // Consistent between calls.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Who flies.
    #[must_use]
    pub fn hangar(&self) -> &dyn Hangar {
        self.hangar.as_ref()
    }

    /// The operator's consent, in words.
    #[must_use]
    pub fn consent(&self) -> String {
        self.consent.words(Instant::now())
    }

    /// Whether the operator's consent lets the assistant fly now; `true` for a simulated craft.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.consent.is_armed(Instant::now())
    }

    /// The flight under way, or the last one.
    #[must_use]
    pub fn flight(&self) -> Option<Flight> {
        self.inner().flight.clone()
    }

    /// Whether a flight is under way.
    #[must_use]
    pub fn is_flying(&self) -> bool {
        self.inner().flight.as_ref().is_some_and(|flight| !flight.is_over())
    }

    /// Somebody calls. Calls that come faster than they can mean anything are refused; those that stop the craft never are.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn call(&self, stops: bool) -> Result<(), String> {
        let (mut inner, now) = (self.inner(), Instant::now());
        inner.called = now;
        // Whoever was gone is back; a stop stays one.
        inner.lost = None;
        if stops {
            inner.stops += 1;
            return Ok(());
        }
        let (left, since) = inner.calls;
        let left = (left + CALLS_PER_S * now.duration_since(since).as_secs_f64()).min(CALLS_AT_ONCE);
        inner.calls = ((left - 1.0).max(0.0), now);
        if left < 1.0 { Err(format!("too many calls: at most {CALLS_PER_S} per second; wait a moment")) } else { Ok(()) }
    }

    /// The operator arms the assistant for a time, half an hour at most, and one flight: the one under way, if there is one.
    pub fn arm(&self, time: Duration) {
        let mut inner = self.inner();
        let in_flight = inner.flying().is_ok();
        inner.operator_has_it = false;
        self.consent.arm(time, in_flight, Instant::now());
    }

    /// The operator takes the consent back: a flight under way holds, and lands.
    pub fn disarm(&self) {
        let mut inner = self.inner();
        match inner.flying() {
            Ok(flight) => self.end(&mut inner, &flight),
            Err(_) => self.consent.revoke(),
        }
    }

    /// Begins a flight, or gives the one that holds in the air a new instruction. The flight, the number of the instruction in it, and
    /// how it was read.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn fly(self: &Arc<Self>, wanted: Wanted) -> Result<(Flight, u32, String), String> {
        self.fly_unless(wanted, || false)
    }

    /// The same, unless whoever asked is gone by then.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn fly_unless(self: &Arc<Self>, wanted: Wanted, is_gone: impl Fn() -> bool) -> Result<(Flight, u32, String), String> {
        let stops = self.inner().stops;
        self.wait_for_files();
        let scene = {
            let mut inner = self.inner();
            let flight = self.may_fly(&mut inner, &wanted)?;
            // What there is, is in the scene where it flies.
            flight.map_or_else(|| wanted.scene.clone(), |flight| flight.scene)
        };
        // It may ask a model: a stop does not wait for that.
        let read = self.hangar.read(&Wanted { scene, ..wanted.clone() })?;
        let mut inner = self.inner();
        let flight = self.may_fly(&mut inner, &wanted)?;
        if inner.stops != stops {
            return Err("the drone was told to hold, land or stop meanwhile: nothing was begun".to_owned());
        }
        if is_gone() {
            return Err("the call was cancelled: nothing was begun".to_owned());
        }
        let Some(flight) = flight else {
            self.consent.begin(Instant::now())?;
            let flight = self.begin(&mut inner, wanted).inspect_err(|_| self.consent.give_back())?;
            return Ok((flight, 1, read));
        };
        let Some(instruction) = &wanted.instruction else { return Err("the drone is in the air already".to_owned()) };
        flight.pointing.answer_all(false);
        inner.operator_has_it = false;
        let number = flight.seen.borrow().instructions + 1;
        match flight.orders.give([OperatorEvent::Instruction(instruction.clone()), OperatorEvent::Resume]) {
            true => Ok((flight, number, read)),
            false => Err("the flight is over".to_owned()),
        }
    }

    /// Waits while a flight that has ended is still writing its files.
    fn wait_for_files(&self) {
        let until = Instant::now() + CLOSES;
        let closes = |flight: &Flight| !flight.is_over() && flight.phase() == Some(Phase::Ended);
        while self.flight().is_some_and(|flight| closes(&flight)) && Instant::now() < until {
            std::thread::sleep(TICK);
        }
    }

    /// Whether a flight may begin, or the one that holds in the air get this instruction: then that one.
    fn may_fly(&self, inner: &mut Inner, wanted: &Wanted) -> Result<Option<Flight>, String> {
        if wanted.instruction.is_some() && self.hangar.answers().is_none() {
            return Err(NOBODY_ANSWERS.to_owned());
        }
        let now = Instant::now();
        let Ok(flight) = inner.flying() else {
            return if self.consent.is_armed(now) { Ok(None) } else { self.consent.go_on(now).map(|()| None) };
        };
        self.heed(inner, &flight);
        if inner.stopped.is_some() {
            return Err("the flight was stopped, and lands: wait until it is down".to_owned());
        }
        if wanted.instruction.is_none() {
            return Err(format!("the drone is under way already, in the flight `{}`: `status` tells how", flight.id()));
        }
        if wanted.scene.is_some() {
            return Err("the scene cannot change in flight: land first".to_owned());
        }
        inner.admits(&flight, "fly")?;
        match flight.phase() {
            Some(Phase::Held | Phase::Hovering) if !flight.orders.is_going() => {}
            Some(Phase::Landing | Phase::Returning) => return Err(LANDS.to_owned()),
            Some(Phase::Held | Phase::Hovering | Phase::Flying) => {
                return Err(format!(
                    "the flight `{}` is under way with \"{}\": wait for it with `wait_flight`, or `hold` first",
                    flight.id(),
                    flight.seen.borrow().instruction
                ));
            }
            Some(Phase::Ended) => return Err("the files of the last flight are still being written: try again".to_owned()),
            _ => return Err(format!("the flight `{}` is about to take off: `wait_flight`, or `stop`", flight.id())),
        }
        self.consent.go_on(now)?;
        Ok(Some(flight))
    }

    fn begin(self: &Arc<Self>, inner: &mut Inner, wanted: Wanted) -> Result<Flight, String> {
        let (send, operator) = channel();
        let orders = Orders::new(send.clone());
        let pointing = Arc::new(Pointing::default());
        let (watch, seen) = Watch::new(orders.clone(), pointing.clone(), wanted.instruction.is_none());
        let (landed_send, landed) = watch::channel(None);
        let (given_up, folder) = (Arc::<AtomicBool>::default(), Arc::<OnceLock<PathBuf>>::default());
        inner.flights += 1;
        let number = inner.flights;
        let flight = Flight {
            number,
            orders,
            seen,
            landed,
            pointing: pointing.clone(),
            given_up: given_up.clone(),
            folder: folder.clone(),
            scene: wanted.scene.clone(),
            stopped: Arc::default(),
        };
        let seat = Seat { operator, orders: send, watch, pointing, given_up, folder };
        let deck = self.clone();
        let fly = move || {
            // Whatever happens, the flight is known to be over.
            let flown = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| deck.hangar.fly(wanted, seat)));
            let landed = match flown {
                Ok(Ok(flown)) => Landed::Flown(Box::new(flown)),
                Ok(Err(why)) => Landed::Failed(why),
                Err(_) => Landed::Failed("internal error: the flight ended; its drone was told to land".to_owned()),
            };
            let mut inner = deck.inner();
            // What was not flown uses nothing up.
            match landed {
                Landed::Flown(_) => deck.consent.end(),
                Landed::Failed(_) => deck.consent.give_back(),
            }
            inner.stopped = None;
            landed_send.send_replace(Some(landed));
        };
        let thread = Builder::new().name("flight".to_owned()).spawn(fly);
        thread.map_err(|error| format!("cannot start a thread for the flight: {error}"))?;
        (inner.stopped, inner.overrides, inner.operator_has_it) = (None, 0, false);
        (inner.pages_lost, inner.lands_by_us, inner.hovers_since) = (0, false, None);
        inner.flight = Some(flight.clone());
        Ok(flight)
    }

    /// Flies one step towards what is given: a point of a picture, or a side to look at. The flight, and how many points had come to
    /// their end before.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn point(&self, given: impl FnOnce(u64) -> Given, frame: Option<u64>) -> Result<(Flight, u32), String> {
        let mut inner = self.inner();
        let flight = inner.flying()?;
        self.heed(&mut inner, &flight);
        inner.admits(&flight, "point")?;
        self.consent.go_on(Instant::now())?;
        if flight.orders.is_going() {
            return Err("the drone is on its way already: wait for the answer of that `point` or `fly`, or `hold`".to_owned());
        }
        match flight.phase() {
            Some(Phase::Held | Phase::Hovering) => {}
            Some(Phase::Flying) => {
                return Err("the drone flies an instruction: `hold` first, then `look` and `point`".to_owned());
            }
            Some(Phase::Manual) => return Err("somebody flies the drone by hand in the cockpit".to_owned()),
            Some(Phase::Landing | Phase::Returning) => return Err(LANDS.to_owned()),
            _ => return Err("the drone is not in the air yet: wait a moment, and look".to_owned()),
        }
        let frame = match frame {
            Some(frame) => frame,
            None => flight.seen.borrow().newest.as_ref().map(|newest| newest.frame).ok_or("there is no picture yet")?,
        };
        if !flight.pointing.knows(frame) {
            return Err(format!("frame {frame} is too old, or was never there: `look` again, and point in that picture"));
        }
        flight.pointing.answer_all(true);
        flight.pointing.correct(given(frame))?;
        let points = flight.seen.borrow().points;
        flight.orders.begin_point();
        inner.operator_has_it = false;
        // The place that is kept for what was pointed at before, or for an instruction, is forgotten.
        let forgets = flight.pointing.instruction_to_repeat().is_some() || flight.seen.borrow().instruction != POINTED;
        let anew = forgets.then(|| OperatorEvent::Instruction(POINTED.to_owned()));
        let events = anew.into_iter().chain([OperatorEvent::Resume]);
        if flight.orders.give(events) { Ok((flight.clone(), points)) } else { Err("the flight is over".to_owned()) }
    }

    /// Stops and stays in the air.
    ///
    /// # Errors
    /// No flight is under way.
    pub fn hold(&self) -> Done {
        let mut inner = self.inner();
        let flight = inner.flying()?;
        self.heed(&mut inner, &flight);
        if inner.stopped.is_some() {
            return Ok("the drone was stopped: it holds, and lands in a moment".to_owned());
        }
        let phase = flight.phase();
        if matches!(phase, Some(Phase::Landing)) && !inner.lands_by_us {
            return Ok("it lands by another order than yours, and goes on".to_owned());
        }
        flight.hold();
        Ok(match phase {
            None | Some(Phase::Ground) => "the drone does not take off: the flight is over".to_owned(),
            Some(Phase::TakeOff) => "it holds once it has taken off".to_owned(),
            _ => format!(
                "it holds: zero velocity, in the air. `fly`, `point` or `land` next; after {} s without a call it lands",
                self.patience.silent.as_secs()
            ),
        })
    }

    /// Lands where the craft is.
    ///
    /// # Errors
    /// No flight is under way.
    pub fn land(&self) -> Done {
        let mut inner = self.inner();
        let flight = inner.flying()?;
        inner.lands_by_us |= flight.phase() != Some(Phase::Landing);
        if flight.phase().is_none() {
            flight.give_up();
        }
        flight.orders.give([OperatorEvent::Land]);
        Ok("it lands where it is; `wait_flight` tells when it is down".to_owned())
    }

    /// Zero velocity at once, and the end of the flight: the craft holds, then lands. In every state. What was done, in words.
    pub fn stop(&self) -> String {
        let mut inner = self.inner();
        inner.stops += 1;
        let Ok(flight) = inner.flying() else { return "stopped: no flight is under way".to_owned() };
        let phase = flight.phase();
        self.end(&mut inner, &flight);
        match phase {
            None | Some(Phase::Ground) => "stopped: the drone does not take off".to_owned(),
            Some(Phase::TakeOff) => "stopped: it breaks off its take-off, and lands".to_owned(),
            Some(Phase::Landing) => "stopped: it is landing already, and goes on".to_owned(),
            _ => format!(
                "stopped: zero velocity now; it holds for {} s, then lands. Nothing but the operator takes it back",
                self.patience.stopped.as_secs()
            ),
        }
    }

    /// Ends a flight: zero now, then a landing that no call of an assistant takes back.
    fn end(&self, inner: &mut Inner, flight: &Flight) {
        // Of what was ordered before, nothing takes it back.
        self.heed(inner, flight);
        inner.operator_has_it = false;
        self.consent.revoke();
        flight.stopped.store(true, Ordering::Relaxed);
        match flight.phase() {
            // What lands goes on landing.
            Some(Phase::Landing | Phase::Ended) => {}
            // A hold would be in effect only once it has taken off.
            Some(Phase::TakeOff) => {
                flight.orders.give([OperatorEvent::Land]);
            }
            _ => flight.hold(),
        }
        inner.stopped.get_or_insert_with(Instant::now);
    }

    /// Takes note of what somebody else has ordered: whoever took the controls has them, and the assistant is armed anew, or not.
    fn heed(&self, inner: &mut Inner, flight: &Flight) {
        let seen = flight.seen.borrow();
        if core::mem::replace(&mut inner.pages_lost, seen.pages_lost) < seen.pages_lost {
            // Nobody watches any more; the cockpit itself sees to the flight.
            self.consent.revoke();
        }
        if core::mem::replace(&mut inner.overrides, seen.overrides) < seen.overrides {
            self.consent.revoke();
            (inner.operator_has_it, inner.stopped, inner.lost, inner.lands_by_us) = (true, None, None, false);
            flight.stopped.store(false, Ordering::Relaxed);
        }
    }

    /// A running call was cancelled, or its stream was closed: the craft holds.
    pub fn cancelled(&self) {
        let mut inner = self.inner();
        inner.stops += 1;
        if let Ok(flight) = inner.flying()
            && inner.stopped.is_none()
            && !inner.operator_has_it
        {
            flight.leave();
        }
    }

    /// The only client is gone, as when standard input ends.
    pub fn leave(&self) {
        let mut inner = self.inner();
        inner.stops += 1;
        if let Ok(flight) = inner.flying()
            && inner.lost.is_none()
        {
            if !inner.operator_has_it {
                flight.leave();
            }
            inner.lost = Some(Lost::Holds(Instant::now()));
        }
    }

    /// Watches over the flight.
    fn tick(&self, now: Instant) {
        let mut inner = self.inner();
        let Ok(flight) = inner.flying() else { return };
        self.heed(&mut inner, &flight);
        if self.consent.runs_out(now) && flight.phase() != Some(Phase::Returning) {
            tracing::warn!("the operator's consent has run out: the drone holds, and lands");
            self.end(&mut inner, &flight);
        }
        let airborne = flight.is_airborne();
        if airborne && let Some(stopped) = inner.stopped {
            if now.duration_since(stopped) >= self.patience.stopped && !matches!(flight.phase(), Some(Phase::Landing)) {
                flight.orders.give([OperatorEvent::Land]);
                // Again, should something have interrupted it.
                inner.stopped = Some(now);
            }
            return;
        }
        if inner.operator_has_it {
            return;
        }
        // The hover at the end of an instruction would end in a landing though somebody calls.
        let hovers = flight.phase() == Some(Phase::Hovering);
        inner.hovers_since = if hovers { inner.hovers_since.or(Some(now)) } else { None };
        if let Some(since) = inner.hovers_since
            && now.duration_since(since) >= HOVERS
            && now.duration_since(inner.called) < HOVERS
        {
            flight.orders.give([OperatorEvent::Hold]);
            inner.hovers_since = None;
        }
        if let Some(Lost::Holds(since)) = inner.lost
            && (now.duration_since(since) >= self.patience.lost || !airborne)
        {
            flight.orders.give([OperatorEvent::Abandoned]);
            (inner.lost, inner.lands_by_us) = (Some(Lost::Lands), true);
        }
        if flight.flies_by_itself() {
            // The wait begins when there is something to wait for.
            inner.idle_since = now;
        }
        let silent = now.duration_since(inner.called.max(inner.idle_since)) >= self.patience.silent;
        if airborne && silent && inner.lost.is_none() {
            tracing::warn!("no call for {} s: the drone lands", self.patience.silent.as_secs());
            flight.orders.give([OperatorEvent::Abandoned]);
            (inner.lost, inner.lands_by_us) = (Some(Lost::Lands), true);
        }
    }

    /// The newest picture, which can be pointed in from now on.
    ///
    /// # Errors
    /// There is none.
    pub fn newest(&self) -> Result<Newest, String> {
        let flight = self.flight().ok_or("there is no picture before the first flight: `take_off` or `fly`")?;
        let newest = flight.seen.borrow().newest.clone().ok_or("there is no picture yet")?;
        flight.pointing.asked(spf_core::frame::FrameId(newest.frame), newest.pose);
        Ok(newest)
    }
}

/// Why nothing is flown in a landing.
const LANDS: &str = "the drone lands or returns: `hold` takes back a landing of yours";
/// Why `fly` is refused where no model is set up.
const NOBODY_ANSWERS: &str = "no vision-language model is set up for `fly` (start the server with --vlm MODEL, or set a key): \
                              you can fly by yourself with `take_off`, `look` and `point`";

impl Inner {
    /// The flight under way.
    fn flying(&self) -> Result<Flight, String> {
        let flight = self.flight.clone().filter(|flight| !flight.is_over());
        flight.ok_or_else(|| "no flight is under way: `take_off` or `fly` begins one".to_owned())
    }

    /// Whether an assistant may move the craft.
    fn admits(&self, flight: &Flight, what: &str) -> Result<(), String> {
        if self.stopped.is_some() {
            return Err(format!("`{what}` refused: the flight was stopped, and lands"));
        }
        match flight.phase() {
            Some(Phase::Manual) => Err(format!("`{what}` refused: somebody flies the drone by hand in the cockpit")),
            Some(Phase::Ended) => Err("the flight is over".to_owned()),
            _ => Ok(()),
        }
    }
}

/// Whether an instruction of a flight has come to its end, and how.
#[must_use]
pub fn ended(seen: &Seen, instruction: u32) -> Option<Ending> {
    if seen.instructions < instruction { None } else { seen.settled.clone() }
}
