//! [`Space`]: what frames, replies and sensors have shown of the surroundings.

use crate::avoid::BODY_MARGIN;
use crate::frames::{FLOWN_COUNTS, FRAME_COUNTS, Frames, points_on};
use crate::mapped::Mapped;
use crate::obstacle_map::{CELL, Cell, ObstacleMap};
use crate::panels::Panels;
use crate::shown::Shown;
use crate::viewpoint::Viewpoint;
use core::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6};
use spf_core::camera::Camera;
use spf_core::depth::DepthGrid;
use spf_core::direction::Direction;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::keep_out::KeepOut;
use spf_core::primitives::Primitives;
use spf_core::ranges::RangeScan;
use spf_core::reply::Reply;
use spf_core::time::Time;
use spf_motion::odometry::Odometry;

/// Directions away from what is ahead, radians from straight back.
const ASIDE: [f64; 6] = [-FRAC_PI_6, FRAC_PI_6, -FRAC_PI_3, FRAC_PI_3, -FRAC_PI_2, FRAC_PI_2];
/// An obstacle of the map forbids a vertical search move if it is this near to its path or its end, metres beyond the body.
const BESIDE: f64 = 0.5;
const ABOVE: f64 = 0.3;
/// Distance from a target's place at which a known obstacle in between counts as the target, metres.
pub const OWN_SURFACE: f64 = 1.5;

/// What is known of the surroundings. It answers questions; the brake alone gets a list.
#[derive(Debug)]
pub struct Space {
    /// Radius of the body, metres.
    radius: f64,
    frames: Frames,
    shown: Shown,
    panels: Panels,
    /// The map and its planner; `None` if nothing measures what would fill it.
    pub mapped: Option<Mapped>,
    /// The keep-out volumes that the operator has marked.
    kept_out: Vec<KeepOut>,
    /// Number of the last of them that the loss of the position has made void.
    voided: Option<u32>,
}

impl Space {
    /// Nothing is known yet around a body of this radius, metres; `map`: whether depth or ranges are measured.
    #[must_use]
    pub fn new(radius: f64, map: bool) -> Self {
        Self {
            radius,
            frames: Frames::default(),
            shown: Shown::default(),
            panels: Panels::default(),
            mapped: map.then(Mapped::default),
            kept_out: Vec::new(),
            voided: None,
        }
    }

    /// The obstacle map, if there is one.
    #[must_use]
    pub fn map(&self) -> Option<&ObstacleMap> {
        self.mapped.as_ref().map(|mapped| &mapped.map)
    }

    /// Takes a usable frame; `odometry`: drift of the position until then.
    pub fn frame(&mut self, now: Time, from: Viewpoint, odometry: Odometry) {
        self.frames.add(from, odometry);
        if let Some(Mapped { map, .. }) = &mut self.mapped {
            map.advance(now, from.pose.position);
            map.frame(from.captured, &from.camera, from.pose);
        }
    }

    /// Takes the measured height above what is below, metres, at `pose`.
    pub fn below(&mut self, now: Time, clearance: f64, pose: Pose) {
        if let Some(Mapped { map, .. }) = &mut self.mapped {
            map.advance(now, pose.position);
            let end = EnuPosition { up: pose.position.up - clearance, ..pose.position };
            map.ray(pose.position, end, true);
        }
    }

    /// Takes a depth grid captured at `pose`.
    pub fn depth(&mut self, now: Time, grid: &DepthGrid, pose: Pose) {
        if let Some(Mapped { map, depth_at, .. }) = &mut self.mapped {
            map.advance(now, pose.position);
            map.depth(grid, pose);
            *depth_at = Some(grid.captured.min(now));
        }
    }

    /// Takes a scan of a sensor around the craft, measured at `pose`.
    pub fn ranges(&mut self, now: Time, scan: &RangeScan, pose: Pose) {
        if let Some(Mapped { map, .. }) = &mut self.mapped {
            map.advance(now, pose.position);
            map.ranges(scan, pose);
        }
    }

    /// Takes what a reply shows to be free; `asked_for`: whether its query asked for what is near, without which it says nothing of it.
    pub fn reply(&mut self, from: Viewpoint, odometry: Odometry, reply: &Reply, asked_for: bool) {
        if asked_for {
            self.shown.reply(from, odometry, reply);
        } else {
            self.shown.expire(from.captured);
        }
    }

    /// Takes the boxes of a reply, but the target's, as obstacles for the brake.
    pub fn boxes(&mut self, from: Viewpoint, reply: &Reply) {
        self.panels.reply(from, reply);
    }

    /// What the brake has to know of the boxes of the last replies.
    pub fn panels(&mut self, now: Time) -> impl Iterator<Item = EnuPosition> {
        self.panels.points(now)
    }

    /// Forgets the boxes of replies: somebody else is flown to, or nobody knows where they are.
    pub fn forget_boxes(&mut self) {
        self.panels.clear();
    }

    /// Forgets where everything was, but the keep-out volumes: nobody knows where they are now.
    pub fn forget_places(&mut self) {
        if let Some(Mapped { map, .. }) = &mut self.mapped {
            map.clear();
        }
        self.frames.clear();
        self.shown.clear();
    }

    /// The keep-out volumes that the operator has marked.
    #[must_use]
    pub fn kept_out(&self) -> &[KeepOut] {
        &self.kept_out
    }

    /// Takes the keep-out volumes, instead of those before, and returns those that count: an order that crossed with the loss of
    /// the position may name volumes of before.
    pub fn keep_out(&mut self, mut places: Vec<KeepOut>) -> &[KeepOut] {
        places.retain(|place| self.voided.is_none_or(|last| place.id > last));
        if let Some(Mapped { map, told, .. }) = &mut self.mapped {
            map.keep_out(places.iter().flat_map(|place| place.points(CELL)).map(Cell::of));
            // The brake gets them at once.
            *told = None;
        }
        self.kept_out = places;
        &self.kept_out
    }

    /// Makes the keep-out volumes void, since the position was lost. Returns whether there were any.
    pub fn void_kept_out(&mut self) -> bool {
        let last = self.kept_out.iter().map(|place| place.id).max();
        self.voided = last.or(self.voided);
        last.is_some()
    }

    /// Whether the straight path was in view within 3 s, or flown within 12 s: enough for a motion backwards.
    #[must_use]
    pub fn shows_back(&self, now: Time, camera: &Camera, path: [EnuPosition; 2]) -> bool {
        self.frames.show(now, camera, path, FLOWN_COUNTS)
    }

    /// Whether the straight path was in view, or flown, within 3 s: enough for a descent.
    #[must_use]
    pub fn shows_below(&self, now: Time, camera: &Camera, path: [EnuPosition; 2]) -> bool {
        self.frames.show(now, camera, path, FRAME_COUNTS)
    }

    /// Whether a straight path away from a person is known to be free of what stands still: it was flown, or shown by a reply,
    /// and the position has not drifted much since then; or it was in view within the last 3 s.
    #[must_use]
    pub fn is_way_out(&self, now: Time, camera: &Camera, odometry: Odometry, path: [EnuPosition; 2]) -> bool {
        let around = self.radius + BODY_MARGIN;
        // What the newest reply that shows a place says of it comes before the rest.
        points_on(path).all(|point| {
            let shown = self.shown.is_free(now, point, around, odometry);
            shown.unwrap_or_else(|| self.frames.show_or_flown(now, camera, point, odometry))
        })
    }

    /// A motion of the same length that leads away from what is ahead, aside and back, over what is known to be free.
    #[must_use]
    pub fn way_back(
        &self,
        now: Time,
        camera: &Camera,
        odometry: Odometry,
        pose: Pose,
        primitives: Primitives,
    ) -> Option<Primitives> {
        let length = primitives.forward;
        let ways =
            ASIDE.map(|off| Primitives { forward: length * libm::cos(off), right: -length * libm::sin(off), ..primitives });
        ways.into_iter().find(|way| {
            let heading = pose.attitude.heading + libm::atan2(way.right, way.forward);
            let to = Direction { bearing: heading, elevation: 0.0 }.place(pose.position, libm::hypot(way.right, way.forward));
            self.is_way_out(now, camera, odometry, [pose.position, to])
        })
    }

    /// Whether the map has an obstacle above or below `at`, or beside the way there; `climb` in metres, negative downwards.
    #[must_use]
    pub fn bars_climb(&self, at: EnuPosition, climb: f64) -> bool {
        let (above, beside) = (self.radius + ABOVE, self.radius + BESIDE);
        self.map().is_some_and(|map| !map.is_column_clear(at, climb + above.copysign(climb), beside))
    }

    /// Whether the map has an obstacle between the craft and a target's place, `range` metres away.
    #[must_use]
    pub fn hides(&self, from: EnuPosition, place: EnuPosition, range: f64) -> bool {
        self.map().is_some_and(|map| {
            let until = (1.0 - OWN_SURFACE / range.max(OWN_SURFACE)).max(0.0);
            !map.is_clear(from, from.towards(place, until))
        })
    }
}
