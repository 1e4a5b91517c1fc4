//! The thread that presses keys and pushes sticks.

use std::sync::atomic::Ordering;
use std::time::Instant;

use spf_core::command::Setpoint;
use spf_core::telemetry::FlightPhase;
use spf_core::time::Duration;
use spf_screen::profile::Key;
use spf_screen::{Hands, ScreenError};

use super::control::Part;
use super::shared::{Done, Shared};

/// How often keys are pressed and released.
const TICK: Duration = Duration::from_millis(4);
/// How often the focus is looked at while no key is down; while one is, it is looked at each time.
const FOCUS_PERIOD: Duration = Duration::from_millis(50);
/// How often a keyboard without a key is looked at.
const RETRY: Duration = Duration::from_millis(500);

/// Presses and releases keys until the craft is dropped.
pub(super) fn press(mut hands: Hands, shared: &Shared) {
    let (mut looked, mut found) = (Instant::now(), Instant::now());
    let mut last = (FlightPhase::OnGround, Setpoint::HOLD);
    while !shared.stopped.load(Ordering::Relaxed) {
        if shared.resumes.swap(false, Ordering::Relaxed) {
            resume(&mut hands, shared);
        }
        let now = shared.now();
        let mut control = shared.control();
        let wanted = control.poll(now);
        let state = (control.phase(), control.done());
        let is_watched = !control.is_taken() && !control.is_over();
        let complaint = control.take_complaint();
        drop(control);
        if let Some(complaint) = complaint {
            tracing::warn!("{complaint}");
        }
        if state.1 != last.1 {
            shared.did(now, Done::Motion(state.1));
        }
        if last.0 == FlightPhase::TakingOff && state.0 == FlightPhase::Flying {
            shared.did(now, Done::TookOff(shared.take_off_height));
        }
        last = state;
        let mut result = release(&mut hands, &wanted.keys);
        for key in &wanted.keys {
            result = result.and_then(|()| hands.press_if(*key, || shared.control().still(shared.now())));
        }
        result = result.and_then(|()| hands.push_if(wanted.sticks, || shared.control().still(shared.now())));
        if wanted.mouse != 0 && shared.control().still(shared.now()) {
            result = result.and_then(|()| hands.turn(wanted.mouse));
        }
        if is_watched && (hands.holds() || looked.elapsed() >= FOCUS_PERIOD) {
            looked = Instant::now();
            result = result.and_then(|()| if hands.has_focus()? { Ok(()) } else { Err(ScreenError::NoFocus) });
        }
        match result {
            Ok(()) => {}
            Err(ScreenError::NoFocus) => {
                hands.release_all();
                // Without a window nobody has taken it from this program.
                if !lost(&hands, shared) && shared.control().lose_focus(shared.now()) {
                    tracing::warn!("the window has lost the focus: keys released; resume (T) gives it back");
                }
            }
            Err(error) => {
                hands.release_all();
                if shared.control().set_broken(shared.now(), Part::Keys, true) {
                    tracing::error!("keys can no longer be pressed: {error}");
                }
                mend(&mut hands, shared, error);
            }
        }
        if !is_watched && found.elapsed() >= RETRY {
            found = Instant::now();
            lost(&hands, shared);
        }
        std::thread::sleep(TICK);
    }
    drop(hands);
    shared.released.store(true, Ordering::Relaxed);
}

/// Asks for the focus, as the operator wishes.
fn resume(hands: &mut Hands, shared: &Shared) {
    let refused = match hands.activate() {
        Ok(true) => return shared.control().take_back(shared.now()),
        Ok(false) => "the window did not get the focus; resume asks again".to_owned(),
        Err(error) => format!("the window did not get the focus: {error}"),
    };
    tracing::warn!("{refused}");
    // The pilot holds, so that the operator can resume again.
    shared.control().refuse_resume(shared.now());
}

/// Whether the window is no more, which then is a lost link, whoever had the focus: a game that has ended is flown by nobody. A game that
/// was started again is flown when the operator resumes, and not before: it may show a menu.
fn lost(hands: &Hands, shared: &Shared) -> bool {
    let is_gone = hands.is_gone().unwrap_or(false);
    if is_gone && shared.control().set_broken(shared.now(), Part::Window, true) {
        tracing::error!("the window is gone: has the game ended?");
    }
    is_gone
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
        let mut control = shared.control();
        control.poll(shared.now());
        let complaint = control.take_complaint();
        drop(control);
        if let Some(complaint) = complaint {
            tracing::warn!("{complaint}");
        }
        if hands.check([&key]).is_ok() {
            shared.control().set_broken(shared.now(), Part::Keys, false);
            return;
        }
        std::thread::sleep(RETRY);
    }
}
