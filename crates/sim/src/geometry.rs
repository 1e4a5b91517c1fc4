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
    /// a repetition, v down from the picture's top.
    pub uv: Vec2,
}

/// Number of an object in the scene's list, counting from 1; 0 in an id picture means no object (sky, or nothing drawn).
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
    /// An opening (gate, tunnel mouth, hollow): drawn into the second id and depth picture only; hides nothing, touches nothing.
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
    /// Windows: width and height of a cell in metres, share of the cell that is glass (the accent colour).
    Windows {
        /// Cell width and height, metres.
        cell: Vec2,
        /// Share of the cell's width and height that is glass.
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
    /// A picture, its light multiplied by the base colour.
    Image {
        /// Index into [`SceneGeometry::textures`]; one that is not there is white.
        texture: u16,
        /// Share of a mirror, 0..=1.
        mirror: f32,
    },
}

/// Light of a scene.
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
}

/// All that is drawn and touched.
#[derive(Clone, Debug)]
pub struct SceneGeometry {
    /// Meshes.
    pub parts: Vec<Part>,
    /// Surfaces.
    pub materials: Vec<Material>,
    /// Pictures that materials name.
    pub textures: Vec<Texture>,
    /// Light.
    pub light: Light,
}
