//! MiniSpec: the small language in which a planner writes programs for a drone (Chen et al., arXiv 2312.14950, §4; the calls in
//! parentheses and as operands are those of its second version).
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
//! `|` binds tighter than `&`, as in the published interpreter ([`Precedence::Published`]); a comparison without an operator asks
//! whether its operand is `True`. A `;` too many is forgiven, and so is the last one that is missing.

mod machine;
mod parse;
mod stream;
mod value;

use std::sync::Arc;

pub use machine::{Call as SkillCall, Machine, Progress, RuntimeError, Skills};
pub use parse::{Precedence, SyntaxError};
pub use stream::{MAX_TEXT, ProgramStream, parse_body, parse_program};
pub use value::{TypeError, Value};

/// Statements in order; shared, for loops and skills run the same ones again.
pub type Block = Arc<[Statement]>;

/// One statement.
#[derive(Clone, Debug, PartialEq)]
pub enum Statement {
    /// A call whose value nobody wants.
    Call(Call),
    /// `_1=…`.
    Assign {
        /// The variable's number.
        variable: u32,
        /// What it becomes.
        value: Expression,
    },
    /// `->…`: ends the program, or the skill that it stands in, with a value.
    Return(Operand),
    /// `3{…}`.
    Loop {
        /// Times.
        count: u32,
        /// What is done.
        body: Block,
    },
    /// `?…{…}`.
    If {
        /// When.
        condition: Condition,
        /// What is done then.
        body: Block,
    },
}

/// A call of a skill.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// The skill's name or abbreviation, as it was written.
    pub name: String,
    /// What it is given.
    pub arguments: Vec<Operand>,
}

/// What has a value without a call.
#[derive(Clone, Debug, PartialEq)]
pub enum Operand {
    /// Itself.
    Value(Value),
    /// `_1`.
    Variable(u32),
    /// `$1`: an argument of the skill whose body this is.
    Parameter(u32),
}

/// What has a value.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    /// At once.
    Operand(Operand),
    /// After a call.
    Call(Call),
}

/// How two values are compared.
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
    /// What is compared.
    pub left: Expression,
    /// How.
    pub comparator: Comparator,
    /// With what.
    pub right: Expression,
}

/// Comparisons in groups.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// True: all groups must hold, each by any of its comparisons. False: any group, by all of its comparisons.
    pub all_groups: bool,
    /// The groups, in the order written.
    pub groups: Vec<Vec<Comparison>>,
}

impl Condition {
    /// The calls in it, in the order written. All are made before the comparing.
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
