//! Keys and mouse, witnessed by xev.

use std::process::Stdio;
use std::sync::{Arc, Mutex};

use spf_screen::profile::Key;
use spf_screen::{Hands, ScreenError};

use crate::harness::{Program, Screen, Shop, pattern, printed, wait, wait_or_say};

fn key(name: &str) -> Key {
    Key::named(name).unwrap()
}

/// Asks for the focus until it is there.
fn focus(hands: &mut Hands) {
    wait("the focus", || hands.activate().unwrap());
    assert!(hands.has_focus().unwrap());
}

/// A window of xev, which prints the events that it gets.
pub(crate) struct Witness {
    said: Arc<Mutex<String>>,
    _program: Program,
}

impl Witness {
    pub(crate) fn start(screen: &Screen) -> Self {
        let args = ["-oL", "xev", "-name", "spf witness", "-geometry", "300x200+50+50", "-event", "keyboard", "-event", "mouse"];
        let mut child = screen.command("stdbuf", &args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let said = printed(&mut child);
        wait("xev", || screen.display().windows().unwrap().iter().any(|window| window.title == "spf witness" && window.shown));
        screen.run("xdotool", &["mousemove", "200", "200"]).unwrap();
        Self { said, _program: Program(child) }
    }

    /// The key events so far: whether it was a press, the keycode and the keysym's name.
    fn keys(&self) -> Vec<(bool, u8, String)> {
        let said = self.said.lock().unwrap().clone();
        let mut found = Vec::new();
        let mut pressed = None;
        for line in said.lines() {
            if line.starts_with("KeyPress event") || line.starts_with("KeyRelease event") {
                pressed = Some(line.starts_with("KeyPress"));
            }
            // `state 0x0, keycode 25 (keysym 0x77, w), same_screen YES,`
            if let (Some(is_press), Some((_, rest))) = (pressed, line.split_once("keycode ")) {
                let code = rest.split(' ').next().unwrap().parse().unwrap();
                let name = rest.split(", ").nth(1).and_then(|name| name.split(')').next()).unwrap_or_default();
                found.push((is_press, code, name.to_owned()));
                pressed = None;
            }
        }
        found
    }

    pub(crate) fn waits_for(&self, what: &str, expected: &[(bool, &str)]) {
        let deduplicated = || {
            // The server repeats a key that is held for long, with a release before each press.
            let mut keys: Vec<(bool, u8, String)> = Vec::new();
            for key in self.keys() {
                let again = keys.last().is_some_and(|(was_press, code, _)| key.0 && !was_press && *code == key.1);
                if again {
                    keys.pop();
                } else if keys.last() != Some(&key) {
                    keys.push(key);
                }
            }
            keys
        };
        let is_seen = || {
            let keys = deduplicated();
            keys.iter().map(|(is_press, _, name)| (*is_press, name.as_str())).eq(expected.iter().copied())
        };
        wait_or_say(is_seen, || format!("{what}: {expected:?}, so far {:?}; said:\n{}", self.keys(), self.said.lock().unwrap()));
    }
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn keys_and_mouse_reach_the_window_and_are_released_when_dropped() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let witness = Witness::start(&screen);
    let mut hands = Hands::open(&screen.display(), &"spf witness".into()).unwrap();
    focus(&mut hands);
    assert!(!hands.holds());
    hands.press_if(key("s"), || false).unwrap();
    assert!(!hands.holds());
    hands.set(key("w"), true).unwrap();
    hands.set(key("w"), true).unwrap();
    hands.set(key("space"), true).unwrap();
    hands.set(key("space"), false).unwrap();
    witness.waits_for("two keys", &[(true, "w"), (true, "space"), (false, "space")]);
    assert_eq!(hands.held(), [key("w")]);
    let before = screen.run("xdotool", &["getmouselocation"]).unwrap();
    hands.turn(40).unwrap();
    hands.turn(-15).unwrap();
    wait("the mouse", || {
        let now = screen.run("xdotool", &["getmouselocation"]).unwrap();
        let x = |text: &str| text.split([':', ' ']).nth(1).unwrap().parse::<i32>().unwrap();
        x(&now) == x(&before) + 25
    });
    drop(hands);
    witness.waits_for("dropped", &[(true, "w"), (true, "space"), (false, "space"), (false, "w")]);
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn a_panic_releases_every_key() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let witness = Witness::start(&screen);
    let display = screen.display();
    let worker = std::thread::spawn(move || {
        let mut hands = Hands::open(&display, &"spf witness".into()).unwrap();
        focus(&mut hands);
        hands.set(key("a"), true).unwrap();
        hands.set(key("Up"), true).unwrap();
        panic!("that was asked for");
    });
    assert!(worker.join().is_err());
    wait("both released", || {
        let keys = witness.keys();
        ["a", "Up"].iter().all(|name| keys.iter().any(|(is_press, _, other)| !is_press && other == name))
    });
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn without_the_focus_nothing_is_pressed() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let witness = Witness::start(&screen);
    let other = Shop::open(&screen, "Chat", (420, 300), &pattern(200, 100, 3));
    let mut hands = Hands::open(&screen.display(), &"spf witness".into()).unwrap();
    screen.run("xdotool", &["windowactivate", "--sync", &other.window.to_string()]).unwrap();
    assert!(!hands.has_focus().unwrap());
    assert!(matches!(hands.set(key("w"), true), Err(ScreenError::NoFocus)));
    assert!(matches!(hands.turn(10), Err(ScreenError::NoFocus)));
    assert!(hands.held().is_empty());
    focus(&mut hands);
    hands.set(key("w"), true).unwrap();
    // Somebody clicks elsewhere while the key is down.
    screen.run("xdotool", &["windowactivate", "--sync", &other.window.to_string()]).unwrap();
    assert!(matches!(hands.set(key("s"), true), Err(ScreenError::NoFocus)));
    hands.release_all();
    focus(&mut hands);
    hands.set(key("d"), true).unwrap();
    hands.set(key("d"), false).unwrap();
    wait("the last key", || witness.keys().iter().any(|(is_press, _, name)| !is_press && name == "d"));
    let keys = witness.keys();
    assert!(keys.iter().all(|(_, _, name)| name != "s"), "{keys:?}");
    assert_eq!(keys.iter().filter(|(is_press, _, name)| *is_press && name == "w").count(), 1, "{keys:?}");
}

/// The server says so of every keyboard that is used after another one.
#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn a_key_is_held_when_the_same_layout_is_set_again() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    screen.run("setxkbmap", &["us"]).unwrap();
    let witness = Witness::start(&screen);
    let mut hands = Hands::open(&screen.display(), &"spf witness".into()).unwrap();
    focus(&mut hands);
    hands.set(key("w"), true).unwrap();
    for _ in 0..3 {
        screen.run("setxkbmap", &["us"]).unwrap();
        // What the server tells has come with the reply.
        assert!(hands.has_focus().unwrap());
        hands.check([&key("w")]).unwrap();
    }
    assert_eq!(hands.held(), [key("w")]);
    drop(hands);
    witness.waits_for("one key, once", &[(true, "w"), (false, "w")]);
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn another_layout_of_the_keyboard_is_followed() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let witness = Witness::start(&screen);
    let mut hands = Hands::open(&screen.display(), &"spf witness".into()).unwrap();
    focus(&mut hands);
    // Two names of one key cannot be pressed apart.
    let twice = hands.check([&key("w"), &key("#25"), &key("w")]);
    assert!(matches!(&twice, Err(ScreenError::SameKey(one, two)) if one == "w" && two == "#25"), "{twice:?}");
    hands.check([&key("w"), &key("s"), &key("w")]).unwrap();
    hands.set(key("w"), true).unwrap();
    wait("w", || !witness.keys().is_empty());
    // On a French keyboard `w` is elsewhere. What is held is released by its old code.
    screen.run("setxkbmap", &["fr"]).unwrap();
    wait("the new layout", || {
        hands.check([&key("w")]).unwrap();
        hands.held().is_empty()
    });
    hands.set(key("w"), true).unwrap();
    hands.set(key("w"), false).unwrap();
    wait("w again", || witness.keys().iter().filter(|(is_press, _, _)| !is_press).count() >= 2);
    let keys = witness.keys();
    let (first, last) = (&keys[0], keys.last().unwrap());
    assert!(first.2 == "w" && last.2 == "w" && first.1 != last.1, "{keys:?}");
    // A Greek one has none.
    screen.run("setxkbmap", &["gr"]).unwrap();
    wait("no such key", || matches!(hands.check([&key("w")]), Err(ScreenError::NoKey(name)) if name == "w"));
    assert!(matches!(hands.set(key("w"), true), Err(ScreenError::NoKey(_))));
    // The key with a code is there on every layout.
    hands.set(key("#25"), true).unwrap();
    hands.set(key("#25"), false).unwrap();
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn the_keypad_is_found_whatever_num_lock_says() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let witness = Witness::start(&screen);
    let mut hands = Hands::open(&screen.display(), &"spf witness".into()).unwrap();
    focus(&mut hands);
    for name in ["KP_8", "KP_0", "KP_Add"] {
        hands.set(key(name), true).unwrap();
        hands.set(key(name), false).unwrap();
    }
    // Without Num Lock the program sees what is printed below the digits.
    wait("the keypad", || {
        let names: Vec<String> = witness.keys().into_iter().filter(|(is_press, ..)| *is_press).map(|(_, _, name)| name).collect();
        names == ["KP_Up", "KP_Insert", "KP_Add"]
    });
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn a_window_that_is_started_again_is_found_again() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let first = Shop::open(&screen, "A game", (100, 100), &pattern(200, 100, 3));
    let mut hands = Hands::open(&screen.display(), &"A game".into()).unwrap();
    focus(&mut hands);
    first.close();
    wait("gone", || !hands.has_focus().unwrap());
    // A window that does not get the focus is no error.
    assert!(!hands.activate().unwrap());
    let _second = Shop::open(&screen, "A game", (100, 100), &pattern(200, 100, 3));
    wait("found again", || hands.activate().unwrap());
    assert!(Hands::open(&screen.display(), &"Another game".into()).is_err());
}
