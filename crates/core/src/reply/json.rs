//! A lenient JSON reader for the errors that models make, strict about everything else.
//!
//! Accepted: trailing commas, single quotes, keys without quotes, `//` comments, Python's `True`, `False` and `None`, a leading `+`,
//! raw line breaks inside strings, and half a surrogate pair, which is read as U+FFFD. Numbers that overflow are read as infinite,
//! and `NaN` as such, and left to the caller's range checks. Nesting is bounded by
//! [`MAX_DEPTH`], memory by the text's length.

/// Maximum nesting of objects and arrays.
pub(crate) const MAX_DEPTH: usize = 16;

/// Keys of which a reply consists, or with which it begins.
const TELLING: [&str; 4] = ["target", "status", "point", "point_2d"];
/// Whether a key is one of which a reply consists, or with which it begins.
pub(super) fn is_telling(key: &str) -> bool {
    TELLING.iter().any(|telling| telling.eq_ignore_ascii_case(key))
}

/// A JSON value. Objects keep the order and repetitions of their keys.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `null`, or Python's `None`.
    Null,
    /// A truth value.
    Bool(bool),
    /// A number; infinite if it overflows, and not a number where that is written.
    Number(f64),
    /// A string.
    Text(String),
    /// An array.
    Array(Vec<Self>),
    /// An object: its keys and values.
    Object(Vec<(String, Self)>),
}

impl Value {
    /// The value of the first of `keys` that is present and not null; for a repeated key the last value counts.
    #[must_use]
    pub fn field(&self, keys: &[&str]) -> Option<&Self> {
        let Self::Object(fields) = self else { return None };
        keys.iter().find_map(|key| {
            fields
                .iter()
                .rev()
                .find(|(name, _)| name.eq_ignore_ascii_case(key))
                .map(|(_, value)| value)
                .filter(|v| **v != Self::Null)
        })
    }

    /// The value of `key` if it is present, null included; for a repeated key the last value counts.
    #[must_use]
    pub fn key(&self, key: &str) -> Option<&Self> {
        let Self::Object(fields) = self else { return None };
        fields.iter().rev().find(|(name, _)| name.eq_ignore_ascii_case(key)).map(|(_, value)| value)
    }

    /// The value as a number, also if written as text.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(n) => Some(*n),
            Self::Text(text) => text.trim().parse().ok(),
            _ => None,
        }
    }

    /// The value as text.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    /// The value as a boolean, also if written as text.
    #[must_use]
    pub fn truth(&self) -> Option<bool> {
        match self {
            Self::Bool(truth) => Some(*truth),
            Self::Text(text) => match text.trim().to_ascii_lowercase().as_str() {
                "true" | "yes" => Some(true),
                "false" | "no" => Some(false),
                _ => None,
            },
            _ => None,
        }
    }

    /// A short rendering for error messages, at most 40 characters.
    #[must_use]
    pub fn excerpt(&self) -> String {
        match self {
            Self::Null => "null".to_owned(),
            Self::Bool(b) => b.to_string(),
            Self::Number(n) => n.to_string().chars().take(40).collect(),
            Self::Text(text) => text.chars().filter(|c| !c.is_control()).take(40).collect(),
            Self::Array(_) => "an array".to_owned(),
            Self::Object(_) => "an object".to_owned(),
        }
    }
}

/// Why a text is not a JSON value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Broken {
    /// The text ends too early but is valid so far.
    Truncated,
    /// It is not JSON.
    Invalid,
}

/// Reads a single value spanning all of `text`.
pub(crate) fn read(text: &str) -> Result<Value, Broken> {
    let mut reader = Reader { text, at: 0 };
    let value = reader.value(0)?;
    reader.space();
    if reader.at == text.len() { Ok(value) } else { Err(Broken::Invalid) }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl Reader<'_> {
    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn space(&mut self) {
        loop {
            match self.peek() {
                Some(b' ' | b'\t' | b'\r' | b'\n') => self.at += 1,
                Some(b'/') if self.text[self.at..].starts_with("//") => {
                    let rest = &self.text[self.at..];
                    self.at += rest.find('\n').unwrap_or(rest.len());
                }
                _ => return,
            }
        }
    }

    /// Skips white space and returns the next byte; an error if there is none.
    fn next(&mut self) -> Result<u8, Broken> {
        self.space();
        self.peek().ok_or(Broken::Truncated)
    }

    fn value(&mut self, depth: usize) -> Result<Value, Broken> {
        if depth > MAX_DEPTH {
            return Err(Broken::Invalid);
        }
        match self.next()? {
            b'{' => self.object(depth),
            b'[' => self.array(depth),
            quote @ (b'"' | b'\'') => self.string(quote).map(Value::Text),
            b'+' | b'-' | b'.' | b'0'..=b'9' => self.number(),
            b'a'..=b'z' | b'A'..=b'Z' => self.word(),
            _ => Err(Broken::Invalid),
        }
    }

    fn object(&mut self, depth: usize) -> Result<Value, Broken> {
        self.at += 1;
        let mut fields = Vec::new();
        loop {
            let before = self.at;
            match self.next()? {
                b'}' => break,
                byte @ (b'"' | b'\'' | b'_' | b'a'..=b'z' | b'A'..=b'Z') => {
                    let start = self.at;
                    let is_bare = !matches!(byte, b'"' | b'\'');
                    let key = if is_bare { self.bare_key() } else { self.string(byte)? };
                    let end = self.at;
                    if self.next()? != b':' {
                        return Err(Broken::Invalid);
                    }
                    // What the reader takes for one of these keys must look like one: see `keys_in`.
                    let has = |from: usize, to: usize, c: char| self.text[from..to].contains(c);
                    let is_hidden = has(start, end, '\\') || has(end, self.at, '/') || (is_bare && has(before, start, '/'));
                    if is_hidden && is_telling(&key) {
                        return Err(Broken::Invalid);
                    }
                    self.at += 1;
                    fields.push((key, self.value(depth + 1)?));
                }
                _ => return Err(Broken::Invalid),
            }
            self.separator(b'}')?;
        }
        self.at += 1;
        Ok(Value::Object(fields))
    }

    fn array(&mut self, depth: usize) -> Result<Value, Broken> {
        self.at += 1;
        let mut items = Vec::new();
        while self.next()? != b']' {
            items.push(self.value(depth + 1)?);
            self.separator(b']')?;
        }
        self.at += 1;
        Ok(Value::Array(items))
    }

    /// Consumes a comma, or stops at `close` without consuming it.
    fn separator(&mut self, close: u8) -> Result<(), Broken> {
        match self.next()? {
            b',' => self.at += 1,
            byte if byte == close => {}
            _ => return Err(Broken::Invalid),
        }
        Ok(())
    }

    fn bare_key(&mut self) -> String {
        let start = self.at;
        while matches!(self.peek(), Some(b'_' | b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z')) {
            self.at += 1;
        }
        self.text[start..self.at].to_owned()
    }

    fn number(&mut self) -> Result<Value, Broken> {
        let start = self.at;
        while matches!(self.peek(), Some(b'+' | b'-' | b'.' | b'0'..=b'9' | b'e' | b'E')) {
            self.at += 1;
        }
        if self.peek().is_none() {
            return Err(Broken::Truncated);
        }
        self.text[start..self.at].parse().map(Value::Number).ok().ok_or(Broken::Invalid)
    }

    fn word(&mut self) -> Result<Value, Broken> {
        let start = self.at;
        while matches!(self.peek(), Some(b'a'..=b'z' | b'A'..=b'Z')) {
            self.at += 1;
        }
        let word = &self.text[start..self.at];
        if self.peek().is_none() {
            let begun = ["null", "None", "true", "True", "false", "False", "NaN"].iter().any(|whole| whole.starts_with(word));
            return Err(if begun { Broken::Truncated } else { Broken::Invalid });
        }
        match word {
            "null" | "None" => Ok(Value::Null),
            "true" | "True" => Ok(Value::Bool(true)),
            "false" | "False" => Ok(Value::Bool(false)),
            "NaN" => Ok(Value::Number(f64::NAN)),
            _ => Err(Broken::Invalid),
        }
    }

    fn string(&mut self, quote: u8) -> Result<String, Broken> {
        self.at += 1;
        let mut out = String::new();
        loop {
            let start = self.at;
            while self.peek().is_some_and(|b| b != quote && b != b'\\') {
                self.at += 1;
            }
            // Both ends lie on an ASCII byte or the end of the text, hence on a character boundary.
            out.push_str(&self.text[start..self.at]);
            match self.peek() {
                None => return Err(Broken::Truncated),
                Some(b'\\') => out.push(self.escape()?),
                Some(_) => {
                    self.at += 1;
                    return Ok(out);
                }
            }
        }
    }

    fn escape(&mut self) -> Result<char, Broken> {
        let code = *self.text.as_bytes().get(self.at + 1).ok_or(Broken::Truncated)?;
        self.at += 2;
        Ok(match code {
            b'n' => '\n',
            b't' => '\t',
            b'r' => '\r',
            b'b' => '\u{8}',
            b'f' => '\u{c}',
            b'"' | b'\'' | b'\\' | b'/' => char::from(code),
            b'u' => self.unicode()?,
            _ => return Err(Broken::Invalid),
        })
    }

    fn unicode(&mut self) -> Result<char, Broken> {
        let high = self.hex()?;
        let rest = &self.text.as_bytes()[self.at..];
        if !(0xd800..0xdc00).contains(&high) || !rest.starts_with(b"\\u") {
            // Half a surrogate pair is no character.
            let is_half = (0xd800..0xdc00).contains(&high) && rest.len() < 2;
            return if is_half {
                Err(Broken::Truncated)
            } else {
                Ok(char::from_u32(high).unwrap_or(char::REPLACEMENT_CHARACTER))
            };
        }
        let after_high = self.at;
        self.at += 2;
        let low = self.hex()?;
        if !(0xdc00..0xe000).contains(&low) {
            self.at = after_high;
            return Ok(char::REPLACEMENT_CHARACTER);
        }
        char::from_u32(0x1_0000 + ((high - 0xd800) << 10) + (low - 0xdc00)).ok_or(Broken::Invalid)
    }

    fn hex(&mut self) -> Result<u32, Broken> {
        let mut code = 0;
        for _ in 0..4 {
            let digit = char::from(self.peek().ok_or(Broken::Truncated)?).to_digit(16).ok_or(Broken::Invalid)?;
            code = code * 16 + digit;
            self.at += 1;
        }
        Ok(code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_models_write() {
        let value = read("{'a': [1, +2.5, \"x\\u00e9\\ud83d\\ude81\",], \"b\": None, 'c': True,}").unwrap();
        let Value::Array(items) = value.field(&["a"]).unwrap() else { panic!("{value:?}") };
        assert_eq!(items[..], [Value::Number(1.0), Value::Number(2.5), Value::Text("xé🚁".to_owned())]);
        assert_eq!(value.field(&["b"]), None);
        assert_eq!(value.field(&["b", "C"]), Some(&Value::Bool(true)));
    }

    #[test]
    fn reads_what_cannot_mean_anything_else() {
        let text = "{status: 'done', // it's {reached}\n depth_m: NaN, \"x\": \"a\\ud83dz\\ud83d\\u0041\\udc00\"}";
        let value = read(text).unwrap();
        assert_eq!(value.field(&["status"]).and_then(Value::text), Some("done"));
        assert!(value.field(&["depth_m"]).and_then(Value::number).is_some_and(f64::is_nan));
        assert_eq!(value.field(&["x"]).and_then(Value::text), Some("a\u{fffd}z\u{fffd}A\u{fffd}"));
        assert_eq!(read("[1] // end"), Ok(Value::Array(vec![Value::Number(1.0)])));
    }

    #[test]
    fn tells_truncated_from_invalid() {
        let text = r#"{"a": [1, -2.5e1, "x\u00e9"], "b": {"c": null}}"#;
        assert!(read(text).is_ok());
        for end in 0..text.len() {
            assert_eq!(read(&text[..end]), Err(Broken::Truncated), "{}", &text[..end]);
        }
        assert_eq!(read("[crane"), Err(Broken::Invalid));
        for bad in
            ["{a b: 1}", "[1 2]", "[,1]", "[--1]", "{\"a\" 1}", "[nul]", "\"\\q\"", "[1] 2", "[Nan]", "{_: }", "[1 / 2]", "{,}"]
        {
            assert_eq!(read(bad), Err(Broken::Invalid), "{bad}");
        }
    }

    #[test]
    fn nesting_is_bounded() {
        let nested = |n: usize| format!("{}{}", "[".repeat(n), "]".repeat(n));
        assert!(read(&nested(MAX_DEPTH)).is_ok());
        assert_eq!(read(&nested(20_000)), Err(Broken::Invalid));
    }
}
