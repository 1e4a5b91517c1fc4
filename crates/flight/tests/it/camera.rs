//! Flying with images distorted by a lens: the craft flies to the point shown. Also through wind, and on a weak
//! battery.

use std::sync::{Arc, OnceLock};

use spf_core::camera::{Camera, Distortion};
use spf_core::craft::CraftKind;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::lift::{Lifting, lift, unproject};
use spf_core::query::ImagePoint;
use spf_core::time::Time;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::sim::{FlightConditions, LoadedScene, SimWorld, Simulated, oracle_factory};
use spf_flight::summary::Summary;
use spf_oracle::ErrorFile;
use spf_pilot::Outcome;
use spf_render::Channels;
use spf_render::effects::Effects;

/// A strong barrel distortion: 13 % at the corners of the quad's image.
const BARREL: &str = "lens=-0.09:0.005:0.001:-0.002";

fn city() -> Arc<LoadedScene> {
    static CITY: OnceLock<Arc<LoadedScene>> = OnceLock::new();
    CITY.get_or_init(|| Arc::new(LoadedScene::load("city").unwrap())).clone()
}

fn world(effects: &str, kind: CraftKind) -> SimWorld {
    let flight_conditions = FlightConditions { effects: effects.parse().unwrap(), ..FlightConditions::default() };
    let loaded = city();
    SimWorld::under(&flight_conditions, loaded.clone(), kind, loaded.scene.start, 1)
}

/// Distance between the lifted positions of image pixels and the surface of the object that they show, in pixels at
/// their depth: the worst and the mean. `by` is the camera used for lifting.
fn misses(world: &SimWorld, by: &Camera) -> (f64, f64) {
    let position = EnuPosition { east: 2.0, north: -4.0, up: 6.0 };
    let pose = Pose { position, attitude: Attitude { heading: 0.4, pitch: -0.05, roll: 0.03 } };
    let moment = world.loaded().initial_snapshot(pose);
    let image = world.look(&moment, Channels { ids: true, depth: true, ..Channels::default() });
    let (ids, depth) = (image.ids.unwrap(), image.depth.unwrap());
    let (w, h) = (image.width as usize, image.height as usize);
    let mut misses = Vec::new();
    for (x, y) in (7..h - 2).step_by(24).flat_map(|y| (5..w - 2).step_by(24).map(move |x| (x, y))) {
        let at = y * w + x;
        // Well inside one object: an edge may be off by a pixel.
        let inside = [at - 2, at + 2, at - 2 * w, at + 2 * w].iter().all(|&beside| ids[beside] == ids[at]);
        if ids[at] == 0 || !inside {
            continue;
        }
        let point = ImagePoint { u: (x as f64 + 0.5) / w as f64, v: (y as f64 + 0.5) / h as f64 };
        let seen = unproject(by, point, f64::from(depth[at])).unwrap();
        let place = position.displaced(lift(seen, by, pose.attitude, Lifting::Levelled), pose.attitude.heading);
        // Moving objects are not part of the collider.
        let Some(miss) = world.loaded().collider.distance_to(ids[at], place) else { continue };
        misses.push(miss * by.fx / f64::from(depth[at]));
    }
    assert!(misses.len() > 300, "{}", misses.len());
    (misses.iter().copied().fold(0.0, f64::max), misses.iter().sum::<f64>() / misses.len() as f64)
}

#[test]
fn what_is_pointed_at_is_what_is_lifted_to() {
    for (effects, kind) in [(BARREL, CraftKind::Quad), ("lens=wide", CraftKind::Quad), ("lens=tello_ros2", CraftKind::Tello)] {
        let world = world(effects, kind);
        let (worst, mean) = misses(&world, world.camera());
        // The nearest pixel of the undistorted image is at most half a pixel away, and an oblique surface is hit
        // elsewhere.
        assert!(worst < 3.0 && mean < 0.4, "{effects}: {worst} {mean}");
    }
    // With a camera model without the lens, the same pixels miss.
    let world = world(BARREL, CraftKind::Quad);
    let blind = Camera { distortion: Distortion::default(), ..*world.camera() };
    let (worst, mean) = misses(&world, &blind);
    assert!(worst > 20.0 && mean > 1.5, "{worst} {mean}");
}

fn flown(flight_conditions: FlightConditions, kind: CraftKind, seed: u64) -> Summary {
    let site = Simulated { kind, flight_conditions, seed, ..Simulated::new(city(), "city") };
    let vlm_factory = oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap());
    let plan = FlightPlan::new(Site::Simulated(site), "fly to the red crane", "oracle:perfect", vlm_factory);
    fly(plan, &mut []).unwrap().summary
}

#[test]
fn a_flight_through_a_lens_arrives() {
    let effects: Effects = format!("{BARREL},blur,noise").parse().unwrap();
    let summary = flown(FlightConditions { effects, ..FlightConditions::default() }, CraftKind::Quad, 2);
    assert_eq!((summary.outcome, summary.verified), (Outcome::Reached, Some(true)), "{summary:?}");
    assert_eq!(summary.camera_effects.as_deref(), Some("lens=-0.09:0.005:0.001:-0.002,blur=10,noise=3"));
}

#[test]
fn a_flight_in_gusts_arrives_on_another_way() {
    let still = flown(FlightConditions::default(), CraftKind::Quad, 2);
    let wind = "4,from=300,gust=1.5".parse().unwrap();
    let gusty = flown(FlightConditions { wind, ..FlightConditions::default() }, CraftKind::Quad, 2);
    assert_eq!((gusty.outcome, gusty.verified), (Outcome::Reached, Some(true)), "{gusty:?}");
    assert_eq!((still.wind, gusty.wind.as_deref()), (None, Some("4,from=300,gust=1.5")));
    assert!((gusty.path_length_m - still.path_length_m).abs() > 0.01);
}

#[test]
fn a_low_tello_battery_ends_the_flight() {
    // 0.13 % a second: from 0.21 to the envelope's 0.15 in 46 s.
    let summary = flown(FlightConditions { battery: 0.21, ..FlightConditions::default() }, CraftKind::Tello, 1);
    assert_eq!(summary.outcome, Outcome::Aborted, "{summary:?}");
    assert!(summary.cause.contains("battery"), "{}", summary.cause);
    assert!((40.0..70.0).contains(&summary.finished_at_s), "{}", summary.finished_at_s);
}

#[test]
fn images_without_effects_are_those_of_the_renderer() {
    let world = world("none", CraftKind::Quad);
    let shot = world.shot(Time::ZERO).unwrap();
    let moment = world.snapshot_at(Time::ZERO).unwrap();
    let drawn = world.loaded().render(world.camera(), &moment, Channels::ALL);
    assert_eq!(Some(world.photograph(&shot, None).data()), drawn.rgb.as_deref());
    assert_eq!(world.look(&moment, Channels::ALL), drawn);
}
