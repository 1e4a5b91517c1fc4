//! A gamepad that the kernel shows to all programs, by `/dev/uinput`.
//!
//! It looks like the one that libraries for games know best, an Xbox 360 pad by the kernel's driver `xpad`: they find out by the
//! numbers of maker and product what each axis and button is. Buttons are announced, but never pressed.

use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind};
use std::path::Path;

use input_linux::sys::{BUS_USB, input_event, timeval};
use input_linux::{AbsoluteAxis, AbsoluteInfo, AbsoluteInfoSetup, EventKind, InputId, Key, UInputHandle};

use crate::ScreenError;
use crate::gamepad::Positions;

/// Where the kernel makes devices.
const PATH: &str = "/dev/uinput";
/// Microsoft's Xbox 360 pad.
const IDENTITY: InputId = InputId { bustype: BUS_USB, vendor: 0x045e, product: 0x028e, version: 0x0110 };
const NAME: &[u8] = b"spf gamepad";
/// The axes of the sticks, in the order of [`Positions`].
const STICKS: [AbsoluteAxis; 4] = [AbsoluteAxis::X, AbsoluteAxis::Y, AbsoluteAxis::RX, AbsoluteAxis::RY];
/// The other axes of that pad and their ranges: triggers, and the cross.
const OTHERS: [(AbsoluteAxis, i32, i32); 4] =
    [(AbsoluteAxis::Z, 0, 255), (AbsoluteAxis::RZ, 0, 255), (AbsoluteAxis::Hat0X, -1, 1), (AbsoluteAxis::Hat0Y, -1, 1)];
/// Its buttons.
const BUTTONS: [Key; 11] = [
    Key::ButtonSouth,
    Key::ButtonEast,
    Key::ButtonNorth,
    Key::ButtonWest,
    Key::ButtonTL,
    Key::ButtonTR,
    Key::ButtonSelect,
    Key::ButtonStart,
    Key::ButtonMode,
    Key::ButtonThumbl,
    Key::ButtonThumbr,
];

/// A gamepad that exists until it is dropped. Its sticks are in the centre at first.
pub struct Gamepad {
    device: UInputHandle<File>,
    now: Positions,
}

impl std::fmt::Debug for Gamepad {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gamepad").field("now", &self.now).finish_non_exhaustive()
    }
}

impl Gamepad {
    /// Makes the device.
    ///
    /// # Errors
    /// [`ScreenError::NoGamepad`] says what is missing, and what to do.
    pub fn open() -> Result<Self, ScreenError> {
        let device = UInputHandle::new(opened(Path::new(PATH))?);
        announce(&device).map_err(|error| ScreenError::NoGamepad(format!("{PATH} makes no device: {error}")))?;
        Ok(Self { device, now: Positions::default() })
    }

    /// Whether a device could be made, as far as can be told without making one.
    ///
    /// # Errors
    /// [`ScreenError::NoGamepad`].
    pub fn check() -> Result<(), ScreenError> {
        opened(Path::new(PATH)).map(drop)
    }

    /// Writes what the device would report to a file instead, in the kernel's format (`struct input_event`).
    #[must_use]
    pub fn to_file(file: File) -> Self {
        Self { device: UInputHandle::new(file), now: Positions::default() }
    }

    /// Where the sticks are.
    #[must_use]
    pub fn positions(&self) -> Positions {
        self.now
    }

    /// Moves the sticks.
    ///
    /// # Errors
    /// [`ScreenError::Failed`]. Where the sticks are is not known then; they count as moved.
    pub fn set(&mut self, to: Positions) -> Result<(), ScreenError> {
        let events = events(self.now, to);
        if events.is_empty() {
            return Ok(());
        }
        // Noted first: a stick that may be pushed is centred.
        self.now = to;
        match self.device.write(&events) {
            Ok(written) if written == events.len() => Ok(()),
            Ok(_) => Err(ScreenError::Failed("the gamepad took only a part of the motion".to_owned())),
            Err(error) => Err(ScreenError::Failed(format!("the gamepad: {error}"))),
        }
    }

    /// Moves all sticks to the centre.
    pub fn centre(&mut self) {
        if let Err(error) = self.set(Positions::default()) {
            tracing::error!("the sticks were not centred: {error}");
        }
    }
}

impl Drop for Gamepad {
    fn drop(&mut self) {
        // Programs see that before the device goes with its file.
        self.centre();
    }
}

fn opened(path: &Path) -> Result<File, ScreenError> {
    OpenOptions::new().write(true).open(path).map_err(|error| ScreenError::NoGamepad(refusal(path, &error)))
}

/// Why the device was not opened, and what to do.
fn refusal(path: &Path, error: &Error) -> String {
    let path = path.display();
    match error.kind() {
        ErrorKind::NotFound => {
            format!(
                "there is no {path}: load the kernel's module (`sudo modprobe uinput`); a container needs the device of its host"
            )
        }
        ErrorKind::PermissionDenied => format!(
            "no permission to write {path}: allow it with a rule of udev (`KERNEL==\"uinput\", GROUP=\"input\", MODE=\"0660\"`), and be \
             in that group"
        ),
        _ => format!("cannot open {path}: {error}"),
    }
}

/// Says what the device has, and makes it.
fn announce(device: &UInputHandle<File>) -> Result<(), Error> {
    device.set_evbit(EventKind::Key)?;
    BUTTONS.iter().try_for_each(|button| device.set_keybit(*button))?;
    device.set_evbit(EventKind::Absolute)?;
    let full = i32::from(i16::MAX);
    let info = |minimum, maximum, fuzz, flat| AbsoluteInfo { value: 0, minimum, maximum, fuzz, flat, resolution: 0 };
    // No fuzz: the kernel would leave small motions out, the last one to the centre among them.
    let sticks = STICKS.iter().map(|axis| AbsoluteInfoSetup { axis: *axis, info: info(-full - 1, full, 0, 128) });
    let others = OTHERS.iter().map(|(axis, least, most)| AbsoluteInfoSetup { axis: *axis, info: info(*least, *most, 0, 0) });
    let axes: Vec<_> = sticks.chain(others).collect();
    axes.iter().try_for_each(|setup| device.set_absbit(setup.axis))?;
    device.create(&IDENTITY, NAME, 0, &axes)
}

/// What the device reports when its sticks move: each axis that changes, and the end of the report.
fn events(from: Positions, to: Positions) -> Vec<input_event> {
    // The kernel sets the time.
    let event =
        |kind: EventKind, code, value| input_event { time: timeval { tv_sec: 0, tv_usec: 0 }, type_: kind as u16, code, value };
    let moved = STICKS.iter().zip(from.values().into_iter().zip(to.values())).filter(|(_, (old, new))| old != new);
    let mut events: Vec<_> = moved.map(|(axis, (_, new))| event(EventKind::Absolute, *axis as u16, i32::from(new))).collect();
    if !events.is_empty() {
        // `SYN_REPORT`.
        events.push(event(EventKind::Synchronize, 0, 0));
    }
    events
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gamepad::Stick;

    #[test]
    fn a_refusal_says_what_to_do() {
        let missing = opened(Path::new("/nonexistent/uinput")).unwrap_err().to_string();
        assert!(missing.contains("no /nonexistent/uinput") && missing.contains("sudo modprobe uinput"), "{missing}");
        let denied = refusal(Path::new(PATH), &ErrorKind::PermissionDenied.into());
        assert!(denied.contains("no permission to write /dev/uinput") && denied.contains("GROUP=\"input\""), "{denied}");
        // A file is no device.
        let file = tempfile::tempfile().unwrap();
        assert!(announce(&UInputHandle::new(file)).is_err());
        let other = opened(Path::new("/")).unwrap_err().to_string();
        assert!(other.contains("cannot open /"), "{other}");
    }

    #[test]
    fn hand_worked_events() {
        let mut to = Positions::default();
        assert!(events(to, to).is_empty());
        to.push(Stick::named("right_x").unwrap(), 1.0);
        to.push(Stick::named("-left_y").unwrap(), 1.0);
        let found: Vec<_> = events(Positions::default(), to).iter().map(|event| (event.type_, event.code, event.value)).collect();
        // EV_ABS is 3, ABS_Y 1, ABS_RX 3.
        assert_eq!(found, [(3, 1, -32767), (3, 3, 32767), (0, 0, 0)]);
        let back: Vec<_> = events(to, Positions::default()).iter().map(|event| (event.code, event.value)).collect();
        assert_eq!(back, [(1, 0), (3, 0), (0, 0)]);
    }
}
