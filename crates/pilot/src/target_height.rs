//! Whether the target of the present stage is tall: each answer may mean another part of what is, such as the jib of a crane and
//! then its foot, and their average is a place where a craft may see neither.

/// Height above which a target is tall, metres.
const TALL: f64 = 6.0;

/// What the answers about one stage have told.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TargetHeight {
    stage: u32,
    is_tall: bool,
}

impl TargetHeight {
    /// Takes the height of the target's box in an answer about a stage, metres. A target stays tall until the next stage begins,
    /// also while it is searched for: near it, the image shows only a part. A late answer about an earlier stage says nothing.
    pub(super) fn note(&mut self, stage: u32, height: f64) {
        if stage > self.stage {
            *self = Self { stage, is_tall: false };
        }
        self.is_tall |= stage == self.stage && height > TALL;
    }

    pub(super) fn is_tall(self) -> bool {
        self.is_tall
    }
}

#[cfg(test)]
mod tests {
    use super::TargetHeight;

    #[test]
    fn a_target_stays_tall_until_the_next_stage() {
        let mut height = TargetHeight::default();
        let mut after = |stage, metres| {
            height.note(stage, metres);
            height.is_tall()
        };
        assert!(!after(1, 5.9));
        assert!(after(1, 6.1));
        assert!(after(1, 0.5));
        assert!(!after(2, 0.5));
        // Late.
        assert!(!after(1, 40.0));
        assert!(after(2, 40.0));
        assert!(after(1, 0.5));
    }
}
