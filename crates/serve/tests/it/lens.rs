//! Lifting through lenses: the simulator's own picture, as a calibrated camera, one with a fisheye, and one that is taken for a pinhole
//! camera would show it.

use std::sync::Arc;

use spf_camera::calibration::{Calibration, Lens, Undistorter};
use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, BodyDisplacement, EnuPosition, Pose};
use spf_core::lift::{Lifting, lift, unproject};
use spf_core::query::ImagePoint;
use spf_flight::sim::LoadedScene;
use spf_media::{Jpeg, Rgb, jpeg};
use spf_render::Channels;

const SIZE: (u32, u32) = (960, 720);
const TILT: f64 = 0.2;
/// A colour that the scene does not have.
const MARK: [u8; 3] = [255, 0, 255];

/// Directions (right and down, in focal lengths of a pinhole camera) that an image point of a lens shows.
fn undistorted(calibration: &Calibration, column: f64, row: f64) -> (f64, f64) {
    let (x, y) = ((column - calibration.cx) / calibration.fx, (row - calibration.cy) / calibration.fy);
    match calibration.lens {
        Lens::Fisheye { k } => {
            let shown = x.hypot(y).max(1e-12);
            let mut angle = shown;
            for _ in 0..40 {
                let a = angle * angle;
                let polynomial = angle * (1.0 + a * (k[0] + a * (k[1] + a * (k[2] + a * k[3]))));
                let slope = 1.0 + a * (3.0 * k[0] + a * (5.0 * k[1] + a * (7.0 * k[2] + a * 9.0 * k[3])));
                angle -= (polynomial - shown) / slope;
            }
            (x / shown * angle.tan(), y / shown * angle.tan())
        }
        Lens::Brown { k, p: [p1, p2], .. } => {
            let (mut u, mut v) = (x, y);
            for _ in 0..60 {
                let r2 = u * u + v * v;
                let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
                (u, v) = (
                    (x - 2.0 * p1 * u * v - p2 * (r2 + 2.0 * u * u)) / radial,
                    (y - p1 * (r2 + 2.0 * v * v) - 2.0 * p2 * u * v) / radial,
                );
            }
            (u, v)
        }
    }
}

fn calibration(focal: f64, lens: Lens) -> Calibration {
    Calibration { width: SIZE.0, height: SIZE.1, fx: focal, fy: focal - 2.0, cx: 479.5, cy: 359.5, lens }
}

fn fisheye() -> Calibration {
    calibration(420.0, Lens::fisheye([0.08, -0.02, 0.005, -0.001]))
}

fn wide() -> Calibration {
    calibration(700.0, Lens::brown([-0.25, 0.08, 0.001, -0.0005, -0.01, 0.0, 0.0, 0.0]))
}

/// OpenCV 5.0.0: `cv2.fisheye.undistortPoints`, and `cv2.projectPoints` for the other lens, whose inverse it finds in five steps only.
#[test]
fn the_lenses_of_these_tests_are_those_of_opencv() {
    let fisheyes = [
        ((100.0, 120.0), (-1.330_065_674, -0.843_412_109)),
        ((700.0, 300.0), (0.568_959_732, -0.154_263_404)),
        ((850.0, 640.0), (1.349_458_924, 1.026_543_439)),
    ];
    let wides = [
        ((104.343_151_8, 123.043_078_5), (-0.6, -0.38)),
        ((697.377_110_4, 298.463_425_3), (0.32, -0.09)),
        ((850.250_365_2, 637.308_168_2), (0.6, 0.45)),
    ];
    for (lens, expected) in [(fisheye(), fisheyes), (wide(), wides)] {
        for ((column, row), expected) in expected {
            let found = undistorted(&lens, column, row);
            assert!((found.0 - expected.0).abs() < 1e-6 && (found.1 - expected.1).abs() < 1e-6, "{found:?} {expected:?}");
        }
    }
}

/// The picture of a lens, from that of a pinhole camera that sees more.
fn through(calibration: &Calibration, pinhole: &Camera, picture: &Rgb) -> Rgb {
    let mut image = Rgb::new(SIZE.0, SIZE.1);
    for row in 0..SIZE.1 {
        for column in 0..SIZE.0 {
            let (right, down) = undistorted(calibration, f64::from(column), f64::from(row));
            let Some(point) = pinhole.project(right, 1.0, -down) else { continue };
            let (x, y) = (point.u * f64::from(pinhole.width) - 0.5, point.v * f64::from(pinhole.height) - 0.5);
            if x < 0.0 || y < 0.0 {
                continue;
            }
            let at = |dx, dy| picture.pixel(x as u32 + dx, y as u32 + dy).map(|pixel| pixel.map(f64::from));
            if let (Some(a), Some(b), Some(c), Some(d)) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1)) {
                let (fx, fy) = (x.fract(), y.fract());
                let mixed = |n: usize| (a[n] * (1.0 - fx) + b[n] * fx) * (1.0 - fy) + (c[n] * (1.0 - fx) + d[n] * fx) * fy;
                image.set_pixel(column, row, [0, 1, 2].map(|n| mixed(n).round() as u8));
            }
        }
    }
    image
}

/// Centre of the marked pixels.
fn marked(image: &Rgb) -> ImagePoint {
    let (mut sum, mut count) = ((0.0, 0.0), 0.0);
    for y in 0..image.height() {
        for x in 0..image.width() {
            let [red, green, blue] = image.pixel(x, y).unwrap();
            if red > 170 && green < 90 && blue > 170 {
                sum = (sum.0 + f64::from(x) + 0.5, sum.1 + f64::from(y) + 0.5);
                count += 1.0;
            }
        }
    }
    assert!(count > 20.0, "the mark is not in the image");
    ImagePoint { u: sum.0 / count / f64::from(image.width()), v: sum.1 / count / f64::from(image.height()) }
}

/// A scene, a camera that sees 140° of it, and a mark on one of its objects.
struct Marked {
    picture: Rgb,
    pinhole: Camera,
    pose: Pose,
    place: EnuPosition,
}

impl Marked {
    fn new() -> Self {
        let loaded = Arc::new(LoadedScene::load("yard").unwrap());
        let bench = loaded.scene.objects.iter().find(|object| loaded.key(object.id) == "vending_machine").unwrap();
        let bounds = loaded.bounds(bench, &[]);
        let place = bounds.min.towards(bounds.max, 0.5);
        // 5 m from it, looking 28° to its left, so that it is far from the centre of the image.
        let (east, north) = (place.east - 3.0, place.north - 4.0);
        let position = EnuPosition { east, north, up: place.up + 0.8 };
        let heading = position.bearing_to(place) - 28_f64.to_radians();
        let pose = Pose { position, attitude: Attitude { heading, ..Attitude::default() } };
        let pinhole = Camera::from_fov(1920, 1440, 140_f64.to_radians(), 128_f64.to_radians(), TILT);
        let snapshot = loaded.initial_snapshot(pose);
        let image = loaded.render(&pinhole, &snapshot, Channels::RGB);
        let mut picture = Rgb::from_raw(image.width, image.height, image.rgb.unwrap()).unwrap();
        let there = pose.position.displacement_to(place, heading);
        let camera = spf_core::lift::lower(there, &pinhole, pose.attitude, Lifting::Levelled);
        let at = pinhole.project(camera.right, camera.forward, camera.up).unwrap();
        let (x, y) = ((at.u * 1920.0) as i64, (at.v * 1440.0) as i64);
        for dy in -7..=7_i64 {
            for dx in -7..=7_i64 {
                picture.set_pixel((x + dx) as u32, (y + dy) as u32, MARK);
            }
        }
        Self { picture, pinhole, pose, place }
    }

    /// How far from the marked place the point ends that is found and lifted, as a fraction of its distance. The image is compressed as
    /// a camera compresses it.
    fn error(&self, image: &Rgb, camera: &Camera) -> f64 {
        let sent = jpeg::decode(Jpeg::encode(image, 85).unwrap().bytes()).unwrap();
        let there = self.pose.position.displacement_to(self.place, self.pose.attitude.heading);
        let along = spf_core::lift::lower(there, camera, self.pose.attitude, Lifting::Levelled).forward;
        let lifted = lift(unproject(camera, marked(&sent), along).unwrap(), camera, self.pose.attitude, Lifting::Levelled);
        let off = BodyDisplacement {
            right: lifted.right - there.right,
            forward: lifted.forward - there.forward,
            up: lifted.up - there.up,
        };
        off.length() / there.length()
    }
}

#[test]
fn a_marked_point_is_lifted_through_a_pinhole_a_calibrated_and_a_fisheye_camera() {
    let marked = Marked::new();
    let plain = Camera::from_fov(SIZE.0, SIZE.1, 100_f64.to_radians(), 83.6_f64.to_radians(), TILT);
    let straight = through(&calibration(plain.fx, Lens::brown([0.0; 8])), &marked.pinhole, &marked.picture);
    // Without a calibration, by the field of view alone.
    let pinhole = marked.error(&straight, &plain);
    let mut errors = vec![pinhole];
    for lens in [wide(), fisheye()] {
        let seen = through(&lens, &marked.pinhole, &marked.picture);
        let straightened = Undistorter::new(lens.clone()).undistort(seen.clone());
        errors.push(marked.error(&straightened, &lens.camera(TILT)));
        // The same picture, taken for that of a pinhole camera.
        let wrong = marked.error(&seen, &lens.camera(TILT));
        assert!(wrong > 0.02, "{wrong}");
    }
    assert!(errors.iter().all(|error| *error < 0.01), "{errors:?}");
}
