//! Tasks of other people's benchmarks: flown in their simulator, judged by a place instead of an object
//! (docs/guide/bench.md, "Other people's tasks").

use serde::{Deserialize, Serialize};
use spf_core::geometry::{EnuPosition, Pose};
use toml::Spanned;

use super::TaskError;
use super::file::{FORMAT, Source, numbers, pose};
use crate::measures::{Course, GoalDistance, Navigation, length, spread};

/// Maximum number of wordings of a task.
pub const MOST_WORDINGS: usize = 16;
/// Maximum length of an instruction, characters.
pub const LONGEST_INSTRUCTION: usize = 5000;
/// Maximum number of corners of a reference path.
pub const MOST_CORNERS: usize = 4000;
/// Maximum length of a reference path, metres.
pub const MOST_METRES: f64 = 20_000.0;
/// Maximum success radius, metres.
const MOST_RADIUS: f64 = 1000.0;

/// Benchmarks whose tasks can be imported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Benchmark {
    /// AerialVLN (Liu et al., ICCV 2023, arXiv 2308.06735), whose scenes are programs with AirSim 1.x.
    #[serde(rename = "AerialVLN")]
    AerialVln,
}

impl Benchmark {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::AerialVln => "AerialVLN",
        }
    }

    /// The simulator that its scenes are served by.
    #[must_use]
    pub fn simulator(self) -> &'static str {
        match self {
            Self::AerialVln => "AirSim",
        }
    }
}

/// One wording of a task's instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wording {
    /// Id of the benchmark's episode with this wording.
    pub episode: String,
    /// The instruction.
    pub instruction: String,
}

/// Where a flight is to end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Destination {
    /// The place.
    pub position: EnuPosition,
    /// Success radius, metres.
    pub radius_m: f64,
    /// Whether distances to it are measured on the map, without the height.
    pub horizontal: bool,
}

impl Destination {
    /// Distance of a position, metres.
    #[must_use]
    pub fn distance(&self, from: EnuPosition) -> f64 {
        if self.horizontal { self.position.horizontal_distance(from) } else { self.position.distance(from) }
    }
}

/// A task of another benchmark. Positions are in metres, in the world frame of its simulator turned to ENU.
#[derive(Clone, Debug, PartialEq)]
pub struct ForeignTask {
    /// Its id here.
    pub id: String,
    /// Whose task it is.
    pub benchmark: Benchmark,
    /// The benchmark's name of the scene.
    pub scene: String,
    /// The benchmark's id of the path.
    pub trajectory: String,
    /// The wordings of its instruction, at least one.
    pub wordings: Vec<Wording>,
    /// Start pose, level.
    pub start: Pose,
    /// Where to end.
    pub destination: Destination,
    /// The path described by the instruction, at least one corner.
    pub reference: Vec<EnuPosition>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    format: Spanned<u32>,
    id: Spanned<String>,
    instruction: Spanned<String>,
    #[serde(default)]
    other_wordings: Vec<Spanned<String>>,
    foreign: RawForeign,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawForeign {
    benchmark: Benchmark,
    scene: Spanned<String>,
    trajectory: Spanned<String>,
    episodes: Spanned<Vec<Spanned<String>>>,
    start: Spanned<String>,
    goal: Spanned<String>,
    radius_m: Spanned<f64>,
    horizontal: bool,
    path: Spanned<Vec<Spanned<String>>>,
}

/// What is written, in the order of the file.
#[derive(Serialize)]
struct Written<'a> {
    format: u32,
    id: &'a str,
    instruction: &'a str,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    other_wordings: Vec<&'a str>,
    foreign: WrittenForeign<'a>,
}

#[derive(Serialize)]
struct WrittenForeign<'a> {
    benchmark: Benchmark,
    scene: &'a str,
    trajectory: &'a str,
    episodes: Vec<&'a str>,
    start: String,
    goal: String,
    radius_m: f64,
    horizontal: bool,
    path: Vec<String>,
}

/// Whether a text has the table of another benchmark's task.
pub(super) fn is_foreign(text: &str) -> bool {
    #[derive(Deserialize)]
    struct Probe {
        foreign: Option<serde::de::IgnoredAny>,
    }
    // Most task files are recognised without parsing them twice.
    text.contains("foreign") && toml::from_str::<Probe>(text).is_ok_and(|probe| probe.foreign.is_some())
}

impl ForeignTask {
    /// Parses the text of its file; `file` is the name in errors.
    ///
    /// # Errors
    /// [`TaskError::Invalid`] with file, line and a hint.
    pub fn parse(text: &str, file: &str) -> Result<Self, TaskError> {
        let source = Source { text, file };
        let raw: Raw = source.keys()?;
        source.format(&raw.format)?;
        let foreign = &raw.foreign;
        Ok(Self {
            id: source.id(&raw.id)?,
            benchmark: foreign.benchmark,
            scene: source.word("scene", &foreign.scene)?,
            trajectory: source.word("trajectory", &foreign.trajectory)?,
            wordings: wordings(&raw, &source)?,
            start: pose(foreign.start.get_ref()).ok_or_else(|| {
                source.error(
                    foreign.start.span(),
                    "invalid `start`",
                    Some("use \"east,north,up,heading_deg\" in metres and degrees"),
                )
            })?,
            destination: Destination {
                position: place("goal", &foreign.goal, &source)?,
                radius_m: source.number("radius_m", &foreign.radius_m, 0.1, MOST_RADIUS)?,
                horizontal: foreign.horizontal,
            },
            reference: reference(&foreign.path, &source)?,
        })
    }

    /// The text of its file. Positions are rounded to centimetres, the heading to hundredths of a degree.
    ///
    /// # Errors
    /// A text has no TOML form.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        let Pose { position, attitude } = self.start;
        let [east, north, up] = corner(position);
        let mut wordings = self.wordings.iter().map(|wording| wording.instruction.as_str());
        toml::to_string_pretty(&Written {
            format: FORMAT,
            id: &self.id,
            instruction: wordings.next().unwrap_or_default(),
            other_wordings: wordings.collect(),
            foreign: WrittenForeign {
                benchmark: self.benchmark,
                scene: &self.scene,
                trajectory: &self.trajectory,
                episodes: self.wordings.iter().map(|wording| wording.episode.as_str()).collect(),
                start: joined([east, north, up, hundredths(attitude.heading.to_degrees())]),
                goal: joined(corner(self.destination.position)),
                radius_m: self.destination.radius_m,
                horizontal: self.destination.horizontal,
                path: self.reference.iter().map(|at| joined(corner(*at))).collect(),
            },
        })
    }

    /// What flights are measured against. The shortest path of SPL is the straight line from start to goal: a lower bound,
    /// since the benchmark's files have no map of the obstacles.
    #[must_use]
    pub fn course(&self) -> Course {
        Course {
            reference: self.reference.clone(),
            shortest_m: self.start.position.distance(self.destination.position),
            radius_m: self.destination.radius_m,
        }
    }

    /// The measures of a flight along `flown`, ENU in the task's frame, sampled densely. Success is that the method
    /// reported its end (`stopped`) within the radius and touched nothing.
    #[must_use]
    pub fn measure(&self, flown: &[EnuPosition], stopped: bool, collided: bool) -> Navigation {
        let away = |at: &EnuPosition| self.destination.distance(*at);
        let distance = GoalDistance { least_m: flown.iter().map(away).reduce(f64::min), final_m: flown.last().map(away) };
        let arrived = distance.final_m.is_some_and(|metres| metres <= self.destination.radius_m);
        self.course().measure(flown, distance, stopped && arrived && !collided, collided)
    }

    /// The straight line from start to goal, for comparison with the reference path.
    #[must_use]
    pub fn straight(&self) -> Vec<EnuPosition> {
        spread(&[self.start.position, self.destination.position])
    }
}

fn wordings(raw: &Raw, source: &Source<'_>) -> Result<Vec<Wording>, TaskError> {
    let (episodes, count) = (&raw.foreign.episodes, 1 + raw.other_wordings.len());
    if let Some(many) = raw.other_wordings.get(MOST_WORDINGS - 1) {
        return Err(source.error(many.span(), format!("a task can have at most {MOST_WORDINGS} wordings"), None));
    }
    if episodes.get_ref().len() != count {
        let message = format!("`episodes` must name the episode of each wording: {count}, not {}", episodes.get_ref().len());
        return Err(source.error(episodes.span(), message, Some("`instruction` is the first, then `other_wordings`")));
    }
    let instructions = std::iter::once(("instruction", &raw.instruction))
        .chain(raw.other_wordings.iter().map(|wording| ("other_wordings", wording)));
    let wording = |((key, instruction), episode)| {
        Ok(Wording {
            episode: source.word("episodes", episode)?,
            instruction: source.words(key, instruction, LONGEST_INSTRUCTION)?,
        })
    };
    instructions.zip(episodes.get_ref()).map(wording).collect()
}

fn place(key: &str, text: &Spanned<String>, source: &Source<'_>) -> Result<EnuPosition, TaskError> {
    let [east, north, up] = numbers(text.get_ref()).ok_or_else(|| {
        source.error(text.span(), format!("invalid position in `{key}`"), Some("use \"east,north,up\" in metres, within 10 km"))
    })?;
    Ok(EnuPosition { east, north, up })
}

fn reference(path: &Spanned<Vec<Spanned<String>>>, source: &Source<'_>) -> Result<Vec<EnuPosition>, TaskError> {
    if !(1..=MOST_CORNERS).contains(&path.get_ref().len()) {
        return Err(source.error(path.span(), format!("`path` must have 1 to {MOST_CORNERS} corners"), None));
    }
    let corners: Vec<EnuPosition> = path.get_ref().iter().map(|text| place("path", text, source)).collect::<Result<_, _>>()?;
    if length(&corners) > MOST_METRES {
        return Err(source.error(path.span(), format!("`path` must not be longer than {MOST_METRES} m"), None));
    }
    Ok(corners)
}

fn corner(at: EnuPosition) -> [f64; 3] {
    [at.east, at.north, at.up].map(hundredths)
}

/// Rounds to two decimals, without a negative zero.
fn hundredths(value: f64) -> f64 {
    (100.0 * value).round() / 100.0 + 0.0
}

fn joined<const N: usize>(numbers: [f64; N]) -> String {
    numbers.map(|number| number.to_string()).join(",")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::task::{Task, TaskFile};

    const GOOD: &str = r#"
format = 1
id = "aerialvln-val-unseen-00001"
instruction = "Take off and fly to the tower."
other_wordings = ["Rise, then head for the tower."]

[foreign]
benchmark = "AerialVLN"
scene = "12"
trajectory = "T1"
episodes = ["E1", "E2"]
start = "0,0,10,90"
goal = "30,40,10"
radius_m = 20.0
horizontal = true
path = ["0,0,10", "30,0,10", "30,40,10"]
"#;

    fn good() -> ForeignTask {
        ForeignTask::parse(GOOD, "a.toml").unwrap()
    }

    #[test]
    fn a_task_is_written_as_it_is_read() {
        let task = good();
        assert_eq!((task.wordings[1].episode.as_str(), task.reference.len()), ("E2", 3));
        assert_eq!(task.start.attitude.heading, core::f64::consts::FRAC_PI_2);
        let text = task.to_toml().unwrap();
        assert_eq!(ForeignTask::parse(&text, "b.toml").unwrap(), task, "{text}");
        assert_eq!(text.parse::<toml::Table>().unwrap(), GOOD.parse::<toml::Table>().unwrap());
    }

    #[test]
    fn any_words_survive_the_file() {
        let mut task = good();
        for words in
            ["a\r\nb\n", "\n\nx", "\"\"\"", "'''\"", "\\n \\u0041", "\0\u{7f}\u{1b}[2J\t", "\r", "[foreign]\n# \u{feff}é"]
        {
            task.wordings[1].instruction = words.to_owned();
            let text = task.to_toml().unwrap();
            assert_eq!(ForeignTask::parse(&text, "b.toml").unwrap().wordings[1].instruction, words, "{text}");
        }
    }

    #[test]
    fn it_is_no_task_of_this_simulator_and_says_so() {
        assert!(matches!(TaskFile::parse(GOOD, "a.toml"), Ok(TaskFile::Foreign(_))));
        let error = Task::parse(GOOD, "a.toml").unwrap_err().to_string();
        assert!(error.starts_with("a.toml: a task of AerialVLN in its scene 12, which AirSim serves"), "{error}");
        assert!(error.contains("hint: spf bench show a.toml"), "{error}");
        // A file with both is wrong where it is wrong.
        let both = Task::parse(&GOOD.replace("[foreign]", "set = \"simulation\"\n[foreign]"), "a.toml").unwrap_err().to_string();
        assert!(both.starts_with("a.toml:7: unknown field `set`"), "{both}");
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let cases = [
            ("scene = \"12\"", "scene = \"\"", "a.toml:9:", "`scene`"),
            ("episodes = [\"E1\", \"E2\"]", "episodes = [\"E1\"]", "a.toml:11:", "2, not 1"),
            ("start = \"0,0,10,90\"", "start = \"0,0,10\"", "a.toml:12:", "`start`"),
            ("goal = \"30,40,10\"", "goal = \"30,40,nan\"", "a.toml:13:", "`goal`"),
            ("radius_m = 20.0", "radius_m = 0.0", "a.toml:14:", "from 0.1"),
            ("\"30,0,10\"", "\"30,0,10,5\"", "a.toml:16:", "`path`"),
            ("[\"0,0,10\", \"30,0,10\", \"30,40,10\"]", "[]", "a.toml:16:", "1 to 4000"),
            ("\"AerialVLN\"", "\"R2R\"", "a.toml:8:", "unknown variant `R2R`"),
            ("horizontal", "horizontally", "a.toml:15:", "did you mean `horizontal`"),
            ("format = 1", "format = 2", "a.toml:2:", "format 1"),
        ];
        for (good, bad, place, words) in cases {
            assert!(GOOD.contains(good), "{good}");
            let error = ForeignTask::parse(&GOOD.replace(good, bad), "a.toml").unwrap_err().to_string();
            assert!(error.starts_with(place) && error.contains(words), "{error}");
        }
        let far: Vec<String> = (0..5).map(|i| format!("\"{},0,10\"", if i % 2 == 0 { -9000 } else { 9000 })).collect();
        let long = GOOD.replace("\"0,0,10\", ", &format!("{}, ", far.join(", ")));
        assert!(ForeignTask::parse(&long, "a.toml").unwrap_err().to_string().contains("longer than 20000 m"));
    }

    #[test]
    fn a_flight_is_measured_as_by_hand() {
        let task = good();
        let at = |east: f64, north: f64, up: f64| EnuPosition { east, north, up };
        // Along the path, 70 m, but 100 m too high: on the map 0 m from the goal.
        let east = (0..=30).map(|i| at(f64::from(i), 0.0, 110.0));
        let high: Vec<EnuPosition> = east.chain((1..=40).map(|i| at(30.0, f64::from(i), 110.0))).collect();
        let measured = task.measure(&high, true, false);
        assert_eq!((measured.success, measured.oracle_success, measured.error_m), (true, true, Some(0.0)));
        // 50 m straight from start to goal (3-4-5); each of the 71 points is 100 m off, at a radius of 20 m.
        assert!((measured.spl - 50.0 / 70.0).abs() < 1e-9, "{measured:?}");
        assert!((measured.ndtw - libm::exp(-5.0)).abs() < 1e-9 && measured.sdtw == measured.ndtw, "{measured:?}");
        // With the height it is 100 m from the goal.
        let spatial = ForeignTask { destination: Destination { horizontal: false, ..task.destination }, ..task.clone() };
        let measured = spatial.measure(&high, true, false);
        assert_eq!((measured.success, measured.oracle_success, measured.error_m), (false, false, Some(100.0)));
        assert_eq!((measured.spl, measured.sdtw), (0.0, 0.0));
        // To the goal and 30 m back west: it was there, and is no longer within 20 m.
        let back = spread(&[at(30.0, 0.0, 10.0), at(30.0, 40.0, 10.0), at(0.0, 40.0, 10.0)]);
        let measured = task.measure(&back, true, false);
        assert_eq!((measured.success, measured.oracle_success, measured.error_m), (false, true, Some(30.0)));
        // Who does not stop, or touched something, has not succeeded; nothing flown has no error.
        let there = task.straight();
        assert!(task.measure(&there, true, false).success && (task.measure(&there, true, false).spl - 1.0).abs() < 1e-9);
        assert!(!task.measure(&there, false, false).success && !task.measure(&there, true, true).success);
        assert_eq!(task.measure(&[], true, false).error_m, None);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(at in 0..GOOD.len(), with in ".{0,12}", length in 0_usize..30) {
            let end = (at + length).min(GOOD.len());
            if let (Some(before), Some(after)) = (GOOD.get(..at), GOOD.get(end..)) {
                match TaskFile::parse(&format!("{before}{with}{after}"), "a.toml") {
                    Ok(TaskFile::Foreign(task)) => {
                        let again = ForeignTask::parse(&task.to_toml().unwrap(), "b.toml").unwrap();
                        prop_assert_eq!((&again.wordings, again.reference.len()), (&task.wordings, task.reference.len()));
                    }
                    Ok(TaskFile::Own(_)) => prop_assert!(false, "it has no goals"),
                    Err(error) => prop_assert!(error.to_string().starts_with("a.toml:")),
                }
            }
        }
    }
}
