//! Commands with a duration: started, continued, and answered at their end.

use std::collections::VecDeque;
use std::net::SocketAddr;

use spf_core::command::{Command, Setpoint};
use spf_core::rng::RandomStream;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_sim::craft::SimCraft;

use crate::fault::{CraftFault, FaultMachine};
use crate::tello::command::{Direction, Offset, Request};
use crate::tello::figures::ProtocolParameters;
use crate::tello::manoeuvre::{Manoeuvre, Step, arc, place};

/// Validity of a manoeuvre's correction unless replaced by the next.
const HOLDS: Duration = Duration::from_millis(200);
/// A take-off fails if the motors do not start within this time.
const NO_LIFT: Duration = Duration::from_secs(1);

#[derive(Clone, Debug)]
enum Task {
    TakeOff,
    Land,
    Fly(Box<Manoeuvre>),
}

/// A command in progress, and the client waiting for it.
#[derive(Clone, Debug)]
struct Running {
    to: SocketAddr,
    task: Task,
    began: Time,
}

/// The response to a command that has ended.
pub(super) struct Ended {
    pub(super) at: Time,
    pub(super) to: SocketAddr,
    pub(super) text: &'static str,
}

/// What decides about a motion command, beside the craft.
pub(super) struct Conditions<'a> {
    pub(super) figures: &'a ProtocolParameters,
    pub(super) faults: &'a FaultMachine,
    /// The speed of moves, cm/s.
    pub(super) speed: i32,
    pub(super) rng: &'a mut RandomStream,
}

/// The command in progress, of which there is one at a time.
#[derive(Clone, Debug)]
pub(super) struct Tasks {
    running: Option<Running>,
    /// No other command starts before this: the last manoeuvre is still settling.
    busy_until: Time,
}

fn offset_of(direction: Direction, cm: i32) -> Offset {
    let rest = Offset::default();
    match direction {
        Direction::Up => Offset { z: cm, ..rest },
        Direction::Down => Offset { z: -cm, ..rest },
        Direction::Left => Offset { y: cm, ..rest },
        Direction::Right => Offset { y: -cm, ..rest },
        Direction::Forward => Offset { x: cm, ..rest },
        Direction::Back => Offset { x: -cm, ..rest },
    }
}

impl Tasks {
    pub(super) fn new(now: Time) -> Self {
        Self { running: None, busy_until: now }
    }

    pub(super) fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// Forgets the command in progress. Returns who waits for its response.
    pub(super) fn drop_running(&mut self) -> Option<SocketAddr> {
        self.running.take().map(|running| running.to)
    }

    /// The same; returns who waited, unless it was a take-off.
    pub(super) fn stop(&mut self) -> Option<SocketAddr> {
        let running = self.running.take()?;
        (!matches!(running.task, Task::TakeOff)).then_some(running.to)
    }

    /// Handles a motion command: it starts, or is refused with this response.
    pub(super) fn begin(
        &mut self,
        now: Time,
        from: SocketAddr,
        request: Request,
        craft: &mut SimCraft,
        given: &mut Conditions<'_>,
    ) -> Result<(), &'static str> {
        let task = self.task(now, request, craft, given)?;
        match task {
            Task::TakeOff => craft.apply(now, Command::TakeOff, Time::MAX),
            Task::Land => craft.apply(now, Command::Land, Time::MAX),
            Task::Fly(_) => {}
        }
        self.running = Some(Running { to: from, task, began: now });
        Ok(())
    }

    fn task(&self, now: Time, request: Request, craft: &SimCraft, given: &mut Conditions<'_>) -> Result<Task, &'static str> {
        let phase = craft.dynamics().phase();
        if request == Request::TakeOff {
            return self.take_off(now, craft, given);
        }
        match phase {
            FlightPhase::OnGround | FlightPhase::Stopped => return Err("error Motor stop"),
            FlightPhase::Landing => return Err("error Auto land"),
            FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Manoeuvring => {}
        }
        if self.running.is_some() || now < self.busy_until {
            return Err("error Not joystick");
        }
        if request == Request::Land {
            return Ok(Task::Land);
        }
        if [CraftFault::ImuInvalid, CraftFault::ImuLost].iter().any(|&fault| given.faults.has_fault(now, fault)) {
            return Err("error No valid imu");
        }
        let figures = given.figures;
        let metres_a_second = |cm: i32| f64::from(cm) * 0.01;
        match request {
            Request::Move(direction, cm) => {
                let speed = metres_a_second(given.speed);
                Ok(given.through(now, craft, &[offset_of(direction, cm)], speed, cm))
            }
            Request::Turn(degrees) => {
                let error = figures.turn_spread * given.rng.normal();
                let angle = f64::from(degrees).to_radians() + error;
                Ok(Task::Fly(Box::new(Manoeuvre::turn(now, craft, angle, figures.turn_rate, figures.run_timeout))))
            }
            Request::Flip(side) => {
                if craft.dynamics().battery() <= figures.flip_battery {
                    return Err("error");
                }
                let cm = libm::round(100.0 * figures.flip_distance) as i32;
                Ok(given.through(now, craft, &[offset_of(side, cm)], figures.stick_speed, cm))
            }
            Request::Go { to, speed } => Ok(given.through(now, craft, &[to], metres_a_second(speed), length(to))),
            Request::Curve { via, to, speed } => {
                let points = arc(via, to).ok_or("error")?;
                Ok(given.through(now, craft, &points, metres_a_second(speed), length(to)))
            }
            // Scenes have no mission pads.
            _ => Err("error No valid marker"),
        }
    }

    fn take_off(&self, now: Time, craft: &SimCraft, given: &Conditions<'_>) -> Result<Task, &'static str> {
        let faults = given.faults;
        let refused = faults.has_fault(now, CraftFault::TakeOffRefused) || faults.has_fault(now, CraftFault::BatteryEmpty);
        let charged = craft.dynamics().battery() >= given.figures.take_off_battery;
        match craft.dynamics().phase() {
            FlightPhase::OnGround if self.running.is_none() && charged && !refused => Ok(Task::TakeOff),
            FlightPhase::TakingOff => Err("error Not joystick"),
            FlightPhase::Landing => Err("error Auto land"),
            _ => Err("error"),
        }
    }

    /// Continues the command in progress; returns the response when it ends.
    pub(super) fn go_on(&mut self, now: Time, craft: &mut SimCraft, figures: &ProtocolParameters) -> Option<Ended> {
        let mut running = self.running.take()?;
        let phase = craft.dynamics().phase();
        let settled = now + duration_from_secs(figures.settle);
        let ended = match &mut running.task {
            _ if phase == FlightPhase::Stopped => Some((now, "error Motor stop")),
            Task::TakeOff if phase == FlightPhase::OnGround && now.since(running.began) > NO_LIFT => Some((now, "error")),
            Task::TakeOff => (phase == FlightPhase::Flying).then_some((now, "ok")),
            Task::Land => (phase == FlightPhase::OnGround).then_some((now, "ok")),
            Task::Fly(_) if phase != FlightPhase::Flying => Some((now, "error Auto land")),
            Task::Fly(manoeuvre) => match manoeuvre.step(now, craft) {
                Step::Fly(setpoint) => {
                    craft.apply(now, Command::Setpoint(setpoint), now + HOLDS);
                    None
                }
                Step::Done => Some((settled, "ok")),
                Step::GivenUp => Some((settled, "error Run timeout")),
            },
        };
        let Some((at, text)) = ended else {
            self.running = Some(running);
            return None;
        };
        if matches!(running.task, Task::Fly(_)) && phase == FlightPhase::Flying {
            craft.apply(now, Command::Setpoint(Setpoint::HOLD), Time::MAX);
        }
        self.busy_until = at;
        Some(Ended { at, to: running.to, text })
    }
}

impl Conditions<'_> {
    /// A path through offsets, with a random length error. `cm` is its length.
    fn through(&mut self, now: Time, craft: &SimCraft, offsets: &[Offset], speed: f64, cm: i32) -> Task {
        let length = f64::from(cm.max(1)) * 0.01;
        let error = self.figures.move_share * self.rng.normal() + self.figures.move_fixed * self.rng.normal() / length;
        let fraction = (1.0 + error).clamp(0.3, 2.0);
        let points: VecDeque<_> = offsets.iter().map(|offset| place(craft, *offset, fraction)).collect();
        Task::Fly(Box::new(Manoeuvre::through(now, craft, points, speed, self.figures.run_timeout)))
    }
}

/// Length of an offset, centimetres.
fn length(offset: Offset) -> i32 {
    let square = |cm: i32| f64::from(cm) * f64::from(cm);
    libm::round(libm::sqrt(square(offset.x) + square(offset.y) + square(offset.z))) as i32
}
