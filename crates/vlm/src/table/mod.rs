//! The table of models: a built-in file (`models.toml`) that users can extend.

mod rows;
mod select;

use serde_json::Value;
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};

pub use rows::{Auth, FamilyRow, ModelRow, Price, ScaleWord, SchemaDialect, Status, TableError, VendorRow, WireKind};
pub use select::{Choice, SelectError};

use crate::image::ImageRule;

const SHIPPED: &str = include_str!("../../models.toml");

/// Vendors, families and models.
#[derive(Clone, Debug)]
pub struct Table {
    as_of: String,
    vendors: Vec<VendorRow>,
    families: Vec<FamilyRow>,
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
    /// Limits on image sizes.
    pub image: ImageRule,
    /// The vendor's image detail setting.
    pub detail: Option<String>,
    /// How a reply schema is sent.
    pub schema: SchemaDialect,
    /// Whether replies are streamed.
    pub stream: bool,
    /// Maximum number of tokens in a reply, including reasoning.
    pub max_output_tokens: u32,
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
        let table =
            Self { as_of: file.as_of.unwrap_or_default(), vendors: file.vendor, families: file.family, models: file.model };
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
        for model in &self.models {
            let Some(vendor) = self.vendor(&model.vendor) else {
                return Err(TableError::unknown("model", &model.id, "vendor", &model.vendor));
            };
            if let Some(family) = model.family.as_deref().filter(|family| self.family(family).is_none()) {
                return Err(TableError::unknown("model", &model.id, "family", family));
            }
            if let Some(key) =
                rows::sampling(&model.request).or_else(|| rows::sampling(&vendor.request)).filter(|_| !model.sampling)
            {
                return Err(TableError::Sampling { model: model.id.clone(), key });
            }
            if model.status == Status::Retired && model.successor.is_none() {
                return Err(TableError::NoSuccessor { model: model.id.clone() });
            }
        }
        Ok(())
    }

    /// The model with this id at a vendor; without a row, its family is inferred from the id.
    pub(crate) fn model(&self, vendor: &VendorRow, id: &str) -> Model {
        let row = self.models.iter().find(|row| row.vendor == vendor.name && row.id == id);
        let lower = id.to_lowercase();
        let stated = row.and_then(|row| row.family.as_deref()).and_then(|name| self.family(name));
        let matched = self.families.iter().find(|family| family.pieces.iter().any(|piece| lower.contains(piece.as_str())));
        let family = stated.or(matched).or_else(|| self.family(&vendor.family));
        let image = row.and_then(|row| row.image).or_else(|| family.and_then(|family| family.image)).unwrap_or_default();
        let mut request = vendor.request.clone();
        if let Some(row) = row {
            merge(&mut request, &row.request);
        }
        Model {
            id: id.to_owned(),
            vendor: vendor.clone(),
            wire: vendor.wire,
            order: family.map(|family| family.order).unwrap_or_default(),
            scale: family.map_or(ScaleWord::Thousand, |family| family.scale),
            image,
            detail: family.and_then(|family| family.detail.clone()),
            schema: row.and_then(|row| row.schema).unwrap_or(vendor.schema),
            stream: row.and_then(|row| row.stream).unwrap_or(vendor.stream),
            max_output_tokens: row.and_then(|row| row.max_output_tokens).unwrap_or(1024),
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
        GroundingProfile { order: self.order, scale }
    }

    /// The temperature set by its row or its vendor; `None` for the vendor's default.
    #[must_use]
    pub fn temperature(&self) -> Option<f64> {
        rows::temperature(&self.request)
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
