//! Messages between page and server. Text messages are JSON; an image message is binary: the length of its JSON header
//! (four bytes, little endian), the header, and the JPEG.

use serde::{Deserialize, Serialize};
use spf_core::craft::CraftKind;
use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_scene::{Lighting, Weather};

/// Maximum size of a page's message, bytes.
pub(super) const LONGEST: usize = 4096;
/// Maximum distance of the camera from the origin, metres.
const FARTHEST: f64 = 5000.0;

/// A message from the page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum FromPage {
    /// Input of the held keys, each −1 to 1; valid for half a second unless repeated.
    Fly { right: f64, forward: f64, up: f64, yaw: f64, pitch: f64, fast: bool },
    /// Turn by these angles, clockwise and nose up.
    Turn { yaw_deg: f64, pitch_deg: f64 },
    /// Pointer position, as fractions of width and height from the upper left corner; `None` outside the image.
    Point { at: Option<[f64; 2]> },
    /// This image was displayed, or could not be.
    Shown { frame: u64 },
    /// Select the channel.
    Channel { channel: Channel },
    /// Select the image size.
    Detail { detail: Detail },
    /// Switch to another of the available scenes.
    Scene { name: String },
    /// Change light and weather; `None` for the scene's own.
    Conditions { light: Option<Lighting>, weather: Option<Weather> },
    /// Use another craft's camera.
    Craft { craft: CraftKind },
    /// Whether objects stop the camera.
    Collide { on: bool },
    /// Whether actors move.
    Run { on: bool },
    /// Go to a pose, or to the initial pose.
    Go { pose: Option<PagePose> },
}

/// The channel displayed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Channel {
    /// The camera image.
    #[default]
    Colour,
    /// A colour for each object.
    Ids,
    /// A colour for each distance.
    Depth,
}

/// Image size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Detail {
    /// As large as can be rendered smoothly while moving; the camera's own size at rest.
    #[default]
    Auto,
    /// A third of the camera's width and height.
    Low,
    /// Two thirds.
    Medium,
    /// The camera's own size.
    High,
}

/// A pose in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PagePose {
    pub(super) east: f64,
    pub(super) north: f64,
    pub(super) up: f64,
    pub(super) heading_deg: f64,
    pub(super) pitch_deg: f64,
}

impl From<Pose> for PagePose {
    fn from(pose: Pose) -> Self {
        let EnuPosition { east, north, up } = pose.position;
        let heading_deg = pose.attitude.heading.to_degrees().rem_euclid(360.0);
        Self { east, north, up, heading_deg, pitch_deg: pose.attitude.pitch.to_degrees() }
    }
}

impl From<PagePose> for Pose {
    fn from(page: PagePose) -> Self {
        let attitude =
            Attitude { heading: wrap_angle(page.heading_deg.to_radians()), pitch: page.pitch_deg.to_radians(), roll: 0.0 };
        Self { position: EnuPosition { east: page.east, north: page.north, up: page.up }, attitude }
    }
}

impl FromPage {
    /// Parses a message.
    ///
    /// # Errors
    /// A message for the page if it is invalid.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST {
            return Err(format!("a message of {} bytes exceeds the limit of {LONGEST}", text.len()));
        }
        let message: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        message.check()?;
        Ok(message)
    }

    fn check(&self) -> Result<(), String> {
        // NaN fails the comparison as well, should a future format allow it.
        let within = |what: &str, value: f64, low: f64, high: f64| match (low..=high).contains(&value) {
            true => Ok(()),
            false => Err(format!("`{what}` must be from {low} to {high}, not {value}")),
        };
        match self {
            Self::Fly { right, forward, up, yaw, pitch, .. } => {
                let fractions = [("right", right), ("forward", forward), ("up", up), ("yaw", yaw), ("pitch", pitch)];
                fractions.into_iter().try_for_each(|(what, value)| within(what, *value, -1.0, 1.0))
            }
            Self::Turn { yaw_deg, pitch_deg } => {
                within("yaw_deg", *yaw_deg, -360.0, 360.0).and_then(|()| within("pitch_deg", *pitch_deg, -180.0, 180.0))
            }
            Self::Point { at: Some([u, v]) } => within("at[0]", *u, 0.0, 1.0).and_then(|()| within("at[1]", *v, 0.0, 1.0)),
            Self::Go { pose: Some(pose) } => {
                let places = [("east", pose.east), ("north", pose.north), ("up", pose.up)];
                places.into_iter().try_for_each(|(what, value)| within(what, value, -FARTHEST, FARTHEST))?;
                within("heading_deg", pose.heading_deg, -360.0, 360.0)?;
                within("pitch_deg", pose.pitch_deg, -90.0, 90.0)
            }
            _ => Ok(()),
        }
    }
}

/// A text message to the page.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum ToPage {
    /// The first message.
    Hello { version: &'static str, scenes: Vec<String>, lights: Vec<&'static str>, weathers: Vec<&'static str> },
    /// A scene is being loaded; no images until then.
    Loading { name: String },
    /// The scene of the following images.
    Scene {
        name: String,
        title: String,
        description: String,
        objects: usize,
        triangles: usize,
        /// Number of actors.
        actors: usize,
        craft: CraftKind,
        light: Lighting,
        weather: Weather,
    },
    /// The object under the pointer, without a new image.
    Under { under: Option<Under> },
    /// A message was rejected.
    Refused { reason: String },
}

/// An object under the pointer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Under {
    /// Its key in the scene file.
    pub(super) key: String,
    /// Its name.
    pub(super) words: String,
    /// Its category.
    pub(super) kind: String,
    /// Other names, qualities, uses, and what it belongs to.
    pub(super) tags: Vec<String>,
    /// Straight-line distance to its surface under the pointer, metres.
    pub(super) distance_m: f64,
    /// Name of an opening under the pointer that is nearer than the object.
    pub(super) through: Option<String>,
}

/// The header of an image.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Head {
    /// Number within the session, from 1.
    pub(super) frame: u64,
    pub(super) width: u32,
    pub(super) height: u32,
    #[serde(flatten)]
    pub(super) pose: PagePose,
    /// Speed, m/s.
    pub(super) speed_m_s: f64,
    /// The object in contact; `None` in free air, or if objects do not stop the camera.
    pub(super) touching: Option<String>,
    pub(super) under: Option<Under>,
    pub(super) channel: Channel,
    /// Time for rendering and encoding, milliseconds.
    pub(super) draw_ms: f64,
    pub(super) encode_ms: f64,
}

impl Head {
    /// The message with the image.
    pub(super) fn with(&self, jpeg: &[u8]) -> Vec<u8> {
        // A header consists of numbers and short texts: always valid JSON, and far below 4 GiB.
        let head = serde_json::to_vec(self).unwrap_or_default();
        let mut message = Vec::with_capacity(4 + head.len() + jpeg.len());
        message.extend_from_slice(&(head.len() as u32).to_le_bytes());
        message.extend_from_slice(&head);
        message.extend_from_slice(jpeg);
        message
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn messages_are_parsed_and_wrong_ones_reported() {
        let fly = r#"{"type":"fly","right":0,"forward":1,"up":-0.5,"yaw":0,"pitch":0,"fast":true}"#;
        let FromPage::Fly { forward, up, fast, .. } = FromPage::read(fly).unwrap() else { panic!() };
        assert_eq!((forward, up, fast), (1.0, -0.5, true));
        assert_eq!(FromPage::read(r#"{"type":"point","at":null}"#), Ok(FromPage::Point { at: None }));
        for (text, reason) in [
            (fly.replace("-0.5", "-1.5"), "`up` must be from -1 to 1, not -1.5"),
            (r#"{"type":"dance"}"#.to_owned(), "unknown variant `dance`"),
            (r#"{"type":"go","pose":{"east":1e9,"north":0,"up":0,"heading_deg":0,"pitch_deg":0}}"#.to_owned(), "`east` must be"),
            (r#"{"type":"shown","frame":1,"more":2}"#.to_owned(), "unknown field `more`"),
            ("[".to_owned(), "EOF"),
            (" ".repeat(LONGEST + 1), "exceeds the limit of 4096"),
        ] {
            let message = FromPage::read(&text).unwrap_err();
            assert!(message.contains(reason), "{message}");
        }
    }

    #[test]
    fn an_image_has_its_head_in_front() {
        let head = Head {
            frame: 7,
            width: 4,
            height: 3,
            pose: Pose::default().into(),
            speed_m_s: 0.0,
            touching: None,
            under: None,
            channel: Channel::Ids,
            draw_ms: 1.0,
            encode_ms: 2.0,
        };
        let message = head.with(b"jpeg");
        let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
        let read: serde_json::Value = serde_json::from_slice(&message[4..4 + length]).unwrap();
        assert_eq!((read["frame"].as_u64(), read["heading_deg"].as_f64(), &read["channel"]), (Some(7), Some(0.0), &"ids".into()));
        assert_eq!(&message[4 + length..], b"jpeg");
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in r#"(\{"type":"(fly|turn|point|go|scene|shown)"[^}]{0,60}\}?)|.{0,80}"#) {
            match FromPage::read(&text) {
                Ok(FromPage::Turn { yaw_deg, .. }) => prop_assert!(yaw_deg.abs() <= 360.0),
                Ok(_) => {}
                Err(reason) => prop_assert!(!reason.is_empty()),
            }
        }

        #[test]
        fn poses_come_back(east in -5e3..5e3, heading_deg in 0.0..360.0, pitch_deg in -90.0..90.0) {
            let page = PagePose { east, north: -1.0, up: 2.0, heading_deg, pitch_deg };
            let back = PagePose::from(Pose::from(page));
            prop_assert!((back.heading_deg - heading_deg).abs() < 1e-9 && (back.pitch_deg - pitch_deg).abs() < 1e-9);
            prop_assert_eq!(back.east, east);
        }
    }
}
