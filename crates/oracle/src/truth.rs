//! The truth behind `verified` (DESIGN.md section 5, "Truth"): what the last stage may mean, without errors, over all objects.

use spf_core::geometry::wrap_angle;
use spf_core::tags::Tagged;

use super::language::resolve::{Item, meant, vocabulary};
use super::language::{Phrase, Verb, parse};
use super::place::{Placed, Viewpoint};

/// Every object that the last stage of an instruction may mean.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TruthTarget {
    /// Their numbers in the scene's list, in the order given.
    pub objects: Vec<u16>,
    /// False where the verb needs a predicate that only the bench has: through, around, over, behind, scan, follow.
    pub checkable: bool,
    /// Whether anything fits. `verified` is false where nothing does.
    pub fits: bool,
}

/// What the instruction's last stage may mean among all objects of the scene.
///
/// Any object that fits the words counts: every tree for "a tree". Words of order, size and relation narrow the set where
/// places are given, as seen from `from`, the start of the flight.
#[must_use]
pub fn resolve_truth(instruction: &str, objects: &[Placed<'_>], from: Option<Viewpoint>) -> TruthTarget {
    let parsed = parse(instruction, &vocabulary(objects.iter().map(|o| o.tags)));
    let Some(last) = parsed.clauses.last() else { return TruthTarget { checkable: true, ..TruthTarget::default() } };
    let found = resolve_phrase(&last.target, objects, from);
    TruthTarget { fits: !found.is_empty(), objects: found, checkable: last.verb == Verb::GoTo }
}

/// The objects a phrase may mean, by number.
pub(super) fn resolve_phrase(phrase: &Phrase, objects: &[Placed<'_>], from: Option<Viewpoint>) -> Vec<u16> {
    let items: Vec<Item<'_>> = objects.iter().map(|object| item(object, from)).collect();
    meant(phrase, &items).into_iter().map(|i| items[i].tags.id).collect()
}

/// An object as it stands to the start: right and forward in metres, across as the bearing.
fn item<'a>(object: &Placed<'a>, from: Option<Viewpoint>) -> Item<'a> {
    let tags: &Tagged = object.tags;
    let Some(place) = object.place else {
        return Item { tags, across: None, half: 0.0, range: None, size: None, height: None, position: None, weight: 0.0 };
    };
    let origin = from.unwrap_or_default();
    let away = origin.position.displacement_to(place.centre, origin.attitude.heading);
    let range = libm::hypot(away.right, away.forward);
    let seen = from.is_some();
    Item {
        tags,
        across: seen.then(|| wrap_angle(libm::atan2(away.right, away.forward))),
        half: libm::atan2(0.5 * place.width, range),
        range: seen.then_some(range),
        size: Some(place.width * place.height),
        height: Some(place.height),
        position: Some([away.right, away.forward, away.up]),
        weight: place.width * place.height,
    }
}
