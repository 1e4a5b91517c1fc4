//! JPEG images of webcams, without those from which bytes are missing. No I/O.
//!
//! A webcam sends a JPEG file in many small packets. Decoders paint what is missing grey, or as noise, so that others still show
//! something; for a pilot that is worse than no image.

use spf_media::Rgb;
use spf_media::jpeg::with_huffman_tables;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::decode::LIMITS;
use crate::mjpeg::is_whole;

/// Decodes the JPEG file in a webcam's buffer, with the Huffman tables of the standard if it has none; `None` unless its coded data
/// reach from the first row to the last. What they are short of by less than the last row of blocks is not seen, and in a file with
/// restart markers only what is missing at its end is.
#[must_use]
pub fn decode(buffer: &[u8]) -> Option<Rgb> {
    if !is_whole(buffer) {
        return None;
    }
    let file = with_huffman_tables(buffer);
    let end = file.iter().rposition(|byte| *byte != 0)?;
    // Behind the last marker the decoder would go on with zeros; where the bytes end, it says that they are too few.
    let coded = file.get(..end.checked_sub(1)?)?;
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(LIMITS.side as usize)
        .set_max_height(LIMITS.side as usize)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(coded), options);
    decoder.decode_headers().ok()?;
    let (width, height) = decoder.dimensions()?;
    if width as u64 * height as u64 > LIMITS.pixels {
        return None;
    }
    let pixels = decoder.decode().ok()?;
    Rgb::from_raw(u32::try_from(width).ok()?, u32::try_from(height).ok()?, pixels).ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_media::Jpeg;

    use super::*;

    fn file(size: (u32, u32)) -> Vec<u8> {
        let mut image = Rgb::new(size.0, size.1);
        for (index, byte) in image.data_mut().iter_mut().enumerate() {
            *byte = (index * 7 % 251) as u8;
        }
        Jpeg::encode(&image, 80).unwrap().bytes().to_vec()
    }

    #[test]
    fn an_even_image_is_whole() {
        // Its rows take as few bytes as those of any image.
        for grey in [0, 128, 255] {
            let file = Jpeg::encode(&Rgb::filled(160, 120, [grey; 3]), 80).unwrap();
            assert_eq!(decode(file.bytes()).unwrap().width(), 160);
            assert_eq!(decode(&[file.bytes(), &[0; 300]].concat()).unwrap().height(), 120);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_bytes_panic(at in 0_usize..4000, length in 0_usize..4000, bytes in proptest::collection::vec(any::<u8>(), 0..30)) {
            let mut file = file((48, 32));
            let at = at.min(file.len());
            file.splice(at..(at + length).min(file.len()), bytes);
            prop_assert!(decode(&file).is_none_or(|image| image.data().len() == 3 * image.width() as usize * image.height() as usize));
        }
    }
}
