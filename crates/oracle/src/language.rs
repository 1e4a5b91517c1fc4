//! Plain words to stages and targets: the oracle's language, and the truth's.
//!
//! `lex` makes tokens, `grammar` cuts them into clauses and finds each verb, `phrase` reads the noun phrases, and `settle` puts
//! their words right by those of the scene; `resolve` says which objects a phrase means. Up to there no object is known: how many
//! stages an instruction has never depends on what is in view. The words themselves are data, which `lexicon` reads.

mod compounds;
pub(crate) mod grammar;
pub(crate) mod item;
pub(crate) mod lex;
pub(crate) mod lexicon;
mod meaning;
mod motion;
pub(crate) mod order;
mod phrase;
mod pieces;
mod relations;
pub(crate) mod resolve;
pub(crate) mod score;
mod settle;
pub(crate) mod spelling;
pub(crate) mod table;
mod turns;
mod verbs;

pub use grammar::{Clause, Instruction, parse};
pub use meaning::{Order, Relation, Side, Size, Verb};
pub use phrase::{Ordinal, Phrase};
