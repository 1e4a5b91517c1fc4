//! Creates a pilot from a flight's head and a policy; shared by flight and replay, so that both use the same pilot.

use std::sync::Arc;

use spf_core::craft::Craft;
use spf_core::prompt::{PromptKind, PromptText};
use spf_follow::follower::StayWith;
use spf_pilot::policy::Policy;
use spf_pilot::steering::Steering;
use spf_pilot::{Pilot, PilotParts, PilotSettings};
use spf_vlm::ImageSpec;

use crate::log::FlightHeader;

/// The inputs from which a policy is created.
#[derive(Clone)]
pub struct PolicyParts {
    /// Pilot settings.
    pub settings: PilotSettings,
    /// Craft parameters.
    pub craft: Craft,
    /// How the VLM receives the camera's images.
    pub image_spec: ImageSpec,
    /// The prompt.
    pub prompt: Arc<PromptText>,
    /// Seed of its random choices.
    pub seed: u64,
}

/// Creates the policy of a flight.
pub trait PolicyMaker: Send + Sync {
    /// Its name, for summary and log.
    fn name(&self) -> &str;

    /// Kind of prompt it uses; the built-in one of this kind is the default, and `--prompt` takes no other. A policy that
    /// sends no query returns any kind, such as [`PromptKind::Point`].
    fn prompt(&self) -> PromptKind;

    /// Creates the policy.
    fn policy(&self, parts: PolicyParts) -> Box<dyn Policy>;
}

/// Creates the pilot for the flight with this head.
pub(crate) fn pilot(head: &FlightHeader, policy: &dyn PolicyMaker, prompt: Arc<PromptText>) -> Pilot {
    let image_spec = ImageSpec { grounding: head.grounding, image_size: head.image_size };
    let seed = head.sim.as_ref().map_or(0, |sim| sim.seed);
    Pilot::new(PilotParts {
        settings: head.settings,
        craft: head.craft,
        senses: head.senses,
        camera: head.camera,
        limits: head.limits.clone(),
        policy: policy.policy(PolicyParts { settings: head.settings, craft: head.craft, image_spec, prompt, seed }),
        steering: head.settings.keeps().map(|_| Box::<StayWith>::default() as Box<dyn Steering>),
        instruction: head.instruction.clone(),
    })
}
