//! Colour changes of variants, with the names that depend on them.

use std::collections::{BTreeMap, BTreeSet};

use spf_core::rng::RandomStream;
use toml::Spanned;

use super::super::expand::Placed;
use super::super::raw::RawScene;
use super::super::source::Source;
use super::super::surface::palette;
use super::{Span, permutation};
use crate::error::{SceneError, nearest};
use crate::limits::LONGEST_TAG;

/// Longest word for a colour, characters.
const LONGEST_WORD: usize = 40;

/// Colours as written, word and material, in random order.
pub(super) fn order(colours: &BTreeMap<String, Spanned<String>>, rng: &mut RandomStream) -> Vec<(String, (String, Span))> {
    let written: Vec<_> = colours.iter().collect();
    let named = |at: usize| {
        let (word, material) = written[at];
        (word.clone(), (material.get_ref().clone(), material.span()))
    };
    permutation(written.len(), rng).into_iter().map(named).collect()
}

/// Rejects colours without a word or material, and a slot that the mesh lacks, whether or not this seed uses them.
pub(super) fn check(
    colours: &BTreeMap<String, Spanned<String>>,
    slot: &str,
    slots: &[(&'static str, &'static str)],
    raw: &RawScene,
    span: &Span,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    if !colours.is_empty() && !slots.iter().any(|(name, _)| *name == slot) {
        let names: Vec<&str> = slots.iter().map(|(name, _)| *name).collect();
        let hint = match names[..] {
            [] => "a model has its own materials".to_owned(),
            _ => format!("this mesh has the slots `{}`", names.join("`, `")),
        };
        return Err(source.error(span, format!("unknown material slot `{slot}`"), Some(hint)));
    }
    for (word, material) in colours {
        let usable = !word.trim().is_empty() && word.chars().count() <= LONGEST_WORD && !word.chars().any(char::is_uppercase);
        if !usable {
            let hint = format!("colours must be 1 to {LONGEST_WORD} lower-case characters");
            return Err(source.error(&material.span(), format!("invalid colour `{word}`"), Some(hint)));
        }
        let known = || raw.materials.keys().chain(palette().keys()).map(String::as_str);
        if !known().any(|name| name == material.get_ref()) {
            let hint = nearest(material.get_ref(), known()).map(|near| format!("did you mean `{near}`?"));
            return Err(source.error(&material.span(), format!("unknown material `{}`", material.get_ref()), hint));
        }
    }
    Ok(())
}

/// Repaints an object: its material, its `colour`, and that word in its names.
pub(super) fn paint(object: &mut Placed, slot: &str, word: &str, material: &(String, Span)) {
    object.materials.retain(|(name, _, _)| name != slot);
    object.materials.push((slot.to_owned(), material.0.clone(), material.1.clone()));
    if let Some(old) = object.tags.colour.replace(word.to_owned()) {
        let tags = &mut object.tags;
        for text in tags.names.iter_mut().chain(&mut tags.synonyms).chain(&mut tags.qualities) {
            *text = replaced(text, &old, word, ' ');
        }
        let key = object.new_key.as_ref().unwrap_or(&object.key);
        let usable = |word: &str| word.replace(|c: char| !c.is_ascii_lowercase() && !c.is_ascii_digit(), "_");
        object.new_key = Some(replaced(key, &usable(&old), &usable(word), '_'));
    }
}

/// `text` with whole words `old` replaced; words are separated by `divider`. Unchanged if it would become too long for
/// a tag.
fn replaced(text: &str, old: &str, new: &str, divider: char) -> String {
    let pad = |s: &str| format!("{divider}{s}{divider}");
    let padded = pad(text).replace(&pad(old), &pad(new));
    let new = padded.trim_matches(divider);
    if new.is_empty() || new.chars().count() > LONGEST_TAG { text.to_owned() } else { new.to_owned() }
}

/// Amount of text to search when an object is repainted.
pub(super) fn text_length(object: &Placed) -> u64 {
    let tags = &object.tags;
    tags.names.iter().chain(&tags.synonyms).chain(&tags.qualities).map(|text| 40 + text.len() as u64).sum()
}

/// Replaces the old ids by the new ones, each once, also where other objects refer to them.
pub(super) fn rename(placed: &mut [Placed]) {
    let mut taken: BTreeSet<String> = placed.iter().filter(|p| p.new_key.is_none()).map(|p| p.key.clone()).collect();
    let mut names = BTreeMap::new();
    for object in placed.iter_mut() {
        let Some(wanted) = object.new_key.take() else { continue };
        let mut key = wanted.clone();
        let mut number = 1;
        while !taken.insert(key.clone()) {
            number += 1;
            key = format!("{wanted}_{number}");
        }
        names.insert(core::mem::replace(&mut object.key, key.clone()), key);
    }
    for (of, _) in placed.iter_mut().filter_map(|object| object.opening_of.as_mut()) {
        if let Some(name) = names.get(of) {
            of.clone_from(name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_words_change() {
        assert_eq!(replaced("person in red", "red", "dark blue", ' '), "person in dark blue");
        assert_eq!(replaced("red", "red", "blue", ' '), "blue");
        assert_eq!(replaced("tired man", "red", "blue", ' '), "tired man");
        assert_eq!(replaced("dark_blue_car", "dark_blue", "white", '_'), "white_car");
    }
}
