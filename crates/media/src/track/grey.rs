//! Grey images and their pyramids, in integers.

use crate::frame::{FrameError, Rgb};

/// Number of fractional bits of an interpolated value.
pub const FRACTION: u32 = 5;
/// Bits of an interpolation weight.
const WEIGHT: u32 = 14;

/// A grey image of 8 bits, rows from the top.
#[derive(Clone, PartialEq, Eq)]
pub struct Grey {
    width: u32,
    height: u32,
    data: Vec<u8>,
}

impl core::fmt::Debug for Grey {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Grey({}×{})", self.width, self.height)
    }
}

impl Grey {
    /// The brightness of a colour image.
    pub fn of(image: &Rgb) -> Self {
        let brightness = |pixel: &[u8]| {
            let [red, green, blue] = [pixel[0], pixel[1], pixel[2]].map(u32::from);
            ((77 * red + 150 * green + 29 * blue + 128) >> 8) as u8
        };
        let data = image.data().chunks_exact(3).map(brightness).collect();
        Self { width: image.width(), height: image.height(), data }
    }

    /// An image from just as many bytes as it has pixels.
    pub fn of_bytes(width: u32, height: u32, data: Vec<u8>) -> Self {
        debug_assert_eq!(data.len(), width as usize * height as usize);
        Self { width, height, data }
    }

    /// An image from its bytes.
    ///
    /// # Errors
    /// [`FrameError::WrongLength`] if `data` is not `width × height` bytes long.
    pub fn from_raw(width: u32, height: u32, data: Vec<u8>) -> Result<Self, FrameError> {
        let needed = u64::from(width) * u64::from(height);
        if u64::try_from(data.len()) == Ok(needed) {
            Ok(Self { width, height, data })
        } else {
            Err(FrameError::WrongLength { width, height, needed, actual: data.len() })
        }
    }

    /// Width and height, pixels.
    pub const fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The bytes, in rows from the top.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// Half the size, smoothed with 1, 4, 6, 4, 1 in both directions. Pixel (x, y) lies on pixel (2x, 2y).
    fn halved(&self) -> Self {
        let (width, height) = (self.width as usize, self.height as usize);
        let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
        let mut data = Vec::with_capacity(half_width * half_height);
        // Two more on either side, as the edge goes on.
        let mut sums = vec![0_u16; width + 4];
        for y in 0..half_height {
            let row = |offset: isize| {
                let y = (2 * y).saturating_add_signed(offset).min(height - 1);
                &self.data[y * width..(y + 1) * width]
            };
            let rows = [row(-2), row(-1), row(0), row(1), row(2)];
            for (x, sum) in sums[2..width + 2].iter_mut().enumerate() {
                let [a, b, c, d, e] = rows.map(|row| u16::from(row[x]));
                *sum = a + e + 4 * (b + d) + 6 * c;
            }
            let (first, last) = (sums[2], sums[width + 1]);
            sums[..2].fill(first);
            sums[width + 2..].fill(last);
            data.extend(sums.windows(5).step_by(2).map(|sums| {
                let [a, b, c, d, e] = [sums[0], sums[1], sums[2], sums[3], sums[4]].map(u32::from);
                ((a + e + 4 * (b + d) + 6 * c + 128) >> 8) as u8
            }));
        }
        Self { width: half_width as u32, height: half_height as u32, data }
    }

    /// The value at a place, interpolated between four pixels, with [`FRACTION`] fractional bits. Outside the image the
    /// edge goes on.
    fn at(&self, column: Tap, row: Tap) -> i32 {
        let width = self.width as usize;
        let (above, below) = (&self.data[row.first * width..], &self.data[row.second * width..]);
        let value = |bytes: &[u8], at: usize| i32::from(bytes[at]);
        let [a, b] = [value(above, column.first), value(above, column.second)];
        let [c, d] = [value(below, column.first), value(below, column.second)];
        // 7 bits each: the products fit easily.
        let top = a * (128 - column.weight) + b * column.weight;
        let bottom = c * (128 - column.weight) + d * column.weight;
        (top * (128 - row.weight) + bottom * row.weight + (1 << (WEIGHT - FRACTION - 1))) >> (WEIGHT - FRACTION)
    }

    /// Samples the square of `side` × `side` pixels around a place, in its own resolution.
    pub fn square(&self, (x, y): (f64, f64), side: usize, into: &mut [i32]) {
        let half = (side / 2) as f64;
        let (left, top) = (x - half, y - half);
        let (width, height) = (self.width as usize, self.height as usize);
        let fits = left >= 0.0
            && top >= 0.0
            && left + (side as f64) < f64::from(self.width)
            && top + (side as f64) < f64::from(self.height);
        if !fits {
            for (row, values) in into.chunks_exact_mut(side).enumerate() {
                let row = Tap::at(top + row as f64, height);
                for (column, value) in values.iter_mut().enumerate() {
                    *value = self.at(Tap::at(left + column as f64, width), row);
                }
            }
            return;
        }
        let (column, row) = (Tap::at(left, width), Tap::at(top, height));
        let (fx, fy) = (column.weight, row.weight);
        let [w00, w10, w01, w11] = [(128 - fx) * (128 - fy), fx * (128 - fy), (128 - fx) * fy, fx * fy];
        for (number, values) in into.chunks_exact_mut(side).enumerate() {
            let at = (row.first + number) * width + column.first;
            let (above, below) = (&self.data[at..=at + side], &self.data[at + width..=at + width + side]);
            for ((value, above), below) in values.iter_mut().zip(above.windows(2)).zip(below.windows(2)) {
                let [a, b, c, d] = [above[0], above[1], below[0], below[1]].map(i32::from);
                *value = (a * w00 + b * w10 + c * w01 + d * w11 + (1 << (WEIGHT - FRACTION - 1))) >> (WEIGHT - FRACTION);
            }
        }
    }

    /// Samples a grid of `columns` × `rows` places.
    pub fn grid(&self, columns: &[Tap], rows: &[Tap], into: &mut [i32]) {
        for (row, values) in rows.iter().zip(into.chunks_exact_mut(columns.len())) {
            for (column, value) in columns.iter().zip(values) {
                *value = self.at(*column, *row);
            }
        }
    }
}

/// Two neighbouring pixels of a row or column, and the second one's weight in 1/128.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tap {
    first: usize,
    second: usize,
    weight: i32,
}

impl Tap {
    /// The pixels about a coordinate among `length` pixels; the centre of the first one is 0.
    pub fn at(coordinate: f64, length: usize) -> Self {
        let last = length.saturating_sub(1);
        let place = coordinate.clamp(0.0, last as f64);
        let first = place as usize;
        Self { first, second: (first + 1).min(last), weight: ((place - first as f64) * 128.0 + 0.5) as i32 }
    }
}

/// An image in falling sizes, each half of the one before.
#[derive(Clone, Debug)]
pub struct Pyramid {
    levels: Vec<Grey>,
}

impl Pyramid {
    /// The largest number of levels.
    const LEVELS: usize = 5;

    /// Halves the image until a side would be below 24 pixels.
    pub fn of(image: &Grey) -> Self {
        let mut levels = vec![image.clone()];
        while levels.len() < Self::LEVELS
            && let Some(last) = levels.last()
            && last.width.min(last.height) >= 48
        {
            levels.push(last.halved());
        }
        Self { levels }
    }

    /// A level; the coarsest one for a greater number.
    pub fn level(&self, number: usize) -> &Grey {
        &self.levels[number.min(self.levels.len() - 1)]
    }

    /// The coarsest level's number.
    pub fn top(&self) -> usize {
        self.levels.len() - 1
    }

    /// Width and height of the image, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.levels[0].size()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_of_pure_colours() {
        let image = Rgb::from_raw(5, 1, vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255, 0, 0, 0]).unwrap();
        // Rec. 601: 0.299, 0.587 and 0.114 of 255.
        assert_eq!(Grey::of(&image).data(), [77, 149, 29, 255, 0]);
        assert!(Grey::from_raw(3, 2, vec![0; 5]).is_err());
    }

    #[test]
    fn a_pyramid_keeps_a_slope_and_its_places() {
        let slope: Vec<u8> = (0..96 * 64).map(|at| (at % 96 * 2) as u8).collect();
        let pyramid = Pyramid::of(&Grey::from_raw(96, 64, slope).unwrap());
        assert_eq!((pyramid.top(), pyramid.level(1).size(), pyramid.level(9).size()), (1, (48, 32), (48, 32)));
        // Pixel 10 of the half lies on pixel 20, whose value is 40.
        assert_eq!(pyramid.level(1).data()[48 * 5 + 10], 40);
    }

    #[test]
    fn values_between_pixels() {
        let image = Grey::from_raw(2, 2, vec![0, 100, 50, 150]).unwrap();
        let at = |x: f64, y: f64| image.at(Tap::at(x, 2), Tap::at(y, 2));
        assert_eq!(at(0.5, 0.0), 50 * 32);
        assert_eq!(at(0.5, 0.5), 75 * 32);
        assert_eq!(at(9.0, -3.0), 100 * 32);
        let wide = Grey::from_raw(20, 20, (0..400).map(|at| (at * 7 % 251) as u8).collect()).unwrap();
        let (mut fast, mut slow) = ([0; 25], [0; 25]);
        wide.square((9.3, 8.8), 5, &mut fast);
        let taps = |from: f64| -> Vec<Tap> { (0..5).map(|n| Tap::at(from + f64::from(n), 20)).collect() };
        wide.grid(&taps(7.3), &taps(6.8), &mut slow);
        assert_eq!(fast, slow);
    }
}
