//! Normals for meshes without them: smooth over gentle bends, split at edges.

use glam::Vec3;

/// Cosine of the angle from which a bend counts as an edge: 45 degrees.
const CREASE: f32 = 0.707;

/// Vertices with more triangles than this keep the normals of their triangles: their mean describes no surface.
const MOST: usize = 48;

/// A unit normal for each corner of each triangle. Triangles must have an area.
pub(super) fn smooth(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[Vec3; 3]> {
    let across: Vec<Vec3> = triangles.iter().map(|t| cross(t.map(|i| positions[i as usize]))).collect();
    let unit: Vec<Vec3> = across.iter().map(|n| n.normalize_or_zero()).collect();
    // Triangles around each vertex, as concatenated lists.
    let mut ends = vec![0_usize; positions.len() + 1];
    for &i in triangles.iter().flatten() {
        ends[i as usize + 1] += 1;
    }
    for i in 0..positions.len() {
        ends[i + 1] += ends[i];
    }
    let mut about = vec![0_u32; triangles.len() * 3];
    let mut next = ends.clone();
    for (t, corners) in triangles.iter().enumerate() {
        for &i in corners {
            about[next[i as usize]] = t as u32;
            next[i as usize] += 1;
        }
    }
    let normal = |t: usize, corner: u32| {
        let around = &about[ends[corner as usize]..ends[corner as usize + 1]];
        if around.len() > MOST {
            return unit[t];
        }
        let gentle = around.iter().map(|&other| other as usize).filter(|&other| unit[other].dot(unit[t]) > CREASE);
        gentle.map(|other| across[other]).sum::<Vec3>().try_normalize().unwrap_or(unit[t])
    };
    triangles.iter().enumerate().map(|(t, corners)| corners.map(|corner| normal(t, corner))).collect()
}

/// The normal of a triangle, with the length of twice its area.
pub(super) fn cross([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_keeps_its_edges_and_a_dome_is_smooth() {
        // Two walls at a right angle with shared vertices on the edge.
        let corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, -1.0), (1.0, 1.0, -1.0)].map(Vec3::from);
        let normals = smooth(&corners, &[[0, 1, 2], [1, 3, 4]]);
        assert_eq!((normals[0], normals[1]), ([Vec3::Z; 3], [Vec3::X; 3]));
        // The same bent by 20 degrees: the normals of the shared vertices point between the two.
        let bent = Vec3::new(1.0 + 0.94, 0.0, -0.34);
        let normals = smooth(&[corners[0], corners[1], corners[2], bent], &[[0, 1, 2], [1, 3, 2]]);
        assert!(normals[0][1].x > 0.1 && normals[0][1].x < 0.3 && normals[0][0] == Vec3::Z);
        assert_eq!(normals[0][1], normals[1][0]);
    }
}
