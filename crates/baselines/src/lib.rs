//! Other people's methods of flying by language, which See, Point, Fly is compared with (docs/explanation/baselines.md).
//!
//! Each is a [`Policy`](spf_core::policy::Policy) like the method itself: a state machine that is told of frames and answers, so
//! that pilot, executor, envelope and judge are the same for all. [`Pivot`](pivot::Pivot) chooses among arrows drawn on the
//! image, [`TypeFly`](typefly::TypeFly) runs programs that a planner writes from a list of detections, and
//! [`Plain`](plain::Plain) flies moves in words and numbers. As the core, this crate does no I/O and reads no clock.
//!
//! What a query of theirs asks for and the forms of its answer (choices, text actions, lists of detections) stand in the core:
//! whoever answers has to know them too.
#![forbid(unsafe_code)]

pub mod pivot;
pub mod plain;
pub mod typefly;
