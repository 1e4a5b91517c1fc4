//! Writes the output folder of a flight: `flight.mcap`, `decisions.jsonl`, `queries.jsonl`, `video.mp4`, `trajectory.svg`,
//! `summary.json`.
//!
//! A recording failure does not end the flight: the first failure of each file is kept and reported at the end.

use std::collections::BTreeMap;
use std::sync::Arc;

use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::Time;
use spf_pilot::{Action, Decision, Event, Note, Phase, Pilot};
use spf_record::live::LiveSender;
use spf_record::out_dir::OutDir;
use spf_record::trajectory::{DecisionMark, MarkedPlace, TrajectoryInput, trajectory_svg};

use crate::film::{self, Film};
use crate::frame_source::FrameSource;
use crate::log::{self, FlightHeader, FlightLog};
use crate::odometer::Odometer;
use crate::problems::{Problems, slow};
use crate::rows::RowFiles;
use crate::run::Observer;
use crate::summary::{Summary, in_seconds};
use crate::words;

/// Where and what to record.
#[derive(Clone, Debug)]
pub struct RecordPlan {
    /// The folder.
    pub out: OutDir,
    /// Whether to record a video.
    pub video: bool,
    /// The live view, if any.
    pub view: Option<LiveSender>,
}

/// A place that the operator has marked to keep away from.
#[derive(Clone, Copy, Debug)]
struct Marked {
    /// Its ends, seen from above.
    ends: [EnuPosition; 2],
    from: Time,
    until: Option<Time>,
}

impl Marked {
    fn on_map(self, id: u32) -> MarkedPlace {
        let Self { ends, from, until } = self;
        let until = until.map_or("the end".to_owned(), |until| until.to_string());
        MarkedPlace { number: id + 1, ends, label: format!("keep away {}: from {from} to {until}", id + 1) }
    }
}

/// Observes a flight and writes its files.
pub struct Recorder {
    out: OutDir,
    frame_source: Arc<dyn FrameSource>,
    log: Option<FlightLog>,
    rows: RowFiles,
    film: Option<Film>,
    path: Vec<(Time, EnuPosition)>,
    known_path: Vec<(Time, EnuPosition)>,
    /// True position of the estimate's origin, for a craft whose position is dead-reckoned from its take-off point.
    origin: Option<EnuPosition>,
    marks: Vec<DecisionMark>,
    /// Places that the operator has marked so far, by number.
    marked: BTreeMap<u32, Marked>,
    odometer: Odometer,
    problems: Problems,
    /// Whether a failure of a file has been reported in flight.
    warned: bool,
}

const LOG: &str = "flight.mcap";
const VIDEO: &str = "video.mp4";
const TRAJECTORY: &str = "trajectory.svg";

/// Interval of path points in the trajectory image, seconds.
const PATH_STEP_S: f64 = 0.1;

impl Recorder {
    /// Opens the files in a folder. `live`: the flight is on the wall clock.
    #[must_use]
    pub(crate) fn new(plan: &RecordPlan, head: &FlightHeader, frame_source: Arc<dyn FrameSource>, live: bool) -> Self {
        let RecordPlan { out, video, view } = plan.clone();
        let mut problems = Problems::default();
        let file = problems.kept(LOG, log::open(&out.file(LOG), live));
        let logged = file.is_some() || view.is_some();
        let log = logged.then(|| FlightLog::start(file, view, head, &frame_source.prisms(), frame_source.clone()));
        let rows = RowFiles::create(&out, !live, &mut problems);
        let images = log.as_ref().filter(|_| video).map(|log| log.images(film::SIZE));
        let film = video
            .then(|| Film::start(&out.file(VIDEO), frame_source.clone(), &head.instruction, images, live))
            .and_then(|film| problems.kept(VIDEO, film));
        Self {
            out,
            frame_source,
            log,
            rows,
            film,
            path: Vec::new(),
            known_path: Vec::new(),
            origin: None,
            marks: Vec::new(),
            marked: BTreeMap::new(),
            odometer: Odometer::default(),
            problems,
            warned: false,
        }
    }

    fn decided(&mut self, decision: &Decision) {
        self.rows.push(decision, self.odometer.metres(), &mut self.problems);
        self.marks.push(DecisionMark {
            time: decision.answered,
            position: decision.pose.position,
            waypoint: decision.goal.map(|goal| goal.position),
            label: words::decision(decision),
        });
    }

    /// Remembers the places that the operator has marked, and until when.
    fn mark(&mut self, now: Time, pilot: &Pilot) {
        let places = pilot.kept_out();
        for place in places {
            let [left, _, _, right] = place.panel.corners();
            self.marked.entry(place.id).or_insert(Marked { ends: [left, right], from: now, until: None });
        }
        for (id, marked) in &mut self.marked {
            if marked.until.is_none() && !places.iter().any(|place| place.id == *id) {
                marked.until = Some(now);
            }
        }
    }

    /// Reports the first file that can no longer be written when that happens; the reasons are given at the end.
    fn watch_files(&mut self) {
        if self.warned {
            return;
        }
        let log = self.log.as_ref().is_some_and(FlightLog::has_failed).then_some(LOG);
        let failed = log.or_else(|| self.rows.failed()).map(str::to_owned);
        if let Some(file) = failed.or_else(|| self.problems.files.first().cloned()) {
            tracing::warn!("recording failed: {file} cannot be written (disk full?); the flight goes on");
            self.warned = true;
        }
    }

    /// Closes the files and writes the summary, including the names of files that failed; returns the reasons.
    #[must_use]
    pub fn finish(mut self, summary: &mut Summary) -> Vec<String> {
        if let Some(film) = self.film.take() {
            self.problems.kept(VIDEO, film.finish());
        }
        self.rows.finish(&mut self.problems);
        if let Some(origin) = self.origin {
            // The map is that of the scene.
            let move_by = |at: &mut EnuPosition| {
                (at.east, at.north, at.up) = (at.east + origin.east, at.north + origin.north, at.up + origin.up);
            };
            self.known_path.iter_mut().for_each(|(_, at)| move_by(at));
            for mark in &mut self.marks {
                move_by(&mut mark.position);
                mark.waypoint.iter_mut().for_each(move_by);
            }
            self.marked.values_mut().flat_map(|marked| &mut marked.ends).for_each(move_by);
        }
        let (outlines, target) = self.frame_source.map(&summary.targets);
        let image = trajectory_svg(&TrajectoryInput {
            title: summary.title(),
            outcome: headline(summary),
            outlines,
            path: core::mem::take(&mut self.path),
            known_path: core::mem::take(&mut self.known_path),
            decisions: core::mem::take(&mut self.marks),
            target,
            marked: core::mem::take(&mut self.marked).into_iter().map(|(id, marked)| marked.on_map(id)).collect(),
        });
        self.problems.kept(TRAJECTORY, self.out.write(TRAJECTORY, image.as_bytes()));
        summary.not_recorded.clone_from(&self.problems.files);
        // The log comes second to last: it contains the summary.
        if let Some(log) = self.log.take() {
            match self.problems.kept(LOG, log.finish(summary)) {
                Some(0) | None => {}
                Some(lost) => self.problems.note(LOG, slow(lost, "messages", "the flight log")),
            }
            summary.not_recorded.clone_from(&self.problems.files);
        }
        self.problems.kept("summary.json", self.out.write_summary(&in_seconds(summary)));
        self.problems.reasons
    }
}

/// The line below the title of the trajectory image.
fn headline(summary: &Summary) -> String {
    let time = summary.completion_time_s.map_or(String::new(), |time| format!(", {time:.1} s"));
    let distance = summary.final_distance_m.map_or(String::new(), |metres| format!(", {metres:.1} m from the target's surface"));
    let (outcome, flown) = (words::outcome(summary.outcome), summary.path_length_m);
    format!("{outcome}{time}, {flown:.1} m flown, {} decisions{distance}", summary.decisions)
}

impl Observer for Recorder {
    fn event(&mut self, now: Time, event: &Event) {
        if let Some(log) = &mut self.log {
            log.event(now, event);
        }
        if let (Some(film), Event::Depth(grid)) = (&mut self.film, event) {
            film.depth(now, grid);
        }
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        if let Some(log) = &mut self.log {
            log.action(now, action, pilot);
        }
        if let Action::Note(Note::Decision(decision)) = action {
            self.decided(decision);
        }
        if let Some(film) = &mut self.film {
            film.note(now, action);
        }
    }

    fn time(&mut self, now: Time, pilot: &Pilot) {
        if let Some(log) = &mut self.log {
            log.time(now, pilot);
        }
        let known = pilot.known_pose(now);
        // On the ground the first telemetry may come with the command to take off.
        let begins = pilot.phase() == Phase::Ground || pilot.phase() == Phase::TakeOff && self.origin.is_none();
        if begins && pilot.is_dead_reckoned() {
            let place = |pose: Pose| EnuPosition {
                east: pose.position.east - known.position.east,
                north: pose.position.north - known.position.north,
                up: pose.position.up - known.position.up,
            };
            self.origin = self.frame_source.true_pose().map(place).or(self.origin);
        }
        self.odometer.tick(now, pilot);
        self.mark(now, pilot);
        let due = self.path.last().is_none_or(|(at, _)| now.since(*at).as_secs_f64() >= PATH_STEP_S);
        if due {
            // Without ground truth, the path uses the estimated pose.
            let at = self.frame_source.true_pose().map_or(known.position, |pose| pose.position);
            self.path.push((now, at));
            self.known_path.push((now, known.position));
        }
        if let Some(film) = &mut self.film
            && !film.advance(now, pilot)
        {
            // Usually a full disk: the flight continues without its video.
            self.problems.kept(VIDEO, self.film.take().map_or(Ok(()), Film::finish));
        }
        self.watch_files();
    }
}
