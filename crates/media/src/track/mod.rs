//! Follows a box through the images of a video, from pixels alone.
//!
//! Three methods watch each other. Sparse optical flow (`flow`) tells how the box moves and grows from one image to the next;
//! it is precise but forgets what it began with. Correlation with patches of earlier images (`template`) tells whether the
//! box still shows the same, corrects the drift, and finds the target again after it was hidden. Where these two have nothing to
//! hold on to, as on plain clothes, the box goes where the target's colours are (`colour`), if what is around it has others.
//!
//! Pure given the images: no I/O, no clock, no threads, no random numbers. Sums are integers, and the rest is IEEE arithmetic
//! in a fixed order, so equal images give equal bits on every machine.
//!
//! ```
//! use spf_media::track::{TrackImage, PixelBox, Quality, Tracker};
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

mod area;
mod colour;
pub(crate) mod flow;
pub(crate) mod grey;
mod image;
mod template;

pub use area::{PixelBox, Shift};
pub use image::TrackImage;

use colour::{Colours, Map, Model, in_common};
use grey::Pyramid;
use template::{Match, Template};

/// The shortest side of a target's box that can be tracked, pixels: below, there are no corners and no pattern.
pub const SMALLEST: f64 = 12.0;
/// The middle part of a box that is tracked by [`Tracker::start_in_middle`], as a fraction of its sides, and the smallest such
/// part, pixels.
const MIDDLE: f64 = 0.6;
const LEAST_MIDDLE: f64 = 20.0;
/// The weakest pattern that can be tracked, standard deviation in grey levels.
const CONTRAST: f64 = 5.0;
/// Images without the target until it counts as lost.
const COAST: u32 = 5;
/// Resemblance that counts as the target where the flow agrees.
const SAME: f64 = 0.7;
/// Resemblance that counts as the target without flow.
const SURE: f64 = 0.85;
/// Resemblance at which a target is found again where it is expected.
const FOUND: f64 = 0.8;
/// Resemblance at which a target is found again anywhere: of many places, one resembles anything a little.
const FOUND_ELSEWHERE: f64 = 0.88;
/// Resemblance at which an older patch is preferred to all newer ones.
const FITS: f64 = 0.75;
/// Resemblance of a patch that is kept for later.
const KEEP: f64 = 0.85;
/// Least resemblance to the first patch.
const FIRST: f64 = 0.35;
/// Images between two patches that are kept.
const KEEP_EVERY: u32 = 8;
/// Patches that are kept besides the first.
const KEPT: usize = 4;
/// How much better than the next best place one must be.
const MARGIN: f64 = 0.1;
/// The shortest side of a box whose colours are learnt, pixels.
const PAINTED: f64 = 20.0;
/// How much more a box must show the target's colours than what is around it, to be tracked by them.
const PAINT: f64 = 0.35;
/// How much of that must be left, for the target to be held, and to be found again.
const PAINT_HELD: f64 = 0.6;
const PAINT_FOUND: f64 = 0.75;
/// How much more it must be than at the next best place.
const PAINT_MARGIN: f64 = 0.2;
/// How much of their colours two successive images of the same place have in common.
const SAME_PLACE: f64 = 0.6;
/// A box that ends this near to the image's edge is cut off there, pixels.
const EDGE: f64 = 5.0;
/// Images between two looks around for look-alikes.
const LOOK_EVERY: u32 = 4;

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
    before: Pyramid,
    /// The box that is tracked: the middle part of the target's, as a fraction of its sides.
    area: PixelBox,
    part: f64,
    scale: f64,
    quality: Quality,
    /// The motion from one image to the next, pixels, besides what was predicted.
    velocity: Shift,
    /// Patches of the target, oldest first; the first one is never replaced. Empty if there is nothing to track.
    patches: Vec<Template>,
    /// Images since the last patch was kept.
    since_kept: u32,
    /// Images since the target was last recognised.
    missing: u32,
    /// Found again in the last image, but not yet confirmed.
    found: bool,
    /// How much the most similar thing around the target resembles it.
    rival: f64,
    count: u32,
    /// The target's colours; `None` if it does not stand out by them.
    paint: Option<Paint>,
}

/// The target's colours, and the box that they fill.
#[derive(Clone, Debug)]
struct Paint {
    model: Model,
    /// The box that stands out by them in the last image.
    filled: PixelBox,
    /// The target's box there.
    last: PixelBox,
    /// How much the box of colours stood out in the first image.
    contrast: f64,
    /// The colours of the whole last image.
    image: Vec<u32>,
}

impl Tracker {
    /// Begins with the target's box in an image. [`Tracker::track`] tells whether there is something to track.
    #[must_use]
    pub fn start(image: &TrackImage, area: PixelBox) -> Self {
        Self::start_part(image, area, 1.0)
    }

    /// The same, but tracks the middle part of the box, unless that is too small: what lies behind a person shows on either side
    /// of them in their box, and moves otherwise. The box of each [`Track`] is the whole one.
    #[must_use]
    pub fn start_in_middle(image: &TrackImage, whole: PixelBox) -> Self {
        Self::start_part(image, whole, if MIDDLE * whole.side() >= LEAST_MIDDLE { MIDDLE } else { 1.0 })
    }

    fn start_part(image: &TrackImage, whole: PixelBox, part: f64) -> Self {
        let area = whole.scaled(part);
        let before = Pyramid::of(&image.grey);
        let mut tracker = Self {
            before,
            area,
            part,
            scale: 1.0,
            quality: Quality::Lost,
            velocity: Shift::default(),
            patches: Vec::new(),
            since_kept: 0,
            missing: 0,
            found: false,
            rival: 0.0,
            count: 0,
            paint: None,
        };
        if !area.is_sound() || area.inside(image.size()) < 0.5 || image.size().0.min(image.size().1) < 24 {
            return tracker;
        }
        if whole.side() < SMALLEST {
            tracker.quality = Quality::TooSmall;
            return tracker;
        }
        tracker.paint = image.colours.as_ref().filter(|_| area.side() >= PAINTED).and_then(|colours| Paint::of(colours, &area));
        let patch = Template::of(&tracker.before, &area);
        let plain = patch.contrast() < CONTRAST || flow::corners(&tracker.before, &area).len() < flow::FEWEST;
        if plain && tracker.paint.is_none() {
            return tracker;
        }
        tracker.patches.push(patch);
        tracker.quality = Quality::Good;
        tracker.look_around();
        tracker
    }

    /// The target in the last image.
    #[must_use]
    pub fn track(&self) -> Track {
        Track { area: self.area.scaled(1.0 / self.part), scale: self.scale, quality: self.quality }
    }

    /// Whether nothing is tracked any more: the box is below [`SMALLEST`], or had nothing to track from the start. No later
    /// image changes that.
    #[must_use]
    pub const fn is_over(&self) -> bool {
        self.patches.is_empty()
    }

    /// The target in the next image, which must have the size of the first. `predicted` is the shift that is known to come from
    /// the turning of the camera, none if it is not known. What else has moved the box in the last images is expected to go on.
    pub fn next(&mut self, image: &TrackImage, predicted: Option<Shift>) -> Track {
        let now = Pyramid::of(&image.grey);
        if self.patches.is_empty() || now.size() != self.before.size() {
            return self.track();
        }
        self.count = self.count.wrapping_add(1);
        let turned = predicted.filter(|shift| shift.x.is_finite() && shift.y.is_finite()).unwrap_or_default();
        let guess = Shift { x: turned.x + self.velocity.x, y: turned.y + self.velocity.y };
        self.expect_the_same_place(image.colours.as_ref());
        let map = image.colours.as_ref().zip(self.paint.as_ref()).map(|(colours, paint)| paint.model.map(colours));
        if self.missing == 0 || self.found {
            self.keep_hold(&now, map.as_ref(), guess, turned);
        } else {
            self.search(&now, map.as_ref(), guess);
        }
        if let (Some(colours), Some(map)) = (&image.colours, &map) {
            self.repaint(colours, map);
        }
        self.before = now;
        if self.quality == Quality::Good {
            if self.count.is_multiple_of(LOOK_EVERY) {
                self.look_around();
            }
            if self.area.side() < SMALLEST * self.part {
                self.quality = Quality::TooSmall;
                self.patches.clear();
            }
        }
        self.track()
    }

    /// A step from an image in which the target was recognised. `turned` is the part of the guess that the camera's turning makes.
    fn keep_hold(&mut self, now: &Pyramid, map: Option<&Map>, guess: Shift, turned: Shift) {
        let flow = flow::flow(&self.before, now, &self.area, guess);
        let moved = flow.map_or_else(|| self.area.moved(guess, 1.0), |flow| self.area.moved(flow.shift, flow.scale));
        let best = self.best(now, &moved);
        let (from, to) = (moved.centre(), best.area.centre());
        let apart = (to.0 - from.0).abs().max((to.1 - from.1).abs()) / moved.side();
        let agrees = flow.is_some_and(|flow| flow.agreeing >= 0.3) && apart < 0.15;
        let visible = best.area.inside(now.size()) >= 0.6;
        let first = self.patches.first().map_or(0.0, |first| first.score(now, &best.area));
        let same = visible && first >= FIRST && (best.score >= SURE || agrees && best.score >= SAME);
        let painted = if same { None } else { map.and_then(|map| self.by_colour(map, guess)) };
        let expected = self.area.moved(guess, 1.0);
        let Some(area) = (if same { Some(best.area) } else { painted }) else {
            self.miss(if agrees { moved } else { expected });
            return;
        };
        let centre = self.area.centre();
        let (to_x, to_y) = area.centre();
        let step = Shift { x: to_x - centre.0 - turned.x, y: to_y - centre.1 - turned.y };
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
        if same && flow.is_some_and(|flow| flow.agreeing >= 0.6) && best.score >= KEEP && self.since_kept >= KEEP_EVERY {
            if self.patches.len() > KEPT {
                self.patches.remove(1);
            }
            self.patches.push(Template::of(now, &self.area));
            self.since_kept = 0;
        }
    }

    /// A step from an image in which the target was not recognised.
    fn search(&mut self, now: &Pyramid, map: Option<&Map>, guess: Shift) {
        let expected = self.area.moved(guess, 1.0);
        let reach = (1.0 + 0.2 * f64::from(self.missing)).min(2.5);
        let found = self.found_by_pattern(now, &expected, reach);
        let Some(area) = found.or_else(|| map.and_then(|map| self.found_by_colour(map, guess, reach))) else {
            return self.miss(expected);
        };
        self.place(area);
        self.found = true;
        self.missing += 1;
        self.quality = Quality::Coasting;
    }

    /// Where something resembles the target, and nothing else does.
    fn found_by_pattern(&self, now: &Pyramid, expected: &PixelBox, reach: f64) -> Option<PixelBox> {
        let latest = self.patches.last()?;
        let places = latest.scan(now, expected, &[1.0, 0.87, 1.15], reach, 0.0, 3);
        let mut matches: Vec<Match> = places.iter().map(|place| self.best(now, &place.area)).collect();
        matches.sort_by(|a, b| b.score.total_cmp(&a.score));
        let best = matches.first()?;
        let (x, y) = best.area.centre();
        let centre = expected.centre();
        let apart = ((x - centre.0).abs() / expected.width()).max((y - centre.1).abs() / expected.height());
        let other = matches[1..].iter().find(|other| other.area.overlap(&best.area) < 0.3).map_or(0.0, |other| other.score);
        // With a look-alike about, only the place tells them apart, and that only for a while.
        let unlike = best.score > self.rival + MARGIN && best.score > other + MARGIN;
        let in_place = apart < 0.4 && self.missing <= 2 * COAST && best.score > other;
        let found = best.score >= FOUND && in_place || best.score >= FOUND_ELSEWHERE && unlike;
        (found && best.area.inside(now.size()) >= 0.7).then_some(best.area)
    }

    /// Gives the colours up where a film cuts to another place: something there may well have them.
    fn expect_the_same_place(&mut self, colours: Option<&Colours>) {
        let (Some(paint), Some(colours)) = (&mut self.paint, colours) else { return };
        let image = colours.shares();
        if in_common(&paint.image, &image) < SAME_PLACE {
            self.paint = None;
        } else {
            paint.image = image;
        }
    }

    /// Where the target's colours are, near where it is expected.
    fn by_colour(&self, map: &Map, guess: Shift) -> Option<PixelBox> {
        let paint = self.paint.as_ref()?;
        let (near, _) = map.scan(&paint.filled_at(&self.area.moved(guess, 1.0)), 0.3);
        let fit = map.align(&near.area, !is_cut(&near.area, self.before.size()));
        let stands_out = fit.contrast >= PAINT_HELD * paint.contrast;
        let area = paint.target_at(&fit.area);
        (stands_out && area.inside(self.before.size()) >= 0.6).then_some(area)
    }

    /// Where they are at all, if there is one such place only.
    fn found_by_colour(&self, map: &Map, guess: Shift, reach: f64) -> Option<PixelBox> {
        let paint = self.paint.as_ref()?;
        let (place, other) = map.scan(&paint.filled_at(&self.area.moved(guess, 1.0)), reach);
        let fit = map.align(&place.area, false);
        let is_alone = fit.contrast - other >= PAINT_MARGIN;
        let found = is_alone && fit.contrast >= PAINT_FOUND * paint.contrast;
        let area = paint.target_at(&fit.area);
        (found && area.inside(self.before.size()) >= 0.7).then_some(area)
    }

    /// Learns the colours of an image in which the target was recognised.
    fn repaint(&mut self, colours: &Colours, map: &Map) {
        let Some(paint) = &mut self.paint else { return };
        if self.quality != Quality::Good && !self.found {
            return;
        }
        // Found again, its box of colours is where the track has put it.
        let expected = paint.filled_at(&self.area);
        paint.filled = map.align(&expected, !is_cut(&expected, self.before.size())).area;
        paint.last = self.area;
        if self.quality == Quality::Good {
            paint.model.learn(colours, &paint.filled);
        }
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

    /// Notes how much something beside the target resembles it.
    fn look_around(&mut self) {
        let Some(latest) = self.patches.last() else { return };
        let places = latest.scan(&self.before, &self.area, &[1.0], 2.0, 0.75, 1);
        let seen = places.first().map_or(0.0, |place| place.score);
        self.rival = seen.max(0.9 * self.rival);
    }
}

impl Paint {
    fn of(colours: &Colours, area: &PixelBox) -> Option<Self> {
        let model = Model::of(colours, area)?;
        let filled = model.map(colours).fit(area);
        (filled.contrast >= PAINT).then(|| Self {
            model,
            filled: filled.area,
            last: *area,
            contrast: filled.contrast,
            image: colours.shares(),
        })
    }

    /// The target's box if the box of colours has become `filled`.
    fn target_at(&self, filled: &PixelBox) -> PixelBox {
        self.last.carried(&self.filled, filled)
    }

    /// The box of colours if the target's box has become `area`.
    fn filled_at(&self, area: &PixelBox) -> PixelBox {
        self.filled.carried(&self.last, area)
    }
}

/// Whether the left or right edge of an image of this width cuts a box off: its width, which tells its size, is not seen then.
fn is_cut(area: &PixelBox, (width, _): (u32, u32)) -> bool {
    area.left < EDGE || area.right > f64::from(width) - EDGE
}
