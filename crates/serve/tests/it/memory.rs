//! The endpoint's memory: frames of a flight after H.264, another size and JPEG, and frames of other flights.

use std::sync::Arc;

use spf_core::craft::CraftKind;
use spf_core::frame::FrameId;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::time::Time;
use spf_flight::sim::{LoadedScene, SimWorld, WorldSnapshot};
use spf_media::h264::{Decoder, Encoder, EncoderSettings};
use spf_media::{Jpeg, Rgb, jpeg, resize};
use spf_serve::vlm::{Memory, Remembered};

const SIZE: (u32, u32) = (480, 360);
const FRAMES: u64 = 100;

/// The camera of a craft that flies at 3 m/s and turns slowly, ten frames per second.
fn flight(world: &SimWorld, east: f64, heading_deg: f64) -> Vec<(WorldSnapshot, Rgb)> {
    let pose = |n: u64| {
        let t = n as f64 / 10.0;
        let heading = (heading_deg + 3.0 * t).to_radians();
        let position = EnuPosition { east: east + 1.5 * t, north: 2.6 * t, up: 6.0 };
        Pose { position, attitude: Attitude { heading, ..Attitude::default() } }
    };
    (0..FRAMES)
        .map(|n| {
            let at = Time::from_millis(100 * n);
            let snapshot = world.loaded().snapshot(pose(n), 3, at);
            let shot = world.still(at, &snapshot).unwrap();
            let image = world.photograph(&shot, Some(SIZE));
            (snapshot, image)
        })
        .collect()
}

/// A received image: after H.264, at another size, as JPEG of quality 60.
fn arrived(images: &[(WorldSnapshot, Rgb)]) -> Vec<Rgb> {
    let mut encoder = Encoder::new(EncoderSettings { quantiser: 32, ..EncoderSettings::for_size(SIZE.0, SIZE.1, 10.0) }).unwrap();
    let mut decoder = Decoder::new().unwrap();
    let one = |(n, (_, image)): (usize, &(WorldSnapshot, Rgb))| {
        let unit = encoder.encode(Time::from_millis(100 * n as u64), image).unwrap();
        let decoded = decoder.decode(&unit.annex_b).unwrap().unwrap();
        jpeg::decode(Jpeg::encode(&resize(&decoded, 384, 288), 60).unwrap().bytes()).unwrap()
    };
    images.iter().enumerate().map(one).collect()
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn frames_are_recognised_after_h264_resizing_and_jpeg() {
    let (mut right, mut wrong, mut strangers, mut requested) = (0, 0, 0, 0);
    for (scene, kind) in [("city", CraftKind::Quad), ("yard", CraftKind::Tello)] {
        let loaded = Arc::new(LoadedScene::load(scene).unwrap());
        let world = SimWorld::new(loaded.clone(), kind, loaded.scene.start, 3);
        let frames = flight(&world, 0.0, 0.0);
        let memory = Memory::default();
        for (n, (snapshot, image)) in frames.iter().enumerate() {
            memory.push(
                Time::from_millis(100 * n as u64),
                Remembered { frame: FrameId(n as u64), snapshot: snapshot.clone() },
                image,
            );
        }
        let now = Time::from_millis(100 * FRAMES);
        for (n, image) in arrived(&frames).iter().enumerate() {
            requested += 1;
            match memory.recognise(now, image) {
                Ok(found) if found.frame == FrameId(n as u64) => right += 1,
                Ok(_) => wrong += 1,
                Err(_) => {}
            }
        }
        // Another run: elsewhere in the same scene, facing elsewhere.
        let others = flight(&world, 4.0, 40.0);
        strangers += arrived(&others).iter().filter(|image| memory.recognise(now, image).is_ok()).count();
    }
    let figures = format!(
        "{right} of {requested} right, {wrong} taken for another frame, {strangers} of {requested} of another run recognised"
    );
    assert!(right * 100 >= requested * 99 && strangers == 0, "{figures}");
    #[allow(clippy::print_stderr, reason = "the figure stands in docs/guide/grounding.md")]
    {
        eprintln!("{figures}");
    }
}
