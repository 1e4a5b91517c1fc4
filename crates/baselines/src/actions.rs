//! Replies of the *plain text* baseline: actions in words instead of an image point (the paper's "plain VLM" ablation).
//!
//! The paper does not publish its format. This one is a JSON object,
//! `{"actions":[{"cmd":"forward","value":1.5}],"done":false}`, in metres and degrees on the wire, metres and radians
//! here. Parsing is as lenient as [`parse_reply`].
//!
//! [`parse_reply`]: spf_core::reply::parse_reply

mod forms;

use core::f64::consts::PI;

pub use forms::{Moves, parse_moves};
use spf_core::primitives::Primitives;
use spf_core::reply::{MAX_ACTIONS, MAX_TEXT, MOVE_METRES, ScanError, TURN_DEGREES, Value, Verdict, search};

/// Fraction of a limit by which a value may exceed it and still be clamped to it.
const TOLERANCE: f64 = 0.01;

/// One action in words, in the level body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Metres along the heading, 0.2..=5.
    Forward(f64),
    /// Metres backwards, 0.2..=5.
    Back(f64),
    /// Metres to the left, 0.2..=5.
    Left(f64),
    /// Metres to the right, 0.2..=5.
    Right(f64),
    /// Metres up, 0.2..=5.
    Up(f64),
    /// Metres down, 0.2..=5.
    Down(f64),
    /// Radians counter-clockwise, 1° to 180°.
    YawLeft(f64),
    /// Radians clockwise, 1° to 180°.
    YawRight(f64),
    /// Stay in place until the next reply.
    Hover,
    /// Same as [`Hover`](Self::Hover): only [`ActionsReply::done`] ends the flight, as for every policy.
    Stop,
}

impl Action {
    /// The wire name of this action.
    #[must_use]
    pub fn command(self) -> &'static str {
        match self {
            Self::Forward(_) => "forward",
            Self::Back(_) => "back",
            Self::Left(_) => "left",
            Self::Right(_) => "right",
            Self::Up(_) => "up",
            Self::Down(_) => "down",
            Self::YawLeft(_) => "yaw_left",
            Self::YawRight(_) => "yaw_right",
            Self::Hover => "hover",
            Self::Stop => "stop",
        }
    }

    /// The wire value in metres or degrees; `None` for actions without one.
    fn wire_value(self) -> Option<f64> {
        match self {
            Self::Forward(m) | Self::Back(m) | Self::Left(m) | Self::Right(m) | Self::Up(m) | Self::Down(m) => Some(m),
            Self::YawLeft(angle) | Self::YawRight(angle) => Some(angle.to_degrees()),
            Self::Hover | Self::Stop => None,
        }
    }
}

impl From<Action> for Primitives {
    /// The motion of one action. Each action becomes one set of primitives, flown in order.
    fn from(action: Action) -> Self {
        let still = Self::default();
        match action {
            Action::Forward(forward) => Self { forward, ..still },
            Action::Back(back) => Self { forward: -back, ..still },
            Action::Right(right) => Self { right, ..still },
            Action::Left(left) => Self { right: -left, ..still },
            Action::Up(climb) => Self { climb, ..still },
            Action::Down(sink) => Self { climb: -sink, ..still },
            Action::YawRight(yaw) => Self { yaw, ..still },
            Action::YawLeft(yaw) => Self { yaw: -yaw, ..still },
            Action::Hover | Action::Stop => still,
        }
    }
}

impl core::fmt::Display for Action {
    /// The form used in the prompt's action history: `forward 1.5 m`, `yaw_left 30°`.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let tenth = |value: f64| libm::round(value * 10.0) / 10.0;
        match (self, self.wire_value()) {
            (Self::YawLeft(_) | Self::YawRight(_), Some(degrees)) => write!(f, "{} {}°", self.command(), tenth(degrees)),
            (_, Some(metres)) => write!(f, "{} {} m", self.command(), tenth(metres)),
            (_, None) => f.write_str(self.command()),
        }
    }
}

/// One answer to an [`Act`](spf_core::query::QueryKind::Act) query.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActionsReply {
    /// Actions to fly, in order; at most [`MAX_ACTIONS`], empty only if `done`.
    pub actions: Vec<Action>,
    /// Whether the instruction is fulfilled.
    pub done: bool,
    /// True if the reply held more actions than [`MAX_ACTIONS`]; the rest were ignored.
    pub truncated: bool,
}

/// Why an answer is not a list of actions. Nothing may be flown on it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ActionsError {
    /// No JSON anywhere in the answer.
    #[error("the reply contains no JSON object; retry, or use a model that follows schemas")]
    NoJson,
    /// Valid JSON, but not a list of actions.
    #[error("the JSON reply has neither `actions` nor `done`")]
    NoReply,
    /// The answer ends inside its JSON.
    #[error("the reply ends inside its JSON; raise the limit on output tokens")]
    Truncated,
    /// The answer is longer than [`MAX_TEXT`].
    #[error("the reply exceeds {limit} bytes")]
    TooLong {
        /// The limit, bytes.
        limit: usize,
    },
    /// Neither actions nor `done`.
    #[error("`actions` is empty, but `done` is not true")]
    Empty,
    /// A field holds something of the wrong kind, or is missing (`found` is then `null`).
    #[error("`{field}` must be {wanted}, found `{found}`")]
    WrongType {
        /// The field, such as `actions[1].value`.
        field: String,
        /// What was expected.
        wanted: &'static str,
        /// What was found, shortened.
        found: String,
    },
    /// An unknown command.
    #[error("unknown command `{found}`; use forward, back, left, right, up, down, yaw_left, yaw_right, hover or stop")]
    UnknownCommand {
        /// The command found, shortened.
        found: String,
    },
    /// A distance or an angle beyond its range by more than 1 %.
    #[error("`{command}` {found} is out of range {least} to {most}")]
    ValueOutside {
        /// The command.
        command: &'static str,
        /// Metres or degrees.
        found: f64,
        /// Minimum allowed value.
        least: f64,
        /// Maximum allowed value.
        most: f64,
    },
}

impl ActionsError {
    /// A short, stable identifier of the error, for logs and counters.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoJson => "no_json",
            Self::NoReply => "no_reply",
            Self::Truncated => "truncated",
            Self::TooLong { .. } => "too_long",
            Self::Empty => "no_actions",
            Self::WrongType { .. } => "wrong_type",
            Self::UnknownCommand { .. } => "unknown_command",
            Self::ValueOutside { .. } => "value_outside",
        }
    }
}

/// Parses the actions in `text`. Accepts code fences, surrounding prose, a bare array or a single action, numbers as
/// text, alternative keys and spellings of commands, and values up to 1 % out of range. Actions beyond the third are
/// ignored.
///
/// # Errors
/// [`ActionsError`] if no valid list is found. Every number returned is finite and within its range.
pub fn parse_actions(text: &str) -> Result<ActionsReply, ActionsError> {
    find(text, interpret)
}

/// Returns the first JSON value in `text` that `judge` accepts.
fn find<T>(text: &str, judge: impl Fn(&Value, bool) -> Verdict<T, ActionsError>) -> Result<T, ActionsError> {
    search(text, judge).map_err(|unfound| match unfound {
        ScanError::TooLong => ActionsError::TooLong { limit: MAX_TEXT },
        ScanError::Refused(error) => error,
        ScanError::Truncated => ActionsError::Truncated,
        ScanError::NoReply => ActionsError::NoReply,
        ScanError::NoJson => ActionsError::NoJson,
    })
}

const LIST: [&str; 1] = ["actions"];
const COMMAND: [&str; 3] = ["cmd", "command", "action"];
const VALUE: [&str; 3] = ["value", "distance", "angle"];

/// `nested`: the value was found inside a larger one that failed to parse; then only an object that names its list is
/// accepted.
fn interpret(value: &Value, nested: bool) -> Verdict<ActionsReply, ActionsError> {
    let actions = match value {
        Value::Object(_) if value.field(&LIST).is_some() || (!nested && value.field(&["done"]).is_some()) => {
            match value.field(&LIST) {
                None => &[],
                Some(Value::Array(items)) => items.as_slice(),
                Some(single) => core::slice::from_ref(single),
            }
        }
        Value::Object(_) if !nested && value.field(&COMMAND).is_some() => core::slice::from_ref(value),
        Value::Array(items) if items.len() == 1 && items[0].field(&LIST).is_some() => return interpret(&items[0], nested),
        Value::Array(items) if !nested && items.first().is_some_and(|item| item.field(&COMMAND).is_some()) => items.as_slice(),
        _ => return Verdict::Other,
    };
    reply(value, actions).map_or_else(Verdict::Refused, Verdict::Accepted)
}

fn reply(value: &Value, items: &[Value]) -> Result<ActionsReply, ActionsError> {
    let done = truth(value)?;
    let actions: Vec<Action> =
        items.iter().take(MAX_ACTIONS).enumerate().map(|(i, item)| action(item, i)).collect::<Result<_, _>>()?;
    if actions.is_empty() && !done {
        return Err(ActionsError::Empty);
    }
    Ok(ActionsReply { actions, done, truncated: items.len() > MAX_ACTIONS })
}

/// The optional `done` field.
fn truth(value: &Value) -> Result<bool, ActionsError> {
    match value.field(&["done"]) {
        None => Ok(false),
        Some(message) => message.truth().ok_or_else(|| wrong("done".to_owned(), "true or false", message)),
    }
}

fn wrong(field: String, wanted: &'static str, found: &Value) -> ActionsError {
    ActionsError::WrongType { field, wanted, found: found.excerpt() }
}

fn action(item: &Value, index: usize) -> Result<Action, ActionsError> {
    let word = match item.field(&COMMAND) {
        Some(Value::Text(text)) => text,
        other => return Err(wrong(format!("actions[{index}].cmd"), "a command", other.unwrap_or(&Value::Null))),
    };
    let plain: String = word.chars().filter(|c| c.is_alphanumeric()).take(40).flat_map(char::to_lowercase).collect();
    // Only checked for commands that take a value: models give `hover` any number, or none.
    let ranged = |(least, most): (f64, f64), command: &'static str| {
        let value = item.field(&VALUE).unwrap_or(&Value::Null);
        let found = value.number().ok_or_else(|| wrong(format!("actions[{index}].value"), "a number", value))?;
        if !(least * (1.0 - TOLERANCE)..=most * (1.0 + TOLERANCE)).contains(&found) {
            return Err(ActionsError::ValueOutside { command, found, least, most });
        }
        Ok(found.clamp(least, most))
    };
    let metres = |command| ranged(MOVE_METRES, command);
    let radians = |command| ranged(TURN_DEGREES, command).map(|degrees| degrees.to_radians().min(PI));
    Ok(match plain.as_str() {
        "forward" | "forwards" | "moveforward" => Action::Forward(metres("forward")?),
        "back" | "backward" | "backwards" | "moveback" | "movebackward" => Action::Back(metres("back")?),
        "left" | "moveleft" => Action::Left(metres("left")?),
        "right" | "moveright" => Action::Right(metres("right")?),
        "up" | "moveup" | "climb" => Action::Up(metres("up")?),
        "down" | "movedown" | "descend" => Action::Down(metres("down")?),
        "yawleft" | "turnleft" | "rotateleft" => Action::YawLeft(radians("yaw_left")?),
        "yawright" | "turnright" | "rotateright" => Action::YawRight(radians("yaw_right")?),
        "hover" | "hold" | "wait" => Action::Hover,
        "stop" => Action::Stop,
        _ => return Err(ActionsError::UnknownCommand { found: spf_core::reply::one_line(word) }),
    })
}

impl ActionsReply {
    /// Serialises the reply as JSON, rounding metres to the centimetre and degrees to a tenth.
    #[must_use]
    pub fn to_json(&self) -> String {
        let actions: Vec<serde_json::Value> = self
            .actions
            .iter()
            .map(|action| match action.wire_value() {
                Some(value) => serde_json::json!({ "cmd": action.command(), "value": libm::round(value * 100.0) / 100.0 }),
                None => serde_json::json!({ "cmd": action.command() }),
            })
            .collect();
        serde_json::json!({ "actions": actions, "done": self.done }).to_string()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_core::grounding::GroundingProfile;
    use spf_core::prompt::{PromptInput, plain_prompt};
    use spf_core::query::Memory;

    use super::*;

    #[test]
    fn example_reads_as_written() {
        let text = r#"{"actions":[{"cmd":"forward","value":1.5},{"cmd":"yaw_right","value":90.0}],"done":false}"#;
        let reply = parse_actions(text).unwrap();
        assert_eq!(reply.actions, [Action::Forward(1.5), Action::YawRight(PI / 2.0)]);
        assert_eq!((reply.done, reply.truncated), (false, false));
        assert_eq!(reply.to_json(), text);
        assert_eq!(Action::YawRight(PI / 2.0).to_string(), "yaw_right 90°");
        assert_eq!(Action::Forward(1.5).to_string(), "forward 1.5 m");
        // Clockwise and right are positive, left and back negative.
        let flown: Vec<Primitives> =
            [Action::YawLeft(1.0), Action::Left(2.0), Action::Back(3.0), Action::Down(4.0)].map(Into::into).to_vec();
        assert_eq!((flown[0].yaw, flown[1].right, flown[2].forward, flown[3].climb), (-1.0, -2.0, -3.0, -4.0));
    }

    #[test]
    fn the_example_of_the_prompt_is_read() {
        let (memory, profile) = (Memory::default(), GroundingProfile::default());
        let text = plain_prompt(&PromptInput::new("fly to the red crane", &memory, &profile));
        let (_, example) = text.rsplit_once("For example: ").unwrap();
        assert_eq!(parse_actions(example).unwrap().actions.len(), 2);
    }

    #[test]
    fn forgives_what_models_do() {
        for text in [
            "Sure:\n```json\n{\"actions\":[{\"cmd\":\"Turn-Left\",\"value\":\"30\"}],\"done\":\"False\"}\n```",
            "[{'command': 'yaw left', 'angle': 30,},]",
            "{\"action\":\"turn_left\",\"value\":30}",
            "[{\"actions\":[{\"cmd\":\"yaw_left\",\"value\":30}]}]",
            "{\"plan\":{\"actions\":{\"cmd\":\"yaw_left\",\"value\":30}}}",
        ] {
            assert_eq!(parse_actions(text).unwrap().actions, [Action::YawLeft(30.0_f64.to_radians())], "{text}");
        }
        let many =
            parse_actions("{\"actions\":[{\"cmd\":\"hover\"},{\"cmd\":\"stop\"},{\"cmd\":\"up\",\"value\":5.04},7,8]}").unwrap();
        assert_eq!((many.actions, many.truncated), (vec![Action::Hover, Action::Stop, Action::Up(5.0)], true));
        assert!(parse_actions("{\"done\":true}").unwrap().done);
    }

    #[test]
    fn refuses_with_a_reason() {
        for (text, reason) in [
            ("fly left", "no_json"),
            ("{\"answer\":1}", "no_reply"),
            ("{\"actions\":[{\"cmd\":\"forward\",\"value\":1},{\"cmd\":", "truncated"),
            ("{\"actions\":[]}", "no_actions"),
            ("{\"actions\":[{\"cmd\":\"flip\"}]}", "unknown_command"),
            ("{\"actions\":[{\"cmd\":\"forward\"}]}", "wrong_type"),
            ("{\"actions\":[{\"value\":1}]}", "wrong_type"),
            ("{\"actions\":[3]}", "wrong_type"),
            ("{\"actions\":[{\"cmd\":\"up\",\"value\":1}],\"done\":3}", "wrong_type"),
            ("{\"actions\":[{\"cmd\":\"forward\",\"value\":50}]}", "value_outside"),
            ("{\"actions\":[{\"cmd\":\"forward\",\"value\":-1}]}", "value_outside"),
            ("{\"actions\":[{\"cmd\":\"yaw_left\",\"value\":\"NaN\"}]}", "value_outside"),
            ("{\"actions\":[{\"cmd\":\"yaw_left\",\"value\":1e999}]}", "value_outside"),
        ] {
            assert_eq!(parse_actions(text).map_err(|e| e.code()), Err(reason), "{text}");
        }
        assert_eq!(parse_actions(&" ".repeat(MAX_TEXT + 1)).map_err(|e| e.code()), Err("too_long"));
    }

    fn actions() -> impl Strategy<Value = Action> {
        let metres = || MOVE_METRES.0..=MOVE_METRES.1;
        let radians = || (TURN_DEGREES.0..=TURN_DEGREES.1).prop_map(f64::to_radians);
        prop_oneof![
            metres().prop_map(Action::Forward),
            metres().prop_map(Action::Back),
            metres().prop_map(Action::Left),
            metres().prop_map(Action::Right),
            metres().prop_map(Action::Up),
            metres().prop_map(Action::Down),
            radians().prop_map(Action::YawLeft),
            radians().prop_map(Action::YawRight),
            Just(Action::Hover),
            Just(Action::Stop),
        ]
    }

    proptest! {
        #[test]
        fn replies_survive_the_wire(actions in proptest::collection::vec(actions(), 1..=MAX_ACTIONS), done: bool) {
            let reply = ActionsReply { actions, done, truncated: false };
            let read = parse_actions(&format!("Here:\n{}\n.", reply.to_json())).unwrap();
            prop_assert_eq!(read.done, done);
            prop_assert_eq!(read.actions.len(), reply.actions.len());
            for (a, b) in read.actions.iter().zip(&reply.actions) {
                prop_assert_eq!(a.command(), b.command());
                let (a, b) = (a.wire_value().unwrap_or(0.0), b.wire_value().unwrap_or(0.0));
                prop_assert!((a - b).abs() < 0.0051, "{} {}", a, b);
            }
        }

        #[test]
        fn any_text_is_read_without_panic(text in any::<String>(), value: f64, command in "[a-z_]{2,9}") {
            let _ = parse_actions(&text);
            if let Ok(reply) = parse_actions(&format!("[{{\"cmd\":\"{command}\",\"value\":{value:e}}}]")) {
                let value = reply.actions[0].wire_value().unwrap_or(1.0);
                prop_assert!((0.2..=180.0).contains(&value));
            }
        }
    }
}
