//! The numbers of a YAML file, by the crate `saphyr-parser`. Its events are read, not a tree: a calibration is flat, and a
//! tree of hostile input may be deep or have aliases that multiply.

use std::collections::{BTreeMap, BTreeSet};

use saphyr_parser::{Event, Parser};

use super::CalibrationError;

/// Greatest depth of a file; a matrix has 3.
const DEPTH: usize = 8;

/// What OpenCV and ROS write below the name of a matrix.
const MATRIX: [&str; 4] = ["rows", "cols", "dt", "data"];

/// Values by their path of keys, in small letters and without underscores: `camera_matrix.data` is `cameramatrix.data`.
pub(super) struct Values(BTreeMap<String, Value>);

/// The words of a value.
#[derive(Default)]
struct Value {
    /// The path as it is written.
    written: String,
    words: Vec<String>,
}

/// A key in the form in which it is compared.
fn plain(key: &str) -> String {
    key.to_lowercase().replace('_', "")
}

/// Reads the first document.
pub(super) fn values(text: &str) -> Result<Values, CalibrationError> {
    let wrong = |what: &str| CalibrationError::Yaml(what.to_owned());
    // OpenCV's first line is not that of YAML, which has a space in it.
    let text = match text.strip_prefix("%YAML:") {
        Some(rest) => rest.split_once('\n').map_or("", |(_, rest)| rest),
        None => text,
    };
    let mut values = BTreeMap::<String, Value>::new();
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
                    *key = Some(text.into_owned());
                    continue;
                }
                let path: Vec<&str> = open.iter().flatten().flatten().map(String::as_str).collect();
                let written = path.join(".");
                let value = values.entry(plain(&written)).or_insert(Value { written, words: Vec::new() });
                value.words.push(text.into_owned());
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
    /// The values of the only camera of a file that has them below its name, as Kalibr's `cam0`; others as they are.
    pub(super) fn of_one_camera(self) -> Result<Self, CalibrationError> {
        let camera = |path: &str| {
            let (head, _) = path.split_once('.')?;
            let number = head.strip_prefix("cam")?;
            (!number.is_empty() && number.bytes().all(|b| b.is_ascii_digit())).then(|| head.to_owned())
        };
        let cameras: BTreeSet<String> = self.0.keys().filter_map(|path| camera(path)).collect();
        if cameras.len() > 1 {
            return Err(CalibrationError::Several(cameras.into_iter().take(4).collect::<Vec<_>>().join(", ")));
        }
        let Some(camera) = cameras.first() else { return Ok(self) };
        let inner = |path: String| path.strip_prefix(camera.as_str()).and_then(|rest| rest.strip_prefix('.')).map(str::to_owned);
        Ok(Self(self.0.into_iter().map(|(path, value)| (inner(path.clone()).unwrap_or(path), value)).collect()))
    }

    /// The first key, as it is written, that is neither one of `read` (as a value, or a matrix as OpenCV writes it) nor one
    /// of `others` (with anything below it).
    pub(super) fn unknown(&self, read: &[&str], others: &[&str]) -> Option<&str> {
        let is = |key: &str, keys: &[&str]| keys.iter().any(|known| plain(known) == key);
        let known = |path: &str| match path.split_once('.') {
            Some((head, below)) => is(head, others) || (is(head, read) && MATRIX.contains(&below)),
            // The words of a document without keys.
            None => path.is_empty() || is(path, read) || is(path, others),
        };
        self.0.iter().find(|(path, _)| !known(path)).map(|(_, value)| value.written.as_str())
    }

    /// The words of a value that has one of several names, and its name.
    fn find(&self, keys: &[&'static str]) -> Result<Option<(&'static str, &[String])>, CalibrationError> {
        let of = |key: &&'static str| {
            let path = plain(key);
            let value = self.0.get(&path).or_else(|| self.0.get(&format!("{path}.data")))?;
            Some((*key, value.words.as_slice()))
        };
        let mut found = keys.iter().filter_map(of);
        match (found.next(), found.next()) {
            (Some((first, _)), Some((second, _))) => Err(CalibrationError::Twice(first, second)),
            (found, _) => Ok(found),
        }
    }

    /// A word.
    pub(super) fn text(&self, key: &'static str) -> Result<Option<&str>, CalibrationError> {
        match self.find(&[key])? {
            None => Ok(None),
            Some((_, [word])) => Ok(Some(word)),
            Some(_) => Err(CalibrationError::Invalid(key, "one word is needed")),
        }
    }

    /// A number, and its name.
    pub(super) fn number(&self, keys: &[&'static str]) -> Result<Option<(&'static str, f64)>, CalibrationError> {
        match self.numbers(keys)? {
            None => Ok(None),
            Some((key, numbers)) => match numbers[..] {
                [number] => Ok(Some((key, number))),
                _ => Err(CalibrationError::Invalid(key, "one number is needed")),
            },
        }
    }

    /// The numbers of a list or of a matrix, and its name.
    #[allow(clippy::type_complexity, reason = "a name and numbers")]
    pub(super) fn numbers(&self, keys: &[&'static str]) -> Result<Option<(&'static str, Vec<f64>)>, CalibrationError> {
        let Some((key, words)) = self.find(keys)? else { return Ok(None) };
        let number = |word: &String| word.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let numbers: Option<Vec<f64>> = words.iter().map(number).collect();
        numbers
            .map(|numbers| Some((key, numbers)))
            .ok_or(CalibrationError::Invalid(key, "it contains something that is no number"))
    }
}
