//! Pixels as an X11 server sends them.

use spf_media::Rgb;

/// The order of the bytes of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Where red, green and blue are among its four bytes.
    offsets: [usize; 3],
}

impl Layout {
    /// The layout with these masks of red, green and blue in a pixel of 32 bits; `None` if a colour is not one whole byte.
    #[must_use]
    pub fn of(masks: [u32; 3], most_significant_first: bool) -> Option<Self> {
        let mut offsets = [0; 3];
        for (offset, mask) in offsets.iter_mut().zip(masks) {
            let byte = (mask.trailing_zeros() / 8) as usize;
            if mask == 0 || mask.trailing_zeros() % 8 != 0 || mask >> (8 * byte) != 0xff {
                return None;
            }
            *offset = if most_significant_first { 3 - byte } else { byte };
        }
        Some(Self { offsets })
    }

    /// The image of these bytes, four a pixel; `None` if their number is not that of the size.
    #[must_use]
    pub fn image(&self, bytes: &[u8], (width, height): (u32, u32)) -> Option<Rgb> {
        let count = (width as usize).checked_mul(height as usize)?;
        if bytes.len() != count.checked_mul(4)? {
            return None;
        }
        let [red, green, blue] = self.offsets;
        let mut data = vec![0; count * 3];
        for (pixel, from) in data.as_chunks_mut::<3>().0.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *pixel = [from[red], from[green], from[blue]];
        }
        Rgb::from_raw(width, height, data).ok()
    }

    /// The bytes of an image, four a pixel, into a buffer; what does not fit in it is left out.
    pub fn bytes(&self, image: &Rgb, bytes: &mut [u8]) {
        let [red, green, blue] = self.offsets;
        for (to, pixel) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(image.data().as_chunks::<3>().0) {
            (to[red], to[green], to[blue]) = (pixel[0], pixel[1], pixel[2]);
        }
    }
}

/// The size of a picture whose long side is at most `most`, in the shape of another size; sides are even.
#[must_use]
pub fn limited((width, height): (u32, u32), most: u32) -> (u32, u32) {
    let long = width.max(height);
    if long <= most {
        return (width, height);
    }
    let scaled = |side: u32| ((u64::from(side) * u64::from(most) / u64::from(long)) as u32).max(2) & !1;
    (scaled(width), scaled(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hand_worked_layouts() {
        let usual = Layout::of([0x00ff_0000, 0x0000_ff00, 0x0000_00ff], false).unwrap();
        assert_eq!(usual.image(&[3, 2, 1, 0, 6, 5, 4, 0], (2, 1)).unwrap().data(), [1, 2, 3, 4, 5, 6]);
        let other = Layout::of([0x00ff_0000, 0x0000_ff00, 0x0000_00ff], true).unwrap();
        assert_eq!(other.image(&[0, 1, 2, 3], (1, 1)).unwrap().data(), [1, 2, 3]);
        let mut bytes = [9; 4];
        usual.bytes(&Rgb::filled(1, 1, [1, 2, 3]), &mut bytes);
        assert_eq!(bytes, [3, 2, 1, 9]);
        assert!(usual.image(&[0; 7], (2, 1)).is_none());
        // 16 bits a pixel, and ten bits a colour.
        assert!(Layout::of([0xf800, 0x07e0, 0x001f], false).is_none());
        assert!(Layout::of([0x3ff0_0000, 0x000f_fc00, 0x0000_03ff], false).is_none());
    }

    #[test]
    fn large_pictures_are_limited_in_their_shape() {
        assert_eq!(limited((960, 720), 960), (960, 720));
        assert_eq!(limited((1920, 1080), 960), (960, 540));
        assert_eq!(limited((3840, 2160), 960), (960, 540));
        assert_eq!(limited((1000, 3), 960), (960, 2));
    }
}
