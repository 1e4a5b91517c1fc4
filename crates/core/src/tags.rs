//! Object tags: names and properties of an object, as given by the scene and read by the oracle and the judge.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

/// The tags of one object.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Tagged {
    /// Id in the id image; never 0.
    pub id: u16,
    /// Its key in the scene file.
    pub key: String,
    /// Names, the most common first.
    pub names: Vec<String>,
    /// Other names.
    pub synonyms: Vec<String>,
    /// Colour; several joined by `and`.
    pub colour: Option<String>,
    /// Kind (`building`, `car`, `tree`, …).
    pub kind: String,
    /// Adjectives that distinguish it from others of its kind (`tall`, `slender`, `low`, …).
    pub qualities: Vec<String>,
    /// Its uses, in a few words each.
    pub uses: Vec<String>,
    /// The place or set to which it belongs: meeting room, construction site.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Whether it stands for its group, because no object of the scene is named after it ([`Tagged::represent_groups`]): whoever
    /// goes to the meeting table is in the meeting room.
    #[serde(skip_serializing_if = "core::ops::Not::not")]
    pub stands_for_group: bool,
    /// True for an opening, which is rendered into a separate id image.
    pub opening: bool,
    /// Key of the object that an opening belongs to.
    pub opening_of: Option<String>,
    /// Key of the object that a look-alike, such as a picture on a wall, seems to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub looks_like: Option<String>,
}

/// A part of an object that has a name of its own, such as one pier of a bridge.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PieceTag {
    /// Id of the object.
    pub object: u16,
    /// What somebody who looks at it would call it, in lower case.
    pub name: String,
    /// Whether it is the part that one points at to show the object: the mast of a crane.
    pub main: bool,
    /// Whether one can collide with any of it: not with a thin rope.
    pub solid: bool,
}

impl Tagged {
    /// Colour and first name, as the oracle names it in a reply.
    #[must_use]
    pub fn words(&self) -> String {
        let name = self.names.first().unwrap_or(&self.kind);
        match &self.colour {
            Some(colour) if !name.contains(colour.as_str()) => format!("{colour} {name}"),
            _ => name.clone(),
        }
    }

    /// Lets the objects of a scene stand for their groups, where no object is named after the group.
    pub fn represent_groups(objects: &mut [Self]) {
        let named: BTreeSet<String> = objects.iter().flat_map(|tags| tags.names.iter().chain(&tags.synonyms)).cloned().collect();
        for tags in objects {
            tags.stands_for_group = tags.group.as_ref().is_some_and(|group| !named.contains(group));
        }
    }

    /// Whether it is ground or water, which is flown over and never an obstacle.
    #[must_use]
    pub fn is_surface(&self) -> bool {
        SURFACES.contains(&self.kind.as_str())
    }
}

/// Kinds that are ground or water.
pub const SURFACES: [&str; 22] = [
    "ground", "road", "street", "path", "pavement", "sidewalk", "grass", "lawn", "field", "water", "lake", "pond", "river",
    "sea", "plaza", "square", "parking", "floor", "sky", "marking", "crossing", "terrain",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_stands_for_a_group_that_no_object_is_named_after() {
        let of =
            |name: &str, group: &str| Tagged { names: vec![name.to_owned()], group: Some(group.to_owned()), ..Tagged::default() };
        let mut objects = [of("table", "meeting room"), of("break room", "office"), of("chair", "break room"), Tagged::default()];
        Tagged::represent_groups(&mut objects);
        assert_eq!(objects.map(|tags| tags.stands_for_group), [true, true, false, false]);
    }
}
