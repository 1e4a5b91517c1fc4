//! The method's own functions: the prompt that asks for a point, the reply that gives it, and the displacement that it becomes. The same
//! values as in a flight.

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, BodyDisplacement};
use spf_core::grounding::GroundingProfile;
use spf_core::lift::{Lifting, UnprojectError, unproject};
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptInput, point_prompt};
use spf_core::query::{ImagePoint, Memory};
use spf_core::reply::Reply;
use spf_core::step::StepRule;
use spf_vlm::table::Table;
use spf_vlm::today;

use crate::error::Error;
use crate::vlm::{NAMES, refused};

/// Where a point leads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lifted {
    /// Step along the optical axis, metres: the paper's `d_adj` (§3.2).
    pub step_m: f64,
    /// Displacement in the level body frame, metres to the right, forward and up (§3.3, eq. 2).
    pub displacement: BodyDisplacement,
    /// The same as primitives: a turn, radians clockwise, then metres forward and up (§3.4).
    pub primitives: Primitives,
}

/// How a point is lifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiftSettings {
    /// The camera.
    pub camera: Camera,
    /// Attitude of the craft when the frame was captured; only pitch and roll count.
    pub attitude: Attitude,
    /// The rule of step lengths.
    pub step: StepRule,
    /// Whether tilt and attitude are taken into account.
    pub lifting: Lifting,
}

impl Default for LiftSettings {
    /// The simulator's `quad` in level flight, with the paper's step rule.
    fn default() -> Self {
        let (step, lifting) = (StepRule::PAPER, Lifting::Levelled);
        Self { camera: Camera::quad(), attitude: Attitude::default(), step, lifting }
    }
}

/// Lifts a point of the image with a depth label, 1 to 10, which need not be whole. `point` is in fractions of the image from its upper
/// left corner.
///
/// ```
/// use spf_api::point::{LiftSettings, lift};
/// use spf_core::query::ImagePoint;
///
/// // 10 m · (5/10)^1.8 = 2.87 m along the axis of a camera that looks 5° below the horizon.
/// let there = lift(ImagePoint { u: 0.5, v: 0.5 }, 5.0, &LiftSettings::default())?;
/// assert!((there.step_m - 2.872).abs() < 1e-3);
/// assert!((there.displacement.forward - 2.872 * 5_f64.to_radians().cos()).abs() < 1e-3);
/// # Ok::<(), spf_core::lift::UnprojectError>(())
/// ```
///
/// # Errors
/// [`UnprojectError`] for a point outside the image or beyond the lens.
pub fn lift(point: ImagePoint, label: f64, settings: &LiftSettings) -> Result<Lifted, UnprojectError> {
    let LiftSettings { camera, attitude, step, lifting } = settings;
    let step_m = step.length_of(label);
    let displacement = spf_core::lift::lift(unproject(camera, point, step_m)?, camera, *attitude, *lifting);
    Ok(Lifted { step_m, displacement, primitives: Primitives::from_displacement(displacement) })
}

/// The coordinate convention of a model by its name, as `--vlm` takes it: `gemini`, or `ollama#qwen3-vl`. The oracle has Gemini's. `sent`
/// is the size of the image as sent, for families that count pixels.
///
/// # Errors
/// A usage error for a name that is not in the table of models, with the nearest one.
pub fn grounding(name: &str, sent: (u32, u32)) -> Result<GroundingProfile, Error> {
    if name == "oracle" || name.starts_with("oracle:") {
        return Ok(GroundingProfile::default());
    }
    let table = Table::shipped();
    let choice = table.select(name, &today()).map_err(|error| refused(&table, name, &error.into(), NAMES))?;
    Ok(choice.model.grounding(sent))
}

/// Reads a reply in a model's convention; `avoid`: it must list obstacles. Forgiving as in flight: text around the JSON, single quotes,
/// trailing commas and other slips are read.
///
/// # Errors
/// A usage error with the reason for which a flight would ignore the reply.
pub fn parse_reply(text: &str, profile: &GroundingProfile, avoid: bool) -> Result<Reply, Error> {
    spf_core::reply::parse_reply(text, profile, avoid).map_err(|error| Error::usage("the reply cannot be used").because(&error))
}

/// What a prompt says besides the instruction; each is left out where it is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PromptSettings {
    /// The coordinate convention.
    pub profile: GroundingProfile,
    /// Whether obstacle boxes are asked for.
    pub avoid: bool,
    /// Distance from the target at which the instruction counts as fulfilled, metres.
    pub near_m: Option<f64>,
    /// Distance that the craft keeps by itself from somebody whom it follows, metres.
    pub keep_m: Option<f64>,
    /// Field of view of the image from left to right and from top to bottom, degrees.
    pub field_deg: Option<[f64; 2]>,
    /// Where in the middle of the image the horizon is, as a fraction of its height from the top, perhaps outside.
    pub horizon: Option<f64>,
}

/// The built-in prompt of a query without a history; a flight adds what it has flown, from its height on.
#[must_use]
pub fn prompt(instruction: &str, settings: &PromptSettings) -> String {
    let PromptSettings { profile, avoid, near_m, keep_m, field_deg, horizon } = *settings;
    let memory = Memory::default();
    point_prompt(&PromptInput { avoid, near_m, keep_m, field_deg, horizon, ..PromptInput::new(instruction, &memory, &profile) })
}
