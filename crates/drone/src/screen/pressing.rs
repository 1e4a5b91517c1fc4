//! The thread that presses keys.

use std::sync::atomic::Ordering;
use std::time::Instant;

use spf_core::command::Setpoint;
use spf_core::telemetry::FlightPhase;
use spf_core::time::Duration;
use spf_screen::profile::Key;
use spf_screen::{Hands, ScreenError};

use super::shared::{Done, Shared};

/// How often keys are pressed and released.
const TICK: Duration = Duration::from_millis(4);
/// How often the focus is looked at while no key is pressed.
const FOCUS_PERIOD: Duration = Duration::from_millis(50);
/// How often a keyboard without a key is looked at.
const RETRY: Duration = Duration::from_millis(500);

/// Presses and releases keys until the craft is dropped.
pub(super) fn press(mut hands: Hands, shared: &Shared) {
    let mut looked = Instant::now();
    let mut last = (FlightPhase::OnGround, Setpoint::HOLD);
    while !shared.stopped.load(Ordering::Relaxed) {
        if shared.resumes.swap(false, Ordering::Relaxed) && matches!(hands.activate(), Ok(true)) {
            shared.control().take_back();
        }
        let now = shared.now();
        let mut control = shared.control();
        let wanted = control.poll(now);
        let state = (control.phase(), control.done());
        let is_taken = control.is_taken();
        drop(control);
        if state.1 != last.1 {
            shared.did(now, Done::Motion(state.1));
        }
        if last.0 == FlightPhase::TakingOff && state.0 == FlightPhase::Flying {
            shared.did(now, Done::TookOff(shared.take_off_height));
        }
        last = state;
        let mut result = release(&mut hands, &wanted.keys);
        for key in &wanted.keys {
            result = result.and_then(|()| hands.set(*key, true));
        }
        result = result.and_then(|()| hands.turn(wanted.mouse));
        if looked.elapsed() >= FOCUS_PERIOD && !is_taken && state.0 != FlightPhase::OnGround {
            looked = Instant::now();
            result = result.and_then(|()| if hands.has_focus()? { Ok(()) } else { Err(ScreenError::NoFocus) });
        }
        match result {
            Ok(()) => {}
            Err(ScreenError::NoFocus) => {
                hands.release_all();
                shared.control().lose_focus(shared.now());
                if !is_taken {
                    tracing::warn!("the window has lost the focus: keys released; resume gives it back");
                }
            }
            Err(error) => {
                hands.release_all();
                tracing::error!("keys can no longer be pressed: {error}");
                shared.control().set_broken(shared.now(), true);
                mend(&mut hands, shared, error);
            }
        }
        std::thread::sleep(TICK);
    }
    drop(hands);
    shared.released.store(true, Ordering::Relaxed);
}

fn release(hands: &mut Hands, wanted: &[Key]) -> Result<(), ScreenError> {
    hands.held().into_iter().filter(|key| !wanted.contains(key)).try_for_each(|key| hands.set(key, false))
}

/// Waits until the keyboard has its keys again, which a change of the layout may bring.
fn mend(hands: &mut Hands, shared: &Shared, error: ScreenError) {
    let ScreenError::NoKey(name) = error else { return std::thread::sleep(RETRY) };
    let Ok(key) = Key::named(&name) else { return };
    while !shared.stopped.load(Ordering::Relaxed) {
        // The phases go on.
        shared.control().poll(shared.now());
        if hands.check([&key]).is_ok() {
            shared.control().set_broken(shared.now(), false);
            return;
        }
        std::thread::sleep(RETRY);
    }
}
