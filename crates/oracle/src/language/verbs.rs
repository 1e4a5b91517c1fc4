//! Verbs in any inflected form.

use super::lex::{leads_on, singular};
use super::lexicon::{PHRASES, VERBS};
use super::meaning::Verb;

/// The verb at the start: its number of words, and its meaning.
pub(super) fn starts_verb(words: &[String]) -> Option<(usize, Verb)> {
    let first = words.first()?;
    let mut base = words.to_vec();
    base.truncate(6);
    base[0] = verb_stem(first)?;
    VERBS.verbs.longest(&base)
}

/// Whether words tell somebody to do something: a verb, and what leads on to its object. `Fly to the tower`, not `exit` or `park
/// station`.
pub(crate) fn demands(words: &[String]) -> bool {
    let leads = |word: &String| leads_on(word);
    starts_verb(words).is_some_and(|(length, _)| words.get(length).is_some_and(leads) || words[..length].iter().any(leads))
}

/// Whether the words begin with an order that is no flight, "wash the car", and not "open spaces".
pub(crate) fn is_other_order(words: &[String]) -> bool {
    let ordered = words.first().is_some_and(|word| PHRASES.other_orders.contains(word) && word != "give");
    let leads = |next: &String| matches!(next.as_str(), "me" | "us") || leads_on(next);
    ordered && starts_verb(words).is_none() && words.get(1).is_some_and(leads)
}

/// The base form of a known verb.
fn verb_stem(word: &str) -> Option<String> {
    let known = |w: &str| VERBS.verbs.begin_with(w);
    if known(word) {
        return Some(word.to_owned());
    }
    let mut forms = vec![singular(word)];
    if word == "flies" {
        forms.push("fly".to_owned());
    }
    if let Some(base) = word.strip_suffix("ing") {
        forms.push(base.to_owned());
        forms.push(format!("{base}e"));
        let mut chars: Vec<char> = base.chars().collect();
        let last = chars.pop();
        if chars.last() == last.as_ref() {
            forms.push(chars.into_iter().collect());
        }
    }
    forms.into_iter().find(|form| known(form))
}
