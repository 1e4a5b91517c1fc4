//! Instruments that a game draws over its picture: they are painted over, so that neither a model nor optical flow reads them.

use spf_media::Rgb;

use crate::area::{Area, Region};

/// Paints regions of an image over, each with the mean colour of the pixels around it.
pub fn paint_over(image: &mut Rgb, regions: &[Region]) {
    let whole = Area { x: 0, y: 0, width: image.width(), height: image.height() };
    for region in regions {
        let Area { x, y, width, height } = whole.part(region);
        if width > 0 && height > 0 {
            let colour = around(image, x as u32, y as u32, width, height);
            for row in y as u32..y as u32 + height {
                let start = (row as usize * whole.width as usize + x as usize) * 3;
                let pixels = &mut image.data_mut()[start..start + width as usize * 3];
                pixels.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&colour));
            }
        }
    }
}

/// Mean colour of the pixels next to a rectangle, or grey if it is the whole image.
fn around(image: &Rgb, x: u32, y: u32, width: u32, height: u32) -> [u8; 3] {
    let (mut sum, mut count) = ([0_u64; 3], 0);
    let mut add = |pixel: Option<[u8; 3]>| {
        if let Some(pixel) = pixel {
            sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += u64::from(value));
            count += 1;
        }
    };
    for column in x..x + width {
        add(y.checked_sub(1).and_then(|row| image.pixel(column, row)));
        add(image.pixel(column, y + height));
    }
    for row in y..y + height {
        add(x.checked_sub(1).and_then(|column| image.pixel(column, row)));
        add(image.pixel(x + width, row));
    }
    // Not the grey that decoders write for missing blocks.
    if count == 0 { [120; 3] } else { sum.map(|sum| (sum / count) as u8) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_masked_region_has_the_colour_around_it_and_the_rest_stays() {
        let mut image = Rgb::filled(40, 20, [10, 20, 30]);
        for x in 10..20 {
            (5..10).for_each(|y| image.set_pixel(x, y, [255, 0, 0]));
        }
        image.set_pixel(0, 0, [1, 2, 3]);
        paint_over(&mut image, &[Region([0.25, 0.25, 0.25, 0.25])]);
        assert_eq!((image.pixel(12, 7), image.pixel(0, 0)), (Some([10, 20, 30]), Some([1, 2, 3])));
        assert!(image.data().chunks_exact(3).all(|pixel| pixel != [255, 0, 0]));
        paint_over(&mut image, &[Region::WHOLE]);
        assert_eq!(image.pixel(39, 19), Some([120; 3]));
    }
}
