//! The windows of programs, and the monitors.

use xcap::XCapError;

use super::stack;
use crate::area::{Area, Region};
use crate::choosing::chosen;
use crate::{Hidden, Monitor, ScreenError, Window, WindowName};

/// Programs whose windows lie over everything without covering it.
const SEEN_THROUGH: &[&str] =
    if cfg!(target_os = "macos") { &["Dock", "Window Server", "Control Center", "Notification Center"] } else { &[] };

/// The desktop of the session.
#[derive(Clone, Debug)]
pub struct Display(());

impl From<XCapError> for ScreenError {
    fn from(error: XCapError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// A window, and what is behind it.
pub(super) struct Listed {
    pub(super) window: Window,
    pub(super) handle: xcap::Window,
}

impl Display {
    /// The desktop; it has no name.
    ///
    /// # Errors
    /// [`ScreenError::NoDisplay`] for a name, which is one of X11, or without a monitor.
    pub fn open(name: Option<&str>) -> Result<Self, ScreenError> {
        let refused = |why: &str| ScreenError::NoDisplay { display: name.unwrap_or_default().to_owned(), why: why.to_owned() };
        if name.is_some() {
            return Err(refused("only X11 has displays with names"));
        }
        #[cfg(windows)]
        {
            // Pixels of the monitors, whatever their scale. It fails if it was set before, which is as good.
            let _set = enigo::set_dpi_awareness();
        }
        if xcap::Monitor::all()?.is_empty() {
            return Err(refused("there is no monitor"));
        }
        Ok(Self(()))
    }

    /// The windows of programs, from the lowest to the uppermost. Their contents are not known apart from their frames.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn windows(&self) -> Result<Vec<Window>, ScreenError> {
        Ok(self.listed()?.into_iter().rev().map(|listed| listed.window).collect())
    }

    /// The windows, from the uppermost to the lowest.
    pub(super) fn listed(&self) -> Result<Vec<Listed>, ScreenError> {
        let mut windows: Vec<Listed> = Vec::new();
        let mut in_front = None;
        for handle in xcap::Window::all()? {
            // It may have been closed meanwhile.
            let Ok(window) = read(&handle) else { continue };
            let pid = handle.pid().ok();
            // On macOS the program is asked, and not the window: of its windows, the uppermost has the focus.
            let focused = window.focused && pid.is_some() && in_front.is_none_or(|front| Some(front) != pid);
            if focused {
                in_front = pid;
            }
            windows.push(Listed { window: Window { focused, ..window }, handle });
        }
        Ok(windows)
    }

    /// The monitors.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn monitors(&self) -> Result<Vec<Monitor>, ScreenError> {
        Ok(monitors()?.into_iter().map(|(monitor, _)| monitor).collect())
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
        let areas: Vec<Area> = self.monitors()?.into_iter().map(|monitor| monitor.area).collect();
        Ok(self.seen(window, region, &areas)?.err())
    }

    /// On which monitor and where a part of a window is, or why it cannot be seen.
    pub(super) fn seen(
        &self,
        window: u32,
        region: &Region,
        monitors: &[Area],
    ) -> Result<Result<(usize, Area), Hidden>, ScreenError> {
        let mut above = Vec::new();
        for listed in self.listed()? {
            let Listed { window: Window { id, title, area, shown, .. }, handle } = listed;
            if id == window {
                let seen = if shown { stack::seen(&area, region, &above, monitors) } else { Err(Hidden::Minimised) };
                return Ok(seen);
            }
            let is_seen_through = || handle.app_name().is_ok_and(|name| SEEN_THROUGH.contains(&name.as_str()));
            if shown && (SEEN_THROUGH.is_empty() || !is_seen_through()) {
                above.push((title, area));
            }
        }
        Ok(Err(Hidden::Gone(WindowName::default())))
    }
}

fn read(handle: &xcap::Window) -> Result<Window, XCapError> {
    let area = Area { x: handle.x()?, y: handle.y()?, width: handle.width()?, height: handle.height()? };
    let title = handle.title()?.chars().filter(|letter| !letter.is_control()).collect();
    let classes = vec![handle.app_name()?];
    Ok(Window { id: handle.id()?, title, classes, area, shown: !handle.is_minimized()?, focused: handle.is_focused()? })
}

/// The monitors, and what captures them.
pub(super) fn monitors() -> Result<Vec<(Monitor, xcap::Monitor)>, ScreenError> {
    let read = |handle: xcap::Monitor| {
        let area = Area { x: handle.x()?, y: handle.y()?, width: handle.width()?, height: handle.height()? };
        Ok((Monitor { name: handle.name()?, area, primary: handle.is_primary()? }, handle))
    };
    xcap::Monitor::all()?.into_iter().map(read).collect()
}
