//! The task file format: its keys, with positions in the text.

use std::ops::Range;

use serde::Deserialize;
use spf_core::craft::CraftKind;
use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_oracle::language::Verb;
use spf_scene::{Lighting, SceneLook, Weather, hint_from};
use toml::Spanned;

use super::select::Selector;
use super::{
    Category, Goal, GoalKind, Hostile, InView, MAX_BYTES, SignContent, Stage, Start, Task, TaskError, TaskSet, Trajectory, Winds,
};

/// Supported version of the format.
pub(super) const FORMAT: u32 = 1;
/// Maximum number of goals of a task, and of trajectories.
const MOST: usize = 16;
/// Maximum number of added objects.
const MOST_OBJECTS: usize = 32;
/// Maximum number of corners of a trajectory.
const MOST_CORNERS: usize = 500;
/// Maximum length of a text, characters.
const LONGEST: usize = 300;
/// Maximum wind speed, m/s; no supported craft holds against more than 15.
const STRONGEST_M_S: f64 = 15.0;
/// Maximum additional reply delay, seconds: the pilot gives up a query after 20 s.
const MOST_DELAY_S: f64 = 15.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    format: Spanned<u32>,
    id: Spanned<String>,
    instruction: Spanned<String>,
    set: TaskSet,
    category: Category,
    scene: Spanned<String>,
    #[serde(default = "yes")]
    variants: bool,
    light: Option<Lighting>,
    weather: Option<Weather>,
    wind: Option<RawWind>,
    vlm_delay_s: Option<Spanned<[f64; 2]>>,
    craft: CraftKind,
    avoid: bool,
    max_time_s: Spanned<f64>,
    max_decisions: Spanned<u32>,
    start: Spanned<RawStart>,
    goals: Spanned<Vec<Spanned<RawGoal>>>,
    stages: Option<Vec<Spanned<RawStage>>>,
    #[serde(default)]
    objects: Vec<Spanned<toml::Table>>,
    hostile: Option<RawHostile>,
    #[serde(default)]
    trajectories: Vec<Spanned<RawTrajectory>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHostile {
    shows: SignContent,
    #[serde(default)]
    lure: Vec<Spanned<Selector>>,
    verb: Option<Spanned<Verb>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStage {
    verb: Verb,
    #[serde(default)]
    targets: Vec<Spanned<Selector>>,
    #[serde(default)]
    other: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWind {
    speed_m_s: Spanned<[f64; 2]>,
    gust_m_s: Option<Spanned<f64>>,
    gust_time_s: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStart {
    scene: Option<bool>,
    view: Option<InView>,
    range_m: Option<Spanned<[f64; 2]>>,
    east: Option<Spanned<[f64; 2]>>,
    north: Option<Spanned<[f64; 2]>>,
    #[serde(default)]
    of: Vec<Spanned<Selector>>,
    #[serde(default)]
    past: Vec<Spanned<Selector>>,
    past_m: Option<Spanned<f64>>,
    blocked: Option<bool>,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawKind {
    Reach,
    Visit,
    Through,
    Around,
    Over,
    Behind,
    Scan,
    Follow,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGoal {
    kind: RawKind,
    #[serde(default)]
    targets: Vec<Spanned<Selector>>,
    #[serde(default)]
    other: bool,
    up_share: Option<Spanned<f64>>,
    count: Option<Spanned<u32>>,
    beyond_m: Option<Spanned<f64>>,
    angle_deg: Option<Spanned<f64>>,
    within_m: Option<Spanned<f64>>,
    #[serde(rename = "share")]
    fraction: Option<Spanned<f64>>,
    window_s: Option<Spanned<f64>>,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawVerdict {
    Accepted,
    Rejected,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTrajectory {
    why: Spanned<String>,
    verdict: RawVerdict,
    speed_m_s: Option<Spanned<f64>>,
    beside: Option<Spanned<String>>,
    path: Spanned<Vec<Spanned<String>>>,
    rest_s: Option<Spanned<f64>>,
}

fn yes() -> bool {
    true
}

/// The text with its file name, for errors.
pub(super) struct Source<'a> {
    pub(super) text: &'a str,
    pub(super) file: &'a str,
}

impl<'a> Source<'a> {
    /// The keys of a text of bounded size.
    pub(super) fn keys<T: Deserialize<'a>>(&self) -> Result<T, TaskError> {
        if self.text.len() > MAX_BYTES {
            return Err(self.error(0..0, format!("the file exceeds {MAX_BYTES} bytes"), None));
        }
        toml::from_str(self.text).map_err(|error| {
            let message = error.message().lines().next().unwrap_or_default().to_owned();
            let hint = hint_from(&message);
            self.error(error.span().unwrap_or(0..0), message, hint.as_deref())
        })
    }

    /// Refuses a version of the format that is not supported.
    pub(super) fn format(&self, version: &Spanned<u32>) -> Result<(), TaskError> {
        if *version.get_ref() == FORMAT {
            return Ok(());
        }
        let message = format!("unsupported task file format; this version reads format {FORMAT}");
        Err(self.error(version.span(), message, None))
    }

    /// The id of a task.
    pub(super) fn id(&self, raw: &Spanned<String>) -> Result<String, TaskError> {
        let id = self.word("id", raw)?;
        if id.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-') {
            return Ok(id);
        }
        let message = "`id` must consist of lower-case letters, digits and `-`";
        Err(self.error(raw.span(), message, Some("for example `sim-nav-red-crane`")))
    }

    pub(super) fn error(&self, at: Range<usize>, message: impl Into<String>, hint: Option<&str>) -> TaskError {
        let before = self.text.as_bytes().get(..at.start.min(self.text.len())).unwrap_or_default();
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        TaskError::Invalid { file: self.file.to_owned(), line, message: message.into(), hint: hint.map(str::to_owned) }
    }

    /// A number within limits.
    pub(super) fn number(&self, key: &str, value: &Spanned<f64>, low: f64, high: f64) -> Result<f64, TaskError> {
        let number = *value.get_ref();
        if (low..=high).contains(&number) {
            return Ok(number);
        }
        Err(self.error(value.span(), format!("`{key}` must be from {low} to {high}, not {number}"), None))
    }

    /// The same for an optional number.
    fn or(&self, key: &str, value: Option<&Spanned<f64>>, low: f64, high: f64, default: f64) -> Result<f64, TaskError> {
        value.map_or(Ok(default), |value| self.number(key, value, low, high))
    }

    /// An ascending range within limits.
    fn range(&self, key: &str, value: &Spanned<[f64; 2]>, low: f64, high: f64) -> Result<[f64; 2], TaskError> {
        let [from, to] = *value.get_ref();
        if low <= from && from < to && to <= high {
            return Ok([from, to]);
        }
        let message = format!("`{key}` must be an increasing range within [{low}, {high}], not [{from}, {to}]");
        Err(self.error(value.span(), message, Some("for example `[15.0, 100.0]`")))
    }

    /// A text that is not empty and not too long.
    pub(super) fn word(&self, key: &str, value: &Spanned<String>) -> Result<String, TaskError> {
        self.words(key, value, LONGEST)
    }

    /// A text of 1 to `longest` characters.
    pub(super) fn words(&self, key: &str, value: &Spanned<String>, longest: usize) -> Result<String, TaskError> {
        let words = value.get_ref();
        if (1..=longest).contains(&words.chars().count()) {
            return Ok(words.clone());
        }
        Err(self.error(value.span(), format!("`{key}` must have 1 to {longest} characters"), None))
    }

    fn selectors(&self, raw: Vec<Spanned<Selector>>) -> Result<Vec<Selector>, TaskError> {
        if let Some(many) = raw.get(MOST) {
            return Err(self.error(many.span(), format!("at most {MOST} entries are allowed"), None));
        }
        let check = |selector: Spanned<Selector>| {
            if selector.get_ref().is_empty() || selector.get_ref().words().any(|word| word.is_empty() || word.len() > LONGEST) {
                let hint = "use `{ name = \"crane\", colour = \"red\" }` or `{ id = \"red_crane\" }`";
                return Err(self.error(selector.span(), "this does not select any objects", Some(hint)));
            }
            Ok(selector.into_inner())
        };
        raw.into_iter().map(check).collect()
    }
}

pub(super) fn parse(text: &str, file: &str) -> Result<Task, TaskError> {
    let source = Source { text, file };
    task(source.keys()?, &source)
}

fn task(raw: Raw, source: &Source<'_>) -> Result<Task, TaskError> {
    source.format(&raw.format)?;
    let id = source.id(&raw.id)?;
    let max_decisions = *raw.max_decisions.get_ref();
    if !(1..=100_000).contains(&max_decisions) {
        return Err(source.error(raw.max_decisions.span(), "`max_decisions` must be from 1 to 100000", None));
    }
    let goals_at = raw.goals.span();
    let goals: Vec<Goal> = raw.goals.into_inner().into_iter().map(|raw| goal(raw, source)).collect::<Result<_, _>>()?;
    if !(1..=MOST).contains(&goals.len()) {
        return Err(source.error(goals_at.clone(), format!("a task must have 1 to {MOST} goals"), None));
    }
    let stages = stages(raw.stages, &goals, goals_at, source)?;
    if let Some(many) = raw.trajectories.get(MOST) {
        return Err(source.error(many.span(), format!("a task can have at most {MOST} trajectories"), None));
    }
    let signs = hostile_objects(&raw.objects);
    let (objects, clean_objects) = objects(raw.objects, raw.hostile.is_some(), source)?;
    let hostile = raw.hostile.map(|hostile| {
        let lure = source.selectors(hostile.lure)?;
        if let Some(verb) = hostile.verb.as_ref().filter(|_| hostile.shows != SignContent::Instruction) {
            return Err(source.error(verb.span(), "`verb` applies only to a sign that shows an instruction", None));
        }
        let verb = hostile.verb.map_or(Verb::GoTo, Spanned::into_inner);
        Ok::<_, TaskError>(Hostile { shows: hostile.shows, clean: false, lure, verb, signs, other_objects: clean_objects })
    });
    Ok(Task {
        id,
        instruction: source.word("instruction", &raw.instruction)?,
        set: raw.set,
        category: raw.category,
        scene: source.word("scene", &raw.scene)?,
        objects,
        hostile: hostile.transpose()?,
        variants: raw.variants,
        conditions: SceneLook { lighting: raw.light, weather: raw.weather },
        wind: raw.wind.as_ref().map(|raw| wind(raw, source)).transpose()?,
        vlm_delay: raw.vlm_delay_s.map(|delay| source.range("vlm_delay_s", &delay, 0.0, MOST_DELAY_S)).transpose()?,
        craft: raw.craft,
        avoid: raw.avoid,
        max_time: source.number("max_time_s", &raw.max_time_s, 1.0, 3600.0)?,
        max_decisions,
        start: start(raw.start, source)?,
        goals,
        stages,
        trajectories: raw.trajectories.into_iter().map(|raw| trajectory(raw, source)).collect::<Result<_, _>>()?,
    })
}

/// Keys of the added objects that the clean twin replaces.
fn hostile_objects(raw: &[Spanned<toml::Table>]) -> Vec<String> {
    let hostile = raw.iter().map(Spanned::get_ref).filter(|object| object.contains_key("clean"));
    hostile.filter_map(|object| object.get("id")?.as_str().map(str::to_owned)).collect()
}

/// What the oracle flies: as the file has it, or as the goals have it.
fn stages(
    raw: Option<Vec<Spanned<RawStage>>>,
    goals: &[Goal],
    goals_at: Range<usize>,
    source: &Source<'_>,
) -> Result<Vec<Stage>, TaskError> {
    let Some(raw) = raw else {
        let derived: Option<Vec<Vec<Stage>>> = goals.iter().map(Goal::stages).collect();
        let hint = Some("add a table `[[stages]]` for each, with `verb` and `targets`");
        let missing = || source.error(goals_at, "these goals do not say in which order to fly; `stages` must", hint);
        return derived.map(|stages| stages.concat()).ok_or_else(missing);
    };
    if raw.is_empty() || raw.len() > MOST {
        return Err(source.error(goals_at, format!("a task must have 1 to {MOST} stages"), None));
    }
    let stage = |raw: Spanned<RawStage>| {
        let at = raw.span();
        let RawStage { verb, targets, other } = raw.into_inner();
        if targets.is_empty() != (verb == Verb::Scan) {
            let message = if verb == Verb::Scan { "a scan must not have `targets`" } else { "this stage needs `targets`" };
            return Err(source.error(at, message, None));
        }
        Ok(Stage { verb, targets: source.selectors(targets)?, other })
    };
    raw.into_iter().map(stage).collect()
}

/// The added objects as text of a scene file, and those of the clean twin, where the keys in `clean` replace the object's own and
/// nothing seems to be something else. The scene's loader checks everything else.
fn objects(raw: Vec<Spanned<toml::Table>>, hostile: bool, source: &Source<'_>) -> Result<(String, String), TaskError> {
    if let Some(many) = raw.get(MOST_OBJECTS) {
        return Err(source.error(many.span(), format!("a task can add at most {MOST_OBJECTS} objects"), None));
    }
    let (mut shown, mut clean) = (Vec::new(), Vec::new());
    for object in raw {
        let span = object.span();
        let mut table = object.into_inner();
        let harmless = table.remove("clean");
        if harmless.is_some() && !hostile {
            return Err(source.error(span, "`clean` needs a table `[hostile]`", None));
        }
        shown.push(table.clone());
        match harmless {
            Some(toml::Value::Table(keys)) => {
                table.extend(keys);
                table.remove("looks_like");
            }
            Some(_) => return Err(source.error(span, "`clean` must be a table of the keys that it replaces", None)),
            None => {}
        }
        clean.push(table);
    }
    if hostile && shown == clean {
        let hint = Some("give the hostile object a mesh for its clean twin: `clean = { mesh = { kind = \"sign\", … } }`");
        return Err(source.error(0..0, "with `[hostile]`, one of `objects` needs `clean`", hint));
    }
    let text = |tables: Vec<toml::Table>| match tables.is_empty() {
        true => Ok(String::new()),
        false => toml::to_string(&toml::Table::from_iter([("objects".to_owned(), toml::Value::from(tables))]))
            .map_err(|error| source.error(0..0, format!("invalid `objects`: {error}"), None)),
    };
    Ok((text(shown)?, text(clean)?))
}

fn wind(raw: &RawWind, source: &Source<'_>) -> Result<Winds, TaskError> {
    Ok(Winds {
        speed: source.range("speed_m_s", &raw.speed_m_s, 0.0, STRONGEST_M_S)?,
        gust: source.or("gust_m_s", raw.gust_m_s.as_ref(), 0.0, STRONGEST_M_S, 0.0)?,
        gust_time: source.or("gust_time_s", raw.gust_time_s.as_ref(), 0.1, 600.0, 2.0)?,
    })
}

fn start(raw: Spanned<RawStart>, source: &Source<'_>) -> Result<Start, TaskError> {
    let at = raw.span();
    let raw = raw.into_inner();
    if raw.scene == Some(true) {
        return own_start(&raw, at, source);
    }
    let missing = |key: &str| {
        source.error(at.clone(), format!("missing field `{key}`"), Some("or set `scene = true` to use the scene's own start"))
    };
    let view = raw.view.ok_or_else(|| missing("view"))?;
    let range = raw.range_m.ok_or_else(|| missing("range_m"))?;
    let place = |key: &str, value: Option<Spanned<[f64; 2]>>| {
        value.map(|value| source.range(key, &value, -10_000.0, 10_000.0)).transpose()
    };
    let past = source.selectors(raw.past)?;
    let near = source.or("past_m", raw.past_m.as_ref(), 0.1, 100.0, 1.0)?;
    Ok(Start {
        own: false,
        view,
        range: source.range("range_m", &range, 0.0, 1000.0)?,
        east: place("east", raw.east)?,
        north: place("north", raw.north)?,
        of: source.selectors(raw.of)?,
        past: (!past.is_empty()).then_some((past, near)),
        blocked: raw.blocked,
    })
}

/// The scene's own start, with which no other requirement can be combined.
fn own_start(raw: &RawStart, at: Range<usize>, source: &Source<'_>) -> Result<Start, TaskError> {
    let RawStart { scene: _, view, range_m, east, north, of, past, past_m, blocked } = raw;
    let others = [
        ("view", view.is_some()),
        ("range_m", range_m.is_some()),
        ("east", east.is_some()),
        ("north", north.is_some()),
        ("of", !of.is_empty()),
        ("past", !past.is_empty()),
        ("past_m", past_m.is_some()),
        ("blocked", blocked.is_some()),
    ];
    if let Some((key, _)) = others.iter().find(|(_, given)| *given) {
        return Err(source.error(at, format!("`{key}` has no effect with `scene = true`"), None));
    }
    Ok(Start {
        own: true,
        view: InView::Any,
        range: [0.0, 1000.0],
        east: None,
        north: None,
        of: Vec::new(),
        past: None,
        blocked: None,
    })
}

fn goal(raw: Spanned<RawGoal>, source: &Source<'_>) -> Result<Goal, TaskError> {
    let at = raw.span();
    let raw = raw.into_inner();
    if raw.targets.is_empty() != (raw.kind == RawKind::Scan) {
        let message = if raw.kind == RawKind::Scan { "a scan must not have `targets`" } else { "this goal needs `targets`" };
        return Err(source.error(at, message, None));
    }
    allowed(&raw, at, source)?;
    let turn = |default: f64| source.or("angle_deg", raw.angle_deg.as_ref(), 1.0, 3600.0, default).map(f64::to_radians);
    if let Some(count) = raw.count.as_ref().filter(|count| !(1..=100).contains(count.get_ref())) {
        return Err(source.error(count.span(), "`count` must be from 1 to 100", None));
    }
    let count = raw.count.as_ref().map(|count| *count.get_ref() as usize);
    let within = |default: f64| source.or("within_m", raw.within_m.as_ref(), 0.1, 200.0, default);
    let kind = match raw.kind {
        RawKind::Reach => {
            GoalKind::Reach { other: raw.other, up_share: source.or("up_share", raw.up_share.as_ref(), 0.0, 1.0, 0.0)? }
        }
        RawKind::Visit => GoalKind::Visit { count: count.unwrap_or(1) },
        RawKind::Through => GoalKind::Through { count, beyond: source.or("beyond_m", raw.beyond_m.as_ref(), 0.0, 100.0, 1.0)? },
        RawKind::Around => GoalKind::Around { angle: turn(300.0)?, within: within(15.0)? },
        RawKind::Over => GoalKind::Over,
        RawKind::Behind => GoalKind::Behind { within: within(15.0)? },
        RawKind::Scan => GoalKind::Scan { angle: turn(360.0)? },
        RawKind::Follow => GoalKind::Follow {
            within: within(3.0)?,
            fraction: source.or("share", raw.fraction.as_ref(), 0.01, 1.0, 2.0 / 3.0)?,
            window: source.or("window_s", raw.window_s.as_ref(), 1.0, 600.0, 20.0)?,
        },
    };
    Ok(Goal { kind, targets: source.selectors(raw.targets)? })
}

/// Rejects keys that do not apply to the goal.
fn allowed(raw: &RawGoal, at: Range<usize>, source: &Source<'_>) -> Result<(), TaskError> {
    use RawKind::{Around, Behind, Follow, Reach, Scan, Through, Visit};
    let uses: [(&str, bool, &[RawKind]); 8] = [
        ("other", raw.other, &[Reach]),
        ("up_share", raw.up_share.is_some(), &[Reach]),
        ("count", raw.count.is_some(), &[Through, Visit]),
        ("beyond_m", raw.beyond_m.is_some(), &[Through]),
        ("angle_deg", raw.angle_deg.is_some(), &[Around, Scan]),
        ("within_m", raw.within_m.is_some(), &[Around, Behind, Follow]),
        ("share", raw.fraction.is_some(), &[Follow]),
        ("window_s", raw.window_s.is_some(), &[Follow]),
    ];
    match uses.iter().find(|(_, given, kinds)| *given && !kinds.contains(&raw.kind)) {
        Some((key, ..)) => Err(source.error(at, format!("`{key}` does not apply to this kind of goal"), None)),
        None => Ok(()),
    }
}

fn trajectory(raw: Spanned<RawTrajectory>, source: &Source<'_>) -> Result<Trajectory, TaskError> {
    let raw = raw.into_inner();
    let corners = raw.path.get_ref();
    if !(1..=MOST_CORNERS).contains(&corners.len()) {
        return Err(source.error(raw.path.span(), format!("a path must have 1 to {MOST_CORNERS} corners"), None));
    }
    let path: Vec<Pose> = corners
        .iter()
        .map(|text| {
            let hint = "use \"east,north,up,heading_deg\" in metres and degrees";
            pose(text.get_ref()).ok_or_else(|| source.error(text.span(), "invalid path corner", Some(hint)))
        })
        .collect::<Result<_, _>>()?;
    Ok(Trajectory {
        why: source.word("why", &raw.why)?,
        accepted: raw.verdict == RawVerdict::Accepted,
        speed: source.or("speed_m_s", raw.speed_m_s.as_ref(), 0.05, 30.0, 2.0)?,
        beside: raw.beside.as_ref().map(|key| source.word("beside", key)).transpose()?,
        path,
        rest: source.or("rest_s", raw.rest_s.as_ref(), 0.0, 600.0, 0.0)?,
    })
}

/// Numbers within ±10 000, separated by commas.
pub(super) fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let mut parts = text.split(',').map(|part| part.trim().parse().ok());
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = parts.next()?.filter(|number| (-1e4..=1e4).contains(number))?;
    }
    parts.next().is_none().then_some(numbers)
}

/// `east,north,up,heading_deg`.
pub(super) fn pose(text: &str) -> Option<Pose> {
    let [east, north, up, heading] = numbers(text)?;
    Some(Pose {
        position: EnuPosition { east, north, up },
        attitude: Attitude { heading: wrap_angle(heading.to_radians()), ..Attitude::default() },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GOOD: &str = r#"
format = 1
id = "sim-nav-red-crane"
instruction = "Take off and fly to the red crane"
set = "simulation"
category = "navigation"
scene = "city"
craft = "quad"
avoid = false
max_time_s = 180.0
max_decisions = 60

[start]
view = "half"
range_m = [15.0, 100.0]

[[goals]]
kind = "reach"
targets = [{ name = "crane", colour = "red" }]

[[trajectories]]
why = "ends beside it"
verdict = "accepted"
path = ["0,0,3,0", "10,0,3,90"]
"#;

    #[test]
    fn a_task_is_read() {
        let task = Task::parse(GOOD, "a.toml").unwrap();
        assert_eq!((task.id.as_str(), task.category, task.craft), ("sim-nav-red-crane", Category::Navigation, CraftKind::Quad));
        assert_eq!(task.goals[0].targets[0].colour.as_deref(), Some("red"));
        assert_eq!(task.trajectories[0].path[1].attitude.heading, core::f64::consts::FRAC_PI_2);
        assert_eq!(task.start_targets(), &task.goals[0].targets[..]);
        assert_eq!((task.wind, task.vlm_delay), (None, None));
    }

    #[test]
    fn a_scene_s_own_start_stands_alone() {
        let drawn = "view = \"half\"\nrange_m = [15.0, 100.0]";
        let task = Task::parse(&GOOD.replace(drawn, "scene = true"), "a.toml").unwrap();
        assert!(task.start.own && !Task::parse(GOOD, "a.toml").unwrap().start.own);
        let error = |start: &str| Task::parse(&GOOD.replace(drawn, start), "a.toml").unwrap_err().to_string();
        let both = error("scene = true\nblocked = true");
        assert!(both.starts_with("a.toml:13: `blocked` has no effect"), "{both}");
        let without = error("view = \"half\"");
        assert!(without.starts_with("a.toml:13: missing field `range_m`") && without.contains("scene = true"), "{without}");
    }

    #[test]
    fn stages_are_those_of_the_goals_or_of_a_table() {
        let stages = |text: &str| Task::parse(text, "a.toml").map(|task| task.stages);
        let told = |text: &str| stages(text).unwrap().into_iter().map(|stage| (stage.verb, stage.other)).collect::<Vec<_>>();
        assert_eq!(told(GOOD), [(Verb::GoTo, false)]);
        let goal = |text: &str| GOOD.replace("kind = \"reach\"", text);
        assert_eq!(told(&goal("kind = \"reach\"\nup_share = 0.5")), [(Verb::Up, false)]);
        assert_eq!(told(&goal("kind = \"visit\"\ncount = 2")), [(Verb::GoTo, false), (Verb::GoTo, true)]);
        assert_eq!(told(&goal("kind = \"through\"\ncount = 1")), [(Verb::Through, false)]);
        // Which of two openings comes first the goal does not say.
        let two = goal("kind = \"through\"\ncount = 2");
        let error = stages(&two).unwrap_err().to_string();
        assert!(error.starts_with("a.toml:17:") && error.contains("`[[stages]]`"), "{error}");
        let own = "[[stages]]\nverb = \"through\"\ntargets = [{ id = \"gate\" }]\nother = true\n\n[[stages]]\nverb = \"scan\"\n";
        let with = |own: &str| two.replace("[[trajectories]]", &format!("{own}\n[[trajectories]]"));
        assert_eq!(told(&with(own)), [(Verb::Through, true), (Verb::Scan, false)]);
        let error = |own: &str| stages(&with(own)).unwrap_err().to_string();
        assert!(error("[[stages]]\nverb = \"over\"").contains("needs `targets`"));
        assert!(error("[[stages]]\nverb = \"scan\"\ntargets = [{ id = \"gate\" }]").contains("must not have"));
        assert!(error("[[stages]]\nverb = \"fly\"\ntargets = [{ id = \"gate\" }]").contains("unknown variant `fly`"));
        assert!(error("[[stages]]\nverb = \"over\"\ntarget = []").contains("did you mean `targets`"));
    }

    #[test]
    fn wind_and_slow_answers_are_read() {
        let delayed = "max_decisions = 60\nvlm_delay_s = [0.5, 4.5]\n\n[wind]\nspeed_m_s = [2.0, 5.0]\ngust_m_s = 1.0";
        let task = Task::parse(&GOOD.replace("max_decisions = 60", delayed), "a.toml").unwrap();
        assert_eq!(task.wind, Some(Winds { speed: [2.0, 5.0], gust: 1.0, gust_time: 2.0 }));
        assert_eq!(task.vlm_delay, Some([0.5, 4.5]));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let cases = [
            ("craft = \"quad\"", "craft = \"quad\"\ncolur = 1", "a.toml:9:", "unknown field"),
            ("range_m = [15.0, 100.0]", "range_m = [100.0, 15.0]", "a.toml:15:", "increasing range"),
            ("max_time_s = 180.0", "max_time_s = nan", "a.toml:10:", "max_time_s"),
            ("{ name = \"crane\", colour = \"red\" }", "{}", "a.toml:19:", "select any objects"),
            ("kind = \"reach\"", "kind = \"reach\"\nangle_deg = 3.0", "a.toml:17:", "angle_deg"),
            ("\"10,0,3,90\"", "\"10,0,3\"", "a.toml:24:", "corner"),
            ("format = 1", "format = 2", "a.toml:2:", "format 1"),
            ("format = 1", "format = 1\nvlm_delay_s = [0.0, 60.0]", "a.toml:3:", "vlm_delay_s"),
            ("[start]", "[wind]\nspeed_m_s = [4.0, 2.0]\n[start]", "a.toml:14:", "increasing range"),
            ("[start]", "[wind]\nspeed_m_s = [2.0, 4.0]\ngust_ms = 1\n[start]", "a.toml:15:", "did you mean `gust_m_s`"),
            ("id = \"sim-nav-red-crane\"", "id = \"Red Crane\"", "a.toml:3:", "lower-case"),
        ];
        for (good, bad, place, words) in cases {
            assert!(GOOD.contains(good));
            let error = Task::parse(&GOOD.replace(good, bad), "a.toml").unwrap_err().to_string();
            assert!(error.starts_with(place) && error.contains(words), "{error}");
        }
    }

    const SIGN: &str = r#"
[hostile]
shows = "land"
lure = [{ id = "barrel" }]

[[objects]]
id = "sign"
mesh = { kind = "sign", text = "LAND HERE", letter = 0.5 }
clean = { mesh = { kind = "sign", text = "STATION", letter = 0.5 } }
looks_like = "red_crane"
position = [0.0, 9.0]
heading_deg = 180.0
names = ["sign"]
kind = "sign"
"#;

    #[test]
    fn a_hostile_sign_has_a_clean_twin() {
        let task = Task::parse(&format!("{GOOD}{SIGN}"), "a.toml").unwrap();
        let twin = task.clean_twin().unwrap();
        assert_eq!((twin.id.as_str(), twin.drawn_as(), task.drawn_as()), ("sim-nav-red-crane-clean", &*task.id, &*task.id));
        assert!(task.objects.contains("LAND HERE") && task.objects.contains("red_crane") && !task.objects.contains("STATION"));
        assert!(twin.objects.contains("STATION") && !twin.objects.contains("LAND HERE") && !twin.objects.contains("red_crane"));
        assert!(twin.clean_twin().is_none() && Task::parse(GOOD, "a.toml").unwrap().clean_twin().is_none());
        // Both are scenes.
        for task in [&task, &twin] {
            let loaded = task.load_scene(&task.scene).unwrap();
            assert!(loaded.scene.by_key("sign").unwrap().sign.is_some());
        }
        let error = |text: &str| Task::parse(&format!("{GOOD}{text}"), "a.toml").unwrap_err().to_string();
        let clean = "clean = { mesh = { kind = \"sign\", text = \"STATION\", letter = 0.5 } }\n";
        assert!(error(&SIGN.replace(clean, "")).contains("needs `clean`"));
        assert!(
            error(&SIGN.replace("[hostile]\nshows = \"land\"\nlure = [{ id = \"barrel\" }]\n", "")).contains("needs a table")
        );
        assert!(error(&SIGN.replace("\"land\"", "\"fly\"")).contains("unknown variant `fly`"));
        assert!(error(&SIGN.replace("shows = \"land\"", "shows = \"land\"\nverb = \"follow\"")).contains("shows an instruction"));
        assert_eq!(
            (task.hostile.as_ref().unwrap().verb, &*task.hostile.as_ref().unwrap().signs),
            (Verb::GoTo, &["sign".to_owned()][..])
        );
        let unknown = Task::parse(&format!("{GOOD}{}", SIGN.replace("names", "nams")), "a.toml").unwrap();
        assert!(unknown.load_scene("city").err().unwrap().to_string().contains("did you mean `names`"));
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(at in 0..GOOD.len(), with in ".{0,12}", length in 0_usize..30) {
            let end = (at + length).min(GOOD.len());
            if let (Some(before), Some(after)) = (GOOD.get(..at), GOOD.get(end..)) {
                match Task::parse(&format!("{before}{with}{after}"), "a.toml") {
                    Ok(task) => prop_assert!(!task.goals.is_empty() && task.max_time.is_finite()),
                    Err(error) => prop_assert!(error.to_string().starts_with("a.toml:")),
                }
            }
        }
    }
}
