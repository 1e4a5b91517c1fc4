//! The sticks of a gamepad, by what the kernel would be given.

use std::io::{Read as _, Seek as _, SeekFrom};

use spf_media::Rgb;
use spf_screen::gamepad::{Positions, Stick};
use spf_screen::{Gamepad, Hands, ScreenError};

use crate::harness::{Screen, Shop, pattern, wait};

/// Bytes of an event: its time, in two machine words, then kind, code and value.
const TIME: usize = 2 * size_of::<usize>();
const EVENT: usize = TIME + 8;

fn pushed(name: &str, deflection: f64) -> Positions {
    let mut positions = Positions::default();
    positions.push(Stick::named(name).unwrap(), deflection);
    positions
}

/// A gamepad, and the motions of its axes as code and value, each with the end of its report.
struct Pad(std::fs::File);

impl Pad {
    fn made() -> (Self, Gamepad) {
        let file = tempfile::tempfile().unwrap();
        (Self(file.try_clone().unwrap()), Gamepad::to_file(file))
    }

    fn motions(&mut self) -> Vec<(u16, i32)> {
        let mut bytes = Vec::new();
        self.0.seek(SeekFrom::Start(0)).unwrap();
        self.0.read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes.len() % EVENT, 0);
        let mut found = Vec::new();
        for event in bytes.chunks(EVENT) {
            let number = |at: usize| u16::from_ne_bytes([event[TIME + at], event[TIME + at + 1]]);
            let value = i32::from_ne_bytes(event[TIME + 4..].try_into().unwrap());
            match number(0) {
                0 => assert_eq!((number(2), value), (0, 0)),
                kind => {
                    // EV_ABS.
                    assert_eq!(kind, 3);
                    found.push((number(2), value));
                }
            }
        }
        found
    }
}

#[test]
fn sticks_are_pushed_for_the_window_with_the_focus_alone_and_centred_when_dropped() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let _game = Shop::open(&screen, "A game", (100, 100), &pattern(200, 150, 3));
    let other = Shop::open(&screen, "A chat", (400, 300), &Rgb::filled(100, 100, [9; 3]));
    let mut hands = Hands::open(&screen.display(), &"A game".into()).unwrap();
    wait("the focus", || hands.activate().unwrap());
    // None was made.
    let (ahead, wanted) = (pushed("-right_y", 0.5), || true);
    assert!(matches!(hands.push_if(ahead, wanted), Err(ScreenError::NoGamepad(_))));
    let (mut pad, gamepad) = Pad::made();
    hands.take(gamepad);
    hands.push_if(ahead, || false).unwrap();
    assert!(!hands.holds());
    hands.push_if(ahead, wanted).unwrap();
    hands.push_if(ahead, wanted).unwrap();
    assert!(hands.holds());
    // Somebody clicks elsewhere.
    screen.run("xdotool", &["windowactivate", "--sync", &other.window.to_string()]).unwrap();
    assert!(matches!(hands.push_if(pushed("-right_y", 1.0), wanted), Err(ScreenError::NoFocus)));
    hands.release_all();
    assert!(!hands.holds());
    // ABS_RY is 4.
    assert_eq!(pad.motions(), [(4, -16384), (4, 0)]);
    wait("the focus again", || hands.activate().unwrap());
    hands.push_if(pushed("left_x", -1.0), wanted).unwrap();
    screen.run("xdotool", &["windowactivate", "--sync", &other.window.to_string()]).unwrap();
    // To the centre at any time.
    hands.push_if(Positions::default(), wanted).unwrap();
    wait("the focus again", || hands.activate().unwrap());
    hands.push_if(pushed("left_x", 1.0), wanted).unwrap();
    drop(hands);
    assert_eq!(pad.motions()[2..], [(0, -32767), (0, 0), (0, 32767), (0, 0)]);
}

#[test]
fn a_panic_centres_every_stick() {
    let (mut pad, mut gamepad) = Pad::made();
    let worker = std::thread::spawn(move || {
        gamepad.set(pushed("right_x", 1.0)).unwrap();
        panic!("a test");
    });
    assert!(worker.join().is_err());
    assert_eq!(pad.motions(), [(3, 32767), (3, 0)]);
}
