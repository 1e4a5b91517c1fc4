//! The forms of text actions: what a prompt states and a schema allows. Who flies them parses them.

use schemars::JsonSchema;

use super::schema::closed_schema;
use super::short::plain_numbers;
use crate::query::ActForm;

/// Maximum number of actions flown per reply.
pub const MAX_ACTIONS: usize = 3;
/// Minimum and maximum move of one action, metres.
pub const MOVE_METRES: (f64, f64) = (0.2, 5.0);
/// Minimum and maximum turn of one action, degrees.
pub const TURN_DEGREES: (f64, f64) = (1.0, 180.0);

/// What to do next.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "used only for its schema")]
struct WireActions {
    /// One to three commands, carried out in order.
    actions: Vec<WireAction>,
    /// Whether the whole instruction is fulfilled.
    done: bool,
}

/// One command.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "used only for its schema")]
struct WireAction {
    /// What to do.
    #[schemars(schema_with = "commands")]
    cmd: String,
    /// Metres or degrees; null with `hover` and `stop`.
    value: Option<f64>,
}

fn commands(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({
        "type": "string",
        "enum": ["forward", "back", "left", "right", "up", "down", "yaw_left", "yaw_right", "hover", "stop"]
    })
}

/// How to move next.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "used only for its schema")]
struct WireNumeric {
    /// Metres forward, negative backward.
    dx: f64,
    /// Metres to the right, negative to the left.
    dy: f64,
    /// Metres up, negative down.
    dz: f64,
    /// Degrees clockwise, negative counter-clockwise; turned first.
    dyaw: f64,
    /// Whether the whole instruction is fulfilled.
    done: bool,
}

/// What to do next.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "used only for its schema")]
struct WireDiscrete {
    /// The move.
    #[schemars(schema_with = "fixed")]
    action: String,
}

fn fixed(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({
        "type": "string",
        "enum": ["forward", "turn_left", "turn_right", "up", "down", "left", "right", "stop"]
    })
}

/// The JSON schema of an answer to an [`Act`](crate::query::QueryKind::Act) query, in the same portable subset as [`reply_schema`](super::reply_schema).
#[must_use]
pub fn moves_schema(form: ActForm) -> serde_json::Value {
    match form {
        ActForm::Commands => closed_schema::<WireActions>(),
        ActForm::Numeric => plain_numbers(closed_schema::<WireNumeric>()),
        ActForm::Discrete => closed_schema::<WireDiscrete>(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_has_a_schema_that_leaves_nothing_open() {
        for form in [ActForm::Commands, ActForm::Numeric, ActForm::Discrete] {
            let schema = moves_schema(form);
            assert_eq!(schema["additionalProperties"], false);
            assert!(!schema.to_string().contains("format"), "{schema}");
        }
        let commands = moves_schema(ActForm::Commands);
        let action = &commands["properties"]["actions"]["items"];
        assert_eq!(action["additionalProperties"], false);
        assert_eq!(action["required"], serde_json::json!(["cmd", "value"]));
    }
}
