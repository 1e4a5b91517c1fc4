//! Labelled pointing data: images of a scene with an instruction each, what it means in the image, and all that the oracle
//! reads (docs/guide/dataset.md).
//!
//! An example depends only on the scene, the recipe and its number, so examples can be generated in any order and an
//! interrupted run can be resumed. The judge's language parser resolves each instruction over the objects visible in
//! the image; examples that are ambiguous to it are discarded.

mod place;
pub mod record;
mod views;
mod wording;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::query::ImagePoint;
use spf_core::rng::RandomStream;
use spf_core::time::Time;
use spf_media::frame::Rgb;

use spf_core::tags::Tagged;
use spf_oracle::{Mask, Placed, SIZE_SENT, masks, resolve_truth};
use spf_render::effects::{Effects, Shot, SimCamera};
use spf_render::surroundings::Surroundings;
use spf_render::{Channels, RenderedImage, Renderer};
use spf_scene::actors::ActorPlace;
use spf_scene::geometry::{ObjectId, Part, SceneGeometry};

use crate::sim::{LoadedScene, WorldSnapshot};
use place::Plainly;
use views::Views;
pub use wording::Wording;
use wording::{PLACES, instructions, shuffle};

/// Number of views tried for one example before giving up.
const ATTEMPTS: u64 = 3000;
/// Number of hidden objects whose names are tried for one absent target.
const HIDDEN: usize = 40;
/// Minimum pixels of a look-alike at [`SIZE_SENT`]: the size at which it is noticed half of the time.
const LOOK_ALIKE_PIXELS: f64 = 64.0;
/// Downscaling factor of the preview render.
const GLANCE: u32 = 3;
/// Maximum time for which actors have moved, seconds.
const TRAFFIC: f64 = 60.0;
/// Kinds present everywhere in a room, which are no useful targets.
const BACKDROPS: [&str; 2] = ["wall", "ceiling"];
/// Maximum fraction of the image that a target fills, since an image of a single surface is uninformative …
const FILLS: f64 = 0.6;
/// … minimum fraction of its silhouette inside the frame unless it fills a tenth of it (the oracle's criterion for "in
/// view") …
const IN_FRAME: f32 = 0.25;
/// … and maximum fraction of the silhouette inside the frame that is hidden.
const HIDDEN_FRACTION: f64 = 0.85;
/// Maximum fraction of the image covered by other objects nearer than half of the scene's `near`.
const BLOCKED: f64 = 0.4;

/// Parameters of a dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    /// Seed of all random choices.
    pub seed: u64,
    /// The camera without lens distortion, at the size of the images.
    pub camera: Camera,
    /// Simulated camera effects.
    pub effects: Effects,
    /// Fraction of examples whose target is not in the image.
    pub absent: f64,
    /// Fraction of examples whose image contains an object with the target's name but another colour or quality.
    pub look_alikes: f64,
    /// Minimum pixels of a target at [`SIZE_SENT`].
    pub min_pixels: u32,
}

/// Kind of an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The target is in the image.
    Present,
    /// The target is in the image, together with an object of the same name that is not meant.
    LookAlike,
    /// The target is not in the image.
    Absent,
}

impl Recipe {
    /// The kind of example `number`. The requested fractions hold for any range of numbers to within two examples,
    /// since the fractional parts of multiples of the golden ratio are evenly distributed.
    #[must_use]
    pub fn kind(&self, number: u64) -> Kind {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let first = RandomStream::new(self.seed, "dataset kinds", &[]).uniform();
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

/// An object visible in the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Visible {
    /// Its id in the id image, or in the id image of openings.
    pub id: ObjectId,
    /// Its key in the scene.
    pub key: String,
    /// Whether it is an opening.
    pub opening: bool,
    /// Number of visible pixels.
    pub pixels: u64,
    /// Fraction of its silhouette inside the frame, 0..=1.
    pub in_frame: f32,
    /// Light on it, 0 dark ..= 1 daylight.
    pub light: f32,
}

/// The target of the instruction in the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Object id.
    pub id: ObjectId,
    /// Its key in the scene.
    pub key: String,
    /// Whether it is an opening.
    pub opening: bool,
    /// The pixel deepest inside its mask, `[x, y]` from the upper left.
    pub point: [u32; 2],
    /// `[x0, y0, x1, y1]`: bounding box of the mask; `x1` and `y1` are exclusive.
    #[serde(rename = "box")]
    pub bounds: [u32; 4],
    /// Number of pixels of the mask.
    pub pixels: u64,
    /// Distance from the lens to the surface visible at `point`, metres.
    pub distance_m: f64,
    /// Distance from the lens to the nearest surface of the object, metres.
    pub nearest_m: f64,
    /// Occluded fraction of its silhouette inside the frame, 0..=1.
    pub occlusion: f64,
}

/// One example.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// Kind of the example.
    pub kind: Kind,
    /// The instruction.
    pub instruction: String,
    /// How the instruction describes its target.
    pub wording: Wording,
    /// The target; `None` if it is not in the image.
    pub target: Option<Target>,
    /// Visible objects with the target's name that are not meant; also for an absent target.
    pub look_alikes: Vec<ObjectId>,
    /// Camera pose.
    pub pose: Pose,
    /// The camera image.
    pub photograph: Rgb,
    /// Ground truth images: ids, depth, openings and their depth, as the oracle reads them.
    pub truth: RenderedImage,
    /// All visible objects, by ascending id.
    pub visible: Vec<Visible>,
}

impl Example {
    /// The target's mask in row order; `None` without a target.
    #[must_use]
    pub fn mask(&self) -> Option<Vec<bool>> {
        let target = self.target.as_ref()?;
        let ids = if target.opening { &self.truth.opening_ids } else { &self.truth.ids };
        Some(ids.as_ref()?.iter().map(|id| *id == target.id).collect())
    }
}

/// Generates the examples of one scene.
pub struct Generator<'a> {
    loaded: &'a LoadedScene,
    recipe: Recipe,
    sim_camera: SimCamera,
    around: Surroundings,
    /// Objects by first name: each name has the same probability, however many objects share it.
    groups: Vec<Vec<ObjectId>>,
    /// The groups that contain a look-alike.
    alike: Vec<Vec<ObjectId>>,
    /// Renderers of single objects, for their complete silhouettes.
    alone: BTreeMap<ObjectId, Renderer>,
    glance: RenderedImage,
    scratch: RenderedImage,
}

impl<'a> Generator<'a> {
    /// A generator for a scene.
    #[must_use]
    pub fn new(loaded: &'a LoadedScene, recipe: Recipe) -> Self {
        let tags = &loaded.tags;
        let sim_camera = SimCamera::new(recipe.camera, recipe.effects.clone(), recipe.seed);
        let around = Surroundings::of(sim_camera.camera());
        let groups = groups(tags.iter().filter(|tags| !tags.is_surface() && !BACKDROPS.contains(&tags.kind.as_str())));
        let alike = groups
            .iter()
            .map(|group| group.iter().copied().filter(|id| tags.iter().any(|other| is_look_alike(tags, *id, other))).collect())
            .filter(|group: &Vec<ObjectId>| !group.is_empty())
            .collect();
        Self {
            loaded,
            recipe,
            sim_camera,
            around,
            groups,
            alike,
            alone: BTreeMap::new(),
            glance: RenderedImage::default(),
            scratch: RenderedImage::default(),
        }
    }

    /// The camera of the images, including lens distortion.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        self.sim_camera.camera()
    }

    /// Whether the scene has the objects needed for this kind of example.
    #[must_use]
    pub fn can_make(&self, kind: Kind) -> bool {
        !if kind == Kind::LookAlike { &self.alike } else { &self.groups }.is_empty()
    }

    /// Generates example `number`; `None` if no suitable view was found.
    pub fn example(&mut self, number: u64) -> Option<Example> {
        let kind = self.recipe.kind(number);
        let at = Time::from_secs_f64(TRAFFIC * RandomStream::new(self.recipe.seed, "dataset traffic", &[number]).uniform());
        let actors = self.loaded.snapshot(Pose::default(), self.recipe.seed, at).actors;
        (0..ATTEMPTS).find_map(|attempt| self.attempt(kind, number, attempt, &actors))
    }

    fn attempt(&mut self, kind: Kind, number: u64, attempt: u64, actors: &[ActorPlace]) -> Option<Example> {
        let mut rng = RandomStream::new(self.recipe.seed, "dataset view", &[number, attempt]);
        let groups = if kind == Kind::LookAlike { &self.alike } else { &self.groups };
        let group = groups.get(rng.below(groups.len()))?;
        let focus = *group.get(rng.below(group.len()))?;
        let object = self.loaded.scene.object(focus)?;
        let pose = Views { loaded: self.loaded, actors, camera: self.sim_camera.camera() }.of(object, &mut rng)?;
        let snapshot = WorldSnapshot { pose, actors: actors.to_vec() };
        if !self.glance_shows(&snapshot, kind, focus) {
            return None;
        }
        let mut truth = RenderedImage::default();
        self.sim_camera.look(self.sim_camera.camera(), &mut truth, |camera, image| {
            self.loaded.render_into(camera, &snapshot, Channels::TRUTH, image);
        });
        let seen = seen(&truth);
        let mask = seen.iter().find(|mask| mask.id == focus)?;
        if !self.is_large(mask.area, f64::from(self.recipe.min_pixels), &truth) || self.is_blocked(&truth, focus) {
            return None;
        }
        let visible = self.visible(&snapshot, &truth, &seen);
        let fraction = mask.area as f64 / (f64::from(truth.width) * f64::from(truth.height));
        let in_frame = visible.iter().find(|thing| thing.id == focus)?.in_frame;
        if fraction > FILLS || (fraction < 0.1 && in_frame < IN_FRAME) {
            return None;
        }
        let (wording, instruction, meant) = match kind {
            Kind::Absent => self.absent(&visible, &snapshot, &mut rng)?,
            _ => self.present(kind, focus, &visible, (&snapshot, &Plainly { masks: &seen, truth: &truth }), &mut rng)?,
        };
        let look_alikes = self.look_alikes(meant, &visible);
        let target = match kind {
            Kind::Absent => None,
            _ => Some(self.target(mask, &snapshot, &truth).filter(|target| target.occlusion <= HIDDEN_FRACTION)?),
        };
        let shot = Shot::still(Time::from_nanos(number), snapshot);
        let photograph = self.sim_camera.photograph(&shot, None, |camera, snapshot, image| {
            self.loaded.render_into(camera, snapshot, Channels::RGB, image);
        });
        Some(Example { kind, instruction, wording, target, look_alikes, pose, photograph, truth, visible })
    }

    /// Whether a coarse preview shows the objects that the example needs.
    fn glance_shows(&mut self, snapshot: &WorldSnapshot, kind: Kind, focus: ObjectId) -> bool {
        let camera = self.sim_camera.camera();
        let camera = camera.resized((camera.width / GLANCE).max(1), (camera.height / GLANCE).max(1));
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.loaded.render_into(&camera, snapshot, channels, &mut self.glance);
        let image = &self.glance;
        let counts = counts(image);
        let shows = |id: ObjectId, least: f64| counts.get(&id).is_some_and(|pixels| self.is_large(*pixels, least, image));
        let alike = || {
            let mut others = self.loaded.tags.iter().filter(|other| is_look_alike(&self.loaded.tags, focus, other));
            others.any(|other| shows(other.id, LOOK_ALIKE_PIXELS))
        };
        // A slightly lower threshold: the full image decides.
        shows(focus, 0.7 * f64::from(self.recipe.min_pixels)) && (kind != Kind::LookAlike || alike())
    }

    /// Whether `pixels` in `image` correspond to at least `least` at [`SIZE_SENT`].
    fn is_large(&self, pixels: u64, least: f64, image: &RenderedImage) -> bool {
        let sent = f64::from(SIZE_SENT.0) * f64::from(SIZE_SENT.1);
        pixels as f64 * sent >= least * f64::from(image.width) * f64::from(image.height)
    }

    /// Whether another object close to the lens blocks the view.
    fn is_blocked(&self, truth: &RenderedImage, focus: ObjectId) -> bool {
        let (Some(ids), Some(depth)) = (&truth.ids, &truth.depth) else { return true };
        let close = (0.5 * self.loaded.scene.near) as f32;
        let blocked = ids.iter().zip(depth).filter(|(id, depth)| **id != focus && (0.01..close).contains(*depth)).count();
        blocked as f64 > BLOCKED * ids.len() as f64
    }

    fn visible(&mut self, snapshot: &WorldSnapshot, truth: &RenderedImage, seen: &[Mask]) -> Vec<Visible> {
        let light = self.loaded.renderer.light_on(self.sim_camera.camera(), &snapshot.pose, truth);
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.loaded.render_into(self.around.camera(), snapshot, channels, &mut self.scratch);
        let fractions = self.around.fractions(&self.scratch);
        let visible = |mask: &Mask| {
            let tags = self.tags_of(mask.id)?;
            Some(Visible {
                id: mask.id,
                key: tags.key.clone(),
                opening: tags.opening,
                pixels: mask.area,
                in_frame: fractions.get(&mask.id).copied().unwrap_or(1.0),
                // Objects not listed are fully lit.
                light: light.get(&mask.id).copied().unwrap_or(1.0),
            })
        };
        seen.iter().filter_map(visible).collect()
    }

    /// An instruction for the object in focus that is unambiguous among the visible objects.
    fn present(
        &self,
        kind: Kind,
        focus: ObjectId,
        visible: &[Visible],
        (snapshot, plainly): (&WorldSnapshot, &Plainly<'_>),
        rng: &mut RandomStream,
    ) -> Option<(Wording, String, ObjectId)> {
        let tags = self.tags_of(focus)?;
        let alike = self.look_alikes(focus, visible);
        if kind == Kind::LookAlike && alike.is_empty() {
            return None;
        }
        let shown = self.placed(snapshot, |id| visible.iter().any(|thing| thing.id == id));
        let clear = |(wording, instruction): &(Wording, String)| {
            let meant = resolve_truth(instruction, &shown, Some(snapshot.pose));
            // "The leftmost chair" is the leftmost of the objects that "the chair" may mean.
            let plain = PLACES.iter().filter(|_| *wording == Wording::Place).all(|place| {
                let without = instruction.replacen(&format!("{place} "), "", 1);
                without == *instruction || plainly.holds(place, focus, &resolve_truth(&without, &shown, None).objects)
            });
            (kind == Kind::Present || wording.by_look()) && meant.checkable && meant.objects == [focus] && plain
        };
        let (wording, instruction) = instructions(tags, rng).into_iter().find(clear)?;
        Some((wording, instruction, focus))
    }

    /// An instruction for an object of the scene that matches nothing visible; in half of the cases a similar object is
    /// visible.
    fn absent(
        &self,
        visible: &[Visible],
        snapshot: &WorldSnapshot,
        rng: &mut RandomStream,
    ) -> Option<(Wording, String, ObjectId)> {
        let is_shown = |id: ObjectId| visible.iter().any(|thing| thing.id == id);
        let (shown, all) = (self.placed(snapshot, is_shown), self.placed(snapshot, |_| true));
        let mut hidden: Vec<ObjectId> = Vec::new();
        for group in &self.groups {
            let unseen: Vec<ObjectId> = group.iter().copied().filter(|id| !is_shown(*id)).collect();
            hidden.extend(unseen.get(rng.below(unseen.len())));
        }
        shuffle(&mut hidden, rng);
        if rng.chance(0.5) {
            hidden.sort_by_key(|id| self.look_alikes(*id, visible).is_empty());
        }
        for id in hidden.into_iter().take(HIDDEN) {
            let tags = self.tags_of(id)?;
            // "Leftmost" or a use depends on what is in the image, not on objects elsewhere.
            let plain = |(wording, _): &(Wording, String)| !matches!(wording, Wording::Place | Wording::Use);
            let means_nothing = |(_, instruction): &(Wording, String)| {
                let here = resolve_truth(instruction, &shown, Some(snapshot.pose));
                here.checkable && !here.fits && resolve_truth(instruction, &all, Some(snapshot.pose)).objects.contains(&id)
            };
            if let Some((wording, instruction)) = instructions(tags, rng).into_iter().filter(plain).find(means_nothing) {
                return Some((wording, instruction, id));
            }
        }
        None
    }

    /// Visible objects with the same name as `of` but another colour or quality.
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

    fn target(&mut self, mask: &Mask, snapshot: &WorldSnapshot, truth: &RenderedImage) -> Option<Target> {
        let tags = self.tags_of(mask.id)?;
        let (key, opening) = (tags.key.clone(), tags.opening);
        let (w, h) = (truth.width as usize, truth.height as usize);
        let (x, y) = mask.deepest;
        let depth = if opening { &truth.opening_depth } else { &truth.depth };
        let along = f64::from(*depth.as_ref()?.get(y * w + x)?);
        let point = ImagePoint { u: (x as f64 + 0.5) / w as f64, v: (y as f64 + 0.5) / h as f64 };
        let ray = self.sim_camera.camera().ray(point);
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

    /// Pixels of an object inside the frame without occlusion.
    fn silhouette(&mut self, id: ObjectId, opening: bool, snapshot: &WorldSnapshot) -> Option<u64> {
        let LoadedScene { scene, cast, .. } = self.loaded;
        let moving: Vec<Part> = cast.parts(&snapshot.actors, |_, _| true).into_iter().filter(|part| part.object == id).collect();
        let alone = self.alone.entry(id).or_insert_with(|| {
            let parts: Vec<Part> = scene.geometry.parts.iter().filter(|part| part.object == id).cloned().collect();
            Renderer::new(&SceneGeometry { parts, ..scene.geometry.clone() })
        });
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.sim_camera.look(self.sim_camera.camera(), &mut self.scratch, |camera, image| {
            alone.render_into(camera, &snapshot.pose, channels, &moving, image);
        });
        let ids = if opening { &self.scratch.opening_ids } else { &self.scratch.ids };
        Some(ids.as_ref()?.iter().filter(|seen| **seen == id).count() as u64)
    }
}

/// Objects by first name, sorted by name.
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

/// Masks of both id images, by ascending id. Each object is in one of the two.
fn seen(truth: &RenderedImage) -> Vec<Mask> {
    let channels = [truth.ids.as_deref(), truth.opening_ids.as_deref()];
    let mut all: Vec<Mask> = channels.into_iter().flatten().flat_map(|ids| masks(ids, truth.width as usize)).collect();
    all.sort_by_key(|mask| mask.id);
    all
}

/// Number of pixels per object in both id images.
fn counts(image: &RenderedImage) -> BTreeMap<ObjectId, u64> {
    let mut counts = BTreeMap::new();
    for ids in [image.ids.as_deref(), image.opening_ids.as_deref()].into_iter().flatten() {
        for run in ids.chunk_by(|a, b| a == b) {
            if let Some(&id) = run.first().filter(|id| **id != 0) {
                *counts.entry(id).or_default() += run.len() as u64;
            }
        }
    }
    counts
}
