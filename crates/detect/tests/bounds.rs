//! Models that ask for too much memory or time are ended, and the program goes on.
//!
//! Without the harness, because this program is also the process in which the models run.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test that cannot go on fails")]

mod made;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use made::{DepthExport, Export, Trick, depth, hostile, model};
use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::time::Time;
use spf_detect::{Bounds, DepthNetwork, DepthOptions, Detector, NetworkError, OutputKind, Place, worker};
use spf_media::Rgb;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.first().is_some_and(|argument| argument == worker::ARGUMENT) {
        return worker::serve();
    }
    let tests: [(&str, fn()); 5] = [
        ("an_ordinary_model_runs_in_a_process_of_its_own", an_ordinary_model_runs_in_a_process_of_its_own),
        ("a_model_that_asks_for_too_much_is_ended", a_model_that_asks_for_too_much_is_ended),
        ("a_program_that_is_no_detector_is_refused", a_program_that_is_no_detector_is_refused),
        ("a_depth_network_is_bounded_like_a_detector", a_depth_network_is_bounded_like_a_detector),
        ("a_process_that_has_ended_stays_an_error", a_process_that_has_ended_stays_an_error),
    ];
    let wanted = arguments.iter().find(|argument| !argument.starts_with('-'));
    for (name, test) in tests {
        if arguments.iter().any(|argument| argument == "--list") {
            println!("{name}: test");
        } else if wanted.is_none_or(|wanted| name.contains(wanted)) && !arguments.iter().any(|argument| argument == "--ignored") {
            test();
            println!("test {name} ... ok");
        }
    }
    ExitCode::SUCCESS
}

const BOUNDS: Bounds = Bounds { memory: 512 << 20, load: Duration::from_secs(20), run: Duration::from_secs(10) };

fn open(bytes: &[u8], bounds: Bounds) -> Result<Detector, NetworkError> {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("model.onnx");
    std::fs::write(&path, bytes).unwrap();
    Detector::open(&path, &Place::this_program(bounds).unwrap())
}

fn an_ordinary_model_runs_in_a_process_of_its_own() {
    let detector = open(&model(&Export::default()), BOUNDS).unwrap();
    let mut image = Rgb::filled(64, 64, [90, 90, 90]);
    for (x, y) in (0..8).flat_map(|y| (0..8).map(move |x| (8 + x, 16 + y))) {
        image.set_pixel(x, y, [255, 0, 0]);
    }
    let found = detector.detect(&image).unwrap();
    assert_eq!(found.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["red cone"]);
    // The same as in this process.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.onnx");
    std::fs::write(&path, model(&Export::default())).unwrap();
    assert_eq!(Detector::open(&path, &Place::Here).unwrap().detect(&image).unwrap(), found);
    let clone = detector.clone();
    drop(detector);
    assert_eq!(clone.detect(&image).unwrap(), found);
    let refused = open(&model(&Export { half: true, ..Export::default() }), BOUNDS).err().unwrap();
    assert!(refused.to_string().contains("export without `half`"), "{refused}");
}

fn a_model_that_asks_for_too_much_is_ended() {
    let short = Bounds { load: Duration::from_secs(2), ..BOUNDS };
    for (trick, bounds, words) in [
        (Trick::Zeros, BOUNDS, "memory"),
        (Trick::Expanded, BOUNDS, "memory"),
        (Trick::Pieces, BOUNDS, "memory"),
        (Trick::Claimed, BOUNDS, "cannot load"),
        (Trick::Loop, short, "it takes longer than 2 s"),
        (Trick::Output, Bounds { memory: 4 << 30, ..BOUNDS }, "its output exceeds 256 MiB"),
    ] {
        let began = Instant::now();
        let error = open(&hostile(trick), bounds).err().unwrap_or_else(|| panic!("{trick:?} is taken"));
        println!("  {trick:?}: {:.1} s: {error}", began.elapsed().as_secs_f64());
        assert!(error.to_string().contains(words), "{trick:?}: {error}");
        assert!(began.elapsed() < bounds.load + Duration::from_secs(60), "{trick:?}");
    }
}

fn a_program_that_is_no_detector_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.onnx");
    std::fs::write(&path, model(&Export::default())).unwrap();
    let at = |program: &str| Place::Process { program: program.into(), args: Vec::new(), bounds: BOUNDS };
    for program in ["true", "cat", "/none"] {
        let error = Detector::open(&path, &at(program)).err().unwrap();
        assert!(matches!(error, NetworkError::Load(_)), "{program}: {error}");
    }
}

fn a_process_that_has_ended_stays_an_error() {
    let bounds = Bounds { run: Duration::ZERO, ..BOUNDS };
    let detector = open(&model(&Export::default()), bounds).unwrap();
    let image = Rgb::filled(64, 64, [90, 90, 90]);
    // Whoever asks again is told why it has ended.
    for _ in 0..2 {
        let error = detector.detect(&image).unwrap_err();
        assert!(error.to_string().contains("it takes longer than 0 s"), "{error}");
    }
}

fn a_depth_network_is_bounded_like_a_detector() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("depth.onnx");
    let options = DepthOptions { kind: OutputKind::Relative, size: None };
    let open = |bytes: &[u8], bounds: Bounds| {
        std::fs::write(&path, bytes).unwrap();
        DepthNetwork::open(&path, options, &Place::this_program(bounds).unwrap())
    };
    let frame = (FrameId(1), Time::ZERO);
    let image = Rgb::filled(320, 240, [200, 90, 90]);
    let network = open(&depth(&DepthExport::default()), BOUNDS).unwrap();
    let there = network.estimate(frame, &Camera::quad(), &image).unwrap();
    let here = DepthNetwork::open(&path, options, &Place::Here).unwrap().estimate(frame, &Camera::quad(), &image).unwrap();
    assert_eq!(there, here);
    let short = Bounds { load: Duration::from_secs(1), ..BOUNDS };
    for (trick, bounds, words) in [(Trick::Expanded, BOUNDS, "memory"), (Trick::Loop, short, "it takes longer than 1 s")] {
        let error = open(&hostile(trick), bounds).err().unwrap_or_else(|| panic!("{trick:?} is taken"));
        assert!(error.to_string().contains(words), "{trick:?}: {error}");
    }
    // One that was quick before the flight, and is not in it.
    let late = open(&depth(&DepthExport::default()), Bounds { run: Duration::ZERO, ..BOUNDS }).unwrap();
    let mut answers = (0..3).map(|_| late.estimate(frame, &Camera::quad(), &image));
    assert!(answers.next().unwrap().is_ok() || answers.all(|answer| answer.is_err()));
}
