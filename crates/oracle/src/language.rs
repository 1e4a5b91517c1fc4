//! Plain words to stages and targets: the oracle's language, and the truth's.
//!
//! `lex` makes tokens, `grammar` cuts them into clauses and finds each verb, `phrase` reads the noun phrases, and `resolve`
//! says which objects a phrase means. The first three know no scene: how many stages an instruction has never depends on
//! what is in view. The words themselves are data, which `lexicon` reads.

pub(crate) mod grammar;
pub(crate) mod lex;
pub(crate) mod lexicon;
mod meaning;
mod phrase;
mod pieces;
pub(crate) mod resolve;
mod settle;
pub(crate) mod spelling;
mod table;
mod verbs;

pub use grammar::{Clause, Instruction, parse};
pub use meaning::{Relation, Side, Size, Verb};
pub use phrase::{Ordinal, Phrase};
