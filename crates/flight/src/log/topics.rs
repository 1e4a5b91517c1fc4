//! The topics of a flight log.

use schemars::JsonSchema;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameMeta;
use spf_core::gimbal::GimbalReport;
use spf_core::query::Query;
use spf_core::ranges::RangeScan;
use spf_core::telemetry::Telemetry;
use spf_core::track::TrackReport;
use spf_pilot::{Decision, Ending};
use spf_record::log::{Topic, foxglove};

use super::rows::{
    Cancelled, CommandRow, FlightHeader, GapRow, LinkRow, NoteRow, OperatorRow, PoseDeviationRow, ReplyRow, TrackStartRow,
    TruthRow, Wake,
};
use crate::summary::Summary;

/// A topic of a flight log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// The flight's head.
    Flight,
    /// Input: woken without an event.
    Wake,
    /// Input: telemetry.
    Telemetry,
    /// Input: a camera frame.
    Frame,
    /// Input: a depth grid.
    Depth,
    /// A scan of a sensor around the craft.
    Ranges,
    /// Where the gimbal points the camera.
    Gimbal,
    /// Input: where the tracked target is in a frame.
    Track,
    /// Input: a reply or a failure.
    Reply,
    /// Input: an operator input.
    Operator,
    /// Input: the state of the link.
    Link,
    /// Messages were dropped here.
    Gap,
    /// Output: a query.
    Query,
    /// Output: a cancelled query.
    Cancel,
    /// Output: a track was asked for or ended.
    TrackStart,
    /// Output: a command, requested and cleared.
    Command,
    /// Output: a decision.
    Decision,
    /// Output: other notes.
    Note,
    /// Output: the outcome.
    Finished,
    /// Ground truth for the frames of queries.
    Truth,
    /// The summary.
    Summary,
    /// Camera images.
    Image,
    /// Image annotations.
    Annotations,
    /// Calibration of the camera.
    Calibration,
    /// Transforms of world, body and camera.
    Transforms,
    /// Estimated pose.
    PoseKnown,
    /// True pose.
    PoseTrue,
    /// Accuracy of the estimated position.
    PoseDeviation,
    /// The scene in outline.
    Scene,
    /// The current plan.
    Plan,
    /// The obstacle map.
    Map,
    /// The planner's path, and the target's position.
    Path,
    /// Text messages.
    Log,
}

impl Channel {
    /// Every channel, by number.
    pub const ALL: [Self; 33] = [
        Self::Flight,
        Self::Wake,
        Self::Telemetry,
        Self::Frame,
        Self::Depth,
        Self::Ranges,
        Self::Gimbal,
        Self::Track,
        Self::Reply,
        Self::Operator,
        Self::Link,
        Self::Gap,
        Self::Query,
        Self::Cancel,
        Self::TrackStart,
        Self::Command,
        Self::Decision,
        Self::Note,
        Self::Finished,
        Self::Truth,
        Self::Summary,
        Self::Image,
        Self::Annotations,
        Self::Calibration,
        Self::Transforms,
        Self::PoseKnown,
        Self::PoseTrue,
        Self::PoseDeviation,
        Self::Scene,
        Self::Plan,
        Self::Map,
        Self::Path,
        Self::Log,
    ];

    /// The channel of a topic; `None` if unknown.
    #[must_use]
    pub fn of_topic(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|channel| channel.name() == name)
    }

    /// Whether this is an input of the pilot.
    #[must_use]
    pub fn is_input(self) -> bool {
        (Self::Wake..=Self::Link).contains(&self)
    }

    /// Whether this is an output of the pilot, which a replay compares.
    #[must_use]
    pub fn is_output(self) -> bool {
        (Self::Query..=Self::Finished).contains(&self)
    }

    /// Its topic's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Flight => "/flight",
            Self::Wake => "/wake",
            Self::Telemetry => "/telemetry",
            Self::Frame => "/frame",
            Self::Depth => "/depth",
            Self::Ranges => "/ranges",
            Self::Gimbal => "/gimbal",
            Self::Track => "/track",
            Self::Reply => "/reply",
            Self::Operator => "/operator",
            Self::Link => "/link",
            Self::Gap => "/gap",
            Self::Query => "/query",
            Self::Cancel => "/cancel",
            Self::TrackStart => "/track/start",
            Self::Command => "/command",
            Self::Decision => "/decision",
            Self::Note => "/note",
            Self::Finished => "/finished",
            Self::Truth => "/truth",
            Self::Summary => "/summary",
            Self::Image => "/camera/image",
            Self::Annotations => "/camera/annotations",
            Self::Calibration => "/camera/calibration",
            Self::Transforms => "/tf",
            Self::PoseKnown => "/pose/known",
            Self::PoseTrue => "/pose/true",
            Self::PoseDeviation => "/pose/deviation",
            Self::Scene => "/scene",
            Self::Plan => "/plan",
            Self::Map => "/map",
            Self::Path => "/path",
            Self::Log => "/log",
        }
    }

    /// Topic definition of its messages.
    pub(crate) fn form(self) -> Topic {
        fn json<T: JsonSchema>(channel: Channel, schema: &'static str) -> Topic {
            Topic::of_json::<T>(channel.name(), schema)
        }
        let name = self.name();
        match self {
            Self::Flight => json::<FlightHeader>(self, "spf.Flight"),
            Self::Wake => json::<Wake>(self, "spf.Wake"),
            Self::Telemetry => json::<Telemetry>(self, "spf.Telemetry"),
            Self::Frame => json::<FrameMeta>(self, "spf.Frame"),
            Self::Depth => json::<DepthGrid>(self, "spf.Depth"),
            Self::Ranges => json::<RangeScan>(self, "spf.Ranges"),
            Self::Gimbal => json::<GimbalReport>(self, "spf.Gimbal"),
            Self::Track => json::<TrackReport>(self, "spf.Track"),
            Self::Reply => json::<ReplyRow>(self, "spf.Reply"),
            Self::Operator => json::<OperatorRow>(self, "spf.Operator"),
            Self::Link => json::<LinkRow>(self, "spf.Link"),
            Self::Gap => json::<GapRow>(self, "spf.Gap"),
            Self::Query => json::<Query>(self, "spf.Query"),
            Self::Cancel => json::<Cancelled>(self, "spf.Cancel"),
            Self::TrackStart => json::<TrackStartRow>(self, "spf.TrackStart"),
            Self::Command => json::<CommandRow>(self, "spf.Command"),
            Self::Decision => json::<Decision>(self, "spf.Decision"),
            Self::Note => json::<NoteRow>(self, "spf.Note"),
            Self::Finished => json::<Ending>(self, "spf.Finished"),
            Self::Truth => json::<TruthRow>(self, "spf.Truth"),
            Self::Summary => json::<Summary>(self, "spf.Summary"),
            Self::Image => Topic::of_foxglove::<foxglove::CompressedImage>(name),
            Self::Annotations => Topic::of_foxglove::<foxglove::ImageAnnotations>(name),
            Self::Calibration => Topic::of_foxglove::<foxglove::CameraCalibration>(name),
            Self::Transforms => Topic::of_foxglove::<foxglove::FrameTransforms>(name),
            Self::PoseKnown | Self::PoseTrue => Topic::of_foxglove::<foxglove::PoseInFrame>(name),
            Self::PoseDeviation => json::<PoseDeviationRow>(self, "spf.PoseDeviation"),
            Self::Map => Topic::of_foxglove::<foxglove::PointCloud>(name),
            Self::Scene | Self::Plan | Self::Path => Topic::of_foxglove::<foxglove::SceneUpdate>(name),
            Self::Log => Topic::of_foxglove::<foxglove::Log>(name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_stands_at_its_number_and_has_its_own_name() {
        for (index, channel) in Channel::ALL.into_iter().enumerate() {
            assert_eq!(channel as usize, index);
            assert_eq!(Channel::of_topic(channel.name()), Some(channel));
            assert!(!(channel.is_input() && channel.is_output()));
        }
    }

    #[test]
    fn every_topic_has_a_schema() {
        for topic in Channel::ALL.map(Channel::form) {
            assert!(!topic.definition.is_empty() && topic.schema.contains('.'), "{}", topic.name);
        }
    }
}
