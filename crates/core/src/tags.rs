//! Object tags: names and properties of an object, as given by the scene and read by the oracle and the judge.

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
    /// True for an opening, which is rendered into a separate id image.
    pub opening: bool,
    /// Key of the object that an opening belongs to.
    pub opening_of: Option<String>,
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
