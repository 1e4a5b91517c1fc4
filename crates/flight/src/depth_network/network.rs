//! The network of an ONNX file.

use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::time::Time;
use spf_detect::DepthNetwork;
use spf_detect::mono_depth::MonoDepth;
use spf_media::Rgb;

use super::EstimatesDepth;

/// The network of an ONNX file.
pub(super) struct OnnxDepth(pub(super) DepthNetwork);

impl EstimatesDepth for OnnxDepth {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn size(&self) -> (u32, u32) {
        // Sides are at most `spf_detect::MAX_SIDE`.
        let (width, height) = self.0.input();
        (width as u32, height as u32)
    }

    fn estimate(&mut self, frame: (FrameId, Time), camera: &Camera, image: &Rgb) -> Result<MonoDepth, String> {
        self.0.estimate(frame, camera, image).map_err(|error| error.to_string())
    }
}
