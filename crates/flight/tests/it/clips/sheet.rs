//! A picture of a clip: six of its images, with the true box in white and the tracker's in the colour of its quality.

use std::path::Path;

use spf_core::track::TrackQuality;
use spf_media::track::PixelBox;
use spf_media::{Rgb, png};

use super::followed::Followed;

/// The images that are shown.
const SHOWN: [usize; 6] = [0, 15, 31, 47, 63, 79];

pub(super) fn write(folder: &Path, followed: &Followed, images: &[Rgb]) {
    let mut sheet = Rgb::new(3 * 480, 2 * 360);
    for (place, image) in SHOWN.into_iter().enumerate() {
        let (x, y) = (480 * (place as u32 % 3), 360 * (place as u32 / 3));
        let mut one = images[image].clone();
        let (sight, report) = match image.checked_sub(1).map(|image| &followed.images[image]) {
            Some(image) => (image.sight, Some(image.report)),
            None => (followed.images[0].sight, None),
        };
        if let Some(area) = sight.visible {
            frame(&mut one, &area, [255; 3]);
        }
        if let Some(report) = report {
            frame(&mut one, &report.area, colour(report.quality));
        }
        for (row, column) in (0..360).flat_map(|row| (0..480).map(move |column| (row, column))) {
            sheet.set_pixel(x + column, y + row, one.pixel(column, row).unwrap());
        }
    }
    std::fs::create_dir_all(folder).unwrap();
    let number = followed.number;
    let walks = if number.walks { "walker" } else { "static" };
    let name = format!("{:03}-{}-{walks}-{}.png", number.index, number.condition.word(), number.scene);
    std::fs::write(folder.join(name), png::encode(&sheet).unwrap()).unwrap();
}

fn colour(quality: TrackQuality) -> [u8; 3] {
    match quality {
        TrackQuality::Good => [0, 230, 60],
        TrackQuality::Coasting => [255, 180, 0],
        TrackQuality::Lost => [255, 40, 40],
        TrackQuality::TooSmall => [150; 3],
    }
}

fn frame(image: &mut Rgb, area: &PixelBox, colour: [u8; 3]) {
    let clamp = |value: f64, most: u32| libm::round(value).clamp(0.0, f64::from(most - 1)) as u32;
    let (left, right) = (clamp(area.left, image.width()), clamp(area.right, image.width()));
    let (top, bottom) = (clamp(area.top, image.height()), clamp(area.bottom, image.height()));
    for x in left..=right {
        image.set_pixel(x, top, colour);
        image.set_pixel(x, bottom, colour);
    }
    for y in top..=bottom {
        image.set_pixel(left, y, colour);
        image.set_pixel(right, y, colour);
    }
}
