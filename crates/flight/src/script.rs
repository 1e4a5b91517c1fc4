//! Operator events from a file, so that every operator path runs in virtual time (docs/reference/flight-files.md).

use serde::Deserialize;
use spf_core::command::Setpoint;
use spf_core::time::{Duration, Time};
use spf_pilot::OperatorEvent;

use crate::world::Script;

/// Interval at which a held key repeats its setpoint.
const REPEAT: Duration = Duration::from_millis(100);
/// Maximum number of events after expanding held setpoints.
const MAX_EVENTS: usize = 100_000;

/// Why an events file is invalid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScriptError {
    /// Invalid TOML or structure.
    #[error("line {line}: {message}")]
    Format {
        /// Line, from 1.
        line: usize,
        /// The error.
        message: String,
    },
    /// An invalid event.
    #[error("event {number}: {message}")]
    Event {
        /// Number of the event, from 1.
        number: usize,
        /// The error.
        message: String,
    },
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    event: Vec<Row>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    at_s: f64,
    #[serde(rename = "do")]
    what: What,
    text: Option<String>,
    right_m_s: Option<f64>,
    forward_m_s: Option<f64>,
    up_m_s: Option<f64>,
    yaw_rate_deg_s: Option<f64>,
    for_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum What {
    Hold,
    Resume,
    Setpoint,
    Instruction,
    Land,
    /// A hold. It used to cut the motors; no drone flown with such an older file may fall.
    Stop,
    CutMotors,
}

impl Script {
    /// Parses an events file: an array of `[[event]]` tables with `at_s` and `do` (hold or stop, resume, setpoint,
    /// instruction, land, cut_motors).
    ///
    /// # Errors
    /// [`ScriptError`] with the line, or the number of the event.
    pub fn from_toml(text: &str) -> Result<Self, ScriptError> {
        let file: File = toml::from_str(text).map_err(|error| ScriptError::Format {
            line: error.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count()),
            message: error.message().to_owned(),
        })?;
        let mut events = Vec::new();
        for (index, row) in file.event.iter().enumerate() {
            let wrong = |message: &str| ScriptError::Event { number: index + 1, message: message.to_owned() };
            if !(0.0..=86_400.0).contains(&row.at_s) {
                return Err(wrong("`at_s` must be from 0 to 86400 s"));
            }
            let at = Time::from_secs_f64(row.at_s);
            let axes = [row.right_m_s, row.forward_m_s, row.up_m_s, row.yaw_rate_deg_s];
            if row.what != What::Setpoint && (axes.iter().any(Option::is_some) || row.for_s.is_some()) {
                return Err(wrong("velocities and `for_s` are only valid with `do = \"setpoint\"`"));
            }
            match (row.what, &row.text) {
                (What::Instruction, Some(text)) if !text.trim().is_empty() => {
                    events.push((at, OperatorEvent::Instruction(text.clone())))
                }
                (What::Instruction, _) => return Err(wrong("an instruction needs `text`")),
                (_, Some(_)) => return Err(wrong("`text` is only valid with `do = \"instruction\"`")),
                (What::Hold | What::Stop, None) => events.push((at, OperatorEvent::Hold)),
                (What::Resume, None) => events.push((at, OperatorEvent::Resume)),
                (What::Land, None) => events.push((at, OperatorEvent::Land)),
                (What::CutMotors, None) => events.push((at, OperatorEvent::CutMotors)),
                (What::Setpoint, None) => {
                    if !axes.iter().flatten().all(|value| value.is_finite()) {
                        return Err(wrong("velocities must be finite numbers"));
                    }
                    let held = row.for_s.unwrap_or(0.0);
                    if !(0.0..=3600.0).contains(&held) {
                        return Err(wrong("`for_s` must be from 0 to 3600 s"));
                    }
                    let setpoint = Setpoint {
                        right: row.right_m_s.unwrap_or(0.0),
                        forward: row.forward_m_s.unwrap_or(0.0),
                        up: row.up_m_s.unwrap_or(0.0),
                        yaw_rate: row.yaw_rate_deg_s.unwrap_or(0.0).to_radians(),
                    };
                    // Any later operator input releases the key.
                    let later = file.event.iter().map(|row| row.at_s).filter(|other| *other > row.at_s);
                    let let_go = later.fold(f64::INFINITY, f64::min);
                    let (end, cut) = (at + Duration::from_secs_f64(held.min(let_go - row.at_s)), let_go < row.at_s + held);
                    let mut now = at;
                    while now == at || now < end {
                        events.push((now, OperatorEvent::Setpoint(setpoint)));
                        now += REPEAT;
                    }
                    if held > 0.0 && !cut {
                        events.push((end, OperatorEvent::Setpoint(Setpoint::HOLD)));
                    }
                }
            }
            if events.len() > MAX_EVENTS {
                return Err(wrong("the file has more than 100000 events"));
            }
        }
        Ok(Self::new(events))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_held_setpoint_is_repeated_and_ended() {
        let text =
            "[[event]]\nat_s = 1.0\ndo = \"setpoint\"\nforward_m_s = 0.5\nfor_s = 0.25\n[[event]]\nat_s = 0.5\ndo = \"hold\"\n";
        let script = Script::from_toml(text).unwrap();
        let go = OperatorEvent::Setpoint(Setpoint { forward: 0.5, ..Setpoint::HOLD });
        let expected = vec![
            (Time::from_millis(500), OperatorEvent::Hold),
            (Time::from_millis(1000), go.clone()),
            (Time::from_millis(1100), go.clone()),
            (Time::from_millis(1200), go),
            (Time::from_millis(1250), OperatorEvent::Setpoint(Setpoint::HOLD)),
        ];
        assert_eq!(script, Script::new(expected));
    }

    #[test]
    fn a_later_event_lets_go_of_a_held_setpoint() {
        let text = "[[event]]\nat_s = 1.0\ndo = \"setpoint\"\nup_m_s = 0.5\nfor_s = 9\n[[event]]\nat_s = 1.2\ndo = \"resume\"\n";
        let up = OperatorEvent::Setpoint(Setpoint { up: 0.5, ..Setpoint::HOLD });
        let expected = vec![
            (Time::from_millis(1000), up.clone()),
            (Time::from_millis(1100), up),
            (Time::from_millis(1200), OperatorEvent::Resume),
        ];
        assert_eq!(Script::from_toml(text).unwrap(), Script::new(expected));
    }

    #[test]
    fn errors_state_where() {
        let message = |text: &str| Script::from_toml(text).unwrap_err().to_string();
        assert!(message("[[event]]\nat_s = 1\ndo = \"dance\"\n").starts_with("line 3: unknown variant `dance`"));
        assert_eq!(message("[[event]]\nat_s = -1\ndo = \"hold\"\n"), "event 1: `at_s` must be from 0 to 86400 s");
        assert_eq!(message("[[event]]\nat_s = 1\ndo = \"instruction\"\n"), "event 1: an instruction needs `text`");
    }

    proptest! {
        #[test]
        fn no_text_panics(text in ".{0,200}", at in proptest::num::f64::ANY, held in proptest::num::f64::ANY) {
            let _ = Script::from_toml(&text);
            let _ = Script::from_toml(&format!("[[event]]\nat_s = {at:?}\ndo = \"setpoint\"\nfor_s = {held:?}\n"));
        }
    }
}
