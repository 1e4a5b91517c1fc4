//! A flight on a virtual clock: pilot, craft, camera and VLM, in steps of 10 ms.
//!
//! The craft has dead time, lag and acceleration limits, and reports exact telemetry at 20 Hz. Frames are captured
//! every 50 ms and arrive 150 ms later. The VLM is a closure that receives the true pose of the frame.

use std::collections::VecDeque;

use spf_core::camera::Camera;
use spf_core::command::{Command, Setpoint};
use spf_core::craft::Craft;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose, wrap_angle};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::query::{ImagePoint, Query, QueryId};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_envelope::Limits;
use spf_motion::estimator::TelemetryAccuracy;
use spf_pilot::policy::Policy;
use spf_pilot::{Action, Decision, Ending, Event, Note, OperatorEvent, Outcome, Phase, Pilot, PilotParts};
use spf_pilot::{PilotSettings, Preset};

/// The clock's step.
const STEP: Duration = Duration::from_millis(10);
/// Interval of frames and telemetry, steps.
const PERIOD: u64 = 5;
/// From a frame's capture to its arrival.
const CAMERA_LATENCY: Duration = Duration::from_millis(150);
/// Maximum number of actions at one instant; more mean that the pilot never becomes idle.
const ACTIONS_AT_ONCE: usize = 64;
/// Maximum number of steps: more than a whole flight has, landing included.
const STEPS: u64 = 60_000;

/// The crane stands 20 m ahead and 8 m to the right of the start, 6 m up.
pub(crate) const CRANE: EnuPosition = EnuPosition { east: 8.0, north: 20.0, up: 6.0 };

/// Image point of the crane from a pose, if it is visible.
pub(crate) fn sighted(pose: &Pose) -> Option<ImagePoint> {
    let away = pose.position.displacement_to(CRANE, pose.attitude.heading);
    let point = project_displacement(away, &Camera::quad(), pose.attitude, Lifting::Levelled)?;
    ((0.0..=1.0).contains(&point.u) && (0.0..=1.0).contains(&point.v)).then_some(point)
}

/// Ground truth of a frame, which the pilot does not know.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub(crate) pose: Pose,
    pub(crate) speed: f64,
}

/// An answer, and its latency in seconds.
pub(crate) type Answer = (f64, String);

/// The true motion of the craft.
struct Body {
    craft: Craft,
    position: EnuPosition,
    velocity: EnuVelocity,
    /// Not wrapped.
    heading: f64,
    yaw_rate: f64,
    phase: FlightPhase,
    /// Messages in transit, with their times of arrival.
    coming: VecDeque<(Time, Setpoint)>,
    flown: Setpoint,
}

impl Body {
    fn send(&mut self, now: Time, setpoint: Setpoint) {
        self.coming.push_back((now + duration_from_secs(self.craft.dead_time), setpoint));
    }

    fn command(&mut self, now: Time, command: Command) {
        match command {
            Command::TakeOff if self.phase == FlightPhase::OnGround => {
                self.phase = FlightPhase::TakingOff;
                self.send(now, Setpoint { up: self.craft.climb_speed, ..Setpoint::HOLD });
            }
            Command::Setpoint(setpoint) if self.phase == FlightPhase::Flying => self.send(now, setpoint),
            Command::Land if self.phase != FlightPhase::OnGround => {
                self.phase = FlightPhase::Landing;
                self.send(now, Setpoint { up: -0.8, ..Setpoint::HOLD });
            }
            _ => {}
        }
    }

    fn fly(&mut self, now: Time) {
        while let Some((_, setpoint)) = self.coming.pop_front_if(|(at, _)| *at <= now) {
            self.flown = setpoint;
        }
        let (craft, setpoint, step) = (&self.craft, self.flown, STEP.as_secs_f64());
        let towards = |is: f64, wanted: f64, most: f64| is + ((wanted - is) / craft.lag).clamp(-most, most) * step;
        self.yaw_rate = towards(self.yaw_rate, setpoint.yaw_rate, craft.yaw_acceleration);
        self.heading += self.yaw_rate * step;
        let (sin, cos) = (libm::sin(self.heading), libm::cos(self.heading));
        let wanted = (setpoint.right * cos + setpoint.forward * sin, setpoint.forward * cos - setpoint.right * sin);
        self.velocity.east = towards(self.velocity.east, wanted.0, craft.acceleration);
        self.velocity.north = towards(self.velocity.north, wanted.1, craft.acceleration);
        self.velocity.up = towards(self.velocity.up, setpoint.up, craft.climb_acceleration);
        self.position.east += self.velocity.east * step;
        self.position.north += self.velocity.north * step;
        self.position.up += self.velocity.up * step;
        match self.phase {
            FlightPhase::TakingOff if self.position.up > self.craft.take_off_height - 0.3 => {
                self.phase = FlightPhase::Flying;
                self.send(now, Setpoint::HOLD);
            }
            FlightPhase::Landing if self.position.up <= 0.05 => {
                self.phase = FlightPhase::OnGround;
                self.velocity = EnuVelocity::default();
                self.send(now, Setpoint::HOLD);
            }
            _ => {}
        }
    }

    fn seen(&self) -> Seen {
        let attitude = Attitude { heading: wrap_angle(self.heading), ..Attitude::default() };
        Seen { pose: Pose { position: self.position, attitude }, speed: self.velocity.speed() }
    }
}

/// Answers a query about a frame.
type Answerer = dyn FnMut(&Query, &Seen) -> Answer;

/// The flight and its record.
pub(crate) struct Flight {
    pub(crate) pilot: Pilot,
    body: Body,
    pub(crate) now: Time,
    steps: u64,
    vlm: Box<Answerer>,
    coming: Vec<(Time, Event)>,
    /// Truth of each capture, by frame number.
    pub(crate) frames: Vec<Seen>,
    pub(crate) query: Vec<Query>,
    setpoints: Vec<(Time, Setpoint)>,
    notes: Vec<Note>,
    finished: Option<(Ending, EnuPosition)>,
}

impl Flight {
    /// On the ground at the origin, facing `heading`.
    pub(crate) fn new(
        preset: Preset,
        heading: f64,
        policy: impl Policy + 'static,
        vlm: impl FnMut(&Query, &Seen) -> Answer + 'static,
    ) -> Self {
        let craft = Craft::quad();
        let pilot = Pilot::new(PilotParts {
            settings: PilotSettings::preset(preset),
            craft,
            senses: TelemetryAccuracy::EXACT,
            camera: Camera::quad(),
            limits: Limits::for_craft(&craft),
            policy: Box::new(policy),
            steering: None,
            instruction: "fly to the red crane".to_owned(),
        });
        Self {
            pilot,
            body: Body {
                craft,
                position: EnuPosition::default(),
                velocity: EnuVelocity::default(),
                heading,
                yaw_rate: 0.0,
                phase: FlightPhase::OnGround,
                coming: VecDeque::new(),
                flown: Setpoint::HOLD,
            },
            now: Time::ZERO,
            steps: 0,
            vlm: Box::new(vlm),
            coming: Vec::new(),
            frames: Vec::new(),
            query: Vec::new(),
            setpoints: Vec::new(),
            notes: Vec::new(),
            finished: None,
        }
    }

    fn capture(&mut self) {
        let number = self.frames.len() as u64;
        self.frames.push(self.body.seen());
        let frame = FrameMeta {
            id: FrameId(number),
            captured: self.now,
            received: self.now + CAMERA_LATENCY,
            capture_counter: number + 1,
            width: 960,
            height: 720,
            unusable: None,
        };
        self.coming.push((frame.received, Event::Frame(frame)));
    }

    fn telemetry(&self) -> Telemetry {
        Telemetry {
            time: self.now,
            position: Some(self.body.position),
            velocity: Some(self.body.velocity),
            attitude: self.body.seen().pose.attitude,
            yaw_rate: Some(self.body.yaw_rate),
            height: Some(self.body.position.up),
            battery: Some(0.9),
            ground_clearance: None,
            temperature: None,
            phase: self.body.phase,
            crashed: false,
            position_sd: None,
            imu_error: false,
            returns_to: None,
        }
    }

    fn step(&mut self) {
        if self.steps.is_multiple_of(PERIOD) {
            self.capture();
            self.pilot.handle(self.now, Event::Telemetry(self.telemetry()));
        }
        for (_, event) in self.coming.extract_if(.., |(at, _)| *at <= self.now) {
            self.pilot.handle(self.now, event);
        }
        self.pump();
        self.steps += 1;
        self.now += STEP;
        self.body.fly(self.now);
    }

    /// Polls the pilot until it returns `None`.
    fn pump(&mut self) {
        for _ in 0..ACTIONS_AT_ONCE {
            match self.pilot.poll(self.now) {
                None => return,
                Some(Action::Ask(query)) => {
                    let (latency, text) = (self.vlm)(&query, &self.frames[usize::try_from(query.frame.0).unwrap()]);
                    let event = Event::Reply { id: query.id, text };
                    self.coming.push((self.now + duration_from_secs(latency), event));
                    self.query.push(*query);
                }
                Some(Action::Cancel(id)) => self.forget(id),
                Some(Action::Command(cleared)) => {
                    let command = *cleared.get();
                    if let Command::Setpoint(setpoint) = command {
                        self.setpoints.push((self.now, setpoint));
                    }
                    self.body.command(self.now, command);
                }
                Some(Action::Track(_) | Action::Untrack) => {}
                Some(Action::Note(note)) => self.notes.push(note),
                Some(Action::Finished(ending)) => self.finished = Some((ending, self.body.position)),
            }
        }
        panic!("at {} the pilot never becomes idle", self.now);
    }

    fn forget(&mut self, cancelled: QueryId) {
        self.coming.retain(|(_, event)| !matches!(event, Event::Reply { id, .. } if *id == cancelled));
    }

    pub(crate) fn operator(&mut self, event: OperatorEvent) {
        self.pilot.handle(self.now, Event::Operator(event));
        self.pump();
    }

    pub(crate) fn pass(&mut self, seconds: f64) {
        let until = self.now + duration_from_secs(seconds);
        while self.now < until {
            self.step();
        }
    }

    fn until(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        while !done(self) {
            assert!(self.steps < STEPS, "never: {what}; {:?}, notes {:?}", self.pilot.phase(), self.notes.last());
            self.step();
        }
    }

    /// Advances until the craft is commanded to move, and does.
    pub(crate) fn until_moving(&mut self) {
        self.until("a setpoint that moves", |flight| {
            let moves = flight.setpoints.last().is_some_and(|(_, setpoint)| !setpoint.is_hold());
            moves && flight.body.velocity.speed() > 0.5
        });
    }

    /// Flies to the end; returns the outcome and the final position.
    pub(crate) fn end(&mut self) -> (Outcome, EnuPosition) {
        self.until("the end", |flight| flight.pilot.phase() == Phase::Ended);
        let (ending, at) = self.finished.as_ref().unwrap();
        (ending.outcome, *at)
    }

    /// Setpoints commanded from `from` on.
    pub(crate) fn setpoints_since(&self, from: Time) -> impl Iterator<Item = Setpoint> + '_ {
        self.setpoints.iter().filter(move |(at, _)| *at >= from).map(|(_, setpoint)| *setpoint)
    }

    pub(crate) fn decisions(&self) -> impl Iterator<Item = &Decision> {
        self.notes.iter().filter_map(|note| match note {
            Note::Decision(decision) => Some(&**decision),
            _ => None,
        })
    }
}
