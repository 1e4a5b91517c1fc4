//! `spf tello calibrate`: measures in flight the velocity that full stick deflection gives.
//!
//! The craft turns, climbs, descends and flies forward and back, each at half stick and from rest to rest; telemetry
//! before and after each leg is compared. From rest to rest the distance is the speed times the commanded duration,
//! whatever the dead time and lag. All commands are operator setpoints, so the envelope applies as always.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;

use spf_core::command::Setpoint;
use spf_core::geometry::wrap_angle;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_drone::Drone;
use spf_drone::tello::sticks::Calibration;
use spf_pilot::{Action, Event, OperatorEvent, Pilot};
use spf_vlm::{Answer, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use crate::flight::{FlightError, FlightPlan, Site, fly};
use crate::policy::PolicyKind;
use crate::real::Real;
use crate::run::Observer;
use crate::site::Clock;

/// Fraction of full stick used, to limit the distance flown.
const STICK_FRACTION: f64 = 0.5;
/// Commanded duration of each leg.
const LEG: Duration = Duration::from_millis(2500);
/// Time between two legs: to come to rest, then to measure.
const REST: Duration = Duration::from_millis(3500);
/// Averaging time for the height, which is reported in steps of 10 cm.
const LOOK: Duration = Duration::from_millis(1500);
/// Interval at which a setpoint is repeated.
const AGAIN: Duration = Duration::from_millis(100);

/// The quantity being measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Leg {
    Round,
    Up,
    Down,
    Ahead,
    Back,
}

impl Leg {
    const ALL: [Self; 5] = [Self::Round, Self::Up, Self::Down, Self::Ahead, Self::Back];

    fn setpoint(self, full: &Calibration) -> Setpoint {
        let hold = Setpoint::HOLD;
        match self {
            Self::Round => Setpoint { yaw_rate: STICK_FRACTION * full.yaw_rate, ..hold },
            Self::Up => Setpoint { up: STICK_FRACTION * full.climb, ..hold },
            Self::Down => Setpoint { up: -STICK_FRACTION * full.sink, ..hold },
            Self::Ahead => Setpoint { forward: STICK_FRACTION * full.speed, ..hold },
            Self::Back => Setpoint { forward: -STICK_FRACTION * full.speed, ..hold },
        }
    }
}

/// Why calibration failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// The flight ended before all legs were flown.
    #[error("the flight ended before the calibration was complete: {0}")]
    Ended(String),
    /// The flight could not start.
    #[error("cannot start the flight")]
    Start(#[from] FlightError),
}

/// Stage of the routine.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Not airborne yet.
    Waiting,
    /// At rest until the given time, before the leg with this index.
    Rest(usize, Time),
    /// Flying the leg with this index, since the given time.
    Leg(usize, Time),
    /// All legs are measured.
    Over,
}

/// The calibration routine: an observer of the flight that sends operator inputs and measures their effect.
pub struct Routine {
    /// The driver's calibration of full stick; setpoints are a fraction of it.
    full: Calibration,
    operator: Sender<OperatorEvent>,
    stage: Stage,
    /// Whether the initial hold has been sent.
    held: bool,
    reported: Option<Time>,
    heights: VecDeque<(Time, f64)>,
    heading: Option<f64>,
    turned: f64,
    travelled: f64,
    last_update: Option<Time>,
    /// Yaw, distance and height at the start of the leg, and its commanded duration.
    before: ([f64; 3], f64),
    /// The result of each completed leg at full stick.
    measured: Vec<f64>,
    ended: String,
}

impl Routine {
    /// Creates a routine that sends its inputs to `operator`. `full` is the calibration the driver flies with.
    #[must_use]
    pub fn new(full: Calibration, operator: Sender<OperatorEvent>) -> Self {
        Self {
            full,
            operator,
            stage: Stage::Waiting,
            held: false,
            reported: None,
            heights: VecDeque::new(),
            heading: None,
            turned: 0.0,
            travelled: 0.0,
            last_update: None,
            before: ([0.0; 3], 0.0),
            measured: Vec::new(),
            ended: String::new(),
        }
    }

    /// The measured velocities at full stick.
    ///
    /// # Errors
    /// [`CalibrateError::Ended`] if not all legs were flown.
    pub fn measured(&self) -> Result<Calibration, CalibrateError> {
        let &[round, up, down, ahead, back] = self.measured.as_slice() else {
            return Err(CalibrateError::Ended(self.ended.clone()));
        };
        Ok(Calibration { yaw_rate: round, climb: up, sink: down, speed: 0.5 * (ahead + back) })
    }

    /// Handles telemetry.
    fn telemetry(&mut self, now: Time, telemetry: &Telemetry) {
        // Not on the ground: a pilot on hold there does not take off. In the air the hold keeps it from deciding.
        if telemetry.phase != FlightPhase::OnGround && !self.held {
            self.held = true;
            drop(self.operator.send(OperatorEvent::Hold));
        }
        if telemetry.phase == FlightPhase::Flying && self.stage == Stage::Waiting {
            self.stage = Stage::Rest(0, now + REST);
        }
        let heading = telemetry.attitude.heading;
        if let Some(before) = self.heading.replace(heading) {
            self.turned += wrap_angle(heading - before);
        }
        let since = self.last_update.replace(now).map_or(0.0, |before| now.since(before).as_secs_f64());
        // Only while flying a leg: at hover, the reported velocity is sensor noise.
        if let Some(velocity) = telemetry.velocity {
            self.travelled += libm::hypot(velocity.east, velocity.north) * since;
        }
        self.heights.extend(telemetry.height.map(|height| (now, height)));
        while self.heights.front().is_some_and(|(at, _)| now.since(*at) > LOOK) {
            self.heights.pop_front();
        }
    }

    fn place(&self) -> [f64; 3] {
        let height = self.heights.iter().map(|(_, height)| height).sum::<f64>() / self.heights.len().max(1) as f64;
        [self.turned, self.travelled, height]
    }

    fn go_on(&mut self, now: Time) {
        match self.stage {
            Stage::Waiting | Stage::Over => {}
            Stage::Rest(_, until) if now < until => self.say(now, Setpoint::HOLD),
            Stage::Rest(number, _) => {
                if let Some(flown) = number.checked_sub(1).and_then(|flown| Leg::ALL.get(flown)) {
                    self.measure(*flown);
                }
                if number < Leg::ALL.len() {
                    self.before = (self.place(), 0.0);
                    (self.stage, self.reported) = (Stage::Leg(number, now), None);
                    self.go_on(now);
                } else {
                    self.stage = Stage::Over;
                    drop(self.operator.send(OperatorEvent::Land));
                }
            }
            Stage::Leg(number, since) => {
                let elapsed = now.since(since);
                if elapsed < LEG {
                    self.say(now, Leg::ALL[number].setpoint(&self.full));
                } else {
                    self.before.1 = elapsed.as_secs_f64();
                    (self.stage, self.reported) = (Stage::Rest(number + 1, now + REST), None);
                    self.say(now, Setpoint::HOLD);
                }
            }
        }
    }

    fn say(&mut self, now: Time, setpoint: Setpoint) {
        if self.reported.is_none_or(|reported| now.since(reported) >= AGAIN) {
            self.reported = Some(now);
            drop(self.operator.send(OperatorEvent::Setpoint(setpoint)));
        }
    }

    fn measure(&mut self, leg: Leg) {
        let (before, elapsed) = self.before;
        let [turned, travelled, climbed] =
            core::array::from_fn(|i| (self.place()[i] - before[i]).abs() / (elapsed * STICK_FRACTION));
        self.measured.push(match leg {
            Leg::Round => turned,
            Leg::Up | Leg::Down => climbed,
            Leg::Ahead | Leg::Back => travelled,
        });
    }
}

impl Observer for Routine {
    fn event(&mut self, now: Time, event: &Event) {
        if let Event::Telemetry(telemetry) = event {
            self.telemetry(now, telemetry);
        }
    }

    fn action(&mut self, _now: Time, action: &Action, _pilot: &Pilot) {
        if let Action::Finished(ending) = action {
            self.ended.clone_from(&ending.cause);
        }
    }

    fn time(&mut self, now: Time, _pilot: &Pilot) {
        self.go_on(now);
    }
}

/// A VLM for a flight that sends no queries.
struct NoVlm;

impl Vlm for NoVlm {
    fn name(&self) -> &str {
        "none"
    }

    fn answer(&mut self, _request: &QueryRequest<'_>, _image: &mut dyn QueryImage) -> Answer {
        let refused = VlmError::Refused { model: "none".to_owned(), reason: "a calibration flight has no VLM".to_owned() };
        Answer { text: Err(refused), latency: Duration::ZERO, model: String::new(), account: Usage::default() }
    }
}

/// The plan of a calibration flight: only the inputs of `operator` are flown, and no VLM is queried.
#[must_use]
pub fn plan(drone: Box<dyn Drone>, clock: Clock, operator: Receiver<OperatorEvent>, interrupts: Arc<AtomicU32>) -> FlightPlan {
    let (site, no_vlm) = (Site::Real(Real { drone, clock }), Arc::new(|_: Option<&_>, _| Ok(Box::new(NoVlm) as Box<dyn Vlm>)));
    let plan = FlightPlan::new(site, "measure", "none", no_vlm);
    FlightPlan { policy: Arc::new(PolicyKind::plain()), operator: Some(operator), interrupts, ..plan }
}

/// Flies the routine, which takes about 45 s and needs 3 m free ahead and 2 m above the take-off point. `full` is the
/// calibration the drone was connected with, at time `start`.
///
/// # Errors
/// [`CalibrateError`] if the flight cannot start or ends early.
pub fn calibrate(
    drone: Box<dyn Drone>,
    full: Calibration,
    start: Instant,
    interrupts: Arc<AtomicU32>,
) -> Result<Calibration, CalibrateError> {
    let (sender, operator) = channel();
    let mut routine = Routine::new(full, sender);
    fly(plan(drone, Clock::WallSince(start), operator, interrupts), &mut [&mut routine])?;
    routine.measured()
}
