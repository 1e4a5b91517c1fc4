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
    fn persons_and_their_legs_are_persons_and_table_legs_are_not() {
        for name in ["person", "Man in a red coat", "legs", "a pedestrian", "two people"] {
            assert!(is_person(name), "{name}");
        }
        for name in ["table legs", "manhole", "chair leg", "statue", "womanly", ""] {
            assert!(!is_person(name), "{name}");
        }
    }
}
