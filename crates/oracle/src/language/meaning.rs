//! Meanings of words: actions, relations and ranks.

use serde::Deserialize;

/// What is to be done with the target (`docs/explanation/oracle.md` has the stages of each).
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

/// How a thing is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// With a verb of flying or looking: "go to the bus".
    Flight,
    /// Without a verb: "bus". It is gone to.
    Unsaid,
    /// With a verb for something else: "make me a sandwich". It is gone to if it is there, and not searched for.
    Other,
}

/// How an object stands to another, in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// Close to it.
    Near,
    /// As far from it as there is.
    FarFrom,
    /// Left of it.
    LeftOf,
    /// Right of it.
    RightOf,
    /// Farther away, in about the same direction.
    Behind,
    /// Nearer, in about the same direction.
    InFrontOf,
    /// Between two.
    Between,
    /// Lower in the image and close.
    Under,
    /// On, in or above it.
    On,
    /// Higher than it.
    TallerThan,
    /// Lower than it.
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
    /// High.
    Tall,
    /// Not high.
    Short,
    /// Large.
    Large,
    /// Small.
    Small,
    /// Near.
    Nearest,
    /// Far.
    Farthest,
    /// The leftmost.
    Leftmost,
    /// The rightmost.
    Rightmost,
    /// In the middle of the others.
    Middle,
}
