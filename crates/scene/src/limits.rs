//! Size limits of scenes, for all file formats.

/// Longest scene file that is read, bytes.
pub(crate) const MAX_BYTES: usize = 4 << 20;

/// Most objects in a scene; ids are 16 bits, and a legend beyond this is no use to anyone.
pub(crate) const MAX_OBJECTS: usize = 4000;

/// Farthest place of an object, metres from the origin in each axis.
pub(crate) const FARTHEST: f64 = 2000.0;

/// Longest word or phrase among the tags, characters.
pub(crate) const LONGEST_TAG: usize = 80;

/// Most triangles of a scene: what a laptop still renders at several images a second.
pub(crate) const MAX_TRIANGLES: usize = 500_000;
