//! The footprint of an actor: a few discs that cover its mesh.

use glam::DVec2;

use super::{Actor, Gait};
use crate::geometry::Role;

/// Discs in a row along the body's forward axis.
#[derive(Clone, Debug)]
pub(crate) struct Footprint {
    /// Radius of each disc, metres.
    pub(crate) radius: f64,
    /// Their centres, metres forward of the middle.
    pub(crate) offsets: Vec<f64>,
    /// Half the wheelbase, metres; 0 on foot.
    pub(crate) axle: f64,
    /// Metres from the centre to the farthest point.
    pub(crate) reach: f64,
}

impl Footprint {
    /// The discs that cover the solid parts of an actor when it stands, at any heading. The stride of a walking person
    /// reaches farther, into the space reserved until it stands still.
    pub(crate) fn of(actor: &Actor) -> Self {
        let solid = actor.postures.iter().take(1).flatten().filter(|part| part.role == Role::Solid);
        let (mut half, mut round) = (DVec2::splat(0.05), 0.05_f64);
        for vertex in solid.flat_map(|part| &part.vertices) {
            let at = DVec2::new(f64::from(vertex.position.x), f64::from(vertex.position.y));
            half = half.max(at.abs());
            round = round.max(at.length());
        }
        match actor.motion.gait {
            Gait::Walk => Self { radius: round, offsets: vec![0.0], axle: 0.0, reach: round },
            Gait::Drive => {
                let count = (half.y / half.x).ceil().clamp(1.0, 12.0);
                let cell = half.y / count;
                let radius = DVec2::new(half.x, cell).length();
                let offsets: Vec<f64> = (0..count as u32).map(|k| (2.0 * f64::from(k) + 1.0 - count) * cell).collect();
                Self { radius, reach: half.y - cell + radius, offsets, axle: 0.6 * half.y }
            }
        }
    }
}
