//! The fence of the autopilot: read at connect, and replaced by ours on request.

use spf_core::time::Time;
use spf_mavlink::command::{VehicleCommand, ids};
use spf_mavlink::fence::{FenceError, FenceItem, are_same, shapes};
use spf_mavlink::modes::Autopilot;

use super::Vehicle;

impl Vehicle {
    /// Reads the fence, once it is known that there may be one.
    pub(super) fn read_fence(&mut self, now: Time) {
        if self.facts.takes_fence && self.facts.fence.is_none() && !self.fence.is_busy() {
            self.fence.download(now);
        }
    }

    /// Begins to replace the fence; [`fence_sent`](Self::fence_sent) tells the result.
    pub fn send_fence(&mut self, now: Time, fence: Vec<FenceItem>) {
        (self.sent_fence, self.facts.fence, self.facts.fence_items) = (None, None, None);
        self.fence.upload(now, fence);
    }

    /// The result of sending a fence, once it has one. A fence that was accepted is read back then.
    pub fn fence_sent(&mut self) -> Option<Result<(), FenceError>> {
        self.sent_fence
    }

    /// Whether the fence that was read is this one.
    #[must_use]
    pub fn has_fence(&self, fence: &[FenceItem]) -> Option<bool> {
        self.facts.fence_items.as_ref().map(|read| are_same(read, fence))
    }

    /// Puts the fence in force, or out of force, where that is a step of its own.
    pub fn enable_fence(&mut self, on: bool) {
        if self.autopilot == Autopilot::ArduPilot {
            self.commands.submit(VehicleCommand::new(ids::FENCE_ENABLE, &[f32::from(u8::from(on))]));
        }
    }

    pub(super) fn follow_fence(&mut self, now: Time) {
        match self.fence.take_result() {
            None => {}
            Some(Ok(Some(read))) => {
                self.facts.fence = shapes(&read).or(Some(Vec::new()));
                self.facts.fence_items = Some(read);
            }
            Some(Ok(None)) => {
                self.sent_fence = Some(Ok(()));
                self.fence.download(now);
            }
            // A fence that could not be read stays unknown.
            Some(Err(error)) => self.sent_fence = Some(Err(error)),
        }
    }
}
