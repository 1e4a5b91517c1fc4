//! API keys that cannot be printed.

use std::fmt;

/// A vendor's API key. It is displayed as `***`; only the client that sends it can read it.
#[derive(Clone, PartialEq, Eq)]
pub struct ApiKey(String);

/// Replacement text for a key.
const MASK: &str = "***";
/// Shorter values are not secret, and masking them would garble ordinary words.
const SHORTEST: usize = 6;

impl ApiKey {
    /// A key; surrounding white space is removed. `None` if nothing is left.
    #[must_use]
    pub fn new(key: &str) -> Option<Self> {
        let key = key.trim();
        (!key.is_empty()).then(|| Self(key.to_owned()))
    }

    /// The key itself, for the request header.
    pub(crate) fn reveal(&self) -> &str {
        &self.0
    }

    /// Masks the key in a text: vendors repeat keys in their errors.
    #[must_use]
    pub fn scrub(&self, text: &str) -> String {
        if self.0.len() < SHORTEST { text.to_owned() } else { text.replace(&self.0, MASK) }
    }
}

impl fmt::Debug for ApiKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(MASK)
    }
}

impl fmt::Display for ApiKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(MASK)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_never_shown() {
        let key = ApiKey::new(" sk-0123456789abcdef\n").unwrap();
        assert_eq!(format!("{key} {key:?} {key:#?}"), "*** *** ***");
        assert_eq!(key.scrub("bad key sk-0123456789abcdef!"), "bad key ***!");
        assert_eq!(key.reveal(), "sk-0123456789abcdef");
        assert_eq!(ApiKey::new(" \n"), None);
        assert_eq!(ApiKey::new("a").unwrap().scrub("a b"), "a b");
    }
}
