//! The method's own functions.

use pyo3::prelude::*;
use spf_api::error::Error;
use spf_api::point::{LiftSettings, Lifted, PromptSettings, grounding};
use spf_core::camera::Camera;
use spf_core::lift::Lifting;
use spf_core::query::ImagePoint;
use spf_core::step::StepRule;

use crate::convert::{craft, json};
use crate::errors::{raised, wrong};

/// Size of the image of the simulator's cameras.
const CAMERA: (u32, u32) = (960, 720);

/// Lifts a point of the image with a depth label to a displacement of the craft (paper §3.2 and §3.3, eq. 2), as a flight does.
///
/// point: (u, v), fractions of the image from its upper left corner. label: 1 to 10, which need not be whole.
/// craft: whose camera it is, quad or tello. camera: (width, height, horizontal and vertical field of view in degrees) in its place, and
/// tilt_deg its tilt below the horizon. pitch_deg and roll_deg: attitude of the craft, nose up and right side down positive.
/// fixed_step_m: a step length in metres for every label, in the place of the paper's curve. levelled: False to leave out tilt and
/// attitude, as in the paper.
///
/// Returns a dict: step_m, right_m, forward_m, up_m (level body frame), and yaw_deg (clockwise), distance_m, climb_m (the primitives).
/// Raises spf.UsageError for a point outside the image.
#[pyfunction]
#[pyo3(signature = (
    point, label, *, craft = "quad", camera = None, tilt_deg = 0.0, pitch_deg = 0.0, roll_deg = 0.0, fixed_step_m = None, levelled = true
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn lift<'py>(
    py: Python<'py>,
    point: (f64, f64),
    label: f64,
    craft: &str,
    camera: Option<(u32, u32, f64, f64)>,
    tilt_deg: f64,
    pitch_deg: f64,
    roll_deg: f64,
    fixed_step_m: Option<f64>,
    levelled: bool,
) -> PyResult<Bound<'py, PyAny>> {
    if !(1.0..=10.0).contains(&label) {
        return Err(wrong(py, format!("a depth label is from 1 to 10, not {label}"), "label=5"));
    }
    let kind = self::craft(py, Some(craft))?.unwrap_or_default();
    let (mut settings, (u, v)) = (LiftSettings { camera: kind.camera(), ..LiftSettings::default() }, point);
    if let Some((width, height, across, down)) = camera {
        let has_field = |degrees: f64| degrees > 0.0 && degrees < 180.0;
        if width == 0 || height == 0 || !has_field(across) || !has_field(down) || !tilt_deg.is_finite() {
            let hint = "camera=(960, 720, 82.6, 66.9): width, height, and the fields of view in degrees";
            return Err(wrong(py, "there is no such camera", hint));
        }
        settings.camera = Camera::from_fov(width, height, across.to_radians(), down.to_radians(), tilt_deg.to_radians());
    }
    (settings.attitude.pitch, settings.attitude.roll) = (pitch_deg.to_radians(), roll_deg.to_radians());
    if let Some(metres) = fixed_step_m {
        settings.step = StepRule::Fixed(metres);
    }
    if !levelled {
        settings.lifting = Lifting::Paper;
    }
    let lifted = spf_api::point::lift(ImagePoint { u, v }, label, &settings)
        .map_err(|error| raised(py, &Error::usage("the point leads nowhere").because(&error)))?;
    leads(py, &lifted)
}

/// Where a point leads, as a dict.
pub(crate) fn leads<'py>(py: Python<'py>, lifted: &Lifted) -> PyResult<Bound<'py, PyAny>> {
    let (displacement, primitives) = (lifted.displacement, lifted.primitives);
    json(
        py,
        &serde_json::json!({
            "step_m": lifted.step_m,
            "right_m": displacement.right,
            "forward_m": displacement.forward,
            "up_m": displacement.up,
            "yaw_deg": primitives.yaw.to_degrees(),
            "distance_m": primitives.forward,
            "climb_m": primitives.climb,
        }),
    )
}

/// Reads the reply of a VLM, as a flight does: text around the JSON, single quotes, trailing commas and other slips are read.
///
/// family: whose coordinates it has, a name as of `--vlm`: gemini, or oracle, whose coordinates are the same.
/// size: width and height of the image as sent, for families that count pixels; 960 × 720 by default. avoid: whether it must list obstacles.
///
/// Returns a dict with the fields of docs/reference/reply.md, points and boxes in fractions of the image.
/// Raises spf.UsageError with the reason for which a flight would ignore the reply.
#[pyfunction]
#[pyo3(signature = (text, *, family = "oracle", size = None, avoid = false))]
pub(crate) fn parse_reply<'py>(
    py: Python<'py>,
    text: &str,
    family: &str,
    size: Option<(u32, u32)>,
    avoid: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let read = grounding(family, size.unwrap_or(CAMERA)).and_then(|profile| spf_api::point::parse_reply(text, &profile, avoid));
    json(py, &read.map_err(|error| raised(py, &error))?)
}

/// The prompt of a query without a history; a flight adds what it has flown, from its height on.
///
/// family and size: as of spf.parse_reply. avoid: whether obstacles are asked for. near_m: distance from the target at which the
/// instruction counts as fulfilled. keep_m: distance that the craft keeps by itself from somebody whom it follows. field_deg: the
/// horizontal and vertical field of view of the image. horizon: where in the middle of the image the horizon is, as a fraction of its height
/// from the top. What is None is not mentioned.
#[pyfunction]
#[pyo3(signature = (
    instruction, *, family = "oracle", size = None, avoid = false, near_m = None, keep_m = None, field_deg = None, horizon = None
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn prompt(
    py: Python<'_>,
    instruction: &str,
    family: &str,
    size: Option<(u32, u32)>,
    avoid: bool,
    near_m: Option<f64>,
    keep_m: Option<f64>,
    field_deg: Option<(f64, f64)>,
    horizon: Option<f64>,
) -> PyResult<String> {
    let profile = grounding(family, size.unwrap_or(CAMERA)).map_err(|error| raised(py, &error))?;
    let field_deg = field_deg.map(|(across, down)| [across, down]);
    Ok(spf_api::point::prompt(instruction, &PromptSettings { profile, avoid, near_m, keep_m, field_deg, horizon }))
}
