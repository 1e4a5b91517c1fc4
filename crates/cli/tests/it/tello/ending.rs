//! However the program ends, the drone is landed: signals, a stuck terminal, a killed process.

use std::io::{BufRead, BufReader, PipeReader, PipeWriter, Read, Write, pipe};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::flights::{Served, model};
use super::fly_command;
use crate::harness::{Lab, Run, rows};
use crate::vlm::KEY;
use crate::vlm::server::Server;
use crate::vlm::vendors::Vendor;

/// The drone lands by itself 15 s after the last command.
const OWN_LANDING: Duration = Duration::from_secs(15);

/// A virtual Tello, and a running flight with it.
struct Flight {
    lab: Lab,
    served: Served,
    _server: Server,
    child: Child,
    stderr: BufReader<PipeReader>,
    /// Another end of the same pipe.
    writer: PipeWriter,
    printed: String,
}

fn command(lab: &Lab, drone: &str, local: &str, server: &Server, out: &str) -> Command {
    fly_command(lab, drone, local, server, out, &["--no-video", "--max-time", "60"])
}

impl Flight {
    /// Starts one and waits until it flies.
    fn start(drone: &str, local: &str) -> Self {
        Self::start_with(drone, local, |_| {})
    }

    /// The same, with an action in its folder during take-off.
    fn start_with(drone: &str, local: &str, meanwhile: impl Fn(&Lab)) -> Self {
        let lab = Lab::new();
        let served = Served::start(&lab, drone, &["--truth", "truth.jsonl", "--instruction", "fly to the door"]);
        let server = model(50);
        let (reader, writer) = pipe().unwrap();
        let child = command(&lab, drone, local, &server, "mine").stderr(writer.try_clone().unwrap()).spawn().unwrap();
        let (stderr, printed) = (BufReader::new(reader), String::new());
        let mut flight = Self { lab, served, _server: server, child, stderr, writer, printed };
        flight.until("taking off");
        meanwhile(&flight.lab);
        flight.until(" flying");
        flight
    }

    fn until(&mut self, words: &str) {
        loop {
            let mut line = String::new();
            assert!(self.stderr.read_line(&mut line).unwrap() > 0, "{}", self.printed);
            self.printed.push_str(&line);
            if line.trim_end().ends_with(words) {
                return;
            }
        }
    }

    fn signal(&self, name: &str) {
        let line = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
    }

    /// How the drone's flight ended, according to the drone, and how long that took.
    fn landed(&self) -> (Value, Duration) {
        let begun = Instant::now();
        loop {
            // Written when the motors stop; read only when its first line is whole.
            let truth = self.lab.path("truth.jsonl");
            if std::fs::read_to_string(&truth).is_ok_and(|text| text.ends_with('\n')) {
                return (rows(&truth)[0]["ended_by"].clone(), begun.elapsed());
            }
            assert!(begun.elapsed() < Duration::from_secs(40), "it still flies: {}", self.printed);
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Exit code, and all output.
    fn end(self) -> (Option<i32>, String) {
        let Self { served, mut child, mut stderr, writer, mut printed, .. } = self;
        drop(writer);
        stderr.read_to_string(&mut printed).unwrap();
        let code = child.wait().unwrap().code();
        served.end();
        (code, printed)
    }
}

#[test]
fn a_signal_lands_the_drone_and_a_second_one_waits_for_it() {
    signals_land_it(60, &[&["TERM"], &["INT", "INT"]]);
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_hang_up_lands_the_drone_and_so_do_two_sigterms() {
    signals_land_it(64, &[&["HUP"], &["TERM", "TERM"]]);
}

fn signals_land_it(first: usize, each: &[&[&str]]) {
    std::thread::scope(|scope| {
        for (n, signals) in each.iter().enumerate() {
            scope.spawn(move || {
                let flight = Flight::start(&format!("127.0.0.{}", first + 2 * n), &format!("127.0.0.{}", first + 1 + 2 * n));
                for signal in *signals {
                    flight.signal(signal);
                    std::thread::sleep(Duration::from_millis(300));
                }
                let (ended_by, took) = flight.landed();
                let (code, printed) = flight.end();
                assert_eq!((ended_by, code), ("landing".into(), Some(5)), "{signals:?}: {printed}");
                // From 0.8 m: not the drone's own landing.
                assert!(took < OWN_LANDING, "{signals:?}: {took:?}");
                assert_eq!(printed.contains("landing the drone; pressing Ctrl-C again"), signals.len() == 2, "{printed}");
            });
        }
    });
}

/// SIGUSR1 and similar signals do not end a flight, and Ctrl-Z does not suspend one.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn signals_that_mean_nothing_here_end_no_flight() {
    let mut flight = Flight::start("127.0.0.76", "127.0.0.77");
    for signal in ["USR1", "USR2", "ALRM", "VTALRM", "PROF", "IO", "TSTP", "TTIN", "TTOU", "XFSZ", "XCPU"] {
        flight.signal(signal);
    }
    flight.until("Ctrl-Z does not suspend a flight; Ctrl-C lands");
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(flight.child.try_wait().unwrap(), None);
    flight.signal("QUIT");
    assert_eq!(flight.landed().0, "landing");
    assert_eq!(flight.end().0, Some(5));
}

/// The process stops for 3 s, as with SIGSTOP or a suspended machine: its knowledge of the craft is outdated.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_stopped_process_is_a_lost_link() {
    let mut flight = Flight::start("127.0.0.78", "127.0.0.79");
    flight.signal("STOP");
    std::thread::sleep(Duration::from_secs(3));
    flight.signal("CONT");
    flight.until("the link counts as lost");
    // It flies on once the link counts as restored, and the driver has not landed it.
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(flight.child.try_wait().unwrap(), None);
    flight.signal("INT");
    let (ended_by, took) = flight.landed();
    assert!(ended_by == "landing" && took < OWN_LANDING, "{ended_by} {took:?}");
    let (code, printed) = flight.end();
    assert_eq!(code, Some(5), "{printed}");
}

/// Opening this file waits for ever, like a stalled disk.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_disk_that_stalls_delays_neither_flight_nor_ctrl_c() {
    let fifo = |lab: &Lab| assert!(Command::new("mkfifo").arg(lab.path("mine/vlm.jsonl")).status().unwrap().success());
    let flight = Flight::start_with("127.0.0.80", "127.0.0.81", fifo);
    std::thread::sleep(Duration::from_secs(3));
    flight.signal("INT");
    let (ended_by, took) = flight.landed();
    assert!(ended_by == "landing" && took < OWN_LANDING, "{ended_by} {took:?}");
    let names = flight.lab.names("mine");
    let (code, printed) = flight.end();
    assert_eq!(code, Some(5), "{printed}");
    assert!(printed.contains("the files were not finished within 15 s: the disk is stalled or too slow"), "{printed}");
    assert!(names.contains(&"decisions.jsonl".to_owned()), "{names:?}");
}

#[test]
fn without_a_terminal_a_real_drone_takes_off_only_unattended() {
    let lab = Lab::new();
    // Nothing has this address: a connection attempt would exit with 6.
    let mut command = lab.command(&["fly", "go", "--drone", "tello@127.0.0.47", "--vlm", "gemini@http://127.0.0.1:9"]);
    let run = Run::of(&command.env(Vendor::Gemini.key(), KEY).output().unwrap());
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("no terminal") && run.stderr.contains("--unattended"), "{}", run.stderr);
    assert_eq!(lab.names("."), Vec::<String>::new(), "nothing is left behind");
}

/// With a terminal the keys work, and at the end of the instruction the drone hovers for a new one.
#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn with_a_terminal_the_keys_land_a_real_drone_and_it_hovers_at_the_end_by_default() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.82", &["--truth", "truth.jsonl", "--instruction", "fly to the door"]);
    let server = model(50);
    let (drone, vlm) = ("tello@127.0.0.82", format!("gemini@{}", server.url()));
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/tello/terminal.py");
    let mut command = Command::new("timeout");
    command.args(["-k", "5", "60", "python3"]).arg(script).arg(env!("CARGO_BIN_EXE_spf"));
    command.args(["fly", "fly to the door", "--drone", drone, "--vlm", &vlm, "--no-vlm-check", "--no-video", "--out", "mine"]);
    command.current_dir(lab.path("")).env(Vendor::Gemini.key(), KEY).env("SPF_TELLO_LOCAL", "127.0.0.83");
    let Ok(output) = command.output() else { return crate::harness::skip("python3") };
    let run = Run::of(&output);
    assert_eq!(run.code, Some(5), "{}", run.stdout);
    for words in ["the drone hovers for up to 60 s and accepts a new instruction", "Keys:"] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
    assert_eq!(rows(&lab.path("truth.jsonl"))[0]["ended_by"], "landing");
    served.end();
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_terminal_that_is_not_read_stops_neither_flight_nor_ctrl_c() {
    let flight = Flight::start("127.0.0.70", "127.0.0.71");
    // From here on standard error is full.
    let mut writer = flight.writer.try_clone().unwrap();
    let filling = std::thread::spawn(move || while writer.write_all(&[b'.'; 4096]).is_ok() {});
    std::thread::sleep(Duration::from_secs(3));
    flight.signal("INT");
    let (ended_by, took) = flight.landed();
    assert_eq!(ended_by, "landing");
    assert!(took < OWN_LANDING, "{took:?}");
    let Flight { mut child, stderr, writer, served, lab, .. } = flight;
    // At the end it waits for a terminal at most a second at a time, and loses no file.
    drop((stderr, writer));
    filling.join().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(5));
    assert!(lab.names("mine").contains(&"summary.json".to_owned()), "{:?}", lab.names("mine"));
    served.end();
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_drone_left_in_the_air_is_flown_on_without_a_take_off() {
    let mut flight = Flight::start("127.0.0.72", "127.0.0.73");
    flight.signal("KILL");
    flight.child.wait().unwrap();
    let server = model(2);
    let mut again = command(&flight.lab, "127.0.0.72", "127.0.0.73", &server, "again");
    let output = again.stderr(Stdio::piped()).output().unwrap();
    let printed = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{printed}");
    assert!(printed.contains(" flying") && !printed.contains("taking off"), "{printed}");
    let (ended_by, _) = flight.landed();
    assert_eq!((ended_by, rows(&flight.lab.path("truth.jsonl")).len()), ("landing".into(), 1));
    flight.served.end();
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn spf_tello_lands_a_drone_whose_program_died() {
    let mut flight = Flight::start("127.0.0.74", "127.0.0.75");
    flight.signal("KILL");
    flight.child.wait().unwrap();
    let tello = |word: &str| {
        let mut command = flight.lab.command(&["tello", word, "--drone", "tello@127.0.0.74"]);
        Run::of(&command.env("SPF_TELLO_LOCAL", "127.0.0.75").output().unwrap())
    };
    let run = tello("status");
    assert!(run.code == Some(0) && run.stdout.starts_with("in the air\n"), "{}{}", run.stdout, run.stderr);
    let run = tello("stop");
    assert!(run.code == Some(0) && run.stdout.starts_with("zero velocity"), "{}{}", run.stdout, run.stderr);
    let run = tello("land");
    assert_eq!((run.code, run.stdout.as_str()), (Some(0), "on the ground, motors off\n"), "{}", run.stderr);
    assert_eq!(flight.landed().0, "landing");
    let run = tello("status");
    assert!(run.stdout.starts_with("on the ground\n"), "{}", run.stdout);
    flight.served.end();
}
