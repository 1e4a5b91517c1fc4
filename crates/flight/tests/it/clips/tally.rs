//! What the clips of a kind add up to.

use spf_media::track::PixelBox;

use super::flight::camera;
use super::followed::{Followed, Image, Report};

/// The overlap from which a box is on the target.
const ON: f64 = 0.5;

/// Which of the two trackers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum By {
    Pixels,
    Model,
}

impl By {
    pub(super) fn report(self, image: &Image) -> &Report {
        match self {
            Self::Pixels => &image.pixels,
            Self::Model => &image.model,
        }
    }
}

fn overlap(area: Option<PixelBox>, report: &Report) -> f64 {
    area.map_or(0.0, |area| area.overlap(&report.area))
}

fn is_on(image: &Image, by: By) -> bool {
    overlap(image.sight.visible, by.report(image)) >= ON
}

/// Good, and on the target.
fn is_held(image: &Image, by: By) -> bool {
    by.report(image).is_good() && is_on(image, by)
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
    pub(super) fn of<'a>(clips: impl Iterator<Item = &'a Followed>, by: By) -> Self {
        let mut tally = Self::default();
        for clip in clips {
            tally.add(clip, by);
        }
        tally.overlaps.sort_by(f64::total_cmp);
        tally
    }

    fn add(&mut self, clip: &Followed, by: By) {
        self.clips += 1;
        self.refused += u32::from(!clip.accepted);
        self.millis += clip.millis;
        self.quantisers.extend(clip.quantiser);
        if let Some(last) = clip.images.last().filter(|last| last.sight.is_whole(&camera())) {
            self.bridged.add(clip.accepted && is_held(last, by));
            if clip.accepted {
                self.bridged_accepted.add(is_held(last, by));
            }
        }
        for image in clip.images.iter().filter(|_| clip.accepted) {
            let report = by.report(image);
            self.good.add(report.is_good());
            if report.is_good() {
                let on = is_on(image, by);
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

/// The errors of one tracker, of the kind that the stand-in makes.
#[derive(Debug, Default)]
pub(super) struct Errors {
    /// Not held after 2, 4 and 8 s, of the clips whose target is in view then.
    pub(super) lost: [Share; 3],
    /// Standard deviations of the edges, as fractions of the sides: from track to track, and from image to image.
    pub(super) bias: f64,
    pub(super) noise: f64,
    /// Of the logarithm of the scale: the median of its size, and what nine of ten are below.
    pub(super) scale: [f64; 2],
    /// A second after a target that was hidden is back in view: held again.
    pub(super) found: Share,
}

impl Errors {
    pub(super) fn of<'a>(clips: impl Iterator<Item = &'a Followed>, by: By) -> Self {
        let mut errors = Self::default();
        let (mut means, mut rests, mut scales) = (Vec::new(), Vec::new(), Vec::new());
        for clip in clips.filter(|clip| clip.accepted) {
            for (lost, image) in errors.lost.iter_mut().zip([19, 39, 78]) {
                if let Some(image) = clip.images.get(image).filter(|image| image.sight.is_whole(&camera())) {
                    lost.add(!is_held(image, by));
                }
            }
            let held = || clip.images.iter().filter(|image| is_clear(image) && is_held(image, by));
            for edges in columns(held().map(|image| edges(image, by))) {
                let mean = edges.iter().sum::<f64>() / edges.len() as f64;
                if edges.len() >= 10 {
                    means.push(mean);
                    rests.extend(edges.iter().map(|edge| edge - mean));
                }
            }
            scales.extend(held().map(|image| libm::log(by.report(image).scale / image.growth).abs()));
            errors.find(clip, by);
        }
        scales.sort_by(f64::total_cmp);
        (errors.bias, errors.noise) = (spread(&means), spread(&rests));
        errors.scale = [quantile(&scales, 0.5), quantile(&scales, 0.9)];
        errors
    }

    /// Notes where the target comes back after at least 0.6 s in which hardly anything of it was to be seen.
    fn find(&mut self, clip: &Followed, by: By) {
        let mut hidden = 0;
        for (at, image) in clip.images.iter().enumerate() {
            if image.sight.share < 0.2 {
                hidden += 1;
                continue;
            }
            let Some(later) = clip.images.get(at..at + 15) else { return };
            if hidden >= 6 && later.iter().all(|image| image.sight.share >= 0.5) {
                self.found.add(is_held(&later[14], by));
                hidden = 0;
            }
            hidden = if image.sight.share >= 0.5 { 0 } else { hidden };
        }
    }

    pub(super) const HEAD: &str = "| | lost after 2 s | 4 s | 8 s | edges, constant | edges, per image | scale: half below | 90 % | found again |\n|---|---|---|---|---|---|---|---|---|";

    pub(super) fn row(&self, name: &str) -> String {
        let lost: Vec<String> = self.lost.iter().map(|lost| format!("{:.0} % of {}", lost.percent(), lost.of)).collect();
        format!(
            "| {name} | {} | {:.3} | {:.3} | {:.3} | {:.3} | {} of {} |",
            lost.join(" | "),
            self.bias,
            self.noise,
            self.scale[0],
            self.scale[1],
            self.found.part,
            self.found.of
        )
    }
}

/// Whether the true box is that of the whole target.
fn is_clear(image: &Image) -> bool {
    image.sight.share >= 0.95 && !image.sight.is_cut(&camera())
}

/// By how much each edge is off, as a fraction of the side.
fn edges(image: &Image, by: By) -> [f64; 4] {
    let (area, truth) = (by.report(image).area, image.sight.visible.unwrap());
    [
        (area.left - truth.left) / truth.width(),
        (area.right - truth.right) / truth.width(),
        (area.top - truth.top) / truth.height(),
        (area.bottom - truth.bottom) / truth.height(),
    ]
}

fn columns(rows: impl Iterator<Item = [f64; 4]>) -> [Vec<f64>; 4] {
    let mut columns: [Vec<f64>; 4] = Default::default();
    for row in rows {
        columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
    }
    columns
}

/// The standard deviation about zero.
fn spread(values: &[f64]) -> f64 {
    libm::sqrt(values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64)
}
