//! Watches a flight: whether every motion has a fresh reason.

use spf_core::command::{Command, Setpoint};
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_envelope::Limits;
use spf_flight::run::Observer;
use spf_flight::sim::SimWorld;
use spf_pilot::{Action, Event, Note, OperatorEvent, Outcome, Phase, Pilot};

use super::faults::{DepthFailing, FlightPart};

/// Zero is commanded within this time of the end of a reason to move.
const STOP_RULE: Duration = Duration::from_millis(200);
/// Time for which an operator's setpoint moves the craft.
const BY_HAND: Duration = Duration::from_millis(400);

/// The brake knows a silent or late sensor within this time, and any other that it can know within a few grids.
const NOTICED: Duration = Duration::from_millis(700);
/// Speed without a depth sensor, m/s.
const BLIND: f64 = 0.5;
/// Up to this height, metres, the sensor should see the ground in every part of its image, at any attitude of a slow craft.
const GROUND_IN_RANGE: f64 = 4.0;

/// The record of a flight.
pub(crate) struct Watch {
    limits: Limits,
    /// Capture of the newest usable frame with a new capture counter.
    captured: Option<Time>,
    counter: Option<u64>,
    /// Measurement time of the newest telemetry.
    measured: Option<Time>,
    /// Since when no decision moves the craft; `None` while one does.
    without_reason: Option<Time>,
    by_hand: Option<Time>,
    /// From when on the depth sensor fails, and how.
    depth: Option<(Time, DepthFailing)>,
    world: Option<SimWorld>,
    /// Least distance of the craft's middle from anything solid of this world while it flies, m.
    pub(crate) nearest: f64,
    asked: Option<Time>,
    first_motion: Option<Time>,
    first_manual: Option<Time>,
    phases: Vec<(Time, Phase)>,
    pub(crate) last_motion: Option<Time>,
    pub(crate) last_command: String,
    pub(crate) outcome: Option<(Outcome, String)>,
    pub(crate) violations: Vec<String>,
}

impl Watch {
    pub(crate) fn new(limits: Limits, depth: Option<(Time, DepthFailing)>, world: Option<SimWorld>) -> Self {
        Self {
            limits,
            captured: None,
            counter: None,
            measured: None,
            without_reason: Some(Time::ZERO),
            by_hand: None,
            depth,
            world,
            nearest: f64::INFINITY,
            asked: None,
            first_motion: None,
            first_manual: None,
            phases: Vec::new(),
            last_motion: None,
            last_command: "none".to_owned(),
            outcome: None,
            violations: Vec::new(),
        }
    }

    /// When the pilot first entered a phase.
    pub(crate) fn entered(&self, phase: Phase) -> Option<Time> {
        self.phases.iter().find(|(_, entered)| *entered == phase).map(|(at, _)| *at)
    }

    /// Time at which a phase of the flight was well in progress.
    pub(crate) fn begin_of(&self, part: FlightPart) -> Option<Time> {
        let entered = |phase| self.entered(phase);
        let (at, after) = match part {
            FlightPart::TakeOff => (entered(Phase::TakeOff), 1000),
            FlightPart::Deciding => (self.asked, 300),
            FlightPart::Executing | FlightPart::Searching => (self.first_motion, 500),
            FlightPart::Manual => (self.first_manual, 1500),
            FlightPart::Landing => (entered(Phase::Landing), 300),
        };
        at.map(|at| at + Duration::from_millis(after))
    }

    /// Checks that the craft flies slowly where its depth sensor has failed.
    fn braked(&mut self, now: Time, setpoint: Setpoint, height: f64) {
        let Some((_, fault)) = self.depth.filter(|(from, _)| now.since(*from) > NOTICED) else { return };
        let is_blind = match fault {
            DepthFailing::Silent | DepthFailing::Frozen | DepthFailing::Late => true,
            // Its own half, and straight ahead, where the body's corridor reaches into it.
            DepthFailing::HalfBlack => setpoint.right <= 0.0 && setpoint.yaw_rate <= 0.0 && height < GROUND_IN_RANGE,
            DepthFailing::Scale => false,
        };
        if is_blind && setpoint.speed() > BLIND + 1e-6 && self.violations.len() < 3 {
            self.violations.push(format!("at {now} it flies {:.2} m/s without depth", setpoint.speed()));
        }
    }

    fn moved(&mut self, now: Time, phase: Phase) {
        self.last_motion = Some(now);
        self.first_motion.get_or_insert(now);
        let mut wrong = |why: &str, since: Duration| {
            if self.violations.len() < 3 {
                self.violations.push(format!("at {now} it moves {why}, {:.2} s", since.as_secs_f64()));
            }
        };
        let old = duration_from_secs(self.limits.max_telemetry_age) + STOP_RULE;
        let age = now.since(self.measured.unwrap_or(Time::ZERO));
        if age > old {
            wrong("without telemetry", age);
        }
        match phase {
            Phase::Manual => {
                let released = now.since(self.by_hand.unwrap_or(Time::ZERO));
                if released > BY_HAND + STOP_RULE {
                    wrong("by a released key", released);
                }
            }
            Phase::Flying => {
                let age = now.since(self.captured.unwrap_or(Time::ZERO));
                if age > duration_from_secs(self.limits.max_frame_age) + STOP_RULE {
                    wrong("on an old frame", age);
                }
                let without = self.without_reason.map_or(Duration::ZERO, |since| now.since(since));
                if without > STOP_RULE {
                    wrong("without a decision", without);
                }
            }
            phase => wrong(&format!("in {phase:?}"), Duration::ZERO),
        }
    }
}

impl Observer for Watch {
    fn time(&mut self, _: Time, pilot: &Pilot) {
        let Some(world) = self.world.as_ref().filter(|_| pilot.phase() == Phase::Flying) else { return };
        let near = world.loaded().collider.nearest(world.truth().pose.position);
        self.nearest = near.map_or(self.nearest, |near| near.distance.min(self.nearest));
    }

    fn event(&mut self, now: Time, event: &Event) {
        match event {
            Event::Frame(frame) if frame.unusable.is_none() && self.counter != Some(frame.capture_counter) => {
                self.counter = Some(frame.capture_counter);
                self.captured = self.captured.max(Some(frame.captured));
            }
            Event::Telemetry(telemetry) => self.measured = self.measured.max(Some(telemetry.time)),
            Event::Operator(OperatorEvent::Setpoint(_)) => self.by_hand = Some(now),
            Event::Operator(_) | Event::LinkLost => self.without_reason = self.without_reason.or(Some(now)),
            _ => {}
        }
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        match action {
            Action::Ask(_) => _ = self.asked.get_or_insert(now),
            Action::Command(cleared) => match *cleared.get() {
                Command::Setpoint(setpoint) => {
                    self.last_command = if setpoint.is_hold() { "hold" } else { "motion" }.to_owned();
                    if !setpoint.is_hold() {
                        if pilot.phase() == Phase::Manual {
                            self.first_manual.get_or_insert(now);
                        }
                        self.moved(now, pilot.phase());
                        self.braked(now, setpoint, pilot.known_pose(now).position.up);
                    }
                }
                Command::Manoeuvre(_) => self.moved(now, pilot.phase()),
                Command::TakeOff => "take-off".clone_into(&mut self.last_command),
                Command::Tilt(_) => {}
                Command::Return => "return".clone_into(&mut self.last_command),
                Command::Land => "land".clone_into(&mut self.last_command),
                Command::EmergencyStop => "cut motors".clone_into(&mut self.last_command),
            },
            Action::Note(Note::Phase(phase)) => self.phases.push((now, *phase)),
            Action::Note(Note::Decision(decision)) => match decision.step.as_str() {
                "move" | "goto" | "keep" => self.without_reason = None,
                _ => self.without_reason = self.without_reason.or(Some(now)),
            },
            Action::Note(Note::QueryFailed { .. }) => self.without_reason = self.without_reason.or(Some(now)),
            Action::Finished(ending) => self.outcome = Some((ending.outcome, ending.cause.clone())),
            _ => {}
        }
    }
}
