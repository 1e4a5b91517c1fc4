//! Lookup tables: sets of words, and phrases with their meanings.
//!
//! They are parsed from data; a list with a duplicate, or with a phrase that no instruction can contain, is rejected.

use std::collections::{BTreeMap, BTreeSet};

use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// A set of words.
#[derive(Debug)]
pub(crate) struct Words(BTreeSet<String>);

impl Words {
    /// Whether the word is one of them.
    pub(crate) fn contains(&self, word: &str) -> bool {
        self.0.contains(word)
    }

    /// All of them, in alphabetical order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(String::as_str)
    }
}

impl<'de> Deserialize<'de> for Words {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut words = BTreeSet::new();
        for word in Vec::<String>::deserialize(deserializer)? {
            check(&word).map_err(Error::custom)?;
            if let Some(twice) = words.replace(word) {
                return Err(Error::custom(format!("`{twice}` occurs twice in a list")));
            }
        }
        Ok(Self(words))
    }
}

/// Phrases of one or more words, each with its meaning.
#[derive(Debug)]
pub(crate) struct Phrases<T = ()> {
    /// By first word: the remaining words and the meaning, longest phrase first.
    by_first: BTreeMap<String, Vec<(Vec<String>, T)>>,
}

impl<T: Copy> Phrases<T> {
    /// The longest phrase at the start of `words`: its number of words, and its meaning.
    pub(super) fn longest(&self, words: &[String]) -> Option<(usize, T)> {
        let (first, rest) = words.split_first()?;
        let (others, meaning) = self.by_first.get(first)?.iter().find(|(others, _)| rest.starts_with(others))?;
        Some((1 + others.len(), *meaning))
    }

    /// Number of words of the longest phrase at the start of `words`.
    pub(crate) fn length(&self, words: &[String]) -> Option<usize> {
        self.longest(words).map(|(length, _)| length)
    }

    /// The meaning of a single word.
    pub(crate) fn get(&self, word: &str) -> Option<T> {
        // The shortest phrase comes last.
        let (others, meaning) = self.by_first.get(word)?.last()?;
        others.is_empty().then_some(*meaning)
    }

    /// Whether the word by itself is one of the phrases.
    pub(super) fn contains(&self, word: &str) -> bool {
        self.get(word).is_some()
    }

    /// Whether some phrase begins with the word.
    pub(super) fn begin_with(&self, word: &str) -> bool {
        self.by_first.contains_key(word)
    }

    /// Every word of every phrase.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        let others = self.by_first.values().flatten().flat_map(|(others, _)| others);
        self.by_first.keys().chain(others).map(String::as_str)
    }

    fn add(&mut self, phrase: &str, meaning: T) -> Result<(), String> {
        check(phrase)?;
        let mut words = phrase.split(' ').map(str::to_owned);
        let first = words.next().unwrap_or_default();
        let others: Vec<String> = words.collect();
        let beginning_alike = self.by_first.entry(first).or_default();
        if beginning_alike.iter().any(|(known, _)| *known == others) {
            return Err(format!("`{phrase}` occurs twice in a table"));
        }
        let at = beginning_alike.partition_point(|(known, _)| known.len() > others.len());
        beginning_alike.insert(at, (others, meaning));
        Ok(())
    }
}

/// From lists of phrases by meaning.
impl<'de, T: Copy + Ord + Deserialize<'de>> Deserialize<'de> for Phrases<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut table = Self { by_first: BTreeMap::new() };
        for (meaning, phrases) in BTreeMap::<T, Vec<String>>::deserialize(deserializer)? {
            phrases.iter().try_for_each(|phrase| table.add(phrase, meaning)).map_err(Error::custom)?;
        }
        Ok(table)
    }
}

/// Parses a list of phrases without meanings.
pub(super) fn list<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Phrases, D::Error> {
    let mut table = Phrases { by_first: BTreeMap::new() };
    let phrases = Vec::<String>::deserialize(deserializer)?;
    phrases.iter().try_for_each(|phrase| table.add(phrase, ())).map_err(Error::custom)?;
    Ok(table)
}

/// Words and the basic form of each.
#[derive(Debug)]
pub(crate) struct Forms(BTreeMap<String, String>);

impl Forms {
    /// The basic form of this word.
    pub(crate) fn plain(&self, word: &str) -> Option<&str> {
        self.0.get(word).map(String::as_str)
    }

    /// All words that have a basic form.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// All basic forms, once for each of their words.
    pub(super) fn plains(&self) -> impl Iterator<Item = &str> {
        self.0.values().map(String::as_str)
    }
}

/// From lists of words by basic form.
impl<'de> Deserialize<'de> for Forms {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut forms = BTreeMap::new();
        for (plain, words) in BTreeMap::<String, Vec<String>>::deserialize(deserializer)? {
            check(&plain).map_err(Error::custom)?;
            for word in words {
                check(&word).map_err(Error::custom)?;
                if forms.contains_key(&word) {
                    return Err(Error::custom(format!("`{word}` occurs twice in a table")));
                }
                forms.insert(word, plain.clone());
            }
        }
        Ok(Self(forms))
    }
}

/// Phrases, and the single word that each stands for.
#[derive(Debug)]
pub(super) struct Compounds(Vec<(Vec<String>, String)>);

impl Compounds {
    /// The longest phrase at the start of `words`: its number of words, and the word that it stands for.
    pub(super) fn longest(&self, words: &[&str]) -> Option<(usize, &str)> {
        let starts = |phrase: &[String]| phrase.len() <= words.len() && phrase.iter().zip(words).all(|(part, word)| part == word);
        let longest = self.0.iter().filter(|(phrase, _)| starts(phrase)).max_by_key(|(phrase, _)| phrase.len());
        longest.map(|(phrase, plain)| (phrase.len(), plain.as_str()))
    }
}

/// From lists of phrases by word.
impl<'de> Deserialize<'de> for Compounds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut known = BTreeMap::new();
        for (plain, phrases) in BTreeMap::<String, Vec<String>>::deserialize(deserializer)? {
            for phrase in phrases {
                check(&phrase).map_err(Error::custom)?;
                let words: Vec<String> = phrase.split(' ').map(str::to_owned).collect();
                if words.len() < 2 {
                    return Err(Error::custom(format!("`{phrase}` is a single word already")));
                }
                if known.insert(words, plain.clone()).is_some() {
                    return Err(Error::custom(format!("`{phrase}` occurs twice in a table")));
                }
            }
        }
        Ok(Self(known.into_iter().collect()))
    }
}

/// Rejects phrases that no instruction can contain: words must be lower case, with single spaces between them.
fn check(phrase: &str) -> Result<(), String> {
    let usable = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_alphanumeric() && !c.is_uppercase());
    if phrase.split(' ').all(usable) {
        return Ok(());
    }
    Err(format!("`{phrase}` must be lower-case words separated by single spaces"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn the_longest_phrase_is_taken() {
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Meaning {
            Go,
            Scan,
        }
        let text = "go = [\"look\", \"look for\"]\nscan = [\"look all around\"]";
        let phrases: Phrases<Meaning> = toml::from_str(text).unwrap();
        assert_eq!(phrases.longest(&words("look for the car")), Some((2, Meaning::Go)));
        assert_eq!(phrases.longest(&words("look all around it")), Some((3, Meaning::Scan)));
        assert_eq!(phrases.longest(&words("look all")), Some((1, Meaning::Go)));
        assert_eq!((phrases.longest(&words("for the car")), phrases.longest(&[])), (None, None));
        assert_eq!((phrases.get("look"), phrases.get("all"), phrases.begin_with("look")), (Some(Meaning::Go), None, true));
        assert!(toml::from_str::<Phrases<Meaning>>("fly = [\"fly\"]").is_err());
    }

    #[test]
    fn duplicates_and_impossible_phrases_are_refused() {
        #[derive(Debug, Deserialize)]
        struct File {
            #[serde(rename = "words")]
            _words: Option<Words>,
            #[serde(rename = "forms")]
            _forms: Option<Forms>,
            #[serde(default, rename = "list", deserialize_with = "some_list")]
            _list: Option<Phrases>,
        }
        fn some_list<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Phrases>, D::Error> {
            list(deserializer).map(Some)
        }
        let refused = |text: &str| toml::from_str::<File>(text).unwrap_err().to_string();
        assert!(refused("words = [\"car\", \"bus\", \"car\"]").contains("`car` occurs twice"));
        assert!(refused("list = [\"look for\", \"look for\"]").contains("`look for` occurs twice"));
        assert!(refused("[forms]\nred = [\"crimson\"]\npink = [\"crimson\"]").contains("`crimson` occurs twice"));
        for word in ["Car", "", "two  spaces", "it's"] {
            assert!(refused(&format!("words = [\"{word}\"]")).contains("lower-case"), "{word}");
        }
    }
}
