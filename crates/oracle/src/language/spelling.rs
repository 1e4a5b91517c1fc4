//! Spelling: edit distance and the nearest word.

/// Edits between two words: insertion, deletion, substitution, and swap of neighbours (Damerau 1964, restricted form).
#[must_use]
pub(crate) fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let width = b.len() + 1;
    let mut before = vec![0; width];
    let mut last: Vec<usize> = (0..width).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; width];
        for j in 1..=b.len() {
            let changed = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = changed.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = core::mem::replace(&mut last, row);
    }
    last[b.len()]
}

/// The word of `words` with the fewest edits from `word`; the first of equals.
pub(crate) fn nearest<'a>(word: &str, words: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    words.map(|known| (distance(word, known), known)).min_by_key(|(edits, _)| *edits).map(|(_, known)| known)
}

/// Number of edits allowed in a word of this many letters: none below four letters, one up to six, two from seven.
#[must_use]
pub(crate) fn forgiven(letters: usize) -> usize {
    match letters {
        0..4 => 0,
        4..7 => 1,
        _ => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_counted() {
        for (a, b, edits) in
            [("crane", "crane", 0), ("crnae", "crane", 1), ("bulding", "building", 1), ("", "abc", 3), ("car", "tree", 4)]
        {
            assert_eq!(distance(a, b), edits, "{a} {b}");
            assert_eq!(distance(b, a), edits, "{b} {a}");
        }
        assert_eq!(nearest("towr", ["crane", "tower"].into_iter()), Some("tower"));
    }
}
