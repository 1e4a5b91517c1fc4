//! One cell: a flight in processes of its own, a fault in one of its phases, and what came of it.

use std::fs;
use std::io::{BufRead, BufReader, PipeReader, PipeWriter, Write, pipe};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::tap::{Tap, moves};
use super::{Fault, Phase};
use crate::harness::{Lab, rows};
use crate::tello::flights::Served;
use crate::tello::fly_command;
use crate::vlm::server::Server;
use crate::vlm::vendors::Vendor;

/// When the operator of the phases `manual` and `landing` acts, s of flight time.
const OPERATOR_AT: f64 = 9.0;
/// A fault that does not end the flight is followed by an operator's Ctrl-C after this time.
const CTRL_C_AFTER: Duration = Duration::from_secs(2);
/// Whatever is waited for, this is too long.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often a flight is begun that ends before its phase.
const ATTEMPTS: u32 = 3;

const CIRCLE: &str =
    r#"{"status":"navigating","look":null,"stage":1,"point":[480,700],"depth":2,"target":"the door","boxes":[]}"#;
const SEARCH: &str =
    r#"{"status":"not_visible","look":"right","stage":1,"point":null,"depth":null,"target":"the door","boxes":[]}"#;

/// What came of a cell.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    /// The last motion said to the craft after its reason had ended, s after that; 0 without one.
    pub(super) last_motion: f64,
    /// Exit code; `None` if a signal ended the process.
    pub(super) exit: Option<i32>,
    /// How the craft's flight ended, by its own account.
    pub(super) ended_by: String,
    /// The last command of flight said to the craft.
    pub(super) told_last: String,
    /// Whole rows of decisions.jsonl, and decisions shown before the end.
    pub(super) rows: usize,
    pub(super) shown: usize,
    /// Whether flight.mcap opened whole, or was repaired first.
    pub(super) repaired: bool,
    /// All that was printed.
    pub(super) printed: String,
}

/// Standard error of the flight, read by a thread, as far as it is to be read.
struct Printed {
    lines: Arc<Mutex<String>>,
    /// Nothing more is read.
    stalled: Arc<AtomicBool>,
    /// The reading end is to be closed.
    closed: Arc<AtomicBool>,
    writer: PipeWriter,
}

impl Printed {
    fn start(reader: PipeReader, writer: PipeWriter) -> Self {
        let printed = Self { lines: Arc::default(), stalled: Arc::default(), closed: Arc::default(), writer };
        let (lines, stalled, closed) = (printed.lines.clone(), printed.stalled.clone(), printed.closed.clone());
        std::thread::spawn(move || {
            let mut reader = BufReader::new(reader);
            let mut line = String::new();
            while !stalled.load(Ordering::Relaxed) && reader.read_line(&mut line).is_ok_and(|length| length > 0) {
                lines.lock().unwrap().push_str(&line);
                line.clear();
            }
            while stalled.load(Ordering::Relaxed) && !closed.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        printed
    }

    fn text(&self) -> String {
        self.lines.lock().unwrap().clone()
    }

    /// Fills the pipe, and leaves it so.
    fn stall(&self) {
        self.stalled.store(true, Ordering::Relaxed);
        let mut writer = self.writer.try_clone().unwrap();
        std::thread::spawn(move || while writer.write_all(&[[b'.'; 1023].as_slice(), b"\n"].concat()).is_ok() {});
    }
}

/// The flight of a cell.
struct Flight {
    // Dropped first, so that a second flight finds the ports free.
    child: Ended,
    lab: Lab,
    served: Served,
    server: Server,
    tap: Tap,
    printed: Printed,
}

/// A process that does not outlive its flight.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// The disk that fails on demand, compiled once.
fn disk() -> &'static Path {
    static DISK: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = DISK.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let (source, library) = (folder.path().join("disk.c"), folder.path().join("disk.so"));
        fs::write(&source, include_str!("disk.c")).unwrap();
        let built = Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]).arg("-ldl").status();
        assert!(built.is_ok_and(|status| status.success()), "a C compiler is needed, as for the program itself");
        (folder, library)
    });
    path
}

impl Flight {
    fn start(fault: Fault, phase: Phase, drone: &str, local: &str) -> Self {
        let lab = Lab::new();
        lab.write("plain.toml", include_str!("plain.toml"));
        let args =
            ["--truth", "truth.jsonl", "--instruction", "fly to the wall", "--scene", "./plain.toml", "--quality", "draft"];
        let served = Served::start(&lab, drone, &args);
        let tap = Tap::start(drone, local);
        let server = Server::start(move |_, request| {
            let model = Vendor::Gemini.model(request);
            // Where nothing is to be flown by it, it thinks.
            let thinks = !matches!(phase, Phase::Executing | Phase::Searching);
            std::thread::sleep(Duration::from_millis(if thinks { 10_000 } else { 300 }));
            Vendor::Gemini.stream(&model, if phase == Phase::Searching { SEARCH } else { CIRCLE })
        });
        lab.write("disk", "");
        let events = match phase {
            Phase::Manual => {
                format!("[[event]]\nat_s = {OPERATOR_AT}\ndo = \"setpoint\"\nyaw_rate_deg_s = 40.0\nup_m_s = 0.1\nfor_s = 30.0\n")
            }
            Phase::Landing => format!("[[event]]\nat_s = {OPERATOR_AT}\ndo = \"land\"\n"),
            _ => String::new(),
        };
        lab.write("events.toml", events);
        let (reader, writer) = pipe().unwrap();
        let more = ["--no-video", "--max-time", "60", "--events", "events.toml"];
        let mut command = fly_command(&lab, &Tap::name(drone), local, &server, "mine", &more);
        if matches!(fault, Fault::StalledDisk | Fault::FullDisk) {
            command.env("LD_PRELOAD", disk()).env("DISK_FAULT", lab.path("disk"));
        }
        command.env("PANIC_OF_FLIGHT_LOOP_ON_SIGUSR2", "1");
        let child = command.stderr(writer.try_clone().unwrap()).spawn().unwrap();
        let printed = Printed::start(reader, writer);
        Self { child: Ended(child), lab, served, server, tap, printed }
    }

    /// Waits until something is so.
    fn until(&mut self, what: &str, mut is: impl FnMut(&mut Self) -> bool) {
        let begun = Instant::now();
        while !is(self) {
            assert!(begun.elapsed() < PATIENCE, "never {what}: {}", self.printed.text());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Whether a phase was reached, and is well under way.
    fn reach(&mut self, phase: Phase) -> bool {
        let begun = Instant::now();
        while !self.is_in(phase) {
            // On a machine too busy to draw the drone's images a flight ends before its phase.
            if begun.elapsed() > PATIENCE || self.child.0.try_wait().unwrap().is_some() {
                return false;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let well_under_way = if phase == Phase::TakeOff { 1000 } else { 300 };
        std::thread::sleep(Duration::from_millis(well_under_way));
        true
    }

    fn is_in(&self, phase: Phase) -> bool {
        let printed = self.printed.text();
        let has_printed = |words: &str| printed.lines().any(|line| line.ends_with(words));
        let said = self.tap.said();
        match phase {
            Phase::TakeOff => has_printed("taking off"),
            Phase::Deciding => !self.server.questions().is_empty(),
            Phase::Executing | Phase::Searching => said.iter().any(|(_, text)| moves(text)),
            Phase::Manual => printed.contains("manual") && said.last().is_some_and(|(_, text)| moves(text)),
            Phase::Landing => said.iter().any(|(_, text)| text == "land"),
        }
    }

    fn signal(&self, name: &str) {
        let line = format!("kill -{name} {}", self.child.0.id());
        assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
    }

    /// Injects the fault. Returns the time at which the reason to move has ended.
    fn inject(&mut self, fault: Fault) -> Instant {
        match fault {
            Fault::Sigterm => self.signal("TERM"),
            Fault::Sigint => self.signal("INT"),
            Fault::Sighup => self.signal("HUP"),
            Fault::Panic => self.signal("USR2"),
            Fault::Sigstop => {
                self.signal("STOP");
                std::thread::sleep(Duration::from_secs(3));
                self.signal("CONT");
            }
            Fault::StalledTerminal => self.printed.stall(),
            Fault::StalledDisk => self.lab.write("disk", "s"),
            Fault::FullDisk => self.lab.write("disk", "f"),
            Fault::CommandsLost => self.tap.lose_commands(),
        }
        let mut ended = Instant::now();
        if fault.needs_ctrl_c() {
            std::thread::sleep(CTRL_C_AFTER);
            ended = Instant::now();
            self.signal("INT");
        }
        ended
    }
}

/// Flies a cell.
pub(super) fn fly(fault: Fault, phase: Phase, drone: &str, local: &str) -> Outcome {
    let mut flight = Flight::start(fault, phase, drone, local);
    let mut attempts = 1;
    while !flight.reach(phase) {
        assert!(attempts < ATTEMPTS, "never {}: {}", phase.name(), flight.printed.text());
        attempts += 1;
        flight = {
            drop(flight);
            Flight::start(fault, phase, drone, local)
        };
    }
    let ended = flight.inject(fault);
    let truth = flight.lab.path("truth.jsonl");
    flight.until("landed", |_| fs::read(&truth).is_ok_and(|text| text.ends_with(b"\n")));
    let ended_by = rows(&truth)[0]["ended_by"].as_str().unwrap().to_owned();
    let printed_until = flight.printed.text();
    if fault == Fault::StalledTerminal {
        flight.printed.closed.store(true, Ordering::Relaxed);
    }
    let mut exit = None;
    flight.until("ended", |flight| {
        exit = flight.child.0.try_wait().unwrap();
        exit.is_some()
    });
    let said = flight.tap.said();
    let after = |(at, text): &&(Instant, String)| *at > ended && moves(text);
    let last_motion = said.iter().rfind(after).map_or(0.0, |(at, _)| at.duration_since(ended).as_secs_f64());
    let is_of_flight = |text: &str| text == "land" || text == "stop" || text == "takeoff" || text.starts_with("rc ");
    let told_last = said.iter().rfind(|(_, text)| is_of_flight(text)).map_or(String::new(), |(_, text)| text.clone());
    let (kept, repaired) = readable(&flight.lab);
    let printed = flight.printed.text();
    let shown = printed_until.lines().filter(|line| is_decision(line)).count();
    flight.served.end();
    Outcome {
        last_motion,
        exit: exit.and_then(|status| status.code()),
        ended_by,
        told_last,
        rows: kept,
        shown,
        repaired,
        printed,
    }
}

/// `  4.1 s   2. the door at (0.70, 0.48) …`.
fn is_decision(line: &str) -> bool {
    let number = line.split_once(" s ").and_then(|(_, rest)| rest.trim_start().split_once(". "));
    number.is_some_and(|(number, _)| number.parse::<u32>().is_ok())
}

/// Number of whole rows of decisions.jsonl; asserts that the log opens, and says whether it had to be repaired.
fn readable(lab: &Lab) -> (usize, bool) {
    let decisions = lab.path("mine/decisions.jsonl");
    let kept = if decisions.exists() { rows(&decisions).len() } else { 0 };
    let info = || {
        let run = lab.spf(&["log", "info", "--json", "mine/flight.mcap"]);
        serde_json::from_str::<Value>(&run.stdout).is_ok_and(|info| info["whole"] == true)
    };
    if info() {
        return (kept, false);
    }
    let run = lab.spf(&["log", "repair", "mine/flight.mcap"]);
    assert_eq!(run.code, Some(0), "the log is lost: {}", run.stderr);
    assert!(info(), "the repaired log does not open");
    (kept, true)
}
