//! Settings of the effects, and their one-line text form.

use std::str::FromStr;

use spf_core::camera::Distortion;
use spf_core::time::{Duration, duration_from_secs};

use super::compression::Compression;
use super::lens::Lens;

/// Maximum length of a list, bytes.
const LONGEST: usize = 400;

/// Exposure of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// Exposure compensation in stops; positive is brighter.
    Stops(f64),
    /// Automatic: the mean is brought to middle grey, without delay, by at most three stops.
    Automatic,
}

/// Image effects of a camera; none by default.
///
/// As text: names joined by commas, each optionally with `=STRENGTH`. `none` selects no effect, `all` every effect.
///
/// | name | strength | default |
/// |---|---|---|
/// | `blur` | shutter time, milliseconds | 10 |
/// | `noise` | standard deviation at middle grey, in 8-bit levels | 3 |
/// | `exposure` | stops, or `auto` | `auto` |
/// | `lens` | a name of [`Lens::names`], or `k1:k2:p1:p2` | `wide` |
/// | `compression` | `jpeg:QUALITY` or `h264:QUANTISER` | `jpeg:50` |
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Effects {
    /// The lens; `None` for an undistorted pinhole camera.
    pub lens: Option<Lens>,
    /// Shutter time; `None` for an instantaneous exposure.
    pub shutter: Option<Duration>,
    /// Exposure; `None` leaves the rendered image unchanged.
    pub exposure: Option<Exposure>,
    /// Standard deviation of the noise at middle grey, in 8-bit levels.
    pub noise: Option<f64>,
    /// Compression of the video link.
    pub compression: Option<Compression>,
}

/// Why a list of effects is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EffectsError {
    /// Unknown effect.
    #[error("unknown camera effect `{0}`: use blur, noise, exposure, lens, compression, all or none")]
    Unknown(String),
    /// An effect is named more than once.
    #[error("duplicate effect `{0}`")]
    Twice(&'static str),
    /// The strength is invalid for this effect.
    #[error("invalid strength `{value}` for `{effect}`: expected {expected}")]
    Strength {
        /// The effect.
        effect: &'static str,
        /// The text given.
        value: String,
        /// The expected form and range.
        expected: String,
    },
    /// The list is too long.
    #[error("the list of camera effects exceeds {LONGEST} bytes")]
    TooLong,
}

/// The effects, in the order in which they are written.
const WORDS: [&str; 5] = ["lens", "blur", "exposure", "noise", "compression"];

impl Effects {
    /// Whether images are left unchanged.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    fn set(&mut self, effect: &'static str, value: &str) -> Result<(), EffectsError> {
        let usual = |usual: &'static str| if value.is_empty() { usual.to_owned() } else { value.to_owned() };
        let wrong = |expected: &str| EffectsError::Strength { effect, value: value.to_owned(), expected: expected.to_owned() };
        let named = match effect {
            "lens" => {
                let expected = || format!("{} or k1:k2:p1:p2", Lens::names().join(", "));
                let lens = lens(&usual("wide")).ok_or_else(|| wrong(&expected()))?;
                self.lens.replace(lens).is_some()
            }
            "blur" => {
                let millis = number(&usual("10"), 0.1, 200.0).ok_or_else(|| wrong("milliseconds from 0.1 to 200"))?;
                self.shutter.replace(duration_from_secs(millis / 1000.0)).is_some()
            }
            "exposure" => {
                let exposure = match usual("auto").as_str() {
                    "auto" => Exposure::Automatic,
                    stops => Exposure::Stops(number(stops, -6.0, 6.0).ok_or_else(|| wrong("auto, or stops from -6 to 6"))?),
                };
                self.exposure.replace(exposure).is_some()
            }
            "noise" => {
                let levels = number(&usual("3"), 0.0, 100.0).ok_or_else(|| wrong("8-bit grey levels, from 0 to 100"))?;
                self.noise.replace(levels).is_some()
            }
            _ => {
                let compression = compression(&usual("jpeg:50"));
                let expected = "jpeg:QUALITY from 1 to 100, or h264:QUANTISER from 10 (fine) to 40 (coarse)";
                self.compression.replace(compression.ok_or_else(|| wrong(expected))?).is_some()
            }
        };
        if named { Err(EffectsError::Twice(effect)) } else { Ok(()) }
    }
}

fn number(text: &str, low: f64, high: f64) -> Option<f64> {
    text.parse().ok().filter(|value| (low..=high).contains(value))
}

fn lens(text: &str) -> Option<Lens> {
    if let Some(lens) = Lens::named(text) {
        return Some(lens);
    }
    let figures: Vec<f64> = text.split(':').map(|figure| number(figure, -10.0, 10.0)).collect::<Option<_>>()?;
    let [k1, k2, p1, p2] = *figures.as_slice() else { return None };
    Some(Lens::Distorted(Distortion { k1, k2, p1, p2 }))
}

fn compression(text: &str) -> Option<Compression> {
    let (codec, strength) = text.split_once(':')?;
    let strength: u8 = strength.parse().ok()?;
    match codec {
        "jpeg" if (1..=100).contains(&strength) => Some(Compression::Jpeg(strength)),
        "h264" if (10..=40).contains(&strength) => Some(Compression::H264(strength)),
        _ => None,
    }
}

impl FromStr for Effects {
    type Err = EffectsError;

    fn from_str(text: &str) -> Result<Self, EffectsError> {
        if text.len() > LONGEST {
            return Err(EffectsError::TooLong);
        }
        let mut effects = Self::default();
        if matches!(text.trim(), "" | "none") {
            return Ok(effects);
        }
        let mut all = false;
        for word in text.split(',') {
            let (name, value) = word.split_once('=').unwrap_or((word, ""));
            match WORDS.iter().find(|known| **known == name.trim()) {
                Some(effect) => effects.set(effect, value.trim())?,
                None if name.trim() == "all" && value.is_empty() => all = true,
                None => return Err(EffectsError::Unknown(name.trim().to_owned())),
            }
        }
        if all {
            // Effects that were named keep their strength.
            for effect in WORDS {
                let named = effects.clone();
                if effects.set(effect, "").is_err() {
                    effects = named;
                }
            }
        }
        Ok(effects)
    }
}

impl std::fmt::Display for Effects {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = [
            self.lens.as_ref().map(|lens| format!("lens={lens}")),
            self.shutter.map(|shutter| format!("blur={}", shutter.as_nanos() as f64 / 1e6)),
            self.exposure.map(|exposure| match exposure {
                Exposure::Automatic => "exposure=auto".to_owned(),
                Exposure::Stops(stops) => format!("exposure={stops}"),
            }),
            self.noise.map(|levels| format!("noise={levels}")),
            self.compression.map(|compression| format!("compression={compression}")),
        ];
        let parts: Vec<String> = words.into_iter().flatten().collect();
        f.write_str(if parts.is_empty() { "none".to_owned() } else { parts.join(",") }.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<Effects, String> {
        text.parse::<Effects>().map_err(|error| error.to_string())
    }

    #[test]
    fn words_have_their_usual_strength() {
        let all = "lens=wide,blur=10,exposure=auto,noise=3,compression=jpeg:50";
        assert_eq!(read("all").unwrap().to_string(), all);
        assert_eq!(read("blur, noise,lens,exposure,compression").unwrap().to_string(), all);
        assert_eq!(read("all,noise=8").unwrap().to_string(), all.replace("noise=3", "noise=8"));
        assert!(read("none").unwrap().is_none() && read("").unwrap().is_none());
    }

    #[test]
    fn errors_list_what_is_accepted() {
        assert_eq!(
            read("blurr").unwrap_err(),
            "unknown camera effect `blurr`: use blur, noise, exposure, lens, compression, all or none"
        );
        assert_eq!(read("blur=0").unwrap_err(), "invalid strength `0` for `blur`: expected milliseconds from 0.1 to 200");
        assert_eq!(read("noise,noise=2").unwrap_err(), "duplicate effect `noise`");
        assert_eq!(
            read("lens=fish").unwrap_err(),
            "invalid strength `fish` for `lens`: expected tello_ros, tello_ros2, tello_course, wide or k1:k2:p1:p2"
        );
        for text in ["none,blur", "compression=png", "compression=jpeg:101", "exposure=NaN", "lens=1:2:3", "lens=1:2:3:inf", ","]
        {
            assert!(read(text).is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in ".{0,60}", words in "(blur|noise|exposure|lens|compression|all|,|=|:|[0-9.-]){0,12}") {
            for text in [text, words] {
                if let Ok(effects) = read(&text) {
                    prop_assert_eq!(read(&effects.to_string()), Ok(effects));
                }
            }
        }
    }
}
