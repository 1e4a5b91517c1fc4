//! The tracker on rendered clips: flights through scenes of the simulator, with the truth from the id images.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test that cannot go on fails; the figures are printed")]

use std::collections::BTreeMap;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_follow::track::{Quality, Tracker};
use spf_media::Rgb;
use spf_media::track::{PixelBox, Shift, TrackImage};
use spf_render::{Channels, Renderer};
use spf_scene::{Aabb, Scene};

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
    /// Of the good images of people: how far the scale is off, as a logarithm.
    scale_errors: Vec<f64>,
}

/// A flight past a person: from `range` metres away, on the bearing `side`, ten images a second. The craft flies sideways, to and
/// fro, and nearer, and keeps the person in view; so the background moves otherwise than they do.
fn past(person: &Aabb, range: f64, side: f64, image: u32) -> Pose {
    let middle = person.min.towards(person.max, 0.5);
    let time = 0.1 * f64::from(image);
    let bearing = side + 0.25 * libm::sin(0.5 * time);
    let range = range * (1.0 - 0.25 * libm::sin(0.4 * time));
    let [east, north] = [middle.east + range * libm::sin(bearing), middle.north + range * libm::cos(bearing)];
    let position = EnuPosition { east, north, up: person.min.up + 1.3 };
    let heading = bearing + core::f64::consts::PI + 0.12 * libm::sin(1.3 * time);
    Pose { position, attitude: Attitude { heading, ..Attitude::default() } }
}

/// Follows the people of a scene, by the middle of their boxes.
fn people(scene: &Scene, renderer: &Renderer, images: u32, tally: &mut Tally) {
    let camera = camera();
    let channels = Channels { ids: true, ..Channels::RGB };
    let persons = scene.objects.iter().filter(|object| object.tags.names.iter().any(|name| name == "person"));
    for (person, range, side) in persons
        .flat_map(|person| [2.0, 3.5, 6.0].map(|range| (person, range)))
        .flat_map(|(person, range)| [0.0, 1.6, 3.1, 4.7].map(|side| (person, range, side)))
    {
        let mut tracker: Option<Tracker> = None;
        let (mut good, mut wrong, mut last) = (0, 0, "");
        for image in 0..images {
            let pose = past(&person.bounds, range, side, image);
            let rendered = renderer.render(&camera, &pose, channels);
            let truth = boxes(&rendered.ids.unwrap(), 480).get(&person.id).copied();
            let image_of = |rgb: Vec<u8>| {
                if std::env::var_os("GREY").is_some() {
                    let grey = rgb
                        .chunks_exact(3)
                        .map(|p| ((77 * u32::from(p[0]) + 150 * u32::from(p[1]) + 29 * u32::from(p[2]) + 128) >> 8) as u8);
                    return TrackImage::from_grey(480, 360, grey.collect()).unwrap();
                }
                TrackImage::of(&Rgb::from_raw(480, 360, rgb).unwrap())
            };
            let shown = image_of(rendered.rgb.unwrap());
            let Some(tracker) = &mut tracker else {
                let Some((area, pixels)) = truth else { break };
                // Standing free in view.
                if pixels < 0.3 * area.width() * area.height()
                    || area.height() < 0.3 * 360.0 / range
                    || area.left < 4.0
                    || area.right > 476.0
                {
                    break;
                }
                let begun = Tracker::start_in_middle(&shown, area);
                tally.targets += 1;
                tally.refused += u32::from(begun.track().quality != Quality::Good);
                tracker = Some(begun);
                continue;
            };
            let before = past(&person.bounds, range, side, image - 1).attitude.heading;
            let turned = pose.attitude.heading - before;
            let track = tracker.next(&shown, Some(Shift { x: -camera.fx * turned, y: 0.0 }));
            let on = truth.is_some_and(|(area, _)| area.overlap(&track.area) >= 0.5);
            let is_good = track.quality == Quality::Good;
            tally.images += 1;
            tally.good += u32::from(is_good);
            tally.false_good += u32::from(is_good && !on);
            if is_good {
                let distance = |image| {
                    past(&person.bounds, range, side, image)
                        .position
                        .horizontal_distance(person.bounds.min.towards(person.bounds.max, 0.5))
                };
                tally.scale_errors.push(libm::log(track.scale * distance(image) / distance(0)).abs());
            }
            good += u32::from(is_good);
            wrong += u32::from(is_good && !on);
            last = track.quality.word();
            if image + 1 == images && truth.is_some() {
                tally.in_view += 1;
                tally.bridged += u32::from(is_good && on);
            }
        }
        if std::env::var_os("EACH").is_some() && tracker.is_some() {
            println!("  {} {range} m {side}: good {good} of {}, wrong {wrong}, at the end {last}", person.key, images - 1);
        }
    }
}

/// Follows every object that is well in view at the start of a flight.
fn flight(renderer: &Renderer, start: [f64; 4], images: u32, tally: &mut Tally) {
    let camera = camera();
    let channels = Channels { ids: true, ..Channels::RGB };
    let mut tracked: Vec<(u16, Tracker)> = Vec::new();
    for image in 0..images {
        let rendered = renderer.render(&camera, &pose(start, image), channels);
        let truth = boxes(&rendered.ids.unwrap(), 480);
        let shown = TrackImage::of(&Rgb::from_raw(480, 360, rendered.rgb.unwrap()).unwrap());
        if image == 0 {
            for (id, (area, pixels)) in &truth {
                let inside = area.left > 4.0 && area.top > 4.0 && area.right < 476.0 && area.bottom < 356.0;
                if inside && area.side() >= 24.0 && area.width() < 200.0 && *pixels > 0.4 * area.width() * area.height() {
                    let tracker = Tracker::start(&shown, *area);
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
            let track = tracker.next(&shown, Some(Shift { x: -camera.fx * turned, y: 0.0 }));
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

/// Figures: `cargo test -p spf-flight --test it -- --ignored rendered_track::figures --nocapture`. No rendered clip was used to choose the
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

/// The same for people, who are near and plainly dressed:
/// `SCENES="office yard park city" IMAGES=80 cargo test -p spf-flight --test it -- --ignored rendered_track::people --nocapture`; with
/// `GREY=1` without their colours, with `EACH=1` person by person.
#[test]
#[ignore = "prints figures; takes a minute"]
fn people_are_followed() {
    let scenes = std::env::var("SCENES").unwrap_or_else(|_| "yard".to_owned());
    let images = std::env::var("IMAGES").map_or(24, |images| images.parse().unwrap());
    for name in scenes.split(' ') {
        let scene = Scene::load(name).unwrap();
        let renderer = Renderer::new(&scene.geometry);
        let mut tally = Tally::default();
        people(&scene, &renderer, images, &mut tally);
        let share = |part: u32, of: u32| 100.0 * f64::from(part) / f64::from(of.max(1));
        tally.scale_errors.sort_by(f64::total_cmp);
        let count = tally.scale_errors.len() as f64;
        let quantile = |part: f64| tally.scale_errors.get((part * count) as usize).copied().unwrap_or(0.0);
        println!("{name}: scale off by {:.3} (half), {:.3} (one in ten)", quantile(0.5), quantile(0.9));
        let (good, off) = (share(tally.good, tally.images), share(tally.false_good, tally.good));
        println!(
            "{name}: {} targets, {} refused; good in {good:.0} % of {} images, of these {off:.1} % off",
            tally.targets, tally.refused, tally.images
        );
        let bridged = share(tally.bridged, tally.in_view);
        println!("{name}: {bridged:.0} % of {} on the target at the end", tally.in_view);
        assert!(tally.targets > 10 && good > 75.0 && off < 10.0 && bridged > 70.0, "{name}: {tally:?}");
    }
}
