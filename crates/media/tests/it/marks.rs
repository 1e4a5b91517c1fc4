//! Marks: any coordinates are safe, and the pixels are the same on every machine.

use proptest::prelude::*;
use spf_core::query::{ImageBox, ImagePoint, Mark};
use spf_media::marks::{self, Canvas, Colour, Hud, Point, Rect, TextStyle};
use spf_media::{Rgb, resize};

/// Any float: ordinary ones near the image, huge ones, infinities, NaN.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -0.5..1.5_f64, 1 => -2000.0..2000.0_f64, 2 => any::<f64>()]
}

fn point() -> impl Strategy<Value = ImagePoint> {
    (coordinate(), coordinate()).prop_map(|(u, v)| ImagePoint { u, v })
}

fn mark() -> impl Strategy<Value = Mark> {
    prop_oneof![
        (point(), point()).prop_map(|(from, to)| Mark::Arrow { from, to }),
        (point(), any::<u32>()).prop_map(|(at, number)| Mark::Number { at, number }),
        (point(), coordinate()).prop_map(|(at, radius)| Mark::Circle { at, radius }),
        (coordinate(), coordinate(), coordinate(), coordinate(), ".{0,40}")
            .prop_map(|(left, top, right, bottom, label)| { Mark::Box { area: ImageBox { left, top, right, bottom }, label } }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_coordinates_panic(marks in proptest::collection::vec(mark(), 0..4), width in 0_u32..90, height in 0_u32..70) {
        marks::draw(&mut Rgb::new(width, height), &marks);
    }

    #[test]
    fn no_waypoint_and_no_text_panics(at in point(), text in ".{0,60}", size in coordinate(), width in 0_u32..90, height in 0_u32..70) {
        let mut image = Rgb::new(width, height);
        marks::draw_waypoint(&mut image, at, &text, Colour::WAYPOINT);
        marks::draw_hud(&mut image, &Hud { title: &text, status: &text, lines: &[&text, &text], ..Hud::default() });
        let mut canvas = Canvas::new(&mut image);
        canvas.text(Point::new(at.u, at.v), &text, TextStyle::outlined(size));
        canvas.triangle([Point::new(at.u, at.v), Point::new(at.v, size), Point::new(size, size)], Colour::WHITE);
        canvas.fill(Rect { left: at.u, top: at.v, right: size, bottom: size }, Colour::WHITE);
    }

    #[test]
    fn a_nan_draws_nothing(mut mark in mark()) {
        match &mut mark {
            Mark::Arrow { to, .. } => to.u = f64::NAN,
            Mark::Number { at, .. } | Mark::Circle { at, .. } => at.v = f64::NAN,
            Mark::Box { area, .. } => area.left = f64::NAN,
        }
        let mut image = Rgb::filled(80, 60, [7, 7, 7]);
        marks::draw(&mut image, &[mark]);
        prop_assert_eq!(image, Rgb::filled(80, 60, [7, 7, 7]));
    }
}

/// One of everything, over a gradient.
fn sheet(width: u32, height: u32) -> Rgb {
    let mut image = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            image.set_pixel(x, y, [(x * 255 / width) as u8, 140, (y * 255 / height) as u8]);
        }
    }
    let at = |u, v| ImagePoint { u, v };
    marks::draw(
        &mut image,
        &[
            Mark::Arrow { from: at(0.5, 0.9), to: at(0.2, 0.45) },
            Mark::Arrow { from: at(0.5, 0.9), to: at(0.62, 0.5) },
            Mark::Number { at: at(0.2, 0.42), number: 1 },
            Mark::Number { at: at(0.63, 0.46), number: 27 },
            Mark::Circle { at: at(0.42, 0.3), radius: 0.06 },
            Mark::Box { area: ImageBox { left: 0.7, top: 0.3, right: 0.95, bottom: 0.75 }, label: "white van, depth 4".into() },
            Mark::Box { area: ImageBox { left: -0.1, top: 0.02, right: 0.12, bottom: 0.3 }, label: "tree".into() },
        ],
    );
    marks::draw_waypoint(&mut image, at(0.35, 0.6), "depth 7: red tower crane", Colour::WAYPOINT);
    marks::draw_waypoint(&mut image, at(0.97, 0.95), "at the edge", Colour::WAYPOINT);
    marks::draw_hud(
        &mut image,
        &Hud {
            title: "Take off and fly to the red crane",
            status: "12.40 s  flying",
            lines: &["#5 red tower crane  depth 7  step 5.3 m", "yaw +12°  forward 5.1 m  climb +0.8 m"],
            corner: None,
        },
    );
    image
}

#[test]
fn marks_are_the_same_on_every_machine() {
    if let Some(folder) = std::env::var_os("SPF_TEST_PICTURES") {
        let file = std::path::Path::new(&folder).join("marks.png");
        std::fs::write(file, spf_media::png::encode(&sheet(960, 720)).unwrap()).unwrap();
        let file = std::path::Path::new(&folder).join("marks-small.png");
        std::fs::write(file, spf_media::png::encode(&sheet(480, 360)).unwrap()).unwrap();
    }
    // To accept a reviewed change: run with SPF_TEST_PICTURES=FOLDER, view the images, copy the digests from the
    // failure. They also catch a compiler or a library that rounds differently.
    let (large, small) = (sheet(960, 720), sheet(480, 360));
    let digests = [large.digest(), small.digest(), resize(&large, 500, 300).digest()].map(|digest| format!("{digest:016x}"));
    assert_eq!(digests, ["ae6a1d61027e2c89", "9a79b229989110c1", "f964ea3fa79887a5"]);
}
