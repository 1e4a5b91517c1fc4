//! A craft in a hand-made scene: a wide floor with boxes.

#[path = "../../../scene/tests/it/boxes.rs"]
mod boxes;

pub(crate) use boxes::{FLOOR, TABLE, WALL, at, facing, geometry, scene};
use spf_core::command::{Command, Setpoint};
use spf_core::geometry::EnuPosition;
use spf_core::time::{Duration, Time};
use spf_sim::craft::SimCraft;
use spf_sim::dynamics::SimConditions;
use spf_sim::model::Model;

/// In the air at `position`, facing north, telemetry exact.
pub(crate) fn hovering(model: Model, position: EnuPosition) -> SimCraft {
    let conditions = SimConditions { exact: true, hovering: true, ..SimConditions::new(1) };
    SimCraft::with_conditions(scene(), model, facing(position, 0.0), conditions)
}

pub(crate) fn forward(speed: f64) -> Setpoint {
    Setpoint { forward: speed, ..Setpoint::HOLD }
}

/// Commands a setpoint at the craft's present time, without expiry.
pub(crate) fn command(craft: &mut SimCraft, setpoint: Setpoint) {
    craft.apply(craft.time(), Command::Setpoint(setpoint), Time::from_millis(u64::MAX / 2_000_000));
}

pub(crate) fn fly_on(craft: &mut SimCraft, millis: u64) {
    craft.advance_to(craft.time() + Duration::from_millis(millis));
}
