//! Helpers for plots of flights and of results.

/// Removes points closer than half a unit to the previous point kept; the last point is always kept.
#[must_use]
pub fn thinned(places: impl IntoIterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    let mut last = None;
    for [x, y] in places {
        let near = kept.last().is_some_and(|[a, b]| (x - a).abs() < 0.5 && (y - b).abs() < 0.5);
        if !near {
            kept.push([x, y]);
        }
        last = near.then_some([x, y]);
    }
    kept.extend(last);
    kept
}

/// Truncates a text to at most `most` characters.
#[must_use]
pub fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars().take(most.saturating_sub(1)).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_keeps_its_shape_and_its_end() {
        let way = [[0.0, 0.0], [0.1, 0.1], [3.0, 1.0], [3.2, 1.0]];
        assert_eq!(thinned(way), [[0.0, 0.0], [3.0, 1.0], [3.2, 1.0]]);
        assert_eq!(thinned([[1.0, 1.0]; 2]), [[1.0, 1.0]; 2]);
        assert_eq!(thinned([]), [[0.0; 2]; 0]);
        assert_eq!((shortened("oracle", 4).as_str(), shortened("oracle", 6).as_str()), ("ora…", "oracle"));
    }
}
