//! Finding the JSON in an answer, whole or still arriving, with prose, fences and thoughts around it.
//!
//! The search is a machine over bytes that never looks ahead of what has arrived, so that how an answer is cut into chunks
//! cannot change what is read from it.

use super::json::{Broken, MAX_DEPTH, Value, read};

/// Longest answer that is read, bytes.
pub const MAX_TEXT: usize = 64 * 1024;

/// What a JSON value turned out to be.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Verdict<T, E> {
    /// What was looked for.
    Accepted(T),
    /// Meant to be what was looked for, but not to be used.
    Refused(E),
    /// Something else, inside which may yet be what is looked for.
    Other,
}

/// What the search found, besides an accepted value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scan<T, E> {
    at: usize,
    mode: Mode,
    /// Values that begin before this offset lie inside a larger one that was given up.
    nested_until: usize,
    /// The first accepted value.
    pub(crate) accepted: Option<T>,
    /// The first refusal.
    pub(crate) refused: Option<E>,
    /// Some JSON was read, though none that was looked for.
    pub(crate) any_json: bool,
    /// The text ended inside a value that was right so far.
    pub(crate) truncated: bool,
}

#[derive(Clone, Debug, PartialEq)]
enum Mode {
    Prose,
    /// Between `<think>` and `</think>`: a draft there is not the answer.
    Thought,
    Value {
        start: usize,
        open: Vec<u8>,
        quote: Option<u8>,
        escaped: bool,
        /// The last byte outside strings that was no space.
        last: u8,
    },
}

const THINK: &[u8] = b"<think>";
const THOUGHT: &[u8] = b"</think>";

/// Why nothing was accepted in an answer that has ended.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Unfound<E> {
    /// Longer than [`MAX_TEXT`]: not looked at.
    TooLong,
    /// Meant to be it, but not to be used.
    Refused(E),
    /// It ends inside its JSON.
    Truncated,
    /// There is JSON, but none that was looked for.
    NoReply,
    /// There is no JSON.
    NoJson,
}

/// What `judge` accepts first in the JSON of a whole answer.
pub(crate) fn search<T, E>(text: &str, judge: impl Fn(&Value, bool) -> Verdict<T, E>) -> Result<T, Unfound<E>> {
    if text.len() > MAX_TEXT {
        return Err(Unfound::TooLong);
    }
    let mut scan = Scan::new();
    scan.advance(text, true, judge);
    scan.outcome()
}

impl<T, E> Scan<T, E> {
    /// What was found, once the answer has ended.
    pub(super) fn outcome(self) -> Result<T, Unfound<E>> {
        match (self.accepted, self.refused) {
            (Some(found), _) => Ok(found),
            (None, Some(error)) => Err(Unfound::Refused(error)),
            (None, None) if self.truncated => Err(Unfound::Truncated),
            (None, None) if self.any_json => Err(Unfound::NoReply),
            (None, None) => Err(Unfound::NoJson),
        }
    }

    pub(crate) fn new() -> Self {
        Self { at: 0, mode: Mode::Prose, nested_until: 0, accepted: None, refused: None, any_json: false, truncated: false }
    }

    /// Goes on through `text`, which must begin with what was given before. `ended`: no more will come. `judge` is given each
    /// value and whether it lies inside a larger one that was given up.
    ///
    /// Time is linear in the text but for values that are given up, inside which the search starts again: at most once for
    /// each level of nesting, which is bounded.
    pub(crate) fn advance(&mut self, text: &str, ended: bool, judge: impl Fn(&Value, bool) -> Verdict<T, E>) {
        let bytes = text.as_bytes();
        while self.accepted.is_none() {
            let Some(&byte) = bytes.get(self.at) else {
                if !ended {
                    return;
                }
                let Mode::Value { start, .. } = self.mode else {
                    // Thoughts that never ended have used up what was to be the answer.
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

    /// Searches again behind the bracket at `start`, inside the text that ends at `end`.
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

/// One byte of a value: keeps the stack of open brackets, and knows strings.
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
            // Anywhere else a quote is an apostrophe of prose.
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
        b',' | b':' | b'+' | b'-' | b'.' | b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' => {}
        _ => return Step::Broken,
    }
    *last = byte;
    Step::Inside
}
