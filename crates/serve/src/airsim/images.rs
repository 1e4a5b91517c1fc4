//! Pictures: rendered without the simulator's lock, in AirSim's three encodings.
//!
//! Source: AirSim's page on its picture API; bytes that are not compressed are blue, green, red (`RenderRequest.cpp`).

use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_drone::airsim::wire::structs::{ImageRequest, ImageResponse, ImageType};
use spf_flight::sim::WorldSnapshot;
use spf_media::png;
use spf_render::{Channels, RenderedImage};

use super::city::City;
use super::frames::{Ned, mounted};
use super::palette::COLOURS;
use super::settings::Capture;
use super::vehicle::Loaded;

/// Most pictures of one call.
const MOST: usize = 64;
/// Most pixels of one call.
const MOST_PIXELS: u64 = 64 << 20;
/// Depth of what is nowhere, metres: the largest half-precision number.
const NOWHERE: f32 = 65504.0;
/// Depth that is white in a picture of depths, metres.
const VISIBLE: f32 = 100.0;

/// Pictures to be rendered.
pub(super) struct Job {
    loaded: Loaded,
    snapshot: WorldSnapshot,
    labels: Vec<u8>,
    frame: Ned,
    stamp: u64,
    pictures: Vec<Picture>,
}

struct Picture {
    request: ImageRequest,
    pose: Pose,
    capture: Capture,
}

impl Job {
    /// What these requests ask for, as the world is now.
    pub(super) fn new(city: &mut City, vehicle: &str, requests: Vec<ImageRequest>) -> Result<Self, String> {
        if requests.len() > MOST {
            return Err(format!("{} pictures in one call are more than {MOST}", requests.len()));
        }
        let mut pictures = Vec::new();
        for request in requests {
            let (_, mount, body) = city.camera(vehicle, &request.camera_name)?;
            let pose = mounted(&body, mount.place, mount.turned);
            pictures.push(Picture { pose, capture: mount.capture(request.image_type), request });
        }
        let pixels: u64 = pictures.iter().map(|one| u64::from(one.capture.width) * u64::from(one.capture.height)).sum();
        if pixels > MOST_PIXELS {
            return Err(format!("{pixels} pixels in one call are more than {MOST_PIXELS}"));
        }
        let frame = city.vehicle(vehicle)?.frame;
        let snapshot = WorldSnapshot { pose: Pose::default(), actors: city.actors() };
        Ok(Self { loaded: city.loaded.clone(), snapshot, labels: city.labels(), frame, stamp: city.stamp(), pictures })
    }

    /// Renders them.
    pub(super) fn run(self) -> Vec<ImageResponse> {
        let Self { loaded, mut snapshot, labels, frame, stamp, pictures } = self;
        let mut image = RenderedImage::default();
        let mut last: Option<(Pose, Capture, Channels)> = None;
        let shared = wanted(&pictures);
        let shown = |Picture { request, pose, capture }: Picture| {
            let channels = shared.iter().find(|(at, of, _)| *at == pose && *of == capture).map(|(_, _, channels)| *channels);
            let channels = channels.unwrap_or_default();
            if last != Some((pose, capture, channels)) {
                snapshot.pose = pose;
                loaded.render_into(&camera(capture), &snapshot, channels, &mut image);
                last = Some((pose, capture, channels));
            }
            let encoded = encode(&request, capture, &image, &labels);
            let (message, pixels) = match encoded {
                Ok(pixels) => (String::new(), pixels),
                Err(why) => (why, Pixels::default()),
            };
            let at = frame.pose(&pose);
            let there = message.is_empty();
            ImageResponse {
                image_data_uint8: pixels.bytes,
                image_data_float: pixels.floats,
                camera_position: at.position,
                camera_orientation: at.orientation,
                camera_name: request.camera_name,
                time_stamp: stamp,
                message,
                pixels_as_float: request.pixels_as_float,
                compress: request.compress,
                width: if there { capture.width } else { 0 },
                height: if there { capture.height } else { 0 },
                image_type: request.image_type,
            }
        };
        pictures.into_iter().map(shown).collect()
    }
}

/// A camera with square pixels.
pub(super) fn camera(capture: Capture) -> Camera {
    let across = capture.fov.to_radians();
    let focal = 0.5 * f64::from(capture.width) / libm::tan(0.5 * across);
    let down = 2.0 * libm::atan(0.5 * f64::from(capture.height) / focal);
    Camera::from_fov(capture.width, capture.height, across, down, 0.0)
}

/// What has to be rendered from every pose: pictures of one view are rendered at once.
fn wanted(pictures: &[Picture]) -> Vec<(Pose, Capture, Channels)> {
    let mut all: Vec<(Pose, Capture, Channels)> = Vec::new();
    for one in pictures {
        let found = all.iter().position(|(pose, capture, _)| *pose == one.pose && *capture == one.capture);
        let place = found.unwrap_or_else(|| {
            all.push((one.pose, one.capture, Channels::default()));
            all.len() - 1
        });
        if let Some((.., channels)) = all.get_mut(place) {
            match one.request.image_type {
                ImageType::Scene => channels.rgb = true,
                ImageType::DepthPlanar | ImageType::DepthPerspective | ImageType::DepthVis => channels.depth = true,
                ImageType::Segmentation | ImageType::Infrared => channels.ids = true,
                _ => {}
            }
        }
    }
    all
}

#[derive(Default)]
struct Pixels {
    bytes: Vec<u8>,
    floats: Vec<f32>,
}

fn encode(request: &ImageRequest, capture: Capture, image: &RenderedImage, labels: &[u8]) -> Result<Pixels, String> {
    let label = |id: &u16| labels.get(usize::from(*id)).copied().unwrap_or(0);
    let rgb: Vec<u8> = match request.image_type {
        ImageType::DepthPlanar | ImageType::DepthPerspective | ImageType::DepthVis => {
            let depths = depths(request.image_type, capture, image);
            if request.pixels_as_float {
                return Ok(Pixels { bytes: Vec::new(), floats: depths });
            }
            let most = if request.image_type == ImageType::DepthVis { VISIBLE } else { 255.0 };
            depths.iter().flat_map(|depth| [(depth / most * 255.0).clamp(0.0, 255.0).round() as u8; 3]).collect()
        }
        ImageType::Scene | ImageType::Segmentation | ImageType::Infrared if request.pixels_as_float => {
            return Err("only depths are given as floats here".to_owned());
        }
        ImageType::Scene => image.rgb.clone().unwrap_or_default(),
        ImageType::Segmentation => {
            let ids = image.ids.as_deref().unwrap_or_default();
            ids.iter().flat_map(|id| COLOURS[usize::from(label(id))]).collect()
        }
        ImageType::Infrared => image.ids.as_deref().unwrap_or_default().iter().flat_map(|id| [label(id); 3]).collect(),
        other => return Err(format!("{other:?} is not simulated here")),
    };
    let bytes = if request.compress {
        png::encode_rgb8(capture.width, capture.height, &rgb).map_err(|error| error.to_string())?
    } else {
        let mut bgr = rgb;
        bgr.as_chunks_mut::<3>().0.iter_mut().for_each(|[red, _, blue]| core::mem::swap(red, blue));
        bgr
    };
    Ok(Pixels { bytes, floats: Vec::new() })
}

/// Depths, metres; of a picture of depths, too.
fn depths(image_type: ImageType, capture: Capture, image: &RenderedImage) -> Vec<f32> {
    let lens = camera(capture);
    let planar = image.depth.as_deref().unwrap_or_default();
    let width = capture.width.max(1) as usize;
    let along = |(index, depth): (usize, &f32)| {
        let depth = if *depth > 0.0 { *depth } else { NOWHERE };
        if image_type != ImageType::DepthPerspective || depth >= NOWHERE {
            return depth.min(NOWHERE);
        }
        let (x, y) = ((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
        let ray = libm::sqrt(1.0 + ((x - lens.cx) / lens.fx).powi(2) + ((y - lens.cy) / lens.fy).powi(2));
        ((f64::from(depth) * ray) as f32).min(NOWHERE)
    };
    planar.iter().enumerate().map(along).collect()
}
