//! Which camera is at a device: the kernel gives the name of one that was unplugged to the next that is plugged in.

use std::path::{Path, PathBuf};

/// Where the kernel tells about video devices.
const CLASS: &str = "/sys/class/video4linux";
/// Links that are named after the camera itself, wherever it is plugged in.
const BY_ID: &str = "/dev/v4l/by-id";

/// A camera, as far as it can be told from others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    /// Its name, such as `HD Pro Webcam C920`.
    name: String,
    /// Where it is plugged in; `None` if the path of the device names the camera itself.
    place: Option<PathBuf>,
}

impl Identity {
    /// That of the camera at a device; `None` if the kernel does not tell.
    pub(super) fn of(device: &Path) -> Option<Self> {
        Self::read(Path::new(CLASS), device, device.starts_with(BY_ID))
    }

    fn read(class: &Path, device: &Path, by_id: bool) -> Option<Self> {
        let entry = class.join(device.canonicalize().ok()?.file_name()?);
        let name = std::fs::read_to_string(entry.join("name")).ok()?.trim().to_owned();
        let place = if by_id { None } else { Some(entry.join("device").canonicalize().ok()?) };
        Some(Self { name, place })
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn another_camera_or_another_place_is_told_from_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let at = |path: &str| folder.path().join(path);
        for path in ["class/video0", "usb1/1-2", "usb1/1-3", "by-id"] {
            fs::create_dir_all(at(path)).unwrap();
        }
        fs::write(at("video0"), "").unwrap();
        symlink(at("video0"), at("by-id/usb-Maker_Camera_1234")).unwrap();
        let plug = |place: &str, name: &str| {
            fs::remove_file(at("class/video0/device")).ok();
            symlink(at(place), at("class/video0/device")).unwrap();
            fs::write(at("class/video0/name"), format!("{name}\n")).unwrap();
        };
        let read = |device: &str, by_id| Identity::read(&at("class"), &at(device), by_id).unwrap();
        plug("usb1/1-2", "First");
        let (first, named) = (read("video0", false), read("by-id/usb-Maker_Camera_1234", true));
        assert_eq!((first.name(), &first), ("First", &read("video0", false)));
        plug("usb1/1-2", "Second");
        assert_ne!(first, read("video0", false));
        plug("usb1/1-3", "First");
        assert_ne!(first, read("video0", false));
        // The link names the camera itself.
        assert_eq!(named, read("by-id/usb-Maker_Camera_1234", true));
        assert_eq!(Identity::read(&at("class"), &at("video1"), false), None);
    }
}
