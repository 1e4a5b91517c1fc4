//! One episode of a foreign file, and errors that say where it is wrong.

use core::fmt;

use serde::de::{Deserialize, Deserializer, SeqAccess, Visitor};
use serde_json::Value;
use serde_json::value::RawValue;

use super::{EpisodeError, ImportError};

/// Maximum number of episodes of a file.
pub(super) const MOST_EPISODES: usize = 200_000;
/// Maximum size of an episode, bytes. Parsed, an array of numbers takes up to sixteen times its text.
const MAX_BYTES: usize = 1 << 20;
/// Maximum length of an id, characters.
const LONGEST_ID: usize = 200;

/// The texts of the episodes of a file. What else is in the file is skipped, as the benchmark's loader does.
#[derive(serde::Deserialize)]
pub(super) struct File<'a> {
    #[serde(borrow)]
    pub(super) episodes: Texts<'a>,
}

/// At most [`MOST_EPISODES`] texts.
pub(super) struct Texts<'a>(pub(super) Vec<&'a RawValue>);

impl<'de: 'a, 'a> Deserialize<'de> for Texts<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Bounded;
        impl<'de> Visitor<'de> for Bounded {
            type Value = Texts<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of at most {MOST_EPISODES} episodes")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut texts = Vec::new();
                while let Some(text) = list.next_element()? {
                    if texts.len() == MOST_EPISODES {
                        return Err(serde::de::Error::invalid_length(MOST_EPISODES + 1, &self));
                    }
                    texts.push(text);
                }
                Ok(Texts(texts))
            }
        }
        deserializer.deserialize_seq(Bounded)
    }
}

/// One episode.
pub(super) struct Episode<'a> {
    file: &'a str,
    number: usize,
    id: Option<String>,
    keys: Value,
}

impl<'a> Episode<'a> {
    /// The episode with this number, from 1.
    pub(super) fn read(file: &'a str, number: usize, text: &RawValue) -> Result<Self, ImportError> {
        let text = text.get();
        let mut episode = Self { file, number, id: None, keys: Value::Null };
        if text.len() > MAX_BYTES {
            return Err(episode.wrong("", format!("at most {MAX_BYTES} bytes"), format!("{} bytes", text.len())));
        }
        let keys: Value = serde_json::from_str(text).map_err(|error| episode.wrong("", "valid JSON", error.to_string()))?;
        if !keys.is_object() {
            return Err(episode.wrong("", "an object", words(Some(&keys))));
        }
        episode.keys = keys;
        episode.id = Some(episode.name("episode_id")?);
        Ok(episode)
    }

    /// An error in one of its keys.
    pub(super) fn wrong(&self, key: &str, expected: impl Into<String>, found: impl Into<String>) -> ImportError {
        Box::new(EpisodeError {
            file: self.file.to_owned(),
            number: self.number,
            id: self.id.clone(),
            key: if key.is_empty() { "(whole)".to_owned() } else { key.to_owned() },
            expected: expected.into(),
            found: found.into(),
        })
        .into()
    }

    /// The value at a key: names and numbers of entries, joined by `.`.
    fn at(&self, key: &str) -> Option<&Value> {
        key.split('.').try_fold(&self.keys, |value, part| match value {
            Value::Array(list) => list.get(part.parse::<usize>().ok()?),
            value => value.get(part),
        })
    }

    /// A string or an integer, as text.
    pub(super) fn name(&self, key: &str) -> Result<String, ImportError> {
        let name = match self.at(key) {
            Some(Value::String(text)) => Some(text.clone()),
            Some(Value::Number(number)) if number.is_i64() || number.is_u64() => Some(number.to_string()),
            _ => None,
        };
        name.filter(|name| (1..=LONGEST_ID).contains(&name.chars().count())).ok_or_else(|| {
            self.wrong(key, format!("a string of 1 to {LONGEST_ID} characters, or an integer"), words(self.at(key)))
        })
    }

    /// A text of 1 to `longest` characters, without white space around it.
    pub(super) fn text(&self, key: &str, longest: usize) -> Result<String, ImportError> {
        let text = self.at(key).and_then(Value::as_str).map(str::trim);
        let text = text.filter(|text| (1..=longest).contains(&text.chars().count()));
        text.map(str::to_owned)
            .ok_or_else(|| self.wrong(key, format!("a text of 1 to {longest} characters"), words(self.at(key))))
    }

    /// Exactly `N` numbers within ±`most`.
    pub(super) fn numbers<const N: usize>(&self, key: &str, what: &str, most: f64) -> Result<[f64; N], ImportError> {
        let list = self.at(key).and_then(Value::as_array).filter(|list| list.len() == N);
        list.and_then(|list| first(list, most))
            .ok_or_else(|| self.wrong(key, format!("{N} numbers within ±{most}: {what}"), words(self.at(key))))
    }

    /// The first three numbers of each entry of a list with 1 to `longest` entries, within ±`most`.
    pub(super) fn rows(&self, key: &str, what: &str, longest: usize, most: f64) -> Result<Vec<[f64; 3]>, ImportError> {
        let list = self.at(key).and_then(Value::as_array).filter(|list| (1..=longest).contains(&list.len()));
        let list =
            list.ok_or_else(|| self.wrong(key, format!("a list of 1 to {longest} positions, each {what}"), words(self.at(key))))?;
        let row = |(index, row): (usize, &Value)| {
            row.as_array().and_then(|numbers| first(numbers, most)).ok_or_else(|| {
                self.wrong(&format!("{key}.{index}"), format!("at least 3 numbers within ±{most}: {what}"), words(Some(row)))
            })
        };
        list.iter().enumerate().map(row).collect()
    }
}

/// The first `N` numbers of a list, within ±`most`.
fn first<const N: usize>(list: &[Value], most: f64) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for (number, value) in numbers.iter_mut().zip(list.get(..N)?) {
        *number = value.as_f64().filter(|number| number.abs() <= most)?;
    }
    Some(numbers)
}

/// What a value is, in words.
fn words(value: Option<&Value>) -> String {
    match value {
        None => "nothing".to_owned(),
        Some(Value::Null) => "null".to_owned(),
        Some(Value::Bool(_)) => "a truth value".to_owned(),
        Some(Value::Number(number)) => number.to_string(),
        Some(Value::String(text)) => format!("a text of {} characters", text.chars().count()),
        Some(Value::Array(list)) => match list.iter().find(|entry| !entry.is_number()) {
            None => format!("a list of {} numbers", list.len()),
            Some(entry) => format!("a list of {} entries with {}", list.len(), words(Some(entry))),
        },
        Some(Value::Object(keys)) => format!("an object with {} keys", keys.len()),
    }
}
