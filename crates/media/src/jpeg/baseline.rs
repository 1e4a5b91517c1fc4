//! Writes a baseline JPEG file (ITU-T T.81, JFIF 1.02): headers, then the image in tiles.

use fearless_simd::{Level, Simd};

use super::colour;
use super::entropy::Bits;
use super::tables::{self, Alphabet, BLOCK, Specification, Steps, ZIGZAG};
use super::transform::{self, Divisors};
use crate::frame::Rgb;

/// Chroma subsampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sampling {
    /// None: 4:4:4.
    Full,
    /// Two by two: 4:2:0.
    Halved,
}

impl Sampling {
    /// Side of a tile, pixels.
    const fn tile(self) -> usize {
        match self {
            Self::Full => 8,
            Self::Halved => 16,
        }
    }

    /// The component of each block of a tile.
    const fn components(self) -> &'static [usize] {
        match self {
            Self::Full => &[0, 1, 2],
            Self::Halved => &[0, 0, 0, 0, 1, 2],
        }
    }
}

/// Maximum side of a tile, pixels.
const LONGEST_TILE: usize = 16;
/// Estimated size of the headers, bytes.
const HEADERS: usize = 640;

/// Encodes an image of `sides` pixels, none of them zero. `level` selects the machine's instructions, which does not
/// affect the bytes.
pub(super) fn encode(image: &Rgb, sides: (u16, u16), quality: u8, sampling: Sampling, level: Level) -> Vec<u8> {
    let steps = Steps::of(quality);
    // A typical size; larger files grow the buffer.
    let mut file = Vec::with_capacity(HEADERS + image.data().len() / 12);
    headers(&mut file, sides, &steps, sampling);
    let mut file = scanned(image, &steps, sampling, level, file);
    file.extend_from_slice(&[0xff, 0xd9]);
    file
}

/// Writes a segment: marker, length, contents.
fn segment(file: &mut Vec<u8>, marker: u8, parts: &[&[u8]]) {
    let length = 2 + parts.iter().map(|part| part.len()).sum::<usize>();
    file.extend_from_slice(&[0xff, marker, (length >> 8) as u8, length as u8]);
    parts.iter().for_each(|part| file.extend_from_slice(part));
}

fn headers(file: &mut Vec<u8>, (width, height): (u16, u16), steps: &Steps, sampling: Sampling) {
    file.extend_from_slice(&[0xff, 0xd8]);
    // Version 1.02, an aspect of one to one, no thumbnail.
    segment(file, 0xe0, &[b"JFIF\0", &[1, 2, 0, 0, 1, 0, 1, 0, 0]]);
    for (number, steps) in [&steps.luma, &steps.chroma].into_iter().enumerate() {
        segment(file, 0xdb, &[&[number as u8], &ZIGZAG.map(|place| steps[usize::from(place)])]);
    }
    let luma = if sampling == Sampling::Halved { 0x22 } else { 0x11 };
    let components = [3, 1, luma, 0, 2, 0x11, 1, 3, 0x11, 1];
    segment(file, 0xc0, &[&[8], &height.to_be_bytes(), &width.to_be_bytes(), &components]);
    huffman_tables(file);
    segment(file, 0xda, &[&[3, 1, 0x00, 2, 0x11, 3, 0x11, 0, 63, 0]]);
}

/// The tables of Annex K, as segments of a file.
pub(super) fn huffman_tables(file: &mut Vec<u8>) {
    let codes = [(0x00, &tables::LUMA_DC), (0x10, &tables::LUMA_AC), (0x01, &tables::CHROMA_DC), (0x11, &tables::CHROMA_AC)];
    for (number, Specification { counts, symbols }) in codes {
        segment(file, 0xc4, &[&[number], counts, symbols]);
    }
}

/// The scan, compiled for AVX2 and for the architecture's baseline; more variants would not be worth their compile
/// time.
#[cfg(target_arch = "x86_64")]
fn scanned(image: &Rgb, steps: &Steps, sampling: Sampling, level: Level, file: Vec<u8>) -> Vec<u8> {
    if let Some(simd) = level.as_avx2() {
        return simd.vectorize(
            #[inline(always)]
            || scan(simd, image, steps, sampling, file),
        );
    }
    let simd = level.as_sse2().expect("the architecture has SSE2");
    simd.vectorize(
        #[inline(always)]
        || scan(simd, image, steps, sampling, file),
    )
}

/// The scan with the machine's vector instructions.
#[cfg(not(target_arch = "x86_64"))]
fn scanned(image: &Rgb, steps: &Steps, sampling: Sampling, level: Level, file: Vec<u8>) -> Vec<u8> {
    fearless_simd::dispatch!(level, simd => scan(simd, image, steps, sampling, file))
}

/// All tiles, row by row.
#[inline(always)]
fn scan<S: Simd>(simd: S, image: &Rgb, steps: &Steps, sampling: Sampling, file: Vec<u8>) -> Vec<u8> {
    let (luma, chroma) = (Divisors::of(&steps.luma), Divisors::of(&steps.chroma));
    let kinds: [(&Divisors, &Alphabet); 3] = [(&luma, &tables::LUMA), (&chroma, &tables::CHROMA), (&chroma, &tables::CHROMA)];
    let (width, height, tile) = (image.width() as usize, image.height() as usize, sampling.tile());
    let mut bits = Bits::new(file);
    let (mut samples, mut coefficients) = ([[0; BLOCK]; 6], [0; BLOCK]);
    let mut padded = [0; LONGEST_TILE * LONGEST_TILE * 3];
    let mut before = [0; 3];
    for y in (0..height).step_by(tile) {
        for x in (0..width).step_by(tile) {
            let (bytes, stride) = if x + tile <= width && y + tile <= height {
                (&image.data()[(y * width + x) * 3..], width * 3)
            } else {
                pad(image, (x, y), tile, &mut padded);
                (&padded[..], tile * 3)
            };
            match sampling {
                Sampling::Full => colour::full(simd, bytes, stride, &mut samples),
                Sampling::Halved => colour::halved(simd, bytes, stride, &mut samples),
            }
            for (samples, &component) in samples.iter().zip(sampling.components()) {
                let (divisors, alphabet) = kinds[component];
                let found = transform::quantised(simd, samples, divisors, &mut coefficients);
                bits.block(&coefficients, found, &mut before[component], alphabet);
            }
        }
    }
    bits.finish()
}

/// A tile that extends beyond the right or lower edge; edge pixels are repeated, which needs the fewest bits.
fn pad(image: &Rgb, (x, y): (usize, usize), tile: usize, into: &mut [u8]) {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let inside = tile.min(width - x) * 3;
    for (row, into) in into.chunks_exact_mut(tile * 3).take(tile).enumerate() {
        let from = ((y + row).min(height - 1) * width + x) * 3;
        let (kept, repeated) = into.split_at_mut(inside);
        kept.copy_from_slice(&image.data()[from..from + inside]);
        let last = &kept[inside - 3..];
        repeated.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(last));
    }
}
