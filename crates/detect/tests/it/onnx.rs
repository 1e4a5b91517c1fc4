//! Networks run, in each layout in which detectors are exported.

use std::error::Error;
use std::path::PathBuf;

use crate::made::{Export, SIDE, Unit, model};
use spf_core::detection::Detection;
use spf_core::query::ImageBox;
use spf_detect::{Detector, NetworkError, Place};
use spf_media::Rgb;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join("squares.onnx");
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn open(&self, export: &Export) -> Result<Detector, NetworkError> {
        Detector::open(&self.file(&model(export)), &Place::Here)
    }

    /// Why a file is rejected, with the causes.
    fn refused(&self, bytes: &[u8]) -> String {
        let error = Detector::open(&self.file(bytes), &Place::Here).err().unwrap();
        format!("{error}{}", error.source().map_or(String::new(), |source| format!(": {source}")))
    }
}

/// Twice as wide as high, so that there is grey above and below: a red square in the left half, a blue one in the
/// right.
fn squares() -> Rgb {
    let mut image = Rgb::filled(128, 64, [90, 90, 90]);
    let mut square = |left: u32, top: u32, colour: [u8; 3]| {
        for y in top..top + 16 {
            for x in left..left + 16 {
                image.set_pixel(x, y, colour);
            }
        }
    };
    square(32, 16, [255, 0, 0]);
    square(96, 48, [0, 0, 200]);
    image
}

const RED: ImageBox = ImageBox { left: 0.25, top: 0.25, right: 0.375, bottom: 0.5 };
const BLUE: ImageBox = ImageBox { left: 0.75, top: 0.75, right: 0.875, bottom: 1.0 };

fn names(found: &[Detection]) -> Vec<&str> {
    found.iter().map(|detection| detection.name.as_str()).collect()
}

#[test]
fn every_layout_finds_the_same() {
    let folder = Folder::new();
    let plain = Export::default();
    let exports = [
        plain.clone(),
        Export { transposed: true, ..plain.clone() },
        Export { masks: true, ..plain.clone() },
        Export { masks: true, transposed: true, ..plain.clone() },
        Export { dynamic: true, ..plain.clone() },
        // Graphs that say no more of their windows than they need to.
        Export { defaults: true, ..plain.clone() },
        Export { defaults: true, dynamic: true, transposed: true, ..plain.clone() },
        // Fractions of the image, as RT-DETR gives them.
        Export { unit: Unit::Fractions, ..plain.clone() },
        Export { unit: Unit::Fractions, transposed: true, ..plain.clone() },
    ];
    for export in exports {
        let detector = folder.open(&export).unwrap_or_else(|error| panic!("{export:?}: {error}"));
        assert_eq!((detector.input(), detector.name()), ((SIDE, SIDE), "squares.onnx"));
        let found = detector.detect(&squares()).unwrap();
        assert_eq!(names(&found), ["red cone", "blue box"], "{export:?}");
        assert_eq!([found[0].area, found[1].area], [RED, BLUE], "{export:?}");
        assert!(found[0].score > 0.9 && (0.6..0.8).contains(&found[1].score), "{found:?}");
    }
}

#[test]
fn final_boxes_are_taken_as_they_are() {
    let folder = Folder::new();
    // With two classes a final box has as many numbers as a cell; the model's metadata decides, or a model with more
    // classes.
    let says = Export::default().metadata.into_iter().chain([("args", "{'batch': 1, 'nms': True}")]).collect();
    for metadata in [says, vec![("names", "{0: 'red cone', 1: 'blue box', 2: 'door'}")]] {
        let metadata = [metadata, vec![("imgsz", "[64, 64]")]].concat();
        let detector = folder.open(&Export { is_final: true, metadata, ..Export::default() });
        let Ok(detector) = detector else {
            panic!("{}", detector.err().unwrap());
        };
        let found = detector.detect(&squares()).unwrap();
        assert_eq!((names(&found), found[0].area), (vec!["red cone"], RED));
    }
}

#[test]
fn rows_of_rt_detr_are_read() {
    let metadata = vec![("names", "{0: 'red cone', 1: 'blue box', 2: 'door'}"), ("task", "detect"), ("imgsz", "[64, 64]")];
    let rows = Export { classes: 3, queries: Some(64), transposed: true, unit: Unit::Fractions, metadata, ..Export::default() };
    let detector = Folder::new().open(&rows).unwrap_or_else(|error| panic!("{error}"));
    let found = detector.detect(&squares()).unwrap();
    assert_eq!((names(&found), [found[0].area, found[1].area]), (vec!["red cone", "blue box"], [RED, BLUE]));
}

#[test]
fn operators_that_leave_their_windows_to_defaults_change_nothing() {
    let folder = Folder::new();
    let found = |export: &Export| folder.open(export).unwrap().detect(&squares()).unwrap();
    assert_eq!(found(&Export { defaults: true, ..Export::default() }), found(&Export::default()));
}

#[test]
fn final_boxes_in_fractions_are_read_or_refused() {
    let three = "{0: 'red cone', 1: 'blue box', 2: 'door'}";
    let export = Export {
        is_final: true,
        unit: Unit::Fractions,
        metadata: vec![("names", three), ("imgsz", "[64, 64]")],
        ..Export::default()
    };
    let detector = Folder::new().open(&export).unwrap();
    let found = detector.detect(&squares()).unwrap();
    assert_eq!((names(&found), found[0].area), (vec!["red cone"], RED));
    // One that finds nothing in the trial shows its unit only in flight.
    let hidden = Export { offset: -0.2, ..export };
    let detector = Folder::new().open(&hidden).unwrap();
    let refused = detector.detect(&squares()).unwrap_err().to_string();
    assert!(refused.contains("fractions of the image"), "{refused}");
}

#[test]
fn an_image_without_anything_has_an_empty_list() {
    let detector = Folder::new().open(&Export::default()).unwrap();
    for size in [(128, 64), (64, 128), (1, 1), (0, 0), (640, 480)] {
        assert_eq!(detector.detect(&Rgb::filled(size.0, size.1, [90, 90, 90])).unwrap(), [], "{size:?}");
    }
}

#[test]
fn a_model_without_names_numbers_its_classes() {
    let detector = Folder::new().open(&Export { metadata: Vec::new(), ..Export::default() }).unwrap();
    assert_eq!(detector.classes(), ["class 0", "class 1"]);
}

#[test]
fn clones_share_a_network() {
    let detector = Folder::new().open(&Export::default()).unwrap();
    let threads: Vec<_> =
        (0..3).map(|_| detector.clone()).map(|own| std::thread::spawn(move || own.detect(&squares()))).collect();
    let found: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap().unwrap()).collect();
    assert!(found[0].len() == 2 && found.iter().all(|list| *list == found[0]));
}

#[test]
fn what_does_not_fit_is_refused_in_words() {
    let folder = Folder::new();
    let with = |key, value| Export { metadata: vec![(key, value)], ..Export::default() };
    let plain = model(&Export::default());
    let last =
        || Export { is_final: true, metadata: vec![("names", "['a', 'b', 'c']"), ("imgsz", "[64, 64]")], ..Export::default() };
    let cases: [(Vec<u8>, &str); 15] = [
        (b"no model at all".to_vec(), "cannot load"),
        (plain[..plain.len() / 2].to_vec(), "cannot load"),
        (model(&Export { half: true, ..Export::default() }), "export without `half`"),
        (model(&Export { channels: 1, ..Export::default() }), "its input is 1×1×64×64, expected 1×3×height×width"),
        (model(&with("task", "pose")), "task is `pose`, expected `detect`"),
        (
            model(&with("names", "{0: 'a'}")),
            "has scores of 2 classes (or an objectness score, as YOLOv5 and older have: not supported)",
        ),
        (model(&with("names", "['a', 'b', 'c']")), "has scores of 2 classes, but its metadata has 3 class names"),
        (model(&with("names", "{0: 'a', 2: 'b'}")), "`names` of its metadata cannot be read: `{0: 'a', 2: 'b'}`"),
        (model(&Export { constant: true, ..Export::default() }), "the same for every image"),
        (model(&Export { unit: Unit::Cells, ..Export::default() }), "from (0.5, 0.5) to (7.5, 7.5) in an input of 64×64 pixels"),
        (model(&Export { offset: -7.0, ..Export::default() }), "its scores are from -7.0 to 0.0, expected probabilities"),
        (model(&Export { offset: 0.5, constant: true, ..last() }), "the same for every image"),
        (model(&Export { offset: 1.5, ..last() }), "the last two of a row of its output are 1.5"),
        // One class after its objectness, as many numbers as a final box has.
        (
            model(&Export { queries: Some(64), transposed: true, offset: 0.3, ..with("names", "['a']") }),
            "are 0.3 and 0.3, expected left, top, right, bottom, score and class; heads with objectness (YOLOv5 and older)",
        ),
        (Vec::new(), "cannot load"),
    ];
    for (bytes, words) in cases {
        let message = folder.refused(&bytes);
        assert!(message.contains(words), "{message} has not {words}");
    }
    let missing = Detector::open(&folder.0.path().join("none.onnx"), &Place::Here).err().unwrap();
    assert!(matches!(missing, NetworkError::Read(_)));
}
