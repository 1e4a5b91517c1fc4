//! A vehicle flown in the simulator's own time, which stands still while the pilot thinks (`--lockstep`).
//!
//! Flight time is the simulator's: it advances by 0.05 s whenever the flight loop has nothing else to do (`simContinueForTime`, whose
//! answer comes when the step is over and the simulator is paused again). A slow VLM, a slow renderer and a slow machine change nothing.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration as Wait, Instant};

use spf_core::command::Command;
use spf_core::depth::DepthGrid;
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;

use super::address::Address;
use super::control::Control;
use super::craft::{Facts, NAME, capabilities};
use super::opening::{ConnectError, Found, STARTS_WITHIN, find};
use super::pictures::DepthEye;
use super::reporting::Reporter;
use super::rpc::RpcError;
use super::senses::Senses;
use super::session::{MARK, Session};
use super::settings::AirSimSettings;
use super::shared::Eye;
use super::wire::structs::ImageResponse;
use crate::abandon::{self, EmergencyLand};
use crate::frames::{FrameStore, Frames};
use crate::{Capabilities, Drone, DroneError, DroneEvent};

/// How far the simulator's time runs at once: the interval of state reports.
pub(super) const STEP: Duration = Duration::from_millis(50);
/// An image is asked for after so many steps.
const IMAGE_EVERY: u64 = 2;
/// A question who has control after so many.
const CONTROL_EVERY: u64 = 20;
/// How long it may take until what was sent has arrived, before the simulator's time goes on.
const ARRIVES: Wait = Wait::from_secs(2);
/// Marks are numbered anew after so many.
const MARKS: u32 = 1 << 16;

/// What moves the simulator's time, and the vehicle in it.
struct Stepped {
    /// The simulator's answers: state, images, time.
    session: Session,
    /// The calls of the flight.
    motion: Session,
    control: Control,
    reporter: Reporter,
    /// `None` once it only lands.
    eye: Option<Eye>,
    frames: FrameStore,
    depth: VecDeque<(Time, Box<DepthGrid>)>,
    now: Time,
    steps: u64,
    /// Why its time does not run any more.
    over: Option<String>,
}

impl Stepped {
    /// Lets the simulator's time run for one step, and reports what it shows then. A simulator that does not answer is asked no more: it
    /// stays paused, and the link counts as lost while flight time goes on.
    fn step(&mut self) {
        self.now += STEP;
        self.steps += 1;
        // The pilot is alive: time runs because it asks.
        self.control.heartbeat(self.now);
        self.control.tick(self.now);
        if self.over.is_none()
            && let Err(error) = self.run()
            && !matches!(error, RpcError::Refused { .. } | RpcError::Unreadable { .. })
        {
            tracing::warn!(%error, "the simulator's time stands still from now on");
            self.over = Some(error.to_string());
        }
        while let Some(notice) = self.control.take_notice() {
            notice.tell();
        }
    }

    fn run(&mut self) -> Result<(), RpcError> {
        self.exchange()?;
        self.session.run_for(STEP.as_secs_f64())?;
        let (state, _) = self.session.state()?;
        self.reporter.report(self.now, self.now, &state, &mut self.control);
        // Reading it clears it, so that each is read once.
        let touched = self.session.collision()?;
        if touched.has_collided {
            self.control.handle_collision(&touched.object_name);
        }
        if self.steps.is_multiple_of(CONTROL_EVERY) {
            match self.session.is_controlled() {
                Ok(given) => self.control.handle_control(self.now, given),
                // A fork may not tell.
                Err(RpcError::Refused { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        let now = self.now;
        if let Some(eye) = self.eye.as_mut().filter(|_| self.steps.is_multiple_of(IMAGE_EVERY)) {
            let images = self.session.images(&eye.requests(now))?;
            let grid = eye.see(images, now, &mut |_: &ImageResponse| now);
            self.depth.extend(grid.map(|grid| (now, grid)));
        }
        Ok(())
    }

    /// Sends what the control asks for, and takes the answers that have come.
    fn exchange(&mut self) -> Result<(), RpcError> {
        while let Some((number, request)) = self.control.poll(self.now) {
            tracing::trace!(number, ?request, "to the simulator");
            self.motion.send(number, request)?;
        }
        // When this call is answered, those before it have arrived, and what has ended is told.
        let mark = MARK + (self.steps % u64::from(MARKS)) as u32;
        self.motion.mark(mark)?;
        let until = Instant::now() + ARRIVES;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(RpcError::TimedOut { method: "ping", wait: ARRIVES });
            }
            match self.motion.answer(left)? {
                Some((number, _)) if number == mark => return Ok(()),
                // Of an earlier one that came late.
                Some((MARK.., _)) | None => {}
                Some((number, answer)) => self.control.handle_answer(self.now, number, answer),
            }
        }
    }

    /// Whether anything waits for the pilot.
    fn is_waiting(&self) -> bool {
        self.control.has_event() || !self.depth.is_empty()
    }
}

/// It is shared with whatever lands it when the program ends.
struct Held(Mutex<Stepped>);

impl Held {
    fn lock(&self) -> MutexGuard<'_, Stepped> {
        // Each step leaves it consistent.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl EmergencyLand for Held {
    /// Lands it in the simulator's time, however fast that is, and lets that time run on by itself.
    fn abandon(&self) {
        let mut held = self.lock();
        let (begun, allowed) = (held.now, held.control.landing_time());
        held.eye = None;
        while held.control.is_airborne() && held.over.is_none() {
            let now = held.now;
            held.control.leave(now);
            held.step();
            if held.now.since(begun) >= allowed {
                tracing::error!("the craft did not land within {} s: it hovers where it is", allowed.as_secs());
                break;
            }
        }
        if held.control.is_airborne() && held.over.is_some() {
            tracing::error!("the simulator does not answer any more: the craft is left in the air");
        }
        held.control.part();
        if held.over.is_none() {
            drop(held.exchange().and_then(|()| held.session.pause(false)));
        }
    }
}

/// A vehicle whose time runs when the pilot asks what happens next.
pub struct LockstepCraft {
    held: Arc<Held>,
    frames: FrameStore,
    capabilities: Capabilities,
}

impl LockstepCraft {
    /// Connects to a vehicle, pauses the simulator, and takes control of the vehicle. From here on it is landed if the program ends.
    ///
    /// # Errors
    /// [`ConnectError`] if the simulator, the vehicle or its camera is not there, or cannot be used, or its time cannot be stopped.
    pub fn connect(address: &Address, settings: &AirSimSettings) -> Result<(Self, Facts), ConnectError> {
        Self::connect_within(address, settings, STARTS_WITHIN)
    }

    /// The same, for a simulator that is given this long to start.
    pub(super) fn connect_within(
        address: &Address,
        settings: &AirSimSettings,
        patience: Duration,
    ) -> Result<(Self, Facts), ConnectError> {
        let Found { mut session, encoding, version, vehicles, state, camera } = find(address, settings, patience)?;
        let motion = Session::open(address, encoding)?;
        session.pause(true)?;
        let mut control = Control::new(Time::ZERO);
        let mut reporter = Reporter::new(Senses::new(settings.seed, settings.true_pose));
        reporter.report(Time::ZERO, Time::ZERO, &state, &mut control);
        let flies = control.engage(Time::ZERO);
        if flies {
            tracing::warn!("the craft is in the air: it is flown from where it is");
        }
        let frames = FrameStore::default();
        let depth = settings.depth_sensor.then(|| DepthEye::new(&camera, settings.seed));
        let eye = Eye::new(camera, &settings.camera, frames.clone(), depth);
        let stepped = Stepped {
            session,
            motion,
            control,
            reporter,
            eye: Some(eye),
            frames: frames.clone(),
            depth: VecDeque::new(),
            now: Time::ZERO,
            steps: 0,
            over: None,
        };
        let held = Arc::new(Held(Mutex::new(stepped)));
        abandon::register(&(held.clone() as Arc<dyn EmergencyLand>));
        let facts = Facts { encoding, version, vehicles, camera, flies };
        Ok((Self { held, frames, capabilities: capabilities(camera, settings) }, facts))
    }
}

impl Drop for LockstepCraft {
    fn drop(&mut self) {
        self.held.abandon();
    }
}

impl Drone for LockstepCraft {
    fn name(&self) -> &str {
        NAME
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        self.held.lock().control.apply(now, command);
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        let mut held = self.held.lock();
        loop {
            if let Some((at, event)) = held.control.take_event() {
                return Some((at, event));
            }
            if let Some(meta) = held.frames.take_new_frame() {
                return Some((meta.received, DroneEvent::Frame(meta)));
            }
            if let Some((at, grid)) = held.depth.pop_front() {
                return Some((at, DroneEvent::Depth(grid)));
            }
            if held.now + STEP > until {
                return None;
            }
            held.step();
        }
    }

    fn resume(&mut self, _now: Time) {
        self.held.lock().control.resume();
    }

    fn next_event_at(&self) -> Option<Time> {
        let held = self.held.lock();
        Some(if held.is_waiting() { held.now } else { held.now + STEP })
    }
}
