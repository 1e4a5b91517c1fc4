//! The state line that a Tello sends ten times per second.

/// Maximum length of a line, bytes; real ones have about 250.
const LONGEST: usize = 1024;

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
    /// Parses a datagram from the state port; `None` if it is not a state line. Unknown fields are skipped, and invalid
    /// values count as missing.
    #[must_use]
    pub fn read(datagram: &[u8]) -> Option<Self> {
        let text = core::str::from_utf8(datagram).ok().filter(|text| text.len() <= LONGEST && text.is_ascii())?;
        let mut state = Self::default();
        let (mut speed, mut pad, mut heat, mut acceleration) = ([None; 3], [None; 3], [None; 2], [None; 3]);
        let mut known = 0;
        for field in text.trim_end().split(';') {
            let Some((name, value)) = field.split_once(':') else { continue };
            known += 1;
            match name.trim() {
                "mid" => state.pad = value.parse().ok().filter(|pad| (1..=8).contains(pad)),
                "x" => pad[0] = whole(value),
                "y" => pad[1] = whole(value),
                "z" => pad[2] = whole(value),
                "pitch" => state.pitch = whole(value).filter(|deg| deg.abs() <= 180),
                "roll" => state.roll = whole(value).filter(|deg| deg.abs() <= 180),
                "yaw" => state.yaw = whole(value).filter(|deg| deg.abs() <= 360),
                "vgx" => speed[0] = whole(value),
                "vgy" => speed[1] = whole(value),
                "vgz" => speed[2] = whole(value),
                "templ" => heat[0] = whole(value),
                "temph" => heat[1] = whole(value),
                "tof" => state.tof = whole(value).filter(|cm| (0..NO_ECHO).contains(cm)),
                "h" => state.height = whole(value).filter(|cm| cm.abs() <= 10_000),
                "bat" => state.battery = value.parse().ok().filter(|charge| *charge <= 100),
                "baro" => state.barometer = real(value),
                "time" => state.motor_time = value.parse().ok(),
                "agx" => acceleration[0] = real(value),
                "agy" => acceleration[1] = real(value),
                "agz" => acceleration[2] = real(value),
                _ => known -= 1,
            }
        }
        // Some firmware omits fields; noise has none.
        if known < 4 {
            return None;
        }
        state.speed = all(speed).filter(|speeds| speeds.iter().all(|dm| dm.abs() <= 200));
        state.over_pad = all(pad).filter(|_| state.pad.is_some());
        state.temperature = all(heat);
        state.acceleration = all(acceleration);
        Some(state)
    }
}

fn whole(value: &str) -> Option<i32> {
    value.trim().parse().ok()
}

fn real(value: &str) -> Option<f64> {
    value.trim().parse().ok().filter(|number: &f64| number.is_finite())
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

    proptest! {
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
