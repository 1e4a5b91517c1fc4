//! Curved courses over the ground, and profiles swept along them: paths, streams, tracks, beams.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Offset, Sketch, Surface, parts};

/// Maximum number of points of a course, so that a hostile file costs little.
const MOST_POINTS: usize = 60;

/// A smooth line through points `[right, forward]` in the local frame (Catmull-Rom: straight where four follow in line).
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Vec<[Offset; 2]>")]
pub(super) struct Course(Vec<Vec2>);

impl TryFrom<Vec<[Offset; 2]>> for Course {
    type Error = String;

    fn try_from(points: Vec<[Offset; 2]>) -> Result<Self, String> {
        let points: Vec<Vec2> = points.iter().map(|[x, y]| Vec2::new(x.0, y.0)).collect();
        if !(2..=MOST_POINTS).contains(&points.len()) {
            return Err(format!("a course must have 2 to {MOST_POINTS} points, not `{}`", points.len()));
        }
        if points.windows(2).any(|pair| pair[0].distance(pair[1]) < 0.1) {
            return Err("consecutive points of a course must be at least 0.1 m apart".to_owned());
        }
        Ok(Self(points))
    }
}

/// A place on a course.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    pub(super) at: Vec2,
    /// Unit vector to the right of the course.
    pub(super) right: Vec2,
    /// Metres from the start.
    pub(super) along: f32,
}

impl Station {
    /// The point `across` metres to the right and `up` metres high.
    pub(super) fn point(&self, across: f32, up: f32) -> Vec3 {
        (self.at + self.right * across).extend(up)
    }

    /// Unit vector along the course.
    pub(super) fn forward(&self) -> Vec2 {
        Vec2::new(-self.right.y, self.right.x)
    }
}

impl Course {
    /// Stations at equal distances of about `step` metres, both ends included.
    pub(super) fn stations(&self, step: f32) -> Vec<Station> {
        let line = self.dense();
        let mut along = vec![0.0f32];
        for pair in line.windows(2) {
            along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
        }
        let length = along[along.len() - 1];
        let count = parts(length, step);
        let mut segment = 0;
        (0..=count)
            .map(|i| {
                let wanted = length * i as f32 / count as f32;
                while segment + 2 < line.len() && along[segment + 1] < wanted {
                    segment += 1;
                }
                let (a, b) = (line[segment], line[segment + 1]);
                let fraction = (wanted - along[segment]) / (along[segment + 1] - along[segment]).max(1e-6);
                // The direction turns smoothly: between those at the two ends of the dense line's segment.
                let before = line[segment.saturating_sub(1)];
                let after = line[(segment + 2).min(line.len() - 1)];
                let forward = ((b - before).normalize() * (1.0 - fraction) + (after - a).normalize() * fraction).normalize();
                Station { at: a.lerp(b, fraction), right: Vec2::new(forward.y, -forward.x), along: wanted }
            })
            .collect()
    }

    /// Catmull-Rom through all points, sixteen pieces a segment; corners in line with the last are left out.
    fn dense(&self) -> Vec<Vec2> {
        let p = &self.0;
        let end = p.len() - 1;
        let mut line = vec![p[0]];
        for i in 0..end {
            let (b, c) = (p[i], p[i + 1]);
            let a = if i > 0 { p[i - 1] } else { b * 2.0 - c };
            let d = if i + 2 <= end { p[i + 2] } else { c * 2.0 - b };
            for k in 1..=16 {
                let t = k as f32 / 16.0;
                let cubic = b * 2.0
                    + (c - a) * t
                    + (a * 2.0 - b * 5.0 + c * 4.0 - d) * (t * t)
                    + (b * 3.0 - a - c * 3.0 + d) * (t * t * t);
                let next = cubic * 0.5;
                if next.distance(line[line.len() - 1]) > 1e-3 {
                    line.push(next);
                }
            }
        }
        line
    }
}

/// Sweeps an open `profile` of (across, up) along the stations: from left to right with the outside above it, seen in
/// the direction of the course. Level strips have u = 0 on the centre line, so that road markings are placed correctly.
pub(super) fn sweep(surface: &mut Surface, stations: &[Station], profile: &[(f32, f32)]) {
    let mut u = 0.0;
    for pair in profile.windows(2) {
        let (a, b) = (Vec2::from(pair[0]), Vec2::from(pair[1]));
        let side = b - a;
        let width = side.length();
        let normal = Vec2::new(-side.y, side.x) / width.max(1e-6);
        let (ua, ub) = if side.y.abs() < 1e-4 { (a.x, b.x) } else { (u, u + width) };
        u += width;
        for pair in stations.windows(2) {
            let (s, t) = (&pair[0], &pair[1]);
            let corners = [s.point(a.x, a.y), s.point(b.x, b.y), t.point(b.x, b.y), t.point(a.x, a.y)];
            let out = [s, s, t, t].map(|s| (s.right * normal.x).extend(normal.y));
            let uv = [(ua, s.along), (ub, s.along), (ub, t.along), (ua, t.along)].map(Vec2::from);
            surface.smooth([corners[0], corners[1], corners[2]], [out[0], out[1], out[2]], [uv[0], uv[1], uv[2]]);
            surface.smooth([corners[0], corners[2], corners[3]], [out[0], out[2], out[3]], [uv[0], uv[2], uv[3]]);
        }
    }
}

/// The footprint of a band that reaches `half` metres to both sides.
pub(super) fn outline(sketch: &mut Sketch, stations: &[Station], half: f32) {
    let right = stations.iter().map(|s| s.at + s.right * half);
    let left = stations.iter().rev().map(|s| s.at - s.right * half);
    sketch.outline.push(right.chain(left).collect());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_goes_through_its_points_and_stays_straight_where_they_are() {
        let points = [[0.0, 0.0], [0.0, 10.0], [0.0, 20.0], [0.0, 30.0], [10.0, 40.0]];
        let course = Course::try_from(points.map(|p| p.map(Offset)).to_vec()).unwrap();
        let stations = course.stations(1.0);
        assert_eq!((stations[0].at, stations[0].along), (Vec2::ZERO, 0.0));
        assert!(stations[stations.len() - 1].at.distance(Vec2::new(10.0, 40.0)) < 1e-4);
        for station in stations.iter().filter(|s| s.at.y < 19.0) {
            assert!(station.at.x.abs() < 1e-4 && station.right.distance(Vec2::X) < 1e-3, "{station:?}");
        }
        let last = stations[stations.len() - 1];
        assert!(last.forward().dot(Vec2::new(1.0, 1.0).normalize()) > 0.9, "{last:?}");
    }

    #[test]
    fn courses_are_refused_that_have_no_length_or_too_many_points() {
        let course = |points: Vec<[f32; 2]>| Course::try_from(points.iter().map(|p| p.map(Offset)).collect::<Vec<_>>());
        assert!(course(vec![[0.0, 0.0]]).unwrap_err().contains("2 to 60 points"));
        assert!(course(vec![[0.0, 0.0]; 61]).unwrap_err().contains("2 to 60 points"));
        assert!(course(vec![[0.0, 0.0], [0.0, 0.01]]).unwrap_err().contains("0.1 m apart"));
    }
}
