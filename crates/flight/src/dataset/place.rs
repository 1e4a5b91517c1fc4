//! Whether words of place are plainly true of an image.

use spf_oracle::Mask;
use spf_render::Picture;
use spf_scene::geometry::ObjectId;

/// By so much of the image's width the leftmost must lie left of the next.
const APART: f64 = 0.03;
/// The nearest must be nearer by this share.
const NEARER: f64 = 0.85;

/// What is the leftmost, the rightmost or the nearest of several things is so by the middle of what is seen of them, and by the
/// range of their surfaces where they are seen best: not only by where their middles stand, which no image tells.
pub(super) struct Plainly<'a> {
    /// The masks of the image.
    pub(super) masks: &'a [Mask],
    /// Ids and depth, also of openings.
    pub(super) truth: &'a Picture,
}

impl Plainly<'_> {
    /// Whether `place` is plainly true of one thing among others like it.
    pub(super) fn holds(&self, place: &str, of: ObjectId, others: &[ObjectId]) -> bool {
        let others: Vec<&Mask> = others.iter().filter(|id| **id != of).filter_map(|id| self.mask(*id)).collect();
        let Some(own) = self.mask(of) else { return false };
        let width = f64::from(self.truth.width);
        let middle = |mask: &Mask| 0.5 * (mask.left + mask.right) as f64 / width;
        match place {
            "leftmost" => others.iter().all(|other| middle(own) + APART < middle(other)),
            "rightmost" => others.iter().all(|other| middle(own) - APART > middle(other)),
            _ => self
                .range(own)
                .is_some_and(|near| others.iter().all(|other| self.range(other).is_some_and(|range| near < NEARER * range))),
        }
    }

    fn mask(&self, id: ObjectId) -> Option<&Mask> {
        self.masks.iter().find(|mask| mask.id == id)
    }

    /// Depth where the mask is deepest, metres.
    fn range(&self, mask: &Mask) -> Option<f64> {
        let at = mask.deepest.1 * self.truth.width as usize + mask.deepest.0;
        let is_solid = self.truth.ids.as_ref().and_then(|ids| ids.get(at)).is_some_and(|id| *id == mask.id);
        let depth = if is_solid { &self.truth.depth } else { &self.truth.opening_depth };
        depth.as_ref()?.get(at).map(|depth| f64::from(*depth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_oracle::masks;

    #[test]
    fn what_lies_close_beside_or_hardly_nearer_is_not_plain() {
        // Three things side by side, the left two hardly apart in depth.
        let ids: Vec<u16> = (0..2).flat_map(|_| (0..100).map(|x| [1, 2, 3][(x / 34) as usize])).collect();
        let depth: Vec<f32> = ids.iter().map(|id| [5.0, 5.5, 20.0][usize::from(*id) - 1]).collect();
        let truth = Picture { width: 100, height: 2, ids: Some(ids.clone()), depth: Some(depth), ..Picture::default() };
        let masks = masks(&ids, 100);
        let plainly = Plainly { masks: &masks, truth: &truth };
        let all = [1, 2, 3];
        assert!(plainly.holds("leftmost", 1, &all) && plainly.holds("rightmost", 3, &all));
        assert!(!plainly.holds("leftmost", 2, &all) && !plainly.holds("nearest", 1, &all));
        assert!(plainly.holds("nearest", 1, &[1, 3]) && !plainly.holds("nearest", 3, &[1, 3]));
        assert!(!plainly.holds("nearest", 9, &all), "it is not there");
    }
}
