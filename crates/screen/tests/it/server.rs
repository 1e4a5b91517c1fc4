//! An X server without a screen, under a window manager, and the programs on it; used by tests of other crates as well.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Limit that detects hangs only.
pub(crate) const PATIENCE: Duration = Duration::from_secs(90);
/// What these tests start beside it (Debian's xvfb, openbox, xdotool, x11-utils, x11-xserver-utils, x11-xkb-utils).
const PROGRAMS: [&str; 6] = ["Xvfb", "openbox", "xdotool", "xev", "xrandr", "setxkbmap"];

/// A program that is ended with the test.
pub(crate) struct Program(pub(crate) Child);

impl Drop for Program {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

/// The server, and the programs on it.
pub(crate) struct Server {
    /// Its display, such as `:1`.
    pub(crate) name: String,
    programs: Vec<Program>,
}

impl Drop for Server {
    fn drop(&mut self) {
        // The server last.
        while self.programs.pop().is_some() {}
    }
}

impl Server {
    /// The first of the programs needed, or of `more`, that is missing.
    pub(crate) fn missing<'a>(more: &[&'a str]) -> Option<&'a str> {
        let is_there =
            |name: &str| Command::new("sh").args(["-c", &format!("command -v {name}")]).output().unwrap().status.success();
        PROGRAMS.iter().chain(more).copied().find(|name| !is_there(name))
    }

    /// One that runs already.
    #[allow(dead_code, reason = "of the tests that share this file, some need it")]
    pub(crate) fn of(name: &str) -> Self {
        Self { name: name.to_owned(), programs: Vec::new() }
    }

    /// `size`: width, height and depth of its screen, as `1100x800x24`.
    pub(crate) fn start(size: &str) -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-noreset", "-nolisten", "tcp", "-screen", "0", size])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let mut server = Self { name: format!(":{}", number.trim()), programs: vec![Program(server)] };
        // Windows that are opened before it is ready are not managed.
        let ready = tempfile::tempdir().unwrap();
        let mark = ready.path().join("ready");
        let mut openbox = server.command("openbox", &["--sm-disable", "--startup", &format!("touch {}", mark.display())]);
        server.keep(openbox.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        wait("openbox", || mark.exists());
        server
    }

    /// A program on the display, without the settings of the user's window manager.
    pub(crate) fn command(&self, program: &str, args: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(args).env("DISPLAY", &self.name).env("XDG_CONFIG_HOME", "/nonexistent").stdin(Stdio::null());
        command
    }

    /// Ends it with the server.
    pub(crate) fn keep(&mut self, child: Child) {
        self.programs.push(Program(child));
    }
}

pub(crate) fn wait(what: &str, until: impl FnMut() -> bool) {
    wait_or_say(until, || what.to_owned());
}

/// As [`wait`], with what is said in the end told by what is then known.
pub(crate) fn wait_or_say(mut until: impl FnMut() -> bool, what: impl Fn() -> String) {
    let begun = Instant::now();
    while !until() {
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {}", what());
        std::thread::sleep(Duration::from_millis(10));
    }
}
