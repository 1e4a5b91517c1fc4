//! Distances, sweeps and rays over hand-made geometry.

use glam::Vec3;
use proptest::prelude::*;
use spf_scene::collide::{Collider, ColliderError};
use spf_scene::geometry::Role;

use crate::boxes::{FLOOR, TABLE, WALL, at, block, geometry, scene};

#[test]
fn distances_are_those_worked_by_hand() {
    let world = scene();
    let near = world.nearest(at(0.0, 17.0, 5.0)).unwrap();
    assert_eq!(near.object, WALL);
    assert!((near.distance - 3.0).abs() < 1e-5, "{near:?}");
    // 3 m east of the table's edge and 4 m above its top.
    assert!((world.distance_to(TABLE, at(35.0, 0.0, 6.0)).unwrap() - 5.0).abs() < 1e-5);
    assert!((world.distance_to(FLOOR, at(35.0, 0.0, 6.0)).unwrap() - 6.0).abs() < 1e-5);
    assert_eq!(world.distance_to(99, at(0.0, 0.0, 0.0)), None);
    // Surfaces are hollow: from inside a body the distance is that to its wall.
    assert!((world.distance_to(FLOOR, at(0.0, 0.0, -0.25)).unwrap() - 0.25).abs() < 1e-5);
}

#[test]
fn only_solid_parts_are_touched() {
    let world = scene();
    assert_eq!(world.objects().collect::<Vec<_>>(), [FLOOR, WALL, TABLE]);
    assert!(world.sweep(at(0.0, 0.0, 5.0), at(0.0, -50.0, 5.0), 0.3).is_none());
}

#[test]
fn ground_is_the_first_surface_below() {
    let world = scene();
    let table = world.ground_below(at(30.0, 0.0, 9.0)).unwrap();
    assert!(table.object == TABLE && (table.up - 2.0).abs() < 1e-5);
    let under = world.ground_below(at(30.0, 0.0, 1.0)).unwrap();
    assert!(under.object == FLOOR && under.up.abs() < 1e-5);
    assert_eq!(world.ground_below(at(900.0, 0.0, 9.0)), None);
}

#[test]
fn a_wall_blocks_sight_and_air_does_not() {
    let world = scene();
    assert_eq!(world.segment_blocked(at(0.0, 0.0, 5.0), at(0.0, 40.0, 5.0)), Some(WALL));
    assert_eq!(world.segment_blocked(at(0.0, 0.0, 5.0), at(0.0, 19.9, 5.0)), None);
    assert_eq!(world.segment_blocked(at(0.0, 0.0, 35.0), at(0.0, 40.0, 35.0)), None);
}

#[test]
fn a_sweep_stops_where_the_sphere_touches() {
    let hit = scene().sweep(at(0.0, 0.0, 5.0), at(0.0, 40.0, 5.0), 0.3).unwrap();
    assert_eq!(hit.object, WALL);
    assert!((hit.centre.north - 19.7).abs() < 2e-3, "{hit:?}");
    assert!(hit.upward.abs() < 1e-3);
    let floor = scene().sweep(at(0.0, 0.0, 5.0), at(0.0, 0.0, -5.0), 0.3).unwrap();
    assert!(floor.object == FLOOR && floor.upward > 0.999);
}

#[test]
fn an_empty_scene_is_empty_air() {
    let world = Collider::new(&geometry(Vec::new())).unwrap();
    assert_eq!(world.nearest(at(0.0, 0.0, 0.0)), None);
    assert_eq!(world.ground_below(at(0.0, 0.0, 0.0)), None);
    assert!(world.sweep(at(0.0, 0.0, 0.0), at(9.0, 0.0, 0.0), 1.0).is_none());
}

#[test]
fn broken_geometry_is_refused() {
    let mut part = block(4, Vec3::ZERO, Vec3::ONE, Role::Solid);
    part.triangles.push([0, 1, 8]);
    let error = Collider::new(&geometry(vec![part])).unwrap_err();
    assert!(matches!(error, ColliderError::CornerOutOfRange { object: 4, corner: 8, corners: 8, .. }), "{error}");
    let mut part = block(4, Vec3::ZERO, Vec3::ONE, Role::Solid);
    part.vertices[3].position.x = f32::NAN;
    assert!(matches!(Collider::new(&geometry(vec![part])), Err(ColliderError::NotFinite { part: 0, object: 4 })));
}

proptest! {
    /// From any place in front of the wall to any place behind it, within its outline, every sphere is stopped in front
    /// of it.
    #[test]
    fn nothing_tunnels_through_a_thin_wall(
        from in (-15.0..15.0, -60.0..19.0, 2.0..25.0), to in (-15.0..15.0, 21.0..80.0, 2.0..25.0), radius in 0.05..0.5,
    ) {
        let hit = scene().sweep(at(from.0, from.1, from.2), at(to.0, to.1, to.2), radius);
        let hit = hit.expect("the wall is in the way");
        prop_assert_eq!(hit.object, WALL);
        prop_assert!(hit.centre.north < 20.0 && hit.centre.north > (20.0 - radius - 1e-3).min(from.1));
    }

    /// The nearest object overall is the nearest of all objects.
    #[test]
    fn nearest_is_the_least_of_all_distances(east in -50.0..50.0, north in -50.0..50.0, up in 0.0..40.0) {
        let world = scene();
        let point = at(east, north, up);
        let least = world.objects().filter_map(|id| world.distance_to(id, point)).fold(f64::INFINITY, f64::min);
        prop_assert!((world.nearest(point).unwrap().distance - least).abs() < 1e-4);
    }
}
