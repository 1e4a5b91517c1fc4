//! Table cells, and flattening of messages.

use serde_json::Value;

/// Type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Bool,
    Int,
    Real,
    Text,
}

impl Kind {
    /// The type that can hold cells of both types.
    pub(super) fn with(self, other: Self) -> Self {
        match (self, other) {
            (a, b) if a == b => a,
            (Self::Int, Self::Real) | (Self::Real, Self::Int) => Self::Real,
            _ => Self::Text,
        }
    }
}

/// A non-empty cell.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    Bool(bool),
    Int(i64),
    Real(f64),
    Text(String),
}

impl Cell {
    pub(super) fn kind(&self) -> Kind {
        match self {
            Self::Bool(_) => Kind::Bool,
            Self::Int(_) => Kind::Int,
            Self::Real(_) => Kind::Real,
            Self::Text(_) => Kind::Text,
        }
    }

    /// Converts to a column of another type, which must be able to hold it ([`Kind::with`]).
    pub(super) fn into_kind(self, kind: Kind) -> Self {
        match (self, kind) {
            (Self::Int(number), Kind::Real) => Self::Real(number as f64),
            (cell, kind) if cell.kind() == kind => cell,
            (cell, _) => Self::Text(cell.text()),
        }
    }

    /// The text of the cell.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Bool(value) => value.to_string(),
            Self::Int(value) => value.to_string(),
            Self::Real(value) => value.to_string(),
            Self::Text(value) => value.clone(),
        }
    }
}

/// The leaves of a message, each named by its path of keys joined by dots. A list is a single leaf, as JSON; nulls are
/// omitted.
pub(super) fn flatten(name: &str, value: &Value, cells: &mut Vec<(String, Cell)>) {
    let cell = match value {
        Value::Null => return,
        Value::Object(fields) => {
            for (key, value) in fields {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                flatten(&name, value, cells);
            }
            return;
        }
        Value::Bool(value) => Cell::Bool(*value),
        Value::Number(number) => match number.as_i64() {
            Some(whole) => Cell::Int(whole),
            None => Cell::Real(number.as_f64().unwrap_or(f64::NAN)),
        },
        Value::String(text) => Cell::Text(text.clone()),
        Value::Array(_) => Cell::Text(value.to_string()),
    };
    cells.push((name.to_owned(), cell));
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_message_is_flattened_to_its_leaves() {
        let mut cells = Vec::new();
        flatten("", &json!({"a": {"b": 1, "c": null, "d": [1, {"e": 2}]}, "f": 0.5, "g": "x", "h": true}), &mut cells);
        let shown: Vec<_> = cells.iter().map(|(name, cell)| (name.as_str(), cell.text())).collect();
        let expected = [("a.b", "1"), ("a.d", "[1,{\"e\":2}]"), ("f", "0.5"), ("g", "x"), ("h", "true")];
        assert_eq!(shown, expected.map(|(name, text)| (name, text.to_owned())));
    }

    #[test]
    fn a_column_of_whole_and_broken_numbers_is_of_broken_ones() {
        assert_eq!(Kind::Int.with(Kind::Real), Kind::Real);
        assert_eq!(Kind::Bool.with(Kind::Int), Kind::Text);
        assert_eq!(Cell::Int(2).into_kind(Kind::Real), Cell::Real(2.0));
        assert_eq!(Cell::Bool(true).into_kind(Kind::Text), Cell::Text("true".to_owned()));
    }
}
