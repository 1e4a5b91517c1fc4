//! A clock that a camera can read: the time in milliseconds as a QR code, on a terminal or in an image.
//!
//! Filmed by a camera, it tells the delay from the code's appearance to the arrival of the frame that shows it.

use qrcode::types::QrError;
use qrcode::{Color, EcLevel, QrCode, Version};
use spf_media::Rgb;

/// Modules per side, without the quiet zone.
const SIDE: usize = 21;
/// White modules around the code that readers need (ISO/IEC 18004).
const QUIET: usize = 4;
/// Modules per side with the quiet zone.
pub const MODULES: usize = SIDE + 2 * QUIET;
/// Begins the digits, so that another QR code in the image is not taken for the clock.
const MARK: &str = "77317";
/// Digits of the time: 31 years.
const DIGITS: usize = 12;

/// The code of a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClockCode {
    /// Whether a module is dark, row by row, with the quiet zone.
    dark: Vec<bool>,
}

impl ClockCode {
    /// The code of a time in milliseconds, of which the last twelve digits count.
    ///
    /// # Panics
    /// Never: seventeen digits are what the smallest code holds at the highest error correction.
    #[must_use]
    pub fn of(millis: u64) -> Self {
        let digits = format!("{MARK}{:0DIGITS$}", millis % 10_u64.pow(DIGITS as u32));
        Self::encode(&digits).unwrap_or_else(|error| unreachable!("{digits}: {error}"))
    }

    fn encode(digits: &str) -> Result<Self, QrError> {
        let code = QrCode::with_version(digits, Version::Normal(1), EcLevel::H)?;
        let mut dark = vec![false; MODULES * MODULES];
        for (index, colour) in code.to_colors().into_iter().enumerate() {
            let (row, column) = (index / SIDE + QUIET, index % SIDE + QUIET);
            dark[row * MODULES + column] = colour == Color::Dark;
        }
        Ok(Self { dark })
    }

    fn is_dark(&self, column: usize, row: usize) -> bool {
        self.dark.get(row * MODULES + column).is_some_and(|dark| *dark)
    }

    /// Its lines for a terminal, two rows of modules each; a character cell is twice as high as wide. Colours are not set: the
    /// text must be black on white.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        (0..MODULES).step_by(2).map(|row| {
            let cell = |column| match (self.is_dark(column, row), self.is_dark(column, row + 1)) {
                (true, true) => '█',
                (true, false) => '▀',
                (false, true) => '▄',
                (false, false) => ' ',
            };
            (0..MODULES).map(cell).collect()
        })
    }

    /// Draws it into an image; `size` is that of a module, in pixels.
    pub fn draw(&self, image: &mut Rgb, left: u32, top: u32, size: u32) {
        let side = MODULES as u32 * size;
        for y in 0..side.min(image.height().saturating_sub(top)) {
            for x in 0..side.min(image.width().saturating_sub(left)) {
                let dark = self.is_dark((x / size) as usize, (y / size) as usize);
                image.set_pixel(left + x, top + y, if dark { [0; 3] } else { [255; 3] });
            }
        }
    }
}

/// The time in milliseconds that a clock in an image shows; `None` if there is none that can be read.
#[must_use]
pub fn read(image: &Rgb) -> Option<u64> {
    let (width, data) = (image.width() as usize, image.data());
    let luma = |x: usize, y: usize| {
        let [red, green, blue] = [0, 1, 2].map(|channel| data.get((y * width + x) * 3 + channel).copied().map_or(0, u32::from));
        ((213 * red + 715 * green + 72 * blue) / 1000) as u8
    };
    let mut prepared = rqrr::PreparedImage::prepare_from_greyscale(width, image.height() as usize, luma);
    prepared.detect_grids().iter().find_map(|grid| {
        let (_, text) = grid.decode().ok()?;
        text.strip_prefix(MARK).filter(|digits| digits.len() == DIGITS)?.parse().ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_clock_is_read_where_there_is_none() {
        assert_eq!(read(&Rgb::filled(320, 240, [90; 3])), None);
        assert_eq!(read(&Rgb::new(1, 1)), None);
        let mut image = Rgb::filled(200, 200, [255; 3]);
        ClockCode::encode("12345678901234567").unwrap().draw(&mut image, 0, 0, 5);
        assert_eq!(read(&image), None);
    }

    #[test]
    fn the_lines_of_a_terminal_show_the_code() {
        let code = ClockCode::of(1234);
        let lines: Vec<String> = code.lines().collect();
        assert_eq!(lines.len(), MODULES.div_ceil(2));
        let mut image = Rgb::filled(MODULES as u32 * 4, lines.len() as u32 * 8, [255; 3]);
        for (row, line) in (0..).zip(&lines) {
            for (column, cell) in (0..).zip(line.chars()) {
                for (half, dark) in [(0, "█▀".contains(cell)), (1, "█▄".contains(cell))] {
                    for pixel in 0..16 {
                        let (x, y) = (column * 4 + pixel % 4, row * 8 + half * 4 + pixel / 4);
                        if dark {
                            image.set_pixel(x, y, [0; 3]);
                        }
                    }
                }
            }
        }
        assert_eq!(read(&image), Some(1234));
    }

    /// Filmed: not at the edge of a pixel, with little contrast and noise. The reader does not find every code, but none is misread.
    #[test]
    fn nearly_all_that_is_drawn_is_read_and_nothing_is_misread() {
        let mut found = 0;
        for number in 0..80_u32 {
            let millis = u64::from(number) * 12_345_678_901;
            let mut image = Rgb::filled(320, 260, [200, 190, 180]);
            ClockCode::of(millis).draw(&mut image, number * 37 % 90, number * 11 % 40, 5 + number % 3);
            let dark = (number * 7 % 90) as u8;
            for (index, value) in image.data_mut().iter_mut().enumerate() {
                let noise = (index * 7919 % 31) as u8;
                *value = (*value / 3).saturating_add(dark).saturating_add(noise);
            }
            let seen = read(&spf_media::resize(&image, 303, 247));
            assert!(seen.is_none_or(|seen| seen == millis), "{seen:?} of {millis}");
            found += u32::from(seen.is_some());
        }
        assert!(found >= 68, "{found} of 80");
    }
}
