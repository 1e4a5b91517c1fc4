//! The table of models: data that ships with the program (`models.toml`) and that users extend.

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

/// A model with everything that is needed to ask it.
#[derive(Clone, Debug)]
pub struct Model {
    /// Its id at the vendor.
    pub id: String,
    /// The vendor's row.
    pub vendor: VendorRow,
    /// Form of its requests.
    pub wire: WireKind,
    /// Which coordinate comes first.
    pub order: AxisOrder,
    /// What the numbers count.
    pub scale: ScaleWord,
    /// At which size images are sent.
    pub image: ImageRule,
    /// The vendor's word for how finely an image is looked at.
    pub detail: Option<String>,
    /// In which dialect the schema is told.
    pub schema: SchemaDialect,
    /// Whether the answer is streamed.
    pub stream: bool,
    /// Most tokens of an answer, thinking included.
    pub max_output_tokens: u32,
    /// Merged into every request's body.
    pub request: Value,
    /// Prices, the first that is still in force counts.
    pub price: Vec<Price>,
    /// Its row, when it has one.
    pub row: Option<ModelRow>,
    /// The family, when it was only guessed from the id.
    pub assumed: bool,
}

impl Table {
    /// The table that ships with the program.
    ///
    /// # Panics
    /// Never: a test reads it.
    #[must_use]
    pub fn shipped() -> Self {
        Self::from_toml(SHIPPED).expect("the shipped table is part of the program")
    }

    /// Reads a table of its own.
    ///
    /// # Errors
    /// [`TableError`] with what is wrong and where.
    pub fn from_toml(text: &str) -> Result<Self, TableError> {
        let file: rows::File = rows::read(text)?;
        let table =
            Self { as_of: file.as_of.unwrap_or_default(), vendors: file.vendor, families: file.family, models: file.model };
        table.check()?;
        Ok(table)
    }

    /// The table with the rows of `text` added; a row of the same name (models: of the same vendor) replaces the older one.
    ///
    /// # Errors
    /// [`TableError`] with what is wrong and where.
    pub fn extended(mut self, text: &str) -> Result<Self, TableError> {
        let file: rows::File = rows::read(text)?;
        for row in file.vendor {
            self.vendors.retain(|old| old.name != row.name);
            self.vendors.push(row);
        }
        for row in file.family {
            self.families.retain(|old| old.name != row.name);
            // Before the shipped ones, so that its pieces of names are tried first.
            self.families.insert(0, row);
        }
        for row in file.model {
            self.models.retain(|old| (&old.id, &old.vendor) != (&row.id, &row.vendor));
            self.models.push(row);
        }
        self.check()?;
        Ok(self)
    }

    /// The day that the shipped rows are true of.
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

    /// Everything about the model of a row, whether it can still be had or not.
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

    /// Every name that a row uses stands for a row, and no row asks for what its model refuses.
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

    /// Everything about one model at one vendor; a model without a row is taken for one of the family that its id tells of.
    pub(crate) fn model(&self, vendor: &VendorRow, id: &str) -> Model {
        let row = self.models.iter().find(|row| row.vendor == vendor.name && row.id == id);
        let lower = id.to_lowercase();
        let told = row.and_then(|row| row.family.as_deref()).and_then(|name| self.family(name));
        let matched = self.families.iter().find(|family| family.pieces.iter().any(|piece| lower.contains(piece.as_str())));
        let family = told.or(matched).or_else(|| self.family(&vendor.family));
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
    /// The coordinates it is asked for in an image of this size *as sent*.
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

    /// The temperature that its row or its vendor's asks for; none where that is left to the vendor.
    #[must_use]
    pub fn temperature(&self) -> Option<f64> {
        rows::temperature(&self.request)
    }

    /// The price in force on a day, `YYYY-MM-DD`.
    #[must_use]
    pub fn price_on(&self, day: &str) -> Option<&Price> {
        self.price.iter().find(|price| price.until.as_deref().is_none_or(|until| until >= day))
    }
}

/// Puts the values of `over` into `base`, tables into tables.
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
