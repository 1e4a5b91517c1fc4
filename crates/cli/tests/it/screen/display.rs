//! A display with a window manager, and `spf sim window` on it.

use std::fs::File;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use x11rb::protocol::xproto::ConnectionExt as _;

use super::server::Server;
pub(super) use super::server::{PATIENCE, wait};
use crate::harness::{Lab, skip};

/// A display, and the programs on it.
pub(super) struct Screen {
    server: Server,
    pub(super) lab: Lab,
}

impl Screen {
    /// `None`, with a notice, if a program is missing.
    pub(super) fn start(more: &[&str]) -> Option<Self> {
        if let Some(missing) = Server::missing(more) {
            skip(missing);
            return None;
        }
        Some(Self { server: Server::start("1100x800x24"), lab: Lab::new() })
    }

    /// Runs a program on the display; what it printed.
    pub(super) fn run(&self, program: &str, args: &[&str]) -> String {
        let output = self.server.command(program, args).output().unwrap();
        assert!(output.status.success(), "{program} {args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// `spf` on the display.
    pub(super) fn spf(&self, args: &[&str]) -> Command {
        let mut command = self.lab.command(args);
        command.env("DISPLAY", &self.server.name);
        command
    }

    pub(super) fn output(&self, args: &[&str]) -> Output {
        self.spf(args).output().unwrap()
    }

    /// A window of xev with this title, which takes the focus, and prints the keys that it gets to the file `TITLE.txt` in the lab.
    pub(super) fn xev(&mut self, title: &str, geometry: &str) -> String {
        let said = File::create(self.lab.path(&format!("{title}.txt"))).unwrap();
        let args = ["-oL", "xev", "-name", title, "-geometry", geometry, "-event", "keyboard"];
        let child = self.server.command("stdbuf", &args).stdout(said).stderr(Stdio::null()).spawn().unwrap();
        self.server.keep(child);
        self.window(title)
    }

    /// How many keys were typed into a window of xev.
    pub(super) fn typed(&self, title: &str) -> usize {
        let said = self.lab.read(&format!("{title}.txt"));
        String::from_utf8_lossy(&said).lines().filter(|line| line.starts_with("KeyPress event")).count()
    }

    /// The codes of the keys that are down, by the server.
    pub(super) fn keys_down(&self) -> Vec<usize> {
        let (connection, _) = x11rb::connect(Some(&self.server.name)).unwrap();
        let keys = connection.query_keymap().unwrap().reply().unwrap().keys;
        (0..8 * keys.len()).filter(|code| keys[code / 8] >> (code % 8) & 1 == 1).collect()
    }

    /// The number of the window with a title.
    pub(super) fn window(&self, title: &str) -> String {
        let found = || {
            let output = self.server.command("xdotool", &["search", "--onlyvisible", "--name", title]).output();
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
        let process = child.id();
        self.server.keep(child);
        let window = self.window("spf sim window");
        Game { window, process, truth }
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
    pub(super) process: u32,
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
