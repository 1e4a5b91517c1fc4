//! Noun phrases: what kind of thing is meant, and by what it is told from others.

use super::lex::singular;
use super::lexicon;

/// How an object stands to another, in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// Close to it.
    Near,
    /// As far from it as there is.
    FarFrom,
    /// Left of it.
    LeftOf,
    /// Right of it.
    RightOf,
    /// Farther away, in about the same direction.
    Behind,
    /// Nearer, in about the same direction.
    InFrontOf,
    /// Between two.
    Between,
    /// Lower in the picture and close.
    Under,
    /// On, in or above it.
    On,
    /// Higher than it.
    TallerThan,
    /// Lower than it.
    ShorterThan,
}

/// A side of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
    /// Middle.
    Middle,
}

/// Words of size and place that rank objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// High.
    Tall,
    /// Not high.
    Short,
    /// Large.
    Large,
    /// Small.
    Small,
    /// Near.
    Nearest,
    /// Far.
    Farthest,
    /// The leftmost.
    Leftmost,
    /// The rightmost.
    Rightmost,
    /// In the middle of the others.
    Middle,
}

/// "Second from the left".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ordinal {
    /// 1 for the first; −1 for the last.
    pub number: i32,
    /// The side counted from; from the nearest on where none is named.
    pub from: Option<Side>,
}

/// A noun phrase.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Phrase {
    /// Nouns in singular, head last; empty for "something".
    pub nouns: Vec<String>,
    /// Plain colours it must have.
    pub colours: Vec<String>,
    /// Ranks it by size or place, in order.
    pub sizes: Vec<Size>,
    /// Whether the ranking words were superlatives, so that one object alone is meant.
    pub superlative: bool,
    /// Adjectives of shape and matter.
    pub soft: Vec<String>,
    /// Ordinal.
    pub ordinal: Option<Ordinal>,
    /// Side of the picture.
    pub side: Option<Side>,
    /// Relations, each with its anchors (two for *between*).
    pub relations: Vec<(Relation, Vec<Self>)>,
    /// Words that say what it serves for.
    pub uses: Vec<String>,
    /// Whether `uses` tell what it has with it by its colour ("with the red cone"): what lacks it is not meant.
    pub having: bool,
    /// What it is not.
    pub not: Vec<Self>,
    /// "the other one", "another": not what was meant before.
    pub other: bool,
    /// "it", "the black one": the noun is that of an earlier phrase.
    pub pronoun: bool,
    /// All its words as said, singular, without articles and marks: some names are whole descriptions.
    pub said: Vec<String>,
}

impl Phrase {
    /// Whether the phrase says nothing at all.
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

    /// Reads a noun phrase from the words after a verb and its preposition.
    pub(super) fn read(words: &[String]) -> Self {
        let said = words.iter().filter(|w| !matches!(w.as_str(), "the" | "a" | "an" | "," | ".")).map(|w| singular(w)).collect();
        let mut phrase = Self { said, ..Self::default() };
        phrase.take(words, 0);
        phrase
    }

    fn take(&mut self, words: &[String], depth: usize) {
        // Nested relations and relative clauses end somewhere: nobody means more than a few.
        if depth > 6 {
            return;
        }
        let mut i = 0;
        let mut vague = false;
        while i < words.len() {
            let rest = &words[i..];
            let word = rest[0].as_str();
            if let Some(n) = lexicon::DROPPED.iter().filter_map(|p| starts(rest, p)).max() {
                i += n;
            } else if let Some((n, from)) = from_side(rest) {
                let ordinal = self.ordinal.get_or_insert(Ordinal { number: 1, from: None });
                ordinal.from = Some(from);
                i += n;
            } else if let Some((n, side)) = longest(rest, lexicon::SIDES)
                && rest.get(n).is_none_or(|next| next != "of" && next != "side")
            {
                self.side = Some(side);
                i += n;
            } else if let Some((n, superlative)) = negation(rest) {
                // "anything but the crane", "a tree other than the first", "not the red one": up to the next break.
                let end = rest.iter().position(|w| w == "," || w == "but").filter(|&e| e > n).unwrap_or(rest.len());
                let inner = &rest[n.min(end)..end];
                let mut not = Self::default();
                not.take(inner, depth + 1);
                if !not.is_empty() {
                    self.not.push(not);
                }
                self.superlative |= superlative;
                i += end.max(n);
            } else if let Some(size) = superlative_apart(rest) {
                self.sizes.push(size);
                self.superlative = true;
                i += 1;
            } else if let Some((n, colour)) = clothes(rest) {
                self.colours.push(colour.to_owned());
                i += n;
            } else if let Some((n, relation)) = longest(rest, lexicon::RELATIONS)
                && (has_noun(&rest[n..]))
                && !(matches!(word, "in" | "on" | "at" | "by" | "around" | "along" | "inside") && surroundings(&rest[n..]))
                && !(matches!(word, "near" | "nearest" | "closest" | "far")
                    && self.nouns.is_empty()
                    && !vague
                    && (depth == 0 || !self.pronoun && n == 1))
            {
                self.relate(relation, &rest[n..], depth);
                return;
            } else if (matches!(
                word,
                "that"
                    | "thats"
                    | "which"
                    | "who"
                    | "whose"
                    | "where"
                    | "with"
                    | "used"
                    | "for"
                    | "made"
                    | "called"
                    | "named"
                    | "has"
                    | "having"
                    | "when"
                    | "to"
                    | "from"
                    | "full"
                    | "without"
                    | "against"
            ) && (vague || !self.nouns.is_empty()))
                || (self.nouns.is_empty() && matches!(word, "where" | "what" | "wherever" | "whatever" | "whoever"))
            {
                self.relative(rest, depth);
                return;
            } else if word == "of"
                && self.nouns.last().is_some_and(|n| !lexicon::PARTS.contains(&n.as_str()))
                && has_noun(&rest[1..])
            {
                self.relate(Relation::Near, &rest[1..], depth);
                return;
            } else if vague
                && self.nouns.is_empty()
                && !is_adjective(word)
                && !matches!(word, "," | ".")
                && !lexicon::DETERMINERS.contains(&word)
            {
                self.relative(rest, depth);
                return;
            } else {
                vague |= self.word(rest);
                i += 1;
            }
        }
    }

    /// Takes in one word; true when it is a head that names nothing.
    fn word(&mut self, rest: &[String]) -> bool {
        let word = rest[0].as_str();
        let plain = singular(word);
        let next = rest.get(1).map(String::as_str);
        if matches!(word, "," | ".") {
        } else if matches!(word, "it" | "them" | "there" | "one" | "ones")
            && (word == "it" || word == "them" || next.is_none_or(|n| n != "of"))
        {
            // "that one of the trees" keeps its noun for later.
            self.pronoun = true;
            return word == "one" || word == "ones";
        } else if matches!(word, "other" | "another" | "different" | "else") {
            self.other = true;
        } else if word == "next" {
            self.ordinal = Some(Ordinal { number: 2, from: None });
        } else if let Some((_, number)) = lexicon::ORDINALS.iter().find(|(w, _)| *w == word) {
            self.ordinal = Some(Ordinal { number: *number, from: self.ordinal.and_then(|o| o.from) });
        } else if let Some(size) = superlative_apart(rest) {
            self.sizes.push(size);
            self.superlative = true;
        } else if let Some((_, size)) = lexicon::SIZES.iter().find(|(w, _)| *w == word)
            && !(matches!(word, "middle" | "centre" | "center") && next == Some("of"))
            && !(word == "high" && matches!(next, Some("rise" | "rises")))
            && !(word == "low" && next == Some("rise"))
        {
            if !self.sizes.contains(size) {
                self.sizes.push(*size);
            }
            self.superlative |= word.ends_with("est") || word.ends_with("most");
        } else if let Some((_, colour)) = lexicon::COLOURS.iter().find(|(w, _)| *w == word)
            && !(matches!(word, "dark" | "light" | "pale" | "jet" | "deep") && next.is_some_and(is_colour))
        {
            if !self.colours.iter().any(|c| c == colour) {
                self.colours.push((*colour).to_owned());
            }
            // "Silver" asks for grey, and rather for silver.
            if word != *colour {
                self.soft.push(word.to_owned());
            }
        } else if matches!(word, "dark" | "light" | "pale" | "deep") && next.is_some_and(is_colour) {
            self.soft.push(word.to_owned());
        } else if word == "of" {
            // After a part or a collection: "the top of the crane".
            self.nouns.clear();
            self.pronoun = false;
        } else if lexicon::DETERMINERS.contains(&word)
            // The last word of a compound is its head: "traffic light".
            || (lexicon::FLUFF.contains(&word) && (self.nouns.is_empty() || !ends_phrase(next)))
            || matches!(word, "most" | "more" | "jet")
            || (matches!(word, "dark" | "light" | "pale" | "deep") && (self.nouns.is_empty() || !ends_phrase(next)))
            || word.chars().all(|c| c.is_ascii_digit())
        {
        } else if lexicon::SOFT.contains(&word) && next.is_some_and(|n| !matches!(n, "of" | "," | "." | "and")) {
            self.soft.push(word.to_owned());
        } else if lexicon::VAGUE.contains(&plain.as_str()) && next != Some("of") {
            return true;
        } else if lexicon::GRAMMAR.contains(&word)
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
            && matches!(
                first.as_str(),
                "that"
                    | "thats"
                    | "which"
                    | "who"
                    | "is"
                    | "are"
                    | "where"
                    | "its"
                    | "one"
                    | "stands"
                    | "standing"
                    | "stand"
                    | "was"
                    | "being"
                    | "looks"
                    | "sits"
                    | "located"
                    | "parked"
                    | "you"
                    | "see"
                    | "would"
                    | "can"
                    | "could"
                    | "called"
                    | "be"
                    | "i"
                    | "they"
            )
        {
            words = &words[1..];
        }
        let stripped = words.len() < rest.len();
        let Some(first) = words.first().map(String::as_str) else { return };
        let negated = matches!(first, "not" | "isnt" | "arent" | "wasnt");
        let rest = if negated { &words[1..] } else { words };
        // "which is a car": after the copula an article leads in another noun.
        let copula = stripped && words.first().is_some_and(|w| matches!(w.as_str(), "a" | "an" | "the"));
        let head = rest.iter().map(String::as_str).find(|w| !lexicon::DETERMINERS.contains(w) && !lexicon::FLUFF.contains(w));
        let descriptive = head.is_some_and(is_adjective)
            || longest(rest, lexicon::RELATIONS).is_some()
            || longest(rest, lexicon::SIDES).is_some()
            || negation(rest).is_some()
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
            let empty = |w: &str| lexicon::EMPTY.contains(&w) || w.strip_suffix('s').is_some_and(|w| lexicon::EMPTY.contains(&w));
            let telling = rest.iter().filter(|w| w.len() > 1 && !empty(w));
            let before = self.uses.len();
            self.uses.extend(telling.cloned());
            self.having |= first == "with" && rest.iter().any(|w| is_colour(w));
            // "The person who needs help": words that say little elsewhere are all there is to tell one by.
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
    let colour = lexicon::COLOURS.iter().find(|(w, _)| words.get(lead).is_some_and(|word| word == w))?.1;
    let garment = words.get(lead + 1).is_some_and(|w| lexicon::CLOTHES.contains(&w.as_str()));
    let ends = words.get(lead + 1).is_none_or(|w| matches!(w.as_str(), "," | "." | "and"));
    (garment || ends).then_some((lead + 1 + usize::from(garment), colour))
}

/// Length of `pattern` in words when `words` start with it.
pub(super) fn starts(words: &[String], pattern: &str) -> Option<usize> {
    let mut n = 0;
    for part in pattern.split(' ') {
        if words.get(n).is_none_or(|w| w != part) {
            return None;
        }
        n += 1;
    }
    Some(n)
}

/// The longest pattern of a table that `words` start with.
pub(super) fn longest<T: Copy>(words: &[String], table: &[(&str, T)]) -> Option<(usize, T)> {
    table.iter().filter_map(|(pattern, value)| starts(words, pattern).map(|n| (n, *value))).max_by_key(|(n, _)| *n)
}

fn from_side(words: &[String]) -> Option<(usize, Side)> {
    longest(
        words,
        &[
            ("from the left", Side::Left),
            ("from left", Side::Left),
            ("from left to right", Side::Left),
            ("counting from the left", Side::Left),
            ("from the left side", Side::Left),
            ("from your left", Side::Left),
            ("from the right", Side::Right),
            ("from right", Side::Right),
            ("from right to left", Side::Right),
            ("counting from the right", Side::Right),
            ("from the right side", Side::Right),
            ("from your right", Side::Right),
        ],
    )
}

/// Words of exception: how many they are, and whether they leave one out of all ("anything but").
fn negation(words: &[String]) -> Option<(usize, bool)> {
    longest(
        words,
        &[
            ("but not", false),
            ("and not", false),
            ("not", false),
            ("other than", false),
            ("rather than", false),
            ("instead of", false),
            ("except for", false),
            ("except", false),
            ("besides", false),
            ("apart from", false),
            ("excluding", false),
            ("anything but", false),
            ("any but", false),
            ("but the", false),
            ("isnt", false),
            ("arent", false),
            ("different from", false),
        ],
    )
}

/// "furthest away", "the one farthest to the left".
fn superlative_apart(words: &[String]) -> Option<Size> {
    longest(
        words,
        &[
            ("furthest left", Size::Leftmost),
            ("farthest left", Size::Leftmost),
            ("far left", Size::Leftmost),
            ("furthest right", Size::Rightmost),
            ("farthest right", Size::Rightmost),
            ("far right", Size::Rightmost),
            ("furthest to the left", Size::Leftmost),
            ("furthest to the right", Size::Rightmost),
            ("farthest to the left", Size::Leftmost),
            ("farthest to the right", Size::Rightmost),
        ],
    )
    .map(|(_, size)| size)
}

/// Whether a noun phrase is over before this word.
fn ends_phrase(next: Option<&str>) -> bool {
    next.is_none_or(|w| {
        matches!(w, "," | "." | "and" | "that" | "which" | "with" | "from" | "for" | "please" | "but" | "there")
            || lexicon::RELATIONS.iter().any(|(r, _)| r.split(' ').next() == Some(w))
    })
}

fn is_colour(word: &str) -> bool {
    lexicon::COLOURS.iter().any(|(w, _)| *w == word)
}

fn is_adjective(word: &str) -> bool {
    is_colour(word)
        || lexicon::SIZES.iter().any(|(w, _)| *w == word)
        || lexicon::ORDINALS.iter().any(|(w, _)| *w == word)
        || lexicon::SOFT.contains(&word)
        || lexicon::FLUFF.contains(&word)
}

/// Whether some word may be a noun.
fn has_noun(words: &[String]) -> bool {
    words.iter().any(|w| {
        let w = w.as_str();
        !matches!(w, "," | "." | "you" | "me" | "us" | "your" | "the" | "a" | "an" | "left" | "right" | "side" | "hand")
            && (!is_adjective(w) || lexicon::SOFT.contains(&w))
            && (!lexicon::DETERMINERS.contains(&w) || w == "it" || w == "one")
    })
}

/// Whether the words say no more than "the city", "the picture".
fn surroundings(words: &[String]) -> bool {
    words
        .iter()
        .map(String::as_str)
        .filter(|w| !matches!(*w, "the" | "this" | "," | "." | "a" | "whole" | "entire"))
        .all(|w| lexicon::SURROUNDINGS.contains(&w) || matches!(w, "picture" | "image" | "frame" | "sight" | "distance" | "sky"))
}
