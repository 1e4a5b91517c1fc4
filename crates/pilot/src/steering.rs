//! What stays with a target that moves, and is plugged into a flight: the tracker's reports and the replies in, setpoints out.

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::geometry::{EnuPosition, EnuVelocity, Pose};
use spf_core::motion::MotionEstimate;
use spf_core::query::ImageBox;
use spf_core::time::Time;
use spf_core::track::TrackReport;

/// The standoff distance that is kept by default, metres.
pub const DEFAULT_KEEP: f64 = 2.5;

/// What a reply says about the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// When its frame was captured.
    pub captured: Time,
    /// The pose at capture.
    pub pose: Pose,
    /// The target's box in the frame.
    pub area: ImageBox,
    /// The target's range according to its label, metres.
    pub range: f64,
    /// Whether the target is a person, of a person's stature.
    pub is_person: bool,
}

/// A way on which the craft may get away from the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayOut {
    /// Its direction, radians clockwise from north.
    pub bearing: f64,
    /// How fast it may be flown, m/s: the craft must stop within what is known to be free.
    pub speed: f64,
}

/// What is known about a followed target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetEstimate {
    /// Its position.
    pub position: EnuPosition,
    /// Its horizontal velocity; zero if the track is not good.
    pub velocity: EnuVelocity,
    /// Standard deviation of its range, metres.
    pub range_sd: f64,
    /// Whether it was tracked within the last half second.
    pub is_sure: bool,
}

/// Estimates where a target is that moves, and steers the craft so that it keeps a distance to it. Pure, as the pilot.
pub trait Steering: Send {
    /// Takes a reply that sees the target in an image of `camera`.
    fn answer(&mut self, camera: &Camera, answer: &Answer);

    /// Takes a report on the track, whose frame was taken at `pose`.
    fn report(&mut self, report: &TrackReport, pose: Pose);

    /// Forgets the target, and keeps this distance to the next one, metres.
    fn start(&mut self, keep: f64);

    /// Whether the target's track is good: without one, replies alone are no guide to a target that moves.
    fn is_tracked(&self, now: Time) -> bool;

    /// The target at `now`; `None` if it is lost.
    fn target(&self, now: Time, from: EnuPosition) -> Option<TargetEstimate>;

    /// Where the target was last seen; `None` if that is too long ago.
    fn last_place(&self, now: Time) -> Option<EnuPosition>;

    /// The same, if the target has walked on for a while as it did.
    fn went_to(&self, now: Time) -> Option<EnuPosition>;

    /// The setpoint that keeps the distance; `None` if the target is lost. `way_out` is where the craft may get away from it; `None`
    /// if it may not, for what lies around it is not known.
    fn setpoint(&self, now: Time, known: &MotionEstimate, craft: &Craft, way_out: Option<WayOut>) -> Option<Setpoint>;
}
