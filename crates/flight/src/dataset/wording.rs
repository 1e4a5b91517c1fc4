//! Generates instructions from tags in varied wording. The language resolver checks whether each is unambiguous.

use spf_core::rng::RandomStream;

use spf_core::tags::Tagged;

/// Phrasings of an instruction; `{}` is the target without an article.
const ORDERS: [&str; 16] = [
    "Fly to the {}",
    "Go to the {}",
    "Head to the {}",
    "Move towards the {}",
    "Navigate to the {}",
    "Approach the {}",
    "Take off and fly to the {}",
    "Please fly over to the {}",
    "Find the {} and fly to it",
    "Look for the {}",
    "Bring the drone to the {}",
    "Fly straight to the {}.",
    "go near the {}",
    "I want to see the {}",
    "Proceed to the {}, please",
    "Search for the {}",
];

/// Phrasings of a target by its use; `{}` is the use.
const USES: [&str; 4] =
    ["Find something I can use to {}", "Fly to something that can {}", "Go to a thing to {}", "Fly to where people {}"];

/// The attribute by which an instruction describes its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wording {
    /// Its name alone.
    Name,
    /// A synonym.
    Synonym,
    /// Colour and name.
    Colour,
    /// An adjective and a name.
    Quality,
    /// Adjective, colour and name.
    QualityColour,
    /// Position among similar objects in the image: leftmost, rightmost, nearest.
    Place,
    /// Its use.
    Use,
}

impl Wording {
    /// Whether it distinguishes objects of the same name by colour or quality.
    #[must_use]
    pub fn by_look(self) -> bool {
        matches!(self, Self::Colour | Self::Quality | Self::QualityColour)
    }
}

/// All instructions that the tags of an object allow, shuffled by `draw`. Each kind of wording has the same probability
/// of coming first, however many names there are.
pub(super) fn instructions(tags: &Tagged, rng: &mut RandomStream) -> Vec<(Wording, String)> {
    let mut kinds: Vec<(Wording, Vec<String>)> = [
        (Wording::Name, names(tags, &tags.names)),
        (Wording::Synonym, names(tags, &tags.synonyms)),
        (Wording::Colour, coloured(tags)),
        (Wording::Quality, with_qualities(tags, &names(tags, &tags.names))),
        (Wording::QualityColour, with_qualities(tags, &coloured(tags))),
        (Wording::Place, placed(tags)),
        (Wording::Use, tags.uses.clone()),
    ]
    .into_iter()
    .filter(|(_, ways)| !ways.is_empty())
    .collect();
    shuffle(&mut kinds, rng);
    for (_, ways) in &mut kinds {
        shuffle(ways, rng);
    }
    let longest = kinds.iter().map(|(_, ways)| ways.len()).max().unwrap_or(0);
    let mut worded = Vec::new();
    for nth in 0..longest {
        for (wording, ways) in &kinds {
            if let Some(way) = ways.get(nth) {
                let orders: &[&str] = if *wording == Wording::Use { &USES } else { &ORDERS };
                worded.push((*wording, orders[rng.below(orders.len())].replace("{}", way)));
            }
        }
    }
    worded
}

/// Names that can follow an article.
fn names(tags: &Tagged, list: &[String]) -> Vec<String> {
    // Plurals such as "stairs" and phrases are fine; only the kind itself would appear twice.
    list.iter().filter(|name| !name.is_empty() && **name != tags.kind || list.len() == 1).cloned().collect()
}

fn coloured(tags: &Tagged) -> Vec<String> {
    let Some(colour) = &tags.colour else { return Vec::new() };
    let all = names(tags, &tags.names).into_iter().chain(names(tags, &tags.synonyms));
    let plain = all.filter(|name| !name.contains(colour.as_str()));
    // A person's colour is that of their clothes.
    let clothes = tags.kind == "person";
    plain.map(|name| if clothes { format!("{name} in {colour}") } else { format!("{colour} {name}") }).collect()
}

fn with_qualities(tags: &Tagged, names: &[String]) -> Vec<String> {
    let pair = |quality: &String| {
        let plain = names.iter().filter(|name| !name.contains(quality.as_str()));
        plain.map(|name| format!("{quality} {name}")).collect::<Vec<_>>()
    };
    tags.qualities.iter().flat_map(pair).collect()
}

/// Words for positions.
pub(super) const PLACES: [&str; 3] = ["leftmost", "rightmost", "nearest"];

fn placed(tags: &Tagged) -> Vec<String> {
    let names = names(tags, &tags.names);
    PLACES.iter().flat_map(|place| names.iter().map(move |name| format!("{place} {name}"))).collect()
}

/// Fisher-Yates shuffle.
pub(super) fn shuffle<T>(list: &mut [T], rng: &mut RandomStream) {
    for last in (1..list.len()).rev() {
        list.swap(last, rng.below(last + 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_oracle::{Placed, resolve_truth};

    fn tags(id: u16, name: &str, colour: &str, quality: &str) -> Tagged {
        Tagged {
            id,
            key: format!("thing_{id}"),
            names: vec![name.to_owned()],
            synonyms: vec![format!("{name} thing")],
            colour: Some(colour.to_owned()),
            kind: "furniture".to_owned(),
            qualities: vec![quality.to_owned()],
            uses: vec!["sit".to_owned()],
            ..Tagged::default()
        }
    }

    /// Every phrasing is understood: among two objects of one name, the right one is chosen whenever the wording can
    /// distinguish them.
    #[test]
    fn every_order_is_understood() {
        let (red, blue) = (tags(1, "chair", "red", "tall"), tags(2, "chair", "blue", "low"));
        let objects = [Placed { tags: &red, place: None }, Placed { tags: &blue, place: None }];
        for order in ORDERS {
            let instruction = order.replace("{}", "blue chair");
            let meant = resolve_truth(&instruction, &objects, None);
            assert_eq!((meant.objects, meant.checkable), (vec![2], true), "{instruction}");
        }
        let people = [tags(1, "person", "red", "tall"), tags(2, "person", "blue", "low")]
            .map(|tags| Tagged { kind: "person".to_owned(), ..tags });
        let objects = people.each_ref().map(|tags| Placed { tags, place: None });
        let worded = coloured(&people[1]);
        assert_eq!(worded[0], "person in blue");
        assert_eq!(resolve_truth(&format!("Fly to the {}", worded[0]), &objects, None).objects, [2]);
        let lamp = Tagged { uses: vec!["give light".to_owned()], ..tags(3, "lamp", "white", "bright") };
        let objects = [Placed { tags: &red, place: None }, Placed { tags: &lamp, place: None }];
        for order in USES {
            let instruction = order.replace("{}", "sit");
            assert_eq!(resolve_truth(&instruction, &objects, None).objects, [1], "{instruction}");
        }
    }

    #[test]
    fn words_vary_and_repeat_by_seed() {
        let red = tags(1, "chair", "red", "tall");
        let worded = |seed| instructions(&red, &mut RandomStream::new(seed, "test", &[]));
        assert_eq!(worded(4), worded(4));
        let firsts: std::collections::BTreeSet<Wording> = (0..60).map(|seed| worded(seed)[0].0).collect();
        assert_eq!(firsts.len(), 7, "{firsts:?}");
    }
}
