//! Error files: statistical errors of the oracle's answers (`docs/explanation/oracle.md`, "Error files").
//!
//! A file is TOML. Every key must be present, so that the file alone documents a run.

use serde::Deserialize;
use spf_core::reply::DEPTH_LABELS;
use thiserror::Error;

use super::language::spelling;
use super::obedience::Obedience;

/// The built-in files: name and text.
const SHIPPED: [(&str, &str); 6] = [
    ("perfect", include_str!("errors/perfect.toml")),
    ("default", include_str!("errors/default.toml")),
    ("poor", include_str!("errors/poor.toml")),
    ("size", include_str!("errors/size.toml")),
    ("linear", include_str!("errors/linear.toml")),
    ("intended", include_str!("errors/intended.toml")),
];

/// Tables of the file and their keys, for suggesting the nearest one.
const KEYS: [(&str, &[&str]); 9] = [
    ("seen", &["half_px", "sure_px", "missed"]),
    ("point", &["width_share", "size_share"]),
    ("range", &["log_sd"]),
    ("label", &["reading", "off_by_two", "per_decade", "share_at_1", "share_at_10", "farthest_m", "share", "lengths_m"]),
    ("which", &["confused"]),
    ("done", &["log_width"]),
    ("boxes", &["missed", "spurious", "corridor_m"]),
    ("act", &["bearing_step_deg", "log_sd"]),
    ("latency", &["median_s", "p95_s"]),
];

/// Why an error file was rejected.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ErrorFileError {
    /// No built-in file has this name.
    #[error("unknown oracle error profile `{name}`; the built-in ones are {}", names())]
    Name {
        /// The name given.
        name: String,
    },
    /// A stand-in that obeys signs, without a probability.
    #[error("`{name}` needs the probability with which it obeys a sign, from 0 to 1: for example `gullible@0.5`")]
    Obedience {
        /// The name given.
        name: String,
    },
    /// Invalid TOML, or a key is missing or of the wrong type.
    #[error("error file: {0}")]
    Format(String),
    /// An unknown key.
    #[error("error file: unknown key `{key}`; did you mean `{nearest}`?")]
    UnknownKey {
        /// Table and key, `table.key`.
        key: String,
        /// The most similar known key.
        nearest: String,
    },
    /// A value out of its range.
    #[error("error file: `{key}` is {value}, but must be {must}")]
    Value {
        /// Table and key.
        key: &'static str,
        /// The value found.
        value: f64,
        /// The range in words.
        must: &'static str,
    },
}

fn names() -> String {
    SHIPPED.map(|(name, _)| format!("`{name}`")).join(", ")
}

/// The errors of the oracle. All fractions are 0..=1.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorFile {
    /// Whether a visible object is noticed.
    pub seen: SeenErrors,
    /// Noise of the point.
    pub point: PointErrors,
    /// Noise of the range.
    pub range: RangeErrors,
    /// Meaning of the depth label.
    pub label: LabelErrors,
    /// Confusion of targets.
    pub which: WhichErrors,
    /// Errors in judging completion.
    pub done: DoneErrors,
    /// Obstacle boxes.
    pub boxes: BoxErrors,
    /// Text actions.
    pub act: ActErrors,
    /// Latency.
    pub latency: LatencyErrors,
    /// How often it obeys signs; `None` for an oracle that does not read. Given by name only ([`ErrorFile::named`]), so that no
    /// run with it can have another name.
    #[serde(skip)]
    pub obeys: Option<Obedience>,
}

/// *seen*: logistic function of the square root of the visible pixels at the size sent.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenErrors {
    /// Square root of the pixel count at which half of the objects are seen.
    pub half_px: f64,
    /// Square root of the pixel count at which 95 % are seen; equal to `half_px` for a hard threshold.
    pub sure_px: f64,
    /// Fraction missed in addition, whatever the size.
    pub missed: f64,
}

/// *point*: the standard deviation is the larger of the two.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointErrors {
    /// As a fraction of the image's width.
    pub width_share: f64,
    /// As a fraction of the square root of the object's visible area.
    pub size_share: f64,
}

/// *range*: multiplicative error exp N(0, sd).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeErrors {
    /// Standard deviation of the logarithm.
    pub log_sd: f64,
}

/// *depth label*: its meaning, and gross errors.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct LabelErrors {
    /// Meaning of a label.
    #[serde(flatten)]
    pub reading: Reading,
    /// Fraction of answers whose label is off by two, up or down.
    pub off_by_two: f64,
}

/// Meaning of a depth label. Never derived from the flight's settings (s, p, d_min, speeds) or the judge's radius.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "reading", rename_all = "snake_case")]
pub enum Reading {
    /// `round(1 + per_decade · log10(range / 1 m))`.
    RangeLog {
        /// Labels per factor of ten; 4.5 puts 10 at 100 m.
        per_decade: f64,
    },
    /// `round(L · range / farthest_m)`.
    RangeLinear {
        /// Range of label 10, metres.
        farthest_m: f64,
    },
    /// Linear in the fraction of the image height that the object fills.
    Size {
        /// Fraction for label 1.
        share_at_1: f64,
        /// Fraction for label 10.
        share_at_10: f64,
    },
    /// The highest label whose length is at most `fraction · range`.
    IntendedTravel {
        /// Fraction of the range to fly.
        #[serde(rename = "share")]
        fraction: f64,
        /// Length of each label, metres, ascending.
        lengths_m: [f64; DEPTH_LABELS as usize],
    },
}

/// *which*: confusion of objects.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WhichErrors {
    /// Fraction of answers that take the most similar visible object instead.
    pub confused: f64,
}

/// *done*: `P = logistic(ln(near / range) / log_width)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DoneErrors {
    /// Width of the logistic; 0 for a hard threshold.
    pub log_width: f64,
}

/// *boxes*: errors in obstacle mode.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxErrors {
    /// Fraction of obstacles not reported.
    pub missed: f64,
    /// Fraction of frames with a box around nothing.
    pub spurious: f64,
    /// Half the width of the corridor considered necessary for a drone, metres.
    pub corridor_m: f64,
}

/// *act*: errors of text actions.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActErrors {
    /// Bearings are rounded to this, degrees.
    pub bearing_step_deg: f64,
    /// Standard deviation of the logarithm of the guessed distance.
    pub log_sd: f64,
}

/// *latency*: log-normal.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatencyErrors {
    /// Median, seconds.
    pub median_s: f64,
    /// 95th percentile, seconds.
    pub p95_s: f64,
}

impl ErrorFile {
    /// A built-in file: `perfect`, `default`, `poor`, `size`, `linear` or `intended`. `gullible@Q` is `default` that obeys each
    /// legible sign with probability Q, drawn once for a flight; `gullible-frame@Q` draws for each frame;
    /// `gullible-quoted@Q` does not go on with what a sign said when only its history says so.
    ///
    /// # Errors
    /// [`ErrorFileError::Name`] if there is none with this name, [`ErrorFileError::Obedience`] for a probability that is none.
    pub fn named(name: &str) -> Result<Self, ErrorFileError> {
        if let Some(obeys) = Obedience::named(name) {
            let obeys = obeys.ok_or_else(|| ErrorFileError::Obedience { name: name.to_owned() })?;
            return Ok(Self { obeys: Some(obeys), ..Self::default() });
        }
        let Some((_, text)) = SHIPPED.iter().find(|(shipped, _)| *shipped == name) else {
            return Err(ErrorFileError::Name { name: name.to_owned() });
        };
        Self::from_toml(text)
    }

    /// The names accepted by [`ErrorFile::named`].
    #[must_use]
    pub fn shipped() -> [&'static str; 6] {
        SHIPPED.map(|(name, _)| name)
    }

    /// Parses and validates an error file.
    ///
    /// # Errors
    /// [`ErrorFileError`] for invalid TOML, unknown or missing keys, and values out of range.
    pub fn from_toml(text: &str) -> Result<Self, ErrorFileError> {
        let table: toml::Table =
            text.parse().map_err(|e: toml::de::Error| ErrorFileError::Format(e.to_string().trim().to_owned()))?;
        known_keys(&table)?;
        let file: Self = toml::from_str(text).map_err(|e| ErrorFileError::Format(e.to_string().trim().to_owned()))?;
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<(), ErrorFileError> {
        let within = |key, value: f64, low: f64, high: f64, must| {
            if value >= low && value <= high { Ok(()) } else { Err(ErrorFileError::Value { key, value, must }) }
        };
        for (key, value) in [
            ("seen.missed", self.seen.missed),
            ("point.width_share", self.point.width_share),
            ("point.size_share", self.point.size_share),
            ("label.off_by_two", self.label.off_by_two),
            ("which.confused", self.which.confused),
            ("boxes.missed", self.boxes.missed),
            ("boxes.spurious", self.boxes.spurious),
        ] {
            within(key, value, 0.0, 1.0, "between 0 and 1")?;
        }
        for (key, value) in
            [("range.log_sd", self.range.log_sd), ("done.log_width", self.done.log_width), ("act.log_sd", self.act.log_sd)]
        {
            within(key, value, 0.0, 3.0, "between 0 and 3")?;
        }
        within("seen.half_px", self.seen.half_px, 0.0, 1e4, "between 0 and 10000")?;
        within("seen.sure_px", self.seen.sure_px, self.seen.half_px, 1e4, "at least `seen.half_px`")?;
        within("boxes.corridor_m", self.boxes.corridor_m, 0.0, 100.0, "between 0 and 100")?;
        within("act.bearing_step_deg", self.act.bearing_step_deg, 0.01, 90.0, "between 0.01 and 90")?;
        within("latency.median_s", self.latency.median_s, 0.001, 600.0, "between 0.001 and 600")?;
        within("latency.p95_s", self.latency.p95_s, self.latency.median_s, 3600.0, "at least `latency.median_s`")?;
        match &self.label.reading {
            Reading::RangeLog { per_decade } => within("label.per_decade", *per_decade, 0.01, 100.0, "between 0.01 and 100"),
            Reading::RangeLinear { farthest_m } => within("label.farthest_m", *farthest_m, 0.1, 1e5, "between 0.1 and 100000"),
            Reading::Size { share_at_1, share_at_10 } => {
                within("label.share_at_1", *share_at_1, 0.0, 1.0, "between 0 and 1")?;
                within("label.share_at_10", *share_at_10, 0.0, 1.0, "between 0 and 1")?;
                within("label.share_at_1", *share_at_1, *share_at_10 + 1e-6, 1.0, "more than `label.share_at_10`")
            }
            Reading::IntendedTravel { fraction, lengths_m } => {
                within("label.share", *fraction, 0.001, 1.0, "between 0.001 and 1")?;
                for pair in lengths_m.windows(2) {
                    within("label.lengths_m", pair[1], pair[0], 1e5, "ascending")?;
                }
                within("label.lengths_m", lengths_m[0], 0.0, 1e5, "not negative")
            }
        }
    }
}

impl Default for ErrorFile {
    /// The built-in file `default`.
    fn default() -> Self {
        Self::named("default").expect("the shipped file is checked by a test")
    }
}

/// Reports the first unknown key with the nearest known one.
fn known_keys(table: &toml::Table) -> Result<(), ErrorFileError> {
    for (name, value) in table {
        let Some((_, keys)) = KEYS.iter().find(|(known, _)| known == name) else {
            let nearest = spelling::nearest(name, KEYS.iter().map(|(known, _)| *known)).unwrap_or("seen");
            return Err(ErrorFileError::UnknownKey { key: name.clone(), nearest: nearest.to_owned() });
        };
        let Some(inner) = value.as_table() else { continue };
        for key in inner.keys() {
            if !keys.contains(&key.as_str()) {
                let nearest = spelling::nearest(key, keys.iter().copied()).unwrap_or(keys[0]);
                return Err(ErrorFileError::UnknownKey { key: format!("{name}.{key}"), nearest: format!("{name}.{nearest}") });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_file_reads() {
        for name in ErrorFile::shipped() {
            ErrorFile::named(name).unwrap();
        }
        let default = ErrorFile::named("default").unwrap();
        assert_eq!(default, ErrorFile::default());
        assert!((default.range.log_sd - 0.2).abs() < 1e-12 && (default.which.confused - 0.03).abs() < 1e-12);
        let poor = ErrorFile::named("poor").unwrap();
        assert!((poor.seen.missed - 0.1).abs() < 1e-12 && (poor.label.off_by_two - 0.2).abs() < 1e-12);
    }

    #[test]
    fn the_intended_table_is_the_paper_s_ten_steps() {
        let Reading::IntendedTravel { lengths_m, .. } = ErrorFile::named("intended").unwrap().label.reading else {
            panic!("wrong reading");
        };
        for (i, length) in lengths_m.iter().enumerate() {
            // Paper §3.2: 10·(k/10)^1.8.
            let step = 10.0 * libm::pow((i + 1) as f64 / 10.0, 1.8);
            assert!((length - step).abs() < 6e-4, "{length} {step}");
        }
    }

    #[test]
    fn mistakes_are_named() {
        let text = SHIPPED[1].1;
        assert_eq!(
            ErrorFile::from_toml(&text.replace("median_s", "medain_s")).unwrap_err().to_string(),
            "error file: unknown key `latency.medain_s`; did you mean `latency.median_s`?"
        );
        assert_eq!(
            ErrorFile::from_toml(&text.replace("confused = 0.03", "confused = 3.0")).unwrap_err().to_string(),
            "error file: `which.confused` is 3, but must be between 0 and 1"
        );
        assert!(ErrorFile::named("perfekt").unwrap_err().to_string().contains("`perfect`"));
        assert!(matches!(ErrorFile::from_toml("seen = ["), Err(ErrorFileError::Format(_))));
        assert!(matches!(ErrorFile::from_toml("[seen]\nhalf_px = 1"), Err(ErrorFileError::Format(_))));
    }

    proptest::proptest! {
        /// A damaged built-in file is either valid or rejected.
        #[test]
        fn a_damaged_file_is_read_or_refused(file in 0..SHIPPED.len(), from in 0.0..1.0_f64, length in 0..12_usize, put in "[ -~\n]{0,6}") {
            let mut bytes = SHIPPED[file].1.as_bytes().to_vec();
            let from = (from * bytes.len() as f64) as usize;
            let to = (from + length).min(bytes.len());
            bytes.splice(from..to, put.bytes());
            match ErrorFile::from_toml(&String::from_utf8_lossy(&bytes)) {
                Ok(read) => {
                    for rate in [read.which.confused, read.seen.missed, read.boxes.missed, read.label.off_by_two] {
                        assert!((0.0..=1.0).contains(&rate), "{rate}");
                    }
                    assert!(read.latency.median_s > 0.0 && read.latency.p95_s >= read.latency.median_s, "{:?}", read.latency);
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}
