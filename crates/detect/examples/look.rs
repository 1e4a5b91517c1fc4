//! The objects that a model finds in an image: `cargo run -p spf-detect --features onnx --example look -- yolov8n.onnx
//! photo.jpg`.
#![allow(clippy::print_stdout, reason = "it says what it found")]

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use spf_core::detection::write_detections;
use spf_detect::{Detector, Place};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, image] = arguments.as_slice() else { return Err("usage: look MODEL.onnx PICTURE.jpg|png".into()) };
    let detector = Detector::open(Path::new(model), &Place::Here)?;
    let image = spf_media::jpeg::decode_any(&std::fs::read(image)?)?;
    let began = Instant::now();
    let found = detector.detect(&image)?;
    let (width, height) = detector.input();
    println!(
        "{}: {} classes, {width}×{height} pixels, {:.3} s",
        detector.name(),
        detector.classes().len(),
        began.elapsed().as_secs_f64()
    );
    println!("{}", write_detections(&found).trim_end());
    Ok(())
}
