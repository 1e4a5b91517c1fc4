//! Recursive descent parser from the text of complete statements to [`Statement`]s.

use super::{Block, Call, Comparator, Comparison, Condition, Expression, Operand, Statement, Value};

/// Maximum nesting of blocks.
pub(super) const MAX_DEPTH: usize = 16;

/// Precedence of `&` and `|`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precedence {
    /// `|`: `a|b&c` is `(a|b)&c`, as in the published interpreter.
    #[default]
    Published,
    /// `&` binds tighter, as in most languages.
    Ordinary,
}

/// A syntax error.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {what}")]
pub struct SyntaxError {
    /// Line of the text, from 1.
    pub line: usize,
    /// Character of the line, from 1.
    pub column: usize,
    /// The problem.
    pub what: String,
}

impl SyntaxError {
    /// The error at a byte position of a text.
    pub(super) fn at(text: &str, byte: usize, what: impl Into<String>) -> Self {
        let before = &text[..text.floor_char_boundary(byte)];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        Self { line, column, what: what.into() }
    }
}

/// Parser options.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ParseOptions {
    pub(super) precedence: Precedence,
    /// Whether `$1` is allowed: in the body of a skill.
    pub(super) parameters: bool,
}

/// Parses all statements of `text[from..until]`.
pub(super) fn statements(text: &str, from: usize, until: usize, options: ParseOptions) -> Result<Vec<Statement>, SyntaxError> {
    let mut reader = Reader { text: &text[..until], at: from, options };
    reader.program(0)
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
    options: ParseOptions,
}

/// Characters that end a bare token.
const DELIMITERS: &str = ",;(){}&|=<>!?'\"\n";

impl Reader<'_> {
    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn space(&mut self) {
        while self.peek().is_some_and(char::is_whitespace) {
            self.at += self.peek().map_or(0, char::len_utf8);
        }
    }

    /// Consumes `mark` if it comes next, after white space.
    fn take(&mut self, mark: &str) -> bool {
        self.space();
        let found = self.text[self.at..].starts_with(mark);
        if found {
            self.at += mark.len();
        }
        found
    }

    fn expect(&mut self, mark: &str) -> Result<(), SyntaxError> {
        if self.take(mark) { Ok(()) } else { Err(self.unexpected(&format!("`{mark}`"))) }
    }

    fn unexpected(&self, wanted: &str) -> SyntaxError {
        let found = self.peek().map_or_else(|| "the end".to_owned(), |c| format!("`{}`", c.escape_debug()));
        SyntaxError::at(self.text, self.at, format!("expected {wanted}, found {found}"))
    }

    /// Statements up to a `}` or the end, which is not consumed.
    fn program(&mut self, depth: usize) -> Result<Vec<Statement>, SyntaxError> {
        if depth > MAX_DEPTH {
            return Err(SyntaxError::at(self.text, self.at, format!("blocks are nested more than {MAX_DEPTH} deep")));
        }
        let mut found = Vec::new();
        loop {
            while self.take(";") {}
            match self.peek() {
                None => return Ok(found),
                Some('}') if depth > 0 => return Ok(found),
                Some(_) => found.push(self.statement(depth)?),
            }
        }
    }

    fn block(&mut self, depth: usize) -> Result<Block, SyntaxError> {
        self.expect("{")?;
        let body = self.program(depth + 1)?;
        self.expect("}")?;
        Ok(body.into())
    }

    fn statement(&mut self, depth: usize) -> Result<Statement, SyntaxError> {
        if self.take("?") {
            let condition = self.condition()?;
            return Ok(Statement::If { condition, body: self.block(depth)? });
        }
        if self.take("->") {
            let value = self.operand()?;
            return self.end_simple(Statement::Return(value));
        }
        if self.peek().is_some_and(|c| c.is_ascii_digit()) {
            let count = self.whole()?;
            return Ok(Statement::Loop { count, body: self.block(depth)? });
        }
        let begins = self.at;
        if let Some(variable) = self.numbered('_')? {
            if self.take("=") && !self.text[self.at..].starts_with('=') {
                let value = self.expression()?;
                return self.end_simple(Statement::Assign { variable, value });
            }
            return Err(SyntaxError::at(self.text, begins, "a variable alone is not a statement; `_1=…` assigns it"));
        }
        let call = self.call()?;
        self.end_simple(Statement::Call(call))
    }

    /// A simple statement ends with `;`, before a `}`, at the end, or with the parenthesis of a call.
    fn end_simple(&mut self, statement: Statement) -> Result<Statement, SyntaxError> {
        let closed = self.text[..self.at].ends_with(')');
        let ends = self.take(";") || closed || matches!(self.peek(), None | Some('}'));
        if ends { Ok(statement) } else { Err(self.unexpected("`;`")) }
    }

    fn whole(&mut self) -> Result<u32, SyntaxError> {
        let begins = self.at;
        while self.peek().is_some_and(|c| c.is_ascii_digit()) {
            self.at += 1;
        }
        let digits = &self.text[begins..self.at];
        digits.parse().map_err(|_| SyntaxError::at(self.text, begins, format!("`{digits}` is not a number up to {}", u32::MAX)))
    }

    /// `_1` or `$1`: a mark followed directly by a number.
    fn numbered(&mut self, mark: char) -> Result<Option<u32>, SyntaxError> {
        self.space();
        let rest = &self.text[self.at..];
        let Some(digits) = rest.strip_prefix(mark) else { return Ok(None) };
        let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        let bare_ends = digits[end..].chars().next().is_none_or(|c| DELIMITERS.contains(c) || c.is_whitespace());
        if end == 0 || !bare_ends {
            return Ok(None);
        }
        self.at += 1;
        self.whole().map(Some)
    }

    fn operand(&mut self) -> Result<Operand, SyntaxError> {
        if let Some(variable) = self.numbered('_')? {
            return Ok(Operand::Variable(variable));
        }
        let begins = self.at;
        if let Some(parameter) = self.numbered('$')? {
            if self.options.parameters && parameter > 0 {
                return Ok(Operand::Parameter(parameter));
            }
            return Err(SyntaxError::at(self.text, begins, "`$` is only valid in the body of a skill, and counts from 1"));
        }
        if let Some(quote @ ('\'' | '"')) = self.peek() {
            self.at += 1;
            let Some(end) = self.text[self.at..].find(quote) else {
                return Err(SyntaxError::at(self.text, begins, "the quote is not closed"));
            };
            let text = self.text[self.at..self.at + end].to_owned();
            self.at += end + 1;
            return Ok(Operand::Value(Value::Text(text)));
        }
        let token = self.token();
        if token.is_empty() {
            return Err(self.unexpected("a value"));
        }
        Ok(Operand::Value(Value::of_token(token)))
    }

    /// A bare token, trimmed; empty if there is none.
    fn token(&mut self) -> &str {
        self.space();
        let rest = &self.text[self.at..];
        let end = rest.find(|c| DELIMITERS.contains(c)).unwrap_or(rest.len());
        self.at += end;
        rest[..end].trim_end()
    }

    /// A value or a call.
    fn expression(&mut self) -> Result<Expression, SyntaxError> {
        let begins = self.at;
        let operand = self.operand()?;
        let Operand::Value(Value::Text(_)) = &operand else { return Ok(Expression::Operand(operand)) };
        let quoted = self.text[begins..self.at].trim_start().starts_with(['\'', '"']);
        if quoted || !matches!(self.peek(), Some(',' | '(')) && !is_name(self.text[begins..self.at].trim()) {
            return Ok(Expression::Operand(operand));
        }
        // A bare word may be a string or a skill without arguments, which the interpreter decides.
        self.at = begins;
        self.call().map(Expression::Call)
    }

    fn call(&mut self) -> Result<Call, SyntaxError> {
        self.space();
        let begins = self.at;
        let name = self.token().to_owned();
        if !is_name(&name) {
            self.at = begins;
            return Err(self.unexpected("a statement"));
        }
        let mut arguments = Vec::new();
        if self.take("(") {
            if !self.take(")") {
                loop {
                    arguments.push(self.operand()?);
                    if !self.take(",") {
                        break;
                    }
                }
                self.expect(")")?;
            }
        } else {
            while self.take(",") {
                arguments.push(self.operand()?);
            }
        }
        Ok(Call { name, arguments })
    }

    fn condition(&mut self) -> Result<Condition, SyntaxError> {
        let mut comparisons = vec![self.comparison()?];
        let mut joints = Vec::new();
        loop {
            self.space();
            let Some(joint @ ('&' | '|')) = self.peek() else { break };
            // `&&` and `||` are accepted.
            while self.peek() == Some(joint) {
                self.at += 1;
            }
            joints.push(joint);
            comparisons.push(self.comparison()?);
        }
        let all_groups = self.options.precedence == Precedence::Published;
        let parts = if all_groups { '&' } else { '|' };
        let mut groups = Vec::new();
        let mut group = Vec::new();
        for (index, comparison) in comparisons.into_iter().enumerate() {
            if index > 0 && joints[index - 1] == parts {
                groups.push(core::mem::take(&mut group));
            }
            group.push(comparison);
        }
        groups.push(group);
        Ok(Condition { all_groups, groups })
    }

    fn comparison(&mut self) -> Result<Comparison, SyntaxError> {
        const MARKS: [(&str, Comparator); 6] = [
            ("==", Comparator::Equal),
            ("!=", Comparator::Unequal),
            (">=", Comparator::AtLeast),
            ("<=", Comparator::AtMost),
            (">", Comparator::Greater),
            ("<", Comparator::Less),
        ];
        let left = self.expression()?;
        let comparator = MARKS.into_iter().find(|(mark, _)| self.take(mark)).map(|(_, comparator)| comparator);
        Ok(match comparator {
            Some(comparator) => Comparison { left, comparator, right: self.expression()? },
            None => {
                Comparison { left, comparator: Comparator::Equal, right: Expression::Operand(Operand::Value(Value::Bool(true))) }
            }
        })
    }
}

/// Letters, digits and underscores, starting with a letter.
fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_alphabetic()) && word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
}
