//! Uncompressed images of webcams: YUYV (4:2:2, four bytes for two pixels). No I/O.
//!
//! Colours are read as limited-range BT.601, as the kernel says of cameras that do not say anything else (the defaults of
//! `V4L2_COLORSPACE_SRGB`).

use spf_media::Rgb;

/// Bits behind the point of the factors.
const SHIFT: i32 = 16;

/// Length of an image, bytes; `None` if no image can have this size.
#[must_use]
pub fn length((width, height): (u32, u32)) -> Option<usize> {
    let pixels = usize::try_from(width).ok()?.checked_mul(usize::try_from(height).ok()?)?;
    (pixels > 0 && width % 2 == 0).then_some(())?;
    pixels.checked_mul(2)
}

/// The image in a buffer; `None` unless the buffer has the length of an image of this size.
#[must_use]
pub fn decode(buffer: &[u8], size: (u32, u32)) -> Option<Rgb> {
    if length(size) != Some(buffer.len()) {
        return None;
    }
    let mut pixels = Vec::with_capacity(buffer.len() / 2 * 3);
    let (pairs, _) = buffer.as_chunks::<4>();
    for &[first, u, second, v] in pairs {
        let (u, v) = (i32::from(u) - 128, i32::from(v) - 128);
        // ITU-R BT.601-7, 2.5: the factors times 65536, with half a step for rounding.
        let (red, green, blue) = (104_597 * v, -25_675 * u - 53_279 * v, 132_201 * u);
        for luma in [first, second] {
            let luma = 76_309 * (i32::from(luma) - 16) + (1 << (SHIFT - 1));
            pixels.extend([red, green, blue].map(|colour| ((luma + colour) >> SHIFT).clamp(0, 255) as u8));
        }
    }
    Rgb::from_raw(size.0, size.1, pixels).ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn colours_worked_by_hand() {
        // White and black; red (81, 90, 240), green (145, 54, 34) and blue (41, 240, 110) of BT.601.
        let buffer = [235, 128, 16, 128, 81, 90, 81, 240, 145, 54, 145, 34, 41, 240, 41, 110];
        let image = decode(&buffer, (4, 2)).unwrap();
        let near = |x, y, colour: [u8; 3]| {
            let found = image.pixel(x, y).unwrap();
            assert!(found.iter().zip(colour).all(|(found, wanted)| found.abs_diff(wanted) <= 1), "{x},{y}: {found:?}");
        };
        near(0, 0, [255, 255, 255]);
        near(1, 0, [0, 0, 0]);
        near(3, 0, [254, 0, 0]);
        near(0, 1, [0, 255, 1]);
        near(2, 1, [0, 0, 255]);
    }

    #[test]
    fn a_buffer_of_another_length_is_no_image() {
        assert_eq!(length((640, 480)), Some(614_400));
        for (bytes, size) in [(15, (4, 2)), (17, (4, 2)), (0, (0, 0)), (12, (3, 2)), (8, (u32::MAX - 1, u32::MAX))] {
            assert_eq!(decode(&vec![128; bytes], size), None, "{bytes} {size:?}");
        }
    }

    proptest! {
        #[test]
        fn any_buffer_is_an_image_or_refused(buffer in proptest::collection::vec(any::<u8>(), 0..200), width in 0_u32..20, height in 0_u32..12) {
            let image = decode(&buffer, (width, height));
            prop_assert_eq!(image.is_some(), length((width, height)) == Some(buffer.len()));
        }
    }
}
