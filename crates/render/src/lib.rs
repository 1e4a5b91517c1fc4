//! The renderer: images of a scene on the CPU, bit-identical on every machine and for any number of threads.
//!
//! Visibility is determined first (the nearest triangle at each pixel), then each visible pixel is shaded once, with
//! four more samples where surfaces meet. Tiles are independent of each other. All arithmetic is single-precision
//! addition, multiplication, division and square root without fused operations, with integers for edges; other
//! functions are tables from `libm`.
//!
//! The main types are [`Renderer`], a scene prepared for rendering, and [`RenderedImage`], its channels. [`effects`]
//! simulates a craft's camera, and [`surroundings`] renders the view around the frame. No input is refused: cameras of
//! more than [`MAX_SIDE`] pixels per side are limited to that, and missing textures are white.

mod ambient;
mod contact;
mod develop;
mod edge;
pub mod effects;
mod facet;
mod image;
mod joins;
mod lamps;
mod lanes;
mod meter;
mod noise;
mod packet;
mod pattern;
mod prepare;
mod rain;
mod raster;
mod setup;
mod shade;
mod shadow;
mod sky;
pub mod surroundings;
mod texture;
mod tile;
mod view;
mod visibility;
mod walls;

use std::collections::BTreeSet;
use std::sync::{Mutex, OnceLock, PoisonError};

use rayon::prelude::*;
use spf_core::camera::Camera;
use spf_core::geometry::Pose;

use ambient::Ambient;
use contact::Contact;
use develop::{Developed, Srgb};
use glam::Vec3;
pub use image::{RenderedImage, SaveError};
use lamps::LampLight;
use lanes::{Instructions, with_instructions};
use meter::Meter;
use noise::Noise;
use pattern::Paint;
use prepare::Soup;
use raster::{NONE, SUB, TILE, TILE_AREA, Tile};
use setup::{Bins, Wanted, tiles};
use shade::Shader;
use shadow::ShadowMap;
use sky::Sky;
use spf_scene::geometry::{Light, Material, Part, Pattern, SceneGeometry};
use spf_scene::texture::Texture;
pub use view::Frustum;
use view::Pinhole;

/// Maximum width and height of an image, pixels; images of larger cameras are cropped to this.
pub const MAX_SIDE: u32 = 8192;

/// The channels to render. Channels that are not requested cost nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Channels {
    /// The colour image.
    pub rgb: bool,
    /// Depth along the optical axis, metres.
    pub depth: bool,
    /// The id of the object at each pixel's centre.
    pub ids: bool,
    /// The named part of an object at each pixel's centre.
    pub pieces: bool,
    /// Ids and depth of openings, in separate images.
    pub openings: bool,
    /// Quality of the colour image.
    pub quality: Quality,
}

/// Rendering quality of a colour image. Other channels do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// With anti-aliasing: for recordings and images sent to a VLM.
    #[default]
    Full,
    /// For live viewing: no anti-aliasing, hard shadow edges, no contact shadows, and only the coarse part of material noise.
    Live,
}

impl Channels {
    /// Colour only.
    pub const RGB: Self = Self { rgb: true, depth: false, ids: false, pieces: false, openings: false, quality: Quality::Full };
    /// Ids, depth and openings.
    pub const TRUTH: Self = Self { rgb: false, depth: true, ids: true, pieces: false, openings: true, quality: Quality::Full };
    /// What the oracle reads: the same, and named parts.
    pub const PERCEPT: Self = Self { pieces: true, ..Self::TRUTH };
    /// All channels.
    pub const ALL: Self = Self { rgb: true, ..Self::TRUTH };
}

/// Data that only colour images need, created for the first one.
#[derive(Debug)]
struct Palette {
    sky: Sky,
    noise: Noise,
    /// For each material the paints of upright and of level surfaces; then one for surfaces without a material.
    paints: Vec<Paint>,
    ambient: Ambient,
    lamps: LampLight,
    contact: Contact,
    /// Objects that emit light.
    glowing: BTreeSet<u16>,
    shadows: ShadowMap,
    srgb: Srgb,
    /// Lookup table from scene light directly to output bytes.
    developed: Developed,
}

/// A scene prepared for rendering. Shared between threads by reference; rendering one image already uses all threads of the
/// current rayon pool.
#[derive(Debug)]
pub struct Renderer {
    soup: Soup,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    light: Light,
    palette: OnceLock<Palette>,
    meter: OnceLock<Meter>,
    scratch: Mutex<Vec<Scratch>>,
    instructions: Instructions,
}

/// Buffers reused from image to image. Samples are stored tile after tile.
#[derive(Debug, Default)]
struct Scratch {
    solid: Bins,
    openings: Bins,
    near: Vec<f32>,
    id: Vec<u32>,
    opening_near: Vec<f32>,
    opening_id: Vec<u32>,
    rgb: Vec<u8>,
}

impl Renderer {
    /// Prepares a scene. Triangles without area, or with vertex indices out of range, are omitted.
    #[must_use]
    pub fn new(scene: &SceneGeometry) -> Self {
        Self {
            soup: Soup::new(&scene.parts, &scene.materials),
            materials: scene.materials.clone(),
            textures: scene.textures.clone(),
            light: scene.light.clone(),
            palette: OnceLock::new(),
            meter: OnceLock::new(),
            scratch: Mutex::default(),
            instructions: Instructions::best(),
        }
    }

    /// Renders with the baseline instruction set instead of the widest vectors available. The images are the same, bit for bit,
    /// and take longer; for tests of exactly that.
    #[must_use]
    pub fn with_plain_instructions(self) -> Self {
        Self { instructions: Instructions::plain(), ..self }
    }

    /// Number of triangles in the scene.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.soup.triangles.len()
    }

    /// Renders a new image from `pose`. Lens distortion is not applied: the image is that of the undistorted camera.
    #[must_use]
    pub fn render(&self, camera: &Camera, pose: &Pose, channels: Channels) -> RenderedImage {
        let mut image = RenderedImage::default();
        self.render_into(camera, pose, channels, &[], &mut image);
        image
    }

    /// Renders into `image`, reusing its buffers; `actors` are additional parts for this image only (moving objects), in world
    /// coordinates, with materials of the scene. Actors receive the scene's shadows but cast none.
    pub fn render_into(&self, camera: &Camera, pose: &Pose, channels: Channels, actors: &[Part], image: &mut RenderedImage) {
        let mut view = Pinhole::new(camera, pose);
        (view.width, view.height) = (view.width.min(MAX_SIDE), view.height.min(MAX_SIDE));
        image.shape(view.width, view.height, channels);
        if view.width == 0
            || view.height == 0
            || !(channels.rgb || channels.depth || channels.ids || channels.pieces || channels.openings)
        {
            return;
        }
        let actors = if channels.rgb { Soup::new(actors, &self.materials) } else { Soup::unpainted(actors, &self.materials) };
        let mut scratch = self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        self.draw(&view, channels, &actors, &mut scratch, image);
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
    }

    fn draw(&self, view: &Pinhole, channels: Channels, actors: &Soup, scratch: &mut Scratch, image: &mut RenderedImage) {
        let soups = [&self.soup, actors];
        let centres = !channels.rgb;
        scratch.solid.fill(self.instructions, &soups, view, Wanted { openings: false, centres });
        let (columns, rows) = tiles(view.width, view.height);
        let area = columns * rows * TILE_AREA;
        scratch.near.resize(area, 0.0);
        scratch.id.resize(area, NONE);
        let corner = |tile: usize| ((tile % columns) as i32 * TILE, (tile / columns) as i32 * TILE);
        let solid = &scratch.solid;
        let pairs = scratch.near.par_chunks_mut(TILE_AREA).zip(scratch.id.par_chunks_mut(TILE_AREA));
        pairs.enumerate().for_each(|(index, (near, id))| {
            near.fill(0.0);
            id.fill(NONE);
            let mut tile = Tile::new(near, id, corner(index), (SUB / 2, SUB / 2));
            with_instructions!(self.instructions, simd => {
                for t in solid.of(index) {
                    tile.draw(simd, t);
                }
            });
        });
        let object = |id: u32| match self.soup.objects.get(id as usize) {
            Some(&object) => object,
            None => actors.objects.get((id as usize).wrapping_sub(self.soup.objects.len())).copied().unwrap_or(0),
        };
        let piece = |id: u32| match self.soup.pieces.get(id as usize) {
            Some(&piece) => piece,
            None => actors.pieces.get((id as usize).wrapping_sub(self.soup.pieces.len())).copied().unwrap_or(0),
        };
        image.take_truth(&scratch.near, &scratch.id, columns, object);
        image.take_pieces(&scratch.id, columns, piece);
        if channels.openings {
            scratch.openings.fill(self.instructions, &soups, view, Wanted { openings: true, centres: true });
        }
        if channels.openings && scratch.openings.are_empty() {
            image.take_no_openings();
        } else if channels.openings {
            scratch.opening_near.resize(area, 0.0);
            scratch.opening_id.resize(area, NONE);
            let openings = &scratch.openings;
            let pairs = scratch.opening_near.par_chunks_mut(TILE_AREA).zip(scratch.opening_id.par_chunks_mut(TILE_AREA));
            pairs.zip(scratch.near.par_chunks(TILE_AREA)).enumerate().for_each(|(index, ((near, id), solid))| {
                id.fill(NONE);
                if openings.is_empty(index) {
                    return;
                }
                // An opening flush with its wall is visible: it need not be nearer than the wall, only not behind it.
                near.iter_mut().zip(solid).for_each(|(n, s)| *n = s * 0.999);
                let mut tile = Tile::new(near, id, corner(index), (SUB / 2, SUB / 2));
                with_instructions!(self.instructions, simd => {
                    for t in openings.of(index) {
                        tile.draw(simd, t);
                    }
                });
            });
            image.take_openings(&scratch.opening_near, &scratch.opening_id, columns, object);
        }
        if channels.rgb {
            let palette = self.palette();
            let shader =
                Shader::new(soups, (palette, &self.textures), view, self.instructions, channels.quality == Quality::Full);
            scratch.rgb.resize(area * 3, 0);
            let samples = tile::Samples { near: &scratch.near, id: &scratch.id, columns };
            let bins = &scratch.solid;
            scratch.rgb.par_chunks_mut(TILE_AREA * 3).enumerate().for_each_init(tile::Work::default, |work, (index, rgb)| {
                work.shade(&shader, bins, &samples, index, rgb);
            });
            image.take_rgb(&scratch.rgb, columns);
            if let Some(rgb) = image.rgb.as_mut().filter(|_| self.light.rain > 0.0) {
                rain::fall(rgb, view, palette, palette.exposure(view.eye), |x, y| samples.near_at(x, y));
            }
        }
    }

    /// Makes what the first image would make. It works in all threads of the pool, so that it must not be made in a task of that pool while
    /// others wait for it: whoever renders in such tasks calls this before.
    pub fn prepare(&self) {
        self.palette();
    }

    fn palette(&self) -> &Palette {
        // Materials are validated when a scene is created; a part without one is black.
        let black = Paint::new(Vec3::ZERO, Vec3::ZERO, Pattern::Plain, Vec3::ZERO);
        self.palette.get_or_init(|| Palette {
            sky: Sky::new(&self.light),
            noise: Noise::new(),
            paints: self.materials.iter().flat_map(Paint::both).chain([black]).collect(),
            ambient: Ambient::new(&self.soup),
            lamps: LampLight::new(&self.soup, &self.light.lamps),
            contact: Contact::new(&self.soup),
            glowing: self.glowing(),
            shadows: ShadowMap::new(&self.soup, &self.light),
            srgb: Srgb::new(),
            developed: Developed::new(),
        })
    }
}

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
