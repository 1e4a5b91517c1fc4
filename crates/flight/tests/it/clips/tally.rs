//! What the clips of a kind add up to.

use spf_media::track::PixelBox;

use super::flight::camera;
use super::followed::{Followed, Image, Report};

/// The overlap from which a box is on the target.
const ON: f64 = 0.5;

fn overlap(area: Option<PixelBox>, report: &Report) -> f64 {
    area.map_or(0.0, |area| area.overlap(&report.area))
}

fn is_on(image: &Image) -> bool {
    overlap(image.sight.visible, &image.report) >= ON
}

/// Good, and on the target.
fn is_held(image: &Image) -> bool {
    image.report.is_good() && is_on(image)
}

/// A number of cases, and those of them that count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Share {
    pub(super) part: u32,
    pub(super) of: u32,
}

impl Share {
    fn add(&mut self, counts: bool) {
        self.part += u32::from(counts);
        self.of += 1;
    }

    pub(super) fn percent(self) -> f64 {
        100.0 * f64::from(self.part) / f64::from(self.of.max(1))
    }
}

/// How well the tracker follows the targets of one kind.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub(super) clips: u32,
    pub(super) refused: u32,
    /// Of the images of accepted clips.
    pub(super) good: Share,
    /// Of the good images: off the target's visible box, and of these, off its whole box too.
    pub(super) off: Share,
    pub(super) off_whole: Share,
    /// Of the clips whose target is in view at the end: all, and those that were accepted.
    pub(super) bridged: Share,
    pub(super) bridged_accepted: Share,
    /// Overlaps of the good boxes with the visible one.
    overlaps: Vec<f64>,
    millis: f64,
    quantisers: Vec<u8>,
}

impl Tally {
    pub(super) fn of<'a>(clips: impl Iterator<Item = &'a Followed>) -> Self {
        let mut tally = Self::default();
        for clip in clips {
            tally.add(clip);
        }
        tally.overlaps.sort_by(f64::total_cmp);
        tally
    }

    fn add(&mut self, clip: &Followed) {
        self.clips += 1;
        self.refused += u32::from(!clip.accepted);
        self.millis += clip.millis;
        self.quantisers.extend(clip.quantiser);
        if let Some(last) = clip.images.last().filter(|last| last.sight.is_whole(&camera())) {
            self.bridged.add(clip.accepted && is_held(last));
            if clip.accepted {
                self.bridged_accepted.add(is_held(last));
            }
        }
        for image in clip.images.iter().filter(|_| clip.accepted) {
            let report = &image.report;
            self.good.add(report.is_good());
            if report.is_good() {
                let on = is_on(image);
                self.off.add(!on);
                self.off_whole.add(!on && overlap(image.sight.whole, report) < ON);
                self.overlaps.extend(image.sight.visible.map(|area| area.overlap(&report.area)));
            }
        }
    }

    /// The overlap that this part of the good boxes exceeds.
    fn overlap(&self, part: f64) -> f64 {
        quantile(&self.overlaps, 1.0 - part)
    }

    pub(super) const HEAD: &str = "| kind | clips | refused | good, % of images | off, % of good | off the whole target, % of good | in view at the end | bridged, % of them | bridged, % of those not refused | overlap: median, 90 % | ms per image |\n|---|---|---|---|---|---|---|---|---|---|---|";

    pub(super) fn row(&self, name: &str) -> String {
        let quantiser = if self.quantisers.is_empty() {
            String::new()
        } else {
            let sum: f64 = self.quantisers.iter().copied().map(f64::from).sum();
            format!(" (mean quantiser {:.0})", sum / self.quantisers.len() as f64)
        };
        format!(
            "| {name}{quantiser} | {} | {} | {:.0} | {:.1} | {:.1} | {} | {:.0} | {:.0} | {:.2}, {:.2} | {:.1} |",
            self.clips,
            self.refused,
            self.good.percent(),
            self.off.percent(),
            self.off_whole.percent(),
            self.bridged.of,
            self.bridged.percent(),
            self.bridged_accepted.percent(),
            self.overlap(0.5),
            self.overlap(0.9),
            self.millis / f64::from(self.clips.max(1)),
        )
    }
}

/// The value below which this part of some sorted values are.
pub(super) fn quantile(sorted: &[f64], part: f64) -> f64 {
    let at = (part * sorted.len() as f64) as usize;
    sorted.get(at.min(sorted.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}
