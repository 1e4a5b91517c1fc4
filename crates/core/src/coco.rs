//! The 80 object classes of COCO, which common detectors are trained on.

/// Class names, in index order.
pub const CLASSES: [&str; 80] = [
    "person",
    "bicycle",
    "car",
    "motorcycle",
    "airplane",
    "bus",
    "train",
    "truck",
    "boat",
    "traffic light",
    "fire hydrant",
    "stop sign",
    "parking meter",
    "bench",
    "bird",
    "cat",
    "dog",
    "horse",
    "sheep",
    "cow",
    "elephant",
    "bear",
    "zebra",
    "giraffe",
    "backpack",
    "umbrella",
    "handbag",
    "tie",
    "suitcase",
    "frisbee",
    "skis",
    "snowboard",
    "sports ball",
    "kite",
    "baseball bat",
    "baseball glove",
    "skateboard",
    "surfboard",
    "tennis racket",
    "bottle",
    "wine glass",
    "cup",
    "fork",
    "knife",
    "spoon",
    "bowl",
    "banana",
    "apple",
    "sandwich",
    "orange",
    "broccoli",
    "carrot",
    "hot dog",
    "pizza",
    "donut",
    "cake",
    "chair",
    "couch",
    "potted plant",
    "bed",
    "dining table",
    "toilet",
    "tv",
    "laptop",
    "mouse",
    "remote",
    "keyboard",
    "cell phone",
    "microwave",
    "oven",
    "toaster",
    "sink",
    "refrigerator",
    "book",
    "clock",
    "vase",
    "scissors",
    "teddy bear",
    "hair drier",
    "toothbrush",
];

/// The class matching a user's name for an object: the name itself, or its last words (`black car` is a `car`).
#[must_use]
pub fn class_of(name: &str) -> Option<&'static str> {
    let ends = |class: &str| name.strip_suffix(class).is_some_and(|before| before.is_empty() || before.ends_with(' '));
    CLASSES.into_iter().filter(|class| ends(class)).max_by_key(|class| class.len())
}

/// Typical heights, metres, of classes whose instances are about equally tall (most within a third). Objects that are
/// carried, lie on the ground, fly or vary in size are omitted.
const HEIGHTS: [(&str, f64); 28] = [
    ("person", 1.7),
    ("bicycle", 1.05),
    ("car", 1.5),
    ("motorcycle", 1.1),
    ("bus", 3.1),
    ("train", 3.8),
    ("truck", 3.0),
    ("traffic light", 0.9),
    ("fire hydrant", 0.75),
    ("stop sign", 0.75),
    ("parking meter", 1.3),
    ("bench", 0.85),
    ("dog", 0.55),
    ("horse", 1.8),
    ("sheep", 0.9),
    ("cow", 1.5),
    ("elephant", 2.8),
    ("bear", 1.2),
    ("zebra", 1.5),
    ("giraffe", 4.6),
    ("chair", 0.9),
    ("couch", 0.85),
    ("bed", 0.7),
    ("dining table", 0.75),
    ("toilet", 0.75),
    ("oven", 0.85),
    ("refrigerator", 1.7),
    ("microwave", 0.3),
];

/// Least heights, metres, of classes without a typical one whose smallest instances are much taller than [`LEAST_OF_ANY`].
const LEAST: [(&str, f64); 3] = [("airplane", 1.5), ("boat", 0.5), ("kite", 0.3)];
/// Least height of an instance of any class, metres: a cup or an apple.
const LEAST_OF_ANY: f64 = 0.05;

/// Height below which there is hardly an instance of a class, metres.
#[must_use]
pub fn min_height(class: &str) -> f64 {
    LEAST.iter().find(|(name, _)| *name == class).map_or(LEAST_OF_ANY, |(_, metres)| *metres)
}

/// Typical height of a class, metres; `None` if it varies too much.
#[must_use]
pub fn height(class: &str) -> Option<f64> {
    HEIGHTS.iter().find(|(name, _)| *name == class).map(|(_, metres)| *metres)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_end_in_their_class() {
        assert_eq!((CLASSES[0], CLASSES[56], CLASSES[79]), ("person", "chair", "toothbrush"));
        assert_eq!(
            (class_of("black car"), class_of("car"), class_of("stop sign")),
            (Some("car"), Some("car"), Some("stop sign"))
        );
        assert_eq!((class_of("scar"), class_of("red crane"), class_of("car park")), (None, None, None));
        assert_eq!(class_of("teddy bear"), Some("teddy bear"));
    }

    #[test]
    fn heights_are_of_classes() {
        assert!(HEIGHTS.iter().all(|(name, metres)| CLASSES.contains(name) && (0.1..10.0).contains(metres)));
        assert_eq!((height("person"), height("kite")), (Some(1.7), None));
    }
}
