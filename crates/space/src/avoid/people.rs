//! Which obstacles are persons, by the name that the VLM or detector gives.

/// Words for persons and for what is often all that a frame shows of one.
const WORDS: [&str; 32] = [
    "person",
    "persons",
    "people",
    "man",
    "men",
    "woman",
    "women",
    "child",
    "children",
    "kid",
    "kids",
    "boy",
    "girl",
    "pedestrian",
    "pedestrians",
    "human",
    "worker",
    "walker",
    "lady",
    "gentleman",
    "guy",
    "somebody",
    "someone",
    "cyclist",
    "passenger",
    "visitor",
    "baby",
    "legs",
    "leg",
    "feet",
    "foot",
    "face",
];
/// Words that make legs and feet those of a thing.
const THINGS: [&str; 8] = ["table", "chair", "desk", "stool", "bench", "tripod", "furniture", "sofa"];

/// Words for persons who are not of a grown-up person's stature, or of whom a box holds a part.
const SMALL: [&str; 18] = [
    "child", "children", "kid", "kids", "boy", "girl", "baby", "toddler", "legs", "leg", "feet", "foot", "face", "head",
    "cyclist", "sitting", "lying", "kneeling",
];

/// Whether a box of this name is around one grown-up person, upright, from head to foot.
#[must_use]
pub fn is_grown_up(name: &str) -> bool {
    let mut words = name.split(|c: char| !c.is_alphanumeric()).map(str::to_lowercase);
    is_person(name) && !words.any(|word| SMALL.contains(&word.as_str()))
}

/// Whether an obstacle of this name is a person, or a part of one.
#[must_use]
pub fn is_person(name: &str) -> bool {
    let words = || name.split(|c: char| !c.is_alphanumeric()).map(str::to_lowercase);
    let among = |list: &[&str]| words().any(|word| list.contains(&word.as_str()));
    among(&WORDS) && !among(&THINGS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_cyclists_and_legs_are_not_of_a_grown_up_persons_stature() {
        for name in ["person with red cone", "Man in a red coat", "the woman"] {
            assert!(is_grown_up(name), "{name}");
        }
        for name in ["child in red", "a sitting man", "the man's legs", "red cone", "boy"] {
            assert!(!is_grown_up(name), "{name}");
        }
    }

    #[test]
    fn persons_and_their_legs_are_persons_and_table_legs_are_not() {
        for name in ["person", "Man in a red coat", "legs", "a pedestrian", "two people"] {
            assert!(is_person(name), "{name}");
        }
        for name in ["table legs", "manhole", "chair leg", "statue", "womanly", ""] {
            assert!(!is_person(name), "{name}");
        }
    }
}
