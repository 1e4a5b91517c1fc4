//! JSON for people and their scripts: durations and times in seconds, and numbers of at most six digits.
//!
//! The log keeps what was calculated; from these files nothing is replayed.

use serde_json::{Map, Number, Value};

/// Significant digits of a number.
const DIGITS: i32 = 6;
const NANOS: f64 = 1e9;
/// Keys whose values are nanoseconds of flight time.
const TIMES: [&str; 4] = ["captured", "asked", "answered", "deadline"];

/// A message of the log as it is written for people. A time or a duration gets the ending `_s`.
#[must_use]
pub fn for_people(value: Value) -> Value {
    match value {
        Value::Number(number) => Value::Number(rounded(number)),
        Value::Array(values) => Value::Array(values.into_iter().map(for_people).collect()),
        Value::Object(fields) => Value::Object(fields.into_iter().map(field).collect::<Map<_, _>>()),
        other => other,
    }
}

fn field((key, value): (String, Value)) -> (String, Value) {
    let seconds = match &value {
        Value::Number(nanos) if TIMES.contains(&key.as_str()) => nanos.as_f64().map(|nanos| nanos / NANOS),
        Value::Object(fields) => duration(fields),
        _ => None,
    };
    match seconds.and_then(Number::from_f64) {
        Some(seconds) => (format!("{key}_s"), Value::Number(rounded(seconds))),
        None => (key, for_people(value)),
    }
}

/// The seconds of a duration as it is serialised: `secs` and `nanos`.
fn duration(fields: &Map<String, Value>) -> Option<f64> {
    let part = |key: &str| fields.get(key).and_then(Value::as_f64);
    (fields.len() == 2).then_some(())?;
    Some(part("secs")? + part("nanos")? / NANOS)
}

fn rounded(number: Number) -> Number {
    let Some(value) = number.as_f64().filter(|_| number.is_f64()) else { return number };
    Number::from_f64(six_digits(value)).unwrap_or(number)
}

/// The nearest number of six significant digits.
#[must_use]
pub fn six_digits(value: f64) -> f64 {
    // Through its decimal form, whose rounding is the same on every machine.
    format!("{value:.*e}", DIGITS as usize - 1).parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::json;

    use super::*;

    #[test]
    fn times_are_seconds_and_numbers_are_short() {
        let row = json!({"captured": 6_050_000_000_u64, "max_time": {"secs": 300, "nanos": 500_000_000}, "x": [81.595_631_299, 7, -0.000_123_456_78],
            "at": {"secs": "3", "nanos": 1}, "text": "1.23456789", "none": null});
        assert_eq!(
            for_people(row),
            json!({"captured_s": 6.05, "max_time_s": 300.5, "x": [81.5956, 7, -0.000_123_457], "at": {"secs": "3", "nanos": 1},
                "text": "1.23456789", "none": null})
        );
    }

    proptest! {
        #[test]
        fn a_number_moves_by_less_than_its_last_digit(value in proptest::num::f64::NORMAL) {
            let short = six_digits(value);
            prop_assert!((short - value).abs() <= value.abs() * 1e-5, "{value} {short}");
        }
    }
}
