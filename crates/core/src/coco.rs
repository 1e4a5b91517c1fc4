//! The 80 classes of COCO, which detectors that people have at hand know.

/// The names, in the order of their numbers.
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

/// The class that a name of people's means: the name itself, or its last words (`black car` is a `car`).
#[must_use]
pub fn class_of(name: &str) -> Option<&'static str> {
    let ends = |class: &str| name.strip_suffix(class).is_some_and(|before| before.is_empty() || before.ends_with(' '));
    CLASSES.into_iter().filter(|class| ends(class)).max_by_key(|class| class.len())
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
}
