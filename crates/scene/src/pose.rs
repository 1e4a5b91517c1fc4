//! Poses in scene files, and default poses.

use spf_core::craft::CraftKind;
use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};

/// The craft's view at take-off height; from the ground mostly ground is visible.
pub(crate) fn above(start: Pose, craft: CraftKind) -> Pose {
    let up = start.position.up + craft.craft().take_off_height;
    Pose { position: EnuPosition { up, ..start.position }, ..start }
}

/// A pose written `east,north,up,heading_deg[,pitch_deg]`; `None` for other texts.
pub(crate) fn parse_pose(text: &str) -> Option<Pose> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse::<f64>().ok().filter(|v| v.abs() <= 2000.0)).collect();
    let (position, heading, pitch) = match numbers.as_deref() {
        Some(&[east, north, up, heading]) => (EnuPosition { east, north, up }, heading, 0.0),
        Some(&[east, north, up, heading, pitch]) => (EnuPosition { east, north, up }, heading, pitch),
        _ => return None,
    };
    let attitude = Attitude { heading: wrap_angle(heading.to_radians()), pitch: wrap_angle(pitch.to_radians()), roll: 0.0 };
    Some(Pose { position, attitude })
}
