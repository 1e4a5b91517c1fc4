//! EXIF orientation (tag 0x112), and rotation of images according to it.

use crate::frame::Rgb;

/// How the rows and columns of a file map to the upright image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orientation {
    /// Rows of the file are columns of the image; the mirrors apply to the file.
    swapped: bool,
    /// The file's columns run from the right.
    from_right: bool,
    /// The file's rows run from the bottom.
    from_bottom: bool,
}

/// Tag number, and number of its type (16-bit integer).
const TAG: u16 = 0x112;
const SHORT: u16 = 3;

impl Orientation {
    /// The orientation in an EXIF block; upright if it has none.
    #[must_use]
    pub(super) fn of_exif(block: &[u8]) -> Self {
        find(block).and_then(Self::of_number).unwrap_or_default()
    }

    /// From EXIF's numbers.
    const fn of_number(number: u16) -> Option<Self> {
        let (swapped, from_right, from_bottom) = match number {
            1 => (false, false, false),
            2 => (false, true, false),
            3 => (false, true, true),
            4 => (false, false, true),
            5 => (true, false, false),
            6 => (true, false, true),
            7 => (true, true, true),
            8 => (true, true, false),
            _ => return None,
        };
        Some(Self { swapped, from_right, from_bottom })
    }

    /// That of a file which must be turned clockwise by this many quarter turns.
    #[must_use]
    pub const fn quarter_turns(clockwise: u8) -> Self {
        let (swapped, from_right, from_bottom) = match clockwise % 4 {
            0 => (false, false, false),
            1 => (true, false, true),
            2 => (false, true, true),
            _ => (true, true, false),
        };
        Self { swapped, from_right, from_bottom }
    }

    /// Width and height of the upright image, given those of the file.
    #[must_use]
    pub const fn turned_size(self, (width, height): (u32, u32)) -> (u32, u32) {
        if self.swapped { (height, width) } else { (width, height) }
    }

    /// The upright image.
    #[must_use]
    pub fn turned(self, image: Rgb) -> Rgb {
        if self == Self::default() {
            return image;
        }
        let (file_width, file_height) = (image.width(), image.height());
        let (width, height) = self.turned_size((file_width, file_height));
        let (pixels, _) = image.data().as_chunks::<3>();
        let mut turned = Vec::with_capacity(image.data().len());
        for y in 0..height {
            for x in 0..width {
                let (column, row) = if self.swapped { (y, x) } else { (x, y) };
                let column = if self.from_right { file_width - 1 - column } else { column };
                let row = if self.from_bottom { file_height - 1 - row } else { row };
                turned.extend_from_slice(&pixels[row as usize * file_width as usize + column as usize]);
            }
        }
        // One output pixel for each input pixel.
        Rgb::from_raw(width, height, turned).unwrap_or(image)
    }
}

/// The tag's value in the first directory of a block, which starts like a TIFF file.
fn find(block: &[u8]) -> Option<u16> {
    let big = match block.get(..4)? {
        [b'I', b'I', 42, 0] => false,
        [b'M', b'M', 0, 42] => true,
        _ => return None,
    };
    let short = |at: usize| {
        let bytes = block.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    };
    let long = |at: usize| {
        let (first, second) = (u32::from(short(at)?), u32::from(short(at.checked_add(2)?)?));
        Some(if big { first << 16 | second } else { second << 16 | first })
    };
    let directory = usize::try_from(long(4)?).ok()?;
    // An entry: tag, type, count, and a value of four bytes.
    let entries = (0..usize::from(short(directory)?)).map(|entry| directory + 2 + 12 * entry);
    for entry in entries {
        if (short(entry)?, short(entry + 2)?, long(entry + 4)?) == (TAG, SHORT, 1) {
            return short(entry + 8);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn block(big: bool, number: u16) -> Vec<u8> {
        let short = |value: u16| if big { value.to_be_bytes() } else { value.to_le_bytes() };
        let long = |value: u32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
        let mut block = if big { b"MM\0\x2a".to_vec() } else { b"II\x2a\0".to_vec() };
        block.extend(long(8));
        block.extend(short(2));
        for (tag, value) in [(0x10f, 7), (TAG, number)] {
            block.extend([short(tag), short(SHORT)].concat());
            block.extend(long(1));
            block.extend([short(value), [0; 2]].concat());
        }
        block
    }

    /// The orientations as shown in the standard: the corner of the letter, then its long side, from each number's
    /// first row and column.
    #[test]
    fn the_eight_orientations_worked_by_hand() {
        // 1 2 3
        // 4 5 6
        let image = Rgb::from_raw(3, 2, (1..=6).flat_map(|n| [n; 3]).collect()).unwrap();
        let turned = |number| {
            let turned = Orientation::of_exif(&block(number % 2 == 0, number)).turned(image.clone());
            (turned.width(), turned.data().iter().step_by(3).copied().collect::<Vec<_>>())
        };
        assert_eq!(turned(1), (3, vec![1, 2, 3, 4, 5, 6]));
        assert_eq!(turned(2), (3, vec![3, 2, 1, 6, 5, 4]));
        assert_eq!(turned(3), (3, vec![6, 5, 4, 3, 2, 1]));
        assert_eq!(turned(4), (3, vec![4, 5, 6, 1, 2, 3]));
        assert_eq!(turned(5), (2, vec![1, 4, 2, 5, 3, 6]));
        assert_eq!(turned(6), (2, vec![4, 1, 5, 2, 6, 3]));
        assert_eq!(turned(7), (2, vec![6, 3, 5, 2, 4, 1]));
        assert_eq!(turned(8), (2, vec![3, 6, 2, 5, 1, 4]));
        assert_eq!(turned(9), turned(1));
        for (turns, number) in (0..5).zip([1, 6, 3, 8, 1]) {
            assert_eq!(Orientation::quarter_turns(turns), Orientation::of_exif(&block(false, number)));
        }
    }

    proptest! {
        #[test]
        fn any_block_is_read(bytes in prop::collection::vec(any::<u8>(), 0..80), big in any::<bool>()) {
            let head: &[u8] = if big { b"MM\0\x2a\0\0\0\x08" } else { b"II\x2a\0\x08\0\0\0" };
            for block in [[head, &bytes].concat(), bytes] {
                prop_assert!([(3, 2), (2, 3)].contains(&Orientation::of_exif(&block).turned_size((3, 2))));
            }
        }
    }
}
