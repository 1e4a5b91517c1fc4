//! Detectors behind the `Vlm` interface: [`QueryKind::Detect`] queries go to a detector, all others to the VLM.
//! Detections are thus queried, awaited, recorded and replayed like any other reply.

use std::sync::Arc;
use std::time::Instant;

use spf_core::detection::write_detections;
use spf_core::query::QueryKind;
use spf_detect::Detector;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use crate::sim::VlmFactory;

/// A VLM combined with a detector that answers its `Detect` queries.
struct WithDetector {
    vlm: Box<dyn Vlm>,
    detector: Box<dyn Vlm>,
}

impl Vlm for WithDetector {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.vlm.image_spec(camera)
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        match request.query.kind {
            QueryKind::Detect { .. } => self.detector.answer(request, image),
            _ => self.vlm.answer(request, image),
        }
    }
}

/// Combines a VLM with `detector`, which answers `Detect` queries.
#[must_use]
pub fn with_detector(vlm_factory: VlmFactory, detector: VlmFactory) -> VlmFactory {
    Arc::new(move |world, seed| Ok(Box::new(WithDetector { vlm: vlm_factory(world, seed)?, detector: detector(world, seed)? })))
}

/// A detection model as a [`Vlm`]. Its latency is the measured inference time.
struct DetectorVlm(Detector);

impl Vlm for DetectorVlm {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        // In the simulator this renders the frame; a camera's frame is available immediately.
        let pixels = image.pixels();
        let began = Instant::now();
        let detect = |pixels| self.0.detect(&pixels).map_err(|error| VlmError::Detector(error.to_string()));
        let text = match request.query.kind {
            QueryKind::Detect { .. } => pixels.and_then(detect).map(|found| write_detections(&found)),
            _ => Err(VlmError::Refused { model: self.0.name().to_owned(), reason: "lists the objects in an image".to_owned() }),
        };
        Answer { text, latency: began.elapsed(), model: self.0.name().to_owned(), account: Usage::default() }
    }
}

/// A detection model for use with [`with_detector`]; all flights share its network.
#[must_use]
pub fn model_detects(detector: Detector) -> VlmFactory {
    Arc::new(move |_, _| Ok(Box::new(DetectorVlm(detector.clone()))))
}
