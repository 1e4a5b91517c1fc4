//! Reads a reply with unescaped quotes in a name, or with typographic quotes, and tells when text may have got out of its string.
//!
//! A sign in the image may say anything, `EXIT","status":"done` included, and a model copies it into its answer, at times
//! without escaping it. What came from inside a string must not become a field of the reply. So every key that makes a reply
//! ([`is_telling`]), wherever it stands in the answer, must be one that was read as a key ([`keys_in`], [`keys_of`]). Where they
//! differ, [`repaired`] reads what can only be meant in one way:
//!
//! - `status` stands in the answer once, after the target as the prompt asks: the quote before it ends the target, whatever
//!   stands before that quote;
//! - the other keys follow in the order of the prompt, each once, and there are none but those asked for;
//! - nothing that begins or ends a string or an object follows the reply.
//!
//! No kept library that mends JSON promises this: they guess where a string ends.

use super::json::{Value, is_telling, read};

/// The keys of a reply in their order, with their other names.
const ORDER: [&[&str]; 10] = [
    &["target", "label"],
    &["status"],
    &["stage"],
    &["target_box"],
    &["point", "point_2d"],
    &["depth", "depth_label", "depth_m", "distance_m"],
    &["turn_deg"],
    &["look"],
    &["open_way"],
    &["boxes", "obstacles"],
];
const SPACE: [char; 4] = [' ', '\t', '\r', '\n'];

/// The number of telling keys in an answer, also in what is no JSON: every one that the reader can take for a key, and more.
pub(super) fn keys_in(text: &str) -> usize {
    keys(text).filter(|(_, key)| is_telling(key)).count()
}

/// The number of telling keys in a value.
pub(super) fn keys_of(value: &Value) -> usize {
    match value {
        Value::Object(fields) => fields.iter().map(|(key, field)| usize::from(is_telling(key)) + keys_of(field)).sum(),
        Value::Array(items) => items.iter().map(keys_of).sum(),
        _ => 0,
    }
}

/// Words before a colon that are in quotes, or follow a brace or a comma; each with the place of its first character or quote.
fn keys(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.match_indices(':').filter_map(|(colon, _)| {
        let before = text[..colon].trim_end_matches(SPACE);
        let unquoted = before.strip_suffix(is_quote);
        let inner = unquoted.unwrap_or(before);
        let head = inner.trim_end_matches(is_of_a_word);
        let word = &inner[head.len()..];
        if unquoted.is_some() {
            return head.strip_suffix(is_quote).filter(|_| !word.is_empty()).map(|head| (head.len(), word));
        }
        // Of the prose before a colon nothing but these words is of interest: looking further back for each would not be linear.
        let is_key = is_telling(word) && head.trim_end_matches(SPACE).ends_with(['{', ',']);
        is_key.then_some((head.len(), word))
    })
}

fn is_of_a_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

fn is_quote(c: char) -> bool {
    matches!(c, '"' | '\'' | '“' | '”' | '„' | '‟' | '‘' | '’' | '‚' | '‛')
}

/// Whether a string that begins with `opening` may end with `c`.
fn closes(opening: char, c: char) -> bool {
    match opening {
        '"' | '\'' => c == opening,
        '“' | '”' | '„' | '‟' => matches!(c, '“' | '”' | '‟'),
        _ => matches!(c, '‘' | '’' | '‛'),
    }
}

/// The reply in an answer that is not JSON because of its quotes; `None` if there is more than one way to read it.
pub(super) fn repaired(text: &str) -> Option<Value> {
    let mut stated = keys(text).filter(|(_, key)| key.eq_ignore_ascii_case("status"));
    let (status, _) = stated.next().filter(|_| stated.next().is_none())?;
    let start = text.find('{')?;
    let mut repair = Repair { text, at: start, out: String::new(), open: Vec::new(), last: ' ', key: String::new(), status };
    repair.object()?;
    let rest = &text[repair.at..];
    if rest.contains(|c| matches!(c, '{' | '}' | '[') || (is_quote(c) && c != '\'' && c != '’')) {
        return None;
    }
    read(&repair.out).ok().filter(is_in_order)
}

/// Whether the keys are those of a reply, in their order.
fn is_in_order(value: &Value) -> bool {
    let Value::Object(fields) = value else { return false };
    let place = |key: &str| ORDER.iter().position(|names| names.iter().any(|name| name.eq_ignore_ascii_case(key)));
    let places: Option<Vec<usize>> = fields.iter().map(|(key, _)| place(key)).collect();
    places.is_some_and(|places| places.is_sorted_by(|a, b| a < b))
}

/// Writes an object again as JSON.
struct Repair<'a> {
    text: &'a str,
    at: usize,
    out: String,
    open: Vec<char>,
    /// The last character outside strings that was not white space.
    last: char,
    /// The last key.
    key: String,
    /// Where the only `status` stands.
    status: usize,
}

impl<'a> Repair<'a> {
    /// Writes what stands up to the bracket that closes the first one.
    fn object(&mut self) -> Option<()> {
        loop {
            let c = self.text[self.at..].chars().next()?;
            let is_key = self.open.last() == Some(&'{') && matches!(self.last, '{' | ',');
            match c {
                _ if is_key && (is_quote(c) || is_of_a_word(c)) => self.key(c)?,
                _ if is_quote(c) => self.string(c)?,
                '{' | '[' => self.open.push(c),
                '}' | ']' => _ = self.open.pop().filter(|opening| (*opening == '{') == (c == '}'))?,
                ',' | ':' | '+' | '-' | '.' => {}
                _ if SPACE.contains(&c) || is_of_a_word(c) => {}
                _ => return None,
            }
            if is_quote(c) || (is_key && is_of_a_word(c)) {
                self.last = '"';
                continue;
            }
            self.at += c.len_utf8();
            self.out.push(c);
            if self.open.is_empty() {
                return Some(());
            }
            if !SPACE.contains(&c) {
                self.last = c;
            }
        }
    }

    fn key(&mut self, first: char) -> Option<()> {
        let rest = &self.text[self.at..];
        let inner = if is_quote(first) { &rest[first.len_utf8()..] } else { rest };
        let after = inner.trim_start_matches(is_of_a_word);
        let word = &inner[..inner.len() - after.len()];
        let after = if is_quote(first) { after.strip_prefix(|c| closes(first, c))? } else { after };
        self.key = word.to_ascii_lowercase();
        self.write(word, self.text.len() - after.len());
        Some(())
    }

    fn string(&mut self, opening: char) -> Option<()> {
        if !matches!(self.last, ':' | '[' | ',') {
            return None;
        }
        let start = self.at + opening.len_utf8();
        let inner = match (self.key.as_str(), self.open.as_slice()) {
            ("target" | "label", ['{']) => self.target(start, opening)?,
            ("name" | "label", ['{', '[', '{']) => self.name(start, opening)?,
            _ => {
                let inner = &self.text[start..start + self.text[start..].find(|c| closes(opening, c))?];
                let is_plain = |c: char| is_of_a_word(c) || matches!(c, ' ' | '.' | ',' | ';' | '+' | '-');
                Some(inner).filter(|inner| inner.chars().all(is_plain))?
            }
        };
        // Text with keys in it is more than a name.
        if keys(inner).next().is_some() || keys_in(inner) > 0 {
            return None;
        }
        let end = start + inner.len();
        self.write(inner, end + self.text[end..].chars().next()?.len_utf8());
        Some(())
    }

    /// The target: up to the quote and the comma before `status`.
    fn target(&self, start: usize, opening: char) -> Option<&'a str> {
        let before = self.text.get(start..self.status)?;
        let inner = before.trim_end_matches(SPACE).strip_suffix(',')?.trim_end_matches(SPACE);
        inner.strip_suffix(|c| closes(opening, c)).filter(|inner| !is_escaping(inner))
    }

    /// The name of an obstacle, which is its last field: up to the quote after which its object ends, and with it the list, or
    /// another object begins.
    fn name(&self, start: usize, opening: char) -> Option<&'a str> {
        let rest = &self.text[start..];
        let ends = |(at, quote): &(usize, &str)| {
            let after = rest[at + quote.len()..].trim_start_matches(SPACE);
            let Some(after) = after.strip_prefix('}').map(|after| after.trim_start_matches(SPACE)) else { return false };
            let next = after.strip_prefix(',').map(|after| after.trim_start_matches(SPACE));
            (after.starts_with(']') || next.is_some_and(|next| next.starts_with('{'))) && !is_escaping(&rest[..*at])
        };
        rest.match_indices(|c| closes(opening, c)).find(ends).map(|(at, _)| &rest[..at])
    }

    /// Writes a string, and goes on at `next`.
    fn write(&mut self, inner: &str, next: usize) {
        self.out.push('"');
        let mut chars = inner.chars().peekable();
        while let Some(c) = chars.next() {
            match c {
                '"' => self.out.push_str("\\\""),
                '\\' => match chars.next_if(|c| matches!(c, '"' | '\'' | '\\' | '/' | 'n' | 'r' | 't')) {
                    Some(escaped) => self.out.extend(['\\', escaped]),
                    None => self.out.push_str("\\\\"),
                },
                _ => self.out.push(c),
            }
        }
        self.out.push('"');
        self.at = next;
    }
}

/// Whether the text ends with a backslash that escapes what follows.
fn is_escaping(text: &str) -> bool {
    (text.len() - text.trim_end_matches('\\').len()) % 2 == 1
}
