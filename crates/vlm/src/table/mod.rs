//! The table of models: a built-in file (`models.toml`) that users can extend.

mod rows;
mod select;

use serde_json::Value;
use spf_core::grounding::{AxisOrder, GroundingProfile, Habit, Scale};
use spf_core::reply::DEPTH_LABELS;

pub use rows::{
    Auth, FamilyRow, ModelRow, PerMillion, Price, ScaleWord, SchemaDialect, SeriesRow, Status, TableError, Timeouts, VendorRow,
    WireKind,
};
pub use select::{Choice, SelectError};

use crate::image::ImageRule;

const SHIPPED: &str = include_str!("../../models.toml");

/// Tokens of a reply of a model that does not think, and of one that may.
const FEW_TOKENS: u32 = 1024;
const MANY_TOKENS: u32 = 4096;
/// Days before its end in which a model is announced to end.
const ENDS_SOON: i64 = 30;

/// Vendors, families, series and models.
#[derive(Clone, Debug)]
pub struct Table {
    as_of: String,
    vendors: Vec<VendorRow>,
    families: Vec<FamilyRow>,
    series: Vec<SeriesRow>,
    models: Vec<ModelRow>,
}

/// A model with everything needed to query it.
#[derive(Clone, Debug)]
pub struct Model {
    /// Its id at the vendor.
    pub id: String,
    /// The vendor's row.
    pub vendor: VendorRow,
    /// Request format.
    pub wire: WireKind,
    /// Order of its coordinates.
    pub order: AxisOrder,
    /// Unit of its coordinates.
    pub scale: ScaleWord,
    /// Its own form of points.
    pub habit: Habit,
    /// Whether it lists obstacles with boxes when it is asked to.
    pub lists_boxes: bool,
    /// Limits on image sizes.
    pub image: ImageRule,
    /// The vendor's image detail setting.
    pub detail: Option<String>,
    /// How a reply schema is sent.
    pub schema: SchemaDialect,
    /// Whether replies are streamed.
    pub stream: bool,
    /// Whether it may think before it replies; true for models of which nothing is known.
    pub thinks: bool,
    /// Maximum number of tokens in a reply, including reasoning.
    pub max_output_tokens: u32,
    /// Timeouts of a request.
    pub timeouts: Timeouts,
    /// Optional parameters that it supports; `None` if not known.
    pub parameters: Option<Vec<String>>,
    /// Distance in metres of each depth label, if it does not use them as described.
    pub depth_m: Option<Vec<f64>>,
    /// Merged into the body of every request.
    pub request: Value,
    /// Prices; the first one still in force applies.
    pub price: Vec<Price>,
    /// Its row in the table, if any.
    pub row: Option<ModelRow>,
    /// Whether the family was inferred from the id.
    pub assumed: bool,
}

impl Table {
    /// The built-in table.
    ///
    /// # Panics
    /// Never: a test parses it.
    #[must_use]
    pub fn shipped() -> Self {
        Self::from_toml(SHIPPED).expect("the embedded table is valid")
    }

    /// Parses a complete table.
    ///
    /// # Errors
    /// [`TableError`] with the problem and its position.
    pub fn from_toml(text: &str) -> Result<Self, TableError> {
        let file: rows::File = rows::read(text)?;
        let (as_of, vendors) = (file.as_of.unwrap_or_default(), file.vendor);
        let table = Self { as_of, vendors, families: file.family, series: file.series, models: file.model };
        table.check()?;
        Ok(table)
    }

    /// Adds the rows of `text`; a row with the same name (for models: and vendor) replaces the earlier one.
    ///
    /// # Errors
    /// [`TableError`] with the problem and its position.
    pub fn extended(mut self, text: &str) -> Result<Self, TableError> {
        let file: rows::File = rows::read(text)?;
        for row in file.vendor {
            self.vendors.retain(|old| old.name != row.name);
            self.vendors.push(row);
        }
        for row in file.family {
            self.families.retain(|old| old.name != row.name);
            // Before the built-in ones, so that its id patterns are tried first.
            self.families.insert(0, row);
        }
        self.series.splice(0..0, file.series);
        for row in file.model {
            self.models.retain(|old| (&old.id, &old.vendor) != (&row.id, &row.vendor));
            self.models.push(row);
        }
        self.check()?;
        Ok(self)
    }

    /// The date at which the built-in rows were checked.
    #[must_use]
    pub fn as_of(&self) -> &str {
        &self.as_of
    }

    /// All vendors.
    #[must_use]
    pub fn vendors(&self) -> &[VendorRow] {
        &self.vendors
    }

    /// All models, in the order of the table.
    #[must_use]
    pub fn models(&self) -> &[ModelRow] {
        &self.models
    }

    /// The model of a row, whether or not it is still available.
    #[must_use]
    pub fn row_model(&self, row: &ModelRow) -> Option<Model> {
        Some(self.model(self.vendor(&row.vendor)?, &row.id))
    }

    pub(crate) fn vendor(&self, name: &str) -> Option<&VendorRow> {
        self.vendors.iter().find(|row| row.name == name)
    }

    fn family(&self, name: &str) -> Option<&FamilyRow> {
        self.families.iter().find(|row| row.name == name)
    }

    /// Checks that every reference between rows is valid, and that no row requests settings its model rejects.
    fn check(&self) -> Result<(), TableError> {
        for vendor in &self.vendors {
            if self.family(&vendor.family).is_none() {
                return Err(TableError::unknown("vendor", &vendor.name, "family", &vendor.family));
            }
        }
        for series in &self.series {
            let name = series.pieces.join(", ");
            let Some(vendor) = self.vendor(&series.vendor) else {
                return Err(TableError::unknown("series", &name, "vendor", &series.vendor));
            };
            rows::check_timeouts(&name, series.timeouts.as_ref())?;
            let key = rows::sampling(&series.request).or_else(|| rows::sampling(&vendor.request));
            if let Some(key) = key.filter(|_| !series.sampling) {
                return Err(TableError::Sampling { model: name, key });
            }
        }
        for model in &self.models {
            let Some(vendor) = self.vendor(&model.vendor) else {
                return Err(TableError::unknown("model", &model.id, "vendor", &model.vendor));
            };
            if let Some(family) = model.family.as_deref().filter(|family| self.family(family).is_none()) {
                return Err(TableError::unknown("model", &model.id, "family", family));
            }
            let series = self.series_of(vendor, &model.id);
            let sampling = model.sampling || series.is_some_and(|series| series.sampling);
            if let Some(key) = rows::sampling(&model.request).or_else(|| rows::sampling(&vendor.request)).filter(|_| !sampling) {
                return Err(TableError::Sampling { model: model.id.clone(), key });
            }
            rows::check_timeouts(&model.id, model.timeouts.as_ref())?;
            if model.depth_m.as_ref().is_some_and(|metres| !rows::are_distances(metres)) {
                return Err(TableError::Depth { model: model.id.clone() });
            }
            if model.status == Status::Retired && model.successor.is_none() {
                return Err(TableError::NoSuccessor { model: model.id.clone() });
            }
        }
        Ok(())
    }

    /// The first series of a vendor to which an id belongs.
    fn series_of(&self, vendor: &VendorRow, id: &str) -> Option<&SeriesRow> {
        let lower = id.to_lowercase();
        let belongs = |series: &&SeriesRow| {
            series.vendor == vendor.name && series.pieces.iter().any(|piece| lower.contains(piece.as_str()))
        };
        self.series.iter().find(belongs)
    }

    /// The model with this id at a vendor; without a row, its family is inferred from the id.
    pub(crate) fn model(&self, vendor: &VendorRow, id: &str) -> Model {
        let row = self.models.iter().find(|row| row.vendor == vendor.name && row.id == id);
        let lower = id.to_lowercase();
        let stated = row.and_then(|row| row.family.as_deref()).and_then(|name| self.family(name));
        let matched = self.families.iter().find(|family| family.pieces.iter().any(|piece| lower.contains(piece.as_str())));
        let family = stated.or(matched).or_else(|| self.family(&vendor.family));
        let series = self.series_of(vendor, id);
        let image = row.and_then(|row| row.image).or_else(|| series.and_then(|series| series.image));
        let image = image.or_else(|| family.and_then(|family| family.image)).unwrap_or_default();
        let detail = row.and_then(|row| row.detail.clone()).or_else(|| series.and_then(|series| series.detail.clone()));
        let mut request = vendor.request.clone();
        if let Some(series) = series {
            merge(&mut request, &series.request);
        }
        if let Some(row) = row {
            merge(&mut request, &row.request);
        }
        let parameters = row.and_then(|row| row.parameters.clone());
        if parameters.is_some() {
            merge(&mut request, &vendor.request_with_parameters);
        }
        let thinks = row.and_then(|row| row.thinks).or_else(|| series.map(|series| series.thinks)).unwrap_or(true);
        let tokens = row.and_then(|row| row.max_output_tokens).or_else(|| series.and_then(|series| series.max_output_tokens));
        let timeouts = row.and_then(|row| row.timeouts).or_else(|| series.and_then(|series| series.timeouts));
        let quick = vendor.key_needed && !thinks;
        Model {
            id: id.to_owned(),
            vendor: vendor.clone(),
            wire: vendor.wire,
            order: family.map(|family| family.order).unwrap_or_default(),
            scale: family.map_or(ScaleWord::Thousand, |family| family.scale),
            habit: family.map(|family| family.habit).unwrap_or_default(),
            lists_boxes: family.is_none_or(|family| family.lists_boxes),
            image,
            detail: detail.or_else(|| family.and_then(|family| family.detail.clone())),
            schema: row.and_then(|row| row.schema).unwrap_or(vendor.schema),
            stream: row.and_then(|row| row.stream).unwrap_or(vendor.stream),
            thinks,
            max_output_tokens: tokens.unwrap_or(if thinks { MANY_TOKENS } else { FEW_TOKENS }),
            timeouts: timeouts.unwrap_or(if quick { Timeouts::QUICK } else { Timeouts::PATIENT }),
            parameters,
            depth_m: row.and_then(|row| row.depth_m.clone()),
            request,
            price: row.map(|row| row.price.clone()).unwrap_or_default(),
            row: row.cloned(),
            assumed: row.is_none(),
        }
    }
}

impl Model {
    /// Its coordinate convention for an image of this size *as sent*.
    #[must_use]
    pub fn grounding(&self, (width, height): (u32, u32)) -> GroundingProfile {
        let scale = match self.scale {
            ScaleWord::Thousand => Scale::Thousand,
            ScaleWord::Hundred => Scale::Hundred,
            ScaleWord::Unit => Scale::Unit,
            ScaleWord::Pixels => Scale::Pixels { width, height },
        };
        GroundingProfile { order: self.order, scale, habit: self.habit }
    }

    /// The label, as prompts describe them (1 + 4.5 · log10 of the distance in metres), of what this model means by
    /// `label`.
    #[must_use]
    pub fn prompt_label(&self, label: u8) -> u8 {
        let metres = self.depth_m.as_ref().and_then(|metres| metres.get(usize::from(label).checked_sub(1)?));
        metres.map_or(label, |metres| (1.0 + 4.5 * metres.log10()).round().clamp(1.0, f64::from(DEPTH_LABELS)) as u8)
    }

    /// The temperature set by its row or its vendor; `None` for the vendor's default.
    #[must_use]
    pub fn temperature(&self) -> Option<f64> {
        rows::temperature(&self.request)
    }

    /// The date at which it ends, its successor and the days left, if it ends within 30 days of `today` (`YYYY-MM-DD`).
    #[must_use]
    pub fn ends_soon(&self, today: &str) -> Option<(&str, Option<&str>, i64)> {
        let row = self.row.as_ref()?;
        let day = row.retires.as_deref()?;
        let left = crate::day::between(today, day)?;
        (1..=ENDS_SOON).contains(&left).then_some((day, row.successor.as_deref(), left))
    }

    /// The model without sampling (temperature 0), if its row says that it takes such a parameter.
    #[must_use]
    pub fn greedy(mut self) -> Self {
        if self.row.as_ref().is_some_and(|row| row.sampling) {
            let temperature = serde_json::json!({ "temperature": 0.0 });
            let over = match self.wire {
                WireKind::Gemini => serde_json::json!({ "generationConfig": temperature }),
                _ => temperature,
            };
            merge(&mut self.request, &over);
        }
        self
    }

    /// The price in force on a date, `YYYY-MM-DD`.
    #[must_use]
    pub fn price_on(&self, day: &str) -> Option<&Price> {
        self.price.iter().find(|price| price.until.as_deref().is_none_or(|until| until >= day))
    }
}

/// Merges `over` into `base`, recursively.
pub(crate) fn merge(base: &mut Value, over: &Value) {
    match (base, over) {
        (Value::Object(base), Value::Object(over)) => {
            for (key, value) in over {
                merge(base.entry(key.clone()).or_insert(Value::Null), value);
            }
        }
        (_, Value::Null) => {}
        (base, over) => *base = over.clone(),
    }
}

#[cfg(test)]
mod tests;
