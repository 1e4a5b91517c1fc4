//! A camera's frames as pixels, on demand: received already, or drawn when someone looks.

mod store;

use std::sync::Arc;

use spf_core::frame::{FrameId, FrameMeta};
use spf_media::{Rgb, Scaler};

pub use store::FrameStore;

/// A craft's camera, as far as its images go. What the pilot is told of a frame is its [`FrameMeta`]; whoever wants to see it asks
/// here, by its number.
pub trait Frames: Send + Sync {
    /// A frame, while it is kept.
    fn photo(&self, id: FrameId) -> Option<Photo>;

    /// The newest frame.
    fn newest(&self) -> Option<(FrameMeta, Photo)>;

    /// What became of the images on their way; all zero where they have no way to go.
    fn tally(&self) -> FrameTally {
        FrameTally::default()
    }
}

/// Draws an image at a width and height, pixels.
type Draw = dyn Fn((u32, u32)) -> Rgb + Send + Sync;

/// A frame that is held: it stays at hand as long as this lives, however soon the camera forgets it.
#[derive(Clone)]
pub struct Photo {
    size: (u32, u32),
    source: Source,
}

#[derive(Clone)]
enum Source {
    Received(Arc<Rgb>),
    Drawn(Arc<Draw>),
}

impl Photo {
    /// Pixels that were received. Another size is scaled from them.
    #[must_use]
    pub fn received(pixels: Arc<Rgb>) -> Self {
        Self { size: (pixels.width(), pixels.height()), source: Source::Received(pixels) }
    }

    /// An image that is drawn when someone looks, at the size that is asked for. `size`: the camera's own.
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

    /// Its pixels at a width and height, for whoever draws on them. `scaler` lends the memory.
    #[must_use]
    pub fn at(&self, (width, height): (u32, u32), scaler: &mut Scaler) -> Rgb {
        match &self.source {
            Source::Received(pixels) => scaler.scale(pixels, width, height),
            Source::Drawn(draw) => draw((width, height)),
        }
    }
}

/// What became of a camera's images on their way here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameTally {
    /// On the way.
    pub video: VideoTally,
    /// Images decoded.
    pub decoded: u64,
    /// Images that the decoder refused.
    pub refused: u64,
    /// Changes of the image's size.
    pub sizes: u64,
    /// Images that showed what an earlier one had shown already.
    pub repeated: u64,
    /// Images left out because newer ones had come.
    pub overtaken: u64,
}

/// What a video lost on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VideoTally {
    /// Images put together whole.
    pub units: u64,
    /// Places where an image was missing or damaged, by the numbers that images carry.
    pub gaps: u64,
    /// Images thrown away until the next at which decoding can begin.
    pub skipped: u64,
    /// NAL units that were too long or of no use.
    pub damaged: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_received_is_scaled_and_what_is_drawn_is_drawn_at_the_size_asked_for() {
        let mut scaler = Scaler::default();
        let received = Photo::received(Arc::new(Rgb::filled(8, 6, [9, 80, 200])));
        assert_eq!((received.size(), received.at((4, 3), &mut scaler)), ((8, 6), Rgb::filled(4, 3, [9, 80, 200])));
        let drawn = Photo::drawn((8, 6), |(width, height)| Rgb::filled(width, height, [width as u8, height as u8, 0]));
        assert_eq!(drawn.at((4, 3), &mut scaler), Rgb::filled(4, 3, [4, 3, 0]));
        assert_eq!(*drawn.pixels(), Rgb::filled(8, 6, [8, 6, 0]));
    }
}
