//! MiniSpec: the language in which a planner writes drone programs (Chen et al., arXiv 2312.14950, §4; calls with
//! parentheses and as operands are from its second version).
//!
//! ```text
//! program     = { statement } ;
//! statement   = loop | conditional | simple ";" ;
//! loop        = INT "{" program "}" ;
//! conditional = "?" condition "{" program "}" ;
//! simple      = call | VAR "=" ( call | value | VAR ) | "->" ( value | VAR ) ;
//! call        = NAME { "," arg } | NAME "(" [ arg { "," arg } ] ")" ;
//! arg         = value | VAR | PARAM ;
//! condition   = comparison { ( "&" | "|" ) comparison } ;
//! comparison  = operand [ ( ">" | "<" | "==" | "!=" | ">=" | "<=" ) operand ] ;
//! operand     = value | VAR | PARAM | call ;
//! VAR         = "_" INT ;     PARAM = "$" INT ;
//! value       = INT | FLOAT | "True" | "False" | "None" | STRING ;
//! ```
//!
//! `|` binds tighter than `&`, as in the published interpreter ([`Precedence::Published`]); a comparison without an
//! operator tests whether its operand is `True`. Extra semicolons, and a missing last one, are accepted.

mod machine;
mod parse;
mod stream;
mod value;

use std::sync::Arc;

pub use machine::{Call as SkillCall, Machine, Progress, RuntimeError, Skills};
pub use parse::{Precedence, SyntaxError};
pub use stream::{MAX_TEXT, ProgramStream, parse_body, parse_program};
pub use value::{TypeError, Value};

/// Statements in order; shared, since loops and skills repeat them.
pub type Block = Arc<[Statement]>;

/// One statement.
#[derive(Clone, Debug, PartialEq)]
pub enum Statement {
    /// A call whose value is not used.
    Call(Call),
    /// `_1=…`.
    Assign {
        /// The variable's number.
        variable: u32,
        /// Its new value.
        value: Expression,
    },
    /// `->…`: ends the program, or the skill that contains it, with a value.
    Return(Operand),
    /// `3{…}`.
    Loop {
        /// Number of repetitions.
        count: u32,
        /// The body.
        body: Block,
    },
    /// `?…{…}`.
    If {
        /// The condition.
        condition: Condition,
        /// The body.
        body: Block,
    },
}

/// A call of a skill.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// The skill's name or abbreviation, as written.
    pub name: String,
    /// Its arguments.
    pub arguments: Vec<Operand>,
}

/// A value available without a call.
#[derive(Clone, Debug, PartialEq)]
pub enum Operand {
    /// A literal.
    Value(Value),
    /// `_1`.
    Variable(u32),
    /// `$1`: an argument of the enclosing skill.
    Parameter(u32),
}

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    /// An operand.
    Operand(Operand),
    /// A call.
    Call(Call),
}

/// A comparison operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparator {
    /// `>`.
    Greater,
    /// `<`.
    Less,
    /// `>=`.
    AtLeast,
    /// `<=`.
    AtMost,
    /// `==`.
    Equal,
    /// `!=`.
    Unequal,
}

/// One comparison of a condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Left operand.
    pub left: Expression,
    /// Operator.
    pub comparator: Comparator,
    /// Right operand.
    pub right: Expression,
}

/// A condition: comparisons in groups.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// True: all groups must hold, each by any of its comparisons. False: any group must hold, by all of its
    /// comparisons.
    pub all_groups: bool,
    /// The groups, in the order written.
    pub groups: Vec<Vec<Comparison>>,
}

impl Condition {
    /// Its calls, in the order written. All are made before comparing.
    pub(super) fn calls(&self) -> impl Iterator<Item = &Call> {
        let sides = self.groups.iter().flatten().flat_map(|comparison| [&comparison.left, &comparison.right]);
        sides.filter_map(|side| match side {
            Expression::Call(call) => Some(call),
            Expression::Operand(_) => None,
        })
    }
}

#[cfg(test)]
mod tests;
