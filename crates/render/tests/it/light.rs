//! Light and weather in images: lamps, night, rooms, contact shadows, and the light reported to the oracle.

use glam::Vec3;
use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_render::{Channels, Renderer};
use spf_scene::geometry::{Lamp, Light, Role};
use spf_scene::{Lighting, Scene, SceneLook, Weather};

use crate::yard;

const SIDE: u32 = 96;

/// No light but that of lamps.
fn dark(lamps: Vec<Lamp>) -> Light {
    let none = Vec3::ZERO;
    let light = Light { sun: none, sky_ambient: none, ground_ambient: none, zenith: none, horizon: none, ..Light::default() };
    Light { exposure: Some(1.0), haze: 0.0, clouds: 0.0, lamps, ..light }
}

/// Looking straight down from 20 m above the origin: a pixel is 0.417 m.
fn down(scene: &yard::Yard) -> Vec<u8> {
    let attitude = Attitude { pitch: -core::f64::consts::FRAC_PI_2, ..Attitude::default() };
    let pose = Pose { position: EnuPosition { up: 20.0, ..EnuPosition::default() }, attitude };
    let camera =
        Camera { tilt: 0.0, ..Camera::from_fov(SIDE, SIDE, core::f64::consts::FRAC_PI_2, core::f64::consts::FRAC_PI_2, 0.0) };
    Renderer::new(&scene.geometry).render(&camera, &pose, Channels::RGB).rgb.expect("colour was asked for")
}

/// Sum of red, green and blue of the ground at this many metres east and north of the origin.
fn ground(rgb: &[u8], east: f32, north: f32) -> u32 {
    let pixel = |metres: f32| ((metres / 40.0 + 0.5) * SIDE as f32) as usize;
    let at = (pixel(-north) * SIDE as usize + pixel(east)) * 3;
    rgb[at..at + 3].iter().map(|&byte| u32::from(byte)).sum()
}

fn lamp(east: f32, north: f32, up: f32) -> Lamp {
    Lamp { position: Vec3::new(east, north, up), colour: Vec3::splat(20.0), reach: 14.0 }
}

#[test]
fn lamp_light_falls_with_distance_and_ends_at_its_reach() {
    let mut scene = yard::empty();
    scene.geometry.light = dark(vec![lamp(-6.0, 0.0, 4.0)]);
    let rgb = down(&scene);
    let along: Vec<u32> = [-6.0, -3.0, 0.0, 4.0].iter().map(|&east| ground(&rgb, east, 0.0)).collect();
    assert!(along.windows(2).all(|pair| pair[0] > pair[1] + 10), "{along:?}");
    assert_eq!(ground(&rgb, 12.0, 0.0), 0, "beyond the reach there is no light");
    assert_eq!(rgb, down(&scene), "the same light gives the same bits");
}

#[test]
fn a_wall_stops_lamp_light_and_gives_some_back() {
    let mut scene = yard::empty();
    scene.geometry.light = dark(vec![lamp(-3.0, 0.0, 2.0)]);
    let open = down(&scene);
    scene.add_box(Vec3::new(0.0, -20.0, 0.0), Vec3::new(0.3, 20.0, 6.0), 1, 9, Role::Solid);
    let walled = down(&scene);
    let (before, behind) = (ground(&open, 3.0, 0.0), ground(&walled, 3.0, 0.0));
    assert!(before > 40 && behind * 5 < before, "before {before}, behind {behind}");
    assert!(ground(&walled, -2.0, 0.0) >= ground(&open, -2.0, 0.0), "the wall gives light back");
}

#[test]
fn a_corner_of_a_room_is_darker_than_under_its_lamp_but_not_black() {
    let mut scene = yard::empty();
    // A room of 12 m by 12 m by 3 m without a window, a wall across most of it, its ceiling invisible from above.
    for (low, high) in [
        ((-6.2, -6.0), (-6.0, 6.0)),
        ((6.0, -6.0), (6.2, 6.0)),
        ((-6.2, -6.2), (6.2, -6.0)),
        ((-6.2, 6.0), (6.2, 6.2)),
        ((1.0, -6.0), (1.2, 4.0)),
    ] {
        scene.add_box(Vec3::new(low.0, low.1, 0.0), Vec3::new(high.0, high.1, 3.0), 1, 9, Role::Solid);
    }
    scene.geometry.light = dark(vec![lamp(-3.0, 0.0, 2.8)]);
    let rgb = down(&scene);
    let (under, corner, outside) = (ground(&rgb, -3.0, 0.0), ground(&rgb, 5.0, -4.0), ground(&rgb, 9.0, -4.0));
    assert!(under > 3 * corner, "under {under}, corner {corner}");
    assert_eq!(outside, 0, "walls keep light in");
}

#[test]
fn what_stands_on_the_ground_darkens_it_without_sun() {
    let mut scene = yard::empty();
    scene.geometry.light = Light { sky_ambient: Vec3::ONE, ground_ambient: Vec3::ONE, ..dark(Vec::new()) };
    let empty = down(&scene);
    // Too low to hide any of the sky from the coarse grid.
    scene.add_box(Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.3), 1, 9, Role::Solid);
    let standing = down(&scene);
    let (before, beside) = (ground(&empty, 1.4, 0.0), ground(&standing, 1.4, 0.0));
    assert!(beside + 10 < before, "before {before}, beside {beside}");
    assert_eq!(ground(&empty, 8.0, 0.0), ground(&standing, 8.0, 0.0), "far off nothing changes");
}

fn seen(lighting: Lighting, weather: Weather, pose: &Pose) -> (Scene, Vec<u8>) {
    let conditions = SceneLook { lighting: Some(lighting), weather: Some(weather) };
    let scene = Scene::load_with("city", &conditions).expect("the city is part of the program");
    let camera = Camera::quad().resized(320, 240);
    let rgb = Renderer::new(&scene.geometry).render(&camera, pose, Channels::RGB).rgb.expect("colour was asked for");
    (scene, rgb)
}

fn avenue() -> Pose {
    Pose { position: EnuPosition { up: 3.0, ..EnuPosition::default() }, ..Pose::default() }
}

#[test]
fn night_is_darker_than_dusk_and_dusk_than_day_but_for_windows() {
    let images = [Lighting::Day, Lighting::Dusk, Lighting::Night].map(|light| seen(light, Weather::Clear, &avenue()).1);
    let mean = |rgb: &[u8]| rgb.iter().map(|&byte| f64::from(byte)).sum::<f64>() / rgb.len() as f64;
    let [day, dusk, night] = [0, 1, 2].map(|i| mean(&images[i]));
    assert!(day > dusk + 20.0 && dusk > night + 20.0, "{day} {dusk} {night}");
    let bright = |rgb: &[u8]| rgb.chunks_exact(3).filter(|p| p[0] > 200).count();
    assert!(bright(&images[2]) > 100, "windows and lamps shine at night");
    // The lamp beside the avenue, 25 m ahead on the right, lights the foot of its post more than the dark surroundings.
    let row = |rgb: &[u8], y: usize, x: usize| u32::from(rgb[(y * 320 + x) * 3]);
    assert!(row(&images[2], 150, 200) > 2 * row(&images[2], 235, 10));
}

#[test]
fn rain_hides_what_is_far() {
    let contrast = |rgb: &[u8]| {
        // The skyline: the upper middle of the image.
        let part: Vec<f64> =
            (60..100).flat_map(|y| (40..280).map(move |x| (y * 320 + x) * 3)).map(|i| f64::from(rgb[i])).collect();
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        (part.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / part.len() as f64).sqrt()
    };
    let [clear, haze, rain] =
        [Weather::Clear, Weather::Haze, Weather::Rain].map(|w| contrast(&seen(Lighting::Day, w, &avenue()).1));
    assert!(rain < 0.7 * clear && haze < clear, "{clear} {haze} {rain}");
}

#[test]
fn by_day_everything_in_the_city_is_clear_and_by_night_the_park_is_dark() {
    let light = |lighting: Lighting, pose: &Pose| {
        let (scene, _) = seen(lighting, Weather::Clear, pose);
        let renderer = Renderer::new(&scene.geometry);
        let image = renderer.render(&Camera::quad(), pose, Channels::TRUTH);
        let light = renderer.light_on(&Camera::quad(), pose, &image);
        assert_eq!(light, renderer.light_on(&Camera::quad(), pose, &image));
        (scene, light)
    };
    let park = Pose {
        position: EnuPosition { east: -28.0, north: 4.0, up: 9.0 },
        attitude: Attitude { heading: 5.55, ..Attitude::default() },
    };
    for pose in [avenue(), park] {
        assert!(light(Lighting::Day, &pose).1.values().all(|&l| l == 1.0));
    }
    let (scene, night) = light(Lighting::Night, &park);
    let of = |key: &str| night[&scene.by_key(key).expect(key).id];
    assert!(of("playground_slide") < 0.8, "{}", of("playground_slide"));
    let (scene, night) = light(Lighting::Night, &avenue());
    let taxi = night[&scene.by_key("taxi").map_or(0, |o| o.id)];
    assert!(taxi > 0.99, "{taxi}");
}

#[test]
fn a_person_in_the_dark_shed_has_little_light_by_day() {
    let scene = Scene::load("yard").expect("it is part of the program");
    let person = scene.by_key("person_in_the_dark").expect("the yard has one");
    let renderer = Renderer::new(&scene.geometry);
    // From the start of a flight, turned to the shed.
    let mut eye = scene.start;
    (eye.position.up, eye.attitude.heading) = (0.8, 45.0_f64.to_radians());
    let image = renderer.render(&Camera::quad(), &eye, Channels::TRUTH);
    let light = renderer.light_on(&Camera::quad(), &eye, &image);
    let sunlit = light.values().filter(|&&l| l == 1.0).count();
    assert!(light[&person.id] < 0.7 && sunlit > 3, "{}, {sunlit} in full light", light[&person.id]);
}
