//! Follows a box through the images of a video, from pixels alone.
//!
//! A correlation filter (`filter`) that is learnt on the way tells where the box is, how large, and how sure that is; if it is
//! not sure, nothing is learnt. Correlation with patches of earlier images (`template`) makes the box more exact where the two
//! agree, and corrects the drift of what is learnt image by image.
//!
//! Pure given the images: no I/O, no clock, no threads, no random numbers. Sums are integers, and the rest is IEEE arithmetic
//! in a fixed order, so equal images give equal bits on every machine.
//!
//! ```
//! use spf_follow::track::{Quality, Tracker};
//! use spf_media::track::{PixelBox, TrackImage};
//!
//! // A speckled pattern that moves by two pixels.
//! let speckle = |x: u32, y: u32| ((x / 4 * 7919 + y / 4 * 104_729) % 251) as u8;
//! let image = |shift: u32| {
//!     let data = (0..120).flat_map(|y| (0..160).map(move |x| speckle(x + 40 - shift, y))).collect();
//!     TrackImage::from_grey(160, 120, data)
//! };
//! let mut tracker = Tracker::start(&image(0)?, PixelBox { left: 50.0, top: 40.0, right: 90.0, bottom: 80.0 });
//! let track = tracker.next(&image(2)?, None);
//! assert_eq!(track.quality, Quality::Good);
//! assert!((track.area.left - 52.0).abs() < 0.5);
//! # Ok::<(), spf_media::FrameError>(())
//! ```

mod filter;
mod template;

use filter::{Filter, Response};
use spf_media::track::grey::Pyramid;
use spf_media::track::{PixelBox, Shift, TrackImage};
use template::{Match, Template};

/// The shortest side of a target's box that can be tracked, pixels: below, there is no pattern.
pub const SMALLEST: f64 = 12.0;
/// The middle part of a box whose patches are kept by [`Tracker::start_in_middle`], as a fraction of its sides, and the smallest
/// such part, pixels.
const MIDDLE: f64 = 0.6;
const LEAST_MIDDLE: f64 = 20.0;
/// From this fraction of the image's width or height on, only the middle part of a box is followed.
const LARGE: f64 = 0.85;
/// Images without the target until it counts as lost.
const COAST: u32 = 5;
/// The filter's peak, and how far it is above the rest, that count as the target where it is expected.
const SURE: (f64, f64) = (0.3, 22.0);
/// The same, after it was lost.
const FOUND: (f64, f64) = (0.4, 28.0);
/// How much larger or smaller the box is looked for, from one image to the next, and after it was lost.
const GROWTH: f64 = 1.04;
const REGROWTH: f64 = 1.08;
/// Sizes that are tried in turn after it was lost for longer.
const RESIZED: [f64; 3] = [1.0, 0.8, 1.25];
/// What another size must overcome: a peak counts so much less there.
const OTHER_SIZE: f64 = 0.99;
/// How much each image counts in what is learnt.
const RATE: f32 = 0.015;
/// Resemblance of a patch that makes the box more exact, and how much of their boxes patch and filter must have in common.
const SAME: f64 = 0.7;
const AGREE: f64 = 0.8;
/// Resemblance at which an older patch is preferred to all newer ones.
const FITS: f64 = 0.75;
/// Resemblance of a patch that is kept for later.
const KEEP: f64 = 0.85;
/// How far a target is expected from where its motion puts it, as a fraction of the window's sides.
const REACH: f64 = 0.25;
/// How far apart the windows are in which it is searched for, as a fraction of the box's mean side.
const APART: f64 = 0.8;
/// How much stronger than the look-alikes around the target a peak must be.
const MARGIN: f64 = 1.3;
/// Images between two looks around for look-alikes.
const LOOK_EVERY: u32 = 8;
/// The weakest pattern that can be tracked, standard deviation in grey levels, in this much of the box.
const CONTRAST: f64 = 5.0;
const OUTLINE: f64 = 1.5;
/// Images between two patches that are kept.
const KEEP_EVERY: u32 = 8;
/// Patches that are kept besides the first.
const KEPT: usize = 4;

/// How far a track can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Quality {
    /// The box is on the target.
    Good,
    /// The target was not recognised for a moment; the box is where it is expected.
    Coasting,
    /// The target is hidden, gone or changed, or has nothing by which to be recognised. The box means nothing; it becomes
    /// good again if the target is found.
    Lost,
    /// The box is below [`SMALLEST`]: nothing is tracked any more.
    TooSmall,
}

impl Quality {
    /// The quality in one word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Coasting => "coasting",
            Self::Lost => "lost",
            Self::TooSmall => "too-small",
        }
    }
}

/// The target in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track {
    /// Where it is.
    pub area: PixelBox,
    /// Its size divided by that at the start.
    pub scale: f64,
    /// How far this can be trusted.
    pub quality: Quality,
}

/// Follows one box.
#[derive(Clone, Debug)]
pub struct Tracker {
    /// Width and height of the images.
    size: (u32, u32),
    /// The box that the filter follows: of a large target the middle part, `core` of its sides.
    area: PixelBox,
    core: f64,
    scale: f64,
    quality: Quality,
    /// The motion from one image to the next, pixels, besides what was predicted.
    velocity: Shift,
    /// What the target looks like; `None` if there is nothing to track.
    filter: Option<Filter>,
    /// Patches of the target's middle `part`, oldest first; the first one is never replaced.
    patches: Vec<Template>,
    part: f64,
    /// Images since the last patch was kept.
    since_kept: u32,
    /// Images since the target was last recognised.
    missing: u32,
    /// Found again in the last image, but not yet confirmed.
    found: bool,
    /// How much the most similar thing around the target resembles it: a peak.
    rival: f64,
    count: u32,
}

impl Tracker {
    /// Begins with the target's box in an image. [`Tracker::track`] tells whether there is something to track.
    #[must_use]
    pub fn start(image: &TrackImage, area: PixelBox) -> Self {
        Self::start_part(image, area, 1.0)
    }

    /// The same, but keeps patches of the middle part of the box, unless that is too small: what lies behind a person shows on
    /// either side of them in their box, and moves otherwise.
    #[must_use]
    pub fn start_in_middle(image: &TrackImage, area: PixelBox) -> Self {
        Self::start_part(image, area, if MIDDLE * area.side() >= LEAST_MIDDLE { MIDDLE } else { 1.0 })
    }

    fn start_part(image: &TrackImage, area: PixelBox, part: f64) -> Self {
        let size = image.size();
        let mut tracker = Self {
            size,
            area,
            core: 1.0,
            scale: 1.0,
            quality: Quality::Lost,
            velocity: Shift::default(),
            filter: None,
            patches: Vec::new(),
            part,
            since_kept: 0,
            missing: 0,
            found: false,
            rival: 0.0,
            count: 0,
        };
        if !area.is_sound() || area.inside(size) < 0.5 || size.0.min(size.1) < 24 {
            return tracker;
        }
        if area.side() < SMALLEST {
            tracker.quality = Quality::TooSmall;
            return tracker;
        }
        let now = Pyramid::of(&image.grey);
        // The outline is a pattern too.
        if Template::of(&now, &area.scaled(OUTLINE)).contrast() < CONTRAST {
            return tracker;
        }
        let mut filter = Filter::of(&now, image.tints.as_ref(), &area);
        tracker.patches.push(Template::of(&now, &area.scaled(part)));
        tracker.quality = Quality::Good;
        tracker.keep_to_the_core(&mut filter, &now, image);
        tracker.look_around(&filter, &now, image);
        tracker.filter = Some(filter);
        tracker
    }

    /// The target in the last image.
    #[must_use]
    pub fn track(&self) -> Track {
        Track { area: self.area.scaled(1.0 / self.core), scale: self.scale, quality: self.quality }
    }

    /// Whether nothing is tracked any more: the box is below [`SMALLEST`], or had nothing to track from the start. No later
    /// image changes that.
    #[must_use]
    pub const fn is_over(&self) -> bool {
        self.filter.is_none()
    }

    /// The target in the next image, which must have the size of the first. `predicted` is the shift that is known to come from
    /// the turning of the camera, none if it is not known. What else has moved the box in the last images is expected to go on.
    pub fn next(&mut self, image: &TrackImage, predicted: Option<Shift>) -> Track {
        if image.size() != self.size {
            return self.track();
        }
        let Some(mut filter) = self.filter.take() else { return self.track() };
        let now = Pyramid::of(&image.grey);
        let turned = predicted.filter(|shift| shift.x.is_finite() && shift.y.is_finite()).unwrap_or_default();
        let expected = self.area.moved(Shift { x: turned.x + self.velocity.x, y: turned.y + self.velocity.y }, 1.0);
        if self.missing == 0 || self.found {
            let response = strongest(&filter, &now, image, &expected, REACH, GROWTH);
            if is_sure(&response, SURE) && response.area.inside(self.size) >= 0.6 {
                self.hold(&now, &response.area, turned);
                filter.learn(&now, image.tints.as_ref(), &self.area, RATE);
                self.keep_to_the_core(&mut filter, &now, image);
                self.count = self.count.wrapping_add(1);
                if self.count.is_multiple_of(LOOK_EVERY) {
                    self.look_around(&filter, &now, image);
                }
            } else {
                self.miss(expected);
            }
        } else {
            self.search(&filter, &now, image, expected);
        }
        if self.quality == Quality::Good && self.area.side() < SMALLEST * self.core {
            self.quality = Quality::TooSmall;
        } else {
            self.filter = Some(filter);
        }
        self.track()
    }

    /// Goes on with the middle part of a box that has become large: what an edge of the image cuts off, or will soon, does not
    /// tell where the target is, nor its size.
    fn keep_to_the_core(&mut self, filter: &mut Filter, now: &Pyramid, image: &TrackImage) {
        let large = self.area.width() > LARGE * f64::from(self.size.0) || self.area.height() > LARGE * f64::from(self.size.1);
        if !large || self.core < 1.0 || MIDDLE * self.area.side() < LEAST_MIDDLE {
            return;
        }
        self.core = MIDDLE;
        self.part = 1.0;
        self.area = self.area.scaled(MIDDLE);
        *filter = Filter::of(now, image.tints.as_ref(), &self.area);
        self.patches = vec![Template::of(now, &self.area)];
        self.since_kept = 0;
    }

    /// The target was recognised at `seen`. `turned` is what the camera's turning has moved the box.
    fn hold(&mut self, now: &Pyramid, seen: &PixelBox, turned: Shift) {
        let best = self.best(now, &seen.scaled(self.part));
        let exact = best.area.scaled(1.0 / self.part);
        let same = best.score >= SAME && exact.overlap(seen) >= AGREE;
        let area = if same { exact.between(seen) } else { *seen };
        let (from, to) = (self.area.centre(), area.centre());
        let step = Shift { x: to.0 - from.0 - turned.x, y: to.1 - from.1 - turned.y };
        // The first step after it was found again is no motion of the target's alone.
        let weight = if self.found { 0.5 } else { 0.7 };
        self.velocity = Shift {
            x: (1.0 - weight) * self.velocity.x + weight * step.x,
            y: (1.0 - weight) * self.velocity.y + weight * step.y,
        };
        self.place(area);
        self.quality = Quality::Good;
        (self.missing, self.found) = (0, false);
        self.since_kept += 1;
        if same && best.score >= KEEP && self.since_kept >= KEEP_EVERY {
            if self.patches.len() > KEPT {
                self.patches.remove(1);
            }
            self.patches.push(Template::of(now, &self.area.scaled(self.part)));
            self.since_kept = 0;
        }
    }

    /// A step from an image in which the target was not recognised.
    fn search(&mut self, filter: &Filter, now: &Pyramid, image: &TrackImage, expected: PixelBox) {
        // The longer ago, the farther it is looked for.
        let steps = if self.missing > COAST { 1 } else { 0 };
        // And the less is known about its size.
        let sizes: &[f64] = if self.missing > COAST { &RESIZED } else { &[1.0] };
        let about = expected.scaled(sizes[self.missing as usize % sizes.len()]);
        let places = around(&about, (steps, steps), APART);
        let responses = places.map(|place| filter.respond(now, image.tints.as_ref(), &place, 0.5));
        let best = responses.reduce(|best, other| if other.peak > best.peak { other } else { best });
        let found = best.map(|best| strongest(filter, now, image, &best.area, REACH, REGROWTH));
        let Some(found) = found.filter(|found| self.is_the_target(found, &expected)) else {
            return self.miss(expected);
        };
        self.place(found.area);
        self.found = true;
        self.missing += 1;
        self.quality = Quality::Coasting;
    }

    /// Whether what was found is the target, and not something that resembles it.
    fn is_the_target(&self, found: &Response, expected: &PixelBox) -> bool {
        let (from, to) = (expected.centre(), found.area.centre());
        let apart = ((to.0 - from.0).abs() / expected.width()).max((to.1 - from.1).abs() / expected.height());
        // With a look-alike about, only the place tells them apart, and that only for a while.
        let in_place = apart < 0.4 && self.missing <= 2 * COAST;
        is_sure(found, FOUND) && found.area.inside(self.size) >= 0.7 && (in_place || found.peak > MARGIN * self.rival)
    }

    /// Notes how much something beside the target resembles it.
    fn look_around(&mut self, filter: &Filter, now: &Pyramid, image: &TrackImage) {
        let area = self.area;
        let beside = around(&area, (2, 1), APART).filter(|place| *place != area);
        let responses = beside.map(|place| filter.respond(now, image.tints.as_ref(), &place, REACH));
        let others = responses.filter(|other| other.area.overlap(&area) < 0.2);
        let other = others.reduce(|best, other| if other.peak > best.peak { other } else { best });
        // What is not in the middle of its window has a weaker peak.
        let peak = other.map_or(0.0, |other| filter.respond(now, image.tints.as_ref(), &other.area, REACH).peak);
        self.rival = peak.max(0.9 * self.rival);
    }

    /// The target was not recognised; its box is where it is expected.
    fn miss(&mut self, expected: PixelBox) {
        if expected.is_sound() {
            self.area = expected;
        }
        self.found = false;
        self.missing += 1;
        self.quality = if self.missing > COAST { Quality::Lost } else { Quality::Coasting };
        // What is not seen is expected to slow down.
        self.velocity = Shift { x: 0.85 * self.velocity.x, y: 0.85 * self.velocity.y };
    }

    fn place(&mut self, area: PixelBox) {
        self.scale *= area.width() / self.area.width();
        self.area = area;
    }

    /// The place near a box that resembles one of the patches most. The oldest patch that fits is taken: every newer one may
    /// have drifted.
    fn best(&self, now: &Pyramid, about: &PixelBox) -> Match {
        let mut best = Match { area: *about, score: -1.0 };
        for patch in &self.patches {
            let found = patch.align(now, about);
            if found.score >= FITS {
                return found;
            }
            if found.score > best.score {
                best = found;
            }
        }
        best
    }
}

fn is_sure(response: &Response, (peak, above): (f64, f64)) -> bool {
    response.peak >= peak && response.above >= above
}

/// Boxes like this one, up to so many steps away across and down. A step is a part of the mean side.
fn around(area: &PixelBox, (across, down): (i32, i32), part: f64) -> impl Iterator<Item = PixelBox> + use<> {
    let apart = part * (area.width() + area.height()) / 2.0;
    let area = *area;
    let place = move |(x, y)| area.moved(Shift { x: apart * f64::from(x), y: apart * f64::from(y) }, 1.0);
    (-down..=down).flat_map(move |y| (-across..=across).map(move |x| (x, y))).map(place)
}

/// The strongest response about a box, at its size, and at one larger and one smaller.
fn strongest(filter: &Filter, now: &Pyramid, image: &TrackImage, about: &PixelBox, reach: f64, growth: f64) -> Response {
    let near = filter.respond(now, image.tints.as_ref(), about, reach);
    // Again, with it in the middle of the window.
    let mut best = filter.respond(now, image.tints.as_ref(), &near.area, reach);
    for scale in [1.0 / growth, growth] {
        let other = filter.respond(now, image.tints.as_ref(), &near.area.scaled(scale), reach);
        if OTHER_SIZE * other.peak > best.peak {
            best = other;
        }
    }
    best
}
