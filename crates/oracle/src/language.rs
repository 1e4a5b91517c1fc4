//! Instruction language: from plain words to stages and targets, shared by the oracle and the ground truth.
//!
//! `lex` creates tokens, `grammar` splits them into clauses with a verb each, `phrase` parses noun phrases, `settle`
//! corrects their spelling against the words of the scene, and `resolve` determines which objects a phrase means. All but
//! the last are independent of the objects in view, so the number of stages never depends on them. The vocabulary is
//! data, loaded by `lexicon`.

mod compounds;
pub(crate) mod grammar;
pub(crate) mod item;
pub(crate) mod lex;
pub(crate) mod lexicon;
pub(crate) mod manner;
mod meaning;
mod motion;
pub(crate) mod order;
mod phrase;
pub(crate) mod pieces;
mod relations;
pub(crate) mod resolve;
pub(crate) mod score;
mod settle;
pub(crate) mod spelling;
pub(crate) mod table;
mod times;
pub(crate) mod told;
pub(crate) mod turns;
mod verbs;

pub(crate) use grammar::parse_rest;
pub use grammar::{Clause, Instruction, parse};
pub use meaning::{Order, Relation, Side, Size, Verb};
pub use phrase::{Ordinal, Phrase};
pub(crate) use verbs::{demands, is_other_order};
