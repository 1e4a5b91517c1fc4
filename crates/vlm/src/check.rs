//! Checks whether a model replies, and whether its coordinates match the table, with three images of one dot each.

use std::sync::Arc;

use spf_core::frame::FrameId;
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::prompt::{PromptInput, point_prompt};
use spf_core::query::{ImagePoint, Memory, Query, QueryId, QueryKind};
use spf_core::reply::parse_reply;
use spf_core::time::Duration;
use spf_media::{Jpeg, Rgb, resize};

use crate::{Answer, QueryImage, QueryRequest, Usage, Vlm, VlmError};

/// Positions of the dots, off the diagonal so that swapped coordinates show.
pub const DOTS: [ImagePoint; 3] = [ImagePoint { u: 0.2, v: 0.7 }, ImagePoint { u: 0.75, v: 0.3 }, ImagePoint { u: 0.55, v: 0.9 }];
/// Radius of a dot as a fraction of the image's width.
const RADIUS: f64 = 0.03;
/// Maximum distance of a correct point from the dot's centre, as a fraction of the image.
pub const NEAR: f64 = 0.06;
/// Width and height of the frames of the simulator's cameras and of a Tello's, pixels.
pub const USUAL_CAMERA: (u32, u32) = (960, 720);
const INSTRUCTION: &str = "fly to the red dot";

/// A model's reply to one dot.
#[derive(Clone, Debug)]
pub struct Pointed {
    /// Where the dot is.
    pub dot: ImagePoint,
    /// The reply.
    pub answer: Answer,
    /// The point in it, parsed with the table's coordinates.
    pub point: Option<ImagePoint>,
}

/// The result of the three dots.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// It points at the dots; the largest distance as a fraction of the image.
    Good(f64),
    /// It uses different coordinates from those in the table.
    Other(GroundingProfile),
    /// It replies, but does not point at the dots; the largest distance.
    Astray(f64),
    /// It replies, but not in the requested format.
    Unreadable(String),
    /// It does not reply.
    Failed(VlmError),
}

/// The result of a check, with details.
#[derive(Clone, Debug)]
pub struct Check {
    /// The reply to each dot.
    pub pointed: Vec<Pointed>,
    /// The conclusion.
    pub verdict: Verdict,
    /// Width and height of the images sent, pixels.
    pub image_px: (u32, u32),
    /// Resources used.
    pub account: Usage,
}

/// One dot on grey, as the image of a query: where it is, and the size of the camera's frames.
struct Dotted(ImagePoint, (u32, u32));

impl QueryImage for Dotted {
    fn size(&self) -> (u32, u32) {
        self.1
    }

    fn jpeg(&mut self, (width, height): (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        let image = resize(&dotted(self.0, self.1), width, height);
        Jpeg::encode(&image, quality).map(|jpeg| jpeg.shared()).map_err(|error| VlmError::Image(error.to_string()))
    }
}

/// The calibration image of this width and height, pixels: grey with one red dot.
#[must_use]
pub fn dotted(dot: ImagePoint, (width, height): (u32, u32)) -> Rgb {
    let mut image = Rgb::filled(width, height, [128, 128, 128]);
    let (x, y, radius) = (dot.u * f64::from(width), dot.v * f64::from(height), RADIUS * f64::from(width));
    for row in 0..height {
        for column in 0..width {
            let (dx, dy) = (f64::from(column) + 0.5 - x, f64::from(row) + 0.5 - y);
            if dx * dx + dy * dy <= radius * radius {
                image.set_pixel(column, row, [230, 20, 20]);
            }
        }
    }
    image
}

/// Sends the dots to a model, one after the other, each with a time limit of `time`, as images of a camera with frames of `camera`
/// pixels (width, height): some servers resize images of other shapes than 4:3 without saying so.
pub fn check(vlm: &mut dyn Vlm, time: Duration, camera: (u32, u32)) -> Check {
    let image_spec = vlm.image_spec(camera);
    let image_px = image_spec.image_size.unwrap_or(camera);
    let mut check = Check { pointed: Vec::new(), verdict: Verdict::Good(0.0), image_px, account: Usage::default() };
    for (number, dot) in (0..).zip(DOTS) {
        let query = query(number, &image_spec.grounding, image_spec.image_size);
        let answer = vlm.answer(&QueryRequest::new(&query, time), &mut Dotted(dot, camera));
        check.account.add(&answer.account);
        check.account.parts = answer.account.parts;
        if let Err(error) = &answer.text {
            check.verdict = Verdict::Failed(error.clone());
            check.pointed.push(Pointed { dot, answer, point: None });
            return check;
        }
        let reply = answer.text.as_ref().ok().and_then(|text| parse_reply(text, &image_spec.grounding, false).ok());
        check.pointed.push(Pointed { dot, point: reply.and_then(|reply| reply.point), answer });
    }
    check.verdict = verdict(&check.pointed, &image_spec.grounding, image_px);
    check
}

fn query(number: u64, profile: &GroundingProfile, image_size: Option<(u32, u32)>) -> Query {
    let memory = Memory::default();
    Query {
        instruction: INSTRUCTION.to_owned(),
        prompt: point_prompt(&PromptInput::new(INSTRUCTION, &memory, profile)),
        memory,
        image_size,
        ..Query::new(QueryId(number), FrameId(number), QueryKind::point(false))
    }
}

/// The largest distance of the replies from their dots when read in these coordinates; `None` if one cannot be parsed.
fn worst(pointed: &[Pointed], profile: &GroundingProfile) -> Option<f64> {
    let distance = |pointed: &Pointed| {
        let point = parse_reply(pointed.answer.text.as_ref().ok()?, profile, false).ok()?.point?;
        Some((point.u - pointed.dot.u).abs().max((point.v - pointed.dot.v).abs()))
    };
    pointed.iter().map(distance).try_fold(0.0, |worst: f64, distance| distance.map(|distance| worst.max(distance)))
}

fn verdict(pointed: &[Pointed], request: &GroundingProfile, (width, height): (u32, u32)) -> Verdict {
    let own = worst(pointed, request);
    if let Some(worst) = own.filter(|worst| *worst <= NEAR) {
        return Verdict::Good(worst);
    }
    // Three correct points cannot be a coincidence.
    let scales = [Scale::Thousand, Scale::Hundred, Scale::Unit, Scale::Pixels { width, height }];
    let all = [AxisOrder::Yx, AxisOrder::Xy]
        .into_iter()
        .flat_map(|order| scales.map(|scale| GroundingProfile { order, scale, ..GroundingProfile::default() }));
    if let Some(other) = all.into_iter().find(|profile| worst(pointed, profile).is_some_and(|worst| worst <= NEAR)) {
        return Verdict::Other(other);
    }
    if let Some(worst) = own {
        return Verdict::Astray(worst);
    }
    let unread = pointed.iter().filter_map(|pointed| pointed.answer.text.as_ref().ok()).find_map(|text| {
        match parse_reply(text, request, false) {
            Err(error) => Some(error.to_string()),
            Ok(reply) if reply.point.is_none() => Some("it reports the dot as not visible".to_owned()),
            Ok(_) => None,
        }
    });
    Verdict::Unreadable(unread.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImageSpec;

    /// Points at the dots in its own coordinates, whatever the query.
    struct Pointer {
        request: GroundingProfile,
        own: GroundingProfile,
        shift: f64,
    }

    impl Vlm for Pointer {
        fn name(&self) -> &str {
            "pointer"
        }

        fn image_spec(&self, _: (u32, u32)) -> ImageSpec {
            ImageSpec { grounding: self.request, image_size: None }
        }

        fn answer(&mut self, request: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
            let dot = DOTS[usize::try_from(request.query.id.0).unwrap()];
            let [a, b] = self.own.point_numbers(ImagePoint { u: dot.u + self.shift, v: dot.v });
            let text = format!("{{\"status\":\"navigating\",\"point\":[{a},{b}],\"depth\":2}}");
            Answer { text: Ok(text), latency: Duration::ZERO, model: String::new(), account: Usage::default() }
        }
    }

    fn verdict_of(request: GroundingProfile, own: GroundingProfile, shift: f64) -> Verdict {
        check(&mut Pointer { request, own, shift }, Duration::from_secs(1), USUAL_CAMERA).verdict
    }

    #[test]
    fn swapped_axes_and_wrong_scales_are_reported() {
        let pixels = Scale::Pixels { width: 960, height: 720 };
        let all = [AxisOrder::Yx, AxisOrder::Xy].into_iter().flat_map(|order| {
            [Scale::Thousand, Scale::Hundred, Scale::Unit, pixels].map(|scale| GroundingProfile {
                order,
                scale,
                ..GroundingProfile::default()
            })
        });
        let all: Vec<_> = all.collect();
        for request in &all {
            for own in &all {
                match verdict_of(*request, *own, 0.0) {
                    Verdict::Good(worst) => assert!(request == own && worst < 0.01, "{request:?} {own:?}"),
                    Verdict::Other(found) => assert!(request != own && found == *own, "{request:?} {own:?} {found:?}"),
                    other => panic!("{request:?} {own:?}: {other:?}"),
                }
            }
        }
        let profile = GroundingProfile::default();
        assert!(matches!(verdict_of(profile, profile, 0.15), Verdict::Astray(worst) if (worst - 0.15).abs() < 1e-3));
    }

    #[test]
    fn the_dot_is_where_it_is_declared() {
        let image = dotted(DOTS[0], USUAL_CAMERA);
        assert_eq!(image.pixel(192, 504), Some([230, 20, 20]));
        assert_eq!(image.pixel(504, 192), Some([128, 128, 128]));
        let red = (0..720)
            .flat_map(|y| (0..960).map(move |x| (x, y)))
            .filter(|(x, y)| image.pixel(*x, *y) == Some([230, 20, 20]))
            .count();
        // π·28.8² = 2606.
        assert!((2550..2660).contains(&red), "{red}");
    }
}
