//! Noun phrases: the kind of object meant, and the attributes that distinguish it.

use super::lex::{is_thing, singular};
use super::lexicon::{ADJECTIVES, NOUNS, PHRASES, SPELLING, VERBS};
use super::meaning::{Relation, Side, Size};
use super::told::Told;
use super::turns::{
    ARTICLES, alternatives, apposition, beside_it, clothes, describes_person, ends_description, ends_phrase, has_noun,
    is_adjective, is_colour, number, place, surroundings,
};

/// An ordinal, such as "second from the left".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ordinal {
    /// 1 for the first, 2 for the second, …; −1 for the last.
    pub number: i32,
    /// The side from which to count; `None` counts by distance.
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
    /// Words that must be among its tags, if any object of the scene has them: "the man *waving*".
    pub musts: Vec<String>,
    /// The number in a name: "gate 2".
    pub number: Option<u32>,
    /// Separate objects that belong to it: "the tables with chairs".
    pub with: Vec<Self>,
    /// Whether `uses` name a coloured accessory ("with the red cone"), so that objects without it do not match.
    pub having: bool,
    /// Exclusions.
    pub not: Vec<Self>,
    /// Alternatives, each as good as the phrase itself: "the red *or the blue* car".
    pub or: Vec<Self>,
    /// "the other one", "another": excludes earlier targets.
    pub other: bool,
    /// "it", "the black one": the noun comes from an earlier phrase.
    pub pronoun: bool,
    /// All words as given, in the singular, without articles and punctuation, since some names are complete
    /// descriptions.
    pub written: Vec<String>,
    /// Unknown words beside others that name an object; ignored.
    pub ignored: Vec<String>,
    /// Nouns with a corrected spelling: as written, and as corrected.
    pub spelt: Vec<(String, String)>,
    /// The objects, given as data in place of words; then only `nouns` (a name) and `other` hold besides.
    pub(crate) told: Option<Told>,
}

impl Phrase {
    /// Whether the phrase has no content.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let Self { nouns, colours, sizes, soft, ordinal, side, relations, uses, not, other, pronoun, number, .. } = self;
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
            && number.is_none()
    }

    /// The same, whatever its order and whatever came before.
    pub(crate) fn unordered(&self) -> Self {
        let told = self.told.as_ref().map(|told| Told { objects: told.among.clone(), ..told.clone() });
        Self { ordinal: None, other: false, told, ..self.clone() }
    }

    /// Whether an earlier phrase may mean the same objects, by its nouns.
    pub(crate) fn is_like(&self, earlier: &Self) -> bool {
        self.told.is_some() || self.nouns == earlier.nouns
    }

    /// Whether it names a place and no object: "between the two trees".
    pub(super) fn is_place(&self) -> bool {
        let Self { nouns, colours, soft, uses, other, pronoun, relations, .. } = self;
        let names_nothing = nouns.is_empty() && colours.is_empty() && soft.is_empty() && uses.is_empty() && !other && !pronoun;
        names_nothing && relations.iter().any(|(relation, _)| *relation == Relation::Between)
    }

    /// Parses a noun phrase from the words after a verb and its preposition.
    pub(super) fn read(words: &[String]) -> Self {
        let Some((one, other)) = alternatives(words) else { return Self::read_one(words) };
        let (mut phrase, mut other) = (Self::read_one(one), Self::read(other));
        // "The red or the blue car", "the red car or the blue one".
        if phrase.nouns.is_empty() && !phrase.pronoun {
            phrase.nouns.clone_from(&other.nouns);
            phrase.relations.extend(other.relations.iter().cloned());
            phrase.side = phrase.side.or(other.side);
        } else if other.nouns.is_empty() {
            other.nouns.clone_from(&phrase.nouns);
            other.pronoun = false;
        }
        let more = core::mem::take(&mut other.or);
        phrase.or = [vec![other], more].concat();
        phrase
    }

    fn read_one(words: &[String]) -> Self {
        let written =
            words.iter().filter(|w| !matches!(w.as_str(), "the" | "a" | "an" | "," | ".")).map(|w| singular(w)).collect();
        let mut phrase = Self { written, ..Self::default() };
        let (main, apposed) = apposition(words);
        phrase.take(main, 0);
        if let Some(words) = apposed {
            let mut apposed = Self::default();
            apposed.take(words, 1);
            phrase.narrow(apposed);
        }
        phrase
    }

    /// Adds the content of an apposition: "the second cone, *the one further away*".
    fn narrow(&mut self, of: Self) {
        if !of.sizes.is_empty() || of.ordinal.is_some() {
            (self.ordinal, self.sizes, self.superlative) = (of.ordinal, of.sizes, of.superlative);
        }
        self.colours.extend(of.colours);
        self.soft.extend(of.soft);
        self.relations.extend(of.relations);
        self.uses.extend(of.uses);
        self.musts.extend(of.musts);
        self.not.extend(of.not);
        self.side = of.side.or(self.side);
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
            } else if let Some((n, number)) = number(rest, self.nouns.is_empty()) {
                self.number = Some(number);
                i += n;
            } else if word == "with"
                && !self.nouns.is_empty()
                && let Some(end) = beside_it(rest)
            {
                // "The table with the bottle on it".
                self.relate(Relation::Near, &rest[1..end], depth);
                i += end + 2;
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
            } else if word == "over"
                && !self.nouns.is_empty()
                && rest.get(1).is_some_and(|next| ARTICLES.contains(&next.as_str()))
            {
                // "The bridge over the creek".
                self.relate(Relation::On, &rest[1..], depth);
                return;
            } else if (matches!(word, "is" | "are" | "was" | "looks" | "seems") && !self.nouns.is_empty() && rest.len() > 1)
                || (self.nouns == ["person"] && describes_person(words, i))
            {
                self.relative(rest, depth);
                return;
            } else if matches!(word, "standing" | "parked")
                && !self.nouns.is_empty()
                && rest.get(1).is_some_and(|n| ends_description(n))
            {
                i += 1;
            } else if self.is_described_by(rest) {
                let transitive = rest.get(1).is_some_and(|next| ARTICLES.contains(&next.as_str()) || !ends_description(next));
                if transitive {
                    self.relative(rest, depth);
                    return;
                }
                let person = self.nouns.iter().any(|noun| NOUNS.people.contains(noun));
                if person { &mut self.musts } else { &mut self.uses }.push(singular(word));
                i += 1;
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

    /// Whether the words continue with an activity of the object: "*waving* at me", "*sat* on the bench". Before
    /// another noun such a word is part of a name: "swimming pool".
    fn is_described_by(&self, words: &[String]) -> bool {
        let word = words[0].as_str();
        let person = || self.nouns.iter().any(|noun| NOUNS.people.contains(noun));
        let article = words.get(1).is_some_and(|next| ARTICLES.contains(&next.as_str()));
        // "People crossing the road" are no crossing.
        let thing = is_thing(&singular(word)) && !(person() && article);
        let form = NOUNS.participles.contains(word) || (word.len() > 4 && word.ends_with("ing") && !thing);
        form && !self.nouns.is_empty()
            && !ADJECTIVES.fluff.contains(word)
            && !NOUNS.vague.contains(word)
            && (person() || words.get(1).is_none_or(|next| ends_description(next) || ARTICLES.contains(&next.as_str())))
    }

    /// Adds one word; true if it is a head that names nothing.
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
        } else if matches!(word, "him" | "he" | "she") || (word == "her" && next.is_none_or(|n| matches!(n, "," | "." | "and"))) {
            self.pronoun = true;
        } else if PHRASES.somebody.contains(word) && self.nouns.is_empty() {
            self.nouns.push("person".to_owned());
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
        } else if (PHRASES.determiners.contains(word) && !(self.nouns == ["way"] && word == "out"))
            // The last word of a compound is its head: "traffic light".
            || (ADJECTIVES.fluff.contains(word) && (self.nouns.is_empty() || !ends_phrase(next)))
            || matches!(word, "most" | "more" | "jet")
            || (matches!(word, "dark" | "light" | "pale" | "deep") && (self.nouns.is_empty() || !ends_phrase(next)))
            || word.chars().all(|c| c.is_ascii_digit())
        {
        } else if ends_phrase(next) && (VERBS.prepositions.contains(word) || VERBS.plain_prepositions.contains(word)) {
            // "The man walking *around*". "The way out" is a name.
            if self.nouns == ["way"] && word == "out" {
                self.nouns.push(plain);
            }
        } else if ADJECTIVES.soft.contains(word)
            && next.is_some_and(|n| !matches!(n, "of" | "," | "." | "and"))
            // "The needle thingy" is a needle, though "the needle tower" is a tower.
            && !(is_thing(&plain) && next.is_some_and(|n| NOUNS.vague.contains(n)))
        {
            self.soft.push(word.to_owned());
        } else if NOUNS.vague.contains(&plain) && next != Some("of") {
            // "The cone thing" is the cone.
            return self.nouns.is_empty();
        } else if SPELLING.grammar.contains(word)
            && !matches!(word, "people" | "person" | "top" | "park" | "parking" | "cross" | "climbing" | "help" | "sit")
            && (word != "stand" || self.nouns.is_empty())
            && (word != "hot" || ends_phrase(next))
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
        // "which is a car": after the copula an article introduces another noun.
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
            // "Somewhere to sit near the fountain": the place is not part of the use.
            let beside = (1..rest.len()).find(|&at| place(&rest[at..]).is_some());
            let (rest, place) = (&rest[..beside.unwrap_or(rest.len())], beside.and_then(|at| place(&rest[at..])));
            if let Some((relation, anchor)) = place {
                self.relate(relation, anchor, depth);
            }
            let empty = |w: &str| SPELLING.empty.contains(w) || w.strip_suffix('s').is_some_and(|w| SPELLING.empty.contains(w));
            let holds = matches!(first, "with" | "carrying" | "holding" | "wearing" | "pushing");
            let telling = rest.iter().skip(usize::from(holds)).filter(|w| w.len() > 1 && !empty(w));
            let before = self.uses.len();
            // "The red thing with the long arm": no scene lists arms.
            let listed = telling.clone().next_back().is_some_and(|word| !NOUNS.features.contains(word));
            if listed || !holds || !self.nouns.is_empty() {
                self.uses.extend(telling.cloned());
            }
            if first == "with" && rest.len() > 1 && depth < 2 {
                let mut with = Self::default();
                with.take(&rest[1..], depth + 1);
                self.with.push(with);
            }
            self.having |= holds && listed && rest.iter().any(|w| is_colour(w));
            // "The person who needs help": words with little content elsewhere are the only description here.
            if self.uses.len() == before && !self.nouns.is_empty() {
                self.uses.extend(rest.iter().filter(|w| w.len() > 1).cloned());
            }
        }
    }
}
