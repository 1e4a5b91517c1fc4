//! Times of day.

/// Whether a word is a time of day, and thus no misspelt name of an object.
pub(super) fn is_time(word: &str) -> bool {
    TIMES.contains(&word) || DAYS.contains(&word)
}

/// Whether the word is a time that needs no preposition.
pub(super) fn is_day(word: &str) -> bool {
    DAYS.contains(&word)
}

/// Times of day.
const TIMES: [&str; 18] = [
    "dusk",
    "dawn",
    "night",
    "nighttime",
    "noon",
    "midday",
    "midnight",
    "sunset",
    "sundown",
    "sunrise",
    "daybreak",
    "nightfall",
    "twilight",
    "morning",
    "afternoon",
    "evening",
    "daytime",
    "daylight",
];

/// Times that need no preposition.
const DAYS: [&str; 3] = ["tonight", "tomorrow", "today"];
