//! Noun phrases: the kind of object meant, and the attributes that distinguish it.

use super::lex::singular;
use super::lexicon::{ADJECTIVES, NOUNS, PHRASES, SPELLING};
use super::meaning::{Relation, Side, Size};

/// "Second from the left".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ordinal {
    /// 1 for the first; −1 for the last.
    pub number: i32,
    /// The side counted from; by distance if none is named.
    pub from: Option<Side>,
}

/// A noun phrase.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Phrase {
    /// Nouns in the singular, head last; empty for "something".
    pub nouns: Vec<String>,
    /// Basic colours it must have.
    pub colours: Vec<String>,
    /// Rankings by size or position, in order.
    pub sizes: Vec<Size>,
    /// Whether the ranking words were superlatives, so that a single object is meant.
    pub superlative: bool,
    /// Adjectives of shape and material.
    pub soft: Vec<String>,
    /// Ordinal.
    pub ordinal: Option<Ordinal>,
    /// Side of the image.
    pub side: Option<Side>,
    /// Relations, each with its anchors (two for *between*).
    pub relations: Vec<(Relation, Vec<Self>)>,
    /// Words describing its use.
    pub uses: Vec<String>,
    /// Whether `uses` describe something it has, by colour ("with the red cone"): objects without it do not match.
    pub having: bool,
    /// Exclusions.
    pub not: Vec<Self>,
    /// "the other one", "another": excludes earlier targets.
    pub other: bool,
    /// "it", "the black one": the noun comes from an earlier phrase.
    pub pronoun: bool,
    /// All words as given, in the singular, without articles and punctuation, since some names are complete
    /// descriptions.
    pub said: Vec<String>,
    /// Unknown words beside others that name an object; ignored.
    pub ignored: Vec<String>,
    /// Nouns that were put right: as they were said, and as they are read.
    pub spelt: Vec<(String, String)>,
}

impl Phrase {
    /// Whether the phrase has no content.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let Self { nouns, colours, sizes, soft, ordinal, side, relations, uses, not, other, pronoun, .. } = self;
        nouns.is_empty()
            && colours.is_empty()
            && sizes.is_empty()
            && soft.is_empty()
            && ordinal.is_none()
            && side.is_none()
            && relations.is_empty()
            && uses.is_empty()
            && not.is_empty()
            && !other
            && !pronoun
    }

    /// Parses a noun phrase from the words after a verb and its preposition.
    pub(super) fn read(words: &[String]) -> Self {
        let said = words.iter().filter(|w| !matches!(w.as_str(), "the" | "a" | "an" | "," | ".")).map(|w| singular(w)).collect();
        let mut phrase = Self { said, ..Self::default() };
        phrase.take(words, 0);
        phrase
    }

    fn take(&mut self, words: &[String], depth: usize) {
        // Limits nested relations and relative clauses; real instructions have few.
        if depth > 6 {
            return;
        }
        let mut i = 0;
        let mut vague = false;
        while i < words.len() {
            let rest = &words[i..];
            let word = rest[0].as_str();
            if let Some(n) = PHRASES.dropped.length(rest) {
                i += n;
            } else if let Some((n, from)) = PHRASES.counted_from.longest(rest) {
                let ordinal = self.ordinal.get_or_insert(Ordinal { number: 1, from: None });
                ordinal.from = Some(from);
                i += n;
            } else if let Some((n, side)) = PHRASES.sides.longest(rest)
                && rest.get(n).is_none_or(|next| next != "of" && next != "side")
            {
                self.side = Some(side);
                i += n;
            } else if let Some(n) = PHRASES.exceptions.length(rest) {
                // "anything but the crane", "a tree other than the first", "not the red one": up to the next break.
                let end = rest.iter().position(|w| w == "," || w == "but").filter(|&e| e > n).unwrap_or(rest.len());
                let inner = &rest[n.min(end)..end];
                let mut not = Self::default();
                not.take(inner, depth + 1);
                if !not.is_empty() {
                    self.not.push(not);
                }
                i += end.max(n);
            } else if let Some((_, size)) = PHRASES.outermost.longest(rest) {
                self.sizes.push(size);
                self.superlative = true;
                i += 1;
            } else if let Some((n, colour)) = clothes(rest) {
                self.colours.push(colour.to_owned());
                i += n;
            } else if let Some((n, relation)) = PHRASES.relations.longest(rest)
                && (has_noun(&rest[n..]))
                && !(matches!(word, "in" | "on" | "at" | "by" | "around" | "along" | "inside") && surroundings(&rest[n..]))
                && !(matches!(word, "near" | "nearest" | "closest" | "far")
                    && self.nouns.is_empty()
                    && !vague
                    && (depth == 0 || !self.pronoun && n == 1))
            {
                self.relate(relation, &rest[n..], depth);
                return;
            } else if (PHRASES.relative.contains(word) && (vague || !self.nouns.is_empty()))
                || (self.nouns.is_empty() && matches!(word, "where" | "what" | "wherever" | "whatever" | "whoever"))
            {
                self.relative(rest, depth);
                return;
            } else if word == "of" && self.nouns.last().is_some_and(|n| !NOUNS.parts.contains(n)) && has_noun(&rest[1..]) {
                self.relate(Relation::Near, &rest[1..], depth);
                return;
            } else if vague
                && self.nouns.is_empty()
                && !is_adjective(word)
                && !matches!(word, "," | ".")
                && !PHRASES.determiners.contains(word)
            {
                self.relative(rest, depth);
                return;
            } else {
                vague |= self.word(rest);
                i += 1;
            }
        }
    }

    /// Processes one word; true if it is a head noun without meaning of its own.
    fn word(&mut self, rest: &[String]) -> bool {
        let word = rest[0].as_str();
        let plain = singular(word);
        let next = rest.get(1).map(String::as_str);
        if matches!(word, "," | ".") {
        } else if matches!(word, "it" | "them" | "there" | "one" | "ones")
            && (word == "it" || word == "them" || next.is_none_or(|n| n != "of"))
        {
            // "that one of the trees": the noun follows later.
            self.pronoun = true;
            return word == "one" || word == "ones";
        } else if matches!(word, "other" | "another" | "different" | "else") {
            self.other = true;
        } else if word == "next" {
            self.ordinal = Some(Ordinal { number: 2, from: None });
        } else if let Some(number) = ADJECTIVES.ordinals.get(word) {
            self.ordinal = Some(Ordinal { number: *number, from: self.ordinal.and_then(|o| o.from) });
        } else if let Some((_, size)) = PHRASES.outermost.longest(rest) {
            self.sizes.push(size);
            self.superlative = true;
        } else if let Some(size) = ADJECTIVES.sizes.get(word)
            && !(matches!(word, "middle" | "centre" | "center") && next == Some("of"))
            && !(word == "high" && matches!(next, Some("rise" | "rises")))
            && !(word == "low" && next == Some("rise"))
        {
            if !self.sizes.contains(&size) {
                self.sizes.push(size);
            }
            self.superlative |= word.ends_with("est") || word.ends_with("most");
        } else if let Some(colour) = ADJECTIVES.colours.plain(word)
            && !(matches!(word, "dark" | "light" | "pale" | "jet" | "deep") && next.is_some_and(is_colour))
        {
            if !self.colours.iter().any(|c| c == colour) {
                self.colours.push(colour.to_owned());
            }
            // "Silver" means grey, and preferably silver.
            if word != colour {
                self.soft.push(word.to_owned());
            }
        } else if matches!(word, "dark" | "light" | "pale" | "deep") && next.is_some_and(is_colour) {
            self.soft.push(word.to_owned());
        } else if word == "of" {
            // After a part or a collection: "the top of the crane".
            self.nouns.clear();
            self.pronoun = false;
        } else if PHRASES.determiners.contains(word)
            // The last word of a compound is its head: "traffic light".
            || (ADJECTIVES.fluff.contains(word) && (self.nouns.is_empty() || !ends_phrase(next)))
            || matches!(word, "most" | "more" | "jet")
            || (matches!(word, "dark" | "light" | "pale" | "deep") && (self.nouns.is_empty() || !ends_phrase(next)))
            || word.chars().all(|c| c.is_ascii_digit())
        {
        } else if ADJECTIVES.soft.contains(word) && next.is_some_and(|n| !matches!(n, "of" | "," | "." | "and")) {
            self.soft.push(word.to_owned());
        } else if NOUNS.vague.contains(&plain) && next != Some("of") {
            return true;
        } else if SPELLING.grammar.contains(word)
            && !matches!(word, "people" | "person" | "top" | "park" | "parking" | "cross" | "climbing" | "help" | "sit")
        {
        } else {
            self.nouns.push(plain);
        }
        false
    }

    fn relate(&mut self, relation: Relation, rest: &[String], depth: usize) {
        let mut anchors = Vec::new();
        let parts: Vec<&[String]> =
            if relation == Relation::Between { rest.splitn(2, |w| w == "and").collect() } else { vec![rest] };
        for part in parts {
            let mut anchor = Self::default();
            anchor.take(part, depth + 1);
            anchors.push(anchor);
        }
        self.relations.push((relation, anchors));
    }

    /// "that is red", "which people drive", "with a pointed top", "used for lifting".
    fn relative(&mut self, rest: &[String], depth: usize) {
        let mut words = rest;
        while let Some(first) = words.first()
            && PHRASES.relative_lead.contains(first)
        {
            words = &words[1..];
        }
        let stripped = words.len() < rest.len();
        let Some(first) = words.first().map(String::as_str) else { return };
        let negated = matches!(first, "not" | "isnt" | "arent" | "wasnt");
        let rest = if negated { &words[1..] } else { words };
        // "which is a car": after the copula an article leads in another noun.
        let copula = stripped && words.first().is_some_and(|w| matches!(w.as_str(), "a" | "an" | "the"));
        let head = rest.iter().map(String::as_str).find(|w| !PHRASES.determiners.contains(w) && !ADJECTIVES.fluff.contains(w));
        let descriptive = head.is_some_and(is_adjective)
            || PHRASES.relations.longest(rest).is_some()
            || PHRASES.sides.longest(rest).is_some()
            || PHRASES.exceptions.length(rest).is_some()
            || copula;
        if negated {
            let mut not = Self::default();
            not.take(rest, depth + 1);
            if !not.is_empty() {
                self.not.push(not);
            }
        } else if descriptive && !matches!(first, "with" | "used" | "for" | "has" | "having" | "made" | "to") {
            self.take(rest, depth + 1);
        } else {
            let empty = |w: &str| SPELLING.empty.contains(w) || w.strip_suffix('s').is_some_and(|w| SPELLING.empty.contains(w));
            let telling = rest.iter().filter(|w| w.len() > 1 && !empty(w));
            let before = self.uses.len();
            self.uses.extend(telling.cloned());
            self.having |= first == "with" && rest.iter().any(|w| is_colour(w));
            // "The person who needs help": words without content elsewhere are the only distinction here.
            if self.uses.len() == before && !self.nouns.is_empty() {
                self.uses.extend(rest.iter().filter(|w| w.len() > 1).cloned());
            }
        }
    }
}

/// "in the blue coat", "wearing red": how many words, and the plain colour.
fn clothes(words: &[String]) -> Option<(usize, &'static str)> {
    if !matches!(words[0].as_str(), "in" | "wearing" | "with" | "dressed") {
        return None;
    }
    let lead =
        words.iter().take_while(|w| matches!(w.as_str(), "in" | "wearing" | "with" | "dressed" | "a" | "the" | "all")).count();
    let colour = ADJECTIVES.colours.plain(words.get(lead)?)?;
    let garment = words.get(lead + 1).is_some_and(|w| NOUNS.clothes.contains(w));
    let ends = words.get(lead + 1).is_none_or(|w| matches!(w.as_str(), "," | "." | "and"));
    (garment || ends).then_some((lead + 1 + usize::from(garment), colour))
}

/// Whether the noun phrase ends before this word.
fn ends_phrase(next: Option<&str>) -> bool {
    next.is_none_or(|w| {
        matches!(w, "," | "." | "and" | "that" | "which" | "with" | "from" | "for" | "please" | "but" | "there")
            || PHRASES.relations.begin_with(w)
    })
}

fn is_colour(word: &str) -> bool {
    ADJECTIVES.colours.plain(word).is_some()
}

fn is_adjective(word: &str) -> bool {
    is_colour(word)
        || ADJECTIVES.sizes.contains(word)
        || ADJECTIVES.ordinals.contains_key(word)
        || ADJECTIVES.soft.contains(word)
        || ADJECTIVES.fluff.contains(word)
}

/// Whether any word may be a noun.
fn has_noun(words: &[String]) -> bool {
    words.iter().any(|w| {
        let w = w.as_str();
        !matches!(w, "," | "." | "you" | "me" | "us" | "your" | "the" | "a" | "an" | "left" | "right" | "side" | "hand")
            && (!is_adjective(w) || ADJECTIVES.soft.contains(w))
            && (!PHRASES.determiners.contains(w) || w == "it" || w == "one")
    })
}

/// Whether the words only mean "the city", "the image" and the like.
fn surroundings(words: &[String]) -> bool {
    words
        .iter()
        .map(String::as_str)
        .filter(|w| !matches!(*w, "the" | "this" | "," | "." | "a" | "whole" | "entire"))
        .all(|w| NOUNS.surroundings.contains(w) || matches!(w, "picture" | "image" | "frame" | "sight" | "distance" | "sky"))
}
