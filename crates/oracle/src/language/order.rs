//! Selects among several candidates by side, size, range and ordinal.

use super::item::Item;
use super::lexicon::ADJECTIVES;
use super::meaning::{Side, Size};
use super::phrase::Phrase;

/// The outermost candidate on a side; for the middle, the most central one.
pub(super) fn on_side(side: Side, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    if found.len() < 2 || found.iter().any(|&i| items[i].across.is_none()) {
        return found;
    }
    let size = match side {
        Side::Left => Size::Leftmost,
        Side::Right => Size::Rightmost,
        Side::Middle => Size::Middle,
    };
    rank(size, &found, items).map_or(found, |i| vec![i])
}

/// Those whose tags state the requested size; all if none do.
pub(super) fn of_size(phrase: &Phrase, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    let words = phrase.sizes.iter().filter(|_| !phrase.superlative).filter_map(|size| ADJECTIVES.qualities.get(size));
    words.fold(found, |found, words| {
        let matching: Vec<usize> =
            found.iter().copied().filter(|&i| items[i].tags.qualities.iter().any(|q| words.contains(q))).collect();
        if matching.is_empty() { found } else { matching }
    })
}

/// Narrows by size and position. Superlatives and words of position select the extreme; "tall" by itself selects those
/// whose tags state it, and all if none do.
pub(super) fn ranked(phrase: &Phrase, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    let mut found = found;
    for &size in &phrase.sizes {
        if let Some(ordinal) = phrase.ordinal
            && let Some(order) = order(size, &found, items)
        {
            // "The second tallest": the ordinal decides, not the size alone.
            let index = usize::try_from(ordinal.number - 1).ok();
            return index.and_then(|n| order.get(n).copied()).into_iter().collect();
        }
        let Some(words) = ADJECTIVES.qualities.get(&size).filter(|_| !phrase.superlative) else {
            if let Some(best) = rank(size, &found, items) {
                found = vec![best];
            }
            continue;
        };
        let matching = |i: &usize| items[*i].tags.qualities.iter().any(|q| words.contains(q));
        if found.iter().any(matching) {
            found.retain(matching);
        } else if size == Size::Tall {
            found.retain(|&i| items[i].tags.kind != "building" || items[i].height.is_none_or(|height| height >= TALL_M));
        }
    }
    found
}

/// Height from which a building counts as tall without such a tag, metres: four storeys.
const TALL_M: f64 = 12.0;

fn rank(size: Size, found: &[usize], items: &[Item<'_>]) -> Option<usize> {
    order(size, found, items)?.first().copied()
}

/// Candidates in descending order of a quality; `None` if the items lack the data.
fn order(size: Size, found: &[usize], items: &[Item<'_>]) -> Option<Vec<usize>> {
    let mean = || -> Option<f64> {
        let all: Option<Vec<f64>> = found.iter().map(|&i| items[i].across).collect();
        let all = all?;
        Some(all.iter().sum::<f64>() / all.len().max(1) as f64)
    };
    let key = |i: usize| -> Option<f64> {
        let item = &items[i];
        match size {
            Size::Tall => item.height.map(|h| -h),
            Size::Short => item.height,
            Size::Large => item.size.map(|s| -s),
            Size::Small => item.size,
            Size::Nearest => item.range,
            Size::Farthest => item.range.map(|r| -r),
            Size::Leftmost => item.across,
            Size::Rightmost => item.across.map(|a| -a),
            Size::Middle => Some((item.across? - mean()?).abs()),
        }
    };
    let mut keyed: Vec<(f64, usize)> = found.iter().map(|&i| key(i).map(|k| (k, i))).collect::<Option<_>>()?;
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
    Some(keyed.into_iter().map(|(_, i)| i).collect())
}

/// Candidates with the number in their name ("second gate"); `None` if no candidate has a number.
pub(crate) fn numbered(number: i32, found: &[usize], items: &[Item<'_>]) -> Option<Vec<usize>> {
    let borne = |i: usize| -> Option<i32> {
        let tags = items[i].tags;
        tags.names.iter().chain(&tags.synonyms).find_map(|name| {
            let first = name.split(' ').next()?;
            ADJECTIVES.ordinals.get(first).copied().filter(|number| *number > 0)
        })
    };
    let numbers: Vec<(usize, i32)> = found.iter().filter_map(|&i| borne(i).map(|n| (i, n))).collect();
    (!numbers.is_empty() && number > 0).then(|| numbers.into_iter().filter(|(_, n)| *n == number).map(|(i, _)| i).collect())
}

/// The n-th candidate from a side, or by range if no side is named.
pub(super) fn ordered(number: i32, from: Option<Side>, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    let size = match from {
        Some(Side::Left) => Size::Leftmost,
        Some(Side::Right) => Size::Rightmost,
        _ => Size::Nearest,
    };
    if found.is_empty() {
        return found;
    }
    let Some(order) = order(size, &found, items) else { return found };
    let index = if number < 0 { order.len().checked_sub(1) } else { usize::try_from(number - 1).ok() };
    index.and_then(|i| order.get(i).copied()).into_iter().collect()
}
