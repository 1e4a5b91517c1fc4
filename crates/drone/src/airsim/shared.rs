//! What the threads of a vehicle share, and what each does.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration as Wait, Instant};

use spf_core::camera::Camera;
use spf_core::depth::DepthGrid;
use spf_core::frame::Unusable;
use spf_core::time::{Duration, Time};

use super::address::Address;
use super::clock::SimClock;
use super::control::Control;
use super::opening::scene_of;
use super::pictures::{DepthEye, depth_of, pixels};
use super::reporting::Reporter;
use super::rpc::RpcError;
use super::session::Session;
use super::wire::Encoding;
use super::wire::structs::ImageResponse;
use crate::abandon::EmergencyLand;
use crate::frames::FrameStore;

/// How long the motion thread waits for answers before it looks for what is to be sent.
const MOTION_WAIT: Wait = Wait::from_millis(5);
/// Interval of state reports, and how many of them pass between two questions who has control.
const STATE_PERIOD: Wait = Wait::from_millis(50);
const CONTROL_EVERY: u32 = 20;
/// Shortest interval of images, and of depth images.
const IMAGE_PERIOD: Wait = Wait::from_millis(50);
const DEPTH_PERIOD: Duration = Duration::from_millis(66);
/// A connection that has ended is made anew at this interval.
const RECONNECT: Wait = Wait::from_secs(1);
/// Time allowed for the last calls.
const PARTING: Duration = Duration::from_secs(1);

/// State shared by the threads.
pub(super) struct Shared {
    address: Address,
    encoding: Encoding,
    control: Mutex<Control>,
    clock: Mutex<SimClock>,
    depth: Mutex<Option<(Time, Box<DepthGrid>)>>,
    start: Instant,
    stopped: AtomicBool,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The value is consistent between calls.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    pub(super) fn new(address: Address, encoding: Encoding, start: Instant) -> Self {
        Self {
            address,
            encoding,
            control: Mutex::new(Control::new(Time::ZERO + start.elapsed())),
            clock: Mutex::default(),
            depth: Mutex::default(),
            start,
            stopped: AtomicBool::new(false),
        }
    }

    /// Flight time.
    pub(super) fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    pub(super) fn control(&self) -> MutexGuard<'_, Control> {
        lock(&self.control)
    }

    /// The newest depth grid that was not taken yet, with its arrival.
    pub(super) fn take_depth(&self) -> Option<(Time, Box<DepthGrid>)> {
        lock(&self.depth).take()
    }

    pub(super) fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    fn runs(&self) -> bool {
        !self.stopped.load(Ordering::Relaxed)
    }

    /// Waits, but not beyond the end.
    fn rest(&self, wait: Wait) {
        const NAP: Wait = Wait::from_millis(20);
        let until = Instant::now() + wait;
        while self.runs() && Instant::now() < until {
            std::thread::sleep(until.saturating_duration_since(Instant::now()).min(NAP));
        }
    }

    fn reopen(&self) -> Result<Session, RpcError> {
        Session::open(&self.address, self.encoding)
    }

    /// Sends what the control asks for, and takes the answers, until the end. Whoever needs the control never waits for a socket.
    pub(super) fn move_craft(&self, mut session: Option<Session>) {
        let mut again = Instant::now();
        while self.runs() {
            let now = self.now();
            self.control().tick(now);
            if session.is_some() && self.control().is_unanswered(now) {
                tracing::warn!("the simulator does not answer: another connection is made");
                session = None;
            }
            let worked = match &mut session {
                Some(open) => self.exchange(open),
                None if Instant::now() < again => {
                    std::thread::sleep(MOTION_WAIT);
                    Ok(())
                }
                None => {
                    again = Instant::now() + RECONNECT;
                    self.reopen().map(|open| {
                        session = Some(open);
                        let now = self.now();
                        self.control().reconnected(now);
                    })
                }
            };
            if let Err(error) = worked {
                if session.take().is_some() {
                    tracing::warn!(%error, "the connection for motion is lost");
                }
                again = Instant::now() + RECONNECT;
            }
            let notice = || self.control().take_notice();
            while let Some(notice) = notice() {
                notice.tell();
            }
        }
    }

    fn exchange(&self, session: &mut Session) -> Result<(), RpcError> {
        let next = || self.control().poll(self.now());
        while let Some((number, request)) = next() {
            tracing::trace!(number, ?request, "to the simulator");
            session.send(number, request)?;
        }
        let mut wait = MOTION_WAIT;
        while let Some((number, answer)) = session.answer(wait)? {
            let now = self.now();
            self.control().handle_answer(now, number, answer);
            // What has arrived already.
            wait = Wait::from_micros(100);
        }
        Ok(())
    }

    /// Asks for the state until the end.
    pub(super) fn watch_state(&self, mut session: Session, mut reporter: Reporter) {
        let mut round: u32 = 0;
        while self.runs() {
            let begun = Instant::now();
            round = round.wrapping_add(1);
            if let Err(error) = self.ask_state(&mut session, &mut reporter, round) {
                self.recover(&mut session, &error, "state");
            }
            self.rest(STATE_PERIOD.saturating_sub(begun.elapsed()));
        }
    }

    fn ask_state(&self, session: &mut Session, reporter: &mut Reporter, round: u32) -> Result<(), RpcError> {
        let sent = self.now();
        let (state, _) = session.state()?;
        let received = self.now();
        let measured = lock(&self.clock).at(state.timestamp, sent, received);
        reporter.report(received, measured, &state, &mut self.control());
        // Reading it clears it, so that each is read once.
        let touched = session.collision()?;
        if touched.has_collided {
            self.control().handle_collision(&touched.object_name);
        }
        if round.is_multiple_of(CONTROL_EVERY) {
            match session.is_controlled() {
                Ok(given) => {
                    let now = self.now();
                    self.control().handle_control(now, given);
                }
                // A fork may not tell.
                Err(RpcError::Refused { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// After a failed call: a connection that has ended is made anew.
    fn recover(&self, session: &mut Session, error: &RpcError, what: &'static str) {
        tracing::debug!(%error, what, "no answer of the simulator");
        if error.is_of_call() {
            return;
        }
        self.rest(RECONNECT);
        if let Ok(open) = self.reopen() {
            *session = open;
        }
    }

    /// Asks for images until the end.
    pub(super) fn look(&self, mut session: Session, mut eye: Eye) {
        while self.runs() {
            let begun = Instant::now();
            if let Err(error) = self.ask_images(&mut session, &mut eye) {
                self.recover(&mut session, &error, "images");
            }
            self.rest(IMAGE_PERIOD.saturating_sub(begun.elapsed()));
        }
    }

    fn ask_images(&self, session: &mut Session, eye: &mut Eye) -> Result<(), RpcError> {
        let sent = self.now();
        let images = session.images(&eye.requests(sent))?;
        let received = self.now();
        let mut clock = lock(&self.clock);
        let mut captured = |image: &ImageResponse| clock.at(image.time_stamp, sent, received);
        if let Some(grid) = eye.see(images, received, &mut captured) {
            *lock(&self.depth) = Some((received, grid));
        }
        Ok(())
    }
}

impl EmergencyLand for Shared {
    fn abandon(&self) {
        let (begun, allowed) = (Instant::now(), self.control().landing_time());
        while self.control().is_airborne() {
            let now = self.now();
            self.control().leave(now);
            if begun.elapsed() >= allowed {
                tracing::error!("the craft did not land within {} s: it hovers where it is", allowed.as_secs());
                break;
            }
            std::thread::sleep(MOTION_WAIT);
        }
        self.control().part();
        let begun = Instant::now();
        while !self.control().is_settled() && begun.elapsed() < PARTING {
            std::thread::sleep(MOTION_WAIT);
        }
    }
}

/// What becomes of the pictures of a camera.
pub(super) struct Eye {
    camera: Camera,
    name: String,
    frames: FrameStore,
    depth: Option<DepthEye>,
    /// The simulator's time of the newest picture.
    stamp: Option<u64>,
    /// When depth was last asked for.
    measured: Option<Time>,
    /// What was wrong with the last picture, which is said once.
    fault: Option<String>,
}

impl Eye {
    pub(super) fn new(camera: Camera, name: &str, frames: FrameStore, depth: Option<DepthEye>) -> Self {
        Self { camera, name: name.to_owned(), frames, depth, stamp: None, measured: None, fault: None }
    }

    /// The pictures to ask for now: one of colours, and one of depth if it is due.
    pub(super) fn requests(&mut self, now: Time) -> Vec<super::wire::structs::ImageRequest> {
        let mut requests = vec![scene_of(&self.name)];
        if self.depth.is_some() && self.measured.is_none_or(|at| now.since(at) >= DEPTH_PERIOD) {
            self.measured = Some(now);
            requests.push(depth_of(&self.name));
        }
        requests
    }

    /// Takes the answer: a frame, and the depth grid that is returned.
    pub(super) fn see(
        &mut self,
        images: Vec<ImageResponse>,
        received: Time,
        captured: &mut dyn FnMut(&ImageResponse) -> Time,
    ) -> Option<Box<DepthGrid>> {
        let mut images = images.into_iter();
        let seen = images.next().ok_or_else(|| "an answer without an image".to_owned()).and_then(|image| {
            let (at, stamp) = (captured(&image), image.time_stamp);
            pixels(image).map(|image| (at, stamp, image))
        });
        let mut fault = None;
        match seen {
            Ok((at, stamp, image)) => {
                let is_new = self.stamp.replace(stamp) != Some(stamp);
                let resized = (image.width(), image.height()) != (self.camera.width, self.camera.height);
                // The simulator tells whether it has rendered anew; a craft at rest sees the same.
                if is_new || resized {
                    self.frames.receive_live(at, received, image, resized.then_some(Unusable::Resized));
                } else {
                    self.frames.receive(at, received, image);
                }
            }
            Err(why) => fault = Some(why),
        }
        let grid = images.next().and_then(|image| {
            let at = captured(&image);
            self.depth.as_mut()?.measure(&image, at).map_err(|why| fault = Some(why)).ok()
        });
        if fault.is_some() && self.fault != fault {
            tracing::warn!("camera `{}`: {}", self.name, fault.as_deref().unwrap_or_default());
        }
        self.fault = fault;
        grid.map(Box::new)
    }
}
