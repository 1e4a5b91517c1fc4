//! Caches which triangles belong to one smooth surface, since edge pixels query the same pairs repeatedly.

use super::raster::NONE;
use super::shade::Shader;

/// Number of cached answers, a power of two.
const KEPT: usize = 256;

/// Cached answers about pairs of triangles in one image.
#[derive(Debug)]
pub(crate) struct Joins {
    answers: Vec<(u32, u32, bool)>,
}

impl Default for Joins {
    fn default() -> Self {
        Self { answers: vec![(NONE, NONE, true); KEPT] }
    }
}

impl Joins {
    /// True if the common edge of two triangles is not visible.
    #[inline]
    pub(crate) fn continuous(&mut self, shader: &Shader<'_>, a: u32, b: u32) -> bool {
        if a == b || a == NONE || b == NONE {
            return a == b;
        }
        let (a, b) = (a.min(b), a.max(b));
        let slot = &mut self.answers[(a.wrapping_mul(0x9e37_79b1) ^ b.wrapping_mul(0x85eb_ca77)) as usize >> 8 & (KEPT - 1)];
        if (slot.0, slot.1) != (a, b) {
            *slot = (a, b, shader.joined(a, b));
        }
        slot.2
    }
}
