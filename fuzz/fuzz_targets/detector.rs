//! Any text as a list of detections, any numbers as a network's output: no panic, and boxes inside the image.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::camera::Camera;
use spf_core::detection::{MAX_DETECTIONS, obstacles, parse_detections};
use spf_detect::decode::{Layout, suppress};
use spf_detect::letterbox::Letterbox;

const INPUT: (usize, usize) = (64, 64);

fuzz_target!(|data: (&str, Vec<f32>, u8, u8, bool)| {
    let (text, values, rows, columns, masks) = data;
    if let Ok(list) = parse_detections(text) {
        assert!(list.len() <= MAX_DETECTIONS);
        let boxes = obstacles(&list, &Camera::quad(), Some("the black car"));
        assert!(boxes.iter().all(|b| (1..=10).contains(&b.depth) && b.area.left <= b.area.right && b.area.top <= b.area.bottom));
    }
    let shape = [1, usize::from(rows), usize::from(columns)];
    let Ok(layout) = Layout::of(&shape, INPUT, None, masks, None) else { return };
    if let Ok(candidates) = layout.decode(&shape, &values) {
        for kept in suppress(candidates, layout.is_final()) {
            let area = Letterbox::new((960, 720), INPUT).in_image(kept.corners);
            assert!(0.0 <= area.left && area.left <= area.right && area.right <= 1.0 && area.top <= area.bottom);
        }
    }
});
