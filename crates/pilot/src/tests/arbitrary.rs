//! Any events in any order at any times: nothing panics, nothing leaves the limits, nothing moves without a fresh
//! reason, and every run ends.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;
use crate::policy::{Move, Output, PolicyEvent};
use spf_core::geometry::Attitude;
use spf_core::primitives::Primitives;
use spf_core::query::{ActForm, QueryKind};
use spf_core::track::{TrackQuality, TrackReport};

/// The possible events.
#[derive(Clone, Debug)]
enum Happens {
    /// Time passes, milliseconds; the pilot is polled at the times that it requests.
    Time(u64),
    /// A frame of `age` milliseconds ago; `fresh` counts the capture counter on.
    Frame {
        age: i64,
        fresh: bool,
        unusable: bool,
    },
    Telemetry {
        age: i64,
        phase: FlightPhase,
        crashed: bool,
        odd: Option<f64>,
        battery: f64,
    },
    /// An answer to the `which`th newest query.
    Reply {
        which: u64,
        text: String,
    },
    Chunk {
        which: u64,
        text: String,
    },
    Fails {
        which: u64,
    },
    Operator(OperatorEvent),
    Link(bool),
    LetGo(LetGo),
    /// A report on the track of the `which`th newest query.
    Track {
        which: u64,
        age: i64,
        area: [f64; 4],
        scale: f64,
        good: bool,
    },
    /// Everything works for this many milliseconds: frames and telemetry at 20 Hz, answers after 0.3 s.
    Good(u64),
}

fn texts() -> impl Strategy<Value = String> {
    prop_oneof![
        6 => (0.0..=1.0, 0.0..=1.0, 1..=10u8).prop_map(|(u, v, depth)| navigate(u, v, depth)),
        2 => (0.0..=1.0, 0.0..=1.0, 1..=10u8).prop_map(|(u, v, depth)| following(u, v, depth)),
        1 => Just(not_visible(Look::Left)),
        1 => Just(not_visible(Look::Down)),
        1 => Just(done()),
        1 => ".{0,40}",
        1 => Just(r#"{"forward":3,"climb":1}"#.to_owned()),
        1 => Just(r#"{"legs":"none"}"#.to_owned()),
    ]
}

fn following(u: f64, v: f64, depth: u8) -> String {
    let edge = |x: f64, by: f64| (x + by).clamp(0.0, 1.0);
    json(&Reply {
        point: Some(ImagePoint { u, v }),
        depth: Some(depth),
        target: Some("man".to_owned()),
        target_box: Some(ImageBox { left: edge(u, -0.1), top: edge(v, -0.1), right: edge(u, 0.1), bottom: edge(v, 0.1) }),
        ..Reply::new(Status::Following)
    })
}

fn track_reports() -> impl Strategy<Value = Happens> {
    let odd = prop_oneof![1 => Just(f64::NAN), 1 => Just(1e300), 1 => Just(-5.0), 1 => Just(0.0)];
    let edge = prop_oneof![12 => 0.0..1.0_f64, 1 => odd.clone()].boxed();
    let area = [edge.clone(), edge.clone(), edge.clone(), edge];
    let scale = prop_oneof![6 => 0.3..3.0_f64, 1 => odd];
    let age = prop_oneof![8 => 0..400i64, 1 => -100_000..100_000i64];
    (0..3u64, age, area, scale, prop::bool::weighted(0.8)).prop_map(|(which, age, area, scale, good)| Happens::Track {
        which,
        age,
        area,
        scale,
        good,
    })
}

fn operator_events() -> impl Strategy<Value = OperatorEvent> {
    let speed = prop_oneof![4 => -3.0..3.0, 1 => Just(f64::NAN), 1 => Just(1e9)];
    let setpoint = (speed.clone(), speed.clone(), speed.clone(), speed)
        .prop_map(|(right, forward, up, yaw_rate)| OperatorEvent::Setpoint(Setpoint { right, forward, up, yaw_rate }));
    prop_oneof![
        3 => Just(OperatorEvent::Hold),
        6 => Just(OperatorEvent::Resume),
        4 => setpoint,
        2 => Just(OperatorEvent::Instruction("fly to the tree".to_owned())),
        1 => Just(OperatorEvent::KeepOut(Vec::new())),
        1 => Just(OperatorEvent::Land),
        1 => Just(OperatorEvent::Left),
        1 => Just(OperatorEvent::Abandoned),
        1 => Just(OperatorEvent::CutMotors),
    ]
}

fn happenings() -> impl Strategy<Value = Happens> {
    let phase = prop_oneof![
        8 => Just(FlightPhase::Flying),
        1 => Just(FlightPhase::Manoeuvring),
        2 => Just(FlightPhase::OnGround),
        2 => Just(FlightPhase::TakingOff),
        1 => Just(FlightPhase::Landing),
        1 => Just(FlightPhase::Stopped),
    ];
    let odd = prop_oneof![6 => Just(None), 1 => Just(Some(f64::NAN)), 1 => Just(Some(1e300)), 1 => Just(Some(-50.0))];
    let age = prop_oneof![8 => 0..300i64, 1 => -100_000..100_000i64];
    let telemetry = (age.clone(), phase, 0..40u8, odd, 0.05..1.0_f64).prop_map(|(age, phase, crashed, odd, battery)| {
        Happens::Telemetry { age, phase, crashed: crashed == 0, odd, battery: battery.sqrt() }
    });
    prop_oneof![
        8 => (1..2500u64).prop_map(Happens::Time),
        4 => (age, any::<bool>(), 0..5u8).prop_map(|(age, fresh, unusable)| Happens::Frame { age, fresh, unusable: unusable == 0 }),
        4 => telemetry,
        6 => (0..4u64, texts()).prop_map(|(which, text)| Happens::Reply { which, text }),
        1 => (0..4u64, texts()).prop_map(|(which, text)| Happens::Chunk { which, text }),
        2 => (0..4u64).prop_map(|which| Happens::Fails { which }),
        4 => operator_events().prop_map(Happens::Operator),
        1 => any::<bool>().prop_map(Happens::Link),
        1 => prop_oneof![Just(LetGo::Somebody), Just(LetGo::Failsafe), Just(LetGo::Nobody), Just(LetGo::NotLanded)]
            .prop_map(Happens::LetGo),
        6 => track_reports(),
        12 => (100..6000u64).prop_map(Happens::Good),
    ]
}

/// A policy for which one answer is several moves, each flown from the craft's current position.
#[derive(Default)]
struct Legs {
    pending: Option<QueryId>,
    left: Vec<Primitives>,
    moving: bool,
    next_id: u64,
}

impl Legs {
    fn next_leg(&mut self) -> Step {
        let leg = self.left.pop();
        self.moving = leg.is_some();
        leg.map_or(Step::Look, |primitives| Step::Move(Move { primitives, anchor: None, then_rest: true, looks: false }))
    }
}

impl Policy for Legs {
    fn name(&self) -> &'static str {
        "legs"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let step = match event {
            PolicyEvent::Instruction(_) => {
                *self = Self { next_id: self.next_id, ..Self::default() };
                Step::Look
            }
            PolicyEvent::Frame(view) if self.pending.is_none() && !self.moving => {
                let id = QueryId(self.next_id);
                self.next_id += 1;
                self.pending = Some(id);
                Step::Ask(Box::new(Query::new(id, view.frame.id, QueryKind::Act { form: ActForm::Commands })))
            }
            PolicyEvent::Reply { id, text, .. } if self.pending.take_if(|pending| *pending == id).is_some() => {
                let reply: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
                let metres = |key: &str| reply.get(key).and_then(serde_json::Value::as_f64);
                match (metres("forward"), metres("climb")) {
                    (Some(forward), Some(climb)) => {
                        let still = Primitives::default();
                        self.left = vec![Primitives { climb, ..still }, Primitives { forward, ..still }];
                        self.next_leg()
                    }
                    _ if reply.get("legs").is_some() => Step::Done,
                    _ => Step::Reject("no legs".to_owned()),
                }
            }
            PolicyEvent::ReplyFailed { id } => {
                self.pending.take_if(|pending| *pending == id);
                Step::Wait
            }
            PolicyEvent::MoveEnded { completed: true } if self.moving => self.next_leg(),
            PolicyEvent::MoveEnded { .. } => {
                (self.left, self.moving) = (Vec::new(), false);
                Step::Wait
            }
            _ => Step::Wait,
        };
        step.into()
    }
}

/// A pilot without a world: events are generated. Knows the rule for a reason to move.
struct Chaos {
    pilot: Pilot,
    now: Time,
    counter: u64,
    queries: Vec<(Time, QueryId)>,
    /// Open queries, according to the pilot's own actions.
    out: BTreeSet<QueryId>,
    legs: bool,
    /// Position of the craft in consistent telemetry.
    up: f64,
    phase: FlightPhase,
    limits: Limits,
    /// An expected answer that requests motion, since the last event that ends every reason to move.
    reason: bool,
    hand: Option<Time>,
    /// Time at which the last cleared manoeuvre ends, while nothing has ended it.
    own_until: Option<Time>,
    captured: Option<Time>,
    link: bool,
    /// Targets are tracked and followed.
    track: bool,
    moved: usize,
    finished: usize,
    /// How often the operator continued after an outcome.
    reopened: usize,
}

impl Chaos {
    fn new(preset: Preset, legs: bool, own: bool, track: bool, max_time: f64) -> Self {
        let mut setup = Setup::preset(preset);
        setup.settings.track = track;
        if own {
            (setup.settings.motion, setup.settings.think) = (Motion::Manoeuvres, QueryTiming::Stop);
        }
        setup.settings.max_time = secs(max_time);
        setup.settings.reply_timeout = secs(4.0);
        let limits = setup.limits.clone();
        let setup = if legs { setup.policy(Legs::default()) } else { setup };
        let pilot = setup.fly(|_, _| Answer::Never).pilot;
        Self {
            pilot,
            now: Time::ZERO,
            counter: 0,
            queries: Vec::new(),
            out: BTreeSet::new(),
            legs,
            up: 0.0,
            phase: FlightPhase::OnGround,
            limits,
            reason: false,
            hand: None,
            own_until: None,
            captured: None,
            link: true,
            track,
            moved: 0,
            finished: 0,
            reopened: 0,
        }
    }

    fn tell(&mut self, event: Event) {
        match &event {
            Event::Frame(frame) if frame.unusable.is_none() => {
                self.captured = self.captured.max(Some(frame.captured.min(self.now)))
            }
            Event::Operator(OperatorEvent::Setpoint(_)) => (self.reason, self.hand) = (false, Some(self.now)),
            Event::Operator(OperatorEvent::Resume) => self.hand = None,
            // Flown by hand, whatever the next instruction is, and wherever it is not to fly by itself.
            Event::Operator(OperatorEvent::Instruction(_) | OperatorEvent::KeepOut(_)) => self.reason = false,
            // What somebody else flies goes on, and a setpoint from before with it until it expires.
            Event::Operator(OperatorEvent::Abandoned) => self.reason = false,
            Event::Operator(_) => (self.reason, self.hand) = (false, None),
            // A landing that was not commanded changes nothing.
            Event::LetGo(LetGo::NotLanded) => {}
            Event::LetGo(_) => (self.reason, self.hand) = (false, None),
            Event::LinkLost => (self.reason, self.link) = (false, false),
            Event::LinkRestored => self.link = true,
            // The second look at somebody who is followed is taken while the craft goes along with them.
            Event::Reply { id, text } if self.track && *text == done() => drop(self.out.remove(id)),
            Event::Reply { id, text } if self.out.remove(id) => {
                let words: &[&str] = if self.legs { &["forward"] } else { &["navigating", "following", "not_visible"] };
                self.reason = words.iter().any(|word| text.contains(word)) && self.link;
            }
            Event::ReplyFailed { id, .. } if self.out.remove(id) => self.reason = false,
            _ => {}
        }
        let ended = self.pilot.ending().is_some();
        self.pilot.handle(self.now, event);
        self.reopened += usize::from(ended && self.pilot.ending().is_none());
        self.pump();
    }

    fn pump(&mut self) {
        for _ in 0..ACTIONS_AT_ONCE {
            match self.pilot.poll(self.now) {
                None => {
                    assert!(self.pilot.next_deadline().is_none_or(|(deadline, _)| deadline > self.now), "due now, and idle");
                    return;
                }
                Some(Action::Ask(query)) => {
                    assert!(self.out.insert(query.id), "an id twice");
                    self.queries.push((self.now, query.id));
                }
                Some(Action::Cancel(id)) => {
                    assert!(self.out.remove(&id), "cancels what is not out");
                    self.reason = false;
                }
                Some(Action::Command(cleared)) => self.command(&cleared),
                Some(Action::Finished(_)) => self.finished += 1,
                Some(Action::Track(_) | Action::Untrack | Action::Note(_)) => {}
            }
        }
        panic!("never becomes idle");
    }

    fn command(&mut self, cleared: &Cleared<Command>) {
        match *cleared.get() {
            Command::TakeOff => self.phase = FlightPhase::TakingOff,
            Command::Tilt(tilt) => assert!(tilt.is_finite()),
            Command::Land | Command::Return => (self.phase, self.own_until) = (FlightPhase::Landing, None),
            Command::EmergencyStop => (self.phase, self.own_until) = (FlightPhase::Stopped, None),
            Command::Manoeuvre(manoeuvre) => {
                assert!(manoeuvre.is_finite(), "{manoeuvre:?}");
                let velocity = manoeuvre.velocity(1.0);
                assert!(velocity.right.hypot(velocity.forward) <= self.limits.max_speed + 1e-9, "{manoeuvre:?}");
                assert!(velocity.up.abs() <= self.limits.max_climb + 1e-9, "{manoeuvre:?}");
                self.moved += 1;
                self.has_reason();
                self.own_until = Some(self.now + secs(2.0));
                self.phase = FlightPhase::Manoeuvring;
            }
            Command::Setpoint(setpoint) => {
                self.own_until = None;
                if self.phase == FlightPhase::Manoeuvring || (self.phase == FlightPhase::Landing && setpoint.is_hold()) {
                    self.phase = FlightPhase::Flying;
                }
                let limits = &self.limits;
                assert!(setpoint.is_finite(), "{setpoint:?}");
                assert!(setpoint.right.hypot(setpoint.forward) <= limits.max_speed + 1e-9, "{setpoint:?}");
                assert!(setpoint.up.abs() <= limits.max_climb + 1e-9 && setpoint.yaw_rate.abs() <= limits.max_yaw_rate + 1e-9);
                assert!(cleared.valid_until() <= self.now + duration_from_secs(limits.setpoint_validity));
                if !setpoint.is_hold() {
                    self.moved += 1;
                    self.has_reason();
                }
            }
        }
    }

    /// The conditions for any motion.
    fn has_reason(&self) {
        assert!(self.link, "moves without a link");
        match self.pilot.phase() {
            Phase::Manual => {
                let hand = self.hand.expect("manual flight has a hand");
                assert!(self.now.since(hand) < secs(0.5), "a released key flies on");
            }
            Phase::Flying => {
                assert!(self.pilot.ending().is_none(), "moves though the flight is over");
                assert!(self.reason, "moves without an answer since the last stop");
                let captured = self.captured.expect("nothing was seen");
                assert!(self.now.since(captured) <= secs(self.limits.max_frame_age) + STOP_RULE, "moves on stale frames");
            }
            phase => panic!("moves in {phase:?}"),
        }
    }

    /// Time passes as the pilot's deadlines require.
    fn pass(&mut self, millis: u64) {
        let until = self.now + Duration::from_millis(millis);
        // A manoeuvre that is flown has a reason all the time: one that lost it was ended within a tick.
        if let Some(ends) = self.own_until {
            assert!(self.reason || self.now > ends || !self.is_flown(), "a manoeuvre without a reason is flown on");
        }
        for _ in 0..100_000 {
            let due = self.pilot.next_deadline().map_or(until, |(at, _)| at).max(self.now);
            if due > until || self.now == until {
                self.now = until;
                self.pump();
                return;
            }
            self.now = due;
            self.pump();
        }
        panic!("time does not pass");
    }

    /// Whether the pilot flies, as opposed to having ended the flight in the same instant.
    fn is_flown(&self) -> bool {
        matches!(self.pilot.phase(), Phase::Flying)
    }

    fn id(&self, which: u64) -> QueryId {
        self.queries.iter().rev().nth(which as usize).map_or(QueryId(which), |(_, id)| *id)
    }

    fn telemetry(&self, age: i64) -> Telemetry {
        Telemetry {
            time: self.ago(age),
            position: Some(EnuPosition { east: 0.0, north: 0.0, up: self.up }),
            velocity: Some(EnuVelocity::default()),
            yaw_rate: Some(0.0),
            height: Some(self.up),
            battery: Some(0.9),
            phase: self.phase,
            ..Telemetry::default()
        }
    }

    fn ago(&self, millis: i64) -> Time {
        let by = Duration::from_millis(millis.unsigned_abs());
        if millis < 0 { self.now + by } else { self.now - by }
    }

    fn frame(&mut self, age: i64, fresh: bool, unusable: bool) {
        self.counter += u64::from(fresh);
        self.tell(Event::Frame(FrameMeta {
            id: FrameId(self.counter),
            captured: self.ago(age),
            received: self.now,
            capture_counter: self.counter,
            width: 960,
            height: 720,
            unusable: unusable.then_some(spf_core::frame::Unusable::Blank),
        }));
    }

    fn happen(&mut self, happens: Happens) {
        match happens {
            Happens::Time(millis) => self.pass(millis),
            Happens::Frame { age, fresh, unusable } => self.frame(age, fresh, unusable),
            Happens::Telemetry { age, phase, crashed, odd, battery } => {
                let mut telemetry = self.telemetry(age);
                (telemetry.phase, telemetry.crashed, telemetry.battery) = (phase, crashed, Some(battery));
                if let Some(odd) = odd {
                    telemetry.position = Some(EnuPosition { east: odd, north: -odd, up: odd });
                    telemetry.attitude = Attitude { heading: odd, pitch: odd, roll: 0.0 };
                    telemetry.velocity = Some(EnuVelocity { east: odd, north: 0.0, up: odd });
                }
                self.tell(Event::Telemetry(telemetry));
            }
            Happens::Reply { which, text } => self.tell(Event::Reply { id: self.id(which), text }),
            Happens::Chunk { which, text } => self.tell(Event::Chunk { id: self.id(which), text }),
            Happens::Fails { which } => self.tell(Event::ReplyFailed { id: self.id(which), reason: "x".to_owned() }),
            Happens::Operator(event) => self.tell(Event::Operator(event)),
            Happens::Link(true) => self.tell(Event::LinkRestored),
            Happens::LetGo(news) => self.tell(Event::LetGo(news)),
            Happens::Link(false) => self.tell(Event::LinkLost),
            Happens::Track { which, age, area: [left, top, right, bottom], scale, good } => {
                let quality = if good { TrackQuality::Good } else { TrackQuality::Lost };
                self.report(self.id(which), age, ImageBox { left, top, right, bottom }, scale, quality);
            }
            Happens::Good(millis) => self.go_well(millis),
        }
    }

    fn report(&mut self, id: QueryId, age: i64, area: ImageBox, scale: f64, quality: TrackQuality) {
        let captured = self.ago(age);
        self.tell(Event::Track(TrackReport { id, frame: FrameId(self.counter), captured, area, scale, quality }));
    }

    fn go_well(&mut self, millis: u64) {
        let until = self.now + Duration::from_millis(millis);
        while self.now < until {
            self.pass(50);
            self.up += match self.phase {
                FlightPhase::TakingOff => 0.05,
                FlightPhase::Landing => -0.05,
                _ => 0.0,
            };
            if self.phase == FlightPhase::TakingOff && self.up >= 3.0 {
                self.phase = FlightPhase::Flying;
            }
            if self.phase == FlightPhase::Manoeuvring && self.own_until.is_none_or(|until| until <= self.now) {
                (self.phase, self.own_until) = (FlightPhase::Flying, None);
            }
            if self.phase == FlightPhase::Landing && self.up <= 0.0 {
                self.phase = FlightPhase::OnGround;
            }
            self.tell(Event::Telemetry(self.telemetry(0)));
            self.frame(100, true, false);
            let is_due = |at: Time| (secs(0.3)..secs(0.36)).contains(&self.now.since(at));
            let due: Vec<QueryId> = self.queries.iter().filter(|(at, _)| is_due(*at)).map(|(_, id)| *id).collect();
            for id in due {
                let text = if self.track { following(0.7, 0.4, 7) } else { navigate(0.7, 0.4, 7) };
                self.tell(Event::Reply { id, text });
            }
            let area = ImageBox { left: 0.6, top: 0.3, right: 0.8, bottom: 0.5 };
            let id = self.queries.iter().rev().nth(1).map_or(QueryId(1), |(_, id)| *id);
            self.report(id, 100, area, 1.0, TrackQuality::Good);
        }
    }
}

proptest! {
    #[test]
    fn whatever_happens_the_pilot_moves_for_a_reason_and_its_run_ends(
        paper: bool,
        legs: bool,
        own: bool,
        track: bool,
        begin in prop_oneof![3 => Just(6000u64), 1 => 0..6000u64],
        happenings in prop::collection::vec(happenings(), 0..60),
    ) {
        let max_time = 90.0;
        let preset = if paper { Preset::Paper } else { Preset::Default };
        let mut chaos = Chaos::new(preset, legs, own, track, max_time);
        chaos.go_well(begin);
        for happens in happenings {
            chaos.happen(happens);
        }
        // No further events: the time since the last key, the flight's time limit (which may just have been extended),
        // and that of a landing that is not reported, end it.
        chaos.pass(60_000 + (1e3 * max_time) as u64 + 91_000);
        prop_assert_eq!(chaos.pilot.phase(), Phase::Ended);
        prop_assert_eq!(chaos.finished, 1 + chaos.reopened);
        prop_assert_eq!(chaos.pilot.next_deadline(), None);
        // Later events change nothing.
        let moved = chaos.moved;
        for i in 0..3 {
            chaos.tell(Event::Reply { id: QueryId(i), text: navigate(0.5, 0.5, 10) });
            chaos.happen(Happens::Operator(OperatorEvent::Resume));
            chaos.pass(1000);
        }
        prop_assert_eq!(chaos.moved, moved);
    }
}

/// A pilot that never moves would pass too, so this one must move when there are no obstacles.
#[test]
fn the_property_is_one_of_a_pilot_that_moves() {
    let default = Preset::Default;
    for (preset, own, track, least) in
        [(default, false, false, 20), (Preset::Paper, false, false, 20), (default, true, false, 2), (default, false, true, 20)]
    {
        let mut chaos = Chaos::new(preset, false, own, track, 90.0);
        chaos.go_well(12_000);
        assert!(chaos.moved > least, "{preset:?} {}", chaos.moved);
        chaos.happen(Happens::Operator(OperatorEvent::Setpoint(Setpoint { forward: 1.0, ..Setpoint::HOLD })));
        let moved = chaos.moved;
        chaos.go_well(300);
        assert!(chaos.moved > moved);
    }
}
