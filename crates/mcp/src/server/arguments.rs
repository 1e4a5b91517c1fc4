//! What tools are given.

use rmcp::schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_flight::pointing::{Given, Side};

/// Arguments of `fly`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Fly {
    /// What to do, in plain words: "Take off and fly to the red crane". 1 to 2000 characters.
    pub(super) instruction: String,
    /// How long to wait for the end, seconds, 0 to 600; 45 if left out. The flight goes on meanwhile and afterwards.
    #[serde(default)]
    pub(super) wait_s: Option<f64>,
    /// One of `list_scenes`, for a simulated craft on the ground; that of the server if left out.
    #[serde(default)]
    pub(super) scene: Option<String>,
}

/// Arguments of `wait_flight`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WaitFlight {
    /// The flight, as `fly` has named it; the one under way, or the last one, if left out.
    #[serde(default)]
    pub(super) flight_id: Option<String>,
    /// How long to wait, seconds, 0 to 600; 45 if left out.
    #[serde(default)]
    pub(super) wait_s: Option<f64>,
}

/// Arguments of `get_flight`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GetFlight {
    /// The flight, as `list_flights` has named it.
    pub(super) flight_id: String,
}

/// Arguments of `take_off`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TakeOff {
    /// One of `list_scenes`, for a simulated craft; that of the server if left out.
    #[serde(default)]
    pub(super) scene: Option<String>,
}

/// Arguments of `point`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Point {
    /// From the left edge of the picture, 0, to the right one, 1.
    #[serde(default)]
    pub(super) u: Option<f64>,
    /// From the top edge of the picture, 0, to the bottom one, 1.
    #[serde(default)]
    pub(super) v: Option<f64>,
    /// How far the step leads, a whole number from 1 to 10: `steps_m` of `look` has the metres. Keep it shorter than the distance.
    #[serde(default)]
    pub(super) depth: Option<u8>,
    /// Instead of u, v and depth: turn to what is not in the picture, or climb (up) or descend (down) a little.
    #[serde(default)]
    pub(super) look: Option<Side>,
    /// The frame of `look` that this is about; the newest one if left out.
    #[serde(default)]
    pub(super) frame: Option<u64>,
}

impl Point {
    /// What is given about a frame.
    pub(super) fn given(&self) -> Result<Box<dyn FnOnce(u64) -> Given + Send>, String> {
        match (self.u, self.v, self.depth, self.look) {
            (Some(u), Some(v), Some(depth), None) => {
                if !((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v) && (1..=10).contains(&depth)) {
                    return Err(
                        "u and v are fractions of the picture, from 0 to 1, and depth is a whole number from 1 to 10".to_owned()
                    );
                }
                Ok(Box::new(move |frame| Given::point(u, v, depth, frame)))
            }
            (None, None, None, Some(side)) => Ok(Box::new(move |_| Given::look(side))),
            _ => Err("give u, v and depth to fly to a point, or look alone to turn".to_owned()),
        }
    }
}

/// No arguments.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Nothing {}

/// Arguments of the prompts.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct What {
    /// What: "the red crane", or places separated by commas.
    pub(super) what: String,
}
