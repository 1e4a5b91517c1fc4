//! From `NAME[#MODEL][@URL]` to a model.

use super::{Model, Status, Table};

/// A model as it was named.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The name as it was given, for records.
    pub name: String,
    /// The model.
    pub model: Model,
    /// Where it is, when not where the table says.
    pub url: Option<String>,
}

/// Why a name stands for no model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SelectError {
    /// No such vendor.
    #[error("`{name}` is no VLM")]
    Unknown {
        /// The name.
        name: String,
        /// Names that there are.
        known: Vec<String>,
    },
    /// The vendor has no default.
    #[error("`{vendor}` serves many models, and none is named")]
    NoModel {
        /// The vendor.
        vendor: String,
    },
    /// Switched off.
    #[error("`{model}` was retired by {vendor} on {day}; its successor is `{successor}`")]
    Retired {
        /// The model.
        model: String,
        /// The vendor's title.
        vendor: String,
        /// When.
        day: String,
        /// What to ask instead.
        successor: String,
    },
    /// No address.
    #[error("`{0}` is no address of a server: it begins with http:// or https://")]
    Url(String),
}

impl Table {
    /// The model that `NAME[#MODEL][@URL]` or `URL[#MODEL]` names, on a day `YYYY-MM-DD`.
    ///
    /// # Errors
    /// [`SelectError`] when there is none, or it can no longer be had.
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
            // At another address someone else may well serve it still.
            if let Some(successor) = row.successor.clone().filter(|_| gone && url.is_none()) {
                let vendor = vendor_row.title.clone();
                return Err(SelectError::Retired { model: id, vendor, day: day.to_owned(), successor });
            }
        }
        Ok(Choice { name: name.to_owned(), model, url: url.map(|url| url.trim_end_matches('/').to_owned()) })
    }
}

/// The vendor that stands for any server of OpenAI's chat.
const COMPATIBLE: &str = "compatible";

/// Vendor, model and address of a name.
fn parts(name: &str) -> Result<(&str, Option<&str>, Option<&str>), SelectError> {
    let some = |text| Some(text).filter(|text: &&str| !text.is_empty());
    if name.starts_with("http://") || name.starts_with("https://") {
        let (url, id) = name.split_once('#').map_or((name, None), |(url, id)| (url, some(id)));
        return Ok((COMPATIBLE, id, Some(url)));
    }
    // A model's id may hold an `@`, an address begins with http.
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
