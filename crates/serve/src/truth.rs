//! Evaluates the flights of a served drone by ground truth, with the last instruction known: one line of JSON each.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

use serde::Serialize;
use spf_core::geometry::Pose;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_flight::sim::{SimWorld, Verdict, judge};

/// Evaluation interval.
const LOOK: Duration = Duration::from_millis(20);

/// The instruction by which flights are judged, set by the VLM endpoint or the command line.
pub type SharedInstruction = Arc<Mutex<Option<String>>>;

/// Judges a world's flights until it is dropped.
pub(crate) struct Judge {
    stopped: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Judge {
    /// Starts a judging thread. If `file` is given, the results are written to it.
    ///
    /// # Errors
    /// The operating system's error if the thread cannot be started.
    pub(crate) fn start(world: SimWorld, instruction: SharedInstruction, file: Option<File>) -> std::io::Result<Self> {
        let stopped = Arc::new(AtomicBool::new(false));
        let judging = Judging { world, instruction, file, flights: 0, flight: None };
        let ends = stopped.clone();
        let thread = Builder::new().name("judge".to_owned()).spawn(move || judging.run(&ends))?;
        Ok(Self { stopped, thread: Some(thread) })
    }
}

impl Drop for Judge {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        drop(self.thread.take().map(JoinHandle::join));
    }
}

/// A flight in progress.
struct Flight {
    began: Time,
    start: Pose,
    path_length: f64,
    collisions: usize,
}

/// Ground truth of a flight at the start of its landing.
#[derive(Debug, Serialize)]
struct Line<'a> {
    flight: u32,
    instruction: Option<&'a str>,
    #[serde(flatten)]
    verdict: Verdict,
    collisions: usize,
    touched: Vec<String>,
    path_length_m: f64,
    took_off_at_s: f64,
    ended_at_s: f64,
    ended_by: &'static str,
}

struct Judging {
    world: SimWorld,
    instruction: SharedInstruction,
    file: Option<File>,
    flights: u32,
    flight: Option<Flight>,
}

impl Judging {
    fn run(mut self, stopped: &AtomicBool) {
        while !stopped.load(Ordering::Relaxed) {
            self.look(false);
            std::thread::sleep(LOOK);
        }
        self.look(true);
    }

    fn look(&mut self, shut_down: bool) {
        let truth = self.world.truth();
        let ended_by = match truth.phase {
            FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Manoeuvring if shut_down => "shutdown",
            FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Manoeuvring => {
                self.flight.get_or_insert(Flight {
                    began: truth.time,
                    start: truth.pose,
                    path_length: truth.path_length,
                    collisions: truth.collided_with.len(),
                });
                return;
            }
            FlightPhase::Stopped if truth.collided_with.is_empty() => "motors_cut",
            FlightPhase::Stopped => "crash",
            FlightPhase::Landing | FlightPhase::OnGround => "landing",
        };
        let Some(flight) = self.flight.take() else { return };
        self.flights += 1;
        let instruction = self.instruction.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let verdict = instruction.as_deref().map_or_else(Verdict::default, |text| judge(&self.world, text, &flight.start));
        let hits = truth.collided_with.get(flight.collisions..).unwrap_or_default();
        let line = Line {
            flight: self.flights,
            instruction: instruction.as_deref(),
            verdict,
            collisions: hits.len(),
            touched: hits.iter().map(|(_, id)| self.world.loaded().key(*id)).collect(),
            path_length_m: truth.path_length - flight.path_length,
            took_off_at_s: flight.began.as_secs_f64(),
            ended_at_s: truth.time.as_secs_f64(),
            ended_by,
        };
        self.write(&line);
    }

    fn write(&mut self, line: &Line<'_>) {
        let Some(file) = &mut self.file else { return };
        let written = serde_json::to_string(line).map_err(std::io::Error::from).and_then(|text| writeln!(file, "{text}"));
        if let Err(error) = written {
            tracing::warn!(%error, "cannot write the ground truth of a flight");
        }
    }
}

/// Opens a results file for appending.
///
/// # Errors
/// The operating system's error if it cannot be opened.
pub fn truth_file(path: &Path) -> std::io::Result<File> {
    File::options().create(true).append(true).open(path)
}
