//! Size limits of scenes, for all file formats.

/// Maximum size of a scene file, bytes.
pub(crate) const MAX_BYTES: usize = 4 << 20;

/// Maximum number of objects in a scene; ids are 16 bits, and longer legends are of no use.
pub(crate) const MAX_OBJECTS: usize = 4000;

/// Maximum distance of an object from the origin along each axis, metres.
pub(crate) const FARTHEST: f64 = 2000.0;

/// Maximum length of a tag, characters.
pub(crate) const LONGEST_TAG: usize = 80;

/// Maximum number of triangles of a scene, which a laptop still renders at several images per second.
pub(crate) const MAX_TRIANGLES: usize = 500_000;
