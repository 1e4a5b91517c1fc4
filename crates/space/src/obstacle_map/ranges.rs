//! Ranges of sensors around the craft: added to the map, and read from it.

use super::{CELL, Cell, CellState, Line, ObstacleMap};
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::ranges::{MOST_RAYS, RangeRay, RangeScan};
use spf_core::time::Time;

/// A beam wider than this clears only its middle, radians: 10°.
const NARROW: f64 = 10.0 / 180.0 * core::f64::consts::PI;
/// What a beam has hit reaches at least this far above and below it, metres.
const TALL: f64 = 1.0;
/// The part of the cells in a direction that is free if all of it counts as free.
const NEARLY: f64 = 0.9;
/// Number of sectors around the craft that are read from the map, as `OBSTACLE_DISTANCE` has them.
const SECTORS: usize = 72;
/// How far they reach, metres.
const REACH: f64 = 9.0;

impl ObstacleMap {
    /// Adds a scan, measured at `pose`. What a beam has hit is somewhere along its arc, all of which counts as occupied; free is the
    /// middle of a beam, and all of a narrow one.
    pub fn ranges(&mut self, scan: &RangeScan, pose: Pose) {
        for ray in scan.rays.iter().take(MOST_RAYS).filter(|ray| ray.is_valid()) {
            if ray.metres.is_none() || ray.width > NARROW {
                // Up to a cell before the arc.
                let short = ray.metres.map_or(ray.reach, |metres| (metres - CELL).max(0.0));
                let free = RangeRay { metres: None, reach: short, ..*ray };
                self.ray(pose.position, free.end(pose, 0.0), false);
                for hit in ray.hits(pose) {
                    // At the hit alone: the ray to it lies beside the middle.
                    self.column(hit);
                }
            } else {
                for hit in ray.hits(pose) {
                    self.ray(pose.position, hit, true);
                    self.column(hit);
                }
            }
        }
    }

    /// Occupies a hit, and what is above and below it: no beam measures whether a wall ends there, and no way leads under one on a guess.
    fn column(&mut self, hit: EnuPosition) {
        let cells = libm::round(TALL / CELL) as i32;
        for nth in -cells..=cells {
            let place = EnuPosition { up: hit.up + f64::from(nth) * CELL, ..hit };
            self.ray(place, place, true);
        }
    }

    /// What the map knows in each sector around a craft at `pose`, at its height, up to `beside` metres above and below: the nearest
    /// occupied cell, or that all is free up to 9 m. Sectors of which it knows less are left out.
    #[must_use]
    pub fn around(&self, now: Time, pose: Pose, beside: f64) -> RangeScan {
        let width = core::f64::consts::TAU / SECTORS as f64;
        let mut nearest = [None::<f64>; SECTORS];
        for place in self.occupied().map(Cell::middle) {
            let away = pose.position.horizontal_distance(place);
            if (place.up - pose.position.up).abs() > beside || away > REACH {
                continue;
            }
            // As wide as the cell, so that a wall has no gaps.
            let half = libm::atan2(0.5 * CELL, away.max(0.5 * CELL));
            let azimuth = wrap_angle(pose.position.bearing_to(place) - pose.attitude.heading);
            let (first, last) = (libm::round((azimuth - half) / width) as i32, libm::round((azimuth + half) / width) as i32);
            for sector in first..=last {
                let slot = &mut nearest[sector.rem_euclid(SECTORS as i32) as usize];
                *slot = Some(slot.map_or(away, |known| known.min(away)));
            }
        }
        let rays = (0..SECTORS).filter_map(|sector| {
            let azimuth = sector as f64 * width;
            let ray = RangeRay { azimuth, elevation: 0.0, width, metres: nearest[sector], reach: REACH };
            (ray.metres.is_some() || self.is_known_free(pose, azimuth)).then_some(ray)
        });
        RangeScan { captured: now, sensor: 0, rays: rays.collect() }
    }

    /// Whether rays have passed all the way in a direction, level: in nearly every cell there, or in one beside it, since the line of
    /// a ray and this one need not pass through the same cells.
    fn is_known_free(&self, pose: Pose, azimuth: f64) -> bool {
        let heading = pose.attitude.heading + azimuth;
        let at = pose.position;
        let end = EnuPosition { east: at.east + REACH * libm::sin(heading), north: at.north + REACH * libm::cos(heading), ..at };
        let is_free = |cell: Cell| self.known(cell) == CellState::Free;
        let (mut free, mut all) = (0_u32, 0_u32);
        for cell in Line::new(Cell::of(at), Cell::of(end)).skip(1) {
            let Cell { east, north, .. } = cell;
            let beside = [(east - 1, north), (east + 1, north), (east, north - 1), (east, north + 1)];
            all += 1;
            free += u32::from(is_free(cell) || beside.into_iter().any(|(east, north)| is_free(Cell { east, north, ..cell })));
        }
        f64::from(free) >= NEARLY * f64::from(all)
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use spf_core::geometry::Attitude;

    fn pose(heading: f64) -> Pose {
        Pose { position: EnuPosition { east: 0.1, north: 0.1, up: 3.1 }, attitude: Attitude { heading, ..Attitude::default() } }
    }

    fn scan(rays: Vec<RangeRay>) -> RangeScan {
        RangeScan { captured: Time::ZERO, sensor: 1, rays }
    }

    fn map(pose: Pose) -> ObstacleMap {
        let mut map = ObstacleMap::new();
        map.advance(Time::ZERO, pose.position);
        map
    }

    fn sector(metres: Option<f64>, azimuth: f64) -> RangeRay {
        RangeRay { azimuth, elevation: 0.0, width: 5.0_f64.to_radians(), metres, reach: 9.5 }
    }

    #[test]
    fn what_was_added_is_read_again_in_the_direction_it_came_from() {
        for heading in [0.0, 1.0, -2.5] {
            let pose = pose(heading);
            let mut map = map(pose);
            let all: Vec<RangeRay> = (0..72)
                .map(|n| {
                    let azimuth = f64::from(n) * 5.0_f64.to_radians();
                    // A wall on the right, from 45° to 135°, open space elsewhere, and nothing known behind.
                    let metres = (9..=27).contains(&n).then(|| 4.0 / libm::sin(azimuth));
                    sector(metres, azimuth)
                })
                .filter(|ray| wrap_angle(ray.azimuth - PI).abs() > 0.5)
                .collect();
            for _ in 0..3 {
                map.ranges(&scan(all.clone()), pose);
            }
            let around = map.around(Time::ZERO, pose, 0.5);
            let at = |degrees: f64| {
                around.rays.iter().find(|ray| (ray.azimuth.to_degrees() - degrees).abs() < 1e-6).map(|ray| ray.metres)
            };
            let right = at(90.0).flatten().unwrap();
            assert!((right - 4.0).abs() < 0.3, "{heading}: {right}");
            assert_eq!((at(0.0), at(180.0), at(315.0)), (Some(None), None, Some(None)), "{heading}: ahead free, behind unknown");
        }
    }

    #[test]
    fn a_wide_beam_occupies_its_arc_and_clears_only_its_middle() {
        let (pose, half) = (pose(0.0), 15.0_f64.to_radians());
        let mut map = map(pose);
        let beam = RangeRay { azimuth: 0.0, elevation: 0.0, width: 2.0 * half, metres: Some(4.0), reach: 9.0 };
        map.ranges(&scan(vec![beam]), pose);
        let state =
            |azimuth: f64, metres: f64| map.known(Cell::of(RangeRay { metres: Some(metres), azimuth, ..beam }.end(pose, 0.0)));
        assert_eq!(
            (state(0.0, 4.0), state(half, 4.0), state(-half, 4.0)),
            (CellState::Occupied, CellState::Occupied, CellState::Occupied)
        );
        assert_eq!(
            (state(0.0, 2.0), state(half, 2.0), state(FRAC_PI_2, 2.0)),
            (CellState::Free, CellState::Unknown, CellState::Unknown)
        );
    }
}
