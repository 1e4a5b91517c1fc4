//! Object names from those of modelling programs: `Red_Car.003` is a red car.

use std::collections::BTreeSet;

use glam::Vec3;

use spf_core::tags::SURFACES;

/// Maximum length of a name that is read, characters.
const LONGEST: usize = 60;

/// The lower-case words of a node's name, without the numbers that programs add.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut before = ' ';
    for c in name.chars().take(LONGEST) {
        let starts = c.is_uppercase() && before.is_lowercase() || c.is_ascii_digit() != before.is_ascii_digit();
        if starts || !c.is_alphanumeric() {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| c.is_alphanumeric()) {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    while words.len() > 1 && words.last().is_some_and(|word| word.bytes().all(|b| b.is_ascii_digit())) {
        words.pop();
    }
    words
}

/// Names for the tags: all words and, if a colour or a number precedes it, the noun alone.
pub(super) fn names(words: &[String]) -> Vec<String> {
    let mut names = vec![words.join(" ")];
    let thing = words.iter().position(|w| !is_colour(w)).unwrap_or(0);
    if thing > 0 {
        names.push(words[thing..].join(" "));
    }
    names
}

/// Colour words in names: those that the oracle knows and that are not object names.
const COLOURS: [&str; 19] = [
    "red",
    "orange",
    "yellow",
    "green",
    "turquoise",
    "cyan",
    "blue",
    "purple",
    "violet",
    "pink",
    "magenta",
    "brown",
    "beige",
    "white",
    "grey",
    "gray",
    "silver",
    "black",
    "golden",
];

fn is_colour(word: &str) -> bool {
    COLOURS.contains(&word)
}

/// The colour named in a name.
pub(super) fn colour(words: &[String]) -> Option<String> {
    words.iter().find(|word| is_colour(word)).cloned()
}

/// The kind of object for a name: a kind of ground if the last word names one, else `object`.
pub(super) fn kind(words: &[String]) -> String {
    let last = words.last().map(String::as_str);
    last.filter(|word| SURFACES.contains(word)).unwrap_or("object").to_owned()
}

/// The word for a colour; `light` is linear RGB.
pub(super) fn colour_word(light: Vec3) -> &'static str {
    // Perceptual: roughly the square root of linear light.
    let seen = light.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt);
    let (most, least) = (seen.max_element(), seen.min_element());
    let spread = most - least;
    if most < 0.16 {
        return "black";
    }
    if spread < 0.12 * most.max(0.5) {
        return if least > 0.82 {
            "white"
        } else if most < 0.25 {
            "black"
        } else {
            "grey"
        };
    }
    // Hue angle in degrees: red 0, green 120, blue 240.
    let sector = if most == seen.x {
        (seen.y - seen.z) / spread
    } else if most == seen.y {
        2.0 + (seen.z - seen.x) / spread
    } else {
        4.0 + (seen.x - seen.y) / spread
    };
    let hue = if sector < 0.0 { sector * 60.0 + 360.0 } else { sector * 60.0 };
    let pale = spread < 0.35 * most;
    match hue {
        h if !(14.0..345.0).contains(&h) => {
            if pale && most > 0.6 {
                "pink"
            } else {
                "red"
            }
        }
        h if h < 48.0 => {
            if pale && most > 0.6 {
                "beige"
            } else if most < 0.72 {
                "brown"
            } else {
                "orange"
            }
        }
        h if h < 70.0 => {
            if pale {
                "beige"
            } else {
                "yellow"
            }
        }
        h if h < 165.0 => "green",
        h if h < 195.0 => "turquoise",
        h if h < 255.0 => "blue",
        h if h < 300.0 => "purple",
        _ => "pink",
    }
}

/// A key of lower-case letters, digits and `_` that no other object has.
pub(super) fn unique_key(name: &str, taken: &mut BTreeSet<String>) -> String {
    let mut key = String::new();
    for c in name.chars().take(LONGEST).flat_map(char::to_lowercase) {
        if c.is_ascii_lowercase() || c.is_ascii_digit() {
            key.push(c);
        } else if !key.is_empty() && !key.ends_with('_') {
            key.push('_');
        }
    }
    let key = key.trim_end_matches('_');
    let base = if key.is_empty() { "object" } else { key };
    let mut unique = base.to_owned();
    let mut count = 1;
    while !taken.insert(unique.clone()) {
        count += 1;
        unique = format!("{base}_{count}");
    }
    unique
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::srgb_to_linear;

    #[test]
    fn names_of_programs_become_words() {
        let joined = |name: &str| words(name).join(" ");
        assert_eq!(joined("Red_Car.003"), "red car");
        assert_eq!(joined("RedCar2"), "red car");
        assert_eq!(joined("tall-white building"), "tall white building");
        assert_eq!(joined("3D Printer_01"), "3 d printer");
        assert_eq!(joined("007"), "007");
        assert_eq!(joined("Müllcontainer"), "müllcontainer");
        assert_eq!(joined("..__"), "");
        assert_eq!(names(&words("Red_Car.003")), ["red car", "car"]);
        assert_eq!(names(&words("red")), ["red"]);
        assert_eq!(colour(&words("big RED ball")).as_deref(), Some("red"));
        assert_eq!((kind(&words("Forest Floor")).as_str(), kind(&words("floor lamp")).as_str()), ("floor", "object"));
    }

    #[test]
    fn keys_are_unique() {
        let mut taken = BTreeSet::new();
        let keys: Vec<_> = ["Red Car", "red-car", "Red_Car_2", "Ä", "", "red car"].map(|n| unique_key(n, &mut taken)).into();
        assert_eq!(keys, ["red_car", "red_car_2", "red_car_2_2", "object", "object_2", "red_car_3"]);
    }

    #[test]
    fn colours_have_words() {
        let word = |rgb: [u8; 3]| colour_word(rgb.map(|c| srgb_to_linear(f64::from(c) / 255.0) as f32).into());
        for (rgb, expected) in [
            ([200, 30, 30], "red"),
            ([120, 10, 10], "red"),
            ([240, 130, 20], "orange"),
            ([110, 70, 40], "brown"),
            ([220, 200, 170], "beige"),
            ([240, 220, 40], "yellow"),
            ([40, 140, 50], "green"),
            ([60, 90, 40], "green"),
            ([40, 180, 180], "turquoise"),
            ([30, 60, 170], "blue"),
            ([90, 140, 220], "blue"),
            ([110, 50, 150], "purple"),
            ([240, 150, 180], "pink"),
            ([245, 245, 240], "white"),
            ([128, 128, 130], "grey"),
            ([20, 20, 22], "black"),
        ] {
            assert_eq!(word(rgb), expected, "{rgb:?}");
        }
    }
}
