//! From what a simulator's camera sends to frames and depth grids.

use spf_core::camera::Camera;
use spf_core::depth::stereo::Stereo;
use spf_core::depth::{DepthGrid, DepthSource};
use spf_core::time::Time;
use spf_media::Rgb;

use super::opening::{MOST_PIXELS, fault_of, pinhole};
use super::wire::structs::{ImageRequest, ImageResponse, ImageType};

/// Columns of a depth grid, as of our own sensor.
const COLUMNS: u32 = 160;
/// Most rows: a picture that is higher than wide has fewer columns.
const ROWS: u32 = 160;

/// The pixels of a raw picture of colours, which come as blue, green, red; the error says what is wrong with it.
pub(super) fn pixels(image: ImageResponse) -> Result<Rgb, String> {
    if let Some(fault) = fault_of(&image) {
        return Err(fault);
    }
    let mut bytes = image.image_data_uint8;
    bytes.as_chunks_mut::<3>().0.iter_mut().for_each(|pixel| pixel.reverse());
    Rgb::from_raw(image.width, image.height, bytes).map_err(|error| error.to_string())
}

/// A picture of depths along the optical axis.
pub(super) fn depth_of(camera: &str) -> ImageRequest {
    ImageRequest { camera_name: camera.to_owned(), image_type: ImageType::DepthPlanar, pixels_as_float: true, compress: false }
}

/// A stereo camera that sees what a simulator's depth picture shows.
#[derive(Debug)]
pub(super) struct DepthEye {
    /// Horizontal field of view, and tilt, radians.
    fov: f64,
    tilt: f64,
    seed: u64,
    number: u64,
}

impl DepthEye {
    /// One that looks where a camera looks.
    pub(super) fn new(camera: &Camera, seed: u64) -> Self {
        let fov = 2.0 * libm::atan(0.5 * f64::from(camera.width) / camera.fx);
        Self { fov, tilt: camera.tilt, seed, number: 0 }
    }

    /// What it measures of a picture captured then: fewer pixels, with the errors of our own sensor; the error says what is wrong with
    /// the picture.
    pub(super) fn measure(&mut self, image: &ImageResponse, captured: Time) -> Result<DepthGrid, String> {
        let (width, height) = (image.width, image.height);
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > MOST_PIXELS {
            let said: String = image.message.chars().take(200).collect();
            return Err(format!("a depth image of {width}×{height} pixels {said}"));
        }
        if image.image_data_float.len() as u64 != pixels {
            let values = image.image_data_float.len();
            return Err(format!("a depth image of {width}×{height} pixels has {values} values"));
        }
        let columns = width.min(COLUMNS);
        let rows = ((u64::from(columns) * u64::from(height)).div_ceil(u64::from(width)) as u32).clamp(1, height.min(ROWS));
        let at = |column: u32, row: u32| {
            // The middle of the pixels that it stands for.
            let x = (2 * u64::from(column) + 1) * u64::from(width) / (2 * u64::from(columns));
            let y = (2 * u64::from(row) + 1) * u64::from(height) / (2 * u64::from(rows));
            image.image_data_float[(y * u64::from(width) + x) as usize]
        };
        let depths: Vec<f32> =
            (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))).map(|(c, r)| at(c, r)).collect();
        let counter = self.number;
        self.number += 1;
        let cm = Stereo::new((columns, rows)).measure(&depths, self.seed, counter);
        let camera = pinhole((width, height), self.fov, self.tilt).resized(columns, rows);
        Ok(DepthGrid { captured, counter, camera, cm, source: DepthSource::Sensor })
    }
}

#[cfg(test)]
mod tests {
    use super::super::wire::structs::{Quaternionr, Vector3r};
    use super::*;

    fn image(width: u32, height: u32, bytes: Vec<u8>, floats: Vec<f32>) -> ImageResponse {
        ImageResponse {
            image_data_uint8: bytes,
            image_data_float: floats,
            camera_position: Vector3r::default(),
            camera_name: "0".to_owned(),
            camera_orientation: Quaternionr::default(),
            time_stamp: 1,
            message: String::new(),
            pixels_as_float: false,
            compress: false,
            width,
            height,
            image_type: ImageType::Scene,
        }
    }

    /// A blue pixel comes as 255, 0, 0.
    #[test]
    fn blue_green_red_becomes_red_green_blue() {
        let seen = pixels(image(2, 1, vec![255, 0, 0, 3, 2, 1], Vec::new())).unwrap();
        assert_eq!(seen.data(), [0, 0, 255, 1, 2, 3]);
    }

    #[test]
    fn pictures_of_no_size_or_of_another_than_they_say_are_refused() {
        let fault = |width, height, bytes| pixels(image(width, height, vec![0; bytes], Vec::new())).unwrap_err();
        assert_eq!(fault(0, 0, 0), "its image has 0×0 pixels");
        assert_eq!(fault(4, 2, 23), "its image of 4×2 pixels has 23 bytes in the place of 24");
        assert!(fault(u32::MAX, u32::MAX, 3).contains("larger than 4096×4096"));
        let told = ImageResponse { message: "no such camera".to_owned(), ..image(0, 0, Vec::new(), Vec::new()) };
        assert_eq!(pixels(told).unwrap_err(), "no such camera");
        let mut eye = DepthEye::new(&Camera::quad(), 0);
        for (width, height, values) in [(0, 0, 0), (4, 2, 7), (u32::MAX, 2, 8)] {
            assert!(eye.measure(&image(width, height, Vec::new(), vec![1.0; values]), Time::ZERO).is_err());
        }
    }

    /// A step in depth a quarter from the left: by hand, 40 of 160 columns are nearer.
    #[test]
    fn a_depth_picture_of_any_size_becomes_a_grid_that_shows_the_same() {
        for (width, height) in [(256_u32, 144_u32), (640, 480), (160, 90), (40, 30), (100, 400)] {
            let floats = (0..width * height).map(|i| if i % width < width / 4 { 2.0 } else { 8.0 }).collect();
            let mut eye = DepthEye::new(&Camera::quad(), 3);
            let grid = eye.measure(&image(width, height, Vec::new(), floats), Time::from_millis(7)).unwrap();
            assert_eq!((grid.check(), grid.captured, grid.counter), (Ok(()), Time::from_millis(7), 0));
            let columns = grid.camera.width as usize;
            let mean = |from: usize, to: usize| {
                let part: Vec<f64> = grid
                    .cm
                    .iter()
                    .enumerate()
                    .filter(|(i, cm)| **cm > 0 && (from..to).contains(&(i % columns)))
                    .map(|(_, cm)| f64::from(*cm))
                    .collect();
                part.iter().sum::<f64>() / part.len() as f64
            };
            let (near, far) = (mean(0, columns / 4 - 2), mean(columns / 4 + 2, columns));
            assert!((near - 200.0).abs() < 3.0 && (far - 800.0).abs() < 8.0, "{width}×{height}: {near} {far}");
            let fov = 2.0 * libm::atan(0.5 * f64::from(grid.camera.width) / grid.camera.fx);
            assert!((fov.to_degrees() - 90.0).abs() < 1e-9, "{width}×{height}: {fov}");
        }
    }

    #[test]
    fn the_sky_gives_no_depth() {
        let mut eye = DepthEye::new(&Camera::quad(), 3);
        let grid = eye.measure(&image(16, 9, Vec::new(), vec![65504.0; 144]), Time::ZERO).unwrap();
        assert!(grid.cm.iter().all(|cm| *cm == 0));
    }
}
