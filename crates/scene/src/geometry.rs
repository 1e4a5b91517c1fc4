//! What the renderer draws and the collider touches: meshes with materials, grouped into objects.
//!
//! World frame ENU as `Vec3` (x east, y north, z up), metres, inside this crate's geometry only.

use glam::{Vec2, Vec3};

use crate::texture::Texture;

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position, ENU metres.
    pub position: Vec3,
    /// Unit normal, outwards.
    pub normal: Vec3,
    /// Texture coordinates: **metres** along the surface, so that a brick is a brick on every wall; for [`Pattern::Image`] one unit
    /// a repetition, v down from the image's top.
    pub uv: Vec2,
}

/// Number of an object in the scene's list, counting from 1; 0 in an id image means no object (sky, or nothing drawn).
pub type ObjectId = u16;

/// A triangle mesh with one material, belonging to one object.
#[derive(Clone, Debug)]
pub struct Part {
    /// Corners.
    pub vertices: Vec<Vertex>,
    /// Corner indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`SceneGeometry::materials`].
    pub material: u16,
    /// The object it belongs to; ground and roads are objects too.
    pub object: ObjectId,
    /// What it takes part in.
    pub role: Role,
}

/// What a part takes part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Drawn and touched.
    Solid,
    /// Drawn only.
    Visual,
    /// Touched only: clear glass.
    Glass,
    /// An opening (gate, tunnel mouth, hollow): drawn into the second id and depth image only; hides nothing, touches nothing.
    Opening,
}

/// How a surface looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Base colour, linear RGB, 0..=1.
    pub colour: Vec3,
    /// Second colour of the pattern (mortar, glass, marking), linear RGB.
    pub accent: Vec3,
    /// The pattern.
    pub pattern: Pattern,
    /// Drawn from both sides (foliage, thin plates).
    pub two_sided: bool,
    /// Light given off, linear RGB added after shading (lamps, lit windows).
    pub emission: Vec3,
}

/// Patterns over the texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// One colour.
    Plain,
    /// Windows: width and height of a cell in metres, fraction of the cell that is glass (the accent colour).
    Windows {
        /// Cell width and height, metres.
        cell: Vec2,
        /// Fraction of the cell's width and height that is glass.
        glass: f32,
    },
    /// Bricks with mortar of the accent colour.
    Brick,
    /// Asphalt; a dashed centre line and solid edges of the accent colour along v, for a road of this width in metres
    /// (u = 0 at the centre line); 0 for none.
    Asphalt {
        /// Width of the marked road, metres; 0 for no markings.
        width: f32,
    },
    /// Grass: two greens in patches.
    Grass,
    /// Concrete: faint stains and joints every so many metres.
    Concrete {
        /// Distance of joints, metres; 0 for none.
        joint: f32,
    },
    /// Leaves: mottled in light and dark.
    Foliage,
    /// Tree bark, planks: streaks along v.
    Wood,
    /// Water: ripples, mirrors the sky.
    Water,
    /// Stripes of the accent colour across v, period in metres.
    Stripes {
        /// Period, metres.
        period: f32,
    },
    /// An image, its light multiplied by the base colour.
    Image {
        /// Index into [`SceneGeometry::textures`]; one that is not there is white.
        texture: u16,
        /// Fraction of a mirror, 0..=1.
        mirror: f32,
    },
}

/// A source of light that shines all round; what stands about it, its own shade included, holds its light back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Where its light comes from, ENU metres; just outside of the lamp's own meshes, or they keep the light in.
    pub position: Vec3,
    /// Light on a surface that faces it from 1 m away, linear RGB in units of the sun's (which is about 1).
    pub colour: Vec3,
    /// Its light fades to nothing here, metres.
    pub reach: f32,
}

/// Light of a scene. [`Light::default`] is a clear day with the sun high in the south-west.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Unit vector towards the sun.
    pub to_sun: Vec3,
    /// Sun colour times strength, linear RGB.
    pub sun: Vec3,
    /// Ambient light from above, linear RGB.
    pub sky_ambient: Vec3,
    /// Ambient light from below, linear RGB.
    pub ground_ambient: Vec3,
    /// Sky colour at the zenith, linear RGB.
    pub zenith: Vec3,
    /// Sky and haze colour at the horizon, linear RGB.
    pub horizon: Vec3,
    /// Haze: extinction per metre.
    pub haze: f32,
    /// How much of the sky is clouded: 0 none, 0.5 fair weather, 1 all of it.
    pub clouds: f32,
    /// Falling rain, 0 none to 1 heavy.
    pub rain: f32,
    /// Whether there are places so dark that things in them are hard to make out.
    pub dark_places: bool,
    /// What the film's exposure multiplies light by; none: chosen by the light there is.
    pub exposure: Option<f32>,
    /// The lamps that shine.
    pub lamps: Vec<Lamp>,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            // Azimuth 222°, elevation 46°.
            to_sun: Vec3::new(-0.464_815, -0.516_229, 0.719_340).normalize(),
            sun: Vec3::new(1.0, 0.93, 0.82),
            sky_ambient: Vec3::new(0.30, 0.36, 0.45),
            ground_ambient: Vec3::new(0.17, 0.16, 0.14),
            zenith: Vec3::new(0.16, 0.34, 0.68),
            horizon: Vec3::new(0.62, 0.72, 0.82),
            haze: 0.0015,
            clouds: 0.5,
            rain: 0.0,
            dark_places: false,
            exposure: None,
            lamps: Vec::new(),
        }
    }
}

/// All that is drawn and touched.
#[derive(Clone, Debug)]
pub struct SceneGeometry {
    /// Meshes.
    pub parts: Vec<Part>,
    /// Surfaces.
    pub materials: Vec<Material>,
    /// Images that materials name.
    pub textures: Vec<Texture>,
    /// Light.
    pub light: Light,
}
