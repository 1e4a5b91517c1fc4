//! The network of an ONNX file.

use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::time::Time;
use spf_detect::DepthNetwork;
use spf_detect::mono_depth::MonoDepth;
use spf_drone::frames::Photo;
use spf_media::Scaler;

use super::EstimatesDepth;

/// The network of an ONNX file.
pub(super) struct OnnxDepth {
    network: DepthNetwork,
    scaler: Scaler,
}

impl OnnxDepth {
    pub(super) fn new(network: DepthNetwork) -> Self {
        Self { network, scaler: Scaler::default() }
    }
}

impl EstimatesDepth for OnnxDepth {
    fn name(&self) -> &str {
        self.network.name()
    }

    fn estimate(&mut self, frame: (FrameId, Time), camera: &Camera, photo: &Photo) -> Result<MonoDepth, String> {
        // Sides are at most `spf_detect::MAX_SIDE`.
        let (width, height) = self.network.input();
        let image = photo.at((width as u32, height as u32), &mut self.scaler);
        let found = self.network.estimate(frame, camera, &image).map_err(|error| error.to_string());
        self.scaler.reuse(image);
        found
    }
}
