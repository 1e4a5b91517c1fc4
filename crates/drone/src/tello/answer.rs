//! A Tello's responses, and explanations of its errors. The set of strings is open, as it depends on the firmware.

/// A response.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Ok,
    /// A requested value.
    Value(String),
    /// Refused or aborted, in the drone's words.
    Refused(String),
    /// The late response of a manoeuvre that `stop` ended; belongs to no command.
    ForcedStop,
    /// Not a response: the binary protocol of the app, or damaged data.
    Noise,
}

/// Maximum length of a response, bytes.
const LONGEST: usize = 256;

impl Answer {
    /// Parses a datagram from the command port.
    #[must_use]
    pub fn read(datagram: &[u8]) -> Self {
        let text = core::str::from_utf8(datagram).ok().filter(|text| text.len() <= LONGEST && text.is_ascii());
        let Some(text) = text.map(|text| text.trim_matches(|c: char| c.is_ascii_whitespace() || c == '\0')) else {
            return Self::Noise;
        };
        if text.is_empty() || text.chars().any(|c| c.is_ascii_control() && c != '\r' && c != '\n') {
            return Self::Noise;
        }
        let lower = text.to_ascii_lowercase();
        if lower == "ok" || lower.starts_with("ok,") {
            Self::Ok
        } else if lower.starts_with("forced stop") {
            Self::ForcedStop
        } else if REFUSALS.iter().any(|refusal| lower.starts_with(refusal)) {
            Self::Refused(text.to_owned())
        } else {
            Self::Value(text.to_owned())
        }
    }
}

const REFUSALS: [&str; 5] = ["error", "out of range", "unknown command", "unactive", "false"];

/// Prefixes of error responses, longest first if one contains another, and what to do about them.
const EXPLAINED: [(&str, &str); 10] = [
    ("error motor stop", "its motors are off: it reports being on the ground, or the battery is empty"),
    (
        "error no valid imu",
        "no visual odometry: too dark, a glossy or featureless floor, or not calibrated in the app; velocity commands still work",
    ),
    ("error not joystick", "the previous command was still in progress"),
    ("error auto land", "automatic landing: low battery, or 15 s without a command"),
    ("error no valid marker", "no mission pad in view"),
    ("error not valid marker", "no mission pad in view"),
    ("error run timeout", "the move did not finish within 15 s"),
    ("out of range", "a value outside the SDK's limits: please report this as a bug"),
    ("unknown command", "the firmware does not support this command: update it in the Tello app"),
    ("unactive", "activate the Tello in the app"),
];

/// Explains an error response to a user.
#[must_use]
pub fn explain(refusal: &str) -> &'static str {
    let lower = refusal.trim().to_ascii_lowercase();
    EXPLAINED.iter().find(|(beginning, _)| lower.starts_with(beginning)).map_or(
        "no reason given; possible causes: battery below 10 %, not activated in the app, or not in a suitable state",
        |(_, meaning)| meaning,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn answers_are_distinguished() {
        let read = |text: &str| Answer::read(text.as_bytes());
        for ok in ["ok", "OK", "ok\r\n", " ok\0"] {
            assert_eq!(read(ok), Answer::Ok, "{ok:?}");
        }
        assert_eq!(read("ok,drone will reboot"), Answer::Ok);
        assert_eq!(read("87\r\n"), Answer::Value("87".to_owned()));
        for refused in ["error", "error No valid imu", "Out of Range", "unknown command: keepalive", "FALSE", "unactived"] {
            assert_eq!(read(refused), Answer::Refused(refused.to_owned()));
        }
        assert_eq!(read("forced stop"), Answer::ForcedStop);
        assert_eq!(Answer::read(&[0xcc, 0x60, 0x00, 0xff]), Answer::Noise);
        assert_eq!(read(""), Answer::Noise);
    }

    #[test]
    fn every_known_refusal_is_explained_apart() {
        let known = [
            "error Motor stop",
            "error No valid imu",
            "error Not joystick",
            "error Auto land",
            "error No valid marker",
            "error Run timeout",
            "Out of range",
            "unknown command: go",
            "unactived",
        ];
        let mut meanings: Vec<&str> = known.iter().map(|refusal| explain(refusal)).collect();
        meanings.push(explain("error"));
        meanings.sort_unstable();
        meanings.dedup();
        assert_eq!(meanings.len(), known.len() + 1);
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            if let Answer::Refused(text) | Answer::Value(text) = Answer::read(&bytes) {
                prop_assert!(!explain(&text).is_empty());
            }
        }
    }
}
