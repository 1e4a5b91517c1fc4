//! Finds the JSON in an answer, complete or still arriving, surrounded by prose, code fences and reasoning.
//!
//! The scanner is a byte-wise state machine without look-ahead, so the result does not depend on how an answer is split
//! into chunks.

use super::json::{Broken, MAX_DEPTH, Value, read};

/// Maximum length of an answer, bytes.
pub const MAX_TEXT: usize = 64 * 1024;

/// The verdict on a JSON value.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict<T, E> {
    /// The value searched for.
    Accepted(T),
    /// Intended as the value searched for, but invalid.
    Refused(E),
    /// Something else, which may contain the value searched for.
    Other,
}

/// State and results of a scan.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scan<T, E> {
    at: usize,
    mode: Mode,
    /// Values that start before this offset lie inside a larger one that failed to parse.
    nested_until: usize,
    /// The first accepted value.
    pub(crate) accepted: Option<T>,
    /// The first refusal.
    pub(crate) refused: Option<E>,
    /// Whether any JSON was read.
    pub(crate) any_json: bool,
    /// Whether the text ended inside a value that was valid so far.
    pub(crate) truncated: bool,
}

#[derive(Clone, Debug, PartialEq)]
enum Mode {
    Prose,
    /// Between `<think>` and `</think>`: drafts there are not the answer.
    Thought,
    Value {
        start: usize,
        open: Vec<u8>,
        quote: Option<u8>,
        escaped: bool,
        /// The last byte outside strings that was not white space.
        last: u8,
    },
}

const THINK: &[u8] = b"<think>";
const THOUGHT: &[u8] = b"</think>";

/// Why nothing was accepted in a complete answer.
#[derive(Clone, Debug, PartialEq)]
pub enum ScanError<E> {
    /// Longer than [`MAX_TEXT`]: not parsed.
    TooLong,
    /// Intended as the value searched for, but invalid.
    Refused(E),
    /// The text ends inside its JSON.
    Truncated,
    /// There is JSON, but not the value searched for.
    NoReply,
    /// There is no JSON.
    NoJson,
}

/// The first value that `judge` accepts in the JSON of a complete answer. `judge` receives each value and whether it lies inside a
/// larger one that failed to parse.
///
/// # Errors
/// [`ScanError`] if it accepts none.
pub fn search<T, E>(text: &str, judge: impl Fn(&Value, bool) -> Verdict<T, E>) -> Result<T, ScanError<E>> {
    if text.len() > MAX_TEXT {
        return Err(ScanError::TooLong);
    }
    let mut scan = Scan::new();
    scan.advance(text, true, judge);
    scan.outcome()
}

impl<T, E> Scan<T, E> {
    /// The result, once the answer is complete.
    pub(super) fn outcome(self) -> Result<T, ScanError<E>> {
        match (self.accepted, self.refused) {
            (Some(found), _) => Ok(found),
            (None, Some(error)) => Err(ScanError::Refused(error)),
            (None, None) if self.truncated => Err(ScanError::Truncated),
            (None, None) if self.any_json => Err(ScanError::NoReply),
            (None, None) => Err(ScanError::NoJson),
        }
    }

    pub(crate) fn new() -> Self {
        Self { at: 0, mode: Mode::Prose, nested_until: 0, accepted: None, refused: None, any_json: false, truncated: false }
    }

    /// Continues through `text`, which must start with the text of the previous call. `ended`: the text is complete.
    /// `judge` receives each value and whether it lies inside a larger one that failed to parse.
    ///
    /// Time is linear in the text except for values that failed to parse, inside which the scan restarts: at most once
    /// per level of nesting, which is bounded.
    pub(crate) fn advance(&mut self, text: &str, ended: bool, judge: impl Fn(&Value, bool) -> Verdict<T, E>) {
        let bytes = text.as_bytes();
        while self.accepted.is_none() {
            let Some(&byte) = bytes.get(self.at) else {
                if !ended {
                    return;
                }
                let Mode::Value { start, .. } = self.mode else {
                    // Reasoning that never ended has consumed what should have been the answer.
                    self.truncated |= self.mode == Mode::Thought;
                    return;
                };
                self.truncated = self.truncated || read(&text[start..]) == Err(Broken::Truncated);
                self.give_up(start, text.len());
                continue;
            };
            match &mut self.mode {
                Mode::Prose => {
                    if matches!(byte, b'{' | b'[') {
                        self.mode = Mode::Value { start: self.at, open: vec![byte], quote: None, escaped: false, last: byte };
                    } else if byte == b'<' {
                        let rest = &bytes[self.at..];
                        if rest.starts_with(THINK) {
                            self.mode = Mode::Thought;
                        } else if !ended && THINK.starts_with(rest) {
                            return;
                        }
                    }
                    self.at += 1;
                }
                Mode::Thought => {
                    self.at += 1;
                    if bytes[..self.at].ends_with(THOUGHT) {
                        self.mode = Mode::Prose;
                    }
                }
                Mode::Value { start, open, quote, escaped, last } => {
                    let start = *start;
                    self.at += 1;
                    if quote.is_none() && byte == b'/' {
                        // A comment, which is a string that ends with its line.
                        if bytes[self.at - 2] == b'/' {
                            *quote = Some(b'\n');
                        }
                        continue;
                    }
                    match step(byte, open, quote, escaped, last) {
                        Step::Inside => {}
                        Step::Broken => self.give_up(start, self.at),
                        Step::Closed => self.close(&text[start..self.at], start, &judge),
                    }
                }
            }
        }
    }

    fn close(&mut self, text: &str, start: usize, judge: &impl Fn(&Value, bool) -> Verdict<T, E>) {
        let Ok(value) = read(text) else { return self.give_up(start, self.at) };
        self.any_json = true;
        match judge(&value, start < self.nested_until) {
            Verdict::Accepted(found) => self.accepted = Some(found),
            Verdict::Refused(error) => {
                self.refused.get_or_insert(error);
                self.mode = Mode::Prose;
            }
            Verdict::Other => self.give_up(start, self.at),
        }
    }

    /// Restarts the scan after the bracket at `start`, inside the text that ends at `end`.
    fn give_up(&mut self, start: usize, end: usize) {
        self.mode = Mode::Prose;
        self.at = start + 1;
        self.nested_until = self.nested_until.max(end);
    }
}

enum Step {
    Inside,
    Closed,
    Broken,
}

/// Processes one byte of a value: tracks open brackets and strings.
fn step(byte: u8, open: &mut Vec<u8>, quote: &mut Option<u8>, escaped: &mut bool, last: &mut u8) -> Step {
    if let Some(closing) = *quote {
        if *escaped {
            *escaped = false;
        } else if byte == b'\\' {
            *escaped = true;
        } else if byte == closing {
            *quote = None;
        }
        return Step::Inside;
    }
    match byte {
        b' ' | b'\t' | b'\r' | b'\n' => return Step::Inside,
        b'"' | b'\'' => {
            // Elsewhere a quote is an apostrophe in prose.
            if !matches!(*last, b'{' | b'[' | b',' | b':') {
                return Step::Broken;
            }
            *quote = Some(byte);
        }
        b'{' | b'[' => {
            if open.len() > MAX_DEPTH {
                return Step::Broken;
            }
            open.push(byte);
        }
        b'}' | b']' => {
            let opening = if byte == b'}' { b'{' } else { b'[' };
            if open.pop() != Some(opening) {
                return Step::Broken;
            }
            if open.is_empty() {
                return Step::Closed;
            }
        }
        b',' | b':' | b'+' | b'-' | b'.' | b'_' | b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' => {}
        _ => return Step::Broken,
    }
    *last = byte;
    Step::Inside
}
