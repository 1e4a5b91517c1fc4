//! Pixels of simulated frames, drawn while the frame is on its way to the pilot: a real camera's arrive with the frame.

use std::time::{Duration, Instant};

use spf_core::frame::{FrameId, FrameMeta};
use spf_core::time::Time;
use spf_drone::frames::Photo;
use spf_media::Rgb;

/// Maximum number of drawn frames kept.
const KEPT: usize = 4;

/// Frames that a camera has exposed and not delivered yet.
#[derive(Default)]
pub(crate) struct Exposed {
    pub(crate) frames: Vec<(FrameMeta, Photo)>,
    /// A flight time, and the instant that it was.
    pub(crate) clock: Option<(Time, Instant)>,
}

impl Exposed {
    /// Takes the frame to draw next: the first one that is drawn by its delivery if drawing takes `cost`, else the last one.
    pub(crate) fn take(&mut self, now: Instant, cost: Duration) -> Option<(FrameMeta, Photo)> {
        let (then, at) = self.clock?;
        let in_time = |(meta, _): &(FrameMeta, Photo)| at + meta.received.since(then) >= now + cost;
        let first = self.frames.iter().position(in_time).or(self.frames.len().checked_sub(1))?;
        // Those before it are not drawn any more.
        self.frames.drain(..=first).next_back()
    }
}

/// What is drawn already.
#[derive(Default)]
pub(crate) struct Drawn(Vec<(FrameId, Rgb, Duration)>);

impl Drawn {
    /// Keeps the pixels of a frame, and how long they took.
    pub(crate) fn put(&mut self, id: FrameId, pixels: Rgb, took: Duration) {
        if self.0.len() >= KEPT {
            self.0.remove(0);
        }
        self.0.push((id, pixels, took));
    }

    /// Whether this frame is kept.
    pub(crate) fn has(&self, id: FrameId) -> bool {
        self.0.iter().any(|(of, ..)| *of == id)
    }

    /// The pixels of a frame; those of older ones are forgotten.
    pub(crate) fn take(&mut self, id: FrameId) -> Option<(Rgb, Duration)> {
        self.0.retain(|(of, ..)| *of >= id);
        let at = self.0.iter().position(|(of, ..)| *of == id)?;
        let (_, pixels, took) = self.0.remove(at);
        Some((pixels, took))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn frame(id: u64, ms: u64) -> (FrameMeta, Photo) {
        let (at, photo) = (Time::from_millis(ms), Photo::received(Arc::new(Rgb::new(2, 2))));
        let meta =
            FrameMeta { id: FrameId(id), captured: at, received: at, capture_counter: id, width: 2, height: 2, unusable: None };
        (meta, photo)
    }

    #[test]
    fn the_first_frame_is_drawn_that_is_ready_when_it_is_delivered() {
        let now = Instant::now();
        let exposed = || Exposed {
            frames: vec![frame(7, 1050), frame(8, 1100), frame(9, 1150)],
            clock: Some((Time::from_millis(1000), now)),
        };
        let taken = |cost| {
            let mut exposed = exposed();
            let (meta, _) = exposed.take(now, Duration::from_millis(cost)).unwrap();
            (meta.id.0, exposed.frames.len())
        };
        assert_eq!((taken(20), taken(60), taken(100), taken(400)), ((7, 2), (8, 1), (8, 1), (9, 0)));
        assert!(Exposed::default().take(now, Duration::ZERO).is_none());
    }

    #[test]
    fn few_are_kept_and_older_ones_forgotten() {
        let mut drawn = Drawn::default();
        (0..10).for_each(|id| drawn.put(FrameId(id), Rgb::new(2, 2), Duration::ZERO));
        assert!(!drawn.has(FrameId(5)) && drawn.has(FrameId(6)));
        assert!(drawn.take(FrameId(8)).is_some() && !drawn.has(FrameId(7)) && drawn.has(FrameId(9)));
    }
}
