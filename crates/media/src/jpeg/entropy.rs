//! Entropy coding: coefficients to bits (ITU-T T.81 Annex F).

use super::tables::{Alphabet, BLOCK, Code};
use super::transform::FILE_ORDER;

/// Runs of zeros are encoded in pieces of sixteen.
const RUN: u32 = 16;
const SIXTEEN_ZEROS: u8 = 0xf0;
const END_OF_BLOCK: u8 = 0x00;

/// Pending bits that are not bytes yet.
pub(super) struct Bits {
    bytes: Vec<u8>,
    /// The lowest `waiting` bits are pending, fewer than 32 between calls.
    held: u64,
    waiting: u32,
}

impl Bits {
    /// Appends to a file.
    pub(super) fn new(bytes: Vec<u8>) -> Self {
        Self { bytes, held: 0, waiting: 0 }
    }

    /// Appends the lowest `length` bits, 32 at most; those above them are zero.
    #[inline(always)]
    fn put(&mut self, bits: u32, length: u32) {
        self.held = self.held << length | u64::from(bits);
        self.waiting += length;
        if self.waiting >= 32 {
            self.waiting -= 32;
            self.word((self.held >> self.waiting) as u32);
        }
    }

    #[inline(always)]
    fn word(&mut self, word: u32) {
        // True if a byte of its complement is zero.
        let stuffed = (!word).wrapping_sub(0x0101_0101) & word & 0x8080_8080 != 0;
        let bytes = word.to_be_bytes();
        if stuffed { bytes.iter().for_each(|byte| self.byte(*byte)) } else { self.bytes.extend_from_slice(&bytes) }
    }

    /// A byte of ones is followed by a zero, so that it is not mistaken for a marker.
    fn byte(&mut self, byte: u8) {
        self.bytes.push(byte);
        if byte == 0xff {
            self.bytes.push(0);
        }
    }

    /// The file so far; the last byte is padded with ones.
    pub(super) fn finish(mut self) -> Vec<u8> {
        let missing = self.waiting.wrapping_neg() % 8;
        self.held = self.held << missing | ((1 << missing) - 1);
        self.waiting += missing;
        for byte in (0..self.waiting / 8).rev() {
            self.byte((self.held >> (byte * 8)) as u8);
        }
        self.bytes
    }

    /// A coefficient: a code for its number of bits (and the preceding zeros), then those bits.
    #[inline(always)]
    fn coefficient(&mut self, code: Code, value: i32, size: u32) {
        // Negative numbers are encoded relative to the next lower power of two.
        let bits = (value + (value >> 31)) as u32 & ((1 << size) - 1);
        self.put(u32::from(code.bits) << size | bits, u32::from(code.length) + size);
    }

    /// Appends a block. `found` has a bit for each nonzero coefficient; the first coefficient is encoded as the
    /// difference from that of the previous block.
    #[inline(always)]
    pub(super) fn block(&mut self, coefficients: &[i32; BLOCK], found: u64, before: &mut i32, alphabet: &Alphabet) {
        let difference = coefficients[0] - core::mem::replace(before, coefficients[0]);
        let size = bits_of(difference);
        self.coefficient(alphabet.dc.get(size as u8), difference, size);

        let (mut ordered, mut order) = ([0; BLOCK], 0_u64);
        let mut left = found & !1;
        while left != 0 {
            let at = left.trailing_zeros() as usize % BLOCK;
            let place = usize::from(FILE_ORDER[at]) % BLOCK;
            ordered[place] = coefficients[at];
            order |= 1 << place;
            left &= left - 1;
        }
        let mut next = 1;
        while order != 0 {
            let place = order.trailing_zeros();
            let mut run = place - next;
            while run >= RUN {
                let code = alphabet.ac.get(SIXTEEN_ZEROS);
                self.put(u32::from(code.bits), u32::from(code.length));
                run -= RUN;
            }
            let value = ordered[place as usize % BLOCK];
            let size = bits_of(value);
            self.coefficient(alphabet.ac.get((run << 4 | size) as u8), value, size);
            next = place + 1;
            order &= order - 1;
        }
        if next < BLOCK as u32 {
            let code = alphabet.ac.get(END_OF_BLOCK);
            self.put(u32::from(code.bits), u32::from(code.length));
        }
    }
}

/// Number of bits of a coefficient.
#[inline(always)]
fn bits_of(value: i32) -> u32 {
    u32::BITS - value.unsigned_abs().leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_ones_are_stuffed() {
        let mut bits = Bits::new(vec![7]);
        bits.put(0x0012_ff34, 32);
        bits.put(0x1, 1);
        assert_eq!(bits.finish(), [7, 0x00, 0x12, 0xff, 0x00, 0x34, 0xff, 0x00]);
        let mut whole = Bits::new(Vec::new());
        whole.put(0xa5, 8);
        assert_eq!(whole.finish(), [0xa5]);
    }

    /// The detection of bytes of ones must find them at every position, and nothing else in words without any.
    #[test]
    fn no_byte_of_ones_stays_alone() {
        for word in [0xff00_0000_u32, 0x00ff_0000, 0xff00, 0xff, 0xffff_ffff, 0xfe01_0180, 0x8080_8080, 0x01fe_ff02] {
            let mut bits = Bits::new(Vec::new());
            bits.put(word, 32);
            let expected: Vec<u8> =
                word.to_be_bytes().into_iter().flat_map(|byte| if byte == 0xff { vec![byte, 0] } else { vec![byte] }).collect();
            assert_eq!(bits.finish(), expected, "{word:08x}");
        }
    }
}
