//! Tokens: lower-case words, stems, spelling correction.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use super::compounds::apart;
use super::lexicon::{ADJECTIVES, NOUNS, PHRASES, SPELLING, VERBS};
use super::spelling;
use super::table::Words;
use super::times::is_time;

/// Maximum length of an instruction, bytes; the rest is ignored, to bound memory use.
const LONGEST: usize = 4096;

/// Words of an instruction; `,` and `.` stand for soft and hard breaks. Misspelt words are corrected where one known
/// word is clearly nearest, and two that were run together are one token with a space between them.
///
/// Words close to one of `tags` are left unchanged: they are corrected later against the tags.
pub(crate) fn tokens(text: &str, tags: &BTreeSet<String>) -> Vec<String> {
    let near = |word: &str| {
        let limit = spelling::forgiven(word.len());
        let rival = nearest_known(word, limit).map_or(limit, |known| spelling::distance(word, known));
        limit > 0
            && tags
                .iter()
                .any(|tag| tag.len() > 3 && tag.len().abs_diff(word.len()) <= rival && spelling::distance(word, tag) <= rival)
    };
    let right = |word: String| {
        // A common misspelling is not a scene word, however close: "hed" is not "red".
        let tag = |word: &String| !is_known(word) && SPELLING.slips.plain(word).is_none() && near(word);
        let known = |word: &str| tags.contains(word) || tags.contains(&singular(word));
        if known(&word) || is_known(&word) || is_time(&word) || is_right(&word) && SPELLING.slips.plain(&word).is_none() {
            return word;
        }
        if let Some(apart) = apart(&word, |second| known(second) || is_thing(&singular(second))) {
            return apart;
        }
        if tag(&word) { word } else { corrected(&word) }
    };
    let raw = raw_tokens(text);
    let begins = |at: usize| at == 0 || !is_word(&raw[at - 1]) || PHRASES.fillers.contains(&raw[at - 1]);
    let flown = |at: usize| {
        let word = &raw[at];
        let is_meant = begins(at) && raw.get(at + 1).is_some_and(|next| VERBS.prepositions.contains(next) || leads_on(next));
        if is_meant && !tags.contains(word) { flight(word) } else { None }
    };
    (0..raw.len()).map(|at| flown(at).map_or_else(|| right(raw[at].clone()), str::to_owned)).collect()
}

/// Whether a token is a word, and no break.
fn is_word(token: &str) -> bool {
    token != "," && token != "."
}

/// The verb of flying for which a word in its place, unknown elsewhere, is a slip: one letter from a form of the verb, or from
/// "flight" ("flie", "fligh", "flys").
fn flight(word: &str) -> Option<&'static str> {
    let slip = |(_, forms): &&(&str, &[&str])| forms.iter().any(|form| spelling::distance(word, form) == 1);
    if word.len() < 3 || is_listed(word) || ENGLISH.binary_search(&word).is_ok() {
        return None;
    }
    FLIGHT.iter().find(slip).map(|(verb, _)| *verb)
}

/// Verbs of flying, and the forms and nouns from which a slip may come.
const FLIGHT: [(&str, &[&str]); 3] =
    [("fly", &["fly", "flies", "flying", "flight"]), ("head", &["head", "heading"]), ("go", &["goes", "going"])];

/// Words as written, lower case.
pub(crate) fn raw_tokens(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut word = String::new();
    // Between words a hyphen separates; within one, it joins.
    let text = text.replace(" - ", " , ");
    for c in text.chars().take(LONGEST).flat_map(char::to_lowercase).chain([' ']) {
        match c {
            'a'..='z' | '0'..='9' => word.push(c),
            'à' | 'á' | 'â' | 'ä' => word.push('a'),
            'è' | 'é' | 'ê' | 'ë' => word.push('e'),
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

/// The stem used for comparing a word: singular, without endings.
pub(super) fn stem(word: &str) -> String {
    if let Some(stem) = SPELLING.irregular.plain(word) {
        return stem.to_owned();
    }
    singular(word)
}

/// Singular of a regular plural.
pub(crate) fn singular(word: &str) -> String {
    if let Some(stem) = SPELLING.irregular.plain(word) {
        return stem.to_owned();
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
            // The mark of "children's" has been removed here.
            return SPELLING.irregular.plain(base).unwrap_or(base).to_owned();
        }
    }
    word.to_owned()
}

/// Possible stems of a content word, without endings of verbs and agents, for comparing uses.
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

/// All words of the grammar and the synonym tables, the candidates for spelling correction.
static KNOWN: LazyLock<BTreeSet<String>> = LazyLock::new(|| {
    let (verbs, adjectives, phrases) = (&*VERBS, &*ADJECTIVES, &*PHRASES);
    let grammar = verbs.verbs.words().chain(verbs.prepositions.words()).chain(phrases.relations.words());
    let places = phrases.sides.words().chain(phrases.dropped.words());
    let ranks = adjectives.colours.words().chain(adjectives.sizes.words()).chain(adjectives.ordinals.keys().map(String::as_str));
    let lists = [
        &verbs.plain_prepositions,
        &verbs.adverbs,
        &adjectives.fluff,
        &adjectives.soft,
        &NOUNS.vague,
        &NOUNS.parts,
        &NOUNS.surroundings,
        &phrases.determiners,
        &SPELLING.grammar,
        &SPELLING.empty,
    ];
    let listed = lists.into_iter().flat_map(Words::iter);
    let words = grammar.chain(places).chain(ranks).chain(listed).chain(GENERAL_NOUNS.iter().copied());
    words.map(str::to_owned).collect()
});

/// Nouns of the general tables.
static GENERAL_NOUNS: LazyLock<BTreeSet<&'static str>> = LazyLock::new(|| {
    let synonyms = NOUNS.synonyms.iter().flat_map(Words::iter);
    let below = NOUNS.hypernyms.iter().chain(&NOUNS.uses).flat_map(|(word, below)| below.iter().chain([word.as_str()]));
    let irregular = SPELLING.irregular.words().chain(SPELLING.irregular.plains());
    synonyms.chain(below).chain(irregular).flat_map(|phrase| phrase.split(' ')).collect()
});

/// Whether the parser knows the word or its stem.
pub(crate) fn is_known(word: &str) -> bool {
    is_listed(word)
        || stems(word).iter().any(|stem| is_listed(stem))
        || word.chars().all(|c| c.is_ascii_digit() || c == ',' || c == '.')
}

/// Whether one of the lists contains the word, in singular or plural.
pub(super) fn is_listed(word: &str) -> bool {
    let lists = [
        &SPELLING.everyday_nouns,
        &SPELLING.everyday_words,
        &NOUNS.features,
        &NOUNS.participles,
        &NOUNS.people,
        &NOUNS.clothes,
        &PHRASES.directions,
        &PHRASES.turning,
        &PHRASES.measures,
        &PHRASES.numbering,
        &PHRASES.somebody,
        &PHRASES.fillers,
        &PHRASES.lead_in,
    ];
    let everyday = |w: &str| lists.iter().any(|list| list.contains(w)) || PHRASES.asking.begin_with(w);
    let has = |w: &str| KNOWN.contains(w) || everyday(w);
    has(word) || has(&singular(word))
}

/// Number of words at the start that form a phrase which adds nothing to a target ("on the ground", "over there").
pub(crate) fn adds_nothing(words: &[String]) -> usize {
    PHRASES.dropped.length(words).unwrap_or(0)
}

/// Whether the word belongs to a verb of flying.
pub(crate) fn is_verb(word: &str) -> bool {
    VERBS.verbs.words().any(|known| known == word)
}

/// Whether the word asks for a search.
pub(crate) fn is_looking(word: &str) -> bool {
    PHRASES.looking.contains(word) || matches!(word, "find" | "seek" | "scan" | "explore")
}

/// Whether a word leads from a verb to its object.
pub(super) fn leads_on(word: &str) -> bool {
    matches!(word, "the" | "a" | "an" | "this" | "that")
        || VERBS.plain_prepositions.contains(word)
        || VERBS.prepositions.contains(word)
        || VERBS.adverbs.contains(word)
}

/// Whether the word or its stem is English, known to the parser or not, and must not be corrected.
pub(crate) fn is_right(word: &str) -> bool {
    let has = |w: &str| ENGLISH.binary_search(&w).is_ok() || ADJECTIVES.compass.contains(w);
    has(word) || has(&format!("{word}s")) || stems(word).iter().any(|stem| has(stem))
}

/// English words, in alphabetical order.
static ENGLISH: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| include_str!("../../data/english.txt").lines().filter(|line| !line.starts_with('#')).collect());

/// Whether the word names an object that may be searched for, whatever its description.
pub(crate) fn is_thing(word: &str) -> bool {
    let general = NOUNS.synonyms.iter().any(|group| group.iter().flat_map(|term| term.split(' ')).any(|part| part == word));
    general || NOUNS.hypernyms.contains_key(word) || SPELLING.everyday_nouns.contains(word)
}

/// Proper names: words with a capital letter inside a sentence that has no other capitals. "The Eiffel Tower" means no
/// other tower.
pub(super) fn names(text: &str) -> BTreeSet<String> {
    let words: Vec<&str> = text.split_whitespace().take(LONGEST).collect();
    let capital = |word: &&str| word.starts_with(char::is_uppercase) && word.chars().skip(1).any(char::is_lowercase);
    let begins = |at: usize| at == 0 || words[at - 1].ends_with(['.', '!', '?', ':', ';']);
    let capitals = words.iter().filter(|word| capital(word)).count();
    if 2 * capitals > words.len() {
        return BTreeSet::new();
    }
    let within = words.iter().enumerate().filter(|(at, word)| !begins(*at) && capital(word));
    within.flat_map(|(_, word)| raw_tokens(word)).map(|word| singular(&word)).collect()
}

/// The known word nearest to a misspelt one, if it is unique and close enough, and starts with the same letter or
/// differs by one swap of two letters; otherwise the word itself.
fn corrected(word: &str) -> String {
    if is_known(word) {
        return word.to_owned();
    }
    if let Some(right) = SPELLING.slips.plain(word) {
        return right.to_owned();
    }
    if word.len() < 3 || is_right(word) {
        return word.to_owned();
    }
    let limit = spelling::forgiven(word.len());
    if limit == 0 {
        return word.to_owned();
    }
    let plural = word.len() > 4 && word.ends_with('s');
    match nearest_known(word, limit) {
        // Nouns are corrected later, because the scene's tags take precedence.
        Some(known) if GENERAL_NOUNS.contains(known.as_str()) => word.to_owned(),
        Some(known) => known.clone(),
        None if plural => corrected(&word[..word.len() - 1]),
        None => word.to_owned(),
    }
}

/// The general noun nearest to a misspelt one, or the word itself.
pub(super) fn general_noun(word: &str) -> String {
    match nearest_known(word, spelling::forgiven(word.len())) {
        Some(known) if GENERAL_NOUNS.contains(known.as_str()) => known.clone(),
        _ => word.to_owned(),
    }
}

fn nearest_known(word: &str, limit: usize) -> Option<&'static String> {
    KNOWN
        .iter()
        .filter(|known| known.len() >= 3 && known.len().abs_diff(word.len()) <= limit)
        .map(|known| {
            let edits = spelling::distance(word, known);
            // Ties: the same first letter, then the longer word, since a missing letter is the most common error.
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
        // Nouns are left for the scene's tags.
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
