//! MiniSpec values and their comparison.

use core::cmp::Ordering;
use core::fmt;

use super::Comparator;

/// A dynamically typed value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A whole number.
    Int(i64),
    /// A number.
    Float(f64),
    /// True or false.
    Bool(bool),
    /// Nothing.
    None,
    /// A text.
    Text(String),
}

/// Values without an order.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot compare {left} and {right}: both must be numbers or both strings")]
pub struct TypeError {
    /// One of them.
    pub left: String,
    /// The other.
    pub right: String,
}

impl Value {
    /// Parses a token: an integer, a float, `True`, `False`, `None`, otherwise the string itself.
    #[must_use]
    pub fn of_token(token: &str) -> Self {
        match token {
            "True" | "true" => return Self::Bool(true),
            "False" | "false" => return Self::Bool(false),
            "None" | "none" | "null" => return Self::None,
            _ => {}
        }
        // Rust also parses `inf`, `nan` and `infinity`, which are names here.
        if !token.bytes().any(|byte| byte.is_ascii_digit()) || token.bytes().any(|b| b.is_ascii_alphabetic() && b != b'e') {
            return Self::Text(token.to_owned());
        }
        if let Ok(whole) = token.parse() {
            return Self::Int(whole);
        }
        token.parse().ok().filter(|number: &f64| number.is_finite()).map_or_else(|| Self::Text(token.to_owned()), Self::Float)
    }

    /// The value as a number.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Int(whole) => Some(*whole as f64),
            Self::Float(number) => Some(*number),
            Self::Bool(_) | Self::None | Self::Text(_) => None,
        }
    }

    /// Compares two values: across types `==` is false, `!=` true, and an order an error; integers count as numbers.
    ///
    /// # Errors
    /// [`TypeError`] for an order between values without one.
    pub fn compare(&self, comparator: Comparator, other: &Self) -> Result<bool, TypeError> {
        let equal = match (self.number(), other.number()) {
            (Some(a), Some(b)) => a == b,
            _ => self == other,
        };
        match comparator {
            Comparator::Equal => return Ok(equal),
            Comparator::Unequal => return Ok(!equal),
            _ => {}
        }
        let order = match (self, other) {
            (Self::Text(a), Self::Text(b)) => Some(a.cmp(b)),
            _ => self.number().zip(other.number()).and_then(|(a, b)| a.partial_cmp(&b)),
        };
        let order = order.ok_or_else(|| TypeError { left: self.to_string(), right: other.to_string() })?;
        Ok(match comparator {
            Comparator::Greater => order == Ordering::Greater,
            Comparator::Less => order == Ordering::Less,
            Comparator::AtLeast => order != Ordering::Less,
            Comparator::AtMost => order != Ordering::Greater,
            Comparator::Equal | Comparator::Unequal => equal,
        })
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int(whole) => write!(f, "{whole}"),
            Self::Float(number) => write!(f, "{number}"),
            Self::Bool(true) => f.write_str("True"),
            Self::Bool(false) => f.write_str("False"),
            Self::None => f.write_str("None"),
            Self::Text(text) => write!(f, "'{text}'"),
        }
    }
}
