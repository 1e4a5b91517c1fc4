//! The metres of a network's depth: by what the craft's own reports tell of distances.

use std::collections::VecDeque;

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::depth::DepthGrid;
use spf_core::geometry::Pose;
use spf_core::gimbal::{Gimbal, GimbalReport};
use spf_core::ranges::RangeScan;
use spf_core::telemetry::Telemetry;
use spf_core::time::{Duration, Time};
use spf_detect::mono_depth::{Clues, MonoDepth, NoScale, PastScan, Scale};
use spf_drone::Capabilities;
use spf_motion::estimator::MotionEstimator;

/// An older estimate is of no use: the craft is elsewhere.
const STALE: Duration = Duration::from_secs(3);
/// Scans that are kept, and how far from a frame's capture one may be measured to say something about the frame.
const SCANS: usize = 128;
const SIMULTANEOUS: Duration = Duration::from_millis(150);
/// A depth sensor whose last grid is at most this old measures what a network would only estimate.
const SENSED: Duration = Duration::from_secs(1);
/// A grid is that of a camera that is fixed to the craft. A gimbal's is not while the craft rolls by more than this, radians.
const LEVEL: f64 = 0.07;
/// A change of what is known is reported after this many estimates in a row.
const STEADY: u32 = 4;

/// What a craft's reports tell of distances in its frames.
pub(super) struct Scaling {
    camera: Camera,
    motion: MotionEstimator,
    /// Measurement time of the newest telemetry.
    newest: Option<Time>,
    gimbal: Gimbal,
    scans: VecDeque<PastScan>,
    /// Distance to the ground below, metres, if the last telemetry had it.
    below: Option<f64>,
    /// When a depth sensor has last measured.
    sensed: Option<Time>,
    /// Whether the scale is known, as it was last reported, and for how many estimates it has been otherwise.
    reported: Option<bool>,
    otherwise: u32,
}

impl Scaling {
    pub(super) fn new(about: &Capabilities) -> Self {
        Self {
            camera: about.camera,
            motion: MotionEstimator::new(&about.craft, about.senses),
            newest: None,
            gimbal: Gimbal::default(),
            scans: VecDeque::new(),
            below: None,
            sensed: None,
            reported: None,
            otherwise: 0,
        }
    }

    /// Takes telemetry; a report that is older than the newest one is ignored.
    pub(super) fn telemetry(&mut self, now: Time, telemetry: &Telemetry) {
        let time = telemetry.time.min(now);
        if self.newest.is_some_and(|newest| time <= newest) {
            return;
        }
        self.newest = Some(time);
        self.motion.observe(&Telemetry { time, ..*telemetry });
        self.below = telemetry.ground_clearance.filter(|below| below.is_finite());
    }

    /// Notes a setpoint, by which the motion between two reports is predicted.
    pub(super) fn commanded(&mut self, now: Time, setpoint: Setpoint) {
        self.motion.commanded(now, setpoint);
    }

    pub(super) fn gimbal(&mut self, report: GimbalReport) {
        self.gimbal.observe(report);
    }

    /// Keeps a scan, because the estimate for a frame of now comes later.
    pub(super) fn ranges(&mut self, now: Time, scan: &RangeScan) {
        let Some(pose) = self.motion.pose_at(scan.captured.min(now)) else { return };
        if self.scans.len() >= SCANS {
            self.scans.pop_front();
        }
        self.scans.push_back(PastScan { scan: scan.clone(), pose });
    }

    /// Notes that a depth sensor has measured.
    pub(super) fn sensed(&mut self, now: Time) {
        self.sensed = Some(now);
    }

    /// The pose from which a camera that is fixed to the craft would see what the camera has seen; `None` if it is not known.
    fn sight_at(&self, at: Time) -> Option<Pose> {
        self.gimbal.sight(&self.camera, at, self.motion.pose_at(at)?)
    }

    /// The depth of an estimate in metres. `None` if its frame's pose or its scale is not known, or a depth sensor measures it.
    pub(super) fn grid(&mut self, now: Time, estimate: &MonoDepth) -> Option<DepthGrid> {
        let captured = estimate.captured.min(now);
        let is_sensed = self.sensed.is_some_and(|at| now.since(at) < SENSED);
        if is_sensed || now.since(captured) > STALE || self.motion.lost_track().is_some_and(|lost| captured <= lost) {
            return None;
        }
        let (own, pose) = (self.motion.pose_at(captured)?, self.sight_at(captured)?);
        let apart = |past: &PastScan| past.scan.captured.since(captured).max(captured.since(past.scan.captured));
        let scans: Vec<PastScan> = self.scans.iter().filter(|past| apart(past) <= SIMULTANEOUS).cloned().collect();
        let clues = Clues { pose, scans: &scans, height: self.height(pose) };
        let metres = estimate.in_metres(&clues);
        self.report(&metres.as_ref().map(|(_, scale)| *scale).map_err(|why| *why));
        let mut grid = metres.ok()?.0.grid;
        if own != pose {
            if own.attitude.roll.abs() > LEVEL {
                return None;
            }
            grid.camera.tilt += own.attitude.pitch - pose.attitude.pitch;
        }
        Some(grid)
    }

    /// The height of the camera above the ground: as measured below the craft, else above the take-off place. `None` if the two
    /// contradict each other: the ground is not level then.
    fn height(&self, pose: Pose) -> Option<f64> {
        let above_take_off = pose.position.up;
        match self.below {
            Some(below) if (below - above_take_off).abs() > 0.3 + 0.1 * above_take_off.abs() => None,
            Some(below) => Some(below),
            None => Some(above_take_off),
        }
    }

    fn report(&mut self, last: &Result<Scale, NoScale>) {
        if self.reported == Some(last.is_ok()) {
            self.otherwise = 0;
            return;
        }
        self.otherwise += 1;
        if self.reported.is_some() && self.otherwise < STEADY {
            return;
        }
        (self.reported, self.otherwise) = (Some(last.is_ok()), 0);
        match last {
            Ok(scale) => tracing::info!("the depth network is in use: its depths are scaled by {}", scale.source.words()),
            Err(why) => tracing::warn!("the depth network is not in use: {why}"),
        }
    }
}
