//! Whether a part of a window can be seen, from where the windows and the monitors are.

use crate::Hidden;
use crate::area::{Area, Region};
use crate::choosing::{ALLOWED, LEAST};

/// The monitor on which a part of a window is, by its place in the list, and where that part is; or why it cannot be seen.
///
/// `above`: titles and places of the windows above it. A picture is taken of one monitor, so that a window on two counts as beside it.
pub(crate) fn seen(window: &Area, region: &Region, above: &[(String, Area)], monitors: &[Area]) -> Result<(usize, Area), Hidden> {
    let area = window.part(region);
    if area.width < LEAST || area.height < LEAST {
        return Err(Hidden::Tiny { width: area.width, height: area.height });
    }
    let on = |monitor: &Area| area.common(monitor).pixels();
    let (place, monitor) = monitors.iter().enumerate().max_by_key(|(_, monitor)| on(monitor)).ok_or(Hidden::OffScreen)?;
    let allowed = ALLOWED * area.pixels() as f64;
    if (area.pixels() - on(monitor)) as f64 > allowed {
        return Err(Hidden::OffScreen);
    }
    let covered: u64 = above.iter().map(|(_, other)| area.common(other).pixels()).sum();
    if covered as f64 > allowed {
        let by = above.iter().max_by_key(|(_, other)| area.common(other).pixels());
        let name = by.map(|(title, _)| title.as_str()).filter(|title| !title.is_empty());
        return Err(Hidden::Covered(name.map_or_else(|| "another window".to_owned(), |name| format!("`{name}`"))));
    }
    Ok((place, area.common(monitor)))
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use proptest::prelude::*;

    use super::*;

    fn area(x: i32, y: i32, width: u32, height: u32) -> Area {
        Area { x, y, width, height }
    }

    #[test]
    fn hand_worked_windows() {
        let monitors = [area(0, 0, 1000, 800), area(1000, 0, 500, 800)];
        let chat = ("Chat".to_owned(), area(700, 0, 100, 100));
        let see = |window: Area, above: &[(String, Area)]| seen(&window, &Region::WHOLE, above, &monitors);
        assert_eq!(see(area(100, 100, 600, 400), from_ref(&chat)), Ok((0, area(100, 100, 600, 400))));
        assert_eq!(see(area(1100, 0, 300, 300), &[]), Ok((1, area(1100, 0, 300, 300))));
        // One column of pixels beside the monitor, of 600.
        assert_eq!(see(area(-1, 100, 600, 400), &[]), Ok((0, area(0, 100, 599, 400))));
        for (window, why) in [
            (area(900, 100, 200, 200), Hidden::OffScreen),
            (area(650, 50, 200, 200), Hidden::Covered("`Chat`".to_owned())),
            (area(0, 0, 60, 200), Hidden::Tiny { width: 60, height: 200 }),
        ] {
            assert_eq!(see(window, from_ref(&chat)), Err(why));
        }
        // What is covered is not in the region.
        let region = Region([0.5, 0.5, 0.5, 0.5]);
        assert!(seen(&area(650, 50, 200, 200), &region, &[chat], &monitors).is_ok());
        assert_eq!(seen(&area(0, 0, 100, 100), &Region::WHOLE, &[], &[]), Err(Hidden::OffScreen));
    }

    proptest! {
        #[test]
        fn what_is_seen_lies_on_its_monitor(
            x in -3000_i32..3000, y in -3000_i32..3000, width in 0_u32..4000, height in 0_u32..4000,
            place in (any::<i32>(), any::<i32>(), any::<u32>(), any::<u32>())
        ) {
            let monitors = [area(0, 0, 1920, 1080), area(-1000, 200, 1000, 700)];
            let above = [(String::new(), area(place.0, place.1, place.2, place.3))];
            if let Ok((monitor, seen)) = seen(&area(x, y, width, height), &Region::WHOLE, &above, &monitors) {
                prop_assert_eq!(seen.common(&monitors[monitor]), seen);
                prop_assert!(seen.width >= 32 && seen.height >= 32);
            }
        }
    }
}
