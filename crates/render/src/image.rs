//! A rendered image with its channels, and their file formats.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use spf_media::{EncodeError, png};

use super::Channels;
use super::raster::{NONE, TILE, TILE_AREA, place};

/// A rendered image with the requested channels. Rows run from the top, pixels from the left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderedImage {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// sRGB, three bytes per pixel.
    pub rgb: Option<Vec<u8>>,
    /// Depth along the optical axis, metres; 0 where there is nothing.
    pub depth: Option<Vec<f32>>,
    /// Id of the object at each pixel's centre; 0 for none.
    pub ids: Option<Vec<u16>>,
    /// Named part of an object at each pixel's centre, its place in the scene's list from 1; 0 for none.
    pub piece_ids: Option<Vec<u16>>,
    /// Id of the nearest opening at each pixel's centre that is not hidden by a solid object; 0 for none.
    pub opening_ids: Option<Vec<u16>>,
    /// Depth of that opening along the optical axis, metres; 0 for none.
    pub opening_depth: Option<Vec<f32>>,
}

/// Why a channel was not saved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// The image was rendered without this channel.
    #[error("the image has no `{0}` channel; request it when rendering")]
    Missing(&'static str),
    /// The file could not be written.
    #[error("cannot write `{}`", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

impl RenderedImage {
    /// Sets size and channels, keeping the memory.
    pub(crate) fn shape(&mut self, width: u32, height: u32, channels: Channels) {
        fn fit<T: Clone + Default>(channel: &mut Option<Vec<T>>, wanted: bool, len: usize) {
            if wanted { channel.get_or_insert_default().resize(len, T::default()) } else { *channel = None }
        }
        (self.width, self.height) = (width, height);
        let area = width as usize * height as usize;
        fit(&mut self.rgb, channels.rgb, area * 3);
        fit(&mut self.depth, channels.depth, area);
        fit(&mut self.ids, channels.ids, area);
        fit(&mut self.piece_ids, channels.pieces, area);
        fit(&mut self.opening_ids, channels.openings, area);
        fit(&mut self.opening_depth, channels.openings, area);
    }

    pub(crate) fn take_truth(&mut self, near: &[f32], id: &[u32], columns: usize, object: impl Fn(u32) -> u16 + Sync) {
        let width = self.width as usize;
        if let Some(depth) = &mut self.depth {
            let near = near.as_chunks::<EIGHT>().0;
            untile(depth, width, columns, |eight| near[eight].map(|near| if near > 0.0 { 1.0 / near } else { 0.0 }));
        }
        if let Some(ids) = &mut self.ids {
            let id = id.as_chunks::<EIGHT>().0;
            untile(ids, width, columns, |eight| objects(&id[eight], &object));
        }
    }

    pub(crate) fn take_pieces(&mut self, id: &[u32], columns: usize, piece: impl Fn(u32) -> u16 + Sync) {
        let width = self.width as usize;
        if let Some(pieces) = &mut self.piece_ids {
            let id = id.as_chunks::<EIGHT>().0;
            untile(pieces, width, columns, |eight| objects(&id[eight], &piece));
        }
    }

    /// The channels of openings if none is in view.
    pub(crate) fn take_no_openings(&mut self) {
        self.opening_depth.iter_mut().for_each(|depth| depth.fill(0.0));
        self.opening_ids.iter_mut().for_each(|ids| ids.fill(0));
    }

    pub(crate) fn take_openings(&mut self, near: &[f32], id: &[u32], columns: usize, object: impl Fn(u32) -> u16 + Sync) {
        let width = self.width as usize;
        let (near, id) = (near.as_chunks::<EIGHT>().0, id.as_chunks::<EIGHT>().0);
        if let Some(depth) = &mut self.opening_depth {
            untile(depth, width, columns, |eight| {
                core::array::from_fn(|i| if id[eight][i] == NONE { 0.0 } else { 1.0 / near[eight][i] })
            });
        }
        if let Some(ids) = &mut self.opening_ids {
            untile(ids, width, columns, |eight| objects(&id[eight], &object));
        }
    }

    pub(crate) fn take_rgb(&mut self, tiles: &[u8], columns: usize) {
        let Some(rgb) = &mut self.rgb else { return };
        let side = TILE as usize;
        rgb.par_chunks_exact_mut(self.width as usize * 3).enumerate().for_each(|(y, line)| {
            for (column, out) in line.chunks_mut(side * 3).enumerate() {
                let start = ((y / side * columns + column) * TILE_AREA + y % side * side) * 3;
                out.copy_from_slice(&tiles[start..start + out.len()]);
            }
        });
    }

    /// Writes the colour image as PNG.
    ///
    /// # Errors
    /// [`SaveError::Missing`] without colour, [`SaveError::Write`] when the file cannot be written.
    pub fn save_rgb(&self, path: &Path) -> Result<(), SaveError> {
        let rgb = self.rgb.as_ref().ok_or(SaveError::Missing("rgb"))?;
        save(path, png::encode_rgb8(self.width, self.height, rgb))
    }

    /// Writes depth as a 16-bit grey PNG in centimetres: 0 where there is nothing, or where it is beyond 655.35 m.
    ///
    /// # Errors
    /// [`SaveError::Missing`] without depth, [`SaveError::Write`] when the file cannot be written.
    pub fn save_depth(&self, path: &Path) -> Result<(), SaveError> {
        let depth = self.depth.as_ref().ok_or(SaveError::Missing("depth"))?;
        self.write_grey(path, depth.iter().map(|&metres| centimetres(metres)))
    }

    /// Writes ids as a 16-bit grey PNG.
    ///
    /// # Errors
    /// [`SaveError::Missing`] without ids, [`SaveError::Write`] when the file cannot be written.
    pub fn save_ids(&self, path: &Path) -> Result<(), SaveError> {
        let ids = self.ids.as_ref().ok_or(SaveError::Missing("ids"))?;
        self.write_grey(path, ids.iter().copied())
    }

    fn write_grey(&self, path: &Path, values: impl Iterator<Item = u16>) -> Result<(), SaveError> {
        let values: Vec<u16> = values.collect();
        save(path, png::encode_grey16(self.width, self.height, &values))
    }
}

fn save(path: &Path, encoded: Result<Vec<u8>, EncodeError>) -> Result<(), SaveError> {
    let written = encoded.map_err(io::Error::other).and_then(|bytes| std::fs::write(path, bytes));
    written.map_err(|source| SaveError::Write { path: path.to_owned(), source })
}

fn centimetres(metres: f32) -> u16 {
    let steps = metres * 100.0 + 0.5;
    if steps < 65_536.0 { steps as u16 } else { 0 }
}

/// Pixels of a row that are adjacent in the order of tiles.
const EIGHT: usize = 8;

/// The object ids of neighbouring triangles, which are mostly the same.
fn objects(ids: &[u32; EIGHT], object: &impl Fn(u32) -> u16) -> [u16; EIGHT] {
    let of = |id| if id == NONE { 0 } else { object(id) };
    // Compared together, without a branch for each.
    let differ = ids.iter().fold(0, |differ, id| differ | (id ^ ids[0]));
    if differ == 0 { [of(ids[0]); EIGHT] } else { ids.map(of) }
}

/// Converts samples from the order of tiles to rows, [`EIGHT`] neighbours at once; `eight` returns them by index.
fn untile<T: Copy + Send>(out: &mut [T], width: usize, columns: usize, eight: impl Fn(usize) -> [T; EIGHT] + Sync) {
    let side = TILE as usize;
    out.par_chunks_exact_mut(width).enumerate().for_each(|(y, line)| {
        for (column, out) in line.chunks_mut(side).enumerate() {
            let start = ((y / side * columns + column) * TILE_AREA + place(0, y % side)) / EIGHT;
            let blocks = place(EIGHT, 0) / EIGHT;
            let (whole, rest) = out.as_chunks_mut::<EIGHT>();
            let count = whole.len();
            whole.iter_mut().enumerate().for_each(|(block, out)| *out = eight(start + block * blocks));
            if !rest.is_empty() {
                rest.copy_from_slice(&eight(start + count * blocks)[..rest.len()]);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_kept_in_centimetres() {
        assert_eq!([0.0, 0.004, 1.234, 655.35, 655.36, 1e9].map(centimetres), [0, 0, 123, 65535, 0, 0]);
    }

    #[test]
    fn a_missing_channel_is_named() {
        let error = RenderedImage::default().save_depth(Path::new("x.png")).unwrap_err();
        assert_eq!(error.to_string(), "the image has no `depth` channel; request it when rendering");
    }
}
