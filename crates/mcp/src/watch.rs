//! An observer of a flight that tells what an assistant may know of it, and that ends what the assistant has pointed at.

use std::collections::VecDeque;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_drone::frames::Photo;
use spf_flight::log::FlightHeader;
use spf_flight::pointing::Pointing;
use spf_flight::run::Observer;
use spf_flight::sight::Sight;
use spf_flight::words;
use spf_pilot::{Action, Ending, Event, Note, OperatorEvent, Phase, Pilot};
use tokio::sync::watch;

/// Number of lines of what happened that are kept.
const LINES: usize = 30;
/// So long without a wish to move, what was pointed at is flown.
const AT_REST: Duration = Duration::from_millis(400);
/// Up to this speed a craft is at rest, m/s; one that never is, as in a wind, is waited for so long.
const SLOW_M_S: f64 = 0.15;
const GLIDES: Duration = Duration::from_secs(3);
/// Distance from which on a place is marked, metres.
const MARKED_FROM_M: f64 = 0.3;

/// What is known of a flight.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// `None` until the flight has begun.
    pub phase: Option<Phase>,
    /// Flight time.
    pub time: Time,
    /// The instruction.
    pub instruction: String,
    /// How many instructions there were.
    pub instructions: u32,
    /// Where the craft believes itself to be.
    pub pose: Option<Pose>,
    /// The newest telemetry.
    pub telemetry: Option<Telemetry>,
    /// Whether the link is lost.
    pub link_lost: bool,
    /// Decisions so far.
    pub decisions: u32,
    /// The last one, in words.
    pub last_decision: Option<String>,
    /// What happened lately: the flight time, and words.
    pub lines: VecDeque<(Time, String)>,
    /// The outcome of the last instruction.
    pub settled: Option<Ending>,
    /// How many points came to their end.
    pub points: u32,
    /// What came of the last one.
    pub pointed: Option<Pointed>,
    /// How many orders somebody else has given.
    pub overrides: u32,
    /// The last one, in words.
    pub overridden: Option<String>,
    /// How often the page of the cockpit that watched was lost.
    pub pages_lost: u32,
    /// The newest frame.
    pub newest: Option<Newest>,
    /// How far each depth label leads, 1 to 10, metres.
    pub steps_m: Vec<f64>,
}

/// The newest frame.
#[derive(Clone)]
pub struct Newest {
    /// Its number.
    pub frame: u64,
    /// From where it was taken.
    pub pose: Pose,
    /// When it was captured, on the clock of this machine.
    pub captured: Instant,
    /// Its pixels.
    pub photo: Photo,
    /// Where the craft flies to, if that is in view.
    pub goal: Option<Mark>,
}

impl core::fmt::Debug for Newest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Newest").field("frame", &self.frame).field("goal", &self.goal).finish_non_exhaustive()
    }
}

/// A place in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// From the left, 0 to 1.
    pub u: f64,
    /// From the top, 0 to 1.
    pub v: f64,
    /// Its distance.
    pub metres: f64,
}

/// What came of a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Pointed {
    /// Whether the step was flown to its end.
    pub flown: bool,
    /// What was decided, or why nothing was flown.
    pub words: String,
    /// What the envelope and the method shortened or refused.
    pub limited: Vec<String>,
}

/// How far a point is.
#[derive(Clone, Debug, Default, PartialEq)]
enum Step {
    #[default]
    None,
    /// Given; the flight has not gone on yet.
    Given,
    /// The flight goes on; the next query is the one that it answers.
    Going,
    Asked,
    /// Being flown, and since when the craft wants to be at rest.
    Flown {
        decided: String,
        rests: Option<Time>,
    },
}

/// The orders of the assistant: what it gave and the flight has not told yet, and how far its point is.
#[derive(Debug, Default)]
struct Given {
    /// Each with how many orders of somebody else were told of when it was given.
    events: VecDeque<(OperatorEvent, u32)>,
    /// How many orders of somebody else were told of.
    overrides: u32,
    step: Step,
    limited: Vec<String>,
}

/// The assistant's side of a flight's operator channel.
#[derive(Clone, Debug)]
pub struct Orders {
    operator: Sender<OperatorEvent>,
    given: Arc<Mutex<Given>>,
}

impl Orders {
    /// Orders into a flight's operator channel.
    #[must_use]
    pub fn new(operator: Sender<OperatorEvent>) -> Self {
        Self { operator, given: Arc::default() }
    }

    /// Gives orders to the flight; false if it is over.
    pub fn give(&self, events: impl IntoIterator<Item = OperatorEvent>) -> bool {
        // Under the lock: the flight may tell of them at once.
        let mut given = self.given();
        events.into_iter().all(|event| {
            let overrides = given.overrides;
            given.events.push_back((event.clone(), overrides));
            self.operator.send(event).is_ok()
        })
    }

    /// What was pointed at is to be flown: the orders that follow lead to the query that it answers.
    pub fn begin_point(&self) {
        let mut given = self.given();
        (given.step, given.limited) = (Step::Given, Vec::new());
    }

    /// Whether what was pointed at, or an instruction, is on its way: the flight is about to go on.
    #[must_use]
    pub fn is_going(&self) -> bool {
        let given = self.given();
        given.step != Step::None || given.events.iter().any(|(event, _)| *event == OperatorEvent::Resume)
    }

    /// Whether the flight has told of every order.
    #[must_use]
    pub fn is_heard(&self) -> bool {
        self.given().events.is_empty()
    }

    fn given(&self) -> std::sync::MutexGuard<'_, Given> {
        // Consistent between calls.
        self.given.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The observer.
pub struct Watch {
    orders: Orders,
    pointing: Arc<Pointing>,
    /// Whether the assistant points from the first query on.
    alone: bool,
    seen: watch::Sender<Seen>,
    camera: Camera,
    sight: Option<Sight>,
    goal: Option<EnuPosition>,
    telemetry: Option<Telemetry>,
    /// A frame that is not told yet.
    fresh: Option<FrameMeta>,
    /// The newest one, and from where it was taken.
    newest: Option<(FrameId, Pose)>,
    /// When a state was last told.
    told: Option<Time>,
}

impl Watch {
    /// An observer, and what it will have seen; the assistant points from the first query on if it is `alone`.
    #[must_use]
    pub fn new(orders: Orders, pointing: Arc<Pointing>, alone: bool) -> (Self, watch::Receiver<Seen>) {
        let seen = watch::Sender::new(Seen::default());
        let receiver = seen.subscribe();
        let (camera, sight, goal, telemetry) = (Camera::quad(), None, None, None);
        (Self { orders, pointing, alone, seen, camera, sight, goal, telemetry, fresh: None, newest: None, told: None }, receiver)
    }

    fn line(&self, now: Time, text: String) {
        self.seen.send_modify(|seen| {
            if seen.lines.len() >= LINES {
                seen.lines.pop_front();
            }
            seen.lines.push_back((now, text));
        });
    }

    /// An order that took effect, or that was ignored and why: the assistant's own, or somebody else's.
    fn ordered(&self, now: Time, event: &OperatorEvent, ignored: Option<&str>) {
        let mut given = self.orders.given();
        let own = given.events.front().is_some_and(|(own, _)| own == event);
        let mut overtaken = false;
        if own {
            let since = given.events.pop_front().map_or(0, |(_, since)| since);
            // Somebody else has spoken between the order and its effect: theirs is the last word.
            overtaken = matches!(event, OperatorEvent::Resume) && ignored.is_none() && since < given.overrides;
            match (event, ignored, &given.step) {
                (OperatorEvent::Resume, None, Step::Given) => given.step = Step::Going,
                (OperatorEvent::Resume, Some(why), Step::Given) => self.end(&mut given, false, why.to_owned()),
                (OperatorEvent::Land | OperatorEvent::Abandoned | OperatorEvent::Left, None, _) => {
                    self.end(&mut given, false, "the drone was told to land".to_owned());
                }
                (OperatorEvent::Hold, None, Step::Going | Step::Asked | Step::Flown { .. }) => {
                    self.end(&mut given, false, "the drone was told to hold or to stop".to_owned());
                }
                _ => {}
            }
        } else if matches!(event, OperatorEvent::Left | OperatorEvent::Abandoned) {
            self.end(&mut given, false, "the page of the cockpit is gone".to_owned());
            self.seen.send_modify(|seen| seen.pages_lost += 1);
        } else if ignored.is_none() && !matches!(event, OperatorEvent::KeepOut(_)) {
            if matches!(event, OperatorEvent::Instruction(_) | OperatorEvent::Resume) {
                // What they want is asked of the model.
                self.pointing.answer_all(false);
            }
            self.overridden(&mut given, words::operator(event));
        }
        drop(given);
        if overtaken {
            self.end_and_hold(false, "somebody else has taken over".to_owned());
        }
        if ignored.is_none() {
            self.seen.send_modify(|seen| match event {
                OperatorEvent::Instruction(text) => {
                    (seen.instruction, seen.settled) = (text.clone(), None);
                    seen.instructions += 1;
                }
                // A flight whose outcome was settled is open again.
                OperatorEvent::Resume => seen.settled = None,
                _ => {}
            });
        }
        if ignored.is_none() && !matches!(event, OperatorEvent::Setpoint(_)) {
            self.line(now, words::operator(event));
        }
    }

    /// Somebody else has the craft.
    fn overridden(&self, given: &mut Given, words: String) {
        given.overrides += 1;
        let overrides = given.overrides;
        self.end(given, false, format!("somebody else has taken over: {words}"));
        self.seen.send_modify(|seen| (seen.overrides, seen.overridden) = (overrides, Some(words)));
    }

    /// The end of what was pointed at.
    fn end(&self, given: &mut Given, flown: bool, words: String) {
        if core::mem::take(&mut given.step) != Step::None {
            // What was not asked about yet is not flown later.
            self.pointing.withdraw();
            let limited = core::mem::take(&mut given.limited);
            self.seen.send_modify(|seen| {
                seen.points += 1;
                seen.pointed = Some(Pointed { flown, words, limited });
            });
        }
    }

    /// The same, after which the craft holds by the assistant's own order.
    fn end_and_hold(&self, flown: bool, words: String) {
        self.end(&mut self.orders.given(), flown, words);
        self.orders.give([OperatorEvent::Hold]);
    }

    /// Whether what was pointed at is flown to its end: the craft has wanted to be at rest for a moment.
    fn follow_step(&self, now: Time, pilot: &Pilot) {
        let mut given = self.orders.given();
        let Step::Flown { decided, rests } = &mut given.step else { return };
        let by_itself = self.telemetry.is_some_and(|telemetry| telemetry.phase == FlightPhase::Manoeuvring);
        if by_itself || !pilot.wanted().is_hold() {
            *rests = None;
            return;
        }
        let waited = now.since(*rests.get_or_insert(now));
        let velocity = self.telemetry.and_then(|telemetry| telemetry.velocity);
        let glides = velocity.is_some_and(|velocity| velocity.speed() > SLOW_M_S) && waited < GLIDES;
        if waited >= AT_REST && !glides {
            let words = core::mem::take(decided);
            drop(given);
            self.end_and_hold(true, words);
        }
    }

    /// The state, ten times per second.
    fn state(&mut self, now: Time, pilot: &Pilot) {
        let (phase, decisions, pose) = (pilot.phase(), pilot.decisions(), pilot.known_pose(now));
        let due = self.told.is_none_or(|told| now.since(told) >= Duration::from_millis(100));
        if !due && self.seen.borrow().phase == Some(phase) {
            return;
        }
        self.told = Some(now);
        let telemetry = self.telemetry;
        self.seen.send_modify(|seen| {
            (seen.phase, seen.time, seen.decisions) = (Some(phase), now, decisions);
            (seen.pose, seen.telemetry) = (Some(pose), telemetry);
        });
    }

    /// Takes over the newest frame.
    fn frame(&mut self, now: Time, pilot: &Pilot) {
        let Some(meta) = self.fresh.take() else { return };
        let pose = pilot.pose_at(meta.captured).unwrap_or_else(|| pilot.known_pose(now));
        self.pointing.lost_track(pilot.lost_track());
        // Where an image was taken before a jump of the position, nobody knows.
        if pilot.lost_track().is_none_or(|lost| lost <= meta.captured) {
            self.pointing.frame(meta.id, pose);
        }
        self.newest = Some((meta.id, pose));
        let Some(photo) = self.sight.as_ref().and_then(|sight| sight.photo(meta.id)) else { return };
        let captured = Instant::now().checked_sub(now.since(meta.captured)).unwrap_or_else(Instant::now);
        let goal = self.mark(pose, pilot);
        self.seen.send_modify(|seen| seen.newest = Some(Newest { frame: meta.id.0, pose, captured, photo, goal }));
    }

    /// Where the goal is in a frame.
    fn mark(&self, pose: Pose, pilot: &Pilot) -> Option<Mark> {
        if pilot.phase() != Phase::Flying {
            return None;
        }
        let place = pilot.anchor().map(|anchor| anchor.position()).or(self.goal)?;
        let metres = pose.position.distance(place);
        let ahead = pose.position.displacement_to(place, pose.attitude.heading);
        let at = project_displacement(ahead, &self.camera, pose.attitude, Lifting::Levelled)?;
        (at.is_in_image() && metres >= MARKED_FROM_M).then_some(Mark { u: at.u, v: at.v, metres })
    }
}

impl Observer for Watch {
    fn begin(&mut self, head: &FlightHeader, sight: &Sight) {
        (self.camera, self.sight) = (head.camera, Some(sight.clone()));
        self.pointing.begin(head.camera, false);
        self.pointing.answer_all(self.alone);
        self.seen.send_modify(|seen| {
            (seen.phase, seen.instructions) = (Some(Phase::Ground), 1);
            seen.instruction.clone_from(&head.instruction);
            seen.steps_m = (1..=10_u8).map(|label| head.settings.step.length(label)).collect();
        });
    }

    fn event(&mut self, now: Time, event: &Event) {
        match event {
            Event::Frame(meta) if meta.unusable.is_none() => self.fresh = Some(*meta),
            Event::Telemetry(telemetry) => self.telemetry = Some(*telemetry),
            Event::LinkLost | Event::LinkRestored => {
                let lost = matches!(event, Event::LinkLost);
                self.seen.send_modify(|seen| seen.link_lost = lost);
                self.line(now, if lost { "the link to the drone is lost" } else { "the link is back" }.to_owned());
            }
            _ => {}
        }
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        self.pointing.phase(pilot.phase());
        self.frame(now, pilot);
        match action {
            Action::Ask(query) => {
                if let Some((_, pose)) = self.newest.filter(|(frame, _)| *frame == query.frame) {
                    self.pointing.asked(query.frame, pose);
                }
                let mut given = self.orders.given();
                if given.step == Step::Going {
                    given.step = Step::Asked;
                }
            }
            Action::Note(Note::Decision(decision)) => {
                self.goal = decision.goal.filter(|_| !decision.passed).map(|goal| goal.position);
                let told = words::decision(decision);
                self.seen.send_modify(|seen| seen.last_decision = Some(told.clone()));
                self.line(now, format!("decision {}: {told}", decision.number));
                let mut given = self.orders.given();
                if given.step == Step::Asked {
                    let refused = decision.reading.refused.is_some() || decision.goal.is_none();
                    if refused {
                        drop(given);
                        self.end_and_hold(false, told);
                    } else {
                        given.step = Step::Flown { decided: told, rests: None };
                    }
                }
            }
            Action::Note(Note::QueryFailed { reason, .. }) => {
                self.line(now, format!("the query failed: {reason}"));
                if self.orders.given().step == Step::Asked {
                    self.end_and_hold(false, format!("the point was not flown: {reason}"));
                }
            }
            Action::Note(Note::Operator(event)) => self.ordered(now, event, None),
            Action::Note(Note::OperatorIgnored(event, why)) => self.ordered(now, event, Some(why)),
            // A hold on the ground would stay there: it is given once the craft takes off, and is in effect when it has.
            Action::Note(Note::Phase(Phase::TakeOff)) if self.alone => {
                self.orders.give([OperatorEvent::Hold]);
                self.line(now, words::phase(Phase::TakeOff).to_owned());
            }
            Action::Note(Note::LetGo(news)) => {
                let told = words::let_go(*news);
                self.overridden(&mut self.orders.given(), told.to_owned());
                self.line(now, told.to_owned());
            }
            Action::Note(note) => {
                let told = words::note(note);
                if matches!(note, Note::Limited(_)) || matches!(note, Note::Envelope(cause) if !cause.is_rate()) {
                    self.orders.given().limited.push(told.clone());
                }
                if !matches!(note, Note::Envelope(cause) if cause.is_rate()) {
                    self.line(now, told);
                }
            }
            Action::Finished(ending) => {
                self.goal = None;
                self.end(&mut self.orders.given(), false, ending.cause.clone());
                self.seen.send_modify(|seen| seen.settled = Some(ending.clone()));
                self.line(now, format!("{}: {}", words::outcome(ending.outcome), ending.cause));
            }
            Action::Cancel(_) | Action::Track(_) | Action::Untrack | Action::Command(_) => {}
        }
        self.state(now, pilot);
    }

    fn time(&mut self, now: Time, pilot: &Pilot) {
        self.pointing.phase(pilot.phase());
        self.frame(now, pilot);
        self.follow_step(now, pilot);
        self.state(now, pilot);
    }
}
