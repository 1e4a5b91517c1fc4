//! Tokens: lower-case words, stems, forgiven spelling.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use super::{lexicon, spelling};

/// Longest instruction that is read, bytes; the rest is left unread. A model has a window too, and memory stays bounded.
const LONGEST: usize = 4096;

/// Words of an instruction; `,` and `.` stand for soft and hard breaks. Misspelt words are put right where one known word is
/// clearly nearest.
///
/// Words near to one of `tags` are left as they are: the tags put them right later.
pub(super) fn tokens(text: &str, tags: &BTreeSet<String>) -> Vec<String> {
    let near = |word: &str| {
        let limit = spelling::forgiven(word.len());
        let rival = nearest_known(word, limit).map_or(limit, |known| spelling::distance(word, known));
        limit > 0
            && tags
                .iter()
                .any(|tag| tag.len() > 3 && tag.len().abs_diff(word.len()) <= rival && spelling::distance(word, tag) <= rival)
    };
    let right = |word: String| {
        let leave = tags.contains(&word) || tags.contains(&singular(&word)) || (!is_known(&word) && near(&word));
        if leave { word } else { corrected(&word) }
    };
    raw_tokens(text).into_iter().map(right).collect()
}

/// Words as written, lower case.
pub(super) fn raw_tokens(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut word = String::new();
    for c in text.chars().take(LONGEST).flat_map(char::to_lowercase).chain([' ']) {
        match c {
            'a'..='z' | '0'..='9' => word.push(c),
            '\'' | '’' | '`' => {}
            c if c.is_alphanumeric() => word.push(c),
            c => {
                if !word.is_empty() {
                    out.push(core::mem::take(&mut word));
                }
                let mark = match c {
                    ',' | '(' | ')' | '–' | '—' => ",",
                    '.' | ';' | '!' | '?' | ':' | '\n' | '→' => ".",
                    '&' => "and",
                    _ => continue,
                };
                out.push(mark.to_owned());
            }
        }
    }
    out
}

/// The stem a word is compared by: singular, without endings.
pub(super) fn stem(word: &str) -> String {
    if let Some((_, stem)) = lexicon::IRREGULAR.iter().find(|(form, _)| *form == word) {
        return (*stem).to_owned();
    }
    singular(word)
}

/// Singular of a regular plural.
pub(super) fn singular(word: &str) -> String {
    if let Some((_, stem)) = lexicon::IRREGULAR.iter().find(|(form, _)| *form == word) {
        return (*stem).to_owned();
    }
    if word.len() > 3 && !word.ends_with("ss") && !word.ends_with("us") && !word.ends_with("is") {
        if let Some(base) = word.strip_suffix("ies") {
            return format!("{base}y");
        }
        for ending in ["ches", "shes", "xes", "sses"] {
            if word.ends_with(ending) {
                return word[..word.len() - 2].to_owned();
            }
        }
        if let Some(base) = word.strip_suffix('s') {
            return base.to_owned();
        }
    }
    word.to_owned()
}

/// Stems a content word may have: endings of verbs and doers stripped, for comparing uses.
pub(super) fn stems(word: &str) -> Vec<String> {
    let first = stem(word);
    let mut out = vec![first.clone()];
    for ending in ["ing", "ed", "er", "ers", "or", "able"] {
        if let Some(base) = first.strip_suffix(ending)
            && base.len() >= 3
        {
            out.push(base.to_owned());
            out.push(format!("{base}e"));
            let mut undoubled: Vec<char> = base.chars().collect();
            let last = undoubled.pop();
            if undoubled.last() == last.as_ref() {
                out.push(undoubled.into_iter().collect());
            }
        }
    }
    out
}

/// Words of everyday life that are right as they stand, but that no other word is put right to.
fn everyday() -> &'static BTreeSet<&'static str> {
    static EVERYDAY: OnceLock<BTreeSet<&'static str>> = OnceLock::new();
    EVERYDAY.get_or_init(|| lexicon::KNOWN.iter().chain(lexicon::COMMON_VERBS).copied().collect())
}

/// Every word the grammar and the tables of synonyms use.
fn known() -> &'static BTreeSet<String> {
    static KNOWN: OnceLock<BTreeSet<String>> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let mut words = BTreeSet::new();
        let mut add = |phrase: &str| words.extend(phrase.split(' ').map(str::to_owned));
        lexicon::VERBS.iter().for_each(|(w, _)| add(w));
        lexicon::VERB_PREPOSITIONS.iter().for_each(|(w, _)| add(w));
        lexicon::COLOURS.iter().for_each(|(w, _)| add(w));
        lexicon::SIZES.iter().for_each(|(w, _)| add(w));
        lexicon::ORDINALS.iter().for_each(|(w, _)| add(w));
        lexicon::RELATIONS.iter().for_each(|(w, _)| add(w));
        lexicon::SIDES.iter().for_each(|(w, _)| add(w));
        lexicon::SYNONYMS.iter().flat_map(|group| group.iter()).for_each(|w| add(w));
        lexicon::HYPERNYMS.iter().for_each(|(w, below)| {
            add(w);
            below.iter().for_each(|w| add(w));
        });
        lexicon::GENERAL_USES.iter().for_each(|(w, uses)| {
            add(w);
            uses.iter().for_each(|w| add(w));
        });
        lexicon::IRREGULAR.iter().for_each(|(w, stem)| {
            add(w);
            add(stem);
        });
        for list in [
            lexicon::ADVERBS,
            lexicon::FLUFF,
            lexicon::SOFT,
            lexicon::VAGUE,
            lexicon::PARTS,
            lexicon::SURROUNDINGS,
            lexicon::DETERMINERS,
            lexicon::DROPPED,
            lexicon::GRAMMAR,
            lexicon::EMPTY,
        ] {
            list.iter().for_each(|w| add(w));
        }
        words
    })
}

/// Whether the parser knows the word or its stem.
pub(super) fn is_known(word: &str) -> bool {
    let known = known();
    let has = |w: &str| known.contains(w) || everyday().contains(w);
    has(word)
        || has(&singular(word))
        || stems(word).iter().any(|stem| has(stem))
        || word.chars().all(|c| c.is_ascii_digit() || c == ',' || c == '.')
}

/// The known word that a misspelt one is nearest to, when one alone is near enough and starts with the same letter or has
/// only two letters swapped; else the word itself.
fn corrected(word: &str) -> String {
    if is_known(word) || word.len() < 3 {
        return word.to_owned();
    }
    // Short words are put right only from this list: there are too many words of three letters.
    for (wrong, right) in [
        ("teh", "the"),
        ("hte", "the"),
        ("adn", "and"),
        ("nad", "and"),
        ("fyl", "fly"),
        ("flt", "fly"),
        ("flyy", "fly"),
        ("og", "go"),
        ("ot", "to"),
        ("rde", "red"),
        ("tto", "to"),
        ("tree", "tree"),
        ("tre", "tree"),
        ("cra", "car"),
        ("carr", "car"),
        ("teee", "tree"),
        ("balck", "black"),
        ("blak", "black"),
        ("fnid", "find"),
        ("thne", "then"),
        ("hten", "then"),
    ] {
        if word == wrong {
            return right.to_owned();
        }
    }
    let limit = spelling::forgiven(word.len());
    if limit == 0 {
        return word.to_owned();
    }
    let plural = word.len() > 4 && word.ends_with('s');
    match nearest_known(word, limit) {
        // A noun is put right where the tags at hand are known, for they come first.
        Some(known) if nouns().contains(known.as_str()) => word.to_owned(),
        Some(known) => known.clone(),
        None if plural => corrected(&word[..word.len() - 1]),
        None => word.to_owned(),
    }
}

/// The general noun that a misspelt one is nearest to, or the word itself.
pub(super) fn general_noun(word: &str) -> String {
    match nearest_known(word, spelling::forgiven(word.len())) {
        Some(known) if nouns().contains(known.as_str()) => known.clone(),
        _ => word.to_owned(),
    }
}

/// Nouns of the general tables.
fn nouns() -> &'static BTreeSet<&'static str> {
    static NOUNS: OnceLock<BTreeSet<&'static str>> = OnceLock::new();
    NOUNS.get_or_init(|| {
        let synonyms = lexicon::SYNONYMS.iter().flat_map(|group| group.iter().copied());
        let kinds = lexicon::HYPERNYMS.iter().flat_map(|(w, below)| below.iter().copied().chain([*w]));
        let used = lexicon::GENERAL_USES.iter().flat_map(|(w, uses)| uses.iter().copied().chain([*w]));
        let irregular = lexicon::IRREGULAR.iter().flat_map(|(w, stem)| [*w, *stem]);
        synonyms.chain(kinds).chain(used).chain(irregular).flat_map(|w| w.split(' ')).collect()
    })
}

fn nearest_known(word: &str, limit: usize) -> Option<&'static String> {
    known()
        .iter()
        .filter(|known| known.len() >= 3 && known.len().abs_diff(word.len()) <= limit)
        .map(|known| {
            let edits = spelling::distance(word, known);
            // Ties: the same first letter, then the longer word, for a letter left out is the commonest slip.
            (edits, known.chars().next() != word.chars().next(), core::cmp::Reverse(known.len()), known)
        })
        .filter(|(edits, ..)| *edits <= limit)
        .min()
        .map(|(.., known)| known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spelling_is_put_right_and_known_words_stay() {
        let none = BTreeSet::new();
        // Nouns wait for the tags at hand.
        assert_eq!(tokens("Fly to teh rde crnae!", &none), ["fly", "to", "the", "red", "crnae", "."]);
        assert_eq!(tokens("aproach, throgh", &none), ["approach", ",", "through"]);
        assert_eq!(["bulding", "brige", "crnae"].map(general_noun), ["building", "bridge", "crane"]);
        let tags = BTreeSet::from(["barge".to_owned(), "school".to_owned()]);
        assert_eq!(tokens("barge scool", &tags), ["barge", "scool"]);
        assert_eq!(tokens("the horse", &none), ["the", "horse"]);
        assert_eq!(tokens("don't", &none), ["dont"]);
    }

    #[test]
    fn stems_meet() {
        for (a, b) in [("driven", "drive"), ("lifting", "lift"), ("lifts", "lift"), ("sitting", "sit"), ("leaves", "leaf")] {
            assert!(stems(a).contains(&b.to_owned()), "{a} {:?}", stems(a));
        }
    }
}
