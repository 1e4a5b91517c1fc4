//! Plane polygons: triangulation by ear clipping, and the convex hull.

use glam::Vec2;

fn turn(a: Vec2, b: Vec2, c: Vec2) -> f32 {
    (b - a).perp_dot(c - a)
}

/// Triangles of a simple polygon, counter-clockwise, by ear clipping; indices into `polygon`. Quadratic per corner, meant for
/// the profiles of the generators (tens of corners). Corners in line with their neighbours make no triangle.
pub(super) fn triangulate(polygon: &[Vec2]) -> Vec<[u32; 3]> {
    let mut left: Vec<u32> = (0..polygon.len() as u32).collect();
    let mut triangles = Vec::with_capacity(polygon.len().saturating_sub(2));
    let at = |i: u32| polygon[i as usize];
    while left.len() > 2 {
        let n = left.len();
        let ear = (0..n).find(|&i| {
            let [p, q, r] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let (a, b, c) = (at(p), at(q), at(r));
            turn(a, b, c) > 1e-9
                && left.iter().filter(|&&k| k != p && k != q && k != r).all(|&k| {
                    let x = at(k);
                    turn(a, b, x) < 0.0 || turn(b, c, x) < 0.0 || turn(c, a, x) < 0.0
                })
        });
        // If there is no ear, the remainder has no area (collinear corners): drop a corner and go on, so the loop
        // always ends.
        match ear {
            Some(i) => {
                triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
                left.remove(i);
            }
            None => {
                left.remove(flattest(polygon, &left));
            }
        }
    }
    triangles
}

fn flattest(polygon: &[Vec2], left: &[u32]) -> usize {
    let n = left.len();
    let area = |i: usize| {
        let [a, b, c] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]].map(|k| polygon[k as usize]);
        turn(a, b, c).abs()
    };
    (0..n).min_by(|&i, &j| area(i).total_cmp(&area(j))).unwrap_or(0)
}

/// Twice the area of a triangle, positive when its corners run counter-clockwise.
fn cross(o: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
}

/// Points without those well inside the octagon between the outermost ones of eight directions, which cannot be on a
/// hull (Akl and Toussaint 1978): for a mesh that removes most of them.
fn rim(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    const WAYS: [[f64; 2]; 8] =
        [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0], [-1.0, -1.0], [0.0, -1.0], [1.0, -1.0]];
    let Some(&first) = points.first() else { return Vec::new() };
    let mut far = WAYS.map(|way| (way[0] * first[0] + way[1] * first[1], first));
    for &p in points {
        for (way, far) in WAYS.iter().zip(&mut far) {
            let along = way[0] * p[0] + way[1] * p[1];
            *far = if along > far.0 { (along, p) } else { *far };
        }
    }
    let mut corners = far.map(|(_, p)| p).to_vec();
    corners.dedup();
    let sides: Vec<_> = corners.iter().copied().zip(corners.iter().copied().cycle().skip(1)).filter(|(a, b)| a != b).collect();
    // Far more than any rounding error.
    let well = 1e-6 * (far[0].0 + far[4].0) * (far[2].0 + far[6].0);
    let is_inside = |p: &[f64; 2]| sides.len() > 2 && sides.iter().all(|(a, b)| cross(*a, *b, *p) > well);
    points.iter().copied().filter(|p| !is_inside(p)).collect()
}

/// Convex hull, counter-clockwise (Andrew's monotone chain). Fewer than three distinct points are returned unchanged.
pub(crate) fn convex_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = rim(points);
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while hull.len() >= 2 && cross(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_concave_polygon_keeps_its_area() {
        // An L of area 3 in six corners.
        let l = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)].map(|(x, y)| Vec2::new(x, y));
        let triangles = triangulate(&l);
        let area: f32 = triangles.iter().map(|t| 0.5 * turn(l[t[0] as usize], l[t[1] as usize], l[t[2] as usize])).sum();
        assert_eq!(triangles.len(), 4);
        assert!((area - 3.0).abs() < 1e-6, "{area}");
    }

    #[test]
    fn the_hull_drops_inner_points() {
        let hull = convex_hull(&[[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 2.0], [1.0, 0.0]]);
        assert_eq!(hull, vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
    }
}
