//! Selects objects of a scene by key or by name, so that a variant, which recolours and renames objects, keeps its
//! targets.

use serde::Deserialize;
use spf_core::geometry::EnuPosition;
use spf_flight::sim::LoadedScene;
use spf_scene::geometry::ObjectId;
use spf_scene::{Aabb, Object};

/// Selects the objects that satisfy all given conditions.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selector {
    /// Key in the scene; the key of a row selects all of it.
    pub id: Option<String>,
    /// One of its names or synonyms.
    pub name: Option<String>,
    /// Its colour.
    pub colour: Option<String>,
    /// Its kind.
    pub kind: Option<String>,
    /// One of its uses.
    #[serde(rename = "use")]
    pub used_to: Option<String>,
    /// One of its qualities.
    pub quality: Option<String>,
    /// Restricts to the object nearest to the one with this key.
    pub nearest_to: Option<String>,
    /// Restricts to one object by its distance from the start.
    pub from_start: Option<Rank>,
}

/// Rank by distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rank {
    /// The nearest.
    Nearest,
    /// The second.
    Second,
}

impl Selector {
    /// Whether there is no condition; that would select everything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let words = [&self.id, &self.name, &self.colour, &self.kind, &self.used_to, &self.quality];
        words.iter().all(|word| word.is_none())
    }

    /// Its words.
    pub(super) fn words(&self) -> impl Iterator<Item = &String> {
        [&self.id, &self.name, &self.colour, &self.kind, &self.used_to, &self.quality, &self.nearest_to].into_iter().flatten()
    }

    fn fits(&self, object: &Object) -> bool {
        let tags = &object.tags;
        let is = |wanted: &Option<String>, found: Option<&str>| wanted.as_deref().is_none_or(|w| found == Some(w));
        let among = |wanted: &Option<String>, found: &[String]| wanted.as_ref().is_none_or(|w| found.contains(w));
        let called = self.name.as_ref().is_none_or(|w| tags.names.contains(w) || tags.synonyms.contains(w));
        called
            && self.id.as_deref().is_none_or(|id| is_of_row(&object.key, id))
            && is(&self.colour, tags.colour.as_deref())
            && is(&self.kind, Some(&tags.kind))
            && among(&self.used_to, &tags.uses)
            && among(&self.quality, &tags.qualities)
    }

    /// The selected objects, ascending by id. `from` is the start.
    #[must_use]
    pub fn select(&self, loaded: &LoadedScene, from: EnuPosition) -> Vec<ObjectId> {
        let mut found: Vec<&Object> = loaded.scene.objects.iter().filter(|object| self.fits(object)).collect();
        if let Some(key) = &self.nearest_to {
            let to = loaded.scene.by_key(key).map(|object| centre(&object.bounds));
            found.sort_by(|a, b| to.map_or(core::cmp::Ordering::Equal, |to| by_distance(a, b, to)));
            found.truncate(usize::from(to.is_some()));
        }
        if let Some(rank) = self.from_start {
            found.sort_by(|a, b| by_distance(a, b, from));
            found = found.get(rank as usize).map_or_else(Vec::new, |object| vec![*object]);
        }
        found.iter().map(|object| object.id).collect()
    }
}

/// The objects of several selectors, without duplicates, ascending by id.
pub(crate) fn select_all(selectors: &[Selector], loaded: &LoadedScene, from: EnuPosition) -> Vec<ObjectId> {
    let mut all: Vec<ObjectId> = selectors.iter().flat_map(|selector| selector.select(loaded, from)).collect();
    all.sort_unstable();
    all.dedup();
    all
}

fn is_of_row(key: &str, id: &str) -> bool {
    key == id || key.rsplit_once('_').is_some_and(|(row, n)| row == id && !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
}

fn by_distance(a: &Object, b: &Object, to: EnuPosition) -> core::cmp::Ordering {
    let away = |object: &Object| centre(&object.bounds).horizontal_distance(to);
    away(a).total_cmp(&away(b))
}

/// The centre of a box.
pub(crate) fn centre(bounds: &Aabb) -> EnuPosition {
    let (min, max) = (bounds.min, bounds.max);
    EnuPosition { east: 0.5 * (min.east + max.east), north: 0.5 * (min.north + max.north), up: 0.5 * (min.up + max.up) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_key_of_a_row_means_all_of_it() {
        assert!(is_of_row("tree_12", "tree") && is_of_row("tree", "tree"));
        assert!(!is_of_row("tree_house", "tree") && !is_of_row("tree_", "tree") && !is_of_row("red_tree", "tree"));
    }
}
