//! Selects a model by `NAME[#MODEL][@URL]`.

use super::{Model, Status, Table};

/// A selected model.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The name as given, for records.
    pub name: String,
    /// The model.
    pub model: Model,
    /// Its address, if different from the table's.
    pub url: Option<String>,
}

/// Why a name selects no model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SelectError {
    /// Unknown vendor.
    #[error("unknown VLM `{name}`")]
    Unknown {
        /// The name.
        name: String,
        /// Known names.
        known: Vec<String>,
    },
    /// The vendor has no default model.
    #[error("`{vendor}` serves several models; a model name is required")]
    NoModel {
        /// The vendor.
        vendor: String,
    },
    /// The model was retired.
    #[error("`{model}` was retired by {vendor} on {day}; its successor is `{successor}`")]
    Retired {
        /// The model.
        model: String,
        /// The vendor's title.
        vendor: String,
        /// Retirement date.
        day: String,
        /// The model to use instead.
        successor: String,
    },
    /// Invalid address.
    #[error("invalid server URL `{0}`: it must begin with http:// or https://")]
    Url(String),
}

impl Table {
    /// Selects the model `NAME[#MODEL][@URL]` or `URL[#MODEL]`, on a date `YYYY-MM-DD`.
    ///
    /// # Errors
    /// [`SelectError`] if there is none, or it was retired.
    pub fn select(&self, name: &str, today: &str) -> Result<Choice, SelectError> {
        let (vendor, id, url) = parts(name)?;
        let vendor_row = self.vendor(vendor).ok_or_else(|| SelectError::Unknown {
            name: vendor.to_owned(),
            known: self.vendors.iter().map(|row| row.name.clone()).filter(|name| name != COMPATIBLE).collect(),
        })?;
        if vendor_row.base_url.is_empty() && url.is_none() {
            return Err(SelectError::Url(String::new()));
        }
        let id = id
            .map(str::to_owned)
            .or_else(|| vendor_row.default.clone())
            .ok_or_else(|| SelectError::NoModel { vendor: vendor.to_owned() })?;
        let model = self.model(vendor_row, &id);
        if let Some(row) = &model.row {
            let day = row.retires.as_deref().unwrap_or_default();
            let gone = row.status == Status::Retired || (!day.is_empty() && day <= today);
            // At another address it may still be available.
            if let Some(successor) = row.successor.clone().filter(|_| gone && url.is_none()) {
                let vendor = vendor_row.title.clone();
                return Err(SelectError::Retired { model: id, vendor, day: day.to_owned(), successor });
            }
        }
        Ok(Choice { name: name.to_owned(), model, url: url.map(|url| url.trim_end_matches('/').to_owned()) })
    }
}

/// The vendor for any server with OpenAI's chat API.
const COMPATIBLE: &str = "compatible";

/// Splits a name into vendor, model and address.
fn parts(name: &str) -> Result<(&str, Option<&str>, Option<&str>), SelectError> {
    let some = |text| Some(text).filter(|text: &&str| !text.is_empty());
    if name.starts_with("http://") || name.starts_with("https://") {
        let (url, id) = name.split_once('#').map_or((name, None), |(url, id)| (url, some(id)));
        return Ok((COMPATIBLE, id, Some(url)));
    }
    // A model's id may contain an `@`; an address starts with http.
    let (rest, url) = match name.find("@http") {
        Some(at) => (&name[..at], Some(&name[at + 1..])),
        None => (name, None),
    };
    if let Some(url) = url.filter(|url| !url.starts_with("http://") && !url.starts_with("https://")) {
        return Err(SelectError::Url(url.to_owned()));
    }
    let (vendor, id) = rest.split_once('#').map_or((rest, None), |(vendor, id)| (vendor, some(id)));
    Ok((vendor, id, url))
}
