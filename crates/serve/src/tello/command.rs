//! Parses client commands: one per datagram, plain ASCII, no terminator needed.

use super::figures::Firmware;

/// Maximum length of a datagram, bytes; the SDK's longest command is far shorter.
pub const MAX_DATAGRAM: usize = 512;

/// Direction of `up`, `forward` and similar commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Up.
    Up,
    /// Down.
    Down,
    /// Left.
    Left,
    /// Right.
    Right,
    /// Forward.
    Forward,
    /// Back.
    Back,
}

/// A displacement in the SDK's body axes, centimetres: x forward, y left, z up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Offset {
    /// Forward.
    pub x: i32,
    /// To the left.
    pub y: i32,
    /// Up.
    pub z: i32,
}

/// A value requested by a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Read {
    /// Charge in per cent.
    Battery,
    /// The configured speed, cm/s.
    Speed,
    /// Time with motors on, seconds.
    Time,
    /// Wi-Fi signal-to-noise ratio.
    Wifi,
    /// SDK version.
    Sdk,
    /// Serial number.
    Serial,
    /// Height, dm.
    Height,
    /// Lowest and highest temperature, °C.
    Temperature,
    /// Attitude, degrees.
    Attitude,
    /// Barometer, metres.
    Barometer,
    /// Acceleration, 0.001 g.
    Acceleration,
    /// Distance to the ground, mm.
    Tof,
    /// Hardware model.
    Hardware,
    /// Version of the Wi-Fi firmware.
    WifiVersion,
    /// The Wi-Fi network of the router that it has joined.
    Ap,
    /// Its own Wi-Fi network.
    Ssid,
    /// The extension's distance, mm.
    ExtTof,
    /// The extension's version.
    ExtVersion,
}

/// A command of the SDK, with arguments within their limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// `command`: enter SDK mode.
    Sdk,
    /// `takeoff`.
    TakeOff,
    /// `land`.
    Land,
    /// `emergency`: motors off.
    Emergency,
    /// `stop`: hover.
    Stop,
    /// `streamon` and `streamoff`.
    Stream(bool),
    /// `up`, `down`, `left`, `right`, `forward`, `back`, centimetres.
    Move(Direction, i32),
    /// `cw` and `ccw`, degrees clockwise.
    Turn(i32),
    /// `flip`.
    Flip(Direction),
    /// `go x y z speed`, cm/s.
    Go {
        /// Destination, centimetres.
        to: Offset,
        /// Speed, cm/s.
        speed: i32,
    },
    /// `curve x1 y1 z1 x2 y2 z2 speed`.
    Curve {
        /// Intermediate point, centimetres.
        via: Offset,
        /// Destination, centimetres.
        to: Offset,
        /// Speed, cm/s.
        speed: i32,
    },
    /// `go`, `curve` or `jump` over a mission pad.
    OverPad,
    /// `speed`, cm/s.
    Speed(i32),
    /// `rc`: right, forward, up, clockwise, each -100 to 100.
    Rc([i32; 4]),
    /// `mon` and `moff`.
    Pads(bool),
    /// `mdirection`.
    PadDirection,
    /// `motoron` and `motoroff`.
    Motor(bool),
    /// `throwfly`.
    ThrowFly,
    /// `reboot`; also `wifi` and `ap`, which answer before restarting.
    Reboot {
        /// Whether it replies before restarting.
        answers: bool,
    },
    /// `port state video`.
    Ports(u16, u16),
    /// `setfps`, frames a second.
    Fps(u32),
    /// `setbitrate`, and `setresolution high`, which have no effect here.
    VideoSetting,
    /// `setresolution low`.
    LowResolution(bool),
    /// `downvision`.
    DownVision(bool),
    /// `EXT led` and similar commands, with their response.
    Extension(&'static str),
    /// `keepalive`, `wifisetchannel`, `multiwifi`: acknowledged without effect.
    Acknowledge,
    /// A read command.
    Read(Read),
}

/// Why a datagram is not a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Malformed {
    /// Empty, or not text: not answered.
    Noise,
    /// Not a command of this firmware.
    Unknown(String),
    /// The wrong number of arguments, or one that is not a number.
    Arguments,
    /// A number outside its limits.
    OutOfRange,
}

impl Malformed {
    /// The drone's response.
    #[must_use]
    pub fn answer(&self) -> Option<String> {
        match self {
            Self::Noise => None,
            Self::Unknown(verb) => Some(format!("unknown command: {verb}")),
            Self::Arguments => Some("error".to_owned()),
            Self::OutOfRange => Some("out of range".to_owned()),
        }
    }
}

/// Parses a datagram.
///
/// # Errors
/// [`Malformed`] if it is not a valid command.
pub fn parse(datagram: &[u8], firmware: Firmware) -> Result<Request, Malformed> {
    let text = datagram.get(..datagram.len().min(MAX_DATAGRAM)).and_then(|bytes| core::str::from_utf8(bytes).ok());
    let text = text.filter(|text| text.is_ascii()).ok_or(Malformed::Noise)?;
    let mut words = text.trim_matches(['\r', '\n', '\0', ' ']).split_ascii_whitespace();
    let verb = words.next().ok_or(Malformed::Noise)?;
    let arguments: Vec<&str> = words.collect();
    let (needs, request) = read(verb, &arguments, firmware).ok_or_else(|| Malformed::Unknown(verb.to_owned()))?;
    if firmware < needs { Err(Malformed::Unknown(verb.to_owned())) } else { request }
}

type Reading = (Firmware, Result<Request, Malformed>);

/// The firmware that a verb needs, and the parsed command; `None` for an unknown verb.
fn read(verb: &str, arguments: &[&str], firmware: Firmware) -> Option<Reading> {
    use Firmware::{V13, V20, V30};
    let bare = |request| if arguments.is_empty() { Ok(request) } else { Err(Malformed::Arguments) };
    Some(match verb {
        "command" => (V13, bare(Request::Sdk)),
        "takeoff" => (V13, bare(Request::TakeOff)),
        "land" => (V13, bare(Request::Land)),
        "emergency" => (V13, bare(Request::Emergency)),
        "streamon" => (V13, bare(Request::Stream(true))),
        "streamoff" => (V13, bare(Request::Stream(false))),
        "stop" => (V20, bare(Request::Stop)),
        "up" => (V13, distance(arguments).map(|cm| Request::Move(Direction::Up, cm))),
        "down" => (V13, distance(arguments).map(|cm| Request::Move(Direction::Down, cm))),
        "left" => (V13, distance(arguments).map(|cm| Request::Move(Direction::Left, cm))),
        "right" => (V13, distance(arguments).map(|cm| Request::Move(Direction::Right, cm))),
        "forward" => (V13, distance(arguments).map(|cm| Request::Move(Direction::Forward, cm))),
        "back" => (V13, distance(arguments).map(|cm| Request::Move(Direction::Back, cm))),
        "cw" => (V13, turn(arguments, firmware).map(Request::Turn)),
        "ccw" => (V13, turn(arguments, firmware).map(|deg| Request::Turn(-deg))),
        "flip" => (V13, flip(arguments)),
        "go" => (V13, go(arguments, firmware)),
        "curve" => (V13, curve(arguments, firmware)),
        "jump" => (V20, jump(arguments)),
        "speed" => (V13, one(arguments, 10, 100).map(Request::Speed)),
        "rc" => (V13, numbers(arguments, -100, 100).map(Request::Rc)),
        "wifi" => (V13, words(arguments, 2, Request::Reboot { answers: true })),
        "ap" => (V20, words(arguments, 2, Request::Reboot { answers: true })),
        "mon" => (V20, bare(Request::Pads(true))),
        "moff" => (V20, bare(Request::Pads(false))),
        "mdirection" => (V20, one(arguments, 0, 2).map(|_| Request::PadDirection)),
        "motoron" => (V30, bare(Request::Motor(true))),
        "motoroff" => (V30, bare(Request::Motor(false))),
        "throwfly" => (V30, bare(Request::ThrowFly)),
        "reboot" => (V30, bare(Request::Reboot { answers: false })),
        "port" => (V30, ports(arguments)),
        "setfps" => (V30, word(arguments, &[("high", Request::Fps(30)), ("middle", Request::Fps(15)), ("low", Request::Fps(5))])),
        "setbitrate" => (V30, one(arguments, 0, 5).map(|_| Request::VideoSetting)),
        "setresolution" => {
            (V30, word(arguments, &[("high", Request::LowResolution(false)), ("low", Request::LowResolution(true))]))
        }
        "downvision" => (V30, one(arguments, 0, 1).map(|on| Request::DownVision(on == 1))),
        "wifisetchannel" | "multiwifi" | "keepalive" => (V30, Ok(Request::Acknowledge)),
        "EXT" => (V30, extension(arguments)),
        _ => return reading(verb).map(|(needs, read)| (needs, bare(Request::Read(read)))),
    })
}

fn reading(verb: &str) -> Option<(Firmware, Read)> {
    use Firmware::{V13, V20, V30};
    Some(match verb {
        "battery?" => (V13, Read::Battery),
        "speed?" => (V13, Read::Speed),
        "time?" => (V13, Read::Time),
        "wifi?" => (V13, Read::Wifi),
        "height?" => (V13, Read::Height),
        "temp?" => (V13, Read::Temperature),
        "attitude?" => (V13, Read::Attitude),
        "baro?" => (V13, Read::Barometer),
        "acceleration?" => (V13, Read::Acceleration),
        "tof?" => (V13, Read::Tof),
        "sdk?" => (V20, Read::Sdk),
        "sn?" => (V20, Read::Serial),
        "hardware?" => (V30, Read::Hardware),
        "wifiversion?" => (V30, Read::WifiVersion),
        "ap?" => (V30, Read::Ap),
        "ssid?" => (V30, Read::Ssid),
        _ => return None,
    })
}

/// The expected number of values, all within the limits; invalid numbers are reported before values out of range.
fn numbers<const N: usize>(arguments: &[&str], low: i32, high: i32) -> Result<[i32; N], Malformed> {
    let words: [&str; N] = arguments.try_into().map_err(|_| Malformed::Arguments)?;
    let mut values = [0; N];
    for (value, word) in values.iter_mut().zip(words) {
        *value = word.parse().map_err(|_| Malformed::Arguments)?;
    }
    if values.iter().all(|value| (low..=high).contains(value)) { Ok(values) } else { Err(Malformed::OutOfRange) }
}

fn one(arguments: &[&str], low: i32, high: i32) -> Result<i32, Malformed> {
    numbers::<1>(arguments, low, high).map(|[value]| value)
}

fn distance(arguments: &[&str]) -> Result<i32, Malformed> {
    one(arguments, 20, 500)
}

fn turn(arguments: &[&str], firmware: Firmware) -> Result<i32, Malformed> {
    one(arguments, 1, if firmware == Firmware::V13 { 3600 } else { 360 })
}

fn words(arguments: &[&str], count: usize, request: Request) -> Result<Request, Malformed> {
    if arguments.len() == count { Ok(request) } else { Err(Malformed::Arguments) }
}

fn word(arguments: &[&str], known: &[(&str, Request)]) -> Result<Request, Malformed> {
    let [word] = arguments else { return Err(Malformed::Arguments) };
    known.iter().find(|(name, _)| name == word).map(|(_, request)| *request).ok_or(Malformed::Arguments)
}

fn flip(arguments: &[&str]) -> Result<Request, Malformed> {
    let sides = [("l", Direction::Left), ("r", Direction::Right), ("f", Direction::Forward), ("b", Direction::Back)];
    word(arguments, &sides.map(|(name, side)| (name, Request::Flip(side))))
}

/// `m1` to `m8`, and since SDK 3.0 `m-1` (any) and `m-2` (the nearest).
fn is_pad(word: &str, firmware: Firmware) -> bool {
    let number = word.strip_prefix('m').and_then(|number| number.parse::<i32>().ok());
    number.is_some_and(|number| (1..=8).contains(&number) || (firmware >= Firmware::V30 && (-2..0).contains(&number)))
}

/// Removes a trailing pad; `None` if the last word is invalid.
fn without_pad<'a>(arguments: &'a [&'a str], plain: usize, firmware: Firmware) -> Result<(&'a [&'a str], bool), Malformed> {
    match arguments.split_last() {
        _ if arguments.len() == plain => Ok((arguments, false)),
        Some((pad, rest)) if rest.len() == plain && firmware >= Firmware::V20 && is_pad(pad, firmware) => Ok((rest, true)),
        _ => Err(Malformed::Arguments),
    }
}

fn go(arguments: &[&str], firmware: Firmware) -> Result<Request, Malformed> {
    let (arguments, pad) = without_pad(arguments, 4, firmware)?;
    let [x, y, z, speed] = numbers::<4>(arguments, i32::MIN, i32::MAX)?;
    let coordinates = [x, y, z];
    let within = if firmware == Firmware::V13 {
        coordinates.iter().all(|value| (20..=500).contains(value))
    } else {
        // Over a pad any height is valid; otherwise a step within 20 cm on every axis is refused.
        coordinates.iter().all(|value| (-500..=500).contains(value))
            && (pad || coordinates.iter().any(|value| !(-20..=20).contains(value)))
    };
    if !within || !(10..=100).contains(&speed) {
        return Err(Malformed::OutOfRange);
    }
    Ok(if pad { Request::OverPad } else { Request::Go { to: Offset { x, y, z }, speed } })
}

fn curve(arguments: &[&str], firmware: Firmware) -> Result<Request, Malformed> {
    let (arguments, pad) = without_pad(arguments, 7, firmware)?;
    let [x1, y1, z1, x2, y2, z2, speed] = numbers::<7>(arguments, i32::MIN, i32::MAX)?;
    let coordinates = [x1, y1, z1, x2, y2, z2];
    if coordinates.iter().any(|value| !(-500..=500).contains(value)) || !(10..=60).contains(&speed) {
        return Err(Malformed::OutOfRange);
    }
    let (via, to) = (Offset { x: x1, y: y1, z: z1 }, Offset { x: x2, y: y2, z: z2 });
    Ok(if pad { Request::OverPad } else { Request::Curve { via, to, speed } })
}

fn jump(arguments: &[&str]) -> Result<Request, Malformed> {
    let [x, y, z, speed, yaw, from, to] = *arguments else { return Err(Malformed::Arguments) };
    let [x, y, z] = numbers::<3>(&[x, y, z], i32::MIN, i32::MAX)?;
    let ([speed], [yaw]) = (numbers::<1>(&[speed], i32::MIN, i32::MAX)?, numbers::<1>(&[yaw], i32::MIN, i32::MAX)?);
    if !is_pad(from, Firmware::V20) || !is_pad(to, Firmware::V20) {
        return Err(Malformed::Arguments);
    }
    let within = [x, y, z].iter().all(|value| (-500..=500).contains(value));
    if within && (10..=100).contains(&speed) && (-360..=360).contains(&yaw) {
        Ok(Request::OverPad)
    } else {
        Err(Malformed::OutOfRange)
    }
}

fn ports(arguments: &[&str]) -> Result<Request, Malformed> {
    let [state, video] = numbers::<2>(arguments, 1025, 65_535)?;
    let port = |number: i32| u16::try_from(number).map_err(|_| Malformed::OutOfRange);
    Ok(Request::Ports(port(state)?, port(video)?))
}

fn extension(arguments: &[&str]) -> Result<Request, Malformed> {
    match arguments.first() {
        Some(&"led") => Ok(Request::Extension("led ok")),
        Some(&"mled") => Ok(Request::Extension("matrix ok")),
        Some(&"tof?") => Ok(Request::Read(Read::ExtTof)),
        Some(&"version?") => Ok(Request::Read(Read::ExtVersion)),
        _ => Err(Malformed::Arguments),
    }
}
