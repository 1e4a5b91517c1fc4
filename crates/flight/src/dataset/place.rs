//! Whether descriptions such as "leftmost" hold clearly in an image.

use spf_oracle::Mask;
use spf_render::RenderedImage;
use spf_scene::geometry::ObjectId;

/// Minimum distance of the leftmost object from the next, as a fraction of the image width.
const APART: f64 = 0.03;
/// Maximum range of the nearest object relative to the next.
const NEARER: f64 = 0.85;

/// Decides whether an object is clearly the leftmost, rightmost or nearest of several, based on the centre of its
/// visible part and the range at its mask's deepest point, not only on object centres, which are not visible in an
/// image.
pub(super) struct Plainly<'a> {
    /// The masks of the image.
    pub(super) masks: &'a [Mask],
    /// Ids and depth, including openings.
    pub(super) truth: &'a RenderedImage,
}

impl Plainly<'_> {
    /// Whether `place` holds clearly for `of` among `others`.
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

    /// Depth at the mask's deepest point, metres.
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
        // Three objects side by side, the left two hardly apart in depth.
        let ids: Vec<u16> = (0..2).flat_map(|_| (0..100).map(|x| [1, 2, 3][(x / 34) as usize])).collect();
        let depth: Vec<f32> = ids.iter().map(|id| [5.0, 5.5, 20.0][usize::from(*id) - 1]).collect();
        let truth =
            RenderedImage { width: 100, height: 2, ids: Some(ids.clone()), depth: Some(depth), ..RenderedImage::default() };
        let masks = masks(&ids, 100);
        let plainly = Plainly { masks: &masks, truth: &truth };
        let all = [1, 2, 3];
        assert!(plainly.holds("leftmost", 1, &all) && plainly.holds("rightmost", 3, &all));
        assert!(!plainly.holds("leftmost", 2, &all) && !plainly.holds("nearest", 1, &all));
        assert!(plainly.holds("nearest", 1, &[1, 3]) && !plainly.holds("nearest", 3, &[1, 3]));
        assert!(!plainly.holds("nearest", 9, &all), "it is not there");
    }
}
