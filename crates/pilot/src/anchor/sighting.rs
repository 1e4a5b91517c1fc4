//! Sightings: what one reply indicates about the target's position.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::standing::by_ground;
use spf_core::camera::Camera;
use spf_core::geometry::{EnuDirection, EnuPosition, Pose};
use spf_core::lift::{Lifting, UnprojectError, lift, range_of_label, unproject};
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::DEPTH_LABELS;
use spf_core::time::Time;
use spf_motion::odometry::Odometry;

/// A measured range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RangeReading {
    /// Natural logarithm of the range in metres.
    pub ln_range: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// One sighting of the target, from one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sighting {
    /// Capture time of the frame.
    pub captured: Time,
    /// Distinguishes sightings of the same frame, and orders them: the number of the query.
    pub id: u64,
    /// Stage of the instruction, non-decreasing; a later stage replaces the target.
    pub stage: u32,
    /// Position of the craft at capture.
    pub from: EnuPosition,
    /// Error accumulated by the craft's odometry until then.
    pub odometry: Odometry,
    /// Unit vector towards the target.
    pub direction: EnuDirection,
    /// Standard deviation of the direction to the right, radians.
    pub bearing_sigma: f64,
    /// Standard deviation of the direction upwards, radians. It is larger, because a tall target of which other parts are
    /// hidden in other frames is pointed at in different heights.
    pub elevation_sigma: f64,
    /// Range along the direction, if known.
    pub range: Option<RangeReading>,
}

/// How much replies are trusted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Trust {
    /// Standard deviation of a point, as a fraction of the image width.
    pub point: f64,
    /// Standard deviation of the natural logarithm of a range that is read as a label, besides its rounding.
    pub ln_range: f64,
    /// Standard deviation of the heading at capture, radians.
    pub heading: f64,
}

impl Default for Trust {
    /// Points to 1.5 % of the image width, ranges to 20 %, headings to 1°.
    fn default() -> Self {
        Self { point: 0.015, ln_range: 0.2, heading: 1.0_f64.to_radians() }
    }
}

/// Standard deviation of the height of the point on the target that is meant, radians: the visible part of a tall target
/// changes from frame to frame, and its box shows the visible part only.
const HEIGHT_SIGMA: f64 = 0.08;
/// A box of width w holds the point that is meant with this standard deviation, as a fraction of w: that of a uniform
/// distribution.
const WITHIN_BOX: f64 = 0.289;

/// Difference of the natural logarithm of the range that corresponds to one depth label: ln 10 / 4.5.
const LABEL: f64 = core::f64::consts::LN_10 / 4.5;

impl Sighting {
    /// The sighting of a point with a depth label in the frame that was taken at `pose`.
    ///
    /// The highest label means any range from its lower bound on, and the lowest any up to its upper bound, so their
    /// ranges are less exact by half a label and by one label.
    ///
    /// # Errors
    /// [`UnprojectError`] for a point through which no line of sight leads.
    #[expect(clippy::too_many_arguments, reason = "each is a different fact about the frame or the reply")]
    pub fn of_label(
        captured: Time,
        id: u64,
        stage: u32,
        pose: Pose,
        odometry: Odometry,
        camera: &Camera,
        lifting: Lifting,
        point: ImagePoint,
        depth: Option<u8>,
        trust: &Trust,
    ) -> Result<Self, UnprojectError> {
        let body = lift(unproject(camera, point, 1.0)?, camera, pose.attitude, lifting);
        let ahead = EnuPosition::default().displaced(body, pose.attitude.heading);
        let range = depth.map(|label| {
            let rounding = LABEL / libm::sqrt(12.0);
            let open = match label {
                1 => 0.5 * LABEL,
                DEPTH_LABELS => LABEL,
                _ => 0.0,
            };
            let sigma = libm::hypot(libm::hypot(trust.ln_range, rounding), open);
            RangeReading { ln_range: libm::log(range_of_label(f64::from(label))), sigma }
        });
        // A pixel off the axis subtends less than one on it, so this bounds the error of the direction.
        let point_sigma = trust.point * f64::from(camera.width) / camera.fx;
        Ok(Self {
            captured,
            id,
            stage,
            from: pose.position,
            odometry,
            direction: EnuDirection::towards(ahead),
            bearing_sigma: libm::hypot(point_sigma, trust.heading),
            elevation_sigma: libm::hypot(point_sigma, HEIGHT_SIGMA),
            range,
        })
    }

    /// The sighting of a target that fills `area` of the image: the next one may mean another of its points.
    #[must_use]
    pub fn of_box(self, area: ImageBox, camera: &Camera) -> Self {
        let ImageBox { left, top, right, bottom } = area;
        let across = WITHIN_BOX * (right - left).max(0.0) * f64::from(camera.width) / camera.fx;
        let upright = WITHIN_BOX * (bottom - top).max(0.0) * f64::from(camera.height) / camera.fy;
        Self {
            bearing_sigma: libm::hypot(self.bearing_sigma, across),
            elevation_sigma: libm::hypot(self.elevation_sigma, upright),
            ..self
        }
    }

    /// The same with what the lower edge of its box tells, in a frame taken at `pose`: a target stands on the ground or hangs above
    /// it, so the range to the ground there is the most that it can be.
    #[must_use]
    pub fn on_ground(self, area: ImageBox, camera: &Camera, pose: Pose) -> Self {
        let Some((label, ground)) = self.range.zip(by_ground(camera, pose, area, 0.0)) else { return self };
        let is_beyond = label.ln_range > ground.ln_range;
        match ground.fused_with((label.ln_range, label.sigma * label.sigma)).filter(|_| is_beyond) {
            Some((ln_range, variance)) => Self { range: Some(RangeReading { ln_range, sigma: libm::sqrt(variance) }), ..self },
            None => self,
        }
    }

    /// Order of application: by capture, then by number.
    pub(super) fn key(&self) -> (Time, u64) {
        (self.captured, self.id)
    }

    pub(super) fn is_valid(&self) -> bool {
        let EnuDirection { east, north, up } = self.direction;
        let length = east * east + north * north + up * up;
        let from = [self.from.east, self.from.north, self.from.up];
        from.iter().all(|x| x.is_finite())
            && (length - 1.0).abs() < 1e-6
            && self.bearing_sigma.is_finite()
            && self.bearing_sigma > 0.0
            && self.elevation_sigma.is_finite()
            && self.elevation_sigma > 0.0
            && self.odometry.is_finite()
            && self.range.is_none_or(|range| range.ln_range.is_finite() && range.sigma.is_finite() && range.sigma > 0.0)
    }
}
