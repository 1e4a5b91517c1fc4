//! A window of our own: pictures shown in it, and the keys that are down while it has the focus.

use std::collections::BTreeSet;

use spf_media::Rgb;
use x11rb::connection::Connection as _;
use x11rb::protocol::Event;
use x11rb::protocol::shm::ConnectionExt as _;
use x11rb::protocol::xproto::{
    AtomEnum, ConnectionExt as _, CreateGCAux, CreateWindowAux, EventMask, Gcontext, ImageFormat, PropMode, WindowClass,
};
use x11rb::wrapper::ConnectionExt as _;

use super::segment::{Segment, is_shared};
use super::{Display, Server};
use crate::ScreenError;
use crate::profile::Key;

/// Bytes of pixels in one request without shared memory.
const MOST_BYTES: usize = 200_000;

x11rb::atom_manager! {
    /// Names of properties of a window.
    PaneAtoms: PaneAtomsCookie {
        _NET_WM_NAME,
        UTF8_STRING,
        WM_DELETE_WINDOW,
        WM_PROTOCOLS,
    }
}

/// A window with a picture.
pub struct Pane {
    display: Display,
    window: u32,
    context: Gcontext,
    depth: u8,
    size: (u16, u16),
    segment: Option<Segment>,
    delete: u32,
    closed: bool,
    bytes: Vec<u8>,
}

impl std::fmt::Debug for Pane {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pane").field("window", &self.window).field("size", &self.size).finish_non_exhaustive()
    }
}

impl Pane {
    /// Opens a window of this size, pixels.
    ///
    /// # Errors
    /// [`ScreenError`]: no display, or it has no shared memory and refuses the window.
    pub fn open(display: &Display, title: &str, size: (u16, u16)) -> Result<Self, ScreenError> {
        let display = Display::open(display.0.name.as_deref())?;
        let Server { connection, root, .. } = &*display.0;
        let depth = connection.get_geometry(*root)?.reply()?.depth;
        let atoms = PaneAtoms::new(connection)?.reply()?;
        let (window, context) = (connection.generate_id()?, connection.generate_id()?);
        let (width, height) = size;
        let looks = CreateWindowAux::new().background_pixel(0).event_mask(EventMask::STRUCTURE_NOTIFY);
        connection.create_window(depth, window, *root, 0, 0, width, height, 0, WindowClass::INPUT_OUTPUT, 0, &looks)?.check()?;
        connection.create_gc(context, window, &CreateGCAux::new())?;
        // Instance and class (ICCCM section 4.1.2.5).
        connection.change_property8(PropMode::REPLACE, window, AtomEnum::WM_CLASS, AtomEnum::STRING, b"spf\0Spf\0")?;
        connection.change_property8(PropMode::REPLACE, window, AtomEnum::WM_NAME, AtomEnum::STRING, title.as_bytes())?;
        connection.change_property8(PropMode::REPLACE, window, atoms._NET_WM_NAME, atoms.UTF8_STRING, title.as_bytes())?;
        connection.change_property32(PropMode::REPLACE, window, atoms.WM_PROTOCOLS, AtomEnum::ATOM, &[atoms.WM_DELETE_WINDOW])?;
        connection.map_window(window)?;
        connection.flush()?;
        let length = u64::from(width) * u64::from(height) * 4;
        let segment = if is_shared(connection)? { Segment::new(connection, length)? } else { None };
        let delete = atoms.WM_DELETE_WINDOW;
        Ok(Self { display, window, context, depth, size, segment, delete, closed: false, bytes: vec![0; length as usize] })
    }

    /// Its width and height, pixels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.size.0.into(), self.size.1.into())
    }

    /// Shows a picture, which has the window's size.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn show(&mut self, image: &Rgb) -> Result<(), ScreenError> {
        let (width, height) = self.size;
        let Server { connection, layout, .. } = &*self.display.0;
        layout.bytes(image, &mut self.bytes);
        if let Some(segment) = &self.segment {
            segment.write(&self.bytes)?;
            let format = ImageFormat::Z_PIXMAP.into();
            let Segment { number, .. } = segment;
            connection.shm_put_image(
                self.window,
                self.context,
                width,
                height,
                0,
                0,
                width,
                height,
                0,
                0,
                self.depth,
                format,
                false,
                *number,
                0,
            )?;
            // The server has read the memory once it answers.
            connection.get_input_focus()?.reply()?;
            return Ok(());
        }
        let row = usize::from(width) * 4;
        let rows = (MOST_BYTES / row).max(1);
        for (number, bytes) in self.bytes.chunks(row * rows).enumerate() {
            let (count, top) = ((bytes.len() / row) as u16, (number * rows) as i16);
            connection.put_image(ImageFormat::Z_PIXMAP, self.window, self.context, width, count, 0, top, 0, self.depth, bytes)?;
        }
        connection.flush()?;
        Ok(())
    }

    /// Whether somebody has closed it.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn is_closed(&mut self) -> Result<bool, ScreenError> {
        while let Some(event) = self.display.0.connection.poll_for_event()? {
            match event {
                Event::ClientMessage(message) => self.closed |= message.data.as_data32()[0] == self.delete,
                Event::DestroyNotify(_) => self.closed = true,
                _ => {}
            }
        }
        Ok(self.closed)
    }

    /// What looks at the keyboard for this window, on a connection of its own.
    ///
    /// # Errors
    /// [`ScreenError`].
    pub fn keyboard(&self) -> Result<Keyboard, ScreenError> {
        let display = Display::open(self.display.0.name.as_deref())?;
        let mut keyboard = Keyboard { display, window: self.window, symbols: Vec::new() };
        keyboard.read_layout()?;
        Ok(keyboard)
    }
}

/// Looks at the keyboard.
#[derive(Debug)]
pub struct Keyboard {
    display: Display,
    window: u32,
    symbols: Vec<u32>,
}

impl Keyboard {
    /// The keys that are down now, if the window has the focus; none without.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn down(&mut self) -> Result<BTreeSet<Key>, ScreenError> {
        let mut changed = false;
        while let Some(event) = self.display.0.connection.poll_for_event()? {
            changed |= matches!(event, Event::MappingNotify(_));
        }
        if changed {
            self.read_layout()?;
        }
        let Server { connection, .. } = &*self.display.0;
        let (focus, keys) = (connection.get_input_focus()?, connection.query_keymap()?);
        let (focus, keys) = (focus.reply()?.focus, keys.reply()?.keys);
        if focus != self.window {
            return Ok(BTreeSet::new());
        }
        let least = usize::from(connection.setup().min_keycode);
        let is_down = |code: usize| keys.get(code / 8).is_some_and(|byte| byte >> (code % 8) & 1 == 1);
        let symbols = self.symbols.iter().enumerate();
        Ok(symbols.filter(|(place, _)| is_down(least + place)).map(|(_, symbol)| Key::Symbol(*symbol)).collect())
    }

    fn read_layout(&mut self) -> Result<(), ScreenError> {
        self.symbols = super::hands::layout(&self.display.0.connection)?;
        Ok(())
    }
}

impl Drop for Pane {
    fn drop(&mut self) {
        let connection = &self.display.0.connection;
        if let Some(segment) = self.segment.take() {
            segment.detach(connection);
        }
        drop(connection.destroy_window(self.window));
        drop(connection.flush());
    }
}
