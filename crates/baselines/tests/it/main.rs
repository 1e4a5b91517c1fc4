//! The baselines fly through the same pilot, executor and envelope as the method.

mod flight;
mod pivot;
mod plain;
mod typefly;
