//! Words of manner, number, shape and order: recognised, so that they do not become part of a name, but not carried out.

use super::lexicon::PHRASES;
use super::motion::{in_shape, measured};
use super::turns::CARDINALS;

/// Number of words at the start that mean "each in turn"; zero if there are none.
pub(crate) fn in_turn(words: &[String]) -> usize {
    PHRASES.in_turn.length(words).unwrap_or(0)
}

/// Number of words at the start that state how often, how far or in which shape ("twice", "three times", "10 metres high", "in a
/// square"); zero if there are none.
pub(crate) fn amount(words: &[String]) -> usize {
    let word = |at: usize| words.get(at).map_or("", String::as_str);
    let first = word(0);
    if PHRASES.manners.contains(first) {
        return 1;
    }
    let shape = in_shape(words);
    if shape > 0 {
        return shape;
    }
    let number = measured(first) || CARDINALS.contains(&first) || PHRASES.quantities.contains(first);
    let length = if number && matches!(word(1), "time" | "times") {
        return 2;
    } else if number && PHRASES.lengths.contains(word(1)) {
        2
    } else if measured(first) && !first.chars().all(|c| c.is_ascii_digit()) {
        1
    } else {
        return 0;
    };
    length + usize::from(PHRASES.extents.contains(word(length)))
}
