//! Who flies, and what becomes of an order. One page has the controls, any number watch; they are handed over by consent.
//!
//! Every order ends as an [`OperatorEvent`] in the flight's operator channel, like a key of the terminal.

mod handover;
mod keys;
mod lost;
mod ticks;

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use spf_core::command::Setpoint;
use spf_flight::pointing::{Given, Pointing};
use spf_pilot::OperatorEvent;
use tokio::sync::mpsc;

use crate::flight_controls::{FlightControls, ReadInstruction};
use crate::hub::Hub;
use crate::message::{Hello, Order};
pub(crate) use keys::{Keys, May, Refused};
use lost::Lost;
use ticks::Ticks;

/// A page that says nothing for this long is lost: with a beat each 250 ms, and checked each 100 ms, that is known within a second.
pub(crate) const LOST_AFTER: Duration = Duration::from_millis(700);
/// The second step of cutting the motors counts within this time: the page waits 4 s for a gesture that takes 1.5 s.
const CUT_WITHIN: Duration = Duration::from_secs(6);
/// The page that flies is checked this often.
pub(crate) const CHECK: Duration = Duration::from_millis(100);
/// A point so soon after an order to stop was set before it was seen.
const STOPPED: Duration = Duration::from_secs(1);
/// Maximum number of pages that only watch: the others' places are for the pilot and who may fly.
pub(crate) const SPECTATORS: usize = 20;
/// Maximum number of messages queued for a page of the controls.
pub(crate) const TO_PAGE: usize = 64;

/// The controls of the cockpit.
pub(crate) struct Controls {
    inner: Mutex<Inner>,
    hub: Arc<Hub>,
    pointing: Arc<Pointing>,
}

struct Inner {
    keys: Keys,
    pages: BTreeMap<u64, Page>,
    next: u64,
    /// The page that flies.
    pilot: Option<u64>,
    /// The session of the page that flew last; it may come back.
    last_session: Option<u64>,
    /// When the page that flies was lost, and what was done about it.
    lost: Option<(Instant, Lost)>,
    /// The page that asks for the controls.
    asking: Option<u64>,
    armed: Option<(u64, Instant)>,
    /// When the flight was last ordered to stop and not to go on.
    stopped: Option<Instant>,
    checked: Option<Instant>,
    flight: Option<FlightControls>,
    waiting: Option<Waiting>,
    /// Arms the assistant that flies, if one does and must be armed.
    assistant: Option<ArmAssistant>,
}

/// Lets an assistant fly for so many minutes; 0 takes that back.
pub type ArmAssistant = Box<dyn Fn(u8) + Send + Sync>;

/// Where the first instruction goes, and how it is read.
struct Waiting {
    instruction: Sender<String>,
    read: ReadInstruction,
}

struct Page {
    session: Option<u64>,
    heard: Instant,
    /// Time that does not count, since it was heard.
    forgiven: Duration,
    /// When the pilot refused to hand over to it.
    refused: Option<Instant>,
    ticks: Ticks,
    to_page: mpsc::Sender<Arc<str>>,
}

impl Controls {
    pub(crate) fn new(keys: Keys, hub: Arc<Hub>, pointing: Arc<Pointing>) -> Self {
        let inner = Inner {
            keys,
            pages: BTreeMap::new(),
            next: 0,
            pilot: None,
            last_session: None,
            lost: None,
            asking: None,
            armed: None,
            stopped: None,
            checked: None,
            flight: None,
            waiting: None,
            assistant: None,
        };
        Self { inner: Mutex::new(inner), hub, pointing }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        // Consistent between calls.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the sender of this greeting may watch; true in the second place if it may also know prompts.
    pub(crate) fn may_watch(&self, hello: &Hello, peer: IpAddr, now: Instant) -> Result<bool, Refused> {
        let mut inner = self.inner();
        inner.keys.look(hello, peer, now).map(|may| may == May::Fly)
    }

    /// Whether the bearer of a session, or of the token that flies, may delete flights: not while somebody else flies.
    pub(crate) fn may_delete(&self, secret: &str, peer: IpAddr, now: Instant) -> Result<(), String> {
        let mut inner = self.inner();
        let session = inner.keys.bearer(secret, peer, now).map_err(|refused| refused.to_string())?;
        let pilot = inner.pilot.and_then(|pilot| inner.pages.get(&pilot)).map(|page| page.session);
        match pilot {
            Some(pilot) if pilot != session => Err("only the page that flies deletes flights".to_owned()),
            _ => Ok(()),
        }
    }

    /// Whether the bearer of a session, or of the token that flies, may replay flights: not while one is under way.
    pub(crate) fn may_replay(&self, secret: &str, peer: IpAddr, now: Instant) -> Result<(), String> {
        let mut inner = self.inner();
        inner.keys.bearer(secret, peer, now).map_err(|refused| refused.to_string())?;
        if inner.flight.is_some() { Err("a flight is under way: replay it when that one is over".to_owned()) } else { Ok(()) }
    }

    /// Whether a flight is under way.
    pub(crate) fn is_flying(&self) -> bool {
        self.inner().flight.is_some()
    }

    /// A page connects to the controls. It flies if it may and nobody has flown yet, or if it flew last; others ask. Returns its number and the secret of its session.
    pub(crate) fn enter(
        &self,
        hello: &Hello,
        peer: IpAddr,
        to_page: mpsc::Sender<Arc<str>>,
        now: Instant,
    ) -> Result<(u64, Option<String>), Refused> {
        let mut inner = self.inner();
        let session = inner.keys.enter(hello, peer, now)?;
        if session.is_none() && inner.pages.values().filter(|page| page.session.is_none()).count() >= SPECTATORS {
            return Err(Refused::Full);
        }
        let number = inner.next;
        inner.next += 1;
        let id = session.as_ref().map(|(id, _)| *id);
        inner.pages.insert(
            number,
            Page { session: id, heard: now, forgiven: Duration::ZERO, refused: None, ticks: Ticks::default(), to_page },
        );
        // The same session again: the page was loaded anew, or its tab was doubled; the newest one flies.
        let same = inner.pilot.is_some_and(|pilot| inner.pages.get(&pilot).and_then(|page| page.session) == id);
        let back = inner.pilot.is_none() && inner.last_session.is_none_or(|last| Some(last) == id);
        if id.is_some() && (back || same) {
            inner.give(number);
        }
        inner.tell_roles();
        Ok((number, session.map(|(_, secret)| secret)))
    }

    /// A page of the controls is gone.
    pub(crate) fn leave(&self, number: u64, now: Instant) {
        let mut inner = self.inner();
        inner.pages.remove(&number);
        let _ = inner.asking.take_if(|asking| *asking == number);
        if inner.pilot == Some(number) {
            inner.pilot = None;
            inner.lost.get_or_insert((now, Lost::Noticed));
        }
        inner.tell_roles();
    }

    /// A page has answered a beat.
    pub(crate) fn heard(&self, number: u64, now: Instant) {
        let mut inner = self.inner();
        if let Some(page) = inner.pages.get_mut(&number) {
            (page.heard, page.forgiven) = (now, Duration::ZERO);
        }
        if inner.pilot == Some(number) && inner.lost.is_some() {
            inner.found(number, now);
            inner.tell_roles();
        }
    }

    /// The number of a beat that is sent to a page now.
    pub(crate) fn beat(&self, number: u64, now: Instant) -> u64 {
        self.inner().pages.get_mut(&number).map_or(0, |page| page.ticks.beat(now))
    }

    /// Carries out an order that has arrived from a page, with its number and the last beat that the page had seen; one that comes
    /// late or out of order is dropped. Orders to hold, to land and to disarm count whenever they come.
    pub(crate) fn receive(&self, number: u64, id: u64, tick: Option<u64>, order: &Order, now: Instant) -> Result<String, String> {
        let (judged, flies) = {
            let mut inner = self.inner();
            let judged = inner.pages.get_mut(&number).map_or(Ok(()), |page| page.ticks.judge(id, tick, now));
            (judged, inner.pilot == Some(number))
        };
        match judged {
            Err(why) if !matches!(order, Order::Hold | Order::Land | Order::Assistant(0)) => {
                let told = format!("{} dropped: {why}", order.words());
                // A held key repeats it ten times a second.
                if flies && !matches!(order, Order::Fly { .. }) {
                    self.hub.say(&told, "warning");
                }
                Err(told)
            }
            _ => self.order(number, order, now),
        }
    }

    /// Carries out an order of a page. The result is shown there: what was done, or why not.
    pub(crate) fn order(&self, number: u64, order: &Order, now: Instant) -> Result<String, String> {
        let mut inner = self.inner();
        match order {
            Order::Ask => return inner.ask(number, now),
            _ if inner.pilot != Some(number) => return Err("this page only watches: ask for the controls first".to_owned()),
            Order::Give { page, yes } => return inner.answer(&self.hub, *page, *yes, now),
            Order::Instruction(text) => return inner.instruct(text.trim()),
            Order::Assistant(minutes) => return inner.arm_assistant(*minutes),
            _ => {}
        }
        if inner.flight.is_none() {
            return Err("no flight is under way".to_owned());
        }
        // What was held before goes on beside it.
        let armed = if matches!(order, Order::Fly { .. }) { None } else { inner.armed.take() };
        let events = match order {
            Order::Hold => vec![OperatorEvent::Hold],
            Order::Resume => vec![OperatorEvent::Resume],
            Order::Land => vec![OperatorEvent::Land],
            Order::ArmCut => {
                inner.armed = Some((number, now));
                return Ok("motors: confirm below, or the offer ends".to_owned());
            }
            Order::Cut => match armed {
                Some((by, at)) if by == number && now.duration_since(at) <= CUT_WITHIN => vec![OperatorEvent::CutMotors],
                _ => return Err("motors not cut: press Cut motors first, and confirm within 6 s".to_owned()),
            },
            Order::Fly { right, forward, up, turn } => vec![inner.setpoint(*right, *forward, *up, *turn)],
            Order::Point { u, v, depth, frame } => return self.point(&mut inner, Given::point(*u, *v, *depth, *frame), now),
            Order::Avoid { area, depth, frame } => {
                vec![OperatorEvent::KeepOut(self.pointing.avoid(*area, *depth, *frame)?)]
            }
            Order::Unavoid(id) => vec![OperatorEvent::KeepOut(self.pointing.unavoid(*id)?)],
            Order::Look(side) => return self.point(&mut inner, Given::look(*side), now),
            Order::Done => return self.point(&mut inner, Given::done(), now),
            Order::Instruction(_) | Order::Assistant(_) | Order::Ask | Order::Give { .. } => Vec::new(),
        };
        for event in events {
            if !inner.send(event) {
                return Err("the flight is over".to_owned());
            }
        }
        Ok(String::new())
    }

    /// Answers the open query, or corrects whoever answers: the next answer is this one.
    fn point(&self, inner: &mut Inner, given: Given, now: Instant) -> Result<String, String> {
        if let Some(why) = self.pointing.refusal() {
            return Err(why.to_owned());
        }
        // What the flight does about it is not known here yet.
        if inner.stopped.is_some_and(|at| now.duration_since(at) < STOPPED) {
            return Err("the drone was just ordered to stop: Resume first".to_owned());
        }
        if self.pointing.answer(given) {
            return Ok("answered".to_owned());
        }
        self.pointing.correct(given)?;
        // Open queries are cancelled, and the next one is about a fresh frame.
        let again = match self.pointing.instruction_to_repeat() {
            Some(instruction) => vec![OperatorEvent::Instruction(instruction), OperatorEvent::Resume],
            None => vec![OperatorEvent::Hold, OperatorEvent::Resume],
        };
        match again.into_iter().all(|event| inner.send(event)) {
            true => Ok("your point is the next answer".to_owned()),
            false => Err("the flight is over".to_owned()),
        }
    }

    /// An assistant flies, and must be armed by this.
    pub(crate) fn let_arm(&self, arm: ArmAssistant) {
        let mut inner = self.inner();
        inner.assistant = Some(arm);
        inner.tell_roles();
    }

    /// A flight begins.
    pub(crate) fn begin(&self, flight: FlightControls) {
        let mut inner = self.inner();
        (inner.waiting, inner.stopped) = (None, None);
        inner.flight = Some(flight);
    }

    /// The flight is over.
    pub(crate) fn end(&self) {
        self.inner().flight = None;
        self.pointing.forget();
    }

    /// Whether the page is open that flies, and heard.
    pub(crate) fn has_pilot(&self) -> bool {
        let inner = self.inner();
        let page = inner.pilot.and_then(|pilot| inner.pages.get(&pilot));
        inner.lost.is_none() && page.is_some_and(|page| page.heard.elapsed() < LOST_AFTER)
    }

    /// Instructions go here until a flight begins.
    pub(crate) fn wait(&self, instruction: Sender<String>, read: ReadInstruction) {
        self.inner().waiting = Some(Waiting { instruction, read });
    }

    /// The secret of a page that may fly, for the address to print.
    pub(crate) fn secrets(&self) -> (String, Option<String>) {
        self.inner().keys.printed()
    }
}

impl Inner {
    /// Passes an input to the flight; false if it is over.
    fn send(&mut self, event: OperatorEvent) -> bool {
        match event {
            OperatorEvent::Resume | OperatorEvent::Instruction(_) => self.stopped = None,
            OperatorEvent::KeepOut(_) => {}
            _ => self.stopped = Some(Instant::now()),
        }
        self.flight.as_ref().is_some_and(|flight| flight.operator.send(event).is_ok())
    }

    fn arm_assistant(&self, minutes: u8) -> Result<String, String> {
        let arm = self.assistant.as_ref().ok_or("no assistant flies here")?;
        arm(minutes);
        Ok(match minutes {
            0 => "the assistant may fly no longer: what flies holds, and lands".to_owned(),
            minutes => format!("the assistant may fly, for {minutes} min and one flight"),
        })
    }

    fn instruct(&mut self, text: &str) -> Result<String, String> {
        if let Some(read) = self.flight.as_ref().map(|flight| flight.read.clone()) {
            let read = read(text)?;
            let sent = self.send(OperatorEvent::Instruction(text.to_owned())) && self.send(OperatorEvent::Resume);
            return if sent { Ok(read) } else { Err("the flight is over".to_owned()) };
        }
        let Some(waiting) = &self.waiting else { return Err("no flight is under way".to_owned()) };
        let read = (waiting.read)(text)?;
        let sent = waiting.instruction.send(text.to_owned());
        self.waiting = None;
        sent.map(|()| read).map_err(|_| "the program ends".to_owned())
    }

    /// Half the preset speeds at most, as with the keys of the terminal.
    fn setpoint(&self, right: f64, forward: f64, up: f64, turn: f64) -> OperatorEvent {
        let Some(craft) = self.flight.as_ref().map(|flight| flight.craft) else { return OperatorEvent::Hold };
        let (speed, climb, rate) = (0.5 * craft.cruise_speed, 0.5 * craft.climb_speed, 0.5 * craft.yaw_rate);
        OperatorEvent::Setpoint(Setpoint {
            right: right * speed,
            forward: forward * speed,
            up: up * climb,
            yaw_rate: turn * rate,
        })
    }
}

#[cfg(test)]
mod tests;
