//! Whether a window can be seen: shown, on the screen, and not under another one.

use x11rb::protocol::xproto::{ConnectionExt as _, MapState, Window as WindowId, WindowClass};

use super::windows::{ids, title};
use super::{Server, unless_gone};
use crate::area::{Area, Region};
use crate::choosing::{ALLOWED, LEAST};
use crate::{Hidden, ScreenError, WindowName};

/// How many windows lie in each other at most.
const DEPTH: usize = 16;

/// Where a part of a window, or of the screen, is found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Where on the screen it is.
    pub(super) area: Area,
    /// Whose pixels are taken: the screen's, or the window's own.
    pub(super) drawable: WindowId,
    /// The part of them.
    pub(super) part: Area,
}

/// Where a part of a window is, or why it cannot be seen.
///
/// It is what the screen shows, since a window without a compositor has no pixels where it is covered. Xwayland shows nothing itself,
/// and has all pixels of each window, wherever that is and whatever lies over it.
pub(super) fn seen(server: &Server, window: WindowId, region: &Region) -> Result<Result<Place, Hidden>, ScreenError> {
    let Server { connection, root, .. } = server;
    let (attributes, geometry) = (connection.get_window_attributes(window)?, connection.get_geometry(window)?);
    let corner = connection.translate_coordinates(window, *root, 0, 0)?;
    let (attributes, geometry) = (unless_gone(attributes.reply())?, unless_gone(geometry.reply())?);
    let (Some(attributes), Some(geometry), Some(corner)) = (attributes, geometry, unless_gone(corner.reply())?) else {
        return Ok(Err(Hidden::Gone(WindowName::default())));
    };
    if attributes.map_state != MapState::VIEWABLE {
        return Ok(Err(Hidden::Minimised));
    }
    let (width, height) = (geometry.width.into(), geometry.height.into());
    let whole = Area { x: corner.dst_x.into(), y: corner.dst_y.into(), width, height };
    let area = whole.part(region);
    if area.width < LEAST || area.height < LEAST {
        return Ok(Err(Hidden::Tiny { width: area.width, height: area.height }));
    }
    if server.is_rootless {
        let part = Area { x: area.x - whole.x, y: area.y - whole.y, ..area };
        return Ok(Ok(Place { area, drawable: window, part }));
    }
    let missing = |part: u64| (area.pixels() - part.min(area.pixels())) as f64 / area.pixels() as f64;
    if missing(server.screen()?.common(&area).pixels()) > ALLOWED {
        return Ok(Err(Hidden::OffScreen));
    }
    let mut covered = 0;
    let mut by = (0, None);
    for (other, place) in above(server, window)? {
        let common = area.common(&place).pixels();
        covered += common;
        if common > by.0 {
            by = (common, Some(other));
        }
    }
    if covered as f64 > ALLOWED * area.pixels() as f64 {
        let name = by.1.map(|other| name(server, other)).transpose()?.flatten();
        return Ok(Err(Hidden::Covered(name.map_or_else(|| "another window".to_owned(), |name| format!("`{name}`")))));
    }
    let area = area.common(&server.screen()?);
    Ok(Ok(Place { area, drawable: *root, part: area }))
}

/// The title of a window, or of one in it: a window manager's frame has none.
fn name(server: &Server, window: WindowId) -> Result<Option<String>, ScreenError> {
    if let Some(title) = title(server, window)? {
        return Ok(Some(title));
    }
    let Some(tree) = unless_gone(server.connection.query_tree(window)?.reply())? else { return Ok(None) };
    for child in tree.children {
        if let Some(title) = title(server, child)? {
            return Ok(Some(title));
        }
    }
    Ok(None)
}

/// The visible windows above a window, and where they are.
///
/// A compositor has a window of its own over everything, which covers nothing. With one, only the windows of programs count, in the
/// order that the window manager tells.
fn above(server: &Server, window: WindowId) -> Result<Vec<(WindowId, Area)>, ScreenError> {
    let Server { connection, root, atoms, .. } = server;
    let composited = connection.get_selection_owner(atoms._NET_WM_CM_S0)?.reply()?.owner != x11rb::NONE;
    let stacked = if composited { ids(server, atoms._NET_CLIENT_LIST_STACKING)? } else { Vec::new() };
    let (order, own) = if stacked.contains(&window) {
        (stacked, window)
    } else {
        (connection.query_tree(*root)?.reply()?.children, top(server, window)?)
    };
    let Some(place) = order.iter().position(|other| *other == own) else { return Ok(Vec::new()) };
    let mut asked = Vec::new();
    for other in &order[place + 1..] {
        let corner = connection.translate_coordinates(*other, *root, 0, 0)?;
        asked.push((*other, connection.get_window_attributes(*other)?, connection.get_geometry(*other)?, corner));
    }
    let mut found = Vec::new();
    for (other, attributes, geometry, corner) in asked {
        let (attributes, geometry) = (unless_gone(attributes.reply())?, unless_gone(geometry.reply())?);
        let (Some(attributes), Some(geometry), Some(corner)) = (attributes, geometry, unless_gone(corner.reply())?) else {
            continue;
        };
        if attributes.map_state == MapState::VIEWABLE && attributes.class != WindowClass::INPUT_ONLY {
            let border = i32::from(geometry.border_width);
            let length = |inside: u16| u32::from(inside) + 2 * u32::from(geometry.border_width);
            let (x, y) = (i32::from(corner.dst_x) - border, i32::from(corner.dst_y) - border);
            found.push((other, Area { x, y, width: length(geometry.width), height: length(geometry.height) }));
        }
    }
    Ok(found)
}

/// The window that lies directly on the screen and in which this one lies: a window manager's frame, or itself.
fn top(server: &Server, window: WindowId) -> Result<WindowId, ScreenError> {
    let mut at = window;
    for _ in 0..DEPTH {
        match unless_gone(server.connection.query_tree(at)?.reply())? {
            Some(tree) if tree.parent != server.root && tree.parent != x11rb::NONE => at = tree.parent,
            _ => break,
        }
    }
    Ok(at)
}
