//! Pictures of a part of a window, or of a monitor.

use std::time::Instant;

use spf_media::Rgb;

use super::covering::{Place, seen};
use super::segment::{Segment, is_shared, take_slowly};
use super::{Display, Server};
use crate::choosing::AGAIN;
use crate::picture::Shown;
use crate::portal::Stream;
use crate::{Hidden, ScreenError, Target, WindowName};

/// Takes pictures of a target. A window is found by its name, and followed when it moves or is resized.
pub struct Eye {
    display: Display,
    target: Target,
    window: Option<u32>,
    looked: Option<Instant>,
    memory: Memory,
    bytes: Vec<u8>,
    /// What the portal shows, once it was asked.
    stream: Option<Stream>,
}

impl std::fmt::Debug for Eye {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Eye").field("target", &self.target).field("window", &self.window).finish_non_exhaustive()
    }
}

/// Memory shared with the server.
#[derive(Debug)]
enum Memory {
    /// Not asked yet.
    Unknown,
    /// It is shared, once a segment is needed.
    Shared(Option<Segment>),
    /// The server shares none.
    None,
}

impl Eye {
    /// For a target on a display.
    #[must_use]
    pub fn new(display: Display, target: Target) -> Self {
        Self { display, target, window: None, looked: None, memory: Memory::Unknown, bytes: Vec::new(), stream: None }
    }

    /// A picture of the target, or why it cannot be seen. Takes two or three round trips to the server. For [`Target::Portal`] the first
    /// call waits until the user has chosen.
    ///
    /// # Errors
    /// [`ScreenError`]: the display failed, or it is not clear which window or monitor is meant.
    pub fn look(&mut self) -> Result<Result<Shown, Hidden>, ScreenError> {
        if let Target::Portal { region } = &self.target {
            let stream = match self.stream.take() {
                Some(stream) => stream,
                None => Stream::open()?,
            };
            return self.stream.insert(stream).look(region);
        }
        let place = match self.place()? {
            Ok(place) => place,
            Err(hidden) => return Ok(Err(hidden)),
        };
        let at = Instant::now();
        Ok(self.take(place)?.map(|image| Shown { image, area: place.area, at }).ok_or(Hidden::OffScreen))
    }

    fn place(&mut self) -> Result<Result<Place, Hidden>, ScreenError> {
        match &self.target {
            Target::Portal { .. } => Ok(Err(Hidden::Gone(WindowName::default()))),
            Target::Monitor { name } => {
                if self.display.0.is_rootless {
                    return Err(ScreenError::Wayland);
                }
                let monitors = self.display.monitors()?;
                let found = monitors.iter().find(|monitor| monitor.name == *name).map(|monitor| monitor.area);
                let known = monitors.iter().map(|monitor| format!("`{}`", monitor.name)).collect::<Vec<_>>().join(", ");
                let area = found.ok_or_else(|| ScreenError::NoMonitor { name: name.clone(), known })?;
                let area = area.common(&self.display.0.screen()?);
                Ok(Ok(Place { area, drawable: self.display.0.root, part: area }))
            }
            Target::Window { name, region } => {
                if self.window.is_none() && self.looked.is_none_or(|looked| looked.elapsed() >= AGAIN) {
                    self.looked = Some(Instant::now());
                    self.window = self.display.find(name)?;
                }
                let gone = Hidden::Gone(name.clone());
                let Some(window) = self.window else { return Ok(Err(gone)) };
                match seen(&self.display.0, window, region)? {
                    Err(Hidden::Gone(_)) => {
                        self.window = None;
                        Ok(Err(gone))
                    }
                    place => Ok(place),
                }
            }
        }
    }

    /// The pixels of a part of the screen; `None` if the server refuses, as when the screen has just become smaller.
    fn take(&mut self, Place { drawable, part: area, .. }: Place) -> Result<Option<Rgb>, ScreenError> {
        let Server { connection, layout, .. } = &*self.display.0;
        if matches!(self.memory, Memory::Unknown) {
            self.memory = if is_shared(connection)? { Memory::Shared(None) } else { Memory::None };
        }
        let length = area.pixels() * 4;
        if let Memory::Shared(segment) = &mut self.memory
            && segment.as_ref().is_none_or(|segment| segment.length() < length)
        {
            if let Some(old) = segment.take() {
                old.detach(connection);
            }
            *segment = Segment::new(connection, length)?;
            if segment.is_none() {
                // A server on another machine offers shared memory, and then refuses it.
                self.memory = Memory::None;
            }
        }
        let size = (area.width, area.height);
        if let Memory::Shared(Some(segment)) = &self.memory {
            self.bytes.resize(length as usize, 0);
            let taken = segment.take(connection, drawable, area, &mut self.bytes)?;
            return Ok(taken.then(|| layout.image(&self.bytes, size)).flatten());
        }
        let bytes = take_slowly(connection, drawable, area)?;
        Ok(bytes.and_then(|bytes| layout.image(&bytes, size)))
    }
}

impl Drop for Eye {
    fn drop(&mut self) {
        if let Memory::Shared(Some(segment)) = std::mem::replace(&mut self.memory, Memory::None) {
            segment.detach(&self.display.0.connection);
        }
    }
}
