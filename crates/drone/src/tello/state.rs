//! The state line that a Tello sends ten times per second.

/// Maximum length of a line, bytes; real ones have about 250.
const LONGEST: usize = 1024;
/// What to do about a state that cannot be read.
pub(super) const UNREAD: &str = "its firmware writes its state in another form, or another device sends from its address: update it in the \
                                 Tello app, or report what arrives (`sudo tcpdump -nA udp port 8890`)";

/// A state line. Values that a firmware does not send are `None`, never zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// The mission pad in view, 1 to 8.
    pub pad: Option<u8>,
    /// Position relative to that pad, centimetres.
    pub over_pad: Option<[i32; 3]>,
    /// Pitch, positive nose up, degrees.
    pub pitch: Option<i32>,
    /// Roll, positive right side down, degrees.
    pub roll: Option<i32>,
    /// Yaw, clockwise from the heading at power-on, degrees.
    pub yaw: Option<i32>,
    /// Speeds, dm/s, in a firmware-specific frame.
    pub speed: Option<[i32; 3]>,
    /// Lowest and highest temperature, °C.
    pub temperature: Option<[i32; 2]>,
    /// Distance to the ground, centimetres; `None` if out of range.
    pub tof: Option<i32>,
    /// Height above the take-off point, centimetres, in steps of 10.
    pub height: Option<i32>,
    /// Battery charge, per cent.
    pub battery: Option<u8>,
    /// Barometric altitude, metres.
    pub barometer: Option<f64>,
    /// Seconds with motors on.
    pub motor_time: Option<u32>,
    /// Acceleration, 0.001 g.
    pub acceleration: Option<[f64; 3]>,
}

/// Value of the distance sensor when nothing is in range.
const NO_ECHO: i32 = 6553;

impl State {
    /// Parses a datagram from the state port; `None` if it is not a state line. Unknown fields are skipped, and values that are
    /// invalid, or could mean two things, count as missing.
    #[must_use]
    pub fn read(datagram: &[u8]) -> Option<Self> {
        let text = core::str::from_utf8(datagram).ok().filter(|text| text.len() <= LONGEST && text.is_ascii())?;
        let fields = Fields::of(text);
        // Some firmware omits fields; noise has none.
        if NAMES.iter().filter(|name| fields.has(name)).count() < LEAST_FIELDS {
            return None;
        }
        let whole = |name| whole(fields.value(name)?);
        let angle = |name, most| whole(name).filter(|deg: &i32| deg.abs() <= most);
        let pad = whole("mid").and_then(|pad| u8::try_from(pad).ok()).filter(|pad| (1..=8).contains(pad));
        Some(Self {
            pad,
            over_pad: all(["x", "y", "z"].map(whole)).filter(|_| pad.is_some()),
            pitch: angle("pitch", 180),
            roll: angle("roll", 180),
            yaw: angle("yaw", 360),
            speed: all(["vgx", "vgy", "vgz"].map(whole)).filter(|speeds| speeds.iter().all(|dm| dm.abs() <= 200)),
            temperature: all(["templ", "temph"].map(whole)),
            tof: whole("tof").filter(|cm| (0..NO_ECHO).contains(cm)),
            height: whole("h").filter(|cm| cm.abs() <= 10_000),
            battery: whole("bat").and_then(|charge| u8::try_from(charge).ok()).filter(|charge| *charge <= 100),
            barometer: fields.value("baro").and_then(real),
            motor_time: whole("time").and_then(|seconds| u32::try_from(seconds).ok()),
            acceleration: all(["agx", "agy", "agz"].map(|name| fields.value(name).and_then(real))),
        })
    }

    /// The values that a flight needs and this state does not tell, in words.
    #[must_use]
    pub fn missing(&self) -> Vec<&'static str> {
        let needed = [
            ("attitude", self.pitch.and(self.roll).and(self.yaw).is_some()),
            ("speed", self.speed.is_some()),
            ("height", self.height.is_some()),
            ("battery", self.battery.is_some()),
            ("motor time", self.motor_time.is_some()),
        ];
        needed.iter().filter(|(_, told)| !told).map(|(name, _)| *name).collect()
    }
}

/// Names of the fields that are read.
const NAMES: [&str; 20] = [
    "mid", "x", "y", "z", "pitch", "roll", "yaw", "vgx", "vgy", "vgz", "templ", "temph", "tof", "h", "bat", "baro", "time",
    "agx", "agy", "agz",
];
/// A line with fewer of them is none.
const LEAST_FIELDS: usize = 4;

/// The fields of a line, `NAME:VALUE` between semicolons. Other firmware may separate them by line ends, commas or blanks, and names
/// from values by `=`; capitals and blanks around names and values do not matter.
struct Fields<'a>(Vec<(&'a str, &'a str)>);

impl<'a> Fields<'a> {
    fn of(line: &'a str) -> Self {
        let line = line.trim_matches(is_blank);
        // One mark separates all fields: next to semicolons or line ends, a comma belongs to a value.
        let between: fn(char) -> bool = if line.contains(';') {
            |c| c == ';'
        } else if line.contains('\n') {
            |c| c == '\n'
        } else if line.contains(',') {
            |c| c == ','
        } else {
            is_blank
        };
        let mut fields: Vec<(&str, &str)> = Vec::new();
        for field in line.split(between).map(|field| field.trim_matches(is_blank)).filter(|field| !field.is_empty()) {
            match (field.split_once([':', '=']), fields.last_mut()) {
                (Some((name, value)), _) => fields.push((name.trim_matches(is_blank), value.trim_matches(is_blank))),
                // It may belong to the value before it, as in `h:0,80`.
                (None, Some((_, before))) => *before = "",
                (None, None) => {}
            }
        }
        Self(fields)
    }

    fn all(&self, name: &str) -> impl Iterator<Item = &'a str> {
        self.0.iter().filter(move |(other, _)| other.eq_ignore_ascii_case(name)).map(|(_, value)| *value)
    }

    fn has(&self, name: &str) -> bool {
        self.all(name).next().is_some()
    }

    /// The value of a field; `None` if it is not there, or there twice with different values.
    fn value(&self, name: &str) -> Option<&'a str> {
        let mut values = self.all(name);
        let first = values.next()?;
        values.all(|other| other == first).then_some(first)
    }
}

/// Some firmware ends its lines with a zero.
fn is_blank(c: char) -> bool {
    c.is_ascii_whitespace() || c == '\0'
}

/// A whole number, also one that is written with zeros behind its point (`80.00`). With another fraction its unit is not the one that
/// is documented: `h:0.80` may be metres.
fn whole(value: &str) -> Option<i32> {
    let (digits, fraction) = value.split_once('.').unwrap_or((value, ""));
    digits.parse().ok().filter(|_| fraction.bytes().all(|digit| digit == b'0'))
}

fn real(value: &str) -> Option<f64> {
    value.parse().ok().filter(|number: &f64| number.is_finite())
}

fn all<T: Copy, const N: usize>(values: [Option<T>; N]) -> Option<[T; N]> {
    let mut whole = [values[0]?; N];
    for (to, from) in whole.iter_mut().zip(values) {
        *to = from?;
    }
    Some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Published state lines of real drones.
    const OLD: &str = "pitch:1;roll:5;yaw:0;vgx:0;vgy:0;vgz:0;templ:43;temph:46;tof:10;h:0;bat:83;baro:150.12;time:0;agx:15.00;agy:-97.00;agz:-988.00;\r\n";
    const FLYING: &str = "mid:-1;x:-100;y:-100;z:-100;mpry:-1,-1,-1;pitch:0;roll:0;yaw:-3;vgx:0;vgy:0;vgz:1;templ:58;temph:60;tof:71;h:50;bat:82;baro:-57.14;time:14;agx:17.00;agy:-4.00;agz:-956.00;\r\n";
    const PAD: &str = "mid:3;x:-4;y:-3;z:74;mpry:0,0,12;pitch:0;roll:0;yaw:-3;vgx:0;vgy:0;vgz:1;templ:58;temph:60;tof:6553;h:50;bat:82;baro:-57.14;time:14;agx:17.00;agy:-4.00;agz:-956.00;";

    #[test]
    fn lines_of_real_drones_are_read_whole() {
        let old = State::read(OLD.as_bytes()).unwrap();
        assert_eq!((old.roll, old.tof, old.battery, old.temperature), (Some(5), Some(10), Some(83), Some([43, 46])));
        assert_eq!((old.pad, old.over_pad, old.acceleration), (None, None, Some([15.0, -97.0, -988.0])));
        let flying = State::read(FLYING.as_bytes()).unwrap();
        assert_eq!((flying.yaw, flying.speed, flying.height, flying.motor_time), (Some(-3), Some([0, 0, 1]), Some(50), Some(14)));
        assert_eq!((flying.barometer, flying.pad), (Some(-57.14), None));
        let pad = State::read(PAD.as_bytes()).unwrap();
        assert_eq!((pad.pad, pad.over_pad, pad.tof), (Some(3), Some([-4, -3, 74]), None));
    }

    #[test]
    fn nonsense_is_no_state() {
        for text in ["", "ok", "error", "pitch:1;roll:2", "\u{fffd}"] {
            assert_eq!(State::read(text.as_bytes()), None, "{text}");
        }
        let damaged = State::read(b"pitch:1;roll:x;yaw:999;vgx:1;vgy:;vgz:0;bat:255;h:1e9;tof:-4;baro:nan;").unwrap();
        assert_eq!(damaged, State { pitch: Some(1), ..State::default() });
    }

    #[test]
    fn what_could_mean_two_things_is_unknown() {
        let read = |fields: &str| State::read(format!("pitch:0;roll:0;yaw:0;time:3;{fields};").as_bytes()).unwrap();
        for fields in ["h:0.80", "h:80cm", "h:", "h:0,80", "h:80;h:0", "h:8.5e1", "h:..", "h: - 8", "h:80;00", "h"] {
            assert_eq!(read(fields).height, None, "{fields}");
        }
        for fields in ["bat:87%", "bat:0.87", "bat:870.00", "bat:", "bat:87;BAT:12"] {
            assert_eq!(read(fields).battery, None, "{fields}");
        }
        // A decimal comma in a line whose fields commas separate.
        let state = State::read(b"pitch:0,roll:0,yaw:0,time:3,h:0,80,bat:87").unwrap();
        assert_eq!((state.height, state.battery), (None, Some(87)));
        // The three values of a field that is not read are no fields without a name.
        let state = State::read(b"mpry:-1,-1,-1,pitch:0,roll:0,yaw:0,h:80").unwrap();
        assert_eq!(state.height, Some(80));
    }

    #[test]
    fn the_values_that_a_flight_misses_are_named() {
        assert!(State::read(FLYING.as_bytes()).unwrap().missing().is_empty());
        let state = State::read(b"pitch:0;roll:0;yaw:0;h:0.80;tof:x;bat:87;vgx:0;vgy:0;vgz:0").unwrap();
        assert_eq!(state.missing(), ["height", "motor time"]);
        assert_eq!(State::default().missing(), ["attitude", "speed", "height", "battery", "motor time"]);
    }

    /// A line with these values, as some firmware might write it: `decimals` zeros behind the point of each whole number, blanks
    /// around names and values, and another mark between the fields, and between name and value.
    fn written(values: &[(&str, i32)], decimals: usize, blanks: usize, between: &str, is: &str, capitals: bool) -> String {
        let fraction = if decimals == 0 { String::new() } else { format!(".{}", "0".repeat(decimals)) };
        let blank = " ".repeat(blanks);
        let field = |(name, value): &(&str, i32)| {
            let name = if capitals { name.to_uppercase() } else { (*name).to_owned() };
            format!("{blank}{name}{blank}{is}{blank}{value}{fraction}{blank}")
        };
        values.iter().map(field).collect::<Vec<_>>().join(between)
    }

    proptest! {
        #[test]
        fn another_firmware_is_read_as_this_one(
            (height, tof, battery, motor_time) in (-300..3000_i32, 0..900_i32, 0..=100_i32, 0..999_i32),
            angles in proptest::array::uniform3(-180..=180_i32),
            speeds in proptest::array::uniform3(-100..=100_i32),
            (decimals, blanks, between) in prop_oneof![
                (0..4_usize, 0..3_usize, prop::sample::select(vec![";", ",", "\r\n", ";\r\n"])),
                // Blanks that separate fields cannot be within one.
                (0..4_usize, Just(0), prop::sample::select(vec![" ", "  ", "\t"])),
            ],
            is in prop::sample::select(vec![":", "="]),
            capitals: bool,
        ) {
            let [pitch, roll, yaw] = angles;
            let [x, y, z] = speeds;
            let values = [
                ("pitch", pitch), ("roll", roll), ("yaw", yaw), ("vgx", x), ("vgy", y), ("vgz", z), ("tof", tof),
                ("h", height), ("bat", battery), ("time", motor_time),
            ];
            let line = written(&values, decimals, blanks, between, is, capitals);
            let state = State {
                pitch: Some(pitch), roll: Some(roll), yaw: Some(yaw), speed: Some(speeds), tof: Some(tof), height: Some(height),
                battery: u8::try_from(battery).ok(), motor_time: u32::try_from(motor_time).ok(), ..State::default()
            };
            prop_assert_eq!(State::read(line.as_bytes()), Some(state), "{}", line);
        }

        /// Whatever a value looks like, none is made up: it is the number that is written there, or unknown.
        #[test]
        fn a_value_is_what_is_written_or_unknown(text in "[-+0-9., ]{0,8}", between in prop::sample::select(vec![";", ",", "\n"])) {
            let line = ["pitch:0", "roll:0", "yaw:0", "vgx:0", &format!("h:{text}"), "bat:50"].join(between);
            let state = State::read(line.as_bytes()).unwrap();
            prop_assert_eq!(state.battery, Some(50));
            if let Some(height) = state.height {
                prop_assert_eq!(text.trim_matches([',', ' ']).parse::<f64>().ok(), Some(f64::from(height)), "{}", line);
            }
        }

        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..1500), at in 0_usize..200, byte: u8) {
            let _ = State::read(&bytes);
            let mut line = FLYING.as_bytes().to_vec();
            let at = at % line.len();
            line[at] = byte;
            let _ = State::read(&line);
        }
    }
}
