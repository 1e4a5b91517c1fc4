//! Relations between objects: left of one, behind it, between two.

use super::item::Item;
use super::meaning::Relation;

/// The candidates that stand in the given relation to an anchor object, itself given as candidates. Without an anchor there are
/// none.
/// With `all`, every candidate on a side is kept, because an ordinal will select among them.
pub(super) fn related(
    relation: Relation,
    anchors: &[Vec<usize>],
    found: Vec<usize>,
    items: &[Item<'_>],
    all: bool,
) -> Vec<usize> {
    if anchors.is_empty() || anchors.iter().any(Vec::is_empty) {
        return Vec::new();
    }
    let pairs = |i: usize| anchors[0].iter().copied().filter(move |&a| a != i);
    let least = |cost: &dyn Fn(usize, usize) -> Option<f64>| -> Vec<usize> {
        let costs: Vec<(usize, f64)> =
            found.iter().filter_map(|&i| pairs(i).filter_map(|a| cost(i, a)).min_by(f64::total_cmp).map(|c| (i, c))).collect();
        closest(&costs)
    };
    let placed = |i: usize| items[i].position.is_some();
    if !found.iter().all(|&i| placed(i)) || !anchors.iter().flatten().all(|&a| placed(a)) {
        return found;
    }
    match relation {
        Relation::Near | Relation::On => least(&|i, a| gap(&items[i], &items[a])),
        Relation::FarFrom => least(&|i, a| gap(&items[i], &items[a]).map(|d| -d)),
        Relation::Between => {
            // "Between the two trees": between any two of them.
            let second = anchors.get(1).unwrap_or(&anchors[0]);
            let costs: Vec<(usize, f64)> = found
                .iter()
                .filter_map(|&i| {
                    let detour = anchors[0]
                        .iter()
                        .flat_map(|&a| second.iter().map(move |&b| (a, b)))
                        .filter(|&(a, b)| a != b && a != i && b != i);
                    detour
                        .filter_map(|(a, b)| Some(gap(&items[i], &items[a])? + gap(&items[i], &items[b])?))
                        .min_by(f64::total_cmp)
                        .map(|c| (i, c))
                })
                .collect();
            closest(&costs)
        }
        Relation::LeftOf | Relation::RightOf => {
            let sign = if relation == Relation::LeftOf { 1.0 } else { -1.0 };
            if all {
                // "The second car on the left of the avenue": ordinals count all objects on that side.
                let beside = |i: usize, a: usize| Some(sign * (items[a].across? - items[i].across?) > 0.0);
                return found.into_iter().filter(|&i| pairs(i).any(|a| beside(i, a) == Some(true))).collect();
            }
            least(&|i, a| {
                let beside = sign * (items[a].across? - items[i].across?);
                if beside > 0.0 { gap(&items[i], &items[a]) } else { None }
            })
        }
        Relation::Behind | Relation::InFrontOf => {
            let sign = if relation == Relation::Behind { 1.0 } else { -1.0 };
            least(&|i, a| {
                let farther = sign * (items[i].range? - items[a].range?);
                let apart = (items[i].across? - items[a].across?).abs();
                // In about the same direction: the bearings overlap, or nearly.
                if farther > 0.0 {
                    Some(farther + 40.0 * (apart - items[a].half - items[i].half).max(0.0) * items[a].range? / 40.0)
                } else {
                    None
                }
            })
        }
        Relation::Under => least(&|i, a| {
            let lower = items[a].position?[2] - items[i].position?[2];
            if lower > 0.0 { gap(&items[i], &items[a]) } else { None }
        }),
        Relation::TallerThan | Relation::ShorterThan => {
            let sign = if relation == Relation::TallerThan { 1.0 } else { -1.0 };
            found
                .into_iter()
                .filter(|&i| {
                    pairs(i).any(|a| matches!((items[i].height, items[a].height), (Some(h), Some(of)) if sign * (h - of) > 0.0))
                })
                .collect()
        }
    }
}

/// Horizontal distance between two objects, metres.
fn gap(a: &Item<'_>, b: &Item<'_>) -> Option<f64> {
    let (p, q) = (a.position?, b.position?);
    Some(libm::hypot(p[0] - q[0], p[1] - q[1]))
}

/// The candidate with the lowest cost.
fn closest(costs: &[(usize, f64)]) -> Vec<usize> {
    costs.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| vec![*i]).unwrap_or_default()
}
