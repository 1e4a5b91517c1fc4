//! Geometry for rendering and collisions: meshes with materials, grouped into objects.
//!
//! The world frame is ENU as `Vec3` (x east, y north, z up), in metres, within this crate's geometry only.

use glam::{Vec2, Vec3};

use crate::texture::Texture;

/// A vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position, ENU metres.
    pub position: Vec3,
    /// Outward unit normal.
    pub normal: Vec3,
    /// Texture coordinates: **metres** along the surface, so that patterns have a physical scale; for
    /// [`Pattern::Image`] one unit is one repetition, with v down from the top of the image.
    pub uv: Vec2,
}

/// Id of an object in the scene's list, from 1; 0 in an id image means no object (sky, or nothing rendered).
pub type ObjectId = u16;

/// A triangle mesh with one material, belonging to one object.
#[derive(Clone, Debug)]
pub struct Part {
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`SceneGeometry::materials`].
    pub material: u16,
    /// The object it belongs to; ground and roads are objects too.
    pub object: ObjectId,
    /// The named part of the object that each triangle belongs to: its place in [`Scene::pieces`](crate::Scene::pieces), from 1; 0
    /// for none. Empty if no triangle belongs to one.
    pub pieces: Vec<u16>,
    /// Its role.
    pub role: Role,
}

/// The role of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Rendered and solid.
    Solid,
    /// Rendered, but not solid.
    Visual,
    /// Solid, but not rendered: clear glass.
    Glass,
    /// An opening (gate, tunnel mouth, hollow): rendered only into the separate id and depth images of openings; neither hides
    /// nor collides with anything.
    Opening,
}

/// Appearance of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Base colour, linear RGB, 0..=1.
    pub colour: Vec3,
    /// Second colour of the pattern (mortar, glass, marking), linear RGB.
    pub accent: Vec3,
    /// The pattern.
    pub pattern: Pattern,
    /// Whether it is visible from both sides (foliage, thin plates).
    pub two_sided: bool,
    /// Emitted light, linear RGB, added after shading (lamps, lit windows).
    pub emission: Vec3,
}

/// Patterns in texture coordinates.
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
    /// Concrete: faint stains, and joints at regular distances.
    Concrete {
        /// Distance between joints, metres; 0 for none.
        joint: f32,
    },
    /// Leaves: mottled light and dark.
    Foliage,
    /// Tree bark, planks: streaks along v.
    Wood,
    /// Water: rippled, reflecting the sky.
    Water,
    /// Stripes of the accent colour across v, period in metres.
    Stripes {
        /// Period, metres.
        period: f32,
    },
    /// An image, its light multiplied by the base colour.
    Image {
        /// Index into [`SceneGeometry::textures`]; an index out of range gives white.
        texture: u16,
        /// Reflectivity: 0 is matt, 1 a perfect mirror.
        mirror: f32,
    },
}

/// An omnidirectional light; objects around it, including its own shade, block its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Position, ENU metres; just outside of the lamp's own meshes, which would otherwise block it.
    pub position: Vec3,
    /// Light on a surface facing it at 1 m, linear RGB relative to the sun's (about 1).
    pub colour: Vec3,
    /// Distance at which its light has faded to nothing, metres.
    pub reach: f32,
}

/// Light of a scene. [`Light::default`] is a clear day with a high sun in the south-west.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Unit vector towards the sun.
    pub to_sun: Vec3,
    /// Colour times intensity of the sun, linear RGB.
    pub sun: Vec3,
    /// Ambient light from above, linear RGB.
    pub sky_ambient: Vec3,
    /// Ambient light from below, linear RGB.
    pub ground_ambient: Vec3,
    /// Sky colour at the zenith, linear RGB.
    pub zenith: Vec3,
    /// Sky and haze colour at the horizon, linear RGB.
    pub horizon: Vec3,
    /// Haze: extinction coefficient, 1/m.
    pub haze: f32,
    /// Cloud cover: 0 none, 0.5 fair weather, 1 overcast.
    pub clouds: f32,
    /// Rain, 0 none to 1 heavy.
    pub rain: f32,
    /// Whether some places are so dark that objects in them are hard to see.
    pub has_dark_areas: bool,
    /// Exposure factor; `None` for automatic exposure.
    pub exposure: Option<f32>,
    /// The active lamps.
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
            has_dark_areas: false,
            exposure: None,
            lamps: Vec::new(),
        }
    }
}

/// All rendered and solid geometry.
#[derive(Clone, Debug)]
pub struct SceneGeometry {
    /// Meshes.
    pub parts: Vec<Part>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Images used by materials.
    pub textures: Vec<Texture>,
    /// Light.
    pub light: Light,
}
