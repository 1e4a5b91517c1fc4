//! Labelled pointing data: images of a scene with an instruction each, what it means in the image, and all that the oracle
//! reads (docs/dataset.md).
//!
//! An example follows from the scene, the recipe and its number alone, so that examples can be made in any order and a folder
//! that was cut short can be gone on with. What an instruction means is decided by the language of the truth, over the objects
//! that the image shows: an example whose words are not clear to it is not made.

mod place;
pub mod record;
mod views;
mod wording;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::query::ImagePoint;
use spf_core::rng::Draw;
use spf_core::time::Time;
use spf_media::frame::Rgb;

use spf_core::tags::Tagged;
use spf_oracle::{Mask, Placed, SIZE_SENT, masks, resolve_truth};
use spf_render::effects::{Effects, Eye, Shot};
use spf_render::surroundings::Surroundings;
use spf_render::{Channels, Picture, Renderer};
use spf_scene::actors::ActorPlace;
use spf_scene::geometry::{ObjectId, Part, SceneGeometry};

use crate::sim::{LoadedScene, WorldSnapshot};
use place::Plainly;
use views::Views;
pub use wording::Wording;
use wording::{PLACES, instructions, shuffle};

/// Views that are drawn for one example before it is given up.
const ATTEMPTS: u64 = 3000;
/// Hidden things whose names are tried for one absent target.
const HIDDEN: usize = 40;
/// A look-alike has at least this many pixels at [`SIZE_SENT`]: even odds of being noticed.
const LOOK_ALIKE_PIXELS: f64 = 64.0;
/// A first glance is this many times coarser than the image.
const GLANCE: u32 = 3;
/// Actors have moved for up to this long, seconds.
const TRAFFIC: f64 = 60.0;
/// Kinds that are everywhere in a room: nobody is sent to them.
const BACKDROPS: [&str; 2] = ["wall", "ceiling"];
/// A target fills at most this fraction of the image, for an image of one surface is an image of nothing …
const FILLS: f64 = 0.6;
/// … at least this fraction of its silhouette is inside the frame unless it fills a tenth of it (as the oracle counts a thing as in
/// view) …
const IN_FRAME: f32 = 0.25;
/// … and at most this fraction of what is inside the frame is hidden.
const HIDDEN_SHARE: f64 = 0.85;
/// At most this fraction of the image may be something nearer than half of the scene's `near` that is not the target.
const BLOCKED: f64 = 0.4;

/// What is to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    /// Seed of everything.
    pub seed: u64,
    /// The bare camera, at the size of the images.
    pub camera: Camera,
    /// What the camera does to its images.
    pub effects: Effects,
    /// Fraction of examples whose target is not in the image.
    pub absent: f64,
    /// Fraction of examples whose image holds something of the target's name in another colour or of another quality.
    pub look_alikes: f64,
    /// A target has at least this many pixels at [`SIZE_SENT`].
    pub min_pixels: u32,
}

/// What an example asks of who points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The target is in the image.
    Present,
    /// The target is in the image, and so is something of its name that is not meant.
    LookAlike,
    /// The target is not in the image.
    Absent,
}

impl Recipe {
    /// The kind of an example. Shares hold for any stretch of numbers, to within two examples: the fractional parts of multiples
    /// of the golden ratio lie evenly.
    #[must_use]
    pub fn kind(&self, number: u64) -> Kind {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let first = Draw::new(self.seed, "dataset kinds", &[]).uniform();
        let at = first + GOLDEN * number as f64;
        let at = at - libm::floor(at);
        if at < self.absent {
            Kind::Absent
        } else if at < self.absent + self.look_alikes {
            Kind::LookAlike
        } else {
            Kind::Present
        }
    }
}

/// An object with a pixel in the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Visible {
    /// Its number in the id image, or in that of openings.
    pub id: ObjectId,
    /// Its key in the scene.
    pub key: String,
    /// Whether it is an opening.
    pub opening: bool,
    /// Its pixels.
    pub pixels: u64,
    /// Fraction of its silhouette inside the frame, 0..=1.
    pub in_frame: f32,
    /// Light on it, 0 dark ..= 1 daylight.
    pub light: f32,
}

/// What the instruction means in the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Its number.
    pub id: ObjectId,
    /// Its key in the scene.
    pub key: String,
    /// Whether it is an opening.
    pub opening: bool,
    /// The pixel deepest inside its mask, `[x, y]` from the upper left.
    pub point: [u32; 2],
    /// `[x0, y0, x1, y1]`: the smallest box around the mask, from `x0` and `y0` up to, not with, `x1` and `y1`.
    #[serde(rename = "box")]
    pub bounds: [u32; 4],
    /// Pixels of the mask.
    pub pixels: u64,
    /// From the lens to the surface seen at `point`, metres.
    pub distance_m: f64,
    /// From the lens to the nearest surface of the object, metres.
    pub nearest_m: f64,
    /// Fraction of its silhouette inside the frame that something hides, 0..=1.
    pub occlusion: f64,
}

/// One example.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// What it asks.
    pub kind: Kind,
    /// What is said.
    pub instruction: String,
    /// In which manner.
    pub wording: Wording,
    /// What is meant; none when it is not in the image.
    pub target: Option<Target>,
    /// Things in the image of the target's name that are not meant; also those of an absent target's.
    pub look_alikes: Vec<ObjectId>,
    /// Where the camera was.
    pub pose: Pose,
    /// The photograph.
    pub photograph: Rgb,
    /// Ids, depth, openings and their depth, as the oracle reads them.
    pub truth: Picture,
    /// Everything with a pixel in it, ascending by number.
    pub visible: Vec<Visible>,
}

impl Example {
    /// The target's mask, row by row; none without a target.
    #[must_use]
    pub fn mask(&self) -> Option<Vec<bool>> {
        let target = self.target.as_ref()?;
        let ids = if target.opening { &self.truth.opening_ids } else { &self.truth.ids };
        Some(ids.as_ref()?.iter().map(|id| *id == target.id).collect())
    }
}

/// Makes examples in one scene.
pub struct Generator<'a> {
    loaded: &'a LoadedScene,
    recipe: Recipe,
    eye: Eye,
    around: Surroundings,
    /// Things by first name: each name has the same chance, however many bear it.
    groups: Vec<Vec<ObjectId>>,
    /// Those with a look-alike somewhere.
    alike: Vec<Vec<ObjectId>>,
    /// Objects drawn alone, for their whole silhouettes.
    alone: BTreeMap<ObjectId, Renderer>,
    glance: Picture,
    scratch: Picture,
}

impl<'a> Generator<'a> {
    /// A generator of examples in a scene.
    #[must_use]
    pub fn new(loaded: &'a LoadedScene, recipe: Recipe) -> Self {
        let tags = &loaded.tags;
        let eye = Eye::new(recipe.camera, recipe.effects.clone(), recipe.seed);
        let around = Surroundings::of(eye.camera());
        let groups = groups(tags.iter().filter(|tags| !tags.is_surface() && !BACKDROPS.contains(&tags.kind.as_str())));
        let alike = groups
            .iter()
            .map(|group| group.iter().copied().filter(|id| tags.iter().any(|other| is_look_alike(tags, *id, other))).collect())
            .filter(|group: &Vec<ObjectId>| !group.is_empty())
            .collect();
        Self {
            loaded,
            recipe,
            eye,
            around,
            groups,
            alike,
            alone: BTreeMap::new(),
            glance: Picture::default(),
            scratch: Picture::default(),
        }
    }

    /// The camera of the images, with its lens.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        self.eye.camera()
    }

    /// Whether the scene holds what examples of this kind need.
    #[must_use]
    pub fn can_make(&self, kind: Kind) -> bool {
        !if kind == Kind::LookAlike { &self.alike } else { &self.groups }.is_empty()
    }

    /// The example of that number; none when no view was found, which happens where a scene holds nothing of the kind.
    pub fn example(&mut self, number: u64) -> Option<Example> {
        let kind = self.recipe.kind(number);
        let at = Time::from_secs_f64(TRAFFIC * Draw::new(self.recipe.seed, "dataset traffic", &[number]).uniform());
        let actors = self.loaded.snapshot(Pose::default(), self.recipe.seed, at).actors;
        (0..ATTEMPTS).find_map(|attempt| self.attempt(kind, number, attempt, &actors))
    }

    fn attempt(&mut self, kind: Kind, number: u64, attempt: u64, actors: &[ActorPlace]) -> Option<Example> {
        let mut draw = Draw::new(self.recipe.seed, "dataset view", &[number, attempt]);
        let groups = if kind == Kind::LookAlike { &self.alike } else { &self.groups };
        let group = groups.get(draw.below(groups.len()))?;
        let focus = *group.get(draw.below(group.len()))?;
        let object = self.loaded.scene.object(focus)?;
        let pose = Views { loaded: self.loaded, actors, camera: self.eye.camera() }.of(object, &mut draw)?;
        let snapshot = WorldSnapshot { pose, actors: actors.to_vec() };
        if !self.glance_shows(&snapshot, kind, focus) {
            return None;
        }
        let mut truth = Picture::default();
        self.eye.look(self.eye.camera(), &mut truth, |camera, picture| {
            self.loaded.render_into(camera, &snapshot, Channels::TRUTH, picture);
        });
        let seen = seen(&truth);
        let mask = seen.iter().find(|mask| mask.id == focus)?;
        if !self.is_large(mask.area, f64::from(self.recipe.min_pixels), &truth) || self.is_blocked(&truth, focus) {
            return None;
        }
        let visible = self.visible(&snapshot, &truth, &seen);
        let share = mask.area as f64 / (f64::from(truth.width) * f64::from(truth.height));
        let in_frame = visible.iter().find(|thing| thing.id == focus)?.in_frame;
        if share > FILLS || (share < 0.1 && in_frame < IN_FRAME) {
            return None;
        }
        let (wording, instruction, meant) = match kind {
            Kind::Absent => self.absent(&visible, &snapshot, &mut draw)?,
            _ => self.present(kind, focus, &visible, (&snapshot, &Plainly { masks: &seen, truth: &truth }), &mut draw)?,
        };
        let look_alikes = self.look_alikes(meant, &visible);
        let target = match kind {
            Kind::Absent => None,
            _ => Some(self.target(mask, &snapshot, &truth).filter(|target| target.occlusion <= HIDDEN_SHARE)?),
        };
        let shot = Shot::still(Time::from_nanos(number), snapshot);
        let photograph = self.eye.photograph(&shot, None, |camera, snapshot, picture| {
            self.loaded.render_into(camera, snapshot, Channels::RGB, picture);
        });
        Some(Example { kind, instruction, wording, target, look_alikes, pose, photograph, truth, visible })
    }

    /// Whether a coarse look finds what the example is about.
    fn glance_shows(&mut self, snapshot: &WorldSnapshot, kind: Kind, focus: ObjectId) -> bool {
        let camera = self.eye.camera();
        let camera = camera.resized((camera.width / GLANCE).max(1), (camera.height / GLANCE).max(1));
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.loaded.render_into(&camera, snapshot, channels, &mut self.glance);
        let picture = &self.glance;
        let counts = counts(picture);
        let shows = |id: ObjectId, least: f64| counts.get(&id).is_some_and(|pixels| self.is_large(*pixels, least, picture));
        let alike = || {
            let mut others = self.loaded.tags.iter().filter(|other| is_look_alike(&self.loaded.tags, focus, other));
            others.any(|other| shows(other.id, LOOK_ALIKE_PIXELS))
        };
        // Somewhat less will do: the image itself decides.
        shows(focus, 0.7 * f64::from(self.recipe.min_pixels)) && (kind != Kind::LookAlike || alike())
    }

    /// Whether pixels of an image would be `least` at [`SIZE_SENT`].
    fn is_large(&self, pixels: u64, least: f64, picture: &Picture) -> bool {
        let sent = f64::from(SIZE_SENT.0) * f64::from(SIZE_SENT.1);
        pixels as f64 * sent >= least * f64::from(picture.width) * f64::from(picture.height)
    }

    /// Whether something else right before the lens hides the view.
    fn is_blocked(&self, truth: &Picture, focus: ObjectId) -> bool {
        let (Some(ids), Some(depth)) = (&truth.ids, &truth.depth) else { return true };
        let close = (0.5 * self.loaded.scene.near) as f32;
        let blocked = ids.iter().zip(depth).filter(|(id, depth)| **id != focus && (0.01..close).contains(*depth)).count();
        blocked as f64 > BLOCKED * ids.len() as f64
    }

    fn visible(&mut self, snapshot: &WorldSnapshot, truth: &Picture, seen: &[Mask]) -> Vec<Visible> {
        let light = self.loaded.renderer.light_on(self.eye.camera(), &snapshot.pose, truth);
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.loaded.render_into(self.around.camera(), snapshot, channels, &mut self.scratch);
        let shares = self.around.shares(&self.scratch);
        let visible = |mask: &Mask| {
            let tags = self.tags_of(mask.id)?;
            Some(Visible {
                id: mask.id,
                key: tags.key.clone(),
                opening: tags.opening,
                pixels: mask.area,
                in_frame: shares.get(&mask.id).copied().unwrap_or(1.0),
                // What is not listed is clear.
                light: light.get(&mask.id).copied().unwrap_or(1.0),
            })
        };
        seen.iter().filter_map(visible).collect()
    }

    /// Words for the object in focus that mean it alone among what is visible.
    fn present(
        &self,
        kind: Kind,
        focus: ObjectId,
        visible: &[Visible],
        (snapshot, plainly): (&WorldSnapshot, &Plainly<'_>),
        draw: &mut Draw,
    ) -> Option<(Wording, String, ObjectId)> {
        let tags = self.tags_of(focus)?;
        let alike = self.look_alikes(focus, visible);
        if kind == Kind::LookAlike && alike.is_empty() {
            return None;
        }
        let shown = self.placed(snapshot, |id| visible.iter().any(|thing| thing.id == id));
        let clear = |(wording, instruction): &(Wording, String)| {
            let meant = resolve_truth(instruction, &shown, Some(snapshot.pose));
            // "The leftmost chair" is the leftmost of what "the chair" may mean.
            let plain = PLACES.iter().filter(|_| *wording == Wording::Place).all(|place| {
                let without = instruction.replacen(&format!("{place} "), "", 1);
                without == *instruction || plainly.holds(place, focus, &resolve_truth(&without, &shown, None).objects)
            });
            (kind == Kind::Present || wording.by_look()) && meant.checkable && meant.objects == [focus] && plain
        };
        let (wording, instruction) = instructions(tags, draw).into_iter().find(clear)?;
        Some((wording, instruction, focus))
    }

    /// Words for something in the scene that mean nothing of what is visible; half of the time something whose like is visible.
    fn absent(&self, visible: &[Visible], snapshot: &WorldSnapshot, draw: &mut Draw) -> Option<(Wording, String, ObjectId)> {
        let is_shown = |id: ObjectId| visible.iter().any(|thing| thing.id == id);
        let (shown, all) = (self.placed(snapshot, is_shown), self.placed(snapshot, |_| true));
        let mut hidden: Vec<ObjectId> = Vec::new();
        for group in &self.groups {
            let unseen: Vec<ObjectId> = group.iter().copied().filter(|id| !is_shown(*id)).collect();
            hidden.extend(unseen.get(draw.below(unseen.len())));
        }
        shuffle(&mut hidden, draw);
        if draw.chance(0.5) {
            hidden.sort_by_key(|id| self.look_alikes(*id, visible).is_empty());
        }
        for id in hidden.into_iter().take(HIDDEN) {
            let tags = self.tags_of(id)?;
            // What is leftmost, or of use, in an image is so whatever stands elsewhere.
            let plain = |(wording, _): &(Wording, String)| !matches!(wording, Wording::Place | Wording::Use);
            let means_nothing = |(_, instruction): &(Wording, String)| {
                let here = resolve_truth(instruction, &shown, Some(snapshot.pose));
                here.checkable && !here.fits && resolve_truth(instruction, &all, Some(snapshot.pose)).objects.contains(&id)
            };
            if let Some((wording, instruction)) = instructions(tags, draw).into_iter().filter(plain).find(means_nothing) {
                return Some((wording, instruction, id));
            }
        }
        None
    }

    /// What is visible and of the same name as an object, but of another colour or quality.
    fn look_alikes(&self, of: ObjectId, visible: &[Visible]) -> Vec<ObjectId> {
        let alike = |thing: &&Visible| self.tags_of(thing.id).is_some_and(|other| is_look_alike(&self.loaded.tags, of, other));
        visible.iter().filter(alike).map(|thing| thing.id).collect()
    }

    fn tags_of(&self, id: ObjectId) -> Option<&Tagged> {
        self.loaded.tags.iter().find(|tags| tags.id == id)
    }

    fn placed(&self, snapshot: &WorldSnapshot, which: impl Fn(ObjectId) -> bool) -> Vec<Placed<'_>> {
        let mut placed = self.loaded.placed(&snapshot.actors);
        placed.retain(|placed| which(placed.tags.id));
        placed
    }

    fn target(&mut self, mask: &Mask, snapshot: &WorldSnapshot, truth: &Picture) -> Option<Target> {
        let tags = self.tags_of(mask.id)?;
        let (key, opening) = (tags.key.clone(), tags.opening);
        let (w, h) = (truth.width as usize, truth.height as usize);
        let (x, y) = mask.deepest;
        let depth = if opening { &truth.opening_depth } else { &truth.depth };
        let along = f64::from(*depth.as_ref()?.get(y * w + x)?);
        let point = ImagePoint { u: (x as f64 + 0.5) / w as f64, v: (y as f64 + 0.5) / h as f64 };
        let ray = self.eye.camera().ray(point);
        let nearest_m = self.loaded.distance_to(mask.id, &snapshot.actors, snapshot.pose.position)?;
        let whole = self.silhouette(mask.id, opening, snapshot)?;
        let pixel = |at: usize| at as u32;
        Some(Target {
            id: mask.id,
            key,
            opening,
            point: [pixel(x), pixel(y)],
            bounds: [mask.left, mask.top, mask.right + 1, mask.bottom + 1].map(pixel),
            pixels: mask.area,
            distance_m: along * libm::sqrt(1.0 + ray.right * ray.right + ray.up * ray.up),
            nearest_m,
            occlusion: (1.0 - mask.area as f64 / whole.max(mask.area) as f64).clamp(0.0, 1.0),
        })
    }

    /// Pixels of an object inside the frame if nothing stood before it.
    fn silhouette(&mut self, id: ObjectId, opening: bool, snapshot: &WorldSnapshot) -> Option<u64> {
        let LoadedScene { scene, cast, .. } = self.loaded;
        let moving: Vec<Part> = cast.parts(&snapshot.actors, |_, _| true).into_iter().filter(|part| part.object == id).collect();
        let alone = self.alone.entry(id).or_insert_with(|| {
            let parts: Vec<Part> = scene.geometry.parts.iter().filter(|part| part.object == id).cloned().collect();
            Renderer::new(&SceneGeometry { parts, ..scene.geometry.clone() })
        });
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.eye.look(self.eye.camera(), &mut self.scratch, |camera, picture| {
            alone.render_into(camera, &snapshot.pose, channels, &moving, picture);
        });
        let ids = if opening { &self.scratch.opening_ids } else { &self.scratch.ids };
        Some(ids.as_ref()?.iter().filter(|seen| **seen == id).count() as u64)
    }
}

/// Objects by first name, in the order of the names.
fn groups<'t>(tags: impl Iterator<Item = &'t Tagged>) -> Vec<Vec<ObjectId>> {
    let mut named: BTreeMap<&str, Vec<ObjectId>> = BTreeMap::new();
    for tags in tags {
        named.entry(tags.names.first().unwrap_or(&tags.kind)).or_default().push(tags.id);
    }
    named.into_values().collect()
}

/// Whether `other` has a name of the object `of`, but another colour or other qualities.
fn is_look_alike(tags: &[Tagged], of: ObjectId, other: &Tagged) -> bool {
    let Some(tags) = tags.iter().find(|tags| tags.id == of) else { return false };
    let named = tags.names.iter().any(|name| other.names.contains(name));
    other.id != of && named && (other.colour != tags.colour || other.qualities != tags.qualities)
}

/// Masks of both id images, ascending by number. An object is drawn into one of the two.
fn seen(truth: &Picture) -> Vec<Mask> {
    let channels = [truth.ids.as_deref(), truth.opening_ids.as_deref()];
    let mut all: Vec<Mask> = channels.into_iter().flatten().flat_map(|ids| masks(ids, truth.width as usize)).collect();
    all.sort_by_key(|mask| mask.id);
    all
}

/// Pixels of each object in both id images.
fn counts(picture: &Picture) -> BTreeMap<ObjectId, u64> {
    let mut counts = BTreeMap::new();
    for ids in [picture.ids.as_deref(), picture.opening_ids.as_deref()].into_iter().flatten() {
        for run in ids.chunk_by(|a, b| a == b) {
            if let Some(&id) = run.first().filter(|id| **id != 0) {
                *counts.entry(id).or_default() += run.len() as u64;
            }
        }
    }
    counts
}
