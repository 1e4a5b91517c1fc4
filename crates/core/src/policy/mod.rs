//! Policies: state machines that turn frames and replies into steps.
//!
//! A policy never moves anything. It answers each event with one [`Step`]; the pilot carries the step out through executor and
//! envelope, whatever the policy is, so that methods differ only in how they see and decide.

pub mod search;
pub mod spf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::avoid::Avoidance;
use crate::camera::Camera;
use crate::frame::FrameMeta;
use crate::geometry::{BodyDisplacement, Pose};
use crate::primitives::Primitives;
use crate::query::{ImagePoint, Query, QueryId};
use crate::reply::Reply;

/// A frame with what the pilot knows about the moment of its capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The frame.
    pub frame: FrameMeta,
    /// The camera that took it.
    pub camera: Camera,
    /// The craft's pose at capture, as known.
    pub pose: Pose,
    /// True when the craft stood still at capture.
    pub at_rest: bool,
}

/// What a policy is told.
#[derive(Clone, Debug, PartialEq)]
pub enum PolicyEvent<'a> {
    /// A (new) instruction; everything before it is void, and its queries are no longer waited for.
    Instruction(&'a str),
    /// A fresh frame, and a decision is due: no query is out, and nothing that was wanted before is still to be carried out.
    Frame(&'a View),
    /// The whole answer to a query that is still waited for.
    Reply {
        /// Which query.
        id: QueryId,
        /// The answer's text.
        text: &'a str,
    },
    /// A part of the answer to a query that is still waited for; the whole comes as [`PolicyEvent::Reply`] at the end.
    Chunk {
        /// Which query.
        id: QueryId,
        /// The new part.
        text: &'a str,
    },
    /// A query will never be answered. When the pilot itself gave it up (operator, end of the flight, too many at a time) the
    /// step returned is not carried out; the next [`PolicyEvent::Frame`] is when to go on.
    ReplyFailed {
        /// Which query.
        id: QueryId,
    },
    /// The last move has ended, by being flown or by being cut short; in the second case the step returned is not carried out.
    MoveEnded {
        /// False when something stopped it before its end.
        completed: bool,
    },
    /// The last step was carried out: is there more to do at this instant?
    Continue,
}

/// What a policy wants.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Ask a VLM. The pilot sets the query's deadline, and answers with [`PolicyEvent::ReplyFailed`] when more than 8 are out.
    Ask(Box<Query>),
    /// Move; replaces what is being flown.
    Move(Move),
    /// Hold, come to rest and look again.
    Look,
    /// Nothing now.
    Wait,
    /// The instruction is fulfilled.
    Done,
    /// The reply cannot be used; the pilot counts it and asks again.
    Reject(String),
    /// The flight cannot go on.
    Fail(FailReason),
}

/// Why a policy gives up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FailReason {
    /// Searched everywhere the search goes; the target is not there.
    NotFound,
    /// No program led to an end (TypeFly).
    NoProgram,
}

/// A motion that a policy wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// The motion, relative to `anchor`.
    pub primitives: Primitives,
    /// The known pose of the frame it was decided on; `None` moves from wherever the craft is when the move begins.
    pub anchor: Option<Pose>,
    /// True when the next frame must be one taken after the whole motion, at rest (a search turn: half a turn answers nothing).
    pub then_rest: bool,
}

/// What a policy understood of its last reply, for progress, recording and pictures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// The parsed reply of a `Point` query.
    pub reply: Option<Reply>,
    /// What was understood of any other query, in words: text actions as commands and values, numbers chosen.
    pub actions: Vec<String>,
    /// The point flown to, which differs from the reply's when the way to it was blocked.
    pub waypoint: Option<ImagePoint>,
    /// Adjusted step, metres (paper §3.2).
    pub step: Option<f64>,
    /// Displacement in the level body frame of the frame's heading (paper §3.3).
    pub displacement: Option<BodyDisplacement>,
    /// The primitives made of it (paper §3.4).
    pub primitives: Option<Primitives>,
    /// What obstacle mode did to the waypoint.
    pub avoidance: Option<Avoidance>,
    /// Why the reply was refused.
    pub refused: Option<String>,
}

/// A way of flying by language.
pub trait Policy: Send {
    /// Its name on the command line.
    fn name(&self) -> &'static str;

    /// Takes an event and answers with one step.
    fn handle(&mut self, event: PolicyEvent<'_>) -> Step;

    /// What was understood of the last reply handled.
    fn reading(&self) -> Reading;
}
