//! A flight on one virtual clock: pilot, craft, camera, VLM and faults, like the two ends of a connection in quinn's
//! `Pair`.
//!
//! The craft is the executor's test model, extended by flight phases; its telemetry is exact, at 20 Hz. Frames are
//! captured every 50 ms and arrive 150 ms later. The VLM is a closure that receives the true pose of the frame. Every
//! loop is bounded: a pilot that never becomes idle fails the test.

mod alone;
mod arbitrary;
mod asking;
mod endings;
mod failings;
mod faults;
/// The follower that plugs into a flight, compiled for these tests as well: they fly after people.
#[path = "../../../follow/src/follower/mod.rs"]
#[allow(unreachable_pub, reason = "it is another crate's")]
mod follower;
mod following;
mod gimbal;
mod guided;
mod limits;
mod manoeuvres;
mod motion;
mod operator;
mod ranges;
mod returning;
mod search;
mod take_over;
mod tracking;
mod unseen;
mod view_height;
mod whole;

use std::collections::BTreeMap;

use faults::{Content, Fault, Rule, Stream, pass};

use super::*;
use crate::policy::Move;
use crate::policy::Step;
use crate::policy::spf::{Spf, SpfSettings};
use spf_core::command::{Command, Setpoint};
use spf_core::frame::FrameId;
use spf_core::frame::FrameMeta;
use spf_core::geometry::{BodyDisplacement, EnuPosition, EnuVelocity, Pose};
use spf_core::grounding::GroundingProfile;
use spf_core::lift::{Lifting, project_displacement};
use spf_core::query::QueryId;
use spf_core::query::{ImageBox, ImagePoint, Query};
use spf_core::reply::{Look, OpenWay, Reply, Status};
use spf_envelope::Cleared;
use spf_motion::executor::Motion;
use spf_motion::executor::craft_model::CraftModel;
use spf_space::avoid::PathShape;
use std::collections::VecDeque;

/// Interval of frames and telemetry.
const PERIOD: Duration = Duration::from_millis(50);
/// From a frame's capture to its arrival.
const CAMERA_LATENCY: Duration = Duration::from_millis(150);
/// Maximum number of actions at one instant; more mean that the pilot never becomes idle.
const ACTIONS_AT_ONCE: usize = 64;
/// Maximum number of instants: more than a whole flight has, landing included.
const INSTANTS: usize = 60_000;
/// The pilot's guarantee: zero within this time after the end of a reason to move.
const STOP_RULE: Duration = Duration::from_millis(200);

/// Ground truth of a frame, which the pilot does not know.
#[derive(Clone, Copy, Debug)]
struct Seen {
    pose: Pose,
    speed: f64,
    yaw_rate: f64,
    captured: Time,
}

/// How the VLM answers.
#[derive(Clone, Debug)]
enum Answer {
    After(Duration, String),
    FailsAfter(Duration),
    Never,
}

type Vlm = Box<dyn FnMut(&Query, &Seen) -> Answer>;

#[allow(clippy::large_enum_variant, reason = "a few wait at a time")]
enum Happening {
    Capture,
    Report,
    Deliver(Event),
}

/// Configuration of a flight.
struct Setup {
    settings: PilotSettings,
    craft: Craft,
    limits: Limits,
    policy: Option<Box<dyn Policy>>,
    faults: Vec<Rule>,
    charge: f64,
    /// Telemetry that the craft reports of its true state.
    reports: fn(Telemetry) -> Telemetry,
}

impl Setup {
    fn preset(preset: Preset) -> Self {
        let craft = Craft::quad();
        Self {
            settings: PilotSettings::preset(preset),
            craft,
            limits: Limits::for_craft(&craft),
            policy: None,
            faults: Vec::new(),
            charge: 0.9,
            reports: |telemetry| telemetry,
        }
    }

    fn policy(mut self, policy: impl Policy + 'static) -> Self {
        self.policy = Some(Box::new(policy));
        self
    }

    fn fault(mut self, stream: Stream, from: f64, until: Option<f64>, fault: Fault) -> Self {
        self.faults.push(Rule { stream, from, until, fault });
        self
    }

    fn fly(self, vlm: impl FnMut(&Query, &Seen) -> Answer + 'static) -> Flight {
        let camera = Camera::quad();
        let settings = self.settings;
        let policy = self.policy.unwrap_or_else(|| {
            Box::new(Spf::new(SpfSettings {
                step: settings.step,
                lifting: settings.lifting,
                shape: if settings.motion == Motion::Sequential { PathShape::LevelThenClimb } else { PathShape::Straight },
                avoid: settings.avoid,
                confirm_done: settings.confirm_done,
                grounding: GroundingProfile::default(),
                image_size: None,
                craft: self.craft,
                depth: settings.depth,
                near_m: settings.near_m,
                method: settings.method,
                keep_m: settings.keeps(),
                close_up: false,
            }))
        });
        let pilot = Pilot::new(PilotParts {
            settings,
            craft: self.craft,
            senses: TelemetryAccuracy::EXACT,
            camera,
            limits: self.limits,
            policy,
            steering: settings.keeps().map(|_| Box::<follower::StayWith>::default() as Box<dyn Steering>),
            instruction: "fly to the red crane".to_owned(),
        });
        let mut model = CraftModel::new(self.craft);
        (model.now, model.position, model.heading) = (Time::ZERO, EnuPosition::default(), 0.0);
        let mut flight = Flight {
            pilot,
            model,
            phase: FlightPhase::OnGround,
            crashed: false,
            charge: self.charge,
            reports: self.reports,
            now: Time::ZERO,
            vlm: Box::new(vlm),
            faults: self.faults,
            sent: [0; 4],
            queue: BTreeMap::new(),
            queued: 0,
            valid_until: Time::MAX,
            own_until: None,
            refuses_manoeuvres: false,
            frames: Vec::new(),
            delivered: Vec::new(),
            queries: Vec::new(),
            cancelled: Vec::new(),
            tracked: Vec::new(),
            commands: Vec::new(),
            notes: Vec::new(),
            finished: Vec::new(),
            reopened: 0,
        };
        flight.enqueue(Time::ZERO, Happening::Report);
        flight.enqueue(Time::ZERO, Happening::Capture);
        flight
    }
}

/// The flight and its record.
struct Flight {
    pilot: Pilot,
    model: CraftModel,
    phase: FlightPhase,
    crashed: bool,
    charge: f64,
    reports: fn(Telemetry) -> Telemetry,
    now: Time,
    vlm: Vlm,
    faults: Vec<Rule>,
    /// Messages so far of each stream of the faults.
    sent: [u64; 4],
    queue: BTreeMap<(Time, u64), Happening>,
    queued: u64,
    /// Expiry of the setpoint that the craft flies.
    valid_until: Time,
    /// Time at which the craft's manoeuvre ends; `None` while it flies none, or refuses them.
    own_until: Option<Time>,
    refuses_manoeuvres: bool,
    /// Truth of each capture, by frame number.
    frames: Vec<Seen>,
    /// Frames as they reached the pilot, and when.
    delivered: Vec<(Time, FrameMeta)>,
    queries: Vec<(Time, Query)>,
    cancelled: Vec<(Time, QueryId)>,
    tracked: Vec<(Time, Option<spf_core::track::TrackStart>)>,
    commands: Vec<(Time, Command)>,
    notes: Vec<(Time, Note)>,
    finished: Vec<(Time, Ending, EnuPosition)>,
    /// How often the operator continued after an outcome.
    reopened: usize,
}

impl Flight {
    fn enqueue(&mut self, at: Time, what: Happening) {
        self.queued += 1;
        self.queue.insert((at, self.queued), what);
    }

    /// Sends a message to the pilot through the faults. `frozen` makes it one of an earlier time, `blank` empties it.
    fn send(
        &mut self,
        stream: Stream,
        at: Time,
        event: Event,
        frozen: impl Fn(&Self, Time) -> Option<Event>,
        blank: Option<Event>,
    ) {
        let index = &mut self.sent[stream as usize];
        *index += 1;
        for (delay, content) in pass(&self.faults, self.now, stream, *index) {
            let event = match content {
                Content::Intact => Some(event.clone()),
                Content::FrozenSince(since) => frozen(self, since),
                Content::Blank => blank.clone(),
            };
            if let Some(event) = event {
                self.enqueue(at + delay, Happening::Deliver(event));
            }
        }
    }

    fn capture(&mut self) {
        self.frames.push(Seen {
            pose: self.model.pose(),
            speed: self.model.velocity.speed(),
            yaw_rate: self.model.yaw_rate.abs(),
            captured: self.now,
        });
        let frame = FrameMeta {
            id: FrameId(self.frames.len() as u64 - 1),
            captured: self.now,
            received: self.now + CAMERA_LATENCY,
            capture_counter: self.frames.len() as u64,
            width: 960,
            height: 720,
            unusable: None,
        };
        let last_before = move |flight: &Self, since: Time| {
            let index = flight.frames.iter().rposition(|seen| seen.captured < since)?;
            let (captured, capture_counter) = (flight.frames[index].captured, index as u64 + 1);
            // A frozen source counts on and repeats the image.
            Some(Event::Frame(FrameMeta { captured, capture_counter, ..frame }))
        };
        let blank = Event::Frame(FrameMeta { unusable: Some(spf_core::frame::Unusable::Blank), ..frame });
        self.send(Stream::Frames, self.now + CAMERA_LATENCY, Event::Frame(frame), last_before, Some(blank));
        self.enqueue(self.now + PERIOD, Happening::Capture);
    }

    fn telemetry(&self) -> Telemetry {
        Telemetry {
            time: self.now,
            position: Some(self.model.position),
            velocity: Some(self.model.velocity),
            attitude: self.model.known().attitude,
            yaw_rate: Some(self.model.yaw_rate),
            height: Some(self.model.position.up),
            battery: Some(self.charge),
            ground_clearance: None,
            temperature: None,
            phase: self.phase,
            crashed: self.crashed,
            position_sd: None,
            imu_error: false,
            returns_to: Some(EnuPosition::default()),
        }
    }

    fn report(&mut self) {
        match self.phase {
            FlightPhase::TakingOff if self.model.position.up > self.model.craft.take_off_height - 0.3 => {
                self.phase = FlightPhase::Flying;
                self.model.send(Setpoint::HOLD);
            }
            FlightPhase::Manoeuvring if self.own_until.is_none_or(|until| until <= self.now) => {
                self.phase = FlightPhase::Flying;
                self.model.send(Setpoint::HOLD);
            }
            FlightPhase::Landing if self.model.position.up <= 0.05 => {
                self.phase = FlightPhase::OnGround;
                (self.model.velocity, self.model.yaw_rate) = (EnuVelocity::default(), 0.0);
                self.model.send(Setpoint::HOLD);
            }
            _ => {}
        }
        let telemetry = (self.reports)(self.telemetry());
        self.send(Stream::Telemetry, self.now, Event::Telemetry(telemetry), |_, _| None, None);
        self.enqueue(self.now + PERIOD, Happening::Report);
    }

    /// Applies a command to the craft as its autopilot would.
    fn command(&mut self, cleared: &Cleared<Command>) {
        self.commands.push((self.now, *cleared.get()));
        let index = &mut self.sent[Stream::Commands as usize];
        *index += 1;
        if pass(&self.faults, self.now, Stream::Commands, *index).is_empty() {
            return;
        }
        let (up, phase) = (self.model.position.up, self.phase);
        match *cleared.get() {
            Command::TakeOff if phase == FlightPhase::OnGround => {
                self.phase = FlightPhase::TakingOff;
                self.model.send(Setpoint { up: self.model.craft.climb_speed, ..Setpoint::HOLD });
            }
            Command::Setpoint(setpoint) if phase == FlightPhase::Flying => {
                self.model.send(setpoint);
                self.valid_until = cleared.valid_until();
            }
            Command::Manoeuvre(manoeuvre) if phase == FlightPhase::Flying && !self.refuses_manoeuvres => {
                self.phase = FlightPhase::Manoeuvring;
                self.own_until = Some(self.now + secs(manoeuvre.duration(self.model.craft.yaw_rate)));
                self.valid_until = Time::MAX;
                self.model.send(manoeuvre.velocity(self.model.craft.yaw_rate));
            }
            Command::Setpoint(setpoint) if phase == FlightPhase::Manoeuvring && setpoint.is_hold() => {
                self.own_until = None;
                self.model.send(setpoint);
            }
            // A hold interrupts a landing.
            Command::Setpoint(setpoint) if phase == FlightPhase::Landing && setpoint.is_hold() => {
                self.phase = FlightPhase::Flying;
                self.valid_until = cleared.valid_until();
                self.model.send(setpoint);
            }
            // Home is below it, as far as the pilot can tell.
            Command::Return if up > 0.05 && self.model.craft.return_height.is_some() => {
                self.phase = FlightPhase::Landing;
                self.valid_until = Time::MAX;
                self.model.send(Setpoint { up: -0.2, ..Setpoint::HOLD });
            }
            Command::Land if up > 0.05 => {
                self.phase = FlightPhase::Landing;
                self.valid_until = Time::MAX;
                self.model.send(Setpoint { up: -0.8, ..Setpoint::HOLD });
            }
            Command::EmergencyStop => {
                self.phase = FlightPhase::Stopped;
                self.valid_until = Time::MAX;
                (self.model.velocity, self.model.yaw_rate) = (EnuVelocity::default(), 0.0);
                self.model.send(Setpoint::HOLD);
            }
            _ => {}
        }
    }

    fn ask(&mut self, query: Query) {
        let seen = self.frames[usize::try_from(query.frame.0).unwrap()];
        let answer = (self.vlm)(&query, &seen);
        let id = query.id;
        self.queries.push((self.now, query));
        match answer {
            Answer::After(latency, text) => {
                let blank = Event::Reply { id, text: String::new() };
                self.send(Stream::Replies, self.now + latency, Event::Reply { id, text }, |_, _| None, Some(blank));
            }
            Answer::FailsAfter(latency) => {
                let reason = "503 service unavailable".to_owned();
                self.send(Stream::Replies, self.now + latency, Event::ReplyFailed { id, reason }, |_, _| None, None);
            }
            Answer::Never => {}
        }
    }

    /// Polls the pilot until it returns `None`.
    fn pump(&mut self) {
        for _ in 0..ACTIONS_AT_ONCE {
            match self.pilot.poll(self.now) {
                None => {
                    if let Some((deadline, _)) = self.pilot.next_deadline() {
                        assert!(deadline > self.now, "idle, and due at {deadline}, which is not after {}", self.now);
                    }
                    return;
                }
                Some(Action::Ask(query)) => self.ask(*query),
                Some(Action::Cancel(id)) => self.cancelled.push((self.now, id)),
                Some(Action::Track(start)) => self.tracked.push((self.now, Some(start))),
                Some(Action::Untrack) => self.tracked.push((self.now, None)),
                Some(Action::Command(cleared)) => self.command(&cleared),
                Some(Action::Note(note)) => self.notes.push((self.now, note)),
                Some(Action::Finished(ending)) => self.finished.push((self.now, ending, self.model.position)),
            }
        }
        panic!("at {} the pilot never becomes idle", self.now);
    }

    /// Passes an event to the pilot now.
    fn tell(&mut self, event: Event) {
        let ended = self.pilot.ending().is_some();
        self.pilot.handle(self.now, event);
        self.reopened += usize::from(ended && self.pilot.ending().is_none());
        self.pump();
    }

    fn operator(&mut self, event: OperatorEvent) {
        self.tell(Event::Operator(event));
    }

    /// Advances to the next instant at which something is due.
    fn step(&mut self, until: Time) {
        let due = self.queue.first_key_value().map_or(Time::MAX, |((at, _), _)| *at);
        let next =
            due.min(self.pilot.next_deadline().map_or(Time::MAX, |(at, _)| at)).min(self.valid_until).min(until).max(self.now);
        self.model.fly_until(next);
        self.now = next;
        if self.valid_until <= next {
            self.model.send(Setpoint::HOLD);
            self.valid_until = Time::MAX;
        }
        if due <= next
            && let Some((_, happening)) = self.queue.pop_first()
        {
            match happening {
                Happening::Capture => self.capture(),
                Happening::Report => self.report(),
                Happening::Deliver(event) => {
                    if let Event::Frame(frame) = event {
                        self.delivered.push((self.now, frame));
                    }
                    self.pilot.handle(self.now, event);
                }
            }
        }
        self.pump();
    }

    fn until(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        for _ in 0..INSTANTS {
            if done(self) {
                return;
            }
            self.step(Time::MAX);
        }
        panic!("never: {what}; at {}, {:?}, notes {:?}", self.now, self.pilot.phase(), self.notes.last());
    }

    fn pass(&mut self, seconds: f64) {
        let until = self.now + duration_from_secs(seconds);
        self.at(until);
    }

    /// Handles the current instant.
    fn at(&mut self, time: Time) {
        for _ in 0..INSTANTS {
            if self.now >= time {
                return;
            }
            self.step(time);
        }
        panic!("{time} never comes");
    }

    fn end(&mut self) -> Outcome {
        self.until("the end", |flight| flight.pilot.phase() == Phase::Ended);
        self.outcome()
    }

    fn outcome(&self) -> Outcome {
        assert_eq!(self.finished.len(), 1 + self.reopened, "an outcome is told once: {:?}", self.finished);
        let (_, last, _) = self.finished.last().unwrap();
        assert_eq!(self.pilot.ending(), Some(last));
        last.outcome
    }

    fn until_phase(&mut self, phase: Phase) {
        self.until("a phase", |flight| flight.pilot.phase() == phase);
    }

    fn until_asked(&mut self, queries: usize) {
        self.until("a query", |flight| flight.queries.len() >= queries);
    }

    /// Until the craft is commanded to move at least this fast.
    fn until_moving(&mut self) {
        self.until("a setpoint that moves", |flight| !flight.setpoint().is_hold() && flight.model.velocity.speed() > 0.5);
    }

    /// The last setpoint commanded.
    fn setpoint(&self) -> Setpoint {
        self.commands
            .iter()
            .rev()
            .find_map(|(_, command)| match command {
                Command::Setpoint(setpoint) => Some(*setpoint),
                _ => None,
            })
            .unwrap_or(Setpoint::HOLD)
    }

    /// Setpoints commanded from `from` on.
    fn setpoints_since(&self, from: Time) -> impl Iterator<Item = (Time, Setpoint)> + '_ {
        self.commands.iter().filter(move |(at, _)| *at >= from).filter_map(|(at, command)| match command {
            Command::Setpoint(setpoint) => Some((*at, *setpoint)),
            _ => None,
        })
    }

    /// Checks that no motion is commanded from 0.2 s after `reason_ended` on, until now, and that something was
    /// commanded within it.
    fn assert_stopped_since(&self, reason_ended: Time) {
        let by = reason_ended + STOP_RULE;
        let told = self.commands.iter().any(|(at, command)| {
            (reason_ended..=by).contains(at) && !matches!(command, Command::Setpoint(setpoint) if !setpoint.is_hold())
        });
        assert!(told, "nothing stops the craft between {reason_ended} and {by}");
        if let Some((at, setpoint)) = self.setpoints_since(by).find(|(_, setpoint)| !setpoint.is_hold()) {
            panic!("the reason to move ended at {reason_ended}, and at {at} it flies {setpoint:?}");
        }
    }

    fn decisions(&self) -> impl Iterator<Item = &Decision> {
        self.notes.iter().filter_map(|(_, note)| match note {
            Note::Decision(decision) => Some(&**decision),
            _ => None,
        })
    }

    fn count(&self, what: impl Fn(&Command) -> bool) -> usize {
        self.commands.iter().filter(|(_, command)| what(command)).count()
    }
}

fn secs(seconds: f64) -> Duration {
    duration_from_secs(seconds)
}

/// A target that many metres right, ahead and up of the take-off point, facing north.
fn target(right: f64, forward: f64, up: f64) -> EnuPosition {
    EnuPosition::default().displaced(BodyDisplacement { right, forward, up }, 0.0)
}

fn json(reply: &Reply) -> String {
    reply.to_json(&GroundingProfile::default(), false)
}

fn navigate(u: f64, v: f64, depth: u8) -> String {
    json(&Reply {
        point: Some(ImagePoint { u, v }),
        depth: Some(depth),
        target: Some("red crane".to_owned()),
        ..Reply::new(Status::Navigating)
    })
}

fn not_visible(look: Look) -> String {
    json(&Reply { look: Some(look), ..Reply::new(Status::NotVisible) })
}

/// The same with an open direction at the level middle.
fn open_way(look: Look, u: f64, depth: u8) -> String {
    let open_way = Some(OpenWay { point: ImagePoint { u, v: 0.5 }, depth });
    json(&Reply { look: Some(look), open_way, ..Reply::new(Status::NotVisible) })
}

fn done() -> String {
    json(&Reply::new(Status::Done))
}

/// Perfect perception: the true point of `target`, the depth label of its range; done within 3 m.
fn points_at(target: EnuPosition, seen: &Seen) -> String {
    let range = seen.pose.position.distance(target);
    if range < 3.0 {
        return done();
    }
    let away = seen.pose.position.displacement_to(target, seen.pose.attitude.heading);
    let point = project_displacement(away, &Camera::quad(), seen.pose.attitude, Lifting::Levelled);
    match point.filter(|p| (0.0..=1.0).contains(&p.u) && (0.0..=1.0).contains(&p.v)) {
        Some(point) => {
            let text = navigate(point.u, point.v, (1.0 + 4.5 * range.log10()).round().clamp(1.0, 10.0) as u8);
            let mut reply = spf_core::reply::parse_reply(&text, &GroundingProfile::default(), false).unwrap();
            let edge = |x: f64, by: f64| (x + by).clamp(0.0, 1.0);
            let (u, v) = (point.u, point.v);
            reply.target_box =
                Some(ImageBox { left: edge(u, -0.02), top: edge(v, -0.02), right: edge(u, 0.02), bottom: edge(v, 0.02) });
            reply.to_json(&GroundingProfile::default(), false)
        }
        None => not_visible(if away.right < 0.0 { Look::Left } else { Look::Right }),
    }
}

/// A VLM with perfect perception that takes `latency` to answer.
fn perfect(target: EnuPosition, latency: f64) -> impl FnMut(&Query, &Seen) -> Answer {
    move |_, seen| Answer::After(secs(latency), points_at(target, seen))
}

/// A VLM that always gives the same answer.
fn always(text: String, latency: f64) -> impl FnMut(&Query, &Seen) -> Answer {
    move |_, _| Answer::After(secs(latency), text.clone())
}

/// Both presets.
const PRESETS: [Preset; 2] = [Preset::Default, Preset::Paper];
