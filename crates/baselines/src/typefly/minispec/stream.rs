//! Programs that are still arriving: a statement can be run as soon as its end is there.
//!
//! A machine over bytes that never looks ahead of what has arrived finds where statements end; so how a program is cut into chunks
//! cannot change what is read from it.

use super::parse::{MAX_DEPTH, Manner, Precedence, SyntaxError, statements};
use super::{Block, Statement};

/// Longest program that is read, bytes.
pub const MAX_TEXT: usize = 16 * 1024;

/// A program that is still arriving.
#[derive(Clone, Debug, Default)]
pub struct ProgramStream {
    manner: Manner,
    text: String,
    at: usize,
    /// Where the statement begins that is being read.
    start: usize,
    scan: Scan,
    error: Option<SyntaxError>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Mode {
    /// Before a statement.
    #[default]
    Between,
    /// In a run of this many backticks before a statement.
    Fence(usize),
    /// In the rest of a line that began with a fence.
    FenceLine,
    Statement,
    Quoted(u8),
}

#[derive(Clone, Copy, Debug, Default)]
struct Scan {
    mode: Mode,
    braces: usize,
    parentheses: usize,
    /// The statement begins with `?`: a parenthesis in it closes a call and not the statement.
    conditional: bool,
}

/// What a byte did.
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
    /// A program of which nothing has arrived.
    #[must_use]
    pub fn new(precedence: Precedence) -> Self {
        Self { manner: Manner { precedence, parameters: false }, ..Self::default() }
    }

    /// What has arrived so far.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Why nothing more is read; the statements before were right.
    #[must_use]
    pub fn error(&self) -> Option<&SyntaxError> {
        self.error.as_ref()
    }

    /// Takes what has newly arrived and gives the statements that it completed.
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

    /// Everything has arrived: gives what was still open.
    ///
    /// # Errors
    /// [`SyntaxError`], which may stand behind statements that were given before.
    pub fn finish(&mut self) -> Result<Vec<Statement>, SyntaxError> {
        let mut found = Vec::new();
        if self.error.is_none() && self.scan.is_inside() {
            self.close(self.at, &mut found);
        }
        self.error.clone().map_or(Ok(found), Err)
    }

    fn close(&mut self, until: usize, found: &mut Vec<Statement>) {
        match statements(&self.text, self.start, until, self.manner) {
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
                // Behind three the language is named; one or two only hold the program.
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
                // A bracket or quote may come first; what it means is for the parser to refuse.
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
            // A fence behind the program.
            b'`' if self.braces == 0 => return Event::Ended,
            _ => {}
        }
        Event::Nothing
    }
}

/// Reads a whole program.
///
/// # Errors
/// [`SyntaxError`] with its place.
pub fn parse_program(text: &str, precedence: Precedence) -> Result<Vec<Statement>, SyntaxError> {
    let mut stream = ProgramStream::new(precedence);
    let mut found = stream.push(text);
    found.extend(stream.finish()?);
    Ok(found)
}

/// Reads the body of a skill, in which `$1` stands for its first argument.
///
/// # Errors
/// [`SyntaxError`] with its place.
pub fn parse_body(text: &str) -> Result<Block, SyntaxError> {
    let manner = Manner { precedence: Precedence::Published, parameters: true };
    let mut stream = ProgramStream { manner, ..ProgramStream::default() };
    let mut found = stream.push(text);
    found.extend(stream.finish()?);
    Ok(found.into())
}
