//! Points followed from picture to picture, beside the instruments.

use std::collections::BTreeMap;

use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::geometry::Attitude;
use spf_core::lift::seen_after_turn;
use spf_core::query::ImagePoint;
use spf_media::points::Points;
use spf_media::track::{Shift, TrackImage};
use spf_media::{Rgb, Scaler};
use spf_screen::area::Region;

use super::turning::turn;

/// Width of the pictures in which points are followed, pixels.
const FLOW_WIDTH: u32 = 480;
/// Points this near to an instrument may belong to it, as a fraction of the picture.
const MARGIN: f64 = 0.02;
/// A greater turn from picture to picture cannot be followed, radians.
const GREATEST_TURN: f64 = 0.35;

/// The places of a point in two pictures.
pub(super) type Pair = (ImagePoint, ImagePoint);

/// Points followed from picture to picture.
pub(super) struct Flow {
    points: Points,
    scaler: Scaler,
    masks: Vec<Region>,
    before: BTreeMap<u32, ImagePoint>,
    commanded: f64,
}

impl Flow {
    pub(super) fn new(masks: Vec<Region>) -> Self {
        Self { points: Points::default(), scaler: Scaler::default(), masks, before: BTreeMap::new(), commanded: 0.0 }
    }

    /// Begins anew with the next picture.
    pub(super) fn forget(&mut self) {
        self.points = Points::default();
        self.before.clear();
    }

    /// The turn since the last picture in excess of what was commanded, radians; `None` if the picture does not tell. `commanded` is the
    /// sum of all commanded turns.
    pub(super) fn next(&mut self, image: &Rgb, camera: &Camera, motion: Setpoint, commanded: f64) -> Option<f64> {
        let asked = commanded - std::mem::replace(&mut self.commanded, commanded);
        let pairs = self.pairs(image, camera, asked);
        let turned = turn(camera, &pairs, motion, Some(asked))?;
        (turned.angle.abs() < GREATEST_TURN).then_some(turned.angle - asked)
    }

    /// Points with their places in the last picture and in this one. `asked` is the turn that is expected between them, radians.
    fn pairs(&mut self, image: &Rgb, camera: &Camera, asked: f64) -> Vec<Pair> {
        let Some(image) = self.prepared(image) else { return Vec::new() };
        let width = image.size().0;
        // Near the middle a turn shifts all points alike.
        let shift = -asked * camera.fx * f64::from(width) / f64::from(camera.width.max(1));
        let shift = Shift { x: shift, y: 0.0 };
        self.points.next(&image, |_| Some(shift));
        self.take_pairs(image.size())
    }

    /// The same for a camera that has turned by one of several changes of attitude. They are tried in this order until most points are
    /// followed; the one by which the most are is returned as well.
    pub(super) fn pairs_by(&mut self, image: &Rgb, camera: &Camera, turns: &[Attitude]) -> (Vec<Pair>, Attitude) {
        let Some(image) = self.prepared(image) else { return (Vec::new(), Attitude::default()) };
        let (width, height) = image.size();
        let (w, h) = (f64::from(width), f64::from(height));
        let mut best: Option<(usize, Points, Attitude)> = None;
        for turned in turns {
            let mut points = self.points.clone();
            points.next(&image, |(x, y)| {
                let at = ImagePoint { u: (x + 0.5) / w, v: (y + 0.5) / h };
                let to = seen_after_turn(at, camera, Attitude::default(), *turned)?;
                Some(Shift { x: (to.u - at.u) * w, y: (to.v - at.v) * h })
            });
            let followed = points.points().iter().filter(|point| self.before.contains_key(&point.id)).count();
            if best.as_ref().is_none_or(|(most, ..)| followed > *most) {
                best = Some((followed, points, *turned));
            }
            if 2 * followed >= self.before.len() {
                break;
            }
        }
        let turned = best.map_or(Attitude::default(), |(_, points, turned)| {
            self.points = points;
            turned
        });
        (self.take_pairs((width, height)), turned)
    }

    /// The picture in which points are followed.
    fn prepared(&mut self, image: &Rgb) -> Option<TrackImage> {
        let (width, height) = (FLOW_WIDTH, (FLOW_WIDTH * image.height() / image.width().max(1)).max(16));
        let small = self.scaler.scale(image, width, height);
        let grey: Vec<u8> = small.data().as_chunks::<3>().0.iter().map(|pixel| grey(*pixel)).collect();
        self.scaler.reuse(small);
        TrackImage::from_grey(width, height, grey).ok()
    }

    fn take_pairs(&mut self, (width, height): (u32, u32)) -> Vec<Pair> {
        let (w, h) = (f64::from(width), f64::from(height));
        let place = |x: f64, y: f64| ImagePoint { u: (x + 0.5) / w, v: (y + 0.5) / h };
        let free = |at: &ImagePoint| !self.masks.iter().any(|mask| mask.is_near(at.u, at.v, MARGIN));
        let points = self.points.points();
        let now: BTreeMap<u32, ImagePoint> =
            points.iter().map(|point| (point.id, place(point.x, point.y))).filter(|(_, at)| free(at)).collect();
        let pairs = now.iter().filter_map(|(id, to)| Some((*self.before.get(id)?, *to))).collect();
        self.before = now;
        pairs
    }
}

/// BT.709 luma.
fn grey([red, green, blue]: [u8; 3]) -> u8 {
    ((54 * u32::from(red) + 183 * u32::from(green) + 19 * u32::from(blue)) >> 8) as u8
}

#[cfg(test)]
mod tests {
    use spf_screen::profile::Profile;

    use super::*;

    /// What a camera that has turned by an angle sees of a wall all around, with blocks of colour. An instrument at the lower edge stays.
    fn picture(camera: &Camera, turned: f64) -> Rgb {
        let mut image = Rgb::new(960, 720);
        for y in 0..720_u32 {
            for x in 0..960_u32 {
                let ray = camera.ray(ImagePoint { u: (f64::from(x) + 0.5) / 960.0, v: (f64::from(y) + 0.5) / 720.0 });
                let (around, up) = (ray.right.atan() + turned, ray.up / ray.right.hypot(1.0));
                let (column, row) = ((around * 22.0 + 200.0) as u32, (up * 22.0 + 200.0) as u32);
                let level = (column.wrapping_mul(2_654_435_761) ^ row.wrapping_mul(40_503).wrapping_mul(column + 7)) >> 5;
                let instrument = y > 560 && (x / 12 + y / 12) % 2 == 0;
                image.set_pixel(x, y, if instrument { [255; 3] } else { [(level % 200) as u8; 3] });
            }
        }
        image
    }

    #[test]
    fn a_turn_is_seen_in_the_pictures_and_instruments_do_not_count() {
        let camera = Profile::shipped("luanti").unwrap().optics((960, 720));
        let mut flow = Flow::new(vec![Region([0.0, 0.75, 1.0, 0.25])]);
        assert_eq!(flow.next(&picture(&camera, 0.0), &camera, Setpoint::HOLD, 0.0), None);
        // None was commanded.
        let turned = flow.next(&picture(&camera, 0.02), &camera, Setpoint::HOLD, 0.0).unwrap();
        assert!((turned - 0.02).abs() < 0.002, "{turned}");
        // What was commanded leaves nothing to be corrected.
        let rest = flow.next(&picture(&camera, 0.04), &camera, Setpoint::HOLD, 0.02).unwrap();
        assert!(rest.abs() < 0.002, "{rest}");
        flow.forget();
        assert_eq!(flow.next(&picture(&camera, 0.06), &camera, Setpoint::HOLD, 0.02), None);
    }

    #[test]
    fn of_several_turns_the_one_that_was_made_is_found() {
        let camera = Profile::shipped("luanti").unwrap().optics((960, 720));
        let mut flow = Flow::new(Vec::new());
        let turned = Attitude { heading: 0.3, ..Attitude::default() };
        let turns = [Attitude::default(), Attitude { heading: -0.3, ..Attitude::default() }, turned];
        assert!(flow.pairs_by(&picture(&camera, 0.0), &camera, &turns).0.is_empty());
        let (pairs, found) = flow.pairs_by(&picture(&camera, 0.3), &camera, &turns);
        assert!(found == turned && pairs.len() > 20, "{found:?} {}", pairs.len());
    }
}
