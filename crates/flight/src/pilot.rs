//! A pilot is made of what a flight's head says and a policy; in one place, so that a flight and its replay fly the same one.

use std::sync::Arc;

use spf_core::craft::Craft;
use spf_core::pilot::{Pilot, PilotParts, PilotSettings};
use spf_core::policy::Policy;
use spf_core::prompt::{PromptKind, PromptText};
use spf_vlm::Eyesight;

use crate::log::Head;

/// What a policy is told of the flight that it is to decide.
#[derive(Clone)]
pub struct PolicyParts {
    /// How it is flown.
    pub settings: PilotSettings,
    /// What is flown.
    pub craft: Craft,
    /// How who points sees the camera's images.
    pub eyesight: Eyesight,
    /// What who points is told.
    pub prompt: Arc<PromptText>,
    /// The seed of what is drawn by chance.
    pub seed: u64,
}

/// Makes a policy for a flight.
pub trait PolicyMaker: Send + Sync {
    /// Its name, for summary and log.
    fn name(&self) -> &str;

    /// Which prompts it takes; the shipped one of this kind is used where a plan names none.
    fn prompt(&self) -> PromptKind;

    /// The policy.
    fn policy(&self, parts: PolicyParts) -> Box<dyn Policy>;
}

/// The pilot of the flight with this head.
pub(crate) fn pilot(head: &Head, policy: &dyn PolicyMaker, prompt: Arc<PromptText>) -> Pilot {
    let eyesight = Eyesight { grounding: head.grounding, image_size: head.image_size };
    let seed = head.sim.as_ref().map_or(0, |sim| sim.seed);
    Pilot::new(PilotParts {
        settings: head.settings,
        craft: head.craft,
        senses: head.senses,
        camera: head.camera,
        limits: head.limits.clone(),
        policy: policy.policy(PolicyParts { settings: head.settings, craft: head.craft, eyesight, prompt, seed }),
        instruction: head.instruction.clone(),
    })
}
