//! Replacing the autopilot's fence before a flight: sent, read back, compared, and in force.

use std::time::{Duration, Instant};

use spf_core::geometry::EnuPosition;
use spf_mavlink::fence::{FenceError, FenceItem, FenceShape, MOST, items};
use spf_mavlink::frames::GlobalPosition;
use spf_mavlink::modes::Autopilot;

use super::craft::MavlinkCraft;
use super::fence_error::FencingError;
use super::settings::FencePlan;
use super::vehicle::Facts;

/// Maximum time for the transfer in one direction.
const TRANSFER: Duration = Duration::from_secs(60);
/// Maximum time for the vehicle to know its home.
const HOME: Duration = Duration::from_secs(5);
/// Maximum time for the fence to show in the vehicle's state.
const IN_FORCE: Duration = Duration::from_secs(5);
/// Number of times that it is put in force.
const TRIES: u32 = 4;
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// A fence on the globe.
fn shapes(plan: &FencePlan, origin: GlobalPosition, home: EnuPosition) -> Vec<FenceShape> {
    let place = |(east, north): (f64, f64)| origin.offset(EnuPosition { east, north, up: 0.0 }).e7();
    let polygon =
        |inside, ring: &[(f64, f64)]| FenceShape::Polygon { inside, corners: ring.iter().copied().map(place).collect() };
    match plan {
        FencePlan::Circle { radius } => {
            vec![FenceShape::Circle { inside: true, centre: place((home.east, home.north)), radius: *radius as f32 }]
        }
        FencePlan::Polygon { outer, holes } => {
            core::iter::once(polygon(true, outer)).chain(holes.iter().map(|hole| polygon(false, hole))).collect()
        }
    }
}

/// Waits for a value.
fn wait<T>(longest: Duration, mut of: impl FnMut() -> Option<T>) -> Option<T> {
    let begun = Instant::now();
    loop {
        let value = of();
        if value.is_some() || begun.elapsed() >= longest {
            return value;
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}

/// Whether the autopilot will do something at a fence of points.
fn acts(facts: &Facts) -> Result<(), FencingError> {
    let number = |name| facts.parameter(name);
    match facts.autopilot {
        // 1 warns.
        Autopilot::Px4 if number("GF_ACTION").is_none_or(|action| action < 2.0) => {
            Err(FencingError::NoAction("GF_ACTION to 2 (hold), 3 (return) or 5 (land)"))
        }
        Autopilot::ArduPilot if number("FENCE_ACTION").is_none_or(|action| action == 0.0) => {
            Err(FencingError::NoAction("FENCE_ACTION to 1 (return or land)"))
        }
        // Polygons and circles that were uploaded.
        Autopilot::ArduPilot if number("FENCE_TYPE").is_none_or(|kinds| kinds as i64 & 4 == 0) => {
            Err(FencingError::NoAction("FENCE_TYPE to 7 (height, circle around home, polygons)"))
        }
        _ => Ok(()),
    }
}

/// Sends a fence, and reads it back.
fn send(craft: &MavlinkCraft, items: &[FenceItem]) -> Result<(), FencingError> {
    craft.with_vehicle(|vehicle, now| vehicle.send_fence(now, items.to_vec()));
    match wait(TRANSFER, || craft.with_vehicle(|vehicle, _| vehicle.fence_sent())) {
        Some(Ok(())) => {}
        Some(Err(error)) => return Err(FencingError::Transfer(error)),
        None => return Err(FencingError::Transfer(FenceError::Silent)),
    }
    match wait(TRANSFER, || craft.with_vehicle(|vehicle, _| vehicle.has_fence(items))) {
        Some(true) => Ok(()),
        Some(false) => Err(FencingError::Different),
        None => Err(FencingError::Unread),
    }
}

/// Sends a fence and puts it in force.
fn replace(craft: &MavlinkCraft, items: &[FenceItem]) -> Result<(), FencingError> {
    send(craft, items)?;
    // A PX4 does not tell whether a fence is in force: one that it has is, by its parameters.
    if craft.facts().autopilot == Autopilot::Px4 {
        return Ok(());
    }
    // Over a bad radio all repetitions of a command may be lost.
    let in_force = (0..TRIES).any(|_| {
        craft.with_vehicle(|vehicle, _| vehicle.enable_fence(true));
        wait(IN_FORCE, || (craft.facts().fenced == Some(true)).then_some(())).is_some()
    });
    if in_force { Ok(()) } else { Err(FencingError::NotInForce) }
}

/// Replaces the fence of a vehicle on the ground. If that fails, its former fence is put back.
pub(super) fn upload(craft: &MavlinkCraft, plan: &FencePlan) -> Result<(), FencingError> {
    let facts = craft.facts();
    if !facts.takes_fence {
        return Err(FencingError::Unsupported);
    }
    if craft.state().1 {
        return Err(FencingError::InTheAir);
    }
    acts(&facts)?;
    let former = facts.fence_items.clone().ok_or(FencingError::Unknown)?;
    let (origin, home) = wait(HOME, || {
        let facts = craft.facts();
        facts.origin.zip(facts.home)
    })
    .ok_or(FencingError::NoHome)?;
    let items = items(&shapes(plan, origin, home));
    if items.len() > usize::from(MOST) {
        return Err(FencingError::TooLarge);
    }
    let Err(error) = replace(craft, &items) else { return Ok(()) };
    let error = Box::new(error);
    if facts.fenced == Some(false) {
        craft.with_vehicle(|vehicle, _| vehicle.enable_fence(false));
    }
    Err(if send(craft, &former).is_ok() { FencingError::PutBack(error) } else { FencingError::Lost(error) })
}

#[cfg(test)]
mod tests {
    use spf_core::time::Time;
    use spf_mavlink::modes::Mode;
    use spf_mavlink::report::Report;

    use super::super::vehicle::Vehicle;
    use super::*;

    #[test]
    fn a_fence_is_sent_only_to_an_autopilot_that_acts_at_it() {
        let acts = |mode: Mode, parameters: &[(&str, f32)]| {
            let mut vehicle = Vehicle::new(Time::ZERO, mode, [1, 191], 3.0, false);
            for (name, field) in parameters {
                vehicle.handle(Time::ZERO, &Report::Parameter { name: (*name).to_owned(), field: *field, kind: 9 });
            }
            acts(vehicle.facts()).is_ok()
        };
        let (px4, copter) = (Autopilot::Px4.hold(), Autopilot::ArduPilot.hold());
        assert_eq!([0.0, 1.0, 2.0, 3.0, 5.0].map(|it| acts(px4, &[("GF_ACTION", it)])), [false, false, true, true, true]);
        assert!(!acts(px4, &[]) && !acts(copter, &[]) && !acts(copter, &[("FENCE_ACTION", 1.0)]));
        assert!(!acts(copter, &[("FENCE_ACTION", 1.0), ("FENCE_TYPE", 3.0)]));
        assert!(!acts(copter, &[("FENCE_ACTION", 0.0), ("FENCE_TYPE", 7.0)]));
        assert!(acts(copter, &[("FENCE_ACTION", 1.0), ("FENCE_TYPE", 4.0)]));
    }

    /// Worked by hand: at 60° north a degree of longitude is half as long as one of latitude.
    #[test]
    fn metres_become_places_on_the_globe() {
        let origin = GlobalPosition { latitude: 60.0, longitude: 10.0, altitude: 0.0 };
        let home = EnuPosition { east: 0.0, north: 111.194_93, up: 0.0 };
        let circle = shapes(&FencePlan::Circle { radius: 50.0 }, origin, home);
        let [FenceShape::Circle { inside: true, centre: [latitude, longitude], radius: 50.0 }] = circle[..] else {
            panic!("{circle:?}")
        };
        assert!(latitude.abs_diff(600_010_000) <= 1 && longitude == 100_000_000, "{latitude} {longitude}");
        let plan =
            FencePlan::Polygon { outer: vec![(0.0, 0.0), (55.597_46, 0.0), (0.0, 50.0)], holes: vec![vec![(1.0, 1.0); 3]] };
        let shapes = shapes(&plan, origin, home);
        let FenceShape::Polygon { inside: true, corners } = &shapes[0] else { panic!("{shapes:?}") };
        assert!(corners[1][1].abs_diff(100_010_000) <= 1 && corners[1][0] == 600_000_000, "{corners:?}");
        assert!(matches!(&shapes[1], FenceShape::Polygon { inside: false, corners } if corners.len() == 3));
    }
}
