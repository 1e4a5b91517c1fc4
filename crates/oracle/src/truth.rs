//! Ground truth for `verified`: the objects that the last stage may mean, without errors, over all objects.

use super::language::resolve::meant_by;
use super::language::score::vocabulary;
use super::language::{Clause, Verb, parse};
use super::place::{Placed, Viewpoint};

/// All objects that the last stage of an instruction may mean.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TruthTarget {
    /// Their ids in the scene, in the order given.
    pub objects: Vec<u16>,
    /// False if the verb needs a predicate that only the bench has: through, around, over, behind, scan, follow.
    pub checkable: bool,
    /// Whether the last stage is to follow, which nothing ends.
    pub follows: bool,
    /// Whether any object matches; otherwise `verified` is false.
    pub fits: bool,
}

/// Resolves the last stage of an instruction over all objects of the scene.
///
/// Any matching object counts: every tree for "a tree". Ordinals, sizes and relations narrow the set if positions are
/// given, as seen from `from`, the start of the flight.
#[must_use]
pub fn resolve_truth(instruction: &str, objects: &[Placed<'_>], from: Option<Viewpoint>) -> TruthTarget {
    let parsed = parse(instruction, &vocabulary(objects.iter().map(|o| o.tags)));
    let Some(last) = parsed.clauses.last() else { return TruthTarget { checkable: true, ..TruthTarget::default() } };
    let found = resolve_clause(last, objects, from);
    TruthTarget {
        fits: !found.is_empty(),
        objects: found,
        checkable: last.verb == Verb::GoTo,
        follows: last.verb == Verb::Follow,
    }
}

/// The objects a clause may mean, by number.
fn resolve_clause(clause: &Clause, objects: &[Placed<'_>], from: Option<Viewpoint>) -> Vec<u16> {
    let items: Vec<_> = objects.iter().map(|object| object.seen_from(from)).collect();
    meant_by(clause.verb, &clause.target, &items).into_iter().map(|i| items[i].tags.id).collect()
}
