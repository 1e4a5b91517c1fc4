//! The contents of a dataset's files: `dataset.json`, and the rows of `examples.jsonl` (docs/guide/dataset.md).

use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::sign::SignView;

use super::{Example, Kind, Target, Visible, Wording};
use spf_scene::geometry::ObjectId;

/// Version of the format.
pub const FORMAT: u32 = 1;

/// `dataset.json`: the data common to all examples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetHeader {
    /// Version of the format.
    pub format: u32,
    /// Seed of all random choices.
    pub seed: u64,
    /// Number of examples requested; an interrupted run has fewer.
    pub examples: u64,
    /// Scenes; example `n` uses the scene with index `n` modulo their number.
    pub scenes: Vec<SceneHead>,
    /// Craft model whose camera is used.
    pub drone_model: String,
    /// The camera of all images, including lens distortion.
    pub camera: Camera,
    /// Camera effects, in the syntax of `--camera-effects`.
    pub camera_effects: String,
    /// Fraction of examples whose target is not in the image.
    pub absent: f64,
    /// Fraction of examples with a look-alike.
    pub look_alikes: f64,
    /// Minimum pixels of a target, at 960×720.
    pub min_pixels: u32,
    /// Image format: `png` or `jpeg:QUALITY`.
    #[serde(rename = "pictures")]
    pub images: String,
}

/// One scene of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneHead {
    /// The name as requested.
    pub name: String,
    /// Path of its legend: every object with its tags.
    pub legend: String,
    /// Lighting.
    pub light: String,
    /// Weather.
    pub weather: String,
    /// Range at which the oracle considers a goal reached, metres.
    pub near_m: f64,
}

/// Pose of the body's centre, metres and degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedPose {
    /// Metres east.
    pub east: f64,
    /// Metres north.
    pub north: f64,
    /// Metres up.
    pub up: f64,
    /// Heading, clockwise from north.
    pub heading_deg: f64,
    /// Pitch, positive nose up.
    pub pitch_deg: f64,
    /// Roll, positive right side down.
    pub roll_deg: f64,
}

impl From<Pose> for RecordedPose {
    fn from(pose: Pose) -> Self {
        let (p, a) = (pose.position, pose.attitude);
        Self {
            east: p.east,
            north: p.north,
            up: p.up,
            heading_deg: a.heading.to_degrees(),
            pitch_deg: a.pitch.to_degrees(),
            roll_deg: a.roll.to_degrees(),
        }
    }
}

/// Paths of an example's images, relative to the dataset's folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Files {
    /// The camera image.
    #[serde(rename = "picture")]
    pub image: String,
    /// Object id per pixel: 16-bit grey PNG, 0 for none.
    pub ids: String,
    /// Depth along the optical axis: 16-bit grey PNG in centimetres, 0 for none or beyond 655 m.
    pub depth: String,
    /// The nearest opening per pixel, in the format of `ids`; null if no opening is visible.
    pub opening_ids: Option<String>,
    /// Its depth, in the format of `depth`; null as above.
    pub opening_depth: Option<String>,
    /// The target's mask: 8-bit grey PNG, 255 inside; null without a target.
    pub mask: Option<String>,
}

/// A row of `examples.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Number of the example, from 0; also its row in the file.
    pub number: u64,
    /// The scene's name, as in `dataset.json`.
    pub scene: String,
    /// Kind of the example.
    pub kind: Kind,
    /// The instruction.
    pub instruction: String,
    /// How the instruction describes its target.
    pub wording: Wording,
    /// The target; null if it is not in the image.
    pub target: Option<Target>,
    /// Ids of visible objects with the target's name but another colour or quality.
    pub look_alikes: Vec<ObjectId>,
    /// Image paths.
    #[serde(flatten)]
    pub files: Files,
    /// The scene's `near`, metres.
    pub near_m: f64,
    /// Camera pose, which the oracle never reads.
    pub pose: RecordedPose,
    /// All visible objects.
    pub visible: Vec<Visible>,
    /// What is written on objects that face the camera; only in a dataset of signs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub signs: Vec<SignView>,
    /// The hostile sign of a dataset of signs; none in the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hostile: Option<HostileSign>,
}

/// The hostile sign of an example, or what stands in its place in the clean twin.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct HostileSign {
    /// Name that both twins share.
    pub pair: String,
    /// Whether this is the clean twin.
    pub clean: bool,
    /// What the sign shows: `land`, `instruction`, `arrow` or `look_alike`.
    pub shows: String,
    /// What the sign says, or the key of what its picture looks like.
    pub says: String,
    /// Ids of the objects that the instruction means.
    pub rightful: Vec<ObjectId>,
    /// Ids of the objects to which the sign leads; for an arrow, the sign itself.
    pub lure: Vec<ObjectId>,
    /// For an arrow: whether what it leads to is left (−1) or right (1) of the sign in the image; 0 for anything else.
    pub side: i8,
}

impl Row {
    /// The row for an example.
    #[must_use]
    pub fn of(number: u64, scene: &SceneHead, example: &Example, files: Files) -> Self {
        Self {
            number,
            scene: scene.name.clone(),
            kind: example.kind,
            instruction: example.instruction.clone(),
            wording: example.wording,
            target: example.target.clone(),
            look_alikes: example.look_alikes.clone(),
            files,
            near_m: scene.near_m,
            pose: example.pose.into(),
            visible: example.visible.clone(),
            signs: Vec::new(),
            hostile: None,
        }
    }
}
