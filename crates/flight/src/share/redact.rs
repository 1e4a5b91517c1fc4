//! Takes from a message of a flight log what may be shared. What is not known to be harmless is left out.
//!
//! A message of one of our own formats keeps the numbers of the fields that its schema names, and the texts that are words of that
//! schema. Every other text is left out unless a rule here knows its place: words of this program (a policy, a built-in scene, a
//! model of the built-in table) are kept if they are such words, and free text that the flight cannot be understood without (the
//! instruction, what the model answered) is kept without the parts that look private.

use std::collections::{BTreeMap, BTreeSet};

use bytes::Bytes;
use serde_json::Value;
use spf_core::depth::DepthGrid;
use spf_core::prompt::PromptText;
use spf_drone::registry::DRIVERS;
use spf_oracle::ErrorFile;
use spf_scene::{Lighting, Scene, Weather};
use spf_vlm::table::Table;

use super::free_text::{Places, without_private};
use super::mark::{LEFT_OUT, LeftOut};
use crate::log::{Channel, FlightHeader};
use crate::policy::PolicyKind;

/// Fields of a geofence, whose schema does not list them.
const GEOFENCE: [&str; 7] = ["features", "properties", "geometry", "coordinates", "min_altitude_m", "max_altitude_m", "type"];
/// The pilot's names of steps.
const STEPS: [&str; 11] = ["ask", "move", "goto", "follow", "keep", "look", "wait", "done", "reject", "fail", "turn"];
/// Words in the settings of the simulator.
const SIMULATED: [&str; 22] = [
    "quad",
    "tello",
    "from",
    "gust",
    "gust_time",
    "blur",
    "noise",
    "exposure",
    "lens",
    "compression",
    "all",
    "wide",
    "tello_ros",
    "on",
    "off",
    "frozen",
    "half",
    "scale",
    "none",
    "light",
    "mild",
    "strong",
];
/// Files of a flight, which its summary may say were not recorded.
const FILES: [&str; 7] =
    ["flight.mcap", "decisions.jsonl", "queries.jsonl", "vlm.jsonl", "video.mp4", "trajectory.svg", "summary.json"];
/// What the pilot itself says of a query that failed, with its numbers as `#`.
const OWN_REASONS: [&str; 5] = [
    "no reply within # s",
    "its frame is # s old (limit # s), and the craft has flown on",
    "the craft has moved # m since the frame, estimated from commands alone, as its pose is unknown",
    "the craft has turned #° since the frame, estimated from commands alone, as its pose is unknown",
    "the query was cancelled",
];
/// Kinds of failures by their words, which stand between names of hosts and what these said.
const FAILURES: [&str; 19] = [
    "no complete reply",
    "cannot reach",
    "lost during the reply",
    "instead of JSON",
    "returned unexpected JSON",
    "blocked the query",
    "the model refused to answer",
    "the reply was cut off",
    "returned no text",
    "the reply from",
    "cannot prepare the camera frame",
    "the detector failed",
    "cannot be queried",
    "cannot replay the recording",
    "the query was cancelled",
    "no connection from",
    "no answer from",
    "no reply from",
    "failed",
];
/// Codes of failures in `vlm_use`, by [`spf_vlm::VlmError::code`].
const CODES: [&str; 29] = [
    "picture",
    "detector",
    "refused",
    "cancelled",
    "program",
    "deadline",
    "timeout",
    "network",
    "broken_off",
    "bad_request",
    "key",
    "billing",
    "permission",
    "no_such_model",
    "too_large",
    "rate_limit",
    "overloaded",
    "error_in_answer",
    "server_error",
    "web_page",
    "content_type",
    "malformed",
    "blocked",
    "declined",
    "cut_off",
    "empty",
    "too_long",
    "spent",
    "replay",
];

/// The fields and words of a format.
#[derive(Default)]
struct Vocabulary {
    fields: BTreeSet<String>,
    words: BTreeSet<String>,
}

impl Vocabulary {
    /// What a JSON schema lists.
    fn of(schema: &[u8]) -> Self {
        let mut found = Self::default();
        if let Ok(schema) = serde_json::from_slice(schema) {
            found.read(&schema);
        }
        found
    }

    fn read(&mut self, schema: &Value) {
        match schema {
            Value::Array(list) => list.iter().for_each(|part| self.read(part)),
            Value::Object(parts) => {
                if let Some(Value::Object(properties)) = parts.get("properties") {
                    self.fields.extend(properties.keys().cloned());
                }
                let listed = parts.get("enum").and_then(Value::as_array).into_iter().flatten();
                let words = listed.chain(parts.get("const")).filter_map(Value::as_str);
                self.words.extend(words.map(str::to_owned));
                parts.values().for_each(|part| self.read(part));
            }
            _ => {}
        }
    }
}

/// Whether a flight's scene is one of the built-in ones, whose names and objects are no secrets.
#[derive(Clone, Copy, PartialEq, Eq)]
enum SceneKind {
    BuiltIn,
    Own,
}

/// Makes messages that may be shared of the messages of one flight, and keeps account of what it left out.
pub(crate) struct Redactor {
    vocabularies: BTreeMap<Channel, Vocabulary>,
    scene: SceneKind,
    /// Ids of the models of the built-in table, and its names of vendors.
    models: BTreeSet<String>,
    vendors: BTreeSet<String>,
    /// Words that the sender's computer is known by.
    known: Vec<String>,
    left_out: BTreeSet<LeftOut>,
}

impl Redactor {
    /// For the flight with this head. `known` are words that appear in no kept text: the user's name, keys.
    pub(crate) fn new(head: &FlightHeader, known: Vec<String>) -> Self {
        let json =
            Channel::ALL.into_iter().map(|channel| (channel, channel.form())).filter(|(_, topic)| topic.encoding == "json");
        let mut vocabularies: BTreeMap<_, _> =
            json.map(|(channel, topic)| (channel, Vocabulary::of(&topic.definition))).collect();
        if let Some(flight) = vocabularies.get_mut(&Channel::Flight) {
            flight.fields.extend(GEOFENCE.map(str::to_owned));
        }
        let table = Table::shipped();
        Self {
            vocabularies,
            scene: head.sim.as_ref().map_or(SceneKind::BuiltIn, |sim| scene_kind(&sim.scene)),
            models: table.models().iter().map(|model| model.id.clone()).collect(),
            vendors: table.vendors().iter().map(|vendor| vendor.name.clone()).collect(),
            known: known.into_iter().filter(|word| !word.trim().is_empty()).collect(),
            left_out: BTreeSet::new(),
        }
    }

    /// What was left out so far.
    pub(crate) fn left_out(&self) -> &BTreeSet<LeftOut> {
        &self.left_out
    }

    /// Notes that this was left out elsewhere.
    pub(crate) fn note(&mut self, left_out: LeftOut) {
        self.left_out.insert(left_out);
    }

    /// What may be shared of a message in one of our own formats; `None` if it is not one.
    pub(crate) fn row(&mut self, channel: Channel, data: &[u8]) -> Option<Bytes> {
        let vocabulary = self.vocabularies.remove(&channel)?;
        let shared = self.shared(channel, &vocabulary, data);
        self.vocabularies.insert(channel, vocabulary);
        shared
    }

    fn shared(&mut self, channel: Channel, vocabulary: &Vocabulary, data: &[u8]) -> Option<Bytes> {
        // A grid is packed as text, which is that of numbers if it can be read.
        if channel == Channel::Depth {
            let grid: DepthGrid = serde_json::from_slice(data).ok()?;
            return serde_json::to_vec(&grid).ok().map(Bytes::from);
        }
        let mut row: Value = serde_json::from_slice(data).ok()?;
        let of_failure = row.get("note").is_some_and(|note| note == "query_failed")
            || channel == Channel::Reply && row.get("spent").is_none_or(|spent| spent == false);
        self.part(&mut row, "", Place { channel, vocabulary, of_failure });
        serde_json::to_vec(&row).ok().map(Bytes::from)
    }

    fn part(&mut self, value: &mut Value, key: &str, place: Place<'_>) {
        match value {
            Value::Object(fields) => {
                fields.retain(|field, _| {
                    let known = place.vocabulary.fields.contains(field)
                        || key == "models" && self.models.contains(field)
                        || key == "failed" && CODES.contains(&field.as_str());
                    if !known {
                        self.left_out.insert(if key == "models" { LeftOut::VlmName } else { LeftOut::Unknown });
                    }
                    known
                });
                fields.iter_mut().for_each(|(field, value)| self.part(value, field, place));
            }
            Value::Array(list) => list.iter_mut().for_each(|value| self.part(value, key, place)),
            Value::String(text) => *text = self.text(text, key, place),
            Value::Null | Value::Bool(_) | Value::Number(_) => {}
        }
    }

    fn text(&mut self, text: &str, key: &str, place: Place<'_>) -> String {
        let kept = |known: bool| if known { text.to_owned() } else { LEFT_OUT.to_owned() };
        let (shared, left_out) = match (place.channel, key) {
            _ if text == LEFT_OUT => return text.to_owned(),
            (_, "vlm") => (self.vlm(text), LeftOut::VlmName),
            (Channel::Flight, "prompt") => (kept(is_shipped_prompt(text)), LeftOut::OwnPrompt),
            (Channel::Summary, "prompt") => (LEFT_OUT.to_owned(), LeftOut::OwnPrompt),
            (_, "prompt") => (String::new(), LeftOut::SentTexts),
            (_, "detector" | "depth_model") => (LEFT_OUT.to_owned(), LeftOut::NetworkName),
            (_, "scene") => (kept(scene_kind(text) == SceneKind::BuiltIn), LeftOut::OwnScene),
            (Channel::Summary, "targets" | "object" | "surface") => (kept(self.scene == SceneKind::BuiltIn), LeftOut::OwnScene),
            (_, "reason" | "failed") if place.of_failure => (failure(text), LeftOut::FailureTexts),
            (_, "instruction" | "earlier_instructions" | "not_read") => {
                (self.free(text, Places::Possible), LeftOut::PartsOfTexts)
            }
            (
                _,
                "reason" | "failed" | "cause" | "text" | "reply" | "target" | "targets" | "name" | "actions" | "refused"
                | "detections" | "label",
            ) => (self.free(text, Places::None), LeftOut::PartsOfTexts),
            _ => (kept(place.vocabulary.words.contains(text) || is_own_word(key, text)), LeftOut::OtherSettings),
        };
        if shared != text {
            self.left_out.insert(left_out);
        }
        shared
    }

    fn free(&self, text: &str, places: Places) -> String {
        without_private(text, &self.known, places)
    }

    /// A VLM by the names that this program gives it: no address, no path, no model of a server of one's own.
    fn vlm(&self, name: &str) -> String {
        let bare = name.split('@').next().unwrap_or_default();
        let (scheme, rest) = match bare.find(['#', ':']) {
            Some(at) => (&bare[..at], &bare[at..]),
            None => (bare, ""),
        };
        let own = ["oracle", "human", "replay", "exec", "auto"];
        if !own.contains(&scheme) && !self.vendors.contains(scheme) && !self.models.contains(scheme) {
            return LEFT_OUT.to_owned();
        }
        let known =
            rest.get(1..).is_some_and(|rest| self.models.contains(rest) || scheme == "oracle" && ErrorFile::named(rest).is_ok());
        let rest = if rest.is_empty() || known { rest } else { LEFT_OUT };
        let address = if name.contains('@') { LEFT_OUT } else { "" };
        if rest == LEFT_OUT || address == LEFT_OUT { format!("{scheme} {LEFT_OUT}") } else { format!("{scheme}{rest}") }
    }
}

/// Where a text stands.
#[derive(Clone, Copy)]
struct Place<'a> {
    channel: Channel,
    vocabulary: &'a Vocabulary,
    /// Whether the message tells why a query failed, which may be in a server's words.
    of_failure: bool,
}

/// Whether a setting with this name has a value of this program's own.
fn is_own_word(key: &str, text: &str) -> bool {
    // What a craft does not have: the light and the weather of a real one.
    if text.is_empty() {
        return true;
    }
    match key {
        "program" | "by" => is_version(text),
        "policy" => PolicyKind::of_log(text).is_some(),
        "drone" => text == "sim" || DRIVERS.iter().any(|driver| driver.scheme == text),
        "light" => Lighting::from_name(text).is_some(),
        "weather" => Weather::from_name(text).is_some(),
        "drone_model" | "wind" | "camera_effects" | "depth_sensor" => {
            text.split([',', '=']).all(|part| SIMULATED.contains(&part) || part.parse::<f64>().is_ok())
        }
        "step" => STEPS.contains(&text),
        "not_recorded" => FILES.contains(&text),
        _ => false,
    }
}

/// A version as Cargo writes it: `1.2.3`, `1.2.3-beta.1`.
fn is_version(text: &str) -> bool {
    let (numbers, early) = text.split_once('-').unwrap_or((text, "rc"));
    let is_number = |part: &str| part.parse::<u32>().is_ok();
    let early = early.split('.').all(|part| is_number(part) || matches!(part, "alpha" | "beta" | "rc" | "dev"));
    early && text.len() <= 24 && numbers.split('.').count() == 3 && numbers.split('.').all(is_number)
}

/// What may be shared of a reason for which a query failed.
fn failure(text: &str) -> String {
    if OWN_REASONS.contains(&numbers_as_marks(text).as_str()) {
        return text.to_owned();
    }
    let status =
        text.split_once(" returned HTTP ").map(|(_, rest)| rest.chars().take_while(char::is_ascii_digit).collect::<String>());
    if let Some(status) = status.filter(|status| status.len() == 3) {
        return format!("HTTP {status}");
    }
    if text.strip_prefix("HTTP ").is_some_and(|rest| rest.len() == 3 && rest.bytes().all(|digit| digit.is_ascii_digit())) {
        return text.to_owned();
    }
    FAILURES.into_iter().find(|words| text.contains(words)).unwrap_or(LEFT_OUT).to_owned()
}

/// The text with every number, in decimal notation, as `#`.
fn numbers_as_marks(text: &str) -> String {
    let mut marked = String::new();
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        if !letter.is_ascii_digit() {
            marked.push(letter);
            continue;
        }
        marked.push('#');
        let mut point = false;
        while let Some(next) = letters.peek() {
            if !next.is_ascii_digit() && (point || *next != '.') {
                break;
            }
            point |= *next == '.';
            letters.next();
        }
    }
    marked
}

/// A built-in scene, or a variant of one (`city@17`). One with the objects of a task counts as the user's own, for the task may be.
fn scene_kind(name: &str) -> SceneKind {
    let (scene, variant) = name.split_once('@').unwrap_or((name, "0"));
    // A flight without ground truth has no scene.
    let built_in = scene.is_empty() || Scene::built_in().contains(&scene);
    if built_in && variant.parse::<u64>().is_ok() { SceneKind::BuiltIn } else { SceneKind::Own }
}

fn is_shipped_prompt(text: &str) -> bool {
    let paper = PromptText::named("paper");
    paper.iter().any(|prompt| prompt.source() == text)
        || PolicyKind::all().into_iter().any(|policy| PromptText::shipped(policy.prompt()).source() == text)
}
