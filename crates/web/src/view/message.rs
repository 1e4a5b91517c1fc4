//! What page and server say to each other. Text is JSON; an image is binary: the length of its JSON head (four bytes, little
//! endian), the head, and the image as JPEG.

use serde::{Deserialize, Serialize};
use spf_core::craft::CraftKind;
use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_scene::{Lighting, Weather};

/// Longest message that a page may send, bytes.
pub(super) const LONGEST: usize = 4096;
/// How far from the origin a page may put its camera, metres.
const FARTHEST: f64 = 5000.0;

/// What a page says.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum FromPage {
    /// Which way the held keys push. Each from −1 to 1; it holds for half a second unless said again.
    Fly { right: f64, forward: f64, up: f64, yaw: f64, pitch: f64, fast: bool },
    /// Turns by so much, clockwise and nose up.
    Turn { yaw_deg: f64, pitch_deg: f64 },
    /// Where the pointer is, as a fraction of width and height from the upper left corner; none when it left the image.
    Point { at: Option<[f64; 2]> },
    /// This image has been shown, or cannot be.
    Shown { frame: u64 },
    /// What the image shows.
    Channel { channel: Channel },
    /// How large images are.
    Detail { detail: Detail },
    /// Another scene, one of those that the server listed.
    Scene { name: String },
    /// Another light and weather; none: the scene's own.
    Conditions { light: Option<Lighting>, weather: Option<Weather> },
    /// Another craft's camera.
    Craft { craft: CraftKind },
    /// Whether things can be flown through.
    Collide { on: bool },
    /// Whether people walk and vehicles drive.
    Run { on: bool },
    /// To a pose, or back to where the scene begins.
    Go { pose: Option<PagePose> },
}

/// What an image shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Channel {
    /// What the craft's camera sees.
    #[default]
    Colour,
    /// A colour for each object.
    Ids,
    /// A colour for each distance.
    Depth,
}

/// How large images are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Detail {
    /// As large as can be drawn smoothly while the camera moves; the camera's own size at rest.
    #[default]
    Auto,
    /// A third of the camera's width and height.
    Low,
    /// Two thirds.
    Medium,
    /// The camera's own size.
    High,
}

/// A pose as people write it.
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
    /// Reads a message.
    ///
    /// # Errors
    /// A sentence for the page: what is wrong with the message.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST {
            return Err(format!("a message of {} bytes is longer than {LONGEST}", text.len()));
        }
        let message: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        message.check()?;
        Ok(message)
    }

    fn check(&self) -> Result<(), String> {
        // NaN fails the comparison as well; JSON cannot say it, a later format might.
        let within = |what: &str, value: f64, low: f64, high: f64| match (low..=high).contains(&value) {
            true => Ok(()),
            false => Err(format!("`{what}` must be from {low} to {high}, not {value}")),
        };
        match self {
            Self::Fly { right, forward, up, yaw, pitch, .. } => {
                let shares = [("right", right), ("forward", forward), ("up", up), ("yaw", yaw), ("pitch", pitch)];
                shares.into_iter().try_for_each(|(what, value)| within(what, *value, -1.0, 1.0))
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

/// What the server says in text.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum ToPage {
    /// First of all.
    Hello { version: &'static str, scenes: Vec<String>, lights: Vec<&'static str>, weathers: Vec<&'static str> },
    /// A scene is being loaded; images stand still meanwhile.
    Loading { name: String },
    /// The scene that images show from now on.
    Scene {
        name: String,
        title: String,
        description: String,
        objects: usize,
        triangles: usize,
        /// How many things move by themselves.
        actors: usize,
        craft: CraftKind,
        light: Lighting,
        weather: Weather,
    },
    /// What is under the pointer, without a new image.
    Under { under: Option<Under> },
    /// A message could not be followed.
    Refused { reason: String },
}

/// An object under the pointer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Under {
    /// Its key in the scene file.
    pub(super) key: String,
    /// What one calls it.
    pub(super) words: String,
    /// Its category.
    pub(super) kind: String,
    /// Further names, qualities, uses, and where it belongs.
    pub(super) tags: Vec<String>,
    /// Straight-line distance to its surface under the pointer, metres.
    pub(super) distance_m: f64,
    /// What an opening under the pointer is called, when one is nearer than the object.
    pub(super) through: Option<String>,
}

/// The head of an image.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Head {
    /// Counts from 1 in each session.
    pub(super) frame: u64,
    pub(super) width: u32,
    pub(super) height: u32,
    #[serde(flatten)]
    pub(super) pose: PagePose,
    /// Metres per second.
    pub(super) speed_m_s: f64,
    /// What the camera touches; none in free air, or when it flies through things.
    pub(super) touching: Option<String>,
    pub(super) under: Option<Under>,
    pub(super) channel: Channel,
    /// Time to draw and to encode, milliseconds.
    pub(super) draw_ms: f64,
    pub(super) encode_ms: f64,
}

impl Head {
    /// The message of an image.
    pub(super) fn with(&self, jpeg: &[u8]) -> Vec<u8> {
        // A head is numbers and short texts: it is always JSON, and far shorter than 4 GiB.
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
    fn messages_are_read_and_wrong_ones_told() {
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
            (" ".repeat(LONGEST + 1), "longer than 4096"),
        ] {
            let said = FromPage::read(&text).unwrap_err();
            assert!(said.contains(reason), "{said}");
        }
    }

    #[test]
    fn a_picture_has_its_head_in_front() {
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
