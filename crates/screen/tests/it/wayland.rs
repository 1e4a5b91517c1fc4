//! A session of Wayland: sway without a screen, with Xwayland, and a program of Wayland itself beside one of X11.

use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

use spf_screen::area::Region;
use spf_screen::profile::Key;
use spf_screen::{Eye, Hands, ScreenError, Target, WindowName};

use crate::harness::{Program, Screen, Shop, look, pattern, wait};
use crate::pressing::Witness;

/// Debian's sway, xwayland, foot and x11-xserver-utils.
const PROGRAMS: [&str; 5] = ["sway", "Xwayland", "swaymsg", "foot", "xhost"];

struct Session {
    folder: tempfile::TempDir,
    socket: String,
    _programs: Vec<Program>,
}

impl Session {
    /// The session, and its display for programs of X11.
    fn start() -> Option<(Self, Screen)> {
        if let Some(missing) = crate::server::Server::missing(&PROGRAMS) {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{missing} is missing");
            eprintln!("NOT CHECKED: {missing} is missing");
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o777)).unwrap();
        let runtime = folder.path().join("runtime");
        std::fs::create_dir(&runtime).unwrap();
        std::fs::set_permissions(&runtime, PermissionsExt::from_mode(0o700)).unwrap();
        let config = folder.path().join("config");
        let lines = "xwayland force\noutput HEADLESS-1 resolution 1024x768\ndefault_border none\nfocus_follows_mouse no\n\
            focus_on_window_activation focus\nfor_window [title=\".*\"] floating enable\n\
            exec sh -c 'xhost + >&2; echo \"$DISPLAY $WAYLAND_DISPLAY $SWAYSOCK\"'\n";
        std::fs::write(&config, lines).unwrap();
        // It refuses to run as root.
        let is_root = std::fs::metadata("/proc/self").is_ok_and(|it| std::os::unix::fs::MetadataExt::uid(&it) == 0);
        let mut command = Command::new(if is_root { "setpriv" } else { "sway" });
        if is_root {
            std::os::unix::fs::chown(&runtime, Some(NOBODY), Some(NOBODY)).unwrap();
            let who = [format!("--reuid={NOBODY}"), format!("--regid={NOBODY}"), "--clear-groups".to_owned(), "sway".to_owned()];
            command.args(who);
        }
        command.arg("-c").arg(&config).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        command.envs([("WLR_BACKENDS", "headless"), ("WLR_RENDERER", "pixman"), ("WLR_LIBINPUT_NO_DEVICES", "1")]);
        command.env("XDG_RUNTIME_DIR", &runtime).env("HOME", &runtime).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut sway = command.stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(sway.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let [display, wayland, socket] = line.split_whitespace().collect::<Vec<_>>()[..] else { panic!("{line:?}") };
        let screen = Screen::of(display);
        let mut native = Command::new("foot");
        native.args(["--title", "a program of Wayland", "cat"]).env("WAYLAND_DISPLAY", wayland).env("XDG_RUNTIME_DIR", &runtime);
        let native = native.env("LC_ALL", "C.UTF-8").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let session = Self { folder, socket: socket.to_owned(), _programs: vec![Program(native), Program(sway)] };
        wait("the program of Wayland", || session.tree().contains("a program of Wayland"));
        Some((session, screen))
    }

    fn message(&self, args: &[&str]) -> String {
        let mut command = Command::new("swaymsg");
        let output =
            command.args(args).env("SWAYSOCK", &self.socket).env("XDG_RUNTIME_DIR", runtime(self.folder.path())).output();
        String::from_utf8(output.unwrap().stdout).unwrap()
    }

    fn tree(&self) -> String {
        self.message(&["-t", "get_tree"])
    }
}

/// The user `nobody` of Debian and others.
const NOBODY: u32 = 65534;

fn runtime(folder: &Path) -> std::path::PathBuf {
    folder.join("runtime")
}

#[test]
#[ignore = "needs sway: .ci/interop runs it"]
fn a_window_of_xwayland_is_seen_though_covered_and_gets_keys_with_the_focus_alone() {
    let Some((session, screen)) = Session::start() else { return };
    let image = pattern(320, 240, 5);
    let shop = Shop::map(&screen, "A game", &image);
    let name = WindowName { title: None, class: Some("spf Test".to_owned()) };
    let display = screen.display();
    let mut eye = Eye::new(display.clone(), Target::Window { name: name.clone(), region: Region::WHOLE });
    look(&mut eye, "the picture", |seen| seen.as_ref().is_ok_and(|shown| shown.image == image)).unwrap();
    let mut hands = Hands::open(&display, &name).unwrap();
    wait("the focus", || hands.activate().unwrap());
    let w = Key::named("w").unwrap();
    hands.set(w, true).unwrap();
    hands.set(w, false).unwrap();
    // A program that X11 does not know of is in front of it, and has the focus.
    session.message(&["[title=\"a program of Wayland\"]", "focus"]);
    wait("no focus", || !hands.has_focus().unwrap());
    assert!(matches!(hands.set(w, true), Err(ScreenError::NoFocus)) && hands.held().is_empty());
    let covered = eye.look().unwrap().unwrap();
    assert!(covered.image == image, "{:?}", covered.area);
    session.message(&["[title=\"A game\"]", "focus"]);
    wait("the focus again", || hands.has_focus().unwrap());
    drop(hands);
    // A window that says what it gets.
    let witness = Witness::start(&screen);
    let mut hands = Hands::open(&display, &"spf witness".into()).unwrap();
    wait("the focus of the witness", || hands.activate().unwrap());
    hands.set(w, true).unwrap();
    hands.set(w, false).unwrap();
    witness.waits_for("a key", &[(true, "w"), (false, "w")]);
    session.message(&["[title=\"a program of Wayland\"]", "focus"]);
    wait("no focus", || !hands.has_focus().unwrap());
    assert!(matches!(hands.set(w, true), Err(ScreenError::NoFocus)));
    session.message(&["[title=\"spf witness\"]", "focus"]);
    wait("the focus of the witness again", || hands.has_focus().unwrap());
    hands.set(Key::named("d").unwrap(), true).unwrap();
    drop(hands);
    witness.waits_for("no key without the focus", &[(true, "w"), (false, "w"), (true, "d"), (false, "d")]);
    // What the screen shows is not known.
    let monitor = display.monitors().unwrap().remove(0).name;
    let refused = Eye::new(display, Target::Monitor { name: monitor }).look();
    assert!(matches!(refused, Err(ScreenError::Wayland)), "{refused:?}");
    shop.close();
}
