//! The faults of the matrix, and the phases of a flight in which each begins.

use spf_serve::fault::{CraftFault, CraftFaultRule, Fault, FaultPlan, Rule, Stream};

/// When a fault begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FlightPart {
    /// Climbing to the take-off height.
    TakeOff,
    /// At rest, with the first query open.
    Deciding,
    /// Flying a step.
    Executing,
    /// Turning in search of the target.
    Searching,
    /// Flown by hand.
    Manual,
    /// Landing by the operator's command.
    Landing,
}

impl FlightPart {
    /// All parts, in the order of a flight.
    pub(crate) const ALL: [Self; 6] =
        [Self::TakeOff, Self::Deciding, Self::Executing, Self::Searching, Self::Manual, Self::Landing];

    /// Its name in tables.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::TakeOff => "take-off",
            Self::Deciding => "deciding",
            Self::Executing => "executing",
            Self::Searching => "searching",
            Self::Manual => "manual",
            Self::Landing => "landing",
        }
    }
}

/// The behaviour of a model from the beginning of a fault on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ModelFault {
    /// It never answers.
    Silent,
    /// HTTP 429.
    RateLimit,
    /// It refuses to help.
    Unavailable,
    /// It refuses to help.
    Refusal,
    /// It points confidently at a wrong place, far away.
    Lie,
    /// It answers after 15 s.
    Late,
    /// Its answer is cut off.
    Malformed,
}

/// Who sends datagrams that are not the drone's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sender {
    /// A machine with an address of its own.
    Other,
    /// One that forges the drone's address.
    Forged,
}

/// What a depth sensor does from the beginning of a fault on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DepthFailing {
    /// It delivers nothing.
    Silent,
    /// The same values again and again, stamped new.
    Frozen,
    /// The left half has no values.
    HalfBlack,
    /// Depths are 10 % too large.
    Scale,
    /// Everything arrives 1.5 s late.
    Late,
}

/// What goes wrong.
#[derive(Clone, Debug)]
pub(crate) enum What {
    /// The depth sensor.
    Depth(DepthFailing),
    /// Messages between craft and pilot.
    Messages(Vec<(Stream, Fault)>),
    /// The craft itself.
    Craft(CraftFault),
    /// The model.
    Model(ModelFault),
    /// The craft reports this battery charge.
    Charge(f64),
    /// The command to take off is lost.
    TakeOffLost,
    /// A thread of the driver dies.
    Thread,
    /// Somebody else sends datagrams to the driver's ports.
    Sender(Sender),
}

/// A row of the matrix.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Its name in tables.
    pub(crate) name: &'static str,
    /// What goes wrong.
    pub(crate) what: What,
    /// Whether commands still reach the craft.
    pub(crate) commands_arrive: bool,
}

impl Row {
    fn of(name: &'static str, what: What) -> Self {
        Self { name, what, commands_arrive: true }
    }

    fn messages(name: &'static str, faults: &[(Stream, Fault)]) -> Self {
        Self::of(name, What::Messages(faults.to_vec()))
    }

    fn depth(name: &'static str, fault: DepthFailing) -> Self {
        Self::of(name, What::Depth(fault))
    }

    fn model(name: &'static str, fault: ModelFault) -> Self {
        Self::of(name, What::Model(fault))
    }

    /// The fault as a plan that begins at `from`, seconds; empty for a fault of the model.
    pub(crate) fn plan(&self, from: f64) -> FaultPlan {
        let mut plan = FaultPlan::default();
        match &self.what {
            What::Messages(faults) => {
                plan.rules =
                    faults.iter().map(|(stream, fault)| Rule { stream: *stream, from, until: None, fault: *fault }).collect();
            }
            What::Craft(fault) => {
                let until = (*fault == CraftFault::Reboot).then_some(from + 0.1);
                plan.craft = vec![CraftFaultRule { fault: *fault, from, until }];
            }
            What::TakeOffLost => {
                let fault = Fault::Drop { p: 1.0 };
                plan.rules = vec![Rule { stream: Stream::Commands, from, until: Some(from + 0.4), fault }];
            }
            What::Depth(_) | What::Model(_) | What::Charge(_) | What::Thread | What::Sender(_) => {}
        }
        plan
    }
}

/// Every fault.
pub(crate) fn rows() -> Vec<Row> {
    use Stream::{Commands, Frames, Responses, Telemetry};
    let all = |fault: Fault| [Frames, Telemetry, Commands, Responses].map(|stream| (stream, fault)).to_vec();
    let lost = Fault::Drop { p: 1.0 };
    vec![
        Row { commands_arrive: false, ..Row::messages("link cut", &all(lost)) },
        Row::messages("30 % of all messages lost", &all(Fault::Drop { p: 0.3 })),
        Row::messages("every message twice", &all(Fault::Duplicate { p: 1.0, after: 0.2 })),
        Row::messages("messages reordered", &all(Fault::Reorder { p: 0.3, by: 0.3 })),
        Row::messages("messages 1.5 s late", &all(Fault::Delay { mean: 1.5, jitter: 0.0 })),
        Row::messages("messages held back for 1.5 s every 4 s, then a burst", &all(Fault::Burst { every: 4.0, lasts: 1.5 })),
        Row::messages("no video", &[(Frames, lost)]),
        Row::messages("video frozen", &[(Frames, Fault::Freeze)]),
        Row::messages("video black", &[(Frames, Fault::Blank { p: 1.0 })]),
        Row::messages("video corrupt", &[(Frames, Fault::Corrupt { p: 1.0 })]),
        Row::messages("video 1.5 s late", &[(Frames, Fault::Delay { mean: 1.5, jitter: 0.0 })]),
        Row::messages("no telemetry", &[(Telemetry, lost)]),
        Row::messages("telemetry frozen", &[(Telemetry, Fault::Freeze)]),
        Row::messages("telemetry 1.5 s late", &[(Telemetry, Fault::Delay { mean: 1.5, jitter: 0.0 })]),
        Row { commands_arrive: false, ..Row::messages("commands lost", &[(Commands, lost), (Responses, lost)]) },
        Row::of("battery low", What::Charge(0.1)),
        Row::of("battery empty", What::Craft(CraftFault::BatteryEmpty)),
        Row::of("IMU error, shown by the state", What::Craft(CraftFault::ImuLost)),
        Row::of("IMU error, shown by answers only", What::Craft(CraftFault::ImuInvalid)),
        Row::of("reboot", What::Craft(CraftFault::Reboot)),
        Row::of("take-off refused", What::Craft(CraftFault::TakeOffRefused)),
        Row::of("take-off lost", What::TakeOffLost),
        Row::of("a thread of the driver dies", What::Thread),
        Row::of("datagrams from another address", What::Sender(Sender::Other)),
        Row::of("datagrams with the drone's address, forged", What::Sender(Sender::Forged)),
        Row::depth("depth sensor silent", DepthFailing::Silent),
        Row::depth("depth sensor frozen", DepthFailing::Frozen),
        Row::depth("depth sensor 1.5 s late", DepthFailing::Late),
        Row::depth("left half of the depth sensor black", DepthFailing::HalfBlack),
        Row::depth("depths 10 % too large", DepthFailing::Scale),
        Row::model("model silent", ModelFault::Silent),
        Row::model("model HTTP 429", ModelFault::RateLimit),
        Row::model("model HTTP 503", ModelFault::Unavailable),
        Row::model("model refuses", ModelFault::Refusal),
        Row::model("model lies", ModelFault::Lie),
        Row::model("model 15 s late", ModelFault::Late),
        Row::model("model's answer cut off", ModelFault::Malformed),
    ]
}
