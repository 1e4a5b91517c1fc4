//! Instructions from tags, in a variety of words. Whether one says what it should is for the language's resolver to tell.

use spf_core::rng::Draw;

use spf_core::tags::Tagged;

/// Ways to tell someone to go somewhere; `{}` is the thing, without an article.
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

/// Ways to name a thing by what it serves for; `{}` is the use.
const USES: [&str; 4] =
    ["Find something I can use to {}", "Fly to something that can {}", "Go to a thing to {}", "Fly to where people {}"];

/// By what the instruction tells its target from the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wording {
    /// By a name alone.
    Name,
    /// By another name.
    Synonym,
    /// By colour and name.
    Colour,
    /// By an adjective and a name.
    Quality,
    /// By adjective, colour and name.
    QualityColour,
    /// By its place among its like in the image: leftmost, rightmost, nearest.
    Place,
    /// By what it serves for.
    Use,
}

impl Wording {
    /// Whether it tells one thing from another of the same name by colour or quality.
    #[must_use]
    pub fn by_look(self) -> bool {
        matches!(self, Self::Colour | Self::Quality | Self::QualityColour)
    }
}

/// Every way to name an object that its tags give, in an order drawn by `draw`, as whole instructions. Ways differ in kind
/// before they differ in word: each kind has the same chance to come first, however many names there are.
pub(super) fn instructions(tags: &Tagged, draw: &mut Draw) -> Vec<(Wording, String)> {
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
    shuffle(&mut kinds, draw);
    for (_, ways) in &mut kinds {
        shuffle(ways, draw);
    }
    let longest = kinds.iter().map(|(_, ways)| ways.len()).max().unwrap_or(0);
    let mut told = Vec::new();
    for nth in 0..longest {
        for (wording, ways) in &kinds {
            if let Some(way) = ways.get(nth) {
                let orders: &[&str] = if *wording == Wording::Use { &USES } else { &ORDERS };
                told.push((*wording, orders[draw.below(orders.len())].replace("{}", way)));
            }
        }
    }
    told
}

/// Names that fit behind an article.
fn names(tags: &Tagged, list: &[String]) -> Vec<String> {
    // A plural such as "stairs" or a phrase is as good as any; only the colour's own word would stand twice.
    list.iter().filter(|name| !name.is_empty() && **name != tags.kind || list.len() == 1).cloned().collect()
}

fn coloured(tags: &Tagged) -> Vec<String> {
    let Some(colour) = &tags.colour else { return Vec::new() };
    let all = names(tags, &tags.names).into_iter().chain(names(tags, &tags.synonyms));
    let plain = all.filter(|name| !name.contains(colour.as_str()));
    // A person's colour is that of the clothes.
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

/// Words of place.
pub(super) const PLACES: [&str; 3] = ["leftmost", "rightmost", "nearest"];

fn placed(tags: &Tagged) -> Vec<String> {
    let names = names(tags, &tags.names);
    PLACES.iter().flat_map(|place| names.iter().map(move |name| format!("{place} {name}"))).collect()
}

/// Fisher and Yates.
pub(super) fn shuffle<T>(list: &mut [T], draw: &mut Draw) {
    for last in (1..list.len()).rev() {
        list.swap(last, draw.below(last + 1));
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

    /// Every order is understood: among two things of one name the right one is meant whenever the words can tell.
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
        let told = coloured(&people[1]);
        assert_eq!(told[0], "person in blue");
        assert_eq!(resolve_truth(&format!("Fly to the {}", told[0]), &objects, None).objects, [2]);
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
        let told = |seed| instructions(&red, &mut Draw::new(seed, "test", &[]));
        assert_eq!(told(4), told(4));
        let firsts: std::collections::BTreeSet<Wording> = (0..60).map(|seed| told(seed)[0].0).collect();
        assert_eq!(firsts.len(), 7, "{firsts:?}");
    }
}
