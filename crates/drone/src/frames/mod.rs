//! Camera frames as pixels, on demand: already received, or rendered when requested.

pub mod delay;
mod store;
pub mod usable;

use std::sync::Arc;

use spf_core::frame::{FrameId, FrameMeta};
use spf_media::{Rgb, Scaler};

pub use store::FrameStore;

/// The images of a craft's camera. The pilot only gets a frame's [`FrameMeta`]; its pixels are available here by its
/// id. [`FrameStore`] implements it for a camera that pushes its images, and documents which images count as frozen.
pub trait Frames: Send + Sync {
    /// A frame; `None` if it is no longer kept.
    fn photo(&self, id: FrameId) -> Option<Photo>;

    /// The newest frame.
    fn newest(&self) -> Option<(FrameMeta, Photo)>;

    /// Statistics of the video transmission; all zero if there is none.
    fn tally(&self) -> FrameStats {
        FrameStats::default()
    }
}

/// Renders an image with a width and height, pixels.
type RenderFn = dyn Fn((u32, u32)) -> Rgb + Send + Sync;

/// A frame that is held: it stays available as long as this value lives, even if the camera has dropped it.
#[derive(Clone)]
pub struct Photo {
    size: (u32, u32),
    source: Source,
}

#[derive(Clone)]
enum Source {
    Received(Arc<Rgb>),
    Drawn(Arc<RenderFn>),
}

impl Photo {
    /// A frame of received pixels. Other sizes are scaled from them.
    #[must_use]
    pub fn received(pixels: Arc<Rgb>) -> Self {
        Self { size: (pixels.width(), pixels.height()), source: Source::Received(pixels) }
    }

    /// A frame rendered on demand at the requested size; `size` is the camera's own.
    #[must_use]
    pub fn drawn(size: (u32, u32), draw: impl Fn((u32, u32)) -> Rgb + Send + Sync + 'static) -> Self {
        Self { size, source: Source::Drawn(Arc::new(draw)) }
    }

    /// Its own width and height, pixels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Its pixels at their own size.
    #[must_use]
    pub fn pixels(&self) -> Arc<Rgb> {
        match &self.source {
            Source::Received(pixels) => pixels.clone(),
            Source::Drawn(draw) => Arc::new(draw(self.size)),
        }
    }

    /// Its pixels scaled to a width and height, for overlaying marks. `scaler` provides the buffers.
    #[must_use]
    pub fn at(&self, (width, height): (u32, u32), scaler: &mut Scaler) -> Rgb {
        match &self.source {
            Source::Received(pixels) => scaler.scale(pixels, width, height),
            Source::Drawn(draw) => draw((width, height)),
        }
    }
}

/// Statistics of a camera's images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameStats {
    /// Transmission.
    pub video: VideoStats,
    /// Images decoded, including those that a newer one replaced before they became a frame.
    pub decoded: u64,
    /// Images that the decoder rejected.
    pub refused: u64,
    /// Frames that carry no information (see [`usable`]), or of which parts are missing.
    pub unusable: u64,
    /// Changes of the image's size.
    pub sizes: u64,
    /// Images that repeat an earlier one (see [`FrameStore`]).
    pub repeated: u64,
    /// Images dropped because newer ones had arrived.
    pub superseded: u64,
}

/// Transmission losses of a video.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VideoStats {
    /// Complete images.
    pub units: u64,
    /// Gaps detected from frame numbers.
    pub gaps: u64,
    /// Images dropped until the next key frame.
    pub skipped: u64,
    /// NAL units that were too long or invalid.
    pub damaged: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_received_image_is_scaled_and_a_rendered_one_has_the_requested_size() {
        let mut scaler = Scaler::default();
        let received = Photo::received(Arc::new(Rgb::filled(8, 6, [9, 80, 200])));
        assert_eq!((received.size(), received.at((4, 3), &mut scaler)), ((8, 6), Rgb::filled(4, 3, [9, 80, 200])));
        let drawn = Photo::drawn((8, 6), |(width, height)| Rgb::filled(width, height, [width as u8, height as u8, 0]));
        assert_eq!(drawn.at((4, 3), &mut scaler), Rgb::filled(4, 3, [4, 3, 0]));
        assert_eq!(*drawn.pixels(), Rgb::filled(8, 6, [8, 6, 0]));
    }
}
