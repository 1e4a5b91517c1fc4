//! Plain words to stages and targets: the oracle's language, and the truth's.
//!
//! `lex` makes tokens, `grammar` cuts them into clauses and finds each verb, `phrase` reads the noun phrases, and `resolve`
//! says which objects a phrase means. The first three know no scene: how many stages an instruction has never depends on
//! what is in view.

mod grammar;
mod lex;
pub(super) mod lexicon;
mod phrase;
mod pieces;
pub(super) mod resolve;
pub(super) mod spelling;
mod vocabulary;

pub use grammar::{Clause, Instruction, Verb, parse};
pub use phrase::{Ordinal, Phrase, Relation, Side, Size};
