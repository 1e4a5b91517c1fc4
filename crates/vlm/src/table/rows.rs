//! The rows as they stand in a file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use spf_core::grounding::AxisOrder;

use crate::account::Tokens;
use crate::image::ImageRule;

/// Longest file that is read, bytes.
const LONGEST: usize = 1 << 20;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) as_of: Option<String>,
    #[serde(default)]
    pub(super) vendor: Vec<VendorRow>,
    #[serde(default)]
    pub(super) family: Vec<FamilyRow>,
    #[serde(default)]
    pub(super) model: Vec<ModelRow>,
}

/// Who serves models.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VendorRow {
    /// Its name on the command line.
    pub name: String,
    /// Its name for people.
    pub title: String,
    /// Form of its requests.
    pub wire: WireKind,
    /// Where it is, version included, without a slash at the end.
    pub base_url: String,
    /// Variable that names another place.
    pub base_url_env: Option<String>,
    /// How the key is sent.
    pub auth: Auth,
    /// Further headers.
    #[serde(default)]
    pub headers: BTreeMap<String, String>,
    /// Variables that may hold the key; the first that is set counts.
    #[serde(default)]
    pub keys: Vec<String>,
    /// Whether it answers without a key.
    #[serde(default = "yes")]
    pub key_needed: bool,
    /// Where a person gets a key.
    pub key_page: Option<String>,
    /// The model when none is named.
    pub default: Option<String>,
    /// The family of models that tell of none.
    pub family: String,
    /// In which dialect a schema is told.
    #[serde(default)]
    pub schema: SchemaDialect,
    /// Whether answers are streamed.
    #[serde(default = "yes")]
    pub stream: bool,
    /// Merged into every request's body.
    #[serde(default = "nothing")]
    pub request: Value,
}

/// The forms of requests there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WireKind {
    /// Gemini's `generateContent`.
    Gemini,
    /// OpenAI's chat completions, which many servers speak.
    OpenaiChat,
    /// OpenAI's responses.
    OpenaiResponses,
    /// Anthropic's messages.
    Anthropic,
}

/// How a schema is told to a vendor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SchemaDialect {
    /// As JSON schema.
    #[default]
    JsonSchema,
    /// As OpenAPI has it: types in capitals, `nullable`, enumerations of texts only (Gemini's older `responseSchema`).
    OpenApi,
    /// Only that an object is wanted; the prompt tells which.
    JsonObject,
    /// Not at all.
    None,
}

/// How a key is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Auth {
    /// `Authorization: Bearer KEY`.
    Bearer,
    /// `x-api-key: KEY`.
    XApiKey,
    /// `x-goog-api-key: KEY`.
    XGoogApiKey,
}

/// Models taught to point in the same way.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FamilyRow {
    /// Its name in other rows.
    pub name: String,
    /// Pieces of ids, in lower case, that belong to it.
    #[serde(rename = "match")]
    pub pieces: Vec<String>,
    /// Which coordinate comes first.
    pub order: AxisOrder,
    /// What the numbers count.
    pub scale: ScaleWord,
    /// The vendor's word for how finely an image is looked at.
    pub detail: Option<String>,
    /// At which size images are sent.
    pub image: Option<ImageRule>,
}

/// What coordinates count, in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScaleWord {
    /// Thousandths of a side.
    Thousand,
    /// Percent of a side.
    Hundred,
    /// Fractions of a side.
    Unit,
    /// Pixels of the image as sent.
    Pixels,
}

/// One model.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelRow {
    /// Its id at the vendor.
    pub id: String,
    /// The vendor's name.
    pub vendor: String,
    /// Its family, when the id does not tell.
    pub family: Option<String>,
    /// Whether it can still be had.
    pub status: Status,
    /// Whether it is one of the paper's six (table 4).
    #[serde(default)]
    pub paper: bool,
    /// A word to people.
    pub note: Option<String>,
    /// The day it is switched off, `YYYY-MM-DD`.
    pub retires: Option<String>,
    /// The model to ask instead.
    pub successor: Option<String>,
    /// Whether temperature and the like may be sent.
    #[serde(default)]
    pub sampling: bool,
    /// Most tokens of an answer, thinking included.
    pub max_output_tokens: Option<u32>,
    /// At which size images are sent, when not as the family.
    pub image: Option<ImageRule>,
    /// In which dialect a schema is told, when not as the vendor.
    pub schema: Option<SchemaDialect>,
    /// Whether answers are streamed, when not as the vendor.
    pub stream: Option<bool>,
    /// Merged into every request's body.
    #[serde(default = "nothing")]
    pub request: Value,
    /// Prices; the first that is still in force counts.
    #[serde(default)]
    pub price: Vec<Price>,
}

/// Whether a model can still be had.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Yes.
    Current,
    /// Yes, and it may change or go at any time.
    Preview,
    /// For a while yet.
    Deprecated,
    /// No.
    Retired,
}

impl Status {
    /// The word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Current => "current",
            Self::Preview => "preview",
            Self::Deprecated => "deprecated",
            Self::Retired => "retired",
        }
    }
}

/// US dollars for a million tokens.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Price {
    /// Tokens read.
    pub input: f64,
    /// Tokens read from a cache; as other ones when not told.
    pub cached: Option<f64>,
    /// Tokens written, thinking included.
    pub output: f64,
    /// The day it was read.
    pub as_of: String,
    /// The last day it holds.
    pub until: Option<String>,
}

impl Price {
    /// What these tokens cost, US dollars.
    #[must_use]
    pub fn of(&self, tokens: &Tokens) -> f64 {
        let cached = tokens.cached.min(tokens.input);
        let fresh = tokens.input - cached;
        let millions = |count: u64, price: f64| count as f64 * price / 1e6;
        millions(fresh, self.input)
            + millions(cached, self.cached.unwrap_or(self.input))
            + millions(tokens.output + tokens.thinking, self.output)
    }
}

/// What is wrong with a table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// No TOML, or an unknown key, or a value of the wrong kind.
    #[error("the table of models is refused: {0}")]
    Toml(String),
    /// A row names a row that is not there.
    #[error("{row} `{name}` is of the {what} `{other}`, of which there is no row")]
    Unknown {
        /// Kind of the row.
        row: &'static str,
        /// Its name.
        name: String,
        /// Kind of the missing one.
        what: &'static str,
        /// Its name.
        other: String,
    },
    /// A request that the vendor would refuse.
    #[error("`{model}` takes no `{key}` in `request`, says its row; set `sampling = true` if it does")]
    Sampling {
        /// The model.
        model: String,
        /// The key.
        key: &'static str,
    },
    /// Nobody could be told what to ask instead.
    #[error("`{model}` is retired and has no `successor`")]
    NoSuccessor {
        /// The model.
        model: String,
    },
}

impl TableError {
    pub(super) fn unknown(row: &'static str, name: &str, what: &'static str, other: &str) -> Self {
        Self::Unknown { row, name: name.to_owned(), what, other: other.to_owned() }
    }
}

pub(super) fn read(text: &str) -> Result<File, TableError> {
    if text.len() > LONGEST {
        return Err(TableError::Toml(format!("more than {LONGEST} bytes")));
    }
    toml::from_str(text).map_err(|error| TableError::Toml(error.to_string().trim().to_owned()))
}

/// A parameter of sampling anywhere in a request.
pub(super) fn sampling(request: &Value) -> Option<&'static str> {
    const KEYS: [&str; 6] = ["temperature", "top_p", "top_k", "topP", "topK", "logprobs"];
    let map = request.as_object()?;
    KEYS.into_iter().find(|key| map.contains_key(*key)).or_else(|| map.values().find_map(sampling))
}

/// The temperature anywhere in a request.
pub(super) fn temperature(request: &Value) -> Option<f64> {
    let map = request.as_object()?;
    map.get("temperature").and_then(Value::as_f64).or_else(|| map.values().find_map(temperature))
}

fn yes() -> bool {
    true
}

fn nothing() -> Value {
    Value::Object(serde_json::Map::new())
}
