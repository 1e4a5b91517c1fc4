//! Flights whose numbers must not change while the code that makes them is rearranged: every command, the point and the motion of
//! every decision, the outcome and the place where it was reached. Names of fields, settings and topics are no part of it.
//!
//! ```text
//! cargo test -p spf-bench --test all -- --ignored pins            # all of them, against pins.tsv
//! SPF_PINS=renew cargo test -p spf-bench --test all -- --ignored pins   # writes pins.tsv anew
//! ```
//!
//! A change of a row changes published results, so it needs a measurement of that method before and after.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;
use spf_bench::task::shipped;
use spf_bench::trial::{Method, Networks, Trial, VlmUnderTest, draw};
use spf_core::command::{Command, Manoeuvre};
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_flight::run::Observer;
use spf_flight::sim::oracle_factory;
use spf_oracle::ErrorFile;
use spf_pilot::{Action, Decision, Note, Pilot};

/// What is flown: between two answers by nothing, by boxes (and a tracker where somebody is followed), and by measured depth; in
/// both sets, to things that are tall, low, far, walk, and follow one another.
const METHODS: [&str; 4] = ["spf", "spf-paper", "spf-default", "spf-depth"];
const TASKS: [&str; 6] = [
    "sim-obstacle-white-needle",
    "real-obstacle-cone",
    "sim-long-gates",
    "real-follow-green-shirt",
    "hard-clutter-armchair",
    "hard-moving-walker",
];
const SEEDS: [u64; 2] = [0, 1];
const HEAD: &str = "method\ttask\tseed\tcommands\tdecisions\toutcome\tdigest";

/// Takes the numbers of a flight.
struct Numbers {
    digest: u64,
    commands: u32,
    decisions: u32,
    outcome: String,
}

impl Numbers {
    fn new() -> Self {
        Self { digest: 0xcbf2_9ce4_8422_2325, commands: 0, decisions: 0, outcome: "none".to_owned() }
    }

    /// FNV-1a, 64 bits.
    fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.digest = (self.digest ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn all<const N: usize>(&mut self, values: [f64; N]) {
        for value in values {
            // One zero.
            self.take(&(value + 0.0).to_bits().to_le_bytes());
        }
    }

    fn time(&mut self, time: Time) {
        self.all([time.as_secs_f64()]);
    }

    fn pose(&mut self, pose: Pose) {
        let (at, turned) = (pose.position, pose.attitude);
        self.all([at.east, at.north, at.up, turned.heading, turned.pitch, turned.roll]);
    }

    fn command(&mut self, command: Command) {
        self.commands += 1;
        match command {
            Command::TakeOff => self.take(b"take off"),
            Command::Setpoint(to) => self.all([to.right, to.forward, to.up, to.yaw_rate]),
            Command::Manoeuvre(Manoeuvre::Turn { angle }) => self.all([angle]),
            Command::Manoeuvre(Manoeuvre::Go { displacement: to, speed }) => self.all([to.right, to.forward, to.up, speed]),
            Command::Land => self.take(b"land"),
            Command::Return => self.take(b"return"),
            Command::Tilt(angle) => self.all([angle]),
            Command::EmergencyStop => self.take(b"stop"),
        }
    }

    fn decision(&mut self, decision: &Decision) {
        self.decisions += 1;
        self.time(decision.captured);
        self.pose(decision.pose);
        let reading = &decision.reading;
        for point in [reading.reply.as_ref().and_then(|reply| reply.point), reading.waypoint].into_iter().flatten() {
            self.all([point.u, point.v]);
        }
        if let Some(step) = reading.step {
            self.all([step]);
        }
        if let Some(to) = reading.displacement {
            self.all([to.right, to.forward, to.up]);
        }
        if let Some(motion) = reading.primitives {
            self.all([motion.yaw, motion.forward, motion.right, motion.climb]);
        }
        if let Some(goal) = decision.goal {
            self.pose(goal);
        }
        self.take(&[u8::from(decision.passed)]);
    }
}

impl Observer for Numbers {
    fn action(&mut self, now: Time, action: &Action, _: &Pilot) {
        match action {
            Action::Command(cleared) => {
                self.time(now);
                self.command(*cleared.get());
            }
            Action::Note(Note::Decision(decision)) => {
                self.time(now);
                self.decision(decision);
            }
            Action::Finished(ending) => {
                self.time(now);
                self.outcome = format!("{:?}", ending.outcome).to_lowercase();
            }
            _ => {}
        }
    }
}

/// Flies one, and returns its row.
fn row(method: &str, task: &str, seed: u64) -> String {
    let drawn = shipped(task).unwrap().unwrap();
    let name = "oracle:default".to_owned();
    let vlm_factory = oracle_factory(name.clone(), ErrorFile::named("default").unwrap());
    let pointer = Some(VlmUnderTest { vlm_factory, name, latency: None });
    let trial = Trial {
        task: Arc::new(drawn),
        method: Method::of_name(method).unwrap(),
        pointer,
        seed,
        max_cost_usd: None,
        networks: Networks::default(),
    };
    let mut numbers = Numbers::new();
    let flown = trial.fly_observed(&draw(&trial.task, seed).unwrap(), None, &mut [&mut numbers]);
    assert_eq!(flown.record.error, None, "{method} {task} {seed}");
    // Where the judge saw it.
    let flight = flown.record.flight.unwrap();
    numbers.all([flight.final_distance_m.unwrap_or(-1.0), f64::from(u8::from(flown.record.scores.collided))]);
    for place in flown.path.places {
        numbers.all(place);
    }
    let Numbers { digest, commands, decisions, outcome } = numbers;
    format!("{method}\t{task}\t{seed}\t{commands}\t{decisions}\t{outcome}\t{digest:016x}")
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/all/pins.tsv")
}

/// Flies some of them, and returns their rows in the order of the file.
fn rows(fly: impl Fn(usize) -> bool + Sync) -> Vec<String> {
    let methods = METHODS.iter().flat_map(|method| TASKS.iter().map(move |task| (*method, *task)));
    let all: Vec<_> = methods.flat_map(|(method, task)| SEEDS.map(|seed| (method, task, seed))).collect();
    let flown = all.into_par_iter().enumerate().filter(|(at, _)| fly(*at));
    flown.map(|(_, (method, task, seed))| row(method, task, seed)).collect()
}

/// The rows that differ from those of the file, each with what the file says.
fn differences(flown: &[String]) -> Vec<String> {
    let pinned = std::fs::read_to_string(file()).unwrap_or_default();
    let unknown = |row: &&String| !pinned.lines().any(|line| line == row.as_str());
    let named = |row: &String| {
        let key: Vec<&str> = row.split('\t').take(3).collect();
        let was = pinned.lines().find(|line| line.split('\t').take(3).eq(key.iter().copied()));
        format!("was: {}\nis:  {row}", was.unwrap_or("not pinned"))
    };
    flown.iter().filter(unknown).map(named).collect()
}

#[test]
fn a_tenth_of_the_pinned_flights_is_the_same_as_before() {
    // The shortest of each method, one of them with a person to follow, by their place in the file.
    let different = differences(&rows(|at| [6, 20, 27, 32, 44, 51].contains(&at)));
    assert!(different.is_empty(), "{}", different.join("\n"));
}

#[test]
#[ignore = "flies 48 flights: see the head of the file"]
fn all_pinned_flights_are_the_same_as_before() {
    let flown = rows(|_| true);
    if std::env::var_os("SPF_PINS").is_some_and(|what| what == "renew") {
        println!("{} rows differ", differences(&flown).len());
        std::fs::write(file(), format!("{HEAD}\n{}\n", flown.join("\n"))).unwrap();
        return;
    }
    let different = differences(&flown);
    assert!(different.is_empty(), "{} of {} differ\n{}", different.len(), flown.len(), different.join("\n"));
}
