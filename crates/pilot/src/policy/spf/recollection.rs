//! What each query recalls of the flight so far, for the VLM.

use super::history::History;
use crate::policy::{Reading, View};
use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::query::{ImagePoint, Look, Memory};
use spf_core::reply::{Reply, ReplyError, Status};
use spf_core::time::Time;

/// Number of earlier targets that are recalled.
const TARGETS: usize = 8;

/// The memory of a flight, as a query carries it, and the events it is made from.
#[derive(Clone, Debug, Default)]
pub(super) struct Recollection {
    memory: Memory,
    history: History,
    /// Whether a model that leaves out the depth by habit has been asked for it.
    depth_asked: bool,
}

impl Recollection {
    /// The stage of the instruction, from 1; 0 before the first reply.
    pub(super) fn stage(&self) -> u32 {
        self.memory.stage
    }

    /// The half of the image in which the target was last pointed at.
    pub(super) fn last_seen(&self) -> Option<Look> {
        self.memory.last_seen
    }

    /// What has happened until this view.
    pub(super) fn until(&mut self, view: &View) -> Memory {
        self.history.fill(view, &mut self.memory);
        self.memory.clone()
    }

    /// Notes whether a reply could be read: what was wrong is stated until there is another reply. A missing depth is asked for
    /// once: whoever leaves it out all the same would be told so each time.
    pub(super) fn parsed(&mut self, parsed: &Result<Reply, ReplyError>) {
        self.memory.refused = match parsed {
            Ok(reply) if reply.point.is_some() && reply.label().is_none() => {
                let is_first = !core::mem::replace(&mut self.depth_asked, true);
                is_first.then(|| "lacked depth: without it the drone goes little at a time".to_owned())
            }
            Ok(_) => None,
            Err(error) => Some(format!("could not be used: it {}", error.for_the_model())),
        };
    }

    /// Notes a usable reply about a view, which arrives at this time, as the craft is at `pose`; returns whether it has gone on to another stage.
    pub(super) fn answered(&mut self, view: &View, arrived: (Time, Pose), reply: &Reply) -> bool {
        self.history.answered(view, arrived, reply, self.memory.stage);
        let is_stuck = reply.status == Status::Blocked && reply.open_way.is_none();
        self.memory.blocked = if is_stuck { self.memory.blocked + 1 } else { 0 };
        let stage = reply.stage.unwrap_or(self.memory.stage);
        core::mem::replace(&mut self.memory.stage, stage) != stage
    }

    /// Notes that a reply points at its target.
    pub(super) fn pointed(&mut self, reply: &Reply, point: ImagePoint) {
        let targets = &mut self.memory.targets;
        if let Some(target) = &reply.target
            && targets.last() != Some(target)
        {
            targets.push(target.clone());
            if targets.len() > TARGETS {
                targets.remove(0);
            }
        }
        self.memory.last_seen = Some(if point.u < 0.5 { Look::Left } else { Look::Right });
    }

    /// Notes what follows from the last reply.
    pub(super) fn planned(&mut self, camera: &Camera, reading: &Reading) {
        self.history.planned(camera, reading);
    }
}
