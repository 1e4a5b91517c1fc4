//! Writes the out folder of a flight: `decisions.jsonl`, `video.mp4`, `trajectory.svg`, `summary.json`.
//!
//! A flight goes on when recording cannot: the first failure of each file is kept and told at the end.

use serde::Serialize;
use spf_core::geometry::EnuPosition;
use spf_core::pilot::{Action, Decision, Note, Phase, Pilot};
use spf_core::time::Time;
use spf_record::jsonl::JsonLines;
use spf_record::out_dir::OutDir;
use spf_record::trajectory::{DecisionMark, Outline, TrajectoryInput, trajectory_svg};
use spf_sim::actors::ActorPlace;

use crate::film::Film;
use crate::run::Observer;
use crate::sim::{SimWorld, Stage};
use crate::summary::Summary;
use crate::words;

/// A decision as a row of `decisions.jsonl`.
#[derive(Serialize)]
struct Row<'a> {
    #[serde(flatten)]
    decision: &'a Decision,
    /// Flown since take-off, as known, metres.
    flown_m: f64,
}

/// Watches a flight and writes its files.
pub struct Recorder {
    out: OutDir,
    world: SimWorld,
    decisions: Option<JsonLines>,
    film: Option<Film>,
    path: Vec<(Time, EnuPosition)>,
    known_path: Vec<(Time, EnuPosition)>,
    marks: Vec<DecisionMark>,
    flown: f64,
    last_known: Option<EnuPosition>,
    problems: Vec<String>,
}

/// The path in the picture has a point this often.
const PATH_STEP_S: f64 = 0.1;

impl Recorder {
    /// Opens the files in a folder. `title` heads the video; `live` tells that the flight is on the wall clock.
    #[must_use]
    pub fn new(out: OutDir, video: bool, title: &str, world: SimWorld, live: bool) -> Self {
        let mut problems = Vec::new();
        let decisions = kept(&mut problems, JsonLines::create(&out.file("decisions.jsonl")));
        let film = video
            .then(|| Film::start(&out.file("video.mp4"), world.clone(), title, live))
            .and_then(|film| kept(&mut problems, film));
        Self {
            out,
            world,
            decisions,
            film,
            path: Vec::new(),
            known_path: Vec::new(),
            marks: Vec::new(),
            flown: 0.0,
            last_known: None,
            problems,
        }
    }

    fn decided(&mut self, decision: &Decision) {
        if let Some(rows) = &mut self.decisions
            && let Err(error) = rows.push(&Row { decision, flown_m: self.flown })
        {
            self.problems.push(in_full(&error));
            self.decisions = None;
        }
        self.marks.push(DecisionMark {
            time: decision.answered,
            position: decision.pose.position,
            waypoint: decision.goal.map(|goal| goal.position),
            label: words::decision(decision),
        });
    }

    /// Closes the files and writes the summary; what could not be written is returned.
    #[must_use]
    pub fn finish(mut self, summary: &Summary) -> Vec<String> {
        if let Some(film) = self.film.take() {
            kept(&mut self.problems, film.finish());
        }
        let (stage, actors) = (self.world.stage(), self.world.now().actors);
        let picture = trajectory_svg(&TrajectoryInput {
            title: summary.instruction.clone(),
            outcome: headline(summary),
            outlines: outlines(stage, &actors),
            path: core::mem::take(&mut self.path),
            known_path: core::mem::take(&mut self.known_path),
            decisions: core::mem::take(&mut self.marks),
            target: summary.targets.first().and_then(|key| centre(stage, &actors, key)),
        });
        kept(&mut self.problems, self.out.write("trajectory.svg", picture.as_bytes()));
        kept(&mut self.problems, self.out.write_summary(summary));
        self.problems
    }
}

/// The value, or a note of why there is none.
fn kept<T, E: std::error::Error>(problems: &mut Vec<String>, result: Result<T, E>) -> Option<T> {
    result.map_err(|error| problems.push(in_full(&error))).ok()
}

/// An error with its causes on one line.
fn in_full(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(&format!(": {cause}"));
        source = cause.source();
    }
    text
}

/// The line below the picture's title.
fn headline(summary: &Summary) -> String {
    let time = summary.completion_time_s.map_or(String::new(), |time| format!(", {time:.1} s"));
    let distance = summary.final_distance_m.map_or(String::new(), |metres| format!(", {metres:.1} m from the target"));
    let (outcome, flown) = (words::outcome(summary.outcome), summary.path_length_m);
    format!("{outcome}{time}, {flown:.1} m flown, {} decisions{distance}", summary.decisions)
}

/// The scene seen from above with the actors at these places, lowest things first.
fn outlines(stage: &Stage, actors: &[ActorPlace]) -> Vec<Outline> {
    let mut objects: Vec<_> = stage.scene.objects.iter().filter(|object| !object.opening && !object.outline.is_empty()).collect();
    objects.sort_by(|a, b| a.bounds.max.up.total_cmp(&b.bounds.max.up).then(a.id.cmp(&b.id)));
    let outline = |object: &&spf_sim::scene::Object| Outline {
        name: object.key.clone(),
        colour: colour(&object.tags),
        polygons: stage.outline(object, actors),
    };
    objects.iter().map(outline).collect()
}

fn centre(stage: &Stage, actors: &[ActorPlace], key: &str) -> Option<EnuPosition> {
    let bounds = stage.bounds(stage.scene.by_key(key)?, actors);
    let middle = |low: f64, high: f64| 0.5 * (low + high);
    Some(EnuPosition {
        east: middle(bounds.min.east, bounds.max.east),
        north: middle(bounds.min.north, bounds.max.north),
        up: middle(bounds.min.up, bounds.max.up),
    })
}

/// A colour on the map: ground by what it is, everything else by its colour in words.
fn colour(tags: &spf_sim::scene::Tags) -> [u8; 3] {
    let named = |words: &[&str]| words.iter().any(|word| tags.names.iter().chain(&tags.synonyms).any(|name| name.contains(word)));
    match (tags.kind.as_str(), tags.colour.as_deref()) {
        ("water", _) => [170, 205, 230],
        ("tree", _) => [130, 180, 110],
        ("ground", _) if named(&["road", "street", "avenue", "junction", "car park"]) => [204, 204, 208],
        ("ground", _) if named(&["crossing"]) => [236, 236, 236],
        ("ground", _) if named(&["grass", "lawn", "park", "meadow", "hill"]) => [216, 230, 202],
        ("ground", _) => [232, 228, 218],
        (_, Some(word)) if word.contains("red") => [205, 70, 60],
        (_, Some(word)) if word.contains("yellow") => [230, 190, 60],
        (_, Some(word)) if word.contains("green") => [110, 160, 90],
        (_, Some(word)) if word.contains("blue") => [90, 130, 200],
        (_, Some(word)) if word.contains("black") => [60, 60, 64],
        (_, Some(word)) if word.contains("white") => [246, 246, 246],
        (_, Some(word)) if word.contains("brown") || word.contains("orange") || word.contains("beige") => [190, 150, 110],
        _ => [190, 186, 180],
    }
}

impl Observer for Recorder {
    fn action(&mut self, now: Time, action: &Action, _pilot: &Pilot) {
        if let Action::Note(Note::Decision(decision)) = action {
            self.decided(decision);
        }
        if let Some(film) = &mut self.film {
            film.note(now, action);
        }
    }

    fn time(&mut self, now: Time, pilot: &Pilot) {
        let known = pilot.known_pose(now);
        if pilot.phase() != Phase::Ground {
            if let Some(last) = self.last_known {
                self.flown += last.distance(known.position);
            }
            self.last_known = Some(known.position);
        }
        let due = self.path.last().is_none_or(|(at, _)| now.since(*at).as_secs_f64() >= PATH_STEP_S);
        if due {
            self.path.push((now, self.world.truth().pose.position));
            self.known_path.push((now, known.position));
        }
        if let Some(film) = &mut self.film
            && !film.advance(now, pilot)
        {
            // Disk full, most often: the flight goes on without its film, and says so at the end.
            kept(&mut self.problems, self.film.take().map_or(Ok(()), Film::finish));
        }
    }
}
