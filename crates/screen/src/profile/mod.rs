//! Profiles: what a game or simulator looks like as a drone. TOML, strictly read.
//!
//! Units stand in the names: metres, seconds, degrees. `docs/guide/games.md` explains each key.

mod check;
mod edit;
mod key;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;

use crate::area::Region;
use crate::gamepad::{Curve, Stick};
use crate::{Target, WindowName};

pub use edit::{Change, edited};
pub use key::{Key, KeyError};

/// Longest profile, bytes.
const LONGEST: u64 = 64 << 10;

/// The shipped profiles: name and text.
const SHIPPED: [(&str, &str); 3] = [
    ("drl", include_str!("../../../../profiles/drl.toml")),
    ("luanti", include_str!("../../../../profiles/luanti.toml")),
    ("spf-window", include_str!("../../../../profiles/spf-window.toml")),
];

/// Why a profile cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// No profile is shipped under the name, and it is no path either.
    #[error("no profile `{name}`: use {}, or the path of a file", Profile::names().join(", "))]
    Unknown {
        /// The name.
        name: String,
    },
    /// The file cannot be read.
    #[error("cannot read the profile `{}`: {source}", path.display())]
    Unreadable {
        /// Its path.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// It is not TOML, or has unknown or missing keys.
    #[error("{0}")]
    Syntax(Box<toml::de::Error>),
    /// Its text cannot be changed.
    #[error("cannot change the profile: {0}")]
    Edit(String),
    /// A value is outside its range.
    #[error("`{key}`: {expected}, found `{found}`")]
    Value {
        /// The key.
        key: String,
        /// What it must be.
        expected: String,
        /// What it is.
        found: String,
    },
}

/// A game or simulator as a drone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// What it is, in a few words.
    pub about: String,
    /// Who has flown with it, and how its figures are known.
    pub source: String,
    /// Its window.
    pub window: WindowPart,
    /// Its camera.
    pub camera: CameraPart,
    /// The keys.
    pub controls: Controls,
    /// The craft.
    #[serde(default)]
    pub craft: CraftPart,
    /// Keys that take off.
    #[serde(default)]
    pub take_off: TakeOff,
    /// Keys that land.
    #[serde(default)]
    pub landing: Sequence,
    /// Keys that put the craft back to its start; pressed before the take-off.
    #[serde(default)]
    pub reset: Sequence,
}

/// The window of a program: a text in its title, its class, or both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindowPart {
    /// Text that its title contains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Its class, for programs whose title changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// Whether the user chooses it in the dialog of a Wayland desktop's portal, in place of title and class.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub portal: bool,
    /// The part of its contents that is the camera's picture.
    #[serde(default)]
    pub region: Region,
}

impl WindowPart {
    /// What the window is found by; no name if the portal shows it.
    #[must_use]
    pub fn name(&self) -> WindowName {
        WindowName { title: self.title.clone(), class: self.class.clone() }
    }
}

/// The camera that the window shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraPart {
    /// Full horizontal field of view of the region, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizontal_fov_deg: Option<f64>,
    /// Full vertical field of view of the region, degrees; one of the two is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertical_fov_deg: Option<f64>,
    /// Angle by which it looks below the forward axis, degrees.
    #[serde(default)]
    pub tilt_deg: f64,
    /// Time from the state of the program that a picture shows to the picture's appearance on the screen, seconds: about one frame.
    #[serde(default = "usual_latency")]
    pub latency_s: f64,
    /// Instruments that are painted over, as parts of the region.
    #[serde(default)]
    pub masks: Vec<Region>,
}

fn usual_latency() -> f64 {
    0.05
}

/// Keys and mouse, and what they do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controls {
    /// Pulses of a key per second.
    #[serde(default = "usual_pulses")]
    pub pulse_hz: f64,
    /// Time from a key to the first motion, seconds.
    #[serde(default = "usual_dead_time")]
    pub dead_time_s: f64,
    /// Time constant of the velocity, seconds.
    #[serde(default = "usual_lag")]
    pub lag_s: f64,
    /// Along the heading, metres per second; `minus` flies back.
    pub forward: Axis,
    /// To the right; `minus` flies to the left. Without it the craft flies to no side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub right: Option<Axis>,
    /// Climb; `minus` descends.
    pub up: Axis,
    /// Turn.
    pub yaw: Yaw,
    /// What the program makes of the sticks of a gamepad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamepad: Option<Curve>,
}

impl Controls {
    /// What the program makes of a stick.
    #[must_use]
    pub fn curve(&self) -> Curve {
        self.gamepad.unwrap_or_default()
    }
}

fn usual_pulses() -> f64 {
    25.0
}

fn usual_dead_time() -> f64 {
    0.1
}

fn usual_lag() -> f64 {
    0.2
}

/// Two keys that move along an axis, or a stick that does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Key that moves along the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plus: Option<Key>,
    /// Key that moves against it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minus: Option<Key>,
    /// Stick of a gamepad, in place of the keys.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stick: Option<Stick>,
    /// Speed with the key `plus` held, or at full deflection, metres per second.
    pub rate_m_s: f64,
    /// The same for `minus`; as `rate_m_s` if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minus_rate_m_s: Option<f64>,
}

impl Axis {
    /// The keys `plus` and `minus`; none if it has a stick.
    #[must_use]
    pub fn keys(&self) -> Option<(Key, Key)> {
        self.plus.zip(self.minus)
    }

    /// Speed with one of the keys held, metres per second: `plus` for a positive direction.
    #[must_use]
    pub fn rate(&self, direction: f64) -> f64 {
        if direction < 0.0 { self.minus_rate_m_s.unwrap_or(self.rate_m_s) } else { self.rate_m_s }
    }
}

/// How the craft turns: by keys, by the mouse, or by a stick.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, try_from = "YawPart")]
pub enum Yaw {
    /// By keys.
    Keys(YawKeys),
    /// By moving the mouse to the side.
    Mouse(YawMouse),
    /// By a stick of a gamepad.
    Stick(YawStick),
}

/// Keys that turn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YawKeys {
    /// Key that turns clockwise.
    pub plus: Key,
    /// Key that turns counter-clockwise.
    pub minus: Key,
    /// Rate with a key held, degrees per second.
    pub rate_deg_s: f64,
}

/// A mouse that turns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YawMouse {
    /// Turn by one pixel of motion to the right, degrees; negative if that turns counter-clockwise.
    pub mouse_deg: f64,
    /// Greatest rate at which the mouse is moved, degrees per second.
    pub rate_deg_s: f64,
}

/// A stick that turns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YawStick {
    /// Stick that turns clockwise.
    pub stick: Stick,
    /// Rate at full deflection, degrees per second.
    pub rate_deg_s: f64,
}

/// What a profile may say of the turn.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct YawPart {
    plus: Option<Key>,
    minus: Option<Key>,
    mouse_deg: Option<f64>,
    stick: Option<Stick>,
    rate_deg_s: Option<f64>,
}

impl TryFrom<YawPart> for Yaw {
    type Error = String;

    fn try_from(part: YawPart) -> Result<Self, String> {
        let YawPart { plus, minus, mouse_deg, stick, rate_deg_s } = part;
        match (plus, minus, mouse_deg, stick, rate_deg_s) {
            (Some(plus), Some(minus), None, None, Some(rate_deg_s)) => Ok(Self::Keys(YawKeys { plus, minus, rate_deg_s })),
            (None, None, Some(mouse_deg), None, Some(rate_deg_s)) => Ok(Self::Mouse(YawMouse { mouse_deg, rate_deg_s })),
            (None, None, None, Some(stick), Some(rate_deg_s)) => Ok(Self::Stick(YawStick { stick, rate_deg_s })),
            _ => {
                let there = [
                    ("plus", plus.is_some()),
                    ("minus", minus.is_some()),
                    ("mouse_deg", mouse_deg.is_some()),
                    ("stick", stick.is_some()),
                    ("rate_deg_s", rate_deg_s.is_some()),
                ];
                let found: Vec<&str> = there.iter().filter(|(_, is_there)| *is_there).map(|(name, _)| *name).collect();
                let found = if found.is_empty() { "nothing".to_owned() } else { found.join(", ") };
                Err(format!(
                    "expected `rate_deg_s`, and beside it two keys (`plus` and `minus`), or `mouse_deg`, or a `stick`; found {found}"
                ))
            }
        }
    }
}

impl Yaw {
    /// The keys that turn clockwise and counter-clockwise.
    #[must_use]
    pub fn keys(&self) -> Option<(Key, Key)> {
        match self {
            Self::Keys(keys) => Some((keys.plus, keys.minus)),
            Self::Mouse(_) | Self::Stick(_) => None,
        }
    }

    /// The stick that turns.
    #[must_use]
    pub fn stick(&self) -> Option<Stick> {
        match self {
            Self::Stick(stick) => Some(stick.stick),
            Self::Keys(_) | Self::Mouse(_) => None,
        }
    }

    /// Greatest yaw rate, degrees per second.
    #[must_use]
    pub fn rate_deg_s(&self) -> f64 {
        match self {
            Self::Keys(keys) => keys.rate_deg_s,
            Self::Mouse(mouse) => mouse.rate_deg_s,
            Self::Stick(stick) => stick.rate_deg_s,
        }
    }
}

/// The craft.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CraftPart {
    /// Fraction of full speed at which it cruises: some is left to correct with.
    pub cruise: f64,
    /// Radius of its body, metres.
    pub radius_m: f64,
    /// Horizontal and vertical acceleration, metres per second squared.
    pub acceleration_m_s2: f64,
    /// Highest altitude above the start, metres.
    pub max_altitude_m: f64,
    /// Greatest distance from the start, metres.
    pub max_distance_m: f64,
}

impl Default for CraftPart {
    fn default() -> Self {
        Self { cruise: 0.75, radius_m: 0.4, acceleration_m_s2: 6.0, max_altitude_m: 120.0, max_distance_m: 300.0 }
    }
}

/// How it takes off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TakeOff {
    /// Height above the start afterwards, metres; 0 if it already flies.
    #[serde(default)]
    pub height_m: f64,
    /// What is pressed.
    #[serde(default)]
    pub steps: Vec<Step>,
}

/// What is pressed, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sequence {
    /// The steps.
    #[serde(default)]
    pub steps: Vec<Step>,
}

/// One thing that is done for a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Key that is held; none to wait.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<Key>,
    /// Stick that is fully pushed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub push: Option<Stick>,
    /// For how long, seconds.
    pub for_s: f64,
}

impl Profile {
    /// Reads a profile.
    ///
    /// # Errors
    /// [`ProfileError::Syntax`] and [`ProfileError::Value`].
    pub fn parse(text: &str) -> Result<Self, ProfileError> {
        let profile: Self = toml::from_str(text).map_err(|error| ProfileError::Syntax(Box::new(error)))?;
        check::check(&profile)?;
        Ok(profile)
    }

    /// The shipped profile of this name.
    #[must_use]
    pub fn shipped(name: &str) -> Option<Self> {
        let (_, text) = SHIPPED.iter().find(|(shipped, _)| *shipped == name)?;
        // A test reads all of them.
        Self::parse(text).ok()
    }

    /// The names of the shipped profiles.
    #[must_use]
    pub fn names() -> Vec<&'static str> {
        SHIPPED.iter().map(|(name, _)| *name).collect()
    }

    /// A shipped profile, or one from a file: what ends in `.toml` or contains a slash is a path.
    ///
    /// # Errors
    /// [`ProfileError`].
    pub fn open(name: &str) -> Result<Self, ProfileError> {
        Self::parse(&Self::text(name)?)
    }

    /// The text of a profile that [`open`](Self::open) would read, with its comments.
    ///
    /// # Errors
    /// [`ProfileError::Unknown`] and [`ProfileError::Unreadable`].
    pub fn text(name: &str) -> Result<String, ProfileError> {
        if !name.contains(['/', '\\']) && !name.ends_with(".toml") {
            let shipped = SHIPPED.iter().find(|(shipped, _)| *shipped == name);
            let unknown = || ProfileError::Unknown { name: name.to_owned() };
            return shipped.map(|(_, text)| (*text).to_owned()).ok_or_else(unknown);
        }
        let path = Path::new(name);
        let unreadable = |source| ProfileError::Unreadable { path: path.to_owned(), source };
        let bytes = spf_input::read(path, LONGEST).map_err(unreadable)?;
        let not_text = |_| unreadable(std::io::Error::new(std::io::ErrorKind::InvalidData, "it is not UTF-8"));
        String::from_utf8(bytes).map_err(not_text)
    }

    /// The profile as TOML.
    ///
    /// # Errors
    /// A value that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// What is captured.
    #[must_use]
    pub fn target(&self) -> Target {
        let region = self.window.region;
        if self.window.portal { Target::Portal { region } } else { Target::Window { name: self.window.name(), region } }
    }

    /// The camera of pictures of this size, with square pixels.
    #[must_use]
    pub fn optics(&self, (width, height): (u32, u32)) -> Camera {
        let (w, h) = (f64::from(width.max(1)), f64::from(height.max(1)));
        let CameraPart { horizontal_fov_deg, vertical_fov_deg, tilt_deg, .. } = self.camera;
        let half_tangent = |degrees: f64| (0.5 * degrees.to_radians()).tan();
        let across = match (horizontal_fov_deg, vertical_fov_deg) {
            (Some(horizontal), _) => half_tangent(horizontal),
            (None, vertical) => half_tangent(vertical.unwrap_or(60.0)) * w / h,
        };
        let down = across * h / w;
        Camera::from_fov(width, height, 2.0 * across.atan(), 2.0 * down.atan(), tilt_deg.to_radians())
    }

    /// All keys that it presses.
    #[must_use]
    pub fn keys(&self) -> Vec<Key> {
        let axes = self.axes().filter_map(Axis::keys).chain(self.controls.yaw.keys());
        axes.flat_map(|(plus, minus)| [plus, minus]).chain(self.steps().filter_map(|step| step.hold)).collect()
    }

    /// Whether it needs a gamepad.
    #[must_use]
    pub fn has_sticks(&self) -> bool {
        let axes = self.axes().any(|axis| axis.stick.is_some());
        axes || self.controls.yaw.stick().is_some() || self.steps().any(|step| step.push.is_some())
    }

    fn axes(&self) -> impl Iterator<Item = &Axis> {
        let Controls { forward, right, up, .. } = &self.controls;
        [Some(forward), right.as_ref(), Some(up)].into_iter().flatten()
    }

    fn steps(&self) -> impl Iterator<Item = &Step> {
        [&self.take_off.steps, &self.landing.steps, &self.reset.steps].into_iter().flatten()
    }
}

#[cfg(test)]
mod tests;
