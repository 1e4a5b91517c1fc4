//! `spf tello calibrate`: what full stick does, measured by flying it.
//!
//! The craft turns, climbs, sinks, flies ahead and back, each at half stick and from rest to rest, and what it tells of itself before
//! and after is compared. From rest to rest a craft goes as far as its speed times the time that it was told to, whatever its dead
//! time and lag. All goes through the operator's setpoints, so the envelope has the last word as always.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;

use spf_core::command::Setpoint;
use spf_core::geometry::wrap_angle;
use spf_core::pilot::{Action, Event, OperatorEvent, Pilot};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_drone::Drone;
use spf_drone::tello::sticks::Calibration;
use spf_vlm::{Account, Answer, Asked, Picture, Vlm, VlmError};

use crate::flight::{FlightError, FlightPlan, Site, fly};
use crate::policy::PolicyKind;
use crate::real::Real;
use crate::run::Observer;
use crate::site::Clock;

/// Fraction of full stick: the drone must not fly far.
const SHARE: f64 = 0.5;
/// How long each leg is told.
const LEG: Duration = Duration::from_millis(2500);
/// Between two legs: until it stands, and then for as long as is looked.
const REST: Duration = Duration::from_millis(3500);
/// Height is averaged over this: it is told in steps of 10 cm.
const LOOK: Duration = Duration::from_millis(1500);
/// A setpoint is said again this often.
const AGAIN: Duration = Duration::from_millis(100);

/// What is measured.
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
            Self::Round => Setpoint { yaw_rate: SHARE * full.yaw_rate, ..hold },
            Self::Up => Setpoint { up: SHARE * full.climb, ..hold },
            Self::Down => Setpoint { up: -SHARE * full.sink, ..hold },
            Self::Ahead => Setpoint { forward: SHARE * full.speed, ..hold },
            Self::Back => Setpoint { forward: -SHARE * full.speed, ..hold },
        }
    }
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// The flight ended before.
    #[error("the flight ended before everything was measured: {0}")]
    Ended(String),
    /// There was none.
    #[error("the flight cannot be started")]
    Start(#[from] FlightError),
}

/// Where the routine is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Not in the air yet.
    Waiting,
    /// Standing still until then, before the leg of that number.
    Rest(usize, Time),
    /// Flying the leg of that number, since then.
    Leg(usize, Time),
    /// Everything is measured.
    Over,
}

/// Told what happens on a flight, it does what an operator would do, and measures.
pub struct Routine {
    /// What the driver takes full stick for: a setpoint is a fraction of it.
    full: Calibration,
    operator: Sender<OperatorEvent>,
    stage: Stage,
    /// It was told to hold as soon as it flies.
    held: bool,
    said: Option<Time>,
    heights: VecDeque<(Time, f64)>,
    heading: Option<f64>,
    turned: f64,
    travelled: f64,
    heard: Option<Time>,
    /// Turned, travelled, height when the leg began, and how long it was told.
    before: ([f64; 3], f64),
    /// Of each leg that is over, what full stick does.
    measured: Vec<f64>,
    ended: String,
}

impl Routine {
    /// A routine whose events go to `operator`. `full` is the calibration that the driver flies with.
    #[must_use]
    pub fn new(full: Calibration, operator: Sender<OperatorEvent>) -> Self {
        Self {
            full,
            operator,
            stage: Stage::Waiting,
            held: false,
            said: None,
            heights: VecDeque::new(),
            heading: None,
            turned: 0.0,
            travelled: 0.0,
            heard: None,
            before: ([0.0; 3], 0.0),
            measured: Vec::new(),
            ended: String::new(),
        }
    }

    /// What full stick does.
    ///
    /// # Errors
    /// [`CalibrateError::Ended`] when not all of it was flown.
    pub fn measured(&self) -> Result<Calibration, CalibrateError> {
        let &[round, up, down, ahead, back] = self.measured.as_slice() else {
            return Err(CalibrateError::Ended(self.ended.clone()));
        };
        Ok(Calibration { yaw_rate: round, climb: up, sink: down, speed: 0.5 * (ahead + back) })
    }

    /// Told by the craft.
    fn telemetry(&mut self, now: Time, telemetry: &Telemetry) {
        // Not before: what is held on the ground does not take off. So nothing is decided.
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
        let since = self.heard.replace(now).map_or(0.0, |before| now.since(before).as_secs_f64());
        // Only on the way: what a craft that hovers tells is the noise of its sensor.
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
                    (self.stage, self.said) = (Stage::Leg(number, now), None);
                    self.go_on(now);
                } else {
                    self.stage = Stage::Over;
                    drop(self.operator.send(OperatorEvent::Land));
                }
            }
            Stage::Leg(number, since) => {
                let told = now.since(since);
                if told < LEG {
                    self.say(now, Leg::ALL[number].setpoint(&self.full));
                } else {
                    self.before.1 = told.as_secs_f64();
                    (self.stage, self.said) = (Stage::Rest(number + 1, now + REST), None);
                    self.say(now, Setpoint::HOLD);
                }
            }
        }
    }

    fn say(&mut self, now: Time, setpoint: Setpoint) {
        if self.said.is_none_or(|said| now.since(said) >= AGAIN) {
            self.said = Some(now);
            drop(self.operator.send(OperatorEvent::Setpoint(setpoint)));
        }
    }

    fn measure(&mut self, leg: Leg) {
        let (before, told) = self.before;
        let [turned, travelled, climbed] = core::array::from_fn(|i| (self.place()[i] - before[i]).abs() / (told * SHARE));
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

/// Nobody is asked anything.
struct Nobody;

impl Vlm for Nobody {
    fn name(&self) -> &str {
        "nobody"
    }

    fn answer(&mut self, _asked: &Asked<'_>, _picture: &mut dyn Picture) -> Answer {
        let refused = VlmError::Refused { model: "nobody".to_owned(), reason: "the drone is being measured".to_owned() };
        Answer { text: Err(refused), latency: Duration::ZERO, model: String::new(), account: Account::default() }
    }
}

/// Such a flight: what the `operator` says is flown, and nobody else is asked.
#[must_use]
pub fn plan(drone: Box<dyn Drone>, clock: Clock, operator: Receiver<OperatorEvent>, interrupts: Arc<AtomicU32>) -> FlightPlan {
    let (site, nobody) = (Site::Real(Real { drone, clock }), Arc::new(|_: Option<&_>, _| Ok(Box::new(Nobody) as Box<dyn Vlm>)));
    let plan = FlightPlan::new(site, "measure", "nobody", nobody);
    FlightPlan { policy: Arc::new(PolicyKind::plain()), operator: Some(operator), interrupts, ..plan }
}

/// Flies the routine, some 45 s, with 3 m free ahead and 2 m above the take-off point. `full` is what the drone was connected with,
/// at `start`.
///
/// # Errors
/// [`CalibrateError`].
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
