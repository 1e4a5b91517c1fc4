//! Chooses rendering quality and frame rate of the virtual Tello's camera: lower quality rather than delay.

use spf_core::time::Duration;

/// Rendering quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderQuality {
    /// With anti-aliasing.
    Full,
    /// Without anti-aliasing, which compression hides.
    Live,
    /// Like `Live`, rendered at half the width and height and enlarged.
    Draft,
}

/// Video quality setting.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VideoQuality {
    /// `Live` if time permits, else `Draft`.
    #[default]
    Auto,
    /// A fixed quality.
    Always(RenderQuality),
}

impl VideoQuality {
    /// All names.
    pub const NAMES: [&str; 4] = ["auto", "full", "live", "draft"];

    /// The quality with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "auto" => Some(Self::Auto),
            "full" => Some(Self::Always(RenderQuality::Full)),
            "live" => Some(Self::Always(RenderQuality::Live)),
            "draft" => Some(Self::Always(RenderQuality::Draft)),
            _ => None,
        }
    }
}

/// Above this time for rendering and encoding, too little is left for sending.
const SLOW: Duration = Duration::from_millis(70);
/// Number of slow images in a row before the quality is reduced.
const SLOW_IN_A_ROW: u32 = 2;
/// A draft faster than this leaves time for four times the pixels.
const QUICK: Duration = Duration::from_millis(25);
/// Number of fast drafts before the quality is raised, initially; doubled after each failure, up to the second value.
const QUICK_IN_A_ROW: (u32, u32) = (45, 1440);
/// Frames per second while drafts are needed, to leave time for other processes such as the viewer.
const BUSY_RATE: u32 = 15;

/// Chooses the quality from measured times.
#[derive(Clone, Debug)]
pub(crate) struct Pace {
    quality: VideoQuality,
    draft: bool,
    /// Number of images in a row in favour of the other quality.
    row: u32,
    patience: u32,
}

impl Pace {
    pub(crate) fn new(quality: VideoQuality) -> Self {
        Self { quality, draft: false, row: 0, patience: QUICK_IN_A_ROW.0 }
    }

    /// Quality of the next image.
    pub(crate) fn fineness(&self) -> RenderQuality {
        match self.quality {
            VideoQuality::Always(fineness) => fineness,
            VideoQuality::Auto if self.draft => RenderQuality::Draft,
            VideoQuality::Auto => RenderQuality::Live,
        }
    }

    /// Frame interval, if `fps` is requested.
    pub(crate) fn period(&self, fps: u32) -> Duration {
        let most = if self.draft { BUSY_RATE } else { u32::MAX };
        Duration::from_secs(1) / fps.clamp(1, most)
    }

    /// Records the time for rendering and encoding an image.
    pub(crate) fn took(&mut self, time: Duration) {
        if self.quality != VideoQuality::Auto {
            return;
        }
        let speaks = if self.draft { time < QUICK } else { time > SLOW };
        self.row = if speaks { self.row + 1 } else { 0 };
        if !self.draft && self.row >= SLOW_IN_A_ROW {
            (self.draft, self.row) = (true, 0);
        } else if self.draft && self.row >= self.patience {
            (self.draft, self.row) = (false, 0);
            self.patience = (2 * self.patience).min(QUICK_IN_A_ROW.1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(pace: &mut Pace, images: u32, millis: u64) -> RenderQuality {
        (0..images).for_each(|_| pace.took(Duration::from_millis(millis)));
        pace.fineness()
    }

    #[test]
    fn slow_images_become_drafts_and_fast_drafts_become_full_again() {
        let mut pace = Pace::new(VideoQuality::Auto);
        assert_eq!((pace.fineness(), pace.period(30)), (RenderQuality::Live, Duration::from_secs(1) / 30));
        assert_eq!(after(&mut pace, 1, 200), RenderQuality::Live);
        assert_eq!(after(&mut pace, 1, 30), RenderQuality::Live);
        assert_eq!(after(&mut pace, 2, 200), RenderQuality::Draft);
        assert_eq!((pace.period(30), pace.period(5)), (Duration::from_secs(1) / 15, Duration::from_secs(1) / 5));
        assert_eq!(after(&mut pace, 44, 10), RenderQuality::Draft);
        assert_eq!(after(&mut pace, 1, 10), RenderQuality::Live);
    }

    #[test]
    fn what_was_tried_in_vain_is_tried_more_seldom() {
        let mut pace = Pace::new(VideoQuality::Auto);
        let mut tried = 0;
        // Live images are always slow here and drafts always fast: at most ten minutes of drafts.
        for _ in 0..9000 {
            let live = pace.fineness() == RenderQuality::Live;
            tried += u32::from(live);
            pace.took(Duration::from_millis(if live { 120 } else { 10 }));
        }
        assert!((10..=26).contains(&tried), "{tried}");
    }

    #[test]
    fn what_is_requested_stays() {
        for name in ["full", "live", "draft"] {
            let quality = VideoQuality::from_name(name).unwrap();
            let mut pace = Pace::new(quality);
            let before = pace.fineness();
            assert_eq!((after(&mut pace, 100, 500), pace.period(30)), (before, Duration::from_secs(1) / 30));
        }
        assert_eq!(VideoQuality::from_name("best"), None);
    }
}
