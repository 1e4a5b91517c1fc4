//! The tables of ITU-T T.81 Annex K, which every decoder accepts, and values derived from them.

/// Coefficients of a block.
pub(super) const BLOCK: usize = 64;

/// The row-major position of each coefficient in file order.
pub(super) const ZIGZAG: [u8; BLOCK] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7, 14, 21, 28, 35, 42,
    49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
];

/// Quantisation steps of luma at quality 50, row by row (table K.1).
const LUMA_STEPS: [u8; BLOCK] = [
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51, 87, 80,
    62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98,
    112, 100, 103, 99,
];

/// Quantisation steps of chroma at quality 50, row by row (table K.2).
const CHROMA_STEPS: [u8; BLOCK] = [
    17, 18, 24, 47, 99, 99, 99, 99, 18, 21, 26, 66, 99, 99, 99, 99, 24, 26, 56, 99, 99, 99, 99, 99, 47, 66, 99, 99, 99, 99, 99,
    99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99,
    99, 99,
];

/// Divisors of the coefficients, row by row.
pub(super) struct Steps {
    pub(super) luma: [u8; BLOCK],
    pub(super) chroma: [u8; BLOCK],
}

impl Steps {
    /// The divisors for a quality of 1..=100, by the scaling introduced by the Independent JPEG Group.
    pub(super) fn of(quality: u8) -> Self {
        let quality = u32::from(quality);
        let percent = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
        let scaled = |steps: [u8; BLOCK]| steps.map(|step| ((u32::from(step) * percent + 50) / 100).clamp(1, 255) as u8);
        Self { luma: scaled(LUMA_STEPS), chroma: scaled(CHROMA_STEPS) }
    }
}

/// A Huffman table as stored in a file.
pub(super) struct Specification {
    /// Number of codes of each length from 1 to 16 bits.
    pub(super) counts: [u8; 16],
    /// Their symbols, shortest code first.
    pub(super) symbols: &'static [u8],
}

/// Table K.3.
pub(super) const LUMA_DC: Specification =
    Specification { counts: [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0], symbols: &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11] };

/// Table K.4.
pub(super) const CHROMA_DC: Specification =
    Specification { counts: [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0], symbols: &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11] };

/// Table K.5.
pub(super) const LUMA_AC: Specification = Specification {
    counts: [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125],
    symbols: &[
        0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22, 0x71, 0x14, 0x32,
        0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16,
        0x17, 0x18, 0x19, 0x1a, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45,
        0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69,
        0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94,
        0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6,
        0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8,
        0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8,
        0xf9, 0xfa,
    ],
};

/// Table K.6.
pub(super) const CHROMA_AC: Specification = Specification {
    counts: [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 119],
    symbols: &[
        0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13, 0x22, 0x32, 0x81,
        0x08, 0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33, 0x52, 0xf0, 0x15, 0x62, 0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34,
        0xe1, 0x25, 0xf1, 0x17, 0x18, 0x19, 0x1a, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44,
        0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68,
        0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92,
        0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4,
        0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6,
        0xd7, 0xd8, 0xd9, 0xda, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8,
        0xf9, 0xfa,
    ],
};

/// A code of a Huffman table.
#[derive(Clone, Copy)]
pub(super) struct Code {
    /// Its bits, the first one highest.
    pub(super) bits: u16,
    /// Its length; 0 if there is no code.
    pub(super) length: u8,
}

/// The code of each symbol.
pub(super) struct Codes([Code; 256]);

impl Codes {
    const fn of(specification: &Specification) -> Self {
        let mut codes = [Code { bits: 0, length: 0 }; 256];
        let (mut next, mut symbol, mut length) = (0, 0, 0);
        while length < 16 {
            let mut left = specification.counts[length];
            while left > 0 {
                codes[specification.symbols[symbol] as usize] = Code { bits: next, length: length as u8 + 1 };
                (next, symbol, left) = (next + 1, symbol + 1, left - 1);
            }
            // After the last code of 16 bits no space is needed.
            next = next.wrapping_shl(1);
            length += 1;
        }
        Self(codes)
    }

    /// The code of a symbol.
    #[inline(always)]
    pub(super) const fn get(&self, symbol: u8) -> Code {
        self.0[symbol as usize]
    }
}

/// The codes for one kind of blocks.
pub(super) struct Alphabet {
    pub(super) dc: Codes,
    pub(super) ac: Codes,
}

/// Of brightness.
pub(super) static LUMA: Alphabet = Alphabet { dc: Codes::of(&LUMA_DC), ac: Codes::of(&LUMA_AC) };
/// Of colour.
pub(super) static CHROMA: Alphabet = Alphabet { dc: Codes::of(&CHROMA_DC), ac: Codes::of(&CHROMA_AC) };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_comes_once() {
        let mut places = ZIGZAG;
        places.sort_unstable();
        assert!(places.iter().enumerate().all(|(index, place)| index == usize::from(*place)));
    }

    /// Codes printed in Annex K: end of block, run of 16, and the last one.
    #[test]
    fn codes_are_those_of_the_standard() {
        let code = |codes: &Codes, symbol| (codes.get(symbol).bits, codes.get(symbol).length);
        assert_eq!(code(&LUMA.ac, 0x00), (0b1010, 4));
        assert_eq!(code(&LUMA.ac, 0xf0), (0b111_1111_1001, 11));
        assert_eq!(code(&LUMA.ac, 0xfa), (0xfffe, 16));
        assert_eq!(code(&CHROMA.ac, 0x00), (0b00, 2));
        assert_eq!(code(&CHROMA.ac, 0xf0), (0b11_1111_1010, 10));
        assert_eq!(code(&LUMA.dc, 11), (0b1_1111_1110, 9));
        assert_eq!(code(&CHROMA.dc, 11), (0b111_1111_1110, 11));
    }

    #[test]
    fn steps_scale_with_quality() {
        assert_eq!(Steps::of(50).luma, LUMA_STEPS);
        assert_eq!(Steps::of(100).chroma, [1; BLOCK]);
        assert_eq!((Steps::of(75).luma[0], Steps::of(25).luma[0], Steps::of(1).luma[0]), (8, 32, 255));
    }
}
