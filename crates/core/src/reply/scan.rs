//! Finds the JSON in an answer, complete or still arriving, surrounded by prose, code fences and reasoning.
//!
//! Everything before the last end of a thought is thought, whatever its mark: its opening may have been in the prompt. Marks within
//! a JSON string are text, and no string within a value is read as one: a sign in the image could have written it.
//!
//! The scanner is a byte-wise state machine without look-ahead, so the result does not depend on how an answer is split
//! into chunks.

use super::json::{Broken, MAX_DEPTH, Value, read};
use super::repair::keys_of;

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
    /// Whether the scan has met a quote inside of it.
    is_quoted: bool,
    /// The accepted values since the last end of a thought.
    pub(crate) accepted: Vec<T>,
    /// The first refusal since then.
    pub(crate) refused: Option<E>,
    /// A refusal after the last accepted value.
    pub(super) overruled: Option<E>,
    /// Where the last thought ended.
    pub(super) since: usize,
    /// The telling keys read since then.
    pub(super) keys: usize,
    /// Whether any JSON was read.
    pub(crate) any_json: bool,
    /// Whether the text ended inside a value that was valid so far.
    pub(crate) truncated: bool,
    /// Whether a thought ended where a value broke off.
    pub(super) is_torn: bool,
    /// Where the last accepted value ends.
    pub(super) accepted_until: usize,
}

#[derive(Clone, Debug, PartialEq)]
enum Mode {
    Prose,
    /// After the beginning of a thought: drafts there are not the answer.
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

/// Where thoughts begin: tags of open models, and a channel other than the final one (OpenAI's harmony format).
const BEGINS: [&[u8]; 6] =
    [b"<think>", b"<thinking>", b"<thought>", b"<reasoning>", b"<|channel|>analysis", b"<|channel|>commentary"];
/// Where they end.
const ENDS: [&[u8]; 5] = [b"</think>", b"</thinking>", b"</thought>", b"</reasoning>", b"<|channel|>final"];

/// Whether a thought begins or ends in a text.
pub(super) fn has_thought(text: &str) -> bool {
    let rests = text.match_indices('<').map(|(at, _)| &text.as_bytes()[at..]);
    rests.into_iter().any(|rest| BEGINS.iter().chain(&ENDS).any(|mark| rest.starts_with(mark)))
}

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
    scan.outcome().map(|mut all| all.swap_remove(0))
}

impl<T, E> Scan<T, E> {
    /// The accepted values, once the answer is complete: at least one.
    pub(super) fn outcome(self) -> Result<Vec<T>, ScanError<E>> {
        match self.refused {
            _ if !self.accepted.is_empty() => Ok(self.accepted),
            Some(error) => Err(ScanError::Refused(error)),
            None if self.truncated => Err(ScanError::Truncated),
            None if self.any_json => Err(ScanError::NoReply),
            None => Err(ScanError::NoJson),
        }
    }

    pub(crate) fn new() -> Self {
        Self {
            at: 0,
            mode: Mode::Prose,
            nested_until: 0,
            is_quoted: false,
            accepted: Vec::new(),
            refused: None,
            overruled: None,
            since: 0,
            keys: 0,
            any_json: false,
            truncated: false,
            is_torn: false,
            accepted_until: 0,
        }
    }

    /// Continues through `text`, which must start with the text of the previous call. `ended`: the text is complete.
    /// `judge` receives each value and whether it lies inside a larger one that failed to parse.
    ///
    /// Time is linear in the text except for values that failed to parse, inside which the scan restarts: at most once
    /// per level of nesting, which is bounded.
    pub(crate) fn advance(&mut self, text: &str, ended: bool, judge: impl Fn(&Value, bool) -> Verdict<T, E>) {
        let bytes = text.as_bytes();
        loop {
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
                        if ENDS.iter().any(|mark| rest.starts_with(mark)) {
                            // Where a value breaks off, the mark may be of a text that has left its string.
                            self.is_torn |= self.at < self.nested_until;
                            self.end_thought();
                        } else if BEGINS.iter().any(|mark| rest.starts_with(mark)) {
                            self.mode = Mode::Thought;
                        } else if !ended && ENDS.iter().chain(&BEGINS).any(|mark| mark.starts_with(rest)) {
                            return;
                        }
                    }
                    self.is_quoted |= byte == b'"' && self.at < self.nested_until;
                    self.at += 1;
                }
                Mode::Thought => {
                    self.at += 1;
                    if ENDS.iter().any(|mark| bytes[..self.at].ends_with(mark)) {
                        self.end_thought();
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
        self.mode = Mode::Prose;
        self.any_json = true;
        let is_nested = start < self.nested_until;
        // Behind a quote in a larger value that is broken it may be part of a string.
        if !(is_nested && self.is_quoted) {
            self.keys += keys_of(&value);
            self.take(&value, is_nested, judge);
        }
    }

    /// Takes a value, or those within it if it is something else.
    fn take(&mut self, value: &Value, is_nested: bool, judge: &impl Fn(&Value, bool) -> Verdict<T, E>) {
        match judge(value, is_nested) {
            Verdict::Accepted(found) => {
                self.accepted.push(found);
                self.accepted_until = self.at;
                self.overruled = None;
            }
            Verdict::Refused(error) if self.accepted.is_empty() => _ = self.refused.get_or_insert(error),
            Verdict::Refused(error) => self.overruled = Some(error),
            Verdict::Other => match value {
                Value::Array(items) => items.iter().for_each(|item| self.take(item, true, judge)),
                Value::Object(fields) => fields.iter().for_each(|(_, field)| self.take(field, true, judge)),
                _ => {}
            },
        }
    }

    /// Restarts the scan after the bracket at `start`, inside the text that ends at `end`.
    fn give_up(&mut self, start: usize, end: usize) {
        self.mode = Mode::Prose;
        self.at = start + 1;
        self.is_quoted = self.is_quoted && start < self.nested_until;
        self.nested_until = self.nested_until.max(end);
    }

    /// Whether a thought has begun and not ended.
    pub(super) fn is_thinking(&self) -> bool {
        self.mode == Mode::Thought
    }

    /// What was found so far was a draft.
    fn end_thought(&mut self) {
        let Self { at, nested_until, is_quoted, is_torn, .. } = *self;
        *self = Self { at, since: at, nested_until, is_quoted, is_torn, ..Self::new() };
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
