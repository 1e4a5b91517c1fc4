//! Pictures of a part of a window, or of a monitor.

use std::time::Instant;

use spf_media::Rgb;

use super::windows::{Display, monitors};
use crate::area::Area;
use crate::choosing::AGAIN;
use crate::picture::Shown;
use crate::{Hidden, ScreenError, Target};

/// Takes pictures of a target. A window is found by its name, and followed when it moves or is resized.
#[derive(Debug)]
pub struct Eye {
    display: Display,
    target: Target,
    window: Option<u32>,
    looked: Option<Instant>,
}

impl Eye {
    /// For a target on the desktop.
    #[must_use]
    pub fn new(display: Display, target: Target) -> Self {
        Self { display, target, window: None, looked: None }
    }

    /// A picture of the target, or why it cannot be seen.
    ///
    /// # Errors
    /// [`ScreenError`]: the capture failed, or it is not clear which window or monitor is meant.
    pub fn look(&mut self) -> Result<Result<Shown, Hidden>, ScreenError> {
        let monitors = monitors()?;
        let areas: Vec<Area> = monitors.iter().map(|(monitor, _)| monitor.area).collect();
        let place = match &self.target {
            Target::Monitor { name } => {
                let known = || monitors.iter().map(|(monitor, _)| format!("`{}`", monitor.name)).collect::<Vec<_>>().join(", ");
                let found = monitors.iter().position(|(monitor, _)| monitor.name == *name);
                let place = found.ok_or_else(|| ScreenError::NoMonitor { name: name.clone(), known: known() })?;
                Ok((place, areas.get(place).copied().unwrap_or_default()))
            }
            Target::Portal { .. } => return Err(ScreenError::Portal("only Wayland has it".to_owned())),
            Target::Window { name, region } => {
                if self.window.is_none() && self.looked.is_none_or(|looked| looked.elapsed() >= AGAIN) {
                    self.looked = Some(Instant::now());
                    self.window = self.display.find(name)?;
                }
                match self.window {
                    Some(window) => match self.display.seen(window, region, &areas)? {
                        Err(Hidden::Gone(_)) => {
                            self.window = None;
                            Err(Hidden::Gone(name.clone()))
                        }
                        place => place,
                    },
                    None => Err(Hidden::Gone(name.clone())),
                }
            }
        };
        let (place, area) = match place {
            Ok(place) => place,
            Err(hidden) => return Ok(Err(hidden)),
        };
        let Some((monitor, handle)) = monitors.get(place) else { return Ok(Err(Hidden::OffScreen)) };
        let at = Instant::now();
        // What is on the screen, as on X11: a window's own picture would show it where it is covered.
        let from = |place: i32, start: i32| place.saturating_sub(start).max(0).unsigned_abs();
        let (x, y) = (from(area.x, monitor.area.x), from(area.y, monitor.area.y));
        let taken = handle.capture_region(x, y, area.width, area.height)?;
        let (width, height) = taken.dimensions();
        let data = taken.into_raw().as_chunks::<4>().0.iter().flat_map(|[red, green, blue, _]| [*red, *green, *blue]).collect();
        let image = Rgb::from_raw(width, height, data).map_err(|error| ScreenError::Failed(error.to_string()))?;
        Ok(Ok(Shown { image, area, at }))
    }
}
