//! The rows of the table, as in the file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use spf_core::grounding::{AxisOrder, Habit};

use crate::image::ImageRule;
use crate::usage::Tokens;

/// Maximum size of a file, bytes.
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
    pub(super) series: Vec<SeriesRow>,
    #[serde(default)]
    pub(super) model: Vec<ModelRow>,
}

/// A vendor.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VendorRow {
    /// Its name on the command line.
    pub name: String,
    /// Its display name.
    pub title: String,
    /// Request format.
    pub wire: WireKind,
    /// Base URL, including the version, without trailing slash.
    pub base_url: String,
    /// Variable that overrides the base URL.
    pub base_url_env: Option<String>,
    /// How the key is sent.
    pub auth: Auth,
    /// Additional headers.
    #[serde(default)]
    pub headers: BTreeMap<String, String>,
    /// Variables that can hold the key; the first one set is used.
    #[serde(default)]
    pub keys: Vec<String>,
    /// Whether a key is required.
    #[serde(default = "yes")]
    pub key_needed: bool,
    /// Web page for obtaining a key.
    pub key_page: Option<String>,
    /// The default model.
    pub default: Option<String>,
    /// The family of models whose id matches none.
    pub family: String,
    /// How a reply schema is sent.
    #[serde(default)]
    pub schema: SchemaDialect,
    /// Whether replies are streamed.
    #[serde(default = "yes")]
    pub stream: bool,
    /// Merged into the body of every request.
    #[serde(default = "nothing")]
    pub request: Value,
    /// Whether it reports the cost of a reply at its end.
    #[serde(default)]
    pub reports_cost: bool,
    /// Merged into the body of requests to models whose row has `parameters`.
    #[serde(default = "nothing")]
    pub request_with_parameters: Value,
}

/// Request formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WireKind {
    /// Gemini's `generateContent`.
    Gemini,
    /// OpenAI's chat completions, supported by many servers.
    OpenaiChat,
    /// OpenAI's responses API.
    OpenaiResponses,
    /// Anthropic's messages API.
    Anthropic,
}

/// How a reply schema is sent to a vendor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SchemaDialect {
    /// As JSON schema.
    #[default]
    JsonSchema,
    /// In OpenAPI form: upper-case types, `nullable`, enumerations of strings only (Gemini's older `responseSchema`).
    OpenApi,
    /// Only as a request for a JSON object; the prompt describes it.
    JsonObject,
    /// Not at all.
    None,
}

/// How the key is sent.
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

/// Models with the same coordinate convention.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FamilyRow {
    /// Its name, used in other rows.
    pub name: String,
    /// Lower-case substrings of the ids that belong to it.
    #[serde(rename = "match")]
    pub pieces: Vec<String>,
    /// Order of its coordinates.
    pub order: AxisOrder,
    /// Unit of its coordinates.
    pub scale: ScaleWord,
    /// The form in which it points, whatever it is asked for; such points may come without a depth.
    #[serde(default)]
    pub habit: Habit,
    /// Whether it lists obstacles with boxes when it is asked to; if not, obstacle mode is off unless it is turned on.
    #[serde(default = "yes")]
    pub lists_boxes: bool,
    /// The vendor's image detail setting.
    pub detail: Option<String>,
    /// Limits on image sizes.
    pub image: Option<ImageRule>,
}

/// Models of one vendor that are queried in the same way.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeriesRow {
    /// Name of the vendor.
    pub vendor: String,
    /// Lower-case substrings of the ids that belong to it.
    #[serde(rename = "match")]
    pub pieces: Vec<String>,
    /// Whether they may think before they reply, although `request` asks for as little as possible.
    #[serde(default = "yes")]
    pub thinks: bool,
    /// Whether sampling parameters such as temperature may be sent.
    #[serde(default)]
    pub sampling: bool,
    /// The vendor's image detail setting, if different from the family.
    pub detail: Option<String>,
    /// Limits on image sizes, if different from the family.
    pub image: Option<ImageRule>,
    /// Maximum number of tokens in a reply, including reasoning.
    pub max_output_tokens: Option<u32>,
    /// Timeouts of a request, if different from the default.
    pub timeouts: Option<Timeouts>,
    /// Merged into the body of every request.
    #[serde(default = "nothing")]
    pub request: Value,
}

/// Timeouts of one request, seconds.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timeouts {
    /// For the connection.
    pub connect_s: f64,
    /// From the start to the first byte of the reply.
    pub first_byte_s: f64,
    /// For the whole reply.
    pub whole_s: f64,
}

impl Timeouts {
    /// Of a vendor's service whose model does not think.
    pub const QUICK: Self = Self { connect_s: 2.0, first_byte_s: 8.0, whole_s: 12.0 };
    /// Of a model that thinks, is not known, or runs on a machine of one's own.
    pub const PATIENT: Self = Self { connect_s: 5.0, first_byte_s: 20.0, whole_s: 30.0 };

    fn is_valid(&self) -> bool {
        [self.connect_s, self.first_byte_s, self.whole_s].iter().all(|seconds| (0.001..=86_400.0).contains(seconds))
    }
}

/// Unit of coordinates, as in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScaleWord {
    /// Thousandths of the image size.
    Thousand,
    /// Percent of the image size.
    Hundred,
    /// Fractions of the image size.
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
    /// Name of the vendor.
    pub vendor: String,
    /// Its family, if not inferred from the id.
    pub family: Option<String>,
    /// Availability.
    pub status: Status,
    /// Whether it is one of the six models in the paper (table 4).
    #[serde(default)]
    pub paper: bool,
    /// A note for users.
    pub note: Option<String>,
    /// Retirement date, `YYYY-MM-DD`.
    pub retires: Option<String>,
    /// The model to use instead.
    pub successor: Option<String>,
    /// Whether sampling parameters such as temperature may be sent.
    #[serde(default)]
    pub sampling: bool,
    /// Whether it may think before it replies, if different from its series.
    pub thinks: Option<bool>,
    /// Maximum number of tokens in a reply, including reasoning.
    pub max_output_tokens: Option<u32>,
    /// The vendor's image detail setting, if different from its series or family.
    pub detail: Option<String>,
    /// Limits on image sizes, if different from its series or family.
    pub image: Option<ImageRule>,
    /// Timeouts of a request, if different from its series.
    pub timeouts: Option<Timeouts>,
    /// Optional parameters that the model supports according to its vendor; with them, the vendor is told to route only to
    /// servers that support all parameters sent.
    pub parameters: Option<Vec<String>>,
    /// Distance in metres that each of its depth labels means, if it does not use them as described; `spf vlm trial`
    /// measures them.
    pub depth_m: Option<Vec<f64>>,
    /// How a reply schema is sent, if different from the vendor.
    pub schema: Option<SchemaDialect>,
    /// Whether replies are streamed, if different from the vendor.
    pub stream: Option<bool>,
    /// Merged into the body of every request.
    #[serde(default = "nothing")]
    pub request: Value,
    /// Prices; the first one still in force applies.
    #[serde(default)]
    pub price: Vec<Price>,
}

/// Availability of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Available.
    Current,
    /// Available, but may change or be removed at any time.
    Preview,
    /// Still available, but retired soon.
    Deprecated,
    /// No longer available.
    Retired,
}

impl Status {
    /// The word used in files.
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

/// Prices in US dollars per million tokens.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Price {
    /// Input tokens.
    pub input: f64,
    /// Cached input tokens; the input price if not given.
    pub cached: Option<f64>,
    /// Output tokens, including reasoning.
    pub output: f64,
    /// Date at which the price was checked.
    pub as_of: String,
    /// Last day of validity.
    pub until: Option<String>,
}

impl Price {
    /// Cost of these tokens, US dollars.
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

/// Prices of input and output tokens, US dollars per million, as a user gives them: `IN,OUT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerMillion {
    /// Input tokens.
    pub input: f64,
    /// Output tokens, including reasoning.
    pub output: f64,
}

impl std::str::FromStr for PerMillion {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (input, output) = text.split_once(',').ok_or(())?;
        let price = |text: &str| text.trim().parse::<f64>().ok().filter(|price| (0.0..=1e6).contains(price)).ok_or(());
        Ok(Self { input: price(input)?, output: price(output)? })
    }
}

impl From<PerMillion> for Price {
    fn from(PerMillion { input, output }: PerMillion) -> Self {
        Self { input, cached: None, output, as_of: String::new(), until: None }
    }
}

/// Why a table is invalid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// Invalid TOML, an unknown key, or a value of the wrong type.
    #[error("invalid table of models: {0}")]
    Toml(String),
    /// A reference to a row that does not exist.
    #[error("{row} `{name}` refers to an unknown {what} `{other}`")]
    Unknown {
        /// Kind of the row.
        row: &'static str,
        /// Its name.
        name: String,
        /// Kind of the missing row.
        what: &'static str,
        /// Its name.
        other: String,
    },
    /// A request that the vendor would reject.
    #[error("`{model}` does not accept `{key}` in `request`, says the table of models; set `sampling = true` if it does")]
    Sampling {
        /// The model.
        model: String,
        /// The key.
        key: &'static str,
    },
    /// Timeouts that are no times.
    #[error("invalid `timeouts` of `{name}`: each must be from 0.001 to 86400 seconds")]
    Timeouts {
        /// The row.
        name: String,
    },
    /// Distances that no labels can mean.
    #[error(
        "invalid `depth_m` of `{model}`: give the distance of each label from 1 to 10 in metres, none less than the one before"
    )]
    Depth {
        /// The model.
        model: String,
    },
    /// A retired model without a successor.
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
        return Err(TableError::Toml(format!("exceeds {LONGEST} bytes")));
    }
    toml::from_str(text).map_err(|error| TableError::Toml(error.to_string().trim().to_owned()))
}

/// Whether these can be the distances of depth labels.
pub(super) fn are_distances(metres: &[f64]) -> bool {
    let labels = usize::from(spf_core::reply::DEPTH_LABELS);
    metres.len() == labels && metres.is_sorted() && metres.iter().all(|metres| (0.001..=1e5).contains(metres))
}

/// Checks the timeouts of the row `name`.
pub(super) fn check_timeouts(name: &str, timeouts: Option<&Timeouts>) -> Result<(), TableError> {
    match timeouts.filter(|timeouts| !timeouts.is_valid()) {
        Some(_) => Err(TableError::Timeouts { name: name.to_owned() }),
        None => Ok(()),
    }
}

/// The name of a sampling parameter in a request, if any.
pub(super) fn sampling(request: &Value) -> Option<&'static str> {
    const KEYS: [&str; 6] = ["temperature", "top_p", "top_k", "topP", "topK", "logprobs"];
    let map = request.as_object()?;
    KEYS.into_iter().find(|key| map.contains_key(*key)).or_else(|| map.values().find_map(sampling))
}

/// The temperature in a request, if any.
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
