//! Images of the simulator's cameras never count as a covered lens, in any light. `IMAGES=100`, with `--ignored`, measures more
//! images, and prints the smallest figures.

use crate::wired::CAMERA_FAULTS;
use spf_core::camera::Camera;
use spf_core::frame::Unusable;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::rng::RandomStream;
use spf_core::time::Time;
use spf_drone::frames::usable::{statistics, why_unusable};
use spf_flight::sim::LoadedScene;
use spf_media::Rgb;
use spf_media::h264::{Decoder, Encoder, EncoderSettings};
use spf_render::{Channels, Quality};
use spf_scene::{Lighting, SceneLook};
use spf_serve::fault::{CraftFaultRule, FaultMachine, FaultPlan};
use spf_serve::tello::lens::disturb;

/// A free place in the scene: at least this far from every surface, metres.
const CLEAR: f64 = 0.4;

fn somewhere(loaded: &LoadedScene, rng: &mut RandomStream) -> Pose {
    let (min, max) = (loaded.scene.bounds.min, loaded.scene.bounds.max);
    loop {
        let between = |from: f64, to: f64, rng: &mut RandomStream| from + (to - from) * rng.uniform();
        let position = EnuPosition {
            east: between(min.east, max.east, rng),
            north: between(min.north, max.north, rng),
            up: between(0.5, 3.0, rng),
        };
        let heading = between(-3.1, 3.1, rng);
        if loaded.collider.nearest(position).is_none_or(|nearest| nearest.distance >= CLEAR)
            && loaded.collider.ground_below(position).is_some()
        {
            return Pose { position, attitude: Attitude { heading, ..Attitude::default() } };
        }
    }
}

/// As in the virtual Tello's video.
fn through_the_codec(image: &Rgb) -> Rgb {
    let settings = EncoderSettings { quantiser: 30, ..EncoderSettings::for_size(image.width(), image.height(), 30.0) };
    let unit = Encoder::new(settings).unwrap().encode(Time::ZERO, image).unwrap();
    Decoder::new().unwrap().decode(&unit.annex_b).unwrap().unwrap()
}

/// Whether it shows nothing: a wall, a piece of sky, or a hedge at night that fills the image, with all but one in a
/// hundred pixels within eight of 255 levels.
fn is_empty(image: &Rgb) -> bool {
    let mut levels: Vec<u8> = image.data().chunks_exact(3).map(|pixel| pixel[1]).collect();
    levels.sort_unstable();
    let at = |percent: usize| levels[percent * (levels.len() - 1) / 100];
    at(99) - at(1) < 8
}

#[test]
fn no_image_at_the_start_of_a_room_or_yard_is_unusable_in_any_light() {
    none_is_unusable(&["office", "yard"], 1);
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn no_image_of_a_scene_is_unusable_in_any_light() {
    none_is_unusable(&["office", "yard", "city", "park"], std::env::var("IMAGES").map_or(10, |count| count.parse().unwrap()));
}

/// Of this many images of each of these scenes in each light.
#[allow(clippy::print_stdout, reason = "the figures are for people")]
fn none_is_unusable(scenes: &[&str], count: usize) {
    let camera = Camera::tello();
    let mut refused = Vec::new();
    for scene in scenes {
        for light in Lighting::ALL {
            let look = SceneLook { lighting: Some(light), ..SceneLook::default() };
            let loaded = LoadedScene::load_with(scene, &look).unwrap();
            let mut rng = RandomStream::new(7, "places", &[]);
            let (mut range, mut steps, mut repeated, mut missing) = (f32::MAX, usize::MAX, 0.0_f32, 0.0_f32);
            let mut mean = f32::MAX;
            let mut empty = 0;
            for number in 0..count {
                let pose = if number == 0 { loaded.scene.start } else { somewhere(&loaded, &mut rng) };
                let rendered =
                    loaded.render(&camera, &loaded.initial_snapshot(pose), Channels { quality: Quality::Live, ..Channels::RGB });
                let image = Rgb::from_raw(rendered.width, rendered.height, rendered.rgb.unwrap()).unwrap();
                if is_empty(&image) {
                    empty += 1;
                    continue;
                }
                for image in [through_the_codec(&image), image] {
                    let of = statistics(&image).unwrap();
                    (range, steps, mean) = (range.min(of.range), steps.min(of.steps), mean.min(of.mean));
                    (repeated, missing) = (repeated.max(of.repeated), missing.max(of.missing));
                    if let Some(why) = why_unusable(&image) {
                        refused.push(format!("{scene} {light:?} at {pose:?}: {why:?}, {of:?}"));
                    }
                }
            }
            println!(
                "{scene} {light:?}: range {range:.1}, steps {steps}, mean {mean:.1}, repeated {repeated:.2}, missing {missing:.2}, {empty} empty"
            );
            assert!(empty * 10 <= count, "{empty} of {count} are empty");
        }
    }
    assert!(refused.is_empty(), "{refused:#?}");
}

#[test]
fn each_fault_of_the_camera_is_seen_through_the_codec() {
    let loaded = LoadedScene::load("office").unwrap();
    let rendered = loaded.render(&Camera::tello(), &loaded.initial_snapshot(loaded.scene.start), Channels::RGB);
    let whole = Rgb::from_raw(rendered.width, rendered.height, rendered.rgb.unwrap()).unwrap();
    let expected = [Unusable::Covered, Unusable::Covered, Unusable::Blank];
    for (fault, expected) in CAMERA_FAULTS.into_iter().zip(expected) {
        let plan = FaultPlan { craft: vec![CraftFaultRule { fault, from: 0.0, until: None }], ..FaultPlan::default() };
        let mut image = whole.clone();
        disturb(&mut image, &FaultMachine::new(plan, 0).unwrap(), Time::from_millis(500));
        for image in [through_the_codec(&image), image] {
            assert_eq!(why_unusable(&image), Some(expected), "{fault:?}: {:?}", statistics(&image));
        }
    }
}
