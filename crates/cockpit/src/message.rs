//! What a page sends, as JSON texts.

use serde::Deserialize;
use serde_json::error::Category;
use spf_flight::pointing::Side;

/// Maximum length of a message, bytes.
pub(crate) const LONGEST: usize = 16 * 1024;
/// Maximum length of an instruction, characters, as on the command line.
pub(crate) const LONGEST_INSTRUCTION: usize = 2000;

/// Maximum time for which an assistant is armed, minutes.
const LONGEST_ARMING: u8 = 30;

/// Who connects. Without a token or a session: a spectator on the same machine.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hello {
    /// From the address that was printed.
    #[serde(default)]
    pub(crate) token: Option<String>,
    /// From an earlier welcome.
    #[serde(default)]
    pub(crate) session: Option<String>,
}

/// A message on the socket of the controls.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum ToControls {
    /// The first message.
    Hello(Hello),
    /// The answer to a beat: the page is alive.
    Beat(u64),
    /// An order, with a number by which it is acknowledged.
    Order {
        /// The number.
        id: u64,
        /// The last beat that the page had seen when it was given.
        #[serde(default)]
        tick: Option<u64>,
        /// What to do.
        #[serde(rename = "do")]
        order: Order,
    },
}

/// What a page may order.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Order {
    /// Stop and stay in the air.
    Hold,
    /// Go on with the instruction.
    Resume,
    /// Land here.
    Land,
    /// The first step of cutting the motors.
    ArmCut,
    /// The second one, within six seconds.
    Cut,
    /// A new instruction.
    Instruction(String),
    /// Manual flight, each axis from −1 to 1 of the speeds of manual flight.
    Fly {
        /// Rightwards.
        right: f64,
        /// Forward.
        forward: f64,
        /// Upwards.
        up: f64,
        /// Clockwise.
        turn: f64,
    },
    /// Fly towards a point of a picture.
    Point {
        /// 0 left edge to 1 right edge.
        u: f64,
        /// 0 top edge to 1 bottom edge.
        v: f64,
        /// Depth label, 1 to 10.
        depth: u8,
        /// The frame in which it was pointed.
        frame: u64,
    },
    /// Keep away from a place in a picture.
    Avoid {
        /// Left, top, right and bottom edge, as fractions of the picture.
        area: [f64; 4],
        /// Depth label, 1 to 10.
        depth: u8,
        /// The frame in which it was marked.
        frame: u64,
    },
    /// Keep away from it no more.
    Unavoid(u32),
    /// Answer an open query: the target is out of view, on this side.
    Look(Side),
    /// Answer an open query: the instruction is fulfilled.
    Done,
    /// Let the assistant fly for so many minutes, 1 to 30, and one flight; 0 takes that back.
    Assistant(u8),
    /// Ask the pilot for the controls.
    Ask,
    /// Hand the controls over to who asks, or not.
    Give {
        /// The page that was asked about.
        page: u64,
        /// Whether it gets them.
        yes: bool,
    },
}

/// A format of live pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Format {
    /// Each by itself.
    Jpeg,
    /// H.264, for a page whose browser has a decoder.
    Film,
}

/// A message on the socket of pictures and state.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum ToWatch {
    /// The first message.
    Hello(Hello),
    /// In which format pictures are wanted, JPEG at first; pictures are counted anew.
    Format(Format),
    /// So many pictures were shown: the next one may come.
    Shown(u64),
    /// Everything about the decision on this query.
    Open(u64),
}

impl Order {
    /// What it is called where it is told of.
    pub(crate) fn words(&self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Resume => "resume",
            Self::Land => "land",
            Self::ArmCut | Self::Cut => "cut motors",
            Self::Instruction(_) => "instruction",
            Self::Fly { .. } => "fly by hand",
            Self::Point { .. } | Self::Look(_) | Self::Done => "point",
            Self::Avoid { .. } | Self::Unavoid(_) => "keep away",
            Self::Assistant(_) => "the assistant",
            Self::Ask | Self::Give { .. } => "the controls",
        }
    }
}

impl ToControls {
    /// Reads a message.
    pub(crate) fn read(text: &str) -> Result<Self, String> {
        let message: Self = read(text)?;
        let finite = match &message {
            Self::Order { order: Order::Fly { right, forward, up, turn }, .. } => {
                [right, forward, up, turn].iter().all(|axis| (-1.0..=1.0).contains(*axis))
            }
            Self::Order { order: Order::Point { u, v, depth, .. }, .. } => {
                (0.0..=1.0).contains(u) && (0.0..=1.0).contains(v) && (1..=10).contains(depth)
            }
            Self::Order { order: Order::Avoid { area, depth, .. }, .. } => {
                let [left, top, right, bottom] = area;
                area.iter().all(|edge| (0.0..=1.0).contains(edge)) && left < right && top < bottom && (1..=10).contains(depth)
            }
            Self::Order { order: Order::Instruction(text), .. } => {
                !text.trim().is_empty() && text.chars().count() <= LONGEST_INSTRUCTION && !text.contains(char::is_control)
            }
            Self::Order { order: Order::Assistant(minutes), .. } => *minutes <= LONGEST_ARMING,
            _ => true,
        };
        if finite { Ok(message) } else { Err("a value is outside its range".to_owned()) }
    }
}

impl ToWatch {
    /// Reads a message.
    pub(crate) fn read(text: &str) -> Result<Self, String> {
        read(text)
    }
}

/// The text of an error never quotes the message, which may hold a token.
fn read<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| {
        match error.classify() {
            Category::Data => "a message of an unknown form; reload the page",
            Category::Io | Category::Syntax | Category::Eof => "a message that is not JSON",
        }
        .to_owned()
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn orders_are_read_and_others_refused() {
        let read = |text: &str| ToControls::read(text);
        assert_eq!(read(r#"{"order":{"id":3,"do":"hold"}}"#), Ok(ToControls::Order { id: 3, tick: None, order: Order::Hold }));
        let resume = ToControls::Order { id: 3, tick: Some(17), order: Order::Resume };
        assert_eq!(read(r#"{"order":{"id":3,"tick":17,"do":"resume"}}"#), Ok(resume));
        for tick in ["-1", "1.5", "\"7\"", "1e99"] {
            assert!(read(&format!(r#"{{"order":{{"id":3,"tick":{tick},"do":"resume"}}}}"#)).is_err(), "{tick}");
        }
        assert_eq!(read(r#"{"hello":{}}"#), Ok(ToControls::Hello(Hello::default())));
        let fly = |forward: &str| {
            read(&format!(r#"{{"order":{{"id":1,"do":{{"fly":{{"right":0,"forward":{forward},"up":0,"turn":0}}}}}}}}"#))
        };
        assert!(fly("1").is_ok() && fly("1.01").is_err() && fly("1e999").is_err() && fly("null").is_err());
        let point = |u: &str, depth: &str| {
            read(&format!(r#"{{"order":{{"id":1,"do":{{"point":{{"u":{u},"v":0.5,"depth":{depth},"frame":7}}}}}}}}"#))
        };
        assert!(point("0.5", "10").is_ok() && point("1.5", "5").is_err() && point("0.5", "11").is_err());
        let avoid =
            |area: &str| read(&format!(r#"{{"order":{{"id":1,"do":{{"avoid":{{"area":{area},"depth":5,"frame":7}}}}}}}}"#));
        assert!(avoid("[0.1,0.2,0.3,1]").is_ok() && avoid("[0.3,0.2,0.1,1]").is_err() && avoid("[0,0,1,1e999]").is_err());
        let say = |text: &str| read(&serde_json::json!({"order": {"id": 1, "do": {"instruction": text}}}).to_string());
        assert!(say("go on").is_ok() && say("  ").is_err() && say("a\u{1b}[2J").is_err() && say(&"x".repeat(2001)).is_err());
        let arm = |minutes: &str| read(&format!(r#"{{"order":{{"id":1,"do":{{"assistant":{minutes}}}}}}}"#));
        assert!(arm("0").is_ok() && arm("30").is_ok() && arm("31").is_err() && arm("-1").is_err() && arm("1.5").is_err());
        let secret = "5ec2e7";
        assert!(!read(&format!(r#"{{"hello":{{"tokn":"{secret}"}}}}"#)).unwrap_err().contains(secret));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "\\PC{0,200}|[{}\":,a-z0-9.]{0,80}") {
            let _ = crate::read_page_message(&text);
        }
    }
}
