//! Replacing the autopilot's fence before a flight: sent, read back, compared, and in force.

use std::time::{Duration, Instant};

use spf_core::geometry::EnuPosition;
use spf_mavlink::fence::{FenceError, FenceShape, MOST, items};
use spf_mavlink::frames::GlobalPosition;

use super::craft::MavlinkCraft;
use super::fence_error::FencingError;
use super::settings::FencePlan;

/// Maximum time for the transfer in one direction: each of its steps is repeated five times.
const TRANSFER: Duration = Duration::from_secs(60);
/// Maximum time for the vehicle to know its home.
const HOME: Duration = Duration::from_secs(5);
/// Maximum time for the fence to show in the vehicle's state.
const IN_FORCE: Duration = Duration::from_secs(5);
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

/// Replaces the fence of a vehicle on the ground.
pub(super) fn upload(craft: &MavlinkCraft, plan: &FencePlan) -> Result<(), FencingError> {
    let facts = craft.facts();
    if !facts.takes_fence {
        return Err(FencingError::Unsupported);
    }
    if craft.state().1 {
        return Err(FencingError::InTheAir);
    }
    let (origin, home) = wait(HOME, || {
        let facts = craft.facts();
        facts.origin.zip(facts.home)
    })
    .ok_or(FencingError::NoHome)?;
    let items = items(&shapes(plan, origin, home));
    if items.len() > usize::from(MOST) {
        return Err(FencingError::TooLarge);
    }
    craft.with_vehicle(|vehicle, now| vehicle.send_fence(now, items.clone()));
    match wait(TRANSFER, || craft.with_vehicle(|vehicle, _| vehicle.fence_sent())) {
        Some(Ok(())) => {}
        Some(Err(error)) => return Err(FencingError::Transfer(error)),
        None => return Err(FencingError::Transfer(FenceError::Silent)),
    }
    match wait(TRANSFER, || craft.with_vehicle(|vehicle, _| vehicle.has_fence(&items))) {
        Some(true) => {}
        Some(false) => return Err(FencingError::Different),
        None => return Err(FencingError::Unread),
    }
    craft.with_vehicle(|vehicle, _| vehicle.enable_fence());
    wait(IN_FORCE, || (craft.facts().fenced == Some(true)).then_some(())).ok_or(FencingError::NotInForce)
}

#[cfg(test)]
mod tests {
    use super::*;

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
