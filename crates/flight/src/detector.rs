//! Detectors behind the `Vlm` interface: lists of what is in a frame ([`QueryKind::Detect`]) come from a detector, everything else
//! from the VLM. So a list is asked for, waited for, recorded and replayed like every other answer.

use std::sync::Arc;

use spf_core::query::QueryKind;
use spf_vlm::{Answer, Asked, Eyesight, Picture, Vlm};

use crate::sim::WhoPoints;

/// Who points, and a detector that lists what is in the picture in their place.
struct WithDetector {
    vlm: Box<dyn Vlm>,
    detector: Box<dyn Vlm>,
}

impl Vlm for WithDetector {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn eyesight(&self, camera: (u32, u32)) -> Eyesight {
        self.vlm.eyesight(camera)
    }

    fn answer(&mut self, asked: &Asked<'_>, picture: &mut dyn Picture) -> Answer {
        match asked.query.kind {
            QueryKind::Detect { .. } => self.detector.answer(asked, picture),
            _ => self.vlm.answer(asked, picture),
        }
    }
}

/// The same, with lists of what is in the picture from `detector`.
#[must_use]
pub fn with_detector(who: WhoPoints, detector: WhoPoints) -> WhoPoints {
    Arc::new(move |world, seed| Ok(Box::new(WithDetector { vlm: who(world, seed)?, detector: detector(world, seed)? })))
}
