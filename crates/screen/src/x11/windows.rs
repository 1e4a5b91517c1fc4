//! The windows of programs.

use x11rb::protocol::xproto::{Atom, AtomEnum, ConnectionExt as _, MapState, Window as WindowId};

use super::{Server, unless_gone};
use crate::area::Area;
use crate::{ScreenError, Window};

/// Longest title and longest list read from a property, in units of 4 bytes.
const LONGEST: u32 = 4096;
/// How deep windows without a window manager's list are looked for.
const DEPTH: usize = 3;

/// The windows of programs, from the lowest to the uppermost.
pub(super) fn list(server: &Server) -> Result<Vec<Window>, ScreenError> {
    let Server { connection, root, atoms, .. } = server;
    let mut ids = ids(server, atoms._NET_CLIENT_LIST_STACKING)?;
    if ids.is_empty() {
        ids = self::ids(server, atoms._NET_CLIENT_LIST)?;
    }
    if ids.is_empty() {
        titled(server, *root, DEPTH, &mut ids)?;
    }
    let focused = focused(server)?;
    let mut windows = Vec::new();
    for id in ids {
        let (attributes, geometry) = (connection.get_window_attributes(id)?, connection.get_geometry(id)?);
        let corner = connection.translate_coordinates(id, *root, 0, 0)?;
        let (attributes, geometry) = (unless_gone(attributes.reply())?, unless_gone(geometry.reply())?);
        let corner = unless_gone(corner.reply())?;
        // It may have been closed meanwhile.
        let (Some(attributes), Some(geometry), Some(corner)) = (attributes, geometry, corner) else { continue };
        let area =
            Area { x: corner.dst_x.into(), y: corner.dst_y.into(), width: geometry.width.into(), height: geometry.height.into() };
        let shown = attributes.map_state == MapState::VIEWABLE;
        let title = title(server, id)?.unwrap_or_default();
        windows.push(Window { id, title, classes: classes(server, id)?, area, shown, focused: focused == Some(id) });
    }
    Ok(windows)
}

/// A list of windows in a property of the root window; empty if there is none.
pub(super) fn ids(server: &Server, property: Atom) -> Result<Vec<WindowId>, ScreenError> {
    let Server { connection, root, .. } = server;
    let reply = connection.get_property(false, *root, property, AtomEnum::WINDOW, 0, LONGEST)?.reply()?;
    Ok(reply.value32().map(Iterator::collect).unwrap_or_default())
}

/// The window that is active by the window manager, or without one the one with the focus.
pub(super) fn focused(server: &Server) -> Result<Option<WindowId>, ScreenError> {
    match ids(server, server.atoms._NET_ACTIVE_WINDOW)?.first() {
        Some(active) => Ok(Some(*active)),
        None => Ok(Some(server.connection.get_input_focus()?.reply()?.focus)),
    }
}

/// The title of a window; `None` if it has none or is gone.
pub(super) fn title(server: &Server, window: WindowId) -> Result<Option<String>, ScreenError> {
    let Server { connection, atoms, .. } = server;
    let modern = connection.get_property(false, window, atoms._NET_WM_NAME, atoms.UTF8_STRING, 0, LONGEST)?;
    let old = connection.get_property(false, window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, LONGEST)?;
    let text = |reply: x11rb::protocol::xproto::GetPropertyReply| {
        let readable = String::from_utf8_lossy(&reply.value).chars().filter(|letter| !letter.is_control()).collect::<String>();
        (!readable.is_empty()).then_some(readable)
    };
    let (modern, old) = (unless_gone(modern.reply())?, unless_gone(old.reply())?);
    Ok(modern.and_then(text).or_else(|| old.and_then(text)))
}

/// The two texts of a window's class; none if it has none or is gone.
fn classes(server: &Server, window: WindowId) -> Result<Vec<String>, ScreenError> {
    let asked = server.connection.get_property(false, window, AtomEnum::WM_CLASS, AtomEnum::STRING, 0, LONGEST)?;
    let texts = unless_gone(asked.reply())?.map(|reply| reply.value).unwrap_or_default();
    let texts = texts.split(|byte| *byte == 0).filter(|text| !text.is_empty());
    Ok(texts.take(2).map(|text| String::from_utf8_lossy(text).replace(char::is_control, "")).collect())
}

/// Windows with a title in the tree below a window, from the lowest to the uppermost: without a window manager nobody lists them.
fn titled(server: &Server, below: WindowId, depth: usize, found: &mut Vec<WindowId>) -> Result<(), ScreenError> {
    let Some(tree) = unless_gone(server.connection.query_tree(below)?.reply())? else { return Ok(()) };
    for child in tree.children {
        if title(server, child)?.is_some() {
            found.push(child);
        } else if depth > 1 {
            titled(server, child, depth - 1, found)?;
        }
    }
    Ok(())
}
