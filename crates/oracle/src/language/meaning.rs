//! Meanings of words: actions, relations and ranks.

use serde::Deserialize;

/// The action on the target (`docs/explanation/oracle.md` lists the stages of each).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verb {
    /// Fly to it; also for finding, approaching and reaching.
    GoTo,
    /// Through its opening.
    Through,
    /// Once around it.
    Around,
    /// Over it.
    Over,
    /// Up along it, to its top.
    Up,
    /// To its far side.
    Behind,
    /// Look all around.
    Scan,
    /// Stay near it.
    Follow,
}

impl Verb {
    /// Its name in a task file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::GoTo => "go_to",
            Self::Through => "through",
            Self::Around => "around",
            Self::Over => "over",
            Self::Up => "up",
            Self::Behind => "behind",
            Self::Scan => "scan",
            Self::Follow => "follow",
        }
    }
}

/// How the user asks for the target: with or without a flight verb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// With a verb of flying or looking: "go to the bus".
    Flight,
    /// Without a verb: "bus". The drone flies to it.
    Unsaid,
    /// With another verb: "make me a sandwich". The drone flies to it if the scene has one, and does not search for it.
    Other,
}

/// Relation of one object to another, in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// Close to it.
    Near,
    /// Farthest from it.
    FarFrom,
    /// Left of it.
    LeftOf,
    /// Right of it.
    RightOf,
    /// Farther away, in about the same direction.
    Behind,
    /// Nearer, in about the same direction.
    InFrontOf,
    /// Between two others.
    Between,
    /// Lower in the image and close.
    Under,
    /// On, in or above it.
    On,
    /// Taller than it.
    TallerThan,
    /// Shorter than it.
    ShorterThan,
}

/// A side of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
    /// Middle.
    Middle,
}

/// Words of size and position that rank objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Size {
    /// Tall.
    Tall,
    /// Short.
    Short,
    /// Large.
    Large,
    /// Small.
    Small,
    /// Nearest.
    Nearest,
    /// Farthest.
    Farthest,
    /// The leftmost.
    Leftmost,
    /// The rightmost.
    Rightmost,
    /// In the middle of the others.
    Middle,
}
