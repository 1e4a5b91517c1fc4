//! Memory shared with the X11 server (MIT-SHM 1.2): a file without a name, of which the server is given a descriptor.
//!
//! It is read as a file and not mapped, which costs one copy (0.4 ms for 960×720) and needs no `unsafe`.

use std::fs::File;
use std::os::unix::fs::FileExt as _;

use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use x11rb::connection::{Connection as _, RequestConnection as _};
use x11rb::protocol::shm::{ConnectionExt as _, Seg, X11_EXTENSION_NAME};
use x11rb::protocol::xproto::{ConnectionExt as _, ImageFormat};
use x11rb::rust_connection::RustConnection;

use crate::ScreenError;
use crate::area::Area;

/// Shared memory for pictures of up to a size.
#[derive(Debug)]
pub(super) struct Segment {
    file: File,
    pub(super) number: Seg,
    length: u64,
}

/// Whether the server shares memory, which one on another machine does not.
pub(super) fn is_shared(connection: &RustConnection) -> Result<bool, ScreenError> {
    if connection.extension_information(X11_EXTENSION_NAME)?.is_none() {
        return Ok(false);
    }
    let version = connection.shm_query_version()?.reply()?;
    Ok((version.major_version, version.minor_version) >= (1, 2))
}

impl Segment {
    /// Memory of this many bytes; `None` if the server refuses it.
    pub(super) fn new(connection: &RustConnection, length: u64) -> Result<Option<Self>, ScreenError> {
        let failed = |error: std::io::Error| ScreenError::Failed(format!("no memory for pictures: {error}"));
        let file = memfd_create("spf-screen", MemfdFlags::CLOEXEC).map_err(|error| failed(error.into()))?;
        ftruncate(&file, length).map_err(|error| failed(error.into()))?;
        let given = file.try_clone().map_err(failed)?;
        let number = connection.generate_id()?;
        let refused = connection.shm_attach_fd(number, given, false)?.check().is_err();
        Ok((!refused).then(|| Self { file: file.into(), number, length }))
    }

    /// Number of bytes.
    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Takes a picture of part of a window into `bytes`; `false` if the server refuses.
    pub(super) fn take(
        &self,
        connection: &RustConnection,
        window: u32,
        area: Area,
        bytes: &mut [u8],
    ) -> Result<bool, ScreenError> {
        let Some([x, y, width, height]) = corners(area) else { return Ok(false) };
        let all = ImageFormat::Z_PIXMAP.into();
        let reply = connection.shm_get_image(window, x as i16, y as i16, width, height, u32::MAX, all, self.number, 0)?.reply();
        match super::unless_gone(reply)? {
            Some(_) => {
                let read = self.file.read_exact_at(bytes, 0);
                read.map(|()| true).map_err(|error| ScreenError::Failed(format!("shared memory: {error}")))
            }
            None => Ok(false),
        }
    }

    /// Writes pixels for the server.
    pub(super) fn write(&self, bytes: &[u8]) -> Result<(), ScreenError> {
        self.file.write_all_at(bytes, 0).map_err(|error| ScreenError::Failed(format!("shared memory: {error}")))
    }

    /// Gives it back.
    pub(super) fn detach(self, connection: &RustConnection) {
        // Without a connection there is nothing to give back.
        drop(connection.shm_detach(self.number));
    }
}

/// The same without shared memory: through the connection, which takes longer.
pub(super) fn take_slowly(connection: &RustConnection, window: u32, area: Area) -> Result<Option<Vec<u8>>, ScreenError> {
    let Some([x, y, width, height]) = corners(area) else { return Ok(None) };
    let reply = connection.get_image(ImageFormat::Z_PIXMAP, window, x as i16, y as i16, width, height, u32::MAX)?.reply();
    Ok(super::unless_gone(reply)?.map(|reply| reply.data))
}

/// Position and size in the protocol's 16 bits.
fn corners(area: Area) -> Option<[u16; 4]> {
    let (x, y) = (i16::try_from(area.x).ok()?, i16::try_from(area.y).ok()?);
    Some([x as u16, y as u16, u16::try_from(area.width).ok()?, u16::try_from(area.height).ok()?])
}
