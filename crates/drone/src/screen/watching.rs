//! The thread that looks: frames, the turn between them, and the reports of the reckoned motion.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use spf_core::frame::Unusable;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_media::Rgb;
use spf_screen::picture::Pictures;
use spf_screen::profile::Profile;
use spf_screen::{Eye, Hidden, ScreenError};

use super::control::{Bar, Part};
use super::flow::Flow;
use super::motion::deflection;
use super::reckoning::Reckoning;
use super::shared::{Done, Shared};
use super::stillness::{Drawn, Stillness};
use super::turn_check::TurnCheck;
use crate::DroneEvent;
use crate::frames::FrameStore;

/// Time between two pictures.
const PERIOD: Duration = Duration::from_millis(50);

/// Looks at the window.
pub(super) struct Watcher {
    eye: Eye,
    pictures: Pictures,
    profile: Profile,
    frames: FrameStore,
    stillness: Stillness,
    flow: Flow,
    reckoning: Reckoning,
    turns: TurnCheck,
    drawn: Drawn,
    last: Option<Rgb>,
    size: (u32, u32),
    hidden: Option<Hidden>,
    was_frozen: bool,
}

impl Watcher {
    pub(super) fn new(now: Time, eye: Eye, profile: &Profile, size: (u32, u32), frames: FrameStore) -> Self {
        Self {
            eye,
            pictures: Pictures::new(&profile.camera.masks),
            profile: profile.clone(),
            frames,
            stillness: Stillness::default(),
            flow: Flow::new(profile.camera.masks.clone()),
            reckoning: Reckoning::new(now, profile.controls.dead_time_s, profile.controls.lag_s),
            turns: TurnCheck::default(),
            drawn: Drawn::default(),
            last: None,
            size,
            hidden: None,
            was_frozen: false,
        }
    }

    /// Looks until the craft is dropped.
    pub(super) fn run(mut self, shared: &Arc<Shared>) {
        let mut next = Instant::now();
        while !shared.stopped.load(Ordering::Relaxed) {
            let looked = self.look(shared);
            let is_news = shared.control().set_broken(shared.now(), Part::Picture, looked.is_err());
            if let Err(error) = looked {
                if is_news {
                    tracing::error!("the window can no longer be captured: {error}");
                }
                std::thread::sleep(Duration::from_millis(500));
            }
            next = (next + PERIOD).max(Instant::now());
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
    }

    fn look(&mut self, shared: &Shared) -> Result<(), ScreenError> {
        let latency = duration_from_secs(self.profile.camera.latency_s);
        let seen = self.eye.look()?;
        let received = shared.now();
        match seen {
            Ok(shown) => {
                if self.hidden.take().is_some() {
                    tracing::info!("the window can be seen again");
                }
                let taken = shared.time_of(shown.at);
                let captured = taken - latency;
                let image = self.pictures.finish(shown.image);
                self.reckon(shared, captured);
                let frozen = self.picture(shared, captured, &image);
                if frozen && !std::mem::replace(&mut self.was_frozen, frozen) {
                    tracing::warn!(
                        "keys were held, and the picture has not changed: the game is paused, frozen or in a menu, or does not notice keys \
                         as short as `controls.pulse_hz` of the profile makes them, or the craft is stuck"
                    );
                }
                self.was_frozen = frozen;
                let mut control = shared.control();
                control.bar(Bar::Hidden, false);
                control.bar(Bar::Frozen, frozen);
                drop(control);
                let unusable = if frozen {
                    Some(Unusable::Frozen)
                } else {
                    ((image.width(), image.height()) != self.size).then_some(Unusable::Resized)
                };
                self.frames.receive_live(captured, received, image.clone(), unusable);
                self.last = Some(image);
            }
            Err(hidden) => {
                shared.control().bar(Bar::Hidden, true);
                if self.hidden.as_ref() != Some(&hidden) {
                    tracing::warn!("nothing can be seen: {hidden}");
                    self.hidden = Some(hidden);
                }
                self.reckon(shared, received - latency);
                self.flow.forget();
                if let Some(last) = &self.last {
                    self.frames.receive_live(received - latency, received, last.clone(), Some(Unusable::Hidden));
                }
            }
        }
        let phase = shared.control().phase();
        let telemetry = self.reckoning.telemetry(phase);
        shared.report(received, DroneEvent::Telemetry(telemetry));
        Ok(())
    }

    fn reckon(&mut self, shared: &Shared, to: Time) {
        for (at, done) in shared.take_commands() {
            match done {
                Done::Motion(setpoint) => self.reckoning.command(at, setpoint),
                Done::TookOff(height) => self.reckoning.stand_at(height),
            }
        }
        self.reckoning.advance(to);
    }

    /// Takes a picture into account; whether it has stopped to answer.
    fn picture(&mut self, shared: &Shared, captured: Time, image: &Rgb) -> bool {
        let pushed = deflection(&self.profile.controls, self.reckoning.pushed(captured));
        let before = self.stillness.changes();
        let frozen = self.stillness.is_frozen(captured, image, pushed);
        if let Some(pictures) = self.drawn.add(captured, pushed, self.stillness.changes() > before) {
            shared.control().draws(pictures);
        }
        let size = (image.width(), image.height());
        if size == self.size {
            let camera = self.profile.optics(size);
            let commanded = self.reckoning.commanded_heading();
            let more = self.flow.next(image, &camera, self.reckoning.motion(), commanded);
            if let Some(more) = more {
                self.reckoning.correct_heading(more);
            }
            if let Some(shown) = self.turns.add(captured, commanded, more) {
                tracing::warn!(
                    "the last turns in the picture were {shown:.2} times those that were commanded: `controls.yaw` of the profile is wrong, \
                     or its field of view; `spf screen calibrate` measures the turn"
                );
            }
        } else {
            self.flow.forget();
        }
        frozen
    }
}
