//! Converts a JSON value to a [`Reply`]: accepted and refused forms.

use std::collections::BTreeSet;

use super::json::{Value, read};
use super::scan::Verdict;
use super::{DEPTH_LABELS, Look, ObstacleBox, OpenWay, Reply, Status};
use crate::grounding::{GroundingError, GroundingProfile, Habit};
use crate::lift::{label_of_range, range_of_label};

/// Maximum number of obstacle boxes in a reply.
pub const MAX_BOXES: usize = 64;
/// Maximum length of a target or obstacle name, characters; longer ones are truncated, since names are repeated
/// in the next prompt.
pub const MAX_NAME: usize = 80;
/// Largest distance accepted in metres; the sky may be called as far as that.
pub(super) const MAX_METRES: f64 = 1e5;
/// Maximum stage number.
pub const MAX_STAGE: u32 = 99;

/// Why an answer is not a reply. Nothing may be flown on it: the pilot holds, queries again and counts a failure.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplyError {
    /// No JSON anywhere in the answer.
    #[error("the reply contains no JSON object; retry, or use a model that follows schemas")]
    NoJson,
    /// JSON without `status` and `point`.
    #[error("the JSON reply has neither `status` nor `point`")]
    NoReply,
    /// Several replies, which differ in their status: which of them is meant cannot be told.
    #[error("the answer has several replies with different statuses")]
    Contradiction,
    /// Text may have left its string: a key twice, or quotes that no reading can place.
    #[error("the answer has quotes in a string without a backslash, or a key twice, and can be read in several ways")]
    Ambiguous,
    /// The answer ends inside its JSON.
    #[error("the reply ends inside its JSON; raise the limit on output tokens")]
    Truncated,
    /// The answer is longer than [`MAX_TEXT`](super::MAX_TEXT).
    #[error("the reply exceeds {limit} bytes")]
    TooLong {
        /// The limit, bytes.
        limit: usize,
    },
    /// A field has the wrong type.
    #[error("`{field}` must be {wanted}, found `{found}`")]
    WrongType {
        /// The field, such as `boxes[2].depth`.
        field: String,
        /// What was expected.
        wanted: &'static str,
        /// What was found, shortened.
        found: String,
    },
    /// A required field is missing.
    #[error("`{field}` is missing")]
    Missing {
        /// The field.
        field: String,
    },
    /// `navigating` or `following` without a point to go to.
    #[error("`status` says that the target is visible, but `point` is missing")]
    MissingPoint,
    /// A point without its depth.
    #[error("`status` says that the target is visible, but `depth` is missing")]
    MissingDepth,
    /// A point or box outside the image.
    #[error("`{field}`: {source}")]
    PointOutside {
        /// The field.
        field: String,
        /// The grounding error.
        source: GroundingError,
    },
    /// A depth label outside the scale. It is not clamped: a model that leaves the scale means something else by it,
    /// and clamping would give the longest possible step.
    #[error("`{field}` is {found}; depth labels must be 1 to {DEPTH_LABELS}")]
    DepthOutside {
        /// The field.
        field: String,
        /// The number found.
        found: f64,
    },
    /// A stage number below 0 or above [`MAX_STAGE`].
    #[error("`stage` is {found}; stages must be 1 to {MAX_STAGE}")]
    StageOutside {
        /// The number found.
        found: f64,
    },
    /// A turn of more than half a circle.
    #[error("`turn_deg` is {found}; turns must be -180 to 180")]
    TurnOutside {
        /// The number found.
        found: f64,
    },
    /// More than [`MAX_BOXES`] obstacles.
    #[error("{found} boxes exceed the limit of {MAX_BOXES} per reply")]
    TooManyBoxes {
        /// Number of boxes.
        found: usize,
    },
}

impl ReplyError {
    /// A short, stable identifier of the error, for logs and counters.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoJson => "no_json",
            Self::NoReply => "no_reply",
            Self::Contradiction => "contradiction",
            Self::Ambiguous => "ambiguous",
            Self::Truncated => "truncated",
            Self::TooLong { .. } => "too_long",
            Self::WrongType { .. } => "wrong_type",
            Self::Missing { .. } => "missing_field",
            Self::MissingPoint => "missing_point",
            Self::MissingDepth => "missing_depth",
            Self::PointOutside { .. } => "point_outside",
            Self::DepthOutside { .. } => "depth_outside",
            Self::StageOutside { .. } => "stage_outside",
            Self::TurnOutside { .. } => "turn_outside",
            Self::TooManyBoxes { .. } => "too_many_boxes",
        }
    }

    /// What the next query states, in words after "your last answer". It repeats nothing that the model
    /// wrote, since that may be text that it read in the image.
    #[must_use]
    pub fn for_the_model(&self) -> String {
        match self {
            Self::NoJson | Self::NoReply => "was not the JSON object that is asked for".to_owned(),
            Self::Contradiction => "had several objects with different statuses: write one".to_owned(),
            Self::Ambiguous => "had quotes in a string without a backslash, or a key twice".to_owned(),
            Self::Truncated => "ended before its JSON was complete: be brief".to_owned(),
            Self::TooLong { .. } => "was too long".to_owned(),
            Self::WrongType { field, wanted, .. } => format!("had a {field} that was not {wanted}"),
            Self::Missing { field } => format!("lacked {field}"),
            Self::MissingPoint => "lacked point".to_owned(),
            Self::MissingDepth => "lacked depth".to_owned(),
            Self::PointOutside { field, .. } => format!("had a {field} that is not in the image, in the coordinates asked for"),
            Self::DepthOutside { field, .. } => format!("had a {field} off the scale"),
            Self::StageOutside { .. } => format!("had a stage that was not 1 to {MAX_STAGE}"),
            Self::TurnOutside { .. } => "had a turn_deg that was not -180 to 180".to_owned(),
            Self::TooManyBoxes { .. } => "had too many boxes".to_owned(),
        }
    }
}

const STATUS: [&str; 1] = ["status"];
const POINT: [&str; 2] = ["point", "point_2d"];
const DEPTH: [&str; 2] = ["depth", "depth_label"];
const METRES: [&str; 2] = ["depth_m", "distance_m"];
const TARGET_BOX: [&str; 1] = ["target_box"];
const TURN: [&str; 1] = ["turn_deg"];
const OPEN_WAY: &str = "open_way";
/// Largest turn, degrees.
const MAX_TURN: f64 = 180.0;
const TARGET: [&str; 2] = ["target", "label"];
const BOXES: [&str; 2] = ["boxes", "obstacles"];
const BOX: [&str; 4] = ["box", "box_2d", "bbox", "bbox_2d"];
/// The edges of a box by name: left, top, right, bottom.
const EDGES: [&[&str]; 4] =
    [&["xmin", "x1", "left"], &["ymin", "y1", "top"], &["xmax", "x2", "right"], &["ymax", "y2", "bottom"]];
const NAME: [&str; 2] = ["name", "label"];

/// The requirements of the query.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    /// The coordinates of the reply.
    pub(super) profile: &'a GroundingProfile,
    /// Whether it must list obstacles.
    pub(super) avoid: bool,
}

/// Interprets `value` as a reply: an object, or an array of such. `nested`: the value was
/// found inside a larger one that failed to parse, and so needs its own `status` to be accepted.
pub(super) fn interpret(value: &Value, asked: Asked<'_>, nested: bool) -> Verdict<Reply, ReplyError> {
    match value {
        Value::Array(items) => {
            let states = items.iter().any(|item| item.field(&STATUS).is_some());
            let verdicts = items.iter().map(|item| object(item, asked, nested));
            let mut answers: Vec<_> = verdicts.filter(|verdict| *verdict != Verdict::Other).collect();
            let status = |verdict: &Verdict<Reply, ReplyError>| match verdict {
                Verdict::Accepted(reply) => Some(reply.status),
                _ => None,
            };
            // Of bare points the first is the best; replies count as they do without the list.
            let valid = answers.iter().position(|answer| status(answer).is_some());
            let counts = if states { answers.len().checked_sub(1) } else { valid.or(Some(0)) };
            let Some(counts) = counts.filter(|place| *place < answers.len()) else { return Verdict::Other };
            let counted = answers.swap_remove(counts);
            match status(&counted) {
                Some(last) if answers.iter().filter_map(status).any(|other| other != last) => {
                    Verdict::Refused(ReplyError::Contradiction)
                }
                _ => counted,
            }
        }
        value => object(value, asked, nested),
    }
}

fn object(value: &Value, asked: Asked<'_>, nested: bool) -> Verdict<Reply, ReplyError> {
    let answers = value.field(&STATUS).is_some() || (!nested && value.field(&POINT).is_some());
    if !answers {
        return Verdict::Other;
    }
    reply(value, asked).map_or_else(Verdict::Refused, Verdict::Accepted)
}

fn reply(value: &Value, Asked { profile, avoid }: Asked<'_>) -> Result<Reply, ReplyError> {
    if repeats_a_key(value) {
        return Err(ReplyError::Ambiguous);
    }
    // Models trained to point often return a bare point with its label, which can only mean "go there".
    let status = value.field(&STATUS).map_or(Ok(Status::Navigating), status)?;
    let point = value.field(&POINT).map(|v| point(v, "point", profile)).transpose();
    let distance = distance(value, "depth");
    let turn = value.field(&TURN).map(turn).transpose();
    let boxes = match value.field(&BOXES) {
        Some(found) => boxes(found, profile),
        // A missing list is not an empty list.
        None if avoid => Err(ReplyError::Missing { field: "boxes".to_owned() }),
        None => Ok(Vec::new()),
    };
    let mut reply = Reply::new(status);
    if status.leads_to_a_point() {
        match (point, turn) {
            (Ok(None), Ok(Some(Some(turn)))) => reply.turn_deg = Some(turn),
            // Without a point, the turn was the answer.
            (Ok(None), Err(error)) => return Err(error),
            (point, _) => {
                reply.point = Some(point?.ok_or(ReplyError::MissingPoint)?);
                match distance? {
                    Some(Distance { label, metres }) => (reply.depth, reply.range_m) = (Some(label), metres),
                    None if profile.habit == Habit::Asked => return Err(ReplyError::MissingDepth),
                    // Whoever points by habit leaves it to the pilot.
                    None => {}
                }
            }
        }
        reply.boxes = boxes?;
    } else {
        // What a search or a retreat flies is kept clear of the boxes, too; `done` flies nowhere.
        reply.boxes = if avoid && status != Status::Done { boxes? } else { boxes.unwrap_or_default() };
        // Models that must fill every field fill these with zeros; what cannot be parsed is omitted.
        let (point, distance) = (point.unwrap_or(None), distance.unwrap_or(None));
        match status {
            Status::NotVisible => {
                reply.turn_deg = turn.unwrap_or(None).flatten();
                reply.look = value.field(&["look"]).map(look).transpose()?.flatten();
                reply.open_way = match value.key(OPEN_WAY) {
                    Some(way) => open_way(way, profile),
                    // Reply version 2: the point of an answer without a visible target is the open way.
                    None => point.zip(distance).map(|(point, distance)| OpenWay { point, depth: distance.label }),
                };
            }
            Status::Blocked => reply.open_way = value.key(OPEN_WAY).and_then(|way| open_way(way, profile)),
            _ => {}
        }
        if let (Some(point), Some(Distance { label, metres }), false) = (point, distance, status == Status::NotVisible) {
            (reply.point, reply.depth, reply.range_m) = (Some(point), Some(label), metres);
        }
    }
    reply.stage = value.field(&["stage"]).map(stage).transpose()?.flatten();
    reply.target = value.field(&TARGET).map(|v| name(v, "target")).transpose()?.flatten();
    // It moves nothing, so an unreadable one is dropped.
    let target_box = value.field(&TARGET_BOX).and_then(|v| area(v, profile, "target_box").ok());
    reply.target_box = target_box.filter(|area| area.right > area.left && area.bottom > area.top);
    Ok(reply)
}

/// Whether an object in `value` has two fields that would be read as the same one.
fn repeats_a_key(value: &Value) -> bool {
    let kind = |key: &str| {
        let key = key.to_ascii_lowercase();
        let same = [&POINT[..], &DEPTH, &METRES, &BOXES, &BOX].into_iter().find(|names| names.contains(&key.as_str()));
        same.map_or(key, |names| names[0].to_owned())
    };
    match value {
        Value::Object(fields) => {
            let mut seen = BTreeSet::new();
            fields.iter().any(|(key, field)| !seen.insert(kind(key)) || repeats_a_key(field))
        }
        Value::Array(items) => items.iter().any(repeats_a_key),
        _ => false,
    }
}

/// A distance as stated.
#[derive(Clone, Copy)]
struct Distance {
    label: u8,
    /// If it was stated in metres.
    metres: Option<f64>,
}

impl Distance {
    fn range(&self) -> f64 {
        self.metres.unwrap_or_else(|| range_of_label(f64::from(self.label)))
    }
}

/// The distance in an object: a label in `depth`, or metres in `depth_m` or with their unit. Of two the nearer counts.
fn distance(value: &Value, field: &str) -> Result<Option<Distance>, ReplyError> {
    let label = value.field(&DEPTH).map(|found| match metres_with_unit(found) {
        Some(stated) => metres(stated, field.to_owned()),
        None => Ok(Distance { label: depth(found, field)?, metres: None }),
    });
    let length = value.field(&METRES).map(|found| {
        let field = format!("{field}_m");
        let stated = found.number().or_else(|| metres_with_unit(found));
        metres(stated.ok_or_else(|| wrong(&field, "a distance in metres", found))?, field)
    });
    match (label, length) {
        (Some(Ok(one)), Some(Ok(other))) => Ok(Some(if other.range() < one.range() { other } else { one })),
        (Some(Ok(only)), _) | (None, Some(Ok(only))) => Ok(Some(only)),
        (Some(Err(error)), _) | (None, Some(Err(error))) => Err(error),
        (None, None) => Ok(None),
    }
}

/// The number of a text such as `3 m`.
fn metres_with_unit(value: &Value) -> Option<f64> {
    let text = value.text()?.trim();
    let number = ["metres", "meters", "metre", "meter", "m"].iter().find_map(|unit| text.strip_suffix(unit))?;
    number.trim_end().parse().ok()
}

fn metres(metres: f64, field: String) -> Result<Distance, ReplyError> {
    if !(metres > 0.0 && metres <= MAX_METRES) {
        return Err(ReplyError::DepthOutside { field, found: metres });
    }
    Ok(Distance { label: label_of_range(metres), metres: Some(metres) })
}

fn open_way(value: &Value, profile: &GroundingProfile) -> Option<OpenWay> {
    let at = value.field(&POINT).and_then(|v| point(v, "open_way.point", profile).ok())?;
    let distance = distance(value, "open_way.depth").ok()??;
    Some(OpenWay { point: at, depth: distance.label })
}

/// `None` for 0, which models write instead of null.
fn turn(value: &Value) -> Result<Option<f64>, ReplyError> {
    let degrees = value.number().ok_or_else(|| wrong("turn_deg", "a number of degrees", value))?;
    if !(-MAX_TURN..=MAX_TURN).contains(&degrees) {
        return Err(ReplyError::TurnOutside { found: degrees });
    }
    Ok(Some(degrees).filter(|degrees| *degrees != 0.0))
}

/// The word in normalised form, without case, spaces, hyphens and underscores.
fn plain_word(value: &Value, field: &str, wanted: &'static str) -> Result<String, ReplyError> {
    match value {
        Value::Text(text) => Ok(text.chars().filter(|c| c.is_alphanumeric()).take(40).flat_map(char::to_lowercase).collect()),
        other => Err(wrong(field, wanted, other)),
    }
}

fn wrong(field: &str, wanted: &'static str, found: &Value) -> ReplyError {
    ReplyError::WrongType { field: field.to_owned(), wanted, found: found.excerpt() }
}

fn status(value: &Value) -> Result<Status, ReplyError> {
    const WANTED: &str = "`navigating`, `following`, `not_visible`, `waiting`, `blocked` or `done`";
    match plain_word(value, "status", WANTED)?.as_str() {
        "navigating" | "navigate" | "inprogress" | "visible" => Ok(Status::Navigating),
        "notvisible" | "notinview" | "notfound" | "invisible" => Ok(Status::NotVisible),
        "done" | "complete" | "completed" | "finished" | "reached" | "arrived" => Ok(Status::Done),
        "following" | "follow" | "tracking" => Ok(Status::Following),
        "waiting" | "wait" | "yield" | "yielding" => Ok(Status::Waiting),
        "blocked" | "obstructed" => Ok(Status::Blocked),
        _ => Err(wrong("status", WANTED, value)),
    }
}

fn look(value: &Value) -> Result<Option<Look>, ReplyError> {
    const WANTED: &str = "`left`, `right`, `up`, `down`, `behind` or `ahead`";
    Ok(Some(match plain_word(value, "look", WANTED)?.as_str() {
        "left" | "lookleft" | "turnleft" => Look::Left,
        "right" | "lookright" | "turnright" => Look::Right,
        "up" | "lookup" | "above" => Look::Up,
        "down" | "lookdown" | "below" => Look::Down,
        "behind" | "lookbehind" | "back" | "backward" | "backwards" | "turnaround" => Look::Behind,
        "ahead" | "forward" | "straight" | "straightahead" | "lookahead" => Look::Ahead,
        "" | "none" | "null" | "unknown" => return Ok(None),
        _ => return Err(wrong("look", WANTED, value)),
    }))
}

/// `None` for 0, which models write if there is only one stage.
fn stage(value: &Value) -> Result<Option<u32>, ReplyError> {
    let number = value.number().ok_or_else(|| wrong("stage", "a whole number", value))?;
    if !(0.0..=f64::from(MAX_STAGE)).contains(&number) {
        return Err(ReplyError::StageOutside { found: number });
    }
    Ok(Some(libm::round(number) as u32).filter(|&stage| stage > 0))
}

fn depth(value: &Value, field: &str) -> Result<u8, ReplyError> {
    let number = value.number().ok_or_else(|| wrong(field, "a depth label", value))?;
    if !(1.0..=f64::from(DEPTH_LABELS)).contains(&number) {
        return Err(ReplyError::DepthOutside { field: field.to_owned(), found: number });
    }
    Ok(libm::round(number) as u8)
}

/// A name on one line, of at most [`MAX_NAME`] characters. It returns in the next prompt, so line breaks and control
/// characters, with which a model (or text it read in the image) could alter that prompt, are removed.
fn name(value: &Value, field: &str) -> Result<Option<String>, ReplyError> {
    let Value::Text(text) = value else { return Err(wrong(field, "a string", value)) };
    Ok(Some(one_line(text)).filter(|name| !name.is_empty()))
}

/// `text` with each run of white space and control characters replaced by a space, trimmed, at most [`MAX_NAME`]
/// characters.
#[must_use]
pub fn one_line(text: &str) -> String {
    one_line_within(text, MAX_NAME)
}

/// The same with a limit of `most` characters.
#[must_use]
pub fn one_line_within(text: &str, most: usize) -> String {
    let mut out = String::new();
    let words = text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|word| !word.is_empty());
    for (i, word) in words.enumerate() {
        if i > 0 {
            out.push(' ');
        }
        out.push_str(word);
        if let Some((end, _)) = out.char_indices().nth(most) {
            out.truncate(end);
            return out.trim_end().to_owned();
        }
    }
    out
}

/// The numbers of a flat or once nested array, or of a text such as `500, 500`, `[10 10 50 50]` or `<box>10 10 50 50</box>`; `None` if
/// there are more than four.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Array(items) if items.iter().any(|item| matches!(item, Value::Array(_))) => {
            let mut all = Vec::new();
            for item in items {
                let Value::Array(inner) = item else { return None };
                all.extend(inner.iter().map(Value::number).collect::<Option<Vec<_>>>()?);
            }
            Some(all).filter(|all| all.len() <= 4)
        }
        Value::Array(items) if items.len() <= 4 => items.iter().map(Value::number).collect(),
        Value::Text(text) => {
            let plain = without_tags(text);
            let parts = plain.split(|c: char| c.is_whitespace() || matches!(c, ',' | ';' | '[' | ']' | '(' | ')'));
            let numbers: Option<Vec<f64>> = parts.filter(|part| !part.is_empty()).take(5).map(|part| part.parse().ok()).collect();
            numbers.filter(|numbers| numbers.len() <= 4)
        }
        _ => None,
    }
}

/// The text with a space in the place of each tag.
fn without_tags(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, tag)) = rest.split_once('<') {
        plain.push_str(before);
        plain.push(' ');
        rest = tag.split_once('>').map_or("", |(_, after)| after);
    }
    plain.push_str(rest);
    plain
}

/// The numbers of an object with named edges, one name of each row, in row order.
fn named<const N: usize>(value: &Value, names: [&[&str]; N]) -> Option<[f64; N]> {
    let mut out = [0.0; N];
    for (number, keys) in out.iter_mut().zip(names) {
        *number = value.field(keys)?.number()?;
    }
    Some(out)
}

fn point(value: &Value, field: &str, profile: &GroundingProfile) -> Result<crate::query::ImagePoint, ReplyError> {
    use crate::grounding::AxisOrder::{Xy, Yx};
    let pair = if let Some([x, y]) = named(value, [&["x"], &["y"]]) {
        Some(match profile.order {
            Xy => [x, y],
            Yx => [y, x],
        })
    } else {
        numbers(value).and_then(|all| <[f64; 2]>::try_from(all).ok())
    };
    let pair = pair.ok_or_else(|| wrong(field, "two numbers", value))?;
    profile.point(pair).map_err(|source| ReplyError::PointOutside { field: field.to_owned(), source })
}

fn area(value: &Value, profile: &GroundingProfile, field: &str) -> Result<crate::query::ImageBox, ReplyError> {
    use crate::grounding::AxisOrder::{Xy, Yx};
    let edges = named(value, EDGES);
    let four = match (edges, profile.order) {
        (Some(four), Xy) => Some(four),
        (Some([x1, y1, x2, y2]), Yx) => Some([y1, x1, y2, x2]),
        (None, _) => numbers(value).and_then(|all| <[f64; 4]>::try_from(all).ok()),
    };
    let four = four.ok_or_else(|| wrong(field, "four numbers", value))?;
    profile.area(four).map_err(|source| ReplyError::PointOutside { field: field.to_owned(), source })
}

fn boxes(value: &Value, profile: &GroundingProfile) -> Result<Vec<ObstacleBox>, ReplyError> {
    // Encoded twice, or written as text.
    let inner = value.text().and_then(|text| read(text.trim()).ok());
    let value = inner.as_ref().unwrap_or(value);
    let single = core::slice::from_ref(value);
    let items = match value {
        Value::Array(items) => items,
        Value::Object(_) => single,
        other => return Err(wrong("boxes", "a list of obstacles", other)),
    };
    if items.len() > MAX_BOXES {
        return Err(ReplyError::TooManyBoxes { found: items.len() });
    }
    let parse = |(i, item): (usize, &Value)| {
        let missing = |part: &str| ReplyError::Missing { field: format!("boxes[{i}].{part}") };
        if !matches!(item, Value::Object(_)) {
            return Err(wrong(&format!("boxes[{i}]"), "an object", item));
        }
        let edges = item.field(&BOX).or_else(|| named(item, EDGES).map(|_| item)).ok_or_else(|| missing("box"))?;
        let named = item.field(&NAME).map(|v| name(v, &format!("boxes[{i}].name"))).transpose()?.flatten();
        Ok(ObstacleBox {
            area: area(edges, profile, &format!("boxes[{i}].box"))?,
            // An obstacle at an unknown range may be here.
            depth: distance(item, &format!("boxes[{i}].depth"))?.map_or(1, |distance| distance.label),
            name: named.unwrap_or_else(|| "obstacle".to_owned()),
        })
    };
    items.iter().enumerate().map(parse).collect()
}
