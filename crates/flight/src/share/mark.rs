//! What a log made to be shared tells of itself.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The mark of a log made to be shared, in the flight's head. Where a text is left out, it has
/// [`LEFT_OUT`] in its place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SharedMark {
    /// Version of the program that made it.
    pub by: String,
    /// How far the flight's own log could be read.
    pub source: SourceEnd,
    /// What was left out.
    pub left_out: BTreeSet<LeftOut>,
}

/// Stands in a shared log where a text was left out.
pub const LEFT_OUT: &str = "[left out]";

/// How the log ended of which a shared one was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SourceEnd {
    /// It was whole.
    #[default]
    Whole,
    /// It was truncated: the last messages before its end may lack their consequences.
    Truncated,
}

/// Whether camera images are shared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pictures {
    /// They are left out.
    #[default]
    LeftOut,
    /// They are kept, encoded again: nothing but their pixels is shared.
    Kept,
}

/// A kind of content that was left out of a shared log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LeftOut {
    /// When the flight began, by the wall clock.
    Clock,
    /// Camera images.
    Pictures,
    /// Captions and lines on the images, outlines of the scene, cells of the obstacle map, and the lines of text for viewers.
    ForViewers,
    /// The texts sent to the VLM: they are made of the prompt, the instruction and the flight, and are not logged twice.
    SentTexts,
    /// A prompt of the user's own.
    OwnPrompt,
    /// The address or the model of a VLM that is not in the built-in table.
    VlmName,
    /// The name of a network of the user's own (a detector, or one for depth).
    NetworkName,
    /// The name of a scene of the user's own, and the names of its objects.
    OwnScene,
    /// What a server, a proxy or a program said when a query failed, but its kind.
    FailureTexts,
    /// Parts of the instruction or of an answer that looked like a key, an address, a path, a serial number, a name or a place.
    PartsOfTexts,
    /// Settings whose value is not one of the program's own words.
    OtherSettings,
    /// Topics, fields and messages that this version does not know.
    Unknown,
}

impl LeftOut {
    /// In words, for a list.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Clock => "date and time of the flight",
            Self::Pictures => "camera images",
            Self::ForViewers => "what only viewers show: captions, outlines, map cells, lines of text",
            Self::SentTexts => "the texts sent to the model",
            Self::OwnPrompt => "your own prompt",
            Self::VlmName => "address or name of your own model",
            Self::NetworkName => "name of your own network (detector, depth)",
            Self::OwnScene => "names of your own scene and of its objects",
            Self::FailureTexts => "what servers or programs said when a query failed (its kind is kept)",
            Self::PartsOfTexts => "parts of texts that looked like a key, address, path, serial number, name or place",
            Self::OtherSettings => "settings that are not words of this program",
            Self::Unknown => "topics, fields and messages that this version does not know",
        }
    }
}
