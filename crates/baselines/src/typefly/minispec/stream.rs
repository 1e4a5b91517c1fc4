//! Programs that are still arriving: a statement can run as soon as it is complete.
//!
//! A byte-wise state machine without look-ahead finds the ends of statements, so the result does not depend on how a
//! program is split into chunks.

use super::parse::{MAX_DEPTH, ParseOptions, Precedence, SyntaxError, statements};
use super::{Block, Statement};

/// Maximum length of a program, bytes.
pub const MAX_TEXT: usize = 16 * 1024;

/// A program that is still arriving.
#[derive(Clone, Debug, Default)]
pub struct ProgramStream {
    options: ParseOptions,
    text: String,
    at: usize,
    /// Start of the current statement.
    start: usize,
    scan: Scan,
    error: Option<SyntaxError>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Mode {
    /// Before a statement.
    #[default]
    Between,
    /// In a run of backticks of this length before a statement.
    Fence(usize),
    /// In the rest of a line that starts with a code fence.
    FenceLine,
    Statement,
    Quoted(u8),
}

#[derive(Clone, Copy, Debug, Default)]
struct Scan {
    mode: Mode,
    braces: usize,
    parentheses: usize,
    /// The statement starts with `?`: a parenthesis in it closes a call and not the statement.
    conditional: bool,
}

/// Effect of a byte.
#[derive(PartialEq)]
enum Event {
    Nothing,
    /// The statement ends with this byte.
    Ends,
    /// The statement ended before this byte.
    Ended,
    TooDeep,
}

impl ProgramStream {
    /// An empty stream.
    #[must_use]
    pub fn new(precedence: Precedence) -> Self {
        Self { options: ParseOptions { precedence, parameters: false }, ..Self::default() }
    }

    /// The text so far.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The error at which reading stopped; earlier statements are valid.
    #[must_use]
    pub fn error(&self) -> Option<&SyntaxError> {
        self.error.as_ref()
    }

    /// Adds a chunk; returns the statements completed by it.
    pub fn push(&mut self, chunk: &str) -> Vec<Statement> {
        let mut found = Vec::new();
        if self.error.is_some() {
            return found;
        }
        let room = MAX_TEXT.saturating_sub(self.text.len());
        self.text.push_str(&chunk[..chunk.floor_char_boundary(room)]);
        while let (Some(&byte), None) = (self.text.as_bytes().get(self.at), &self.error) {
            let was_inside = self.scan.is_inside();
            let event = self.scan.step(byte);
            if !was_inside && (self.scan.is_inside() || event != Event::Nothing) {
                self.start = self.at;
            }
            self.at += 1;
            match event {
                Event::Nothing => {}
                Event::Ends => self.close(self.at, &mut found),
                Event::Ended => {
                    self.close(self.at - 1, &mut found);
                    self.scan.mode = Mode::Fence(1);
                }
                Event::TooDeep => self.refuse(self.at - 1, format!("blocks are nested more than {MAX_DEPTH} deep")),
            }
        }
        if chunk.len() > room && self.error.is_none() {
            self.refuse(self.text.len(), format!("the program is longer than {MAX_TEXT} bytes"));
        }
        found
    }

    /// Finishes the stream; returns the remaining statements.
    ///
    /// # Errors
    /// [`SyntaxError`], possibly after statements that were returned before.
    pub fn finish(&mut self) -> Result<Vec<Statement>, SyntaxError> {
        let mut found = Vec::new();
        if self.error.is_none() && self.scan.is_inside() {
            self.close(self.at, &mut found);
        }
        self.error.clone().map_or(Ok(found), Err)
    }

    fn close(&mut self, until: usize, found: &mut Vec<Statement>) {
        match statements(&self.text, self.start, until, self.options) {
            Ok(read) => found.extend(read),
            Err(error) => self.error = Some(error),
        }
        self.scan = Scan::default();
    }

    fn refuse(&mut self, byte: usize, what: String) {
        self.error = Some(SyntaxError::at(&self.text, byte, what));
    }
}

impl Scan {
    fn is_inside(&self) -> bool {
        matches!(self.mode, Mode::Statement | Mode::Quoted(_))
    }

    fn step(&mut self, byte: u8) -> Event {
        match self.mode {
            Mode::Between => self.between(byte),
            Mode::Fence(ticks) => match byte {
                b'`' => {
                    self.mode = Mode::Fence(ticks + 1);
                    Event::Nothing
                }
                // Three backticks are followed by a language name; one or two only enclose the program.
                b'\n' => self.leave(),
                _ if ticks >= 3 => {
                    self.mode = Mode::FenceLine;
                    Event::Nothing
                }
                _ => self.between(byte),
            },
            Mode::FenceLine if byte == b'\n' => self.leave(),
            Mode::FenceLine => Event::Nothing,
            Mode::Quoted(quote) => {
                if byte == quote {
                    self.mode = Mode::Statement;
                }
                Event::Nothing
            }
            Mode::Statement => self.inside(byte),
        }
    }

    fn leave(&mut self) -> Event {
        self.mode = Mode::Between;
        Event::Nothing
    }

    fn between(&mut self, byte: u8) -> Event {
        match byte {
            b'`' => self.mode = Mode::Fence(1),
            b' ' | b'\t' | b'\r' | b'\n' | b';' => self.mode = Mode::Between,
            _ => {
                *self = Self { mode: Mode::Statement, conditional: byte == b'?', ..Self::default() };
                // A leading bracket or quote is left for the parser to reject.
                return self.inside(byte);
            }
        }
        Event::Nothing
    }

    fn inside(&mut self, byte: u8) -> Event {
        match byte {
            b'\'' | b'"' => self.mode = Mode::Quoted(byte),
            b'{' if self.braces == MAX_DEPTH => return Event::TooDeep,
            b'{' => self.braces += 1,
            b'}' => {
                self.braces = self.braces.saturating_sub(1);
                if self.braces == 0 {
                    return Event::Ends;
                }
            }
            b'(' => self.parentheses += 1,
            b')' => {
                self.parentheses = self.parentheses.saturating_sub(1);
                if self.parentheses == 0 && self.braces == 0 && !self.conditional {
                    return Event::Ends;
                }
            }
            b';' if self.braces == 0 => return Event::Ends,
            // A code fence after the program.
            b'`' if self.braces == 0 => return Event::Ended,
            _ => {}
        }
        Event::Nothing
    }
}

/// Parses a complete program.
///
/// # Errors
/// [`SyntaxError`] with its position.
pub fn parse_program(text: &str, precedence: Precedence) -> Result<Vec<Statement>, SyntaxError> {
    let mut stream = ProgramStream::new(precedence);
    let mut found = stream.push(text);
    found.extend(stream.finish()?);
    Ok(found)
}

/// Parses the body of a skill, in which `$1` is its first argument.
///
/// # Errors
/// [`SyntaxError`] with its position.
pub fn parse_body(text: &str) -> Result<Block, SyntaxError> {
    let options = ParseOptions { precedence: Precedence::Published, parameters: true };
    let mut stream = ProgramStream { options, ..ProgramStream::default() };
    let mut found = stream.push(text);
    found.extend(stream.finish()?);
    Ok(found.into())
}
