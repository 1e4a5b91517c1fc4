//! The box of the tracked target in the video.

use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::panel::Panel;
use spf_core::query::ImageBox;
use spf_core::time::{Duration, Time};
use spf_core::track::TrackQuality;
use spf_media::Rgb;
use spf_media::marks::{Canvas, Colour, Rect};
use spf_pilot::Pilot;

/// How long a report is shown: without a newer one the tracker has stopped.
const SHOWN: Duration = Duration::from_secs(1);
/// The depth label at which the flown distance moves a box least: only the turning of the camera since the report counts.
const FAR: u8 = 10;

/// The tracked box as seen from `known`; `None` if there is none that can be trusted.
pub(super) fn area(pilot: &Pilot, camera: &Camera, at: Time, known: Pose) -> Option<(ImageBox, TrackQuality)> {
    let report = pilot.track().filter(|report| at.since(report.captured) <= SHOWN)?;
    if !matches!(report.quality, TrackQuality::Good | TrackQuality::Coasting) {
        return None;
    }
    // The report is on an older frame than the one that is shown.
    let then = pilot.pose_at(report.captured)?;
    let (area, _) = Panel::new(camera, then, report.area, FAR).seen_from(camera, known)?;
    Some((area, report.quality))
}

/// Draws it: thin, green if it is on the target, and pale where it is expected.
pub(super) fn draw(image: &mut Rgb, area: &ImageBox, quality: TrackQuality) {
    let colour = if quality == TrackQuality::Good { Colour::rgb(80, 220, 100) } else { Colour::rgb(190, 235, 195) };
    let mut canvas = Canvas::new(image);
    let (unit, width, height) = (canvas.unit(), canvas.width(), canvas.height());
    let area = Rect { left: area.left * width, top: area.top * height, right: area.right * width, bottom: area.bottom * height };
    canvas.frame(area, 2.6 * unit, Colour::INK.with_opacity(120));
    canvas.frame(area, 1.3 * unit, colour);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_drawn_thin_and_in_the_colour_of_its_quality() {
        let green = |quality| {
            let mut image = Rgb::filled(640, 480, [60; 3]);
            draw(&mut image, &ImageBox { left: 0.25, top: 0.25, right: 0.5, bottom: 0.5 }, quality);
            let changed = image.data().as_chunks::<3>().0.iter().filter(|pixel| **pixel != [60; 3]).count();
            // 160 × 120 pixels.
            assert!((500..2500).contains(&changed), "{changed}");
            image.data().as_chunks::<3>().0.iter().any(|[red, green, _]| green.saturating_sub(*red) > 60)
        };
        assert!(green(TrackQuality::Good) && !green(TrackQuality::Coasting));
    }
}
