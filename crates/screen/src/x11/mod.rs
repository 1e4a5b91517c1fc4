//! X11, by the protocol alone: no system library is needed.

mod covering;
mod eye;
mod hands;
mod pane;
mod segment;
mod windows;

use std::sync::Arc;

use x11rb::connection::{Connection as _, RequestConnection as _};
use x11rb::errors::{ConnectionError, ReplyError, ReplyOrIdError};
use x11rb::protocol::composite::{ConnectionExt as _, Redirect};
use x11rb::protocol::randr::ConnectionExt as _;
use x11rb::protocol::xproto::{ConnectionExt as _, ImageOrder, Window as WindowId};
use x11rb::rust_connection::RustConnection;

use crate::area::{Area, Region};
use crate::choosing::chosen;
use crate::pixels::Layout;
use crate::{Hidden, Monitor, ScreenError, Window, WindowName};

pub use eye::Eye;
pub use hands::Hands;
pub use pane::{Keyboard, Pane};

/// The extension by which Xwayland, since its version 23.1, can be told, and how it names its outputs before.
const XWAYLAND: &str = "XWAYLAND";

x11rb::atom_manager! {
    /// Names of properties.
    pub(super) Atoms: AtomsCookie {
        _NET_ACTIVE_WINDOW,
        _NET_CLIENT_LIST,
        _NET_CLIENT_LIST_STACKING,
        _NET_WM_NAME,
        UTF8_STRING,
        WM_STATE,
        _NET_WM_CM_S0,
    }
}

/// A connection to an X11 display.
#[derive(Clone)]
pub struct Display(Arc<Server>);

impl std::fmt::Debug for Display {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Display").field("root", &self.0.root).finish_non_exhaustive()
    }
}

struct Server {
    /// The name by which it was opened; `None` for what `DISPLAY` says.
    name: Option<String>,
    connection: RustConnection,
    root: WindowId,
    layout: Layout,
    atoms: Atoms,
    /// Whether it is Xwayland, which shows its windows among those of a Wayland session: the root window has no pixels, and windows of
    /// other programs may lie over them unseen.
    is_rootless: bool,
}

impl From<ConnectionError> for ScreenError {
    fn from(error: ConnectionError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<ReplyError> for ScreenError {
    fn from(error: ReplyError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<ReplyOrIdError> for ScreenError {
    fn from(error: ReplyOrIdError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// What a request about a window says, or `None` if the window is gone.
fn unless_gone<T>(reply: Result<T, ReplyError>) -> Result<Option<T>, ScreenError> {
    match reply {
        Ok(reply) => Ok(Some(reply)),
        Err(ReplyError::X11Error(_)) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

impl Display {
    /// Connects to the display of this name, such as `:0`, or to the one that the variable `DISPLAY` names.
    ///
    /// # Errors
    /// [`ScreenError::NoDisplay`], or [`ScreenError::Lacks`] if its pixels are not of 24 bits.
    pub fn open(name: Option<&str>) -> Result<Self, ScreenError> {
        let display = name.map_or_else(|| std::env::var("DISPLAY").unwrap_or_default(), str::to_owned);
        let (connection, number) = RustConnection::connect(name).map_err(|error| {
            let why = if display.is_empty() {
                "the variable DISPLAY is not set; a Wayland session has it for programs of X11 alone".to_owned()
            } else {
                error.to_string()
            };
            ScreenError::NoDisplay { display: display.clone(), why }
        })?;
        let setup = connection.setup();
        let screen = &setup.roots[number];
        let root = screen.root;
        let depth = screen.allowed_depths.iter().find(|depth| depth.depth == screen.root_depth);
        let visual = depth.and_then(|depth| depth.visuals.iter().find(|visual| visual.visual_id == screen.root_visual));
        let wide = setup.pixmap_formats.iter().any(|format| format.depth == screen.root_depth && format.bits_per_pixel == 32);
        let msb_first = setup.image_byte_order == ImageOrder::MSB_FIRST;
        let layout = visual
            .filter(|_| wide)
            .and_then(|visual| Layout::of([visual.red_mask, visual.green_mask, visual.blue_mask], msb_first))
            .ok_or(ScreenError::Lacks("pixels of 24 bits"))?;
        let atoms = Atoms::new(&connection)?.reply()?;
        let is_rootless = is_rootless(&connection, root)?;
        Ok(Self(Arc::new(Server { name: name.map(str::to_owned), connection, root, layout, atoms, is_rootless })))
    }

    /// The windows of programs, from the lowest to the uppermost.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn windows(&self) -> Result<Vec<Window>, ScreenError> {
        windows::list(&self.0)
    }

    /// The monitors. A display without RandR has one, the whole screen.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn monitors(&self) -> Result<Vec<Monitor>, ScreenError> {
        let Server { connection, root, .. } = &*self.0;
        if connection.extension_information(x11rb::protocol::randr::X11_EXTENSION_NAME)?.is_none() {
            return Ok(vec![Monitor { name: "screen".to_owned(), area: self.0.screen()?, primary: true }]);
        }
        let listed = connection.randr_get_monitors(*root, true)?.reply()?.monitors;
        let names = listed.iter().map(|monitor| connection.get_atom_name(monitor.name)).collect::<Result<Vec<_>, _>>()?;
        let mut monitors = Vec::new();
        for (monitor, name) in listed.iter().zip(names) {
            let name = String::from_utf8_lossy(&name.reply()?.name).into_owned();
            let (x, y) = (monitor.x.into(), monitor.y.into());
            let area = Area { x, y, width: monitor.width.into(), height: monitor.height.into() };
            monitors.push(Monitor { name, area, primary: monitor.primary });
        }
        Ok(monitors)
    }

    /// The window with a name; one whose title is just that comes before others, and one that is shown before one that is not.
    ///
    /// # Errors
    /// [`ScreenError::Ambiguous`] if several have it, and [`ScreenError::Failed`].
    pub fn find(&self, name: &WindowName) -> Result<Option<u32>, ScreenError> {
        chosen(self.windows()?, name)
    }

    /// What hides a part of a window; `None` if it is wholly visible.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn hidden(&self, window: u32, region: &Region) -> Result<Option<Hidden>, ScreenError> {
        Ok(covering::seen(&self.0, window, region)?.err())
    }
}

/// Whether the display is Xwayland's, and its windows are those of a Wayland session.
///
/// Xwayland with a window of its own for all (`Xwayland :1`) is like any other server: nobody redirects its windows, so that a program
/// may ask to do so.
fn is_rootless(connection: &RustConnection, root: WindowId) -> Result<bool, ScreenError> {
    let mut is_xwayland = connection.extension_information(XWAYLAND)?.is_some();
    if !is_xwayland && connection.extension_information(x11rb::protocol::randr::X11_EXTENSION_NAME)?.is_some() {
        let outputs = connection.randr_get_screen_resources_current(root)?.reply()?.outputs;
        if let Some(output) = outputs.first() {
            let name = connection.randr_get_output_info(*output, x11rb::CURRENT_TIME)?.reply()?.name;
            is_xwayland = name.starts_with(XWAYLAND.as_bytes());
        }
    }
    if !is_xwayland || connection.extension_information(x11rb::protocol::composite::X11_EXTENSION_NAME)?.is_none() {
        return Ok(false);
    }
    connection.composite_query_version(0, 4)?.reply()?;
    let is_free = unless_gone(connection.composite_redirect_subwindows(root, Redirect::MANUAL)?.check())?.is_some();
    if is_free {
        connection.composite_unredirect_subwindows(root, Redirect::MANUAL)?.check()?;
    }
    Ok(!is_free)
}

impl Server {
    /// The whole screen: that of all monitors together.
    fn screen(&self) -> Result<Area, ScreenError> {
        let root = self.connection.get_geometry(self.root)?.reply()?;
        Ok(Area { x: 0, y: 0, width: root.width.into(), height: root.height.into() })
    }
}
