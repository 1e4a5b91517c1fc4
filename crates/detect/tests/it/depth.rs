//! Depth networks of each kind and form, and a room whose depths are known: level ground, and a wall.

use crate::made::{self, DepthExport, Export, depth, model};
use proptest::prelude::*;
use spf_core::camera::Camera;
use spf_core::depth::CameraAxes;
use spf_core::frame::FrameId;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::query::ImagePoint;
use spf_core::time::Time;
use spf_detect::mono_depth::{Clues, DepthKind, MonoDepth, ScaleSource};
use spf_detect::{DepthNetwork, DepthOptions, NetworkError, OutputKind, Place};
use spf_media::Rgb;

const HEIGHT: f64 = 2.0;
const WALL: f64 = 6.0;
const FRAME: (FrameId, Time) = (FrameId(7), Time::ZERO);

fn pose() -> Pose {
    Pose { position: EnuPosition { up: HEIGHT, ..EnuPosition::default() }, ..Pose::default() }
}

/// The depth at a place of the image, along the optical axis.
fn truth(camera: &Camera, at: ImagePoint) -> f64 {
    let axes = CameraAxes::new(camera, Pose::default());
    let ray = camera.ray(at);
    let along = axes.place(ray.right, 1.0, ray.up);
    let wall = WALL / along.north;
    if along.up < 0.0 { wall.min(HEIGHT / -along.up) } else { wall }
}

/// An image of the room, as red as `red` says of a depth.
fn image(red: impl Fn(f64) -> f64) -> Rgb {
    let camera = Camera::quad().resized(480, 360);
    let mut image = Rgb::new(480, 360);
    for (x, y) in (0..360).flat_map(|y| (0..480).map(move |x| (x, y))) {
        let at = ImagePoint { u: (f64::from(x) + 0.5) / 480.0, v: (f64::from(y) + 0.5) / 360.0 };
        image.set_pixel(x, y, [(255.0 * red(truth(&camera, at))).round() as u8, 40, 90]);
    }
    image
}

fn open_as(export: &DepthExport, options: DepthOptions) -> Result<DepthNetwork, NetworkError> {
    open_bytes(&depth(export), options)
}

fn open_bytes(bytes: &[u8], options: DepthOptions) -> Result<DepthNetwork, NetworkError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("red.onnx");
    std::fs::write(&path, bytes).unwrap();
    DepthNetwork::open(&path, options, &Place::Here)
}

fn options(kind: OutputKind) -> DepthOptions {
    DepthOptions { kind, size: None }
}

/// The errors of the logarithm of depth, of which one in fifty is larger, and what tells the scale.
fn error(estimate: &MonoDepth, height: Option<f64>) -> (f64, ScaleSource) {
    let clues = Clues { pose: pose(), scans: &[], height };
    let (metres, scale) = estimate.in_metres(&clues).unwrap();
    let camera = metres.grid.camera;
    let of = |(index, cm): (usize, &u16)| {
        let place = |i: u32, of: u32| (f64::from(i) + 0.5) / f64::from(of);
        let index = index as u32;
        let at = ImagePoint { u: place(index % camera.width, camera.width), v: place(index / camera.width, camera.height) };
        (0.01 * f64::from(*cm) / truth(&camera, at)).ln().abs()
    };
    let mut errors: Vec<f64> = metres.grid.cm.iter().enumerate().filter(|(_, cm)| **cm > 0).map(of).collect();
    assert!(errors.len() > metres.grid.cm.len() / 2);
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() * 49 / 50], scale.source)
}

/// A kind, the network's gain, the red of a depth, and the height above the ground, if it is known.
type Case = (OutputKind, f32, fn(f64) -> f64, Option<f64>);

#[test]
fn each_kind_gives_the_metres_of_a_known_room() {
    let far = 16.0;
    // The focal length at 252×196 pixels, by which a canonical depth is multiplied: 126.
    let canonical = 300.0 / 126.0;
    let cases: [Case; 6] = [
        (OutputKind::Disparity, 25.0, |z| 1.0 / z, Some(HEIGHT)),
        (OutputKind::Relative, 0.3, |z| z / 16.0, Some(HEIGHT)),
        (OutputKind::Metric, far, |z| z / 16.0, None),
        (OutputKind::Metric, 2.0 * far, |z| z / 16.0, Some(HEIGHT)),
        (OutputKind::Canonical(300.0), far * canonical, |z| z / 16.0, None),
        (OutputKind::Canonical(1000.0), far * canonical / 0.3, |z| z / 16.0, None),
    ];
    for (kind, gain, red, height) in cases {
        let network = open_as(&DepthExport { gain, ..DepthExport::default() }, options(kind)).unwrap();
        assert_eq!((network.input(), network.output(), network.kind()), ((252, 196), (252, 196), kind));
        let estimate = network.estimate(FRAME, &Camera::quad().resized(480, 360), &image(red)).unwrap();
        assert_eq!((estimate.frame, estimate.captured, estimate.kind), (FRAME.0, FRAME.1, kind.depth_kind()));
        let (error, source) = error(&estimate, height);
        assert!(error < 0.1, "{kind}: {error}");
        assert_eq!(source, if height.is_some() { ScaleSource::Ground } else { ScaleSource::Network }, "{kind}");
    }
}

#[test]
fn every_form_of_input_and_output_gives_the_same() {
    let plain = DepthExport::default();
    let estimate = |export: &DepthExport, options: DepthOptions| {
        let network = open_as(export, options).unwrap_or_else(|error| panic!("{export:?}: {error}"));
        network.estimate(FRAME, &Camera::quad(), &image(|z| z / 16.0)).unwrap()
    };
    let kind = OutputKind::Relative;
    let expected = estimate(&plain, options(kind));
    assert_eq!((expected.kind, expected.camera.width, expected.camera.height), (DepthKind::Relative, 96, 72));
    for export in [
        DepthExport { leading: 1, ..plain.clone() },
        DepthExport { leading: 0, ..plain.clone() },
        DepthExport { several: true, ..plain.clone() },
        DepthExport { confidence: true, ..plain.clone() },
        DepthExport { size: Some((252, 196)), ..plain.clone() },
    ] {
        assert_eq!(estimate(&export, options(kind)), expected, "{export:?}");
    }
    let small = estimate(&plain, DepthOptions { kind, size: Some((70, 56)) });
    assert_eq!((small.camera.width, small.camera.height), (70, 56));
    let square = estimate(&DepthExport { size: Some((518, 518)), ..plain }, options(kind));
    assert_eq!((square.camera.width, square.camera.height), (96, 72));
}

#[test]
fn what_is_no_depth_network_is_refused_in_words() {
    let any = options(OutputKind::Disparity);
    let plain = DepthExport::default();
    let refused = |bytes: &[u8], options| open_bytes(bytes, options).err().unwrap().to_string();
    for (bytes, words) in [
        (b"no model at all".to_vec(), "cannot load"),
        (depth(&DepthExport { planes: 3, ..plain.clone() }), "its output is 1×3×196×252, expected 1×height×width"),
        (model(&Export { dynamic: true, ..Export::default() }), "cannot run"),
        (model(&Export::default()), "its output is 1×6×84, expected"),
        (model(&Export { channels: 1, ..Export::default() }), "expected 1×3×height×width"),
    ] {
        let message = refused(&bytes, any);
        assert!(message.contains(words), "{message} has not {words}");
    }
    let fixed = depth(&DepthExport { size: Some((140, 84)), ..plain });
    let message = refused(&fixed, DepthOptions { size: Some((252, 196)), ..any });
    assert!(message.contains("fixed at 140×84"), "{message}");
}

#[test]
fn an_output_of_no_numbers_is_an_error() {
    for (gain, words) in
        [(f32::NAN, "same for every"), (0.0, "same for every"), (f32::INFINITY, ""), (-1.0, "not positive numbers")]
    {
        let network = open_as(&DepthExport { gain, ..DepthExport::default() }, options(OutputKind::Disparity));
        let image = Rgb::filled(64, 48, [120, 0, 0]);
        let error = network.and_then(|network| network.estimate(FRAME, &Camera::quad(), &image)).unwrap_err();
        assert!(error.to_string().contains(words), "{gain}: {error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever a network makes of an image: depths within bounds, or an error in words.
    #[test]
    fn any_gain_and_any_image_give_depth_or_an_error(gain: f32, size in (0_u32..80, 0_u32..80), red: u8, sky: u8) {
        let export = DepthExport { gain, size: Some((42, 28)), ..DepthExport::default() };
        // One without a gain is constant, and refused.
        let Ok(network) = open_as(&export, options(OutputKind::Metric)) else { return Ok(()) };
        let mut image = Rgb::filled(size.0, size.1, [red, 7, 7]);
        for x in 0..size.0.min(size.1) {
            image.set_pixel(x, x, [sky, 0, 0]);
        }
        if let Ok(estimate) = network.estimate(FRAME, &Camera::quad(), &image) {
            prop_assert!(estimate.is_valid());
            let clues = Clues { pose: pose(), scans: &[], height: None };
            if let Ok((metres, _)) = estimate.in_metres(&clues) {
                prop_assert!(metres.grid.cm.iter().all(|cm| *cm == 0 || (20..=1200).contains(cm)));
            }
        }
    }
}

/// A network of the size of Depth Anything V2-Small in two sizes of image, the files left in `target` for
/// `spf doctor --depth-model`, which says how long they take: here, without optimisation, an image takes half a minute.
#[test]
#[ignore = "files of 90 MB, and half a minute for an image without optimisation"]
fn a_network_of_real_size_runs() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    let write = |size: (usize, usize)| {
        let bytes = made::vit::vit(size);
        std::fs::write(folder.join(format!("vit-{}x{}.onnx", size.0, size.1)), &bytes).unwrap();
        bytes
    };
    write((336, 252));
    let size = (252, 196);
    let network = open_bytes(&write(size), options(OutputKind::Relative)).unwrap();
    assert_eq!((network.input(), network.output()), (size, size));
    network.estimate(FRAME, &Camera::quad(), &image(|z| z / 16.0)).unwrap();
}
