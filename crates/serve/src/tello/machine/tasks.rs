//! Commands with a duration: started, continued, and answered at their end.

use std::collections::VecDeque;
use std::net::SocketAddr;

use spf_core::command::{Command, Setpoint};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_sim::craft::SimCraft;

use super::VirtualTello;
use crate::fault::CraftFault;
use crate::tello::command::{Direction, Offset, Request};
use crate::tello::manoeuvre::{Manoeuvre, Step, arc, place};

/// Validity of a manoeuvre's correction unless replaced by the next.
const HOLDS: Duration = Duration::from_millis(200);
/// A take-off fails if the motors do not start within this time.
const NO_LIFT: Duration = Duration::from_secs(1);

/// The current task.
#[derive(Clone, Debug)]
pub(super) enum Task {
    TakeOff,
    Land,
    Fly(Box<Manoeuvre>),
}

/// A command in progress, and the client waiting for it.
#[derive(Clone, Debug)]
pub(super) struct Running {
    pub(super) to: SocketAddr,
    pub(super) task: Task,
    pub(super) began: Time,
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

impl VirtualTello {
    /// Handles a motion command: it is refused, or starts.
    pub(super) fn begin(&mut self, now: Time, from: SocketAddr, request: Request, craft: &mut SimCraft) {
        match self.task(now, request, craft) {
            Ok(task) => {
                match task {
                    Task::TakeOff => craft.apply(now, Command::TakeOff, Time::MAX),
                    Task::Land => craft.apply(now, Command::Land, Time::MAX),
                    Task::Fly(_) => {}
                }
                self.running = Some(Running { to: from, task, began: now });
            }
            Err(why) => self.refuse(now, from, why),
        }
    }

    fn task(&mut self, now: Time, request: Request, craft: &SimCraft) -> Result<Task, &'static str> {
        let phase = craft.dynamics().phase();
        if request == Request::TakeOff {
            return self.take_off(now, craft);
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
        if [CraftFault::ImuInvalid, CraftFault::ImuLost].iter().any(|&fault| self.faults().has_fault(now, fault)) {
            return Err("error No valid imu");
        }
        let metres_a_second = |cm: i32| f64::from(cm) * 0.01;
        match request {
            Request::Move(direction, cm) => {
                Ok(self.through(now, craft, &[offset_of(direction, cm)], metres_a_second(self.speed), cm))
            }
            Request::Turn(degrees) => {
                let error = self.figures.turn_spread * self.rng.normal();
                let angle = f64::from(degrees).to_radians() + error;
                Ok(Task::Fly(Box::new(Manoeuvre::turn(now, craft, angle, self.figures.turn_rate, self.figures.run_timeout))))
            }
            Request::Flip(side) => {
                if craft.dynamics().battery() <= self.figures.flip_battery {
                    return Err("error");
                }
                let cm = libm::round(100.0 * self.figures.flip_distance) as i32;
                Ok(self.through(now, craft, &[offset_of(side, cm)], self.figures.stick_speed, cm))
            }
            Request::Go { to, speed } => Ok(self.through(now, craft, &[to], metres_a_second(speed), length(to))),
            Request::Curve { via, to, speed } => {
                let points = arc(via, to).ok_or("error")?;
                Ok(self.through(now, craft, &points, metres_a_second(speed), length(to)))
            }
            // Scenes have no mission pads.
            _ => Err("error No valid marker"),
        }
    }

    fn take_off(&mut self, now: Time, craft: &SimCraft) -> Result<Task, &'static str> {
        let faults = self.faults();
        let refused = faults.has_fault(now, CraftFault::TakeOffRefused) || faults.has_fault(now, CraftFault::BatteryEmpty);
        let charged = craft.dynamics().battery() >= self.figures.take_off_battery;
        match craft.dynamics().phase() {
            FlightPhase::OnGround if self.running.is_none() && charged && !refused => Ok(Task::TakeOff),
            FlightPhase::TakingOff => Err("error Not joystick"),
            FlightPhase::Landing => Err("error Auto land"),
            _ => Err("error"),
        }
    }

    /// A path through offsets, with a random length error. `cm` is its length.
    fn through(&mut self, now: Time, craft: &SimCraft, offsets: &[Offset], speed: f64, cm: i32) -> Task {
        let length = f64::from(cm.max(1)) * 0.01;
        let error = self.figures.move_share * self.rng.normal() + self.figures.move_fixed * self.rng.normal() / length;
        let fraction = (1.0 + error).clamp(0.3, 2.0);
        let points: VecDeque<_> = offsets.iter().map(|offset| place(craft, *offset, fraction)).collect();
        Task::Fly(Box::new(Manoeuvre::through(now, craft, points, speed, self.figures.run_timeout)))
    }

    /// Continues the current task; responds when it ends.
    pub(super) fn go_on(&mut self, now: Time, craft: &mut SimCraft) {
        let Some(mut running) = self.running.take() else { return };
        let phase = craft.dynamics().phase();
        let settled = now + duration_from_secs(self.figures.settle);
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
        match ended {
            None => self.running = Some(running),
            Some((at, text)) => {
                if matches!(running.task, Task::Fly(_)) && phase == FlightPhase::Flying {
                    craft.apply(now, Command::Setpoint(Setpoint::HOLD), Time::MAX);
                }
                self.busy_until = at;
                self.answer(at, running.to, text);
            }
        }
    }
}

/// Length of an offset, centimetres.
fn length(offset: Offset) -> i32 {
    let square = |cm: i32| f64::from(cm) * f64::from(cm);
    libm::round(libm::sqrt(square(offset.x) + square(offset.y) + square(offset.z))) as i32
}
