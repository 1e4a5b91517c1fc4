//! The numbers of a YAML file, by the crate `saphyr-parser`. Its events are read, not a tree: a calibration is flat, and a
//! tree of hostile input may be deep or have aliases that multiply.

use std::collections::BTreeMap;

use saphyr_parser::{Event, Parser};

use super::CalibrationError;

/// Greatest depth of a file; a matrix has 3.
const DEPTH: usize = 8;

/// Values by their key at the top, or by `KEY.data`, in small letters and without underscores.
pub(super) struct Values(BTreeMap<String, Vec<String>>);

/// Reads the first document.
pub(super) fn values(text: &str) -> Result<Values, CalibrationError> {
    let wrong = |what: &str| CalibrationError::Yaml(what.to_owned());
    // OpenCV's first line is not that of YAML, which has a space in it.
    let text = match text.strip_prefix("%YAML:") {
        Some(rest) => rest.split_once('\n').map_or("", |(_, rest)| rest),
        None => text,
    };
    let mut values = BTreeMap::<String, Vec<String>>::new();
    // The open collections: the key that comes before the next value, or `None` inside of a sequence.
    let mut open: Vec<Option<Option<String>>> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, _) = event.map_err(|error| wrong(&error.to_string()))?;
        match event {
            Event::Alias(_) => return Err(wrong("it has aliases")),
            Event::MappingStart(..) | Event::SequenceStart(..) => {
                if open.len() >= DEPTH {
                    return Err(wrong("it is too deep"));
                }
                let mapping = matches!(event, Event::MappingStart(..));
                open.push(mapping.then_some(None));
            }
            Event::MappingEnd | Event::SequenceEnd => {
                open.pop();
                // A collection was a value; it may also be a key, which no calibration has.
                if let Some(Some(key)) = open.last_mut() {
                    *key = None;
                }
            }
            Event::Scalar(text, ..) => {
                if let Some(Some(key @ None)) = open.last_mut() {
                    *key = Some(text.to_lowercase().replace('_', ""));
                    continue;
                }
                let path: Vec<&str> = open.iter().flatten().flatten().map(String::as_str).collect();
                values.entry(path.join(".")).or_default().push(text.into_owned());
                if let Some(Some(key)) = open.last_mut() {
                    *key = None;
                }
            }
            Event::DocumentEnd => break,
            _ => {}
        }
    }
    Ok(Values(values))
}

impl Values {
    fn find(&self, key: &str) -> Option<&[String]> {
        let key = key.replace('_', "");
        self.0.get(&key).or_else(|| self.0.get(&format!("{key}.data"))).map(Vec::as_slice)
    }

    /// A word.
    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.find(key)?.first().map(String::as_str)
    }

    /// A number.
    pub(super) fn number(&self, key: &'static str) -> Result<Option<f64>, CalibrationError> {
        Ok(self.numbers(key)?.and_then(|numbers| numbers.first().copied()))
    }

    /// The numbers of a list or of a matrix.
    pub(super) fn numbers(&self, key: &'static str) -> Result<Option<Vec<f64>>, CalibrationError> {
        let Some(words) = self.find(key) else { return Ok(None) };
        let number = |word: &String| word.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let numbers: Option<Vec<f64>> = words.iter().map(number).collect();
        numbers.map(Some).ok_or(CalibrationError::Invalid(key, "it contains something that is no number"))
    }
}
