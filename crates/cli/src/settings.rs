//! What is in force: `spf.toml` under the environment (and `.env`) under flags, each value with where it came from.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};

use crate::error::{CliError, nearest};
use crate::printer::one_line;

/// A key of the configuration: its name in `spf.toml`, its environment variable, its default and what it means.
pub(crate) struct Key {
    /// `table.key` in `spf.toml`.
    pub(crate) name: &'static str,
    /// The environment variable.
    pub(crate) env: &'static str,
    /// What holds when nobody says anything; empty: decided by something else, see `doc`.
    pub(crate) default: &'static str,
    /// Meaning and unit.
    pub(crate) doc: &'static str,
}

const fn key(name: &'static str, env: &'static str, default: &'static str, doc: &'static str) -> Key {
    Key { name, env, default, doc }
}

/// Every key there is. Flags, file and environment all end here.
pub(crate) const KEYS: &[Key] = &[
    key("fly.scene", "SPF_SCENE", "city", "scene: a built-in name, scene file or .glb"),
    key("fly.light", "SPF_LIGHT", "", "day, overcast, dusk or night; empty: the scene's"),
    key("fly.weather", "SPF_WEATHER", "", "clear, haze or rain; empty: the scene's"),
    key("fly.start", "SPF_START", "", "start pose east,north,up,heading_deg[,pitch_deg]; empty: the scene's"),
    key("fly.drone", "SPF_DRONE", "sim", "the drone: sim, or tello[@ADDRESS]"),
    key("fly.drone_model", "SPF_DRONE_MODEL", "", "craft to simulate, quad or tello; empty: the scene's"),
    key(
        "fly.policy",
        "SPF_POLICY",
        "spf",
        "how decisions are made: spf[-detector], plain[-numeric|-discrete], pivot[-parallel], typefly[-coco|-once]",
    ),
    key("fly.preset", "SPF_PRESET", "default", "named set of choices: default or paper"),
    key("fly.step", "SPF_STEP", "", "step length: adaptive or fixed:METRES; empty: the preset's"),
    key("fly.motion", "SPF_MOTION", "", "sequential or blended; empty: the preset's"),
    key("fly.think", "SPF_THINK", "", "stop or continuous; empty: the preset's"),
    key("fly.rate_hz", "SPF_RATE_HZ", "10", "setpoints a second, 5 to 100"),
    key("fly.avoid", "SPF_AVOID", "false", "obstacle mode: true or false"),
    key(
        "fly.detector",
        "SPF_DETECTOR",
        "",
        "detector of obstacle mode: FILE.onnx, oracle[:NAME]; empty: the VLM gives the boxes",
    ),
    key("fly.vlm", "SPF_VLM", "oracle", "who points: NAME[#MODEL][@URL], auto, replay:FILE, oracle, oracle:NAME or oracle:FILE"),
    key(
        "fly.vlm_check",
        "SPF_VLM_CHECK",
        "true",
        "with a real drone, ask the VLM about pictures of a dot before take-off: true or false",
    ),
    key("fly.seed", "SPF_SEED", "0", "seed of all chance, a whole number"),
    key("fly.wind", "SPF_WIND", "", "wind m/s[,from=DEG][,gust=M_S][,gust_time=S], from the north unless said; empty: still air"),
    key("fly.battery", "SPF_BATTERY", "1", "battery charge at the start, 0 to 1"),
    key("fly.max_time_s", "SPF_MAX_TIME_S", "180", "flight time after which the flight is a timeout, seconds"),
    key("fly.max_decisions", "SPF_MAX_DECISIONS", "60", "decisions after which the flight is a timeout"),
    key("fly.reply_timeout_s", "SPF_REPLY_TIMEOUT_S", "20", "how long a VLM's answer is waited for, seconds"),
    key("fly.max_cost_usd", "SPF_MAX_COST_USD", "", "US dollars for the VLM after which the flight ends; empty: no limit"),
    key("fly.prompt", "SPF_PROMPT", "", "prompt file (docs/vlm.md); empty: the shipped one"),
    key("fly.geofence", "SPF_GEOFENCE", "", "GeoJSON file with polygons to stay in, local east/north metres; empty: none"),
    key("fly.realtime", "SPF_REALTIME", "false", "fly on the wall clock: true or false"),
    key("fly.video", "SPF_VIDEO", "true", "make video.mp4: true or false"),
    key("fly.live", "SPF_LIVE", "", "address and port of the live view for Foxglove, such as 127.0.0.1:8765; empty: none"),
    key("fly.out", "SPF_OUT", "", "folder for the flight's files; empty: flights/NNN-instruction"),
    key(
        "camera.effects",
        "SPF_CAMERA_EFFECTS",
        "none",
        "blur=MS, noise=LEVELS, exposure=STOPS, lens=NAME, compression=CODEC:QUALITY, joined by commas; all; none",
    ),
    key("vlm.record", "SPF_VLM_RECORD", "", "new file that the VLM's answers are recorded in; empty: none"),
    key("vlm.fallback", "SPF_VLM_FALLBACK", "", "VLM that is asked when the first one fails; empty: none"),
    key("vlm.hedge_s", "SPF_VLM_HEDGE_S", "", "seconds without an answer after which a second request goes out; empty: never"),
    key("vlm.models", "SPF_VLM_MODELS", "", "TOML file with rows for the table of models; empty: none"),
    key("vlm.image_long_side", "SPF_VLM_IMAGE_LONG_SIDE", "", "longest side of pictures sent, pixels; empty: the model's, 768"),
    key("vlm.jpeg_quality", "SPF_VLM_JPEG_QUALITY", "70", "quality of pictures sent, 1 to 100"),
    key("tello.motion", "SPF_TELLO_MOTION", "rc", "how a Tello flies: rc, or go (steps that it ends by itself; docs/tello.md)"),
    key("tello.local", "SPF_TELLO_LOCAL", "", "this machine's address towards the Tello; empty: any"),
    key("tello.state_port", "SPF_TELLO_STATE_PORT", "8890", "UDP port that the Tello's state comes to"),
    key("tello.video_port", "SPF_TELLO_VIDEO_PORT", "11111", "UDP port that the Tello's video comes to"),
    key(
        "tello.video_latency_s",
        "SPF_TELLO_VIDEO_LATENCY_S",
        "0.15",
        "from the Tello's shutter to the arrival of the picture, seconds",
    ),
    key("tello.speed_m_s", "SPF_TELLO_SPEED_M_S", "1.0", "horizontal speed of `rc 0 100 0 0`, m/s"),
    key("tello.climb_m_s", "SPF_TELLO_CLIMB_M_S", "1.0", "climb rate of `rc 0 0 100 0`, m/s"),
    key("tello.sink_m_s", "SPF_TELLO_SINK_M_S", "0.8", "sink rate of `rc 0 0 -100 0`, m/s"),
    key("tello.yaw_deg_s", "SPF_TELLO_YAW_DEG_S", "95", "yaw rate of `rc 0 0 0 100`, degrees a second"),
    key("envelope.max_speed_m_s", "SPF_MAX_SPEED_M_S", "", "horizontal speed limit, m/s; empty: the craft's"),
    key("envelope.max_climb_m_s", "SPF_MAX_CLIMB_M_S", "", "climb and sink rate limit, m/s; empty: the craft's"),
    key("envelope.max_yaw_rate_deg_s", "SPF_MAX_YAW_RATE_DEG_S", "", "yaw rate limit, degrees a second; empty: the craft's"),
    key("envelope.min_altitude_m", "SPF_MIN_ALTITUDE_M", "", "lowest height that is sunk to, metres above take-off; empty: 0.3"),
    key(
        "envelope.max_altitude_m",
        "SPF_MAX_ALTITUDE_M",
        "",
        "greatest height above take-off, metres; empty: the scene's, else 120",
    ),
    key("envelope.max_distance_m", "SPF_MAX_DISTANCE_M", "", "greatest distance from take-off, metres; empty: 300"),
    key("envelope.low_battery", "SPF_LOW_BATTERY", "", "charge, 0 to 1, below which the flight ends; empty: the craft's"),
    key(
        "envelope.max_failed_replies",
        "SPF_MAX_FAILED_REPLIES",
        "",
        "failed replies in a row after which it lands; empty: the envelope's",
    ),
];

/// Where a value came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// The table above.
    Default,
    /// A configuration file, with its line.
    File(PathBuf, usize),
    /// An environment variable.
    Env(&'static str),
    /// A variable in `.env`.
    DotEnv(&'static str),
    /// A flag.
    Flag(&'static str),
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Default => f.write_str("default"),
            Self::File(path, line) => write!(f, "{}:{line}", path.display()),
            Self::Env(name) => write!(f, "environment {name}"),
            Self::DotEnv(name) => write!(f, ".env {name}"),
            Self::Flag(flag) => f.write_str(flag),
        }
    }
}

/// Every key with its value in force.
#[derive(Clone, Debug)]
pub(crate) struct Settings(BTreeMap<&'static str, (String, Origin)>);

impl Settings {
    /// The layers below flags: defaults, the file (`./spf.toml` when none is named and it exists), `.env`, the environment.
    pub(crate) fn load(file: Option<&Path>) -> Result<Self, CliError> {
        let mut settings = Self(KEYS.iter().map(|key| (key.name, (key.default.to_owned(), Origin::Default))).collect());
        let default = Path::new("spf.toml");
        match file {
            Some(path) => settings.read_file(path)?,
            None if default.exists() => settings.read_file(default)?,
            None => {}
        }
        settings.read_environment()?;
        Ok(settings)
    }

    fn read_environment(&mut self) -> Result<(), CliError> {
        let dotenv = dotenv()?;
        let unknown = |name: &str, place: &str| {
            let hint = match nearest(name, KEYS.iter().map(|key| key.env)) {
                Some(near) => format!("did you mean `{near}`? `spf config show` lists every key"),
                None => "`spf config show` lists every key".to_owned(),
            };
            CliError::usage(format!("unknown variable `{name}` in {place}")).hint(hint)
        };
        if let Some(name) = dotenv.keys().find(|name| is_ours(name)) {
            return Err(unknown(name, ".env"));
        }
        let environment = std::env::vars_os().filter_map(|(name, _)| name.into_string().ok());
        // The order of the environment is nobody's choice: of several the first by name is told.
        if let Some(name) = environment.filter(|name| is_ours(name)).min() {
            return Err(unknown(&name, "the environment"));
        }
        for key in KEYS {
            if let Some(value) = std::env::var_os(key.env) {
                let value = value.into_string().map_err(|_| {
                    CliError::usage(format!("environment {}: the value is not UTF-8", key.env))
                        .hint(format!("{}: {}", key.name, key.doc))
                })?;
                self.0.insert(key.name, (value, Origin::Env(key.env)));
            } else if let Some(value) = dotenv.get(key.env) {
                self.0.insert(key.name, (value.clone(), Origin::DotEnv(key.env)));
            }
        }
        Ok(())
    }

    fn read_file(&mut self, path: &Path) -> Result<(), CliError> {
        let shown = path.display();
        let text = std::fs::read_to_string(path)
            .map_err(|error| CliError::usage(format!("cannot read the configuration `{shown}`")).because(&error))
            .map_err(|error| error.hint("name a file that can be read with --config, or leave it out for ./spf.toml"))?;
        self.read_text(path, &text)
    }

    /// Takes the values of a configuration file over what is there.
    fn read_text(&mut self, path: &Path, text: &str) -> Result<(), CliError> {
        let shown = path.display();
        let table = DeTable::parse(text).map_err(|error| {
            let line = error.span().map_or(1, |span| line_of(text, span.start));
            CliError::usage(format!("{shown}:{line}: {}", error.message()))
                .hint("the file is TOML, for example:\n[fly]\nscene = \"city\"")
        })?;
        for (section, entries) in table.get_ref() {
            let DeValue::Table(entries) = entries.get_ref() else {
                return Err(unknown_key(&shown, line_of(text, section.span().start), section.get_ref()));
            };
            for (name, value) in entries {
                let line = line_of(text, name.span().start);
                let full = format!("{}.{}", section.get_ref(), name.get_ref());
                let Some(key) = KEYS.iter().find(|key| key.name == full) else {
                    return Err(unknown_key(&shown, line, &full));
                };
                let value = match value.get_ref() {
                    DeValue::String(text) => text.clone().into_owned(),
                    DeValue::Integer(number) => number.to_string(),
                    DeValue::Float(number) => number.to_string(),
                    DeValue::Boolean(value) => value.to_string(),
                    DeValue::Datetime(_) | DeValue::Array(_) | DeValue::Table(_) => {
                        return Err(CliError::usage(format!("{shown}:{line}: `{full}` is not one text, number, true or false"))
                            .hint(format!("{full}: {}", key.doc)));
                    }
                };
                self.0.insert(key.name, (value, Origin::File(path.to_owned(), line)));
            }
        }
        Ok(())
    }

    /// Puts a flag over what is there; `None` leaves it.
    pub(crate) fn flag(&mut self, name: &'static str, flag: &'static str, value: Option<String>) {
        debug_assert!(self.0.contains_key(name), "{name} is no key");
        if let Some(value) = value {
            self.0.insert(name, (value, Origin::Flag(flag)));
        }
    }

    /// Puts another default in place of the table's, where nobody said anything.
    pub(crate) fn default(&mut self, name: &'static str, value: &str) {
        if let Some((held, Origin::Default)) = self.0.get_mut(name) {
            value.clone_into(held);
        }
    }

    /// The value of a key; `None` when it is empty, that is, decided elsewhere.
    pub(crate) fn get(&self, name: &'static str) -> Option<&str> {
        self.0.get(name).map(|(value, _)| value.as_str()).filter(|value| !value.is_empty())
    }

    /// The value of a key as a `T`; `what` says what was expected when it is none.
    pub(crate) fn parse<T: std::str::FromStr>(&self, name: &'static str, what: &str) -> Result<Option<T>, CliError> {
        self.get(name).map(|value| value.parse().map_err(|_| self.wrong(name, what))).transpose()
    }

    /// The value of a key as a number in `low..=high`.
    pub(crate) fn number(&self, name: &'static str, low: f64, high: f64) -> Result<Option<f64>, CliError> {
        let expected = || format!("a number from {low} to {high}");
        let value: Option<f64> = self.parse(name, &expected())?;
        // A NaN is in no range.
        if value.is_some_and(|value| !(low..=high).contains(&value)) {
            return Err(self.wrong(name, &expected()));
        }
        Ok(value)
    }

    /// The value of a key as a whole number in `low..=high`.
    pub(crate) fn count(&self, name: &'static str, low: u32, high: u32) -> Result<Option<u32>, CliError> {
        let expected = || format!("a whole number from {low} to {high}");
        let value: Option<u32> = self.parse(name, &expected())?;
        if value.is_some_and(|value| !(low..=high).contains(&value)) {
            return Err(self.wrong(name, &expected()));
        }
        Ok(value)
    }

    /// The value of a key as one of some words.
    pub(crate) fn choice<T: Copy>(&self, name: &'static str, words: &[(&str, T)]) -> Result<Option<T>, CliError> {
        let Some(value) = self.get(name) else { return Ok(None) };
        match words.iter().find(|(word, _)| *word == value) {
            Some((_, choice)) => Ok(Some(*choice)),
            None => {
                let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
                Err(self.wrong_word(name, &known.join(" or "), nearest(value, known)))
            }
        }
    }

    /// The error for a value that is not what it should be, with where it came from.
    pub(crate) fn wrong(&self, name: &'static str, expected: &str) -> CliError {
        self.wrong_word(name, expected, None)
    }

    /// The same for a value that may be a slip of the finger for `near`.
    pub(crate) fn wrong_word(&self, name: &'static str, expected: &str, near: Option<&str>) -> CliError {
        let (value, origin) = &self.0[name];
        let hint = near.map_or_else(|| self.meaning(name), |near| format!("did you mean `{near}`?"));
        CliError::usage(format!("{origin}: `{value}` is not {expected}")).hint(hint)
    }

    /// A key and what it means, as a hint.
    pub(crate) fn meaning(&self, name: &'static str) -> String {
        format!("{name}: {}", KEYS.iter().find(|key| key.name == name).map_or("", |key| key.doc))
    }

    /// Name, value, origin and meaning of every key, in the table's order.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&'static Key, &str, &Origin)> {
        KEYS.iter().map(|key| {
            let (value, origin) = &self.0[key.name];
            (key, value.as_str(), origin)
        })
    }
}

/// The variables of `.env`, if there is one.
fn dotenv() -> Result<BTreeMap<String, String>, CliError> {
    let mut variables = BTreeMap::new();
    if Path::new(".env").exists() {
        let lines = dotenvy::from_path_iter(".env").map_err(|error| CliError::usage("cannot read .env").because(&error))?;
        for line in lines {
            // The error would quote the line, and with it perhaps a key.
            let (name, value) = line.map_err(|_| {
                CliError::usage("a line of .env cannot be read").hint("write NAME=value, one a line; quote values with spaces")
            })?;
            variables.insert(name, value);
        }
    }
    Ok(variables)
}

/// Looks variables of others up, such as vendors' keys: the environment over `.env`.
pub(crate) fn variables() -> Result<impl Fn(&str) -> Option<String>, CliError> {
    let dotenv = dotenv()?;
    Ok(move |name: &str| std::env::var(name).ok().or_else(|| dotenv.get(name).cloned()))
}

/// A name that looks like one of our variables and is none. Keys of VLM vendors have other names and are nobody's business here.
fn is_ours(name: &str) -> bool {
    name.starts_with("SPF_") && !KEYS.iter().any(|key| key.env == name)
}

fn unknown_key(path: &impl std::fmt::Display, line: usize, full: &str) -> CliError {
    let hint = match nearest(full, KEYS.iter().map(|key| key.name)) {
        Some(near) => format!("did you mean `{near}`? `spf config show` lists every key"),
        None => "`spf config show` lists every key".to_owned(),
    };
    CliError::usage(format!("{path}:{line}: unknown key `{}`", one_line(full))).hint(hint)
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|byte| **byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<Settings, CliError> {
        let mut settings = Settings(KEYS.iter().map(|key| (key.name, (key.default.to_owned(), Origin::Default))).collect());
        settings.read_text(Path::new("spf.toml"), text)?;
        Ok(settings)
    }

    #[test]
    fn every_key_has_its_own_name_and_variable() {
        for (index, key) in KEYS.iter().enumerate() {
            assert!(key.env.starts_with("SPF_") && key.name.split('.').count() == 2, "{}", key.name);
            assert!(KEYS[..index].iter().all(|other| other.name != key.name && other.env != key.env), "{}", key.name);
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in ".{0,200}", key in "[a-z_.\"\\[\\] ]{0,20}", value in "[-+0-9a-z_.\"'{}\\[\\],]{0,20}") {
            let _ = read(&text);
            let _ = read(&format!("[fly]\n{key} = {value}\n"));
            let _ = read(&format!("[fly]\nscene = {value}\nseed = {value}\n"));
        }

        #[test]
        fn a_value_keeps_its_meaning_and_its_line(text in "[^\\p{Cc}]{0,40}", seed in any::<u64>(), lines in 0usize..5) {
            let quoted = toml::Value::String(text.clone());
            let settings = read(&format!("{}[fly]\nscene = {quoted}\nseed = {seed}\n", "\n".repeat(lines))).unwrap();
            prop_assert_eq!(settings.get("fly.scene").unwrap_or_default(), text);
            prop_assert_eq!(settings.parse::<u64>("fly.seed", "").unwrap(), Some(seed));
            prop_assert_eq!(&settings.0["fly.seed"].1, &Origin::File(PathBuf::from("spf.toml"), lines + 3));
        }
    }
}
