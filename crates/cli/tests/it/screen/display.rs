//! A display with a window manager, and `spf sim window` on it.

use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use x11rb::protocol::xproto::ConnectionExt as _;

use crate::harness::{Lab, skip};

/// Limit that detects hangs only.
pub(super) const PATIENCE: Duration = Duration::from_secs(90);

/// A program that is ended with the test.
pub(super) struct Program(pub(super) Child);

impl Drop for Program {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

/// A display, and the programs on it.
pub(super) struct Screen {
    pub(super) lab: Lab,
    name: String,
    programs: Vec<Program>,
}

impl Drop for Screen {
    fn drop(&mut self) {
        // The server last.
        while self.programs.pop().is_some() {}
    }
}

pub(super) fn wait(what: &str, mut until: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !until() {
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

impl Screen {
    /// `None`, with a notice, if a program is missing.
    pub(super) fn start(more: &[&str]) -> Option<Self> {
        let needed = ["Xvfb", "openbox", "xdotool", "xev", "xrandr", "setxkbmap"];
        for name in needed.iter().chain(more) {
            if !Command::new("sh").args(["-c", &format!("command -v {name}")]).output().is_ok_and(|it| it.status.success()) {
                skip(name);
                return None;
            }
        }
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-noreset", "-nolisten", "tcp", "-screen", "0", "1100x800x24"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let mut screen = Self { lab: Lab::new(), name: format!(":{}", number.trim()), programs: vec![Program(server)] };
        // Windows that are opened before it is ready are not managed.
        let mark = screen.lab.path("ready");
        screen.keep(Command::new("openbox").args(["--sm-disable", "--startup"]).arg(format!("touch {}", mark.display())));
        wait("openbox", || mark.exists());
        Some(screen)
    }

    /// Starts a program on the display.
    pub(super) fn keep(&mut self, command: &mut Command) {
        command.env("DISPLAY", &self.name).env("HOME", self.lab.path(".")).env("XDG_CONFIG_HOME", self.lab.path("."));
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        self.programs.push(Program(child));
    }

    /// Runs a program on the display; what it printed.
    pub(super) fn run(&self, program: &str, args: &[&str]) -> String {
        let output = Command::new(program).args(args).env("DISPLAY", &self.name).output().unwrap();
        assert!(output.status.success(), "{program} {args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// `spf` on the display.
    pub(super) fn spf(&self, args: &[&str]) -> Command {
        let mut command = self.lab.command(args);
        command.env("DISPLAY", &self.name);
        command
    }

    pub(super) fn output(&self, args: &[&str]) -> Output {
        self.spf(args).output().unwrap()
    }

    /// A window of xev with this title, which takes the focus, and prints the keys that it gets to the file `TITLE.txt` in the lab.
    pub(super) fn xev(&mut self, title: &str, geometry: &str) -> String {
        let said = File::create(self.lab.path(&format!("{title}.txt"))).unwrap();
        let mut xev = Command::new("stdbuf");
        xev.args(["-oL", "xev", "-name", title, "-geometry", geometry, "-event", "keyboard"]).env("DISPLAY", &self.name);
        let child = xev.stdin(Stdio::null()).stdout(said).stderr(Stdio::null()).spawn().unwrap();
        self.programs.push(Program(child));
        self.window(title)
    }

    /// How many keys were typed into a window of xev.
    pub(super) fn typed(&self, title: &str) -> usize {
        let said = self.lab.read(&format!("{title}.txt"));
        String::from_utf8_lossy(&said).lines().filter(|line| line.starts_with("KeyPress event")).count()
    }

    /// The codes of the keys that are down, by the server.
    pub(super) fn keys_down(&self) -> Vec<usize> {
        let (connection, _) = x11rb::connect(Some(&self.name)).unwrap();
        let keys = connection.query_keymap().unwrap().reply().unwrap().keys;
        (0..8 * keys.len()).filter(|code| keys[code / 8] >> (code % 8) & 1 == 1).collect()
    }

    /// The number of the window with a title.
    pub(super) fn window(&self, title: &str) -> String {
        let found = || {
            let output =
                Command::new("xdotool").args(["search", "--onlyvisible", "--name", title]).env("DISPLAY", &self.name).output();
            String::from_utf8(output.unwrap().stdout).unwrap().lines().next().map(str::to_owned)
        };
        wait(title, || found().is_some());
        found().unwrap()
    }

    /// `spf sim window` with the city, with its truth.
    pub(super) fn game(&mut self) -> Game {
        let truth = self.lab.path("truth.tsv");
        let args = ["sim", "window", "city", "--size", "480x360", "--fps", "15", "--truth", "truth.tsv"];
        let child = self.spf(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        self.programs.push(Program(child));
        let window = self.window("spf sim window");
        Game { window, truth }
    }

    /// `spf fly` through the window, by the program that points at colours.
    pub(super) fn fly(&self, python: &std::path::Path, more: &[&str]) -> Command {
        let blob = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/exec_blob.py");
        let vlm = format!("exec:{} {}", python.display(), blob.display());
        let mut args = vec!["fly", "fly to the red crane", "--drone", "screen:spf-window", "--vlm", &vlm, "--no-vlm-check"];
        args.extend(["--unattended", "--at-end", "land", "--no-video", "--json", "--out", "flight"]);
        args.extend(more);
        self.spf(&args)
    }
}

/// The simulator in its window.
pub(super) struct Game {
    pub(super) window: String,
    truth: PathBuf,
}

/// A true pose: seconds, east, north, up, heading in degrees.
pub(super) type Truth = [f64; 5];

impl Game {
    pub(super) fn truth(&self) -> Vec<Truth> {
        let text = std::fs::read_to_string(&self.truth).unwrap_or_default();
        let rows = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        rows.map(|line| {
            let numbers: Vec<f64> = line.trim().split('\t').map(|number| number.parse().unwrap()).collect();
            numbers[..5].try_into().unwrap()
        })
        .collect()
    }

    /// Metres moved within the last seconds of the truth.
    pub(super) fn moved_lately(&self, seconds: f64) -> f64 {
        let truth = self.truth();
        let Some(last) = truth.last() else { return f64::INFINITY };
        let before = truth.iter().rev().find(|row| row[0] <= last[0] - seconds).unwrap_or(&truth[0]);
        distance(before, last)
    }

    /// Waits until it flies level and fast.
    pub(super) fn flies(&self) {
        wait("the flight", || self.moved_lately(1.0) > 0.8 && self.truth().last().is_some_and(|row| row[3] > 2.5));
        // Past the climb of the take-off.
        wait("its way", || {
            let truth = self.truth();
            let (first, last) = (truth[0], truth[truth.len() - 1]);
            (last[1] - first[1]).hypot(last[2] - first[2]) > 3.0
        });
    }

    /// Waits until it rests, and that it stays so for a second.
    pub(super) fn rests(&self) {
        wait("its rest", || self.moved_lately(1.0) < 0.15);
    }
}

fn distance(a: &Truth, b: &Truth) -> f64 {
    (1..4).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}
