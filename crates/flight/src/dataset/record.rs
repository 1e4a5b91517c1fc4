//! What stands in a dataset's files: `dataset.json`, and the rows of `examples.jsonl` (docs/dataset.md).

use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;
use spf_core::geometry::Pose;

use super::{Example, Kind, Target, Visible, Wording};
use spf_scene::geometry::ObjectId;

/// Version of the format.
pub const FORMAT: u32 = 1;

/// `dataset.json`: what all examples share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// Version of the format.
    pub format: u32,
    /// Seed of everything.
    pub seed: u64,
    /// Examples that were asked for; a folder that was cut short holds fewer.
    pub examples: u64,
    /// Scenes; example `n` shows that of index `n` modulo their number.
    pub scenes: Vec<SceneHead>,
    /// The craft whose camera looks.
    pub drone_model: String,
    /// The camera of every image, its lens included.
    pub camera: Camera,
    /// What the camera did to the images, as `--camera-effects` takes it.
    pub camera_effects: String,
    /// Fraction of examples whose target is not in the image.
    pub absent: f64,
    /// Fraction of examples with a look-alike.
    pub look_alikes: f64,
    /// Minimum pixels of a target, at 960×720.
    pub min_pixels: u32,
    /// How images are kept: `png` or `jpeg:QUALITY`.
    pub pictures: String,
}

/// One scene of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneHead {
    /// As it was asked for.
    pub name: String,
    /// Its legend: every object with its tags.
    pub legend: String,
    /// The light.
    pub light: String,
    /// The weather.
    pub weather: String,
    /// The range at which the oracle believes a goal reached, metres.
    pub near_m: f64,
}

/// Where the camera was: the body's centre, metres and degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedPose {
    /// Metres east.
    pub east: f64,
    /// Metres north.
    pub north: f64,
    /// Metres up.
    pub up: f64,
    /// Clockwise from north.
    pub heading_deg: f64,
    /// Nose up.
    pub pitch_deg: f64,
    /// Right side down.
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

/// Paths of an example's images, from the dataset's folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Files {
    /// The photograph.
    pub picture: String,
    /// Object of each pixel: 16-bit grey PNG, 0 for none.
    pub ids: String,
    /// Metres along the optical axis: 16-bit grey PNG in centimetres, 0 for none or beyond 655 m.
    pub depth: String,
    /// The nearest opening at each pixel, as `ids`; null where no opening is seen.
    pub opening_ids: Option<String>,
    /// Its depth, as `depth`; null as above.
    pub opening_depth: Option<String>,
    /// The target's mask: 8-bit grey PNG, 255 inside; null without a target.
    pub mask: Option<String>,
}

/// A row of `examples.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Number of the example, from 0; also the row's number in the file.
    pub number: u64,
    /// The scene's name, as in `dataset.json`.
    pub scene: String,
    /// What the example asks of who points.
    pub kind: Kind,
    /// What is said.
    pub instruction: String,
    /// In which manner.
    pub wording: Wording,
    /// What is meant; null when it is not in the image.
    pub target: Option<Target>,
    /// Numbers of visible objects with the target's name in another colour or quality.
    pub look_alikes: Vec<ObjectId>,
    /// The images.
    #[serde(flatten)]
    pub files: Files,
    /// The scene's `near`, metres.
    pub near_m: f64,
    /// Where the camera was. The oracle never reads it.
    pub pose: RecordedPose,
    /// Every object with a pixel in the image.
    pub visible: Vec<Visible>,
}

impl Row {
    /// The row of an example.
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
        }
    }
}
