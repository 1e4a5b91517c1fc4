//! The tracker on rendered clips: flights through scenes of the simulator, with the truth from the id images.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test that cannot go on fails; the figures are printed")]

use std::collections::BTreeMap;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_media::Rgb;
use spf_media::track::{Grey, PixelBox, Quality, Shift, Tracker};
use spf_render::{Channels, Renderer};
use spf_scene::Scene;

use crate::streets::STREETS;

fn camera() -> Camera {
    Camera::from_fov(480, 360, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 5.0_f64.to_radians())
}

/// The pose at an image of a flight: ten a second, 1.5 m/s forward, the nose swinging by 8°.
fn pose([east, north, up, heading_deg]: [f64; 4], image: u32) -> Pose {
    let (along, course) = (0.15 * f64::from(image), heading_deg.to_radians());
    let heading = course + 8.0_f64.to_radians() * libm::sin(f64::from(image) * 0.12);
    let position = EnuPosition { east: east + along * libm::sin(course), north: north + along * libm::cos(course), up };
    Pose { position, attitude: Attitude { heading, ..Attitude::default() } }
}

/// The boxes of the objects in an id image, and their numbers of pixels.
fn boxes(ids: &[u16], width: usize) -> BTreeMap<u16, (PixelBox, f64)> {
    let mut boxes: BTreeMap<u16, (PixelBox, f64)> = BTreeMap::new();
    for (at, id) in ids.iter().enumerate().filter(|(_, id)| **id != 0) {
        let (x, y) = ((at % width) as f64, (at / width) as f64);
        let (area, pixels) = boxes.entry(*id).or_insert((PixelBox { left: x, top: y, right: x + 1.0, bottom: y + 1.0 }, 0.0));
        area.left = area.left.min(x);
        area.top = area.top.min(y);
        area.right = area.right.max(x + 1.0);
        area.bottom = area.bottom.max(y + 1.0);
        *pixels += 1.0;
    }
    boxes
}

#[derive(Debug, Default)]
struct Tally {
    targets: u32,
    refused: u32,
    /// Targets that are in view at the end, and of these those with a good box on the target.
    in_view: u32,
    bridged: u32,
    images: u32,
    good: u32,
    false_good: u32,
}

/// Follows every object that is well in view at the start of a flight.
fn flight(renderer: &Renderer, start: [f64; 4], images: u32, tally: &mut Tally) {
    let camera = camera();
    let channels = Channels { ids: true, ..Channels::RGB };
    let mut tracked: Vec<(u16, Tracker)> = Vec::new();
    for image in 0..images {
        let rendered = renderer.render(&camera, &pose(start, image), channels);
        let truth = boxes(&rendered.ids.unwrap(), 480);
        let grey = Grey::of(&Rgb::from_raw(480, 360, rendered.rgb.unwrap()).unwrap());
        if image == 0 {
            for (id, (area, pixels)) in &truth {
                let inside = area.left > 4.0 && area.top > 4.0 && area.right < 476.0 && area.bottom < 356.0;
                if inside && area.side() >= 24.0 && area.width() < 200.0 && *pixels > 0.4 * area.width() * area.height() {
                    let tracker = Tracker::start(&grey, *area);
                    tally.targets += 1;
                    if tracker.track().quality == Quality::Good {
                        tracked.push((*id, tracker));
                    } else {
                        tally.refused += 1;
                    }
                }
            }
            continue;
        }
        let turned = pose(start, image).attitude.heading - pose(start, image - 1).attitude.heading;
        for (id, tracker) in &mut tracked {
            let track = tracker.next(&grey, Some(Shift { x: -camera.fx * turned, y: 0.0 }));
            // A target that is partly hidden has a smaller box than the track: strict on the tracker.
            let on = truth.get(id).is_some_and(|(area, _)| area.overlap(&track.area) >= 0.5);
            let good = track.quality == Quality::Good;
            tally.images += 1;
            tally.good += u32::from(good);
            tally.false_good += u32::from(good && !on);
            if std::env::var_os("EACH").is_some() && good && !on {
                println!("  {start:?} object {id} image {image}: {:?} {:?}", track.area, truth.get(id));
            }
            if image + 1 == images {
                let seen = truth.get(id).is_some_and(|(area, pixels)| {
                    *pixels > 0.3 * area.width() * area.height()
                        && area.left > 1.0
                        && area.right < 479.0
                        && area.top > 1.0
                        && area.bottom < 359.0
                });
                tally.in_view += u32::from(seen);
                tally.bridged += u32::from(seen && good && on);
            }
        }
    }
}

#[test]
fn objects_of_the_city_are_followed() {
    let renderer = Renderer::new(&Scene::load("city").unwrap().geometry);
    let mut tally = Tally::default();
    flight(&renderer, STREETS[0], 12, &mut tally);
    assert!(tally.targets > tally.refused && tally.good > tally.images / 2, "{tally:?}");
    assert!(tally.false_good * 20 <= tally.images, "{tally:?}");
}

/// Figures: `cargo test -p spf-render --test it -- --ignored track::figures --nocapture`. No rendered clip was used to choose the
/// tracker's thresholds.
#[test]
#[ignore = "prints figures; takes minutes"]
fn figures() {
    let renderer = Renderer::new(&Scene::load("city").unwrap().geometry);
    let mut tally = Tally::default();
    for start in STREETS {
        for turn in [0.0, 90.0, 180.0, 270.0] {
            flight(&renderer, [start[0], start[1], start[2], start[3] + turn], 80, &mut tally);
        }
    }
    println!("{tally:#?}");
    let share = |part: u32, of: u32| 100.0 * f64::from(part) / f64::from(of.max(1));
    println!("false good: {:.2} % of {} images", share(tally.false_good, tally.images), tally.images);
    println!("bridged: {:.0} % of {} targets in view at the end", share(tally.bridged, tally.in_view), tally.in_view);
}
