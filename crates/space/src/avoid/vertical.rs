//! Whether a climb or a descent on the spot is clear of the obstacles in a view.
//!
//! A forward camera sees neither the space above nor the space below the craft. An object that extends beyond the upper
//! edge of the frame may hang over it, unless its visible part is already higher than the end of the climb.

use super::near_edge;
use spf_core::camera::Camera;
use spf_core::geometry::Attitude;
use spf_core::lift::{CameraDisplacement, Lifting, lift};
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::ObstacleBox;

/// Whether the craft can climb by `climb` metres, negative for a descent, with `clearance` metres around it, among `boxes` of a
/// view taken with this attitude where it starts.
#[must_use]
pub fn is_clear_vertically(camera: &Camera, attitude: Attitude, boxes: &[ObstacleBox], climb: f64, clearance: f64) -> bool {
    !boxes.iter().any(|obstacle| {
        let (reaches, v) = if climb > 0.0 {
            (obstacle.area.top < ImageBox::CUT, 0.0)
        } else {
            (obstacle.area.bottom > 1.0 - ImageBox::CUT, 1.0)
        };
        let ray = camera.ray(ImagePoint { u: 0.5 * (obstacle.area.left + obstacle.area.right), v });
        let along = CameraDisplacement { right: ray.right, forward: 1.0, up: ray.up };
        let level = lift(along, camera, attitude, Lifting::Levelled);
        // The lowest label also stands for anything nearer than its interval.
        let near = if obstacle.depth <= 1 { 0.0 } else { near_edge(obstacle) };
        // A label is a distance along the line of sight. At the edge of the frame, this is its height above or below
        // the craft.
        let away = near * level.up * climb.signum() / level.length();
        reaches && away < climb.abs() + clearance
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::query::ImageBox;

    fn obstacle(top: f64, bottom: f64, depth: u8) -> ObstacleBox {
        ObstacleBox { area: ImageBox { left: 0.3, top, right: 0.6, bottom }, depth, name: "beam".to_owned() }
    }

    #[test]
    fn a_climb_needs_no_near_box_at_the_top_edge_and_a_descent_none_at_the_bottom() {
        let camera = Camera::quad();
        let clear = |obstacle: ObstacleBox, climb| is_clear_vertically(&camera, Attitude::default(), &[obstacle], climb, 0.5);
        assert!(clear(obstacle(0.2, 0.8, 1), 1.0), "it ends inside the frame");
        assert!(!clear(obstacle(0.0, 0.5, 2), 1.0), "a beam ahead, perhaps over the craft");
        assert!(clear(obstacle(0.0, 0.5, 2), -1.0));
        assert!(!clear(obstacle(0.5, 1.0, 2), -1.0), "a table");
        // A tower 36 m ahead leaves the frame far above the end of the climb.
        assert!(clear(obstacle(0.0, 1.0, 8), 3.0) && !clear(obstacle(0.0, 1.0, 8), 40.0));
        assert!(is_clear_vertically(&camera, Attitude::default(), &[], 3.0, 0.5));
        // A Tello's lens is tilted down by 5°: its upper edge points up by 16°, and 3.6 m along that is 1.0 m up, not 1.4 m.
        assert!(!is_clear_vertically(&Camera::tello(), Attitude::default(), &[obstacle(0.0, 0.5, 4)], 1.0, 0.35));
        // Label 1 stands for anything nearer.
        assert!(!clear(obstacle(0.0, 0.5, 1), 0.1));
    }
}
