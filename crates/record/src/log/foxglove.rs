//! Conversion to Foxglove's message types, which its tools and others can display.
//!
//! Reference frames: `world` is ENU (x east, y north, z up, metres from the scene's origin). `body` is FLU (x forward,
//! y left, z up, tilted with the craft) at the *estimated* pose. `camera` is the optical frame: x right in the image, y
//! down, z forward.

pub use foxglove::Encode;
pub use foxglove::messages::{
    CameraCalibration, CompressedImage, FrameTransforms, ImageAnnotations, Log, PointCloud, PoseInFrame, SceneUpdate,
};

use bytes::{Bytes, BytesMut};
use foxglove::Decode;
use foxglove::messages::{
    CircleAnnotation, Color, FrameTransform, LinePrimitive, PackedElementField, Point2, Point3, PointsAnnotation, Quaternion,
    SceneEntity, SpherePrimitive, TextAnnotation, Timestamp, Vector3, line_primitive, log, packed_element_field,
    points_annotation,
};
use serde::Serialize;
use serde_json::Value;
use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_core::query::{ImageBox, ImagePoint, Mark};
use spf_core::time::Time;

/// The reference frame of the world.
const WORLD: &str = "world";
/// The reference frame of the craft at its estimated pose.
const BODY: &str = "body";
/// The reference frame of the image.
const CAMERA: &str = "camera";
/// The format of an image, and the model of a lens's distortion.
const JPEG: &str = "jpeg";
const LENS: &str = "plumb_bob";

/// Size of the waypoint cross, and line thickness, pixels.
const RING: f64 = 24.0;
const LINE: f64 = 2.0;

/// Names of the message types used for a video.
pub(super) const IMAGE: &str = "foxglove.CompressedImage";
pub(super) const ANNOTATIONS: &str = "foxglove.ImageAnnotations";
pub(super) const LOG: &str = "foxglove.Log";

/// Annotations of an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// The waypoint and its caption.
    pub waypoint: Option<(ImagePoint, String)>,
    /// Obstacles reported by the VLM, each with a caption.
    pub boxes: Vec<(ImageBox, String)>,
}

impl Marks {
    /// The boxes as marks.
    #[must_use]
    pub fn as_marks(&self) -> Vec<Mark> {
        self.boxes.iter().map(|(area, label)| Mark::Box { area: *area, label: label.clone() }).collect()
    }
}

/// Severity of a log message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// A normal event.
    Info,
    /// A deviation from what was requested.
    Warning,
    /// A loss.
    Error,
}

/// Encodes a message.
#[must_use]
pub fn encode<M: Encode>(message: &M) -> Bytes {
    let mut buffer = BytesMut::with_capacity(message.encoded_len().unwrap_or(256));
    // The only possible error is a buffer that cannot grow; this one can.
    message.encode(&mut buffer).ok();
    buffer.freeze()
}

/// Converts a message of one of the types in a flight log to JSON, with bytes as base64; `None` for other types and for
/// invalid data.
#[must_use]
pub fn to_json(schema: &str, data: &[u8]) -> Option<Value> {
    fn read<M: Decode + Serialize>(data: &[u8]) -> Option<Value> {
        M::decode(data).ok().and_then(|message| serde_json::to_value(message).ok())
    }
    match schema {
        "foxglove.CameraCalibration" => read::<CameraCalibration>(data),
        "foxglove.CompressedImage" => read::<CompressedImage>(data),
        "foxglove.FrameTransforms" => read::<FrameTransforms>(data),
        "foxglove.ImageAnnotations" => read::<ImageAnnotations>(data),
        "foxglove.Log" => read::<Log>(data),
        "foxglove.PointCloud" => read::<PointCloud>(data),
        "foxglove.PoseInFrame" => read::<PoseInFrame>(data),
        "foxglove.SceneUpdate" => read::<SceneUpdate>(data),
        _ => None,
    }
}

/// A message of poses, lines or a calibration, written again: what its type does not know does not stay. `None` if it is of
/// another type, or if any text in it is not one that this module writes.
#[must_use]
pub fn numbers_only(schema: &str, data: &[u8]) -> Option<Bytes> {
    /// The texts that this module gives such messages.
    const TEXTS: [&str; 9] = ["", WORLD, BODY, CAMERA, LENS, "plan", "path", "target", "LINE_LIST"];
    fn known(value: &Value) -> bool {
        match value {
            Value::String(text) => TEXTS.contains(&text.as_str()),
            Value::Array(list) => list.iter().all(known),
            Value::Object(fields) => fields.values().all(known),
            _ => true,
        }
    }
    fn again<M: Decode + Encode + Serialize>(data: &[u8]) -> Option<Bytes> {
        let message = M::decode(data).ok()?;
        serde_json::to_value(&message).is_ok_and(|value| known(&value)).then(|| encode(&message))
    }
    match schema {
        "foxglove.CameraCalibration" => again::<CameraCalibration>(data),
        "foxglove.FrameTransforms" => again::<FrameTransforms>(data),
        "foxglove.PoseInFrame" => again::<PoseInFrame>(data),
        "foxglove.SceneUpdate" => again::<SceneUpdate>(data),
        _ => None,
    }
}

/// The same camera image with another JPEG; `None` if it is no JPEG, or if `again` makes none of it.
#[must_use]
pub fn image_again(data: &[u8], again: impl FnOnce(&[u8]) -> Option<Bytes>) -> Option<Bytes> {
    let CompressedImage { timestamp, data, format, .. } = CompressedImage::decode(data).ok()?;
    let data = again(&data).filter(|_| format == JPEG)?;
    Some(encode(&CompressedImage { timestamp, frame_id: CAMERA.to_owned(), data, format }))
}

/// A camera image as JPEG, captured at `at`.
#[must_use]
pub fn image(at: Time, jpeg: Bytes) -> CompressedImage {
    CompressedImage { timestamp: Some(stamp(at)), frame_id: CAMERA.to_owned(), data: jpeg, format: JPEG.to_owned() }
}

/// The image in a message; `None` if it is not a JPEG.
pub(super) fn jpeg_of(data: &[u8]) -> Option<Bytes> {
    CompressedImage::decode(data).ok().filter(|image| image.format == JPEG).map(|image| image.data)
}

/// The text of a log message.
pub(super) fn line_of(data: &[u8]) -> Option<String> {
    Log::decode(data).ok().map(|line| line.message)
}

/// The marks in a message created by [`annotations`] for an image of this size.
pub(super) fn marks_of(data: &[u8], size: (u32, u32)) -> Option<Marks> {
    let drawn = ImageAnnotations::decode(data).ok()?;
    let fraction = |at: &Point2| ImagePoint { u: at.x / f64::from(size.0), v: at.y / f64::from(size.1) };
    let mut captions = drawn.texts.iter().map(|text| text.text.clone());
    let waypoint = drawn.circles.first().and_then(|circle| circle.position.as_ref()).map(fraction);
    let waypoint = waypoint.map(|point| (point, captions.next().unwrap_or_default()));
    let corners = |line: &PointsAnnotation| Some((fraction(line.points.first()?), fraction(line.points.get(2)?)));
    let areas = drawn.points.iter().filter_map(corners);
    let areas = areas.map(|(low, high)| ImageBox { left: low.u, top: low.v, right: high.u, bottom: high.v });
    Some(Marks { waypoint, boxes: areas.map(|area| (area, captions.next().unwrap_or_default())).collect() })
}

/// The annotations for the image of this size captured at `at`.
#[must_use]
pub fn annotations(at: Time, size: (u32, u32), marks: &Marks) -> ImageAnnotations {
    let timestamp = Some(stamp(at));
    let pixel = |u: f64, v: f64| Point2 { x: u * f64::from(size.0), y: v * f64::from(size.1) };
    let text = |position, text: &str, color| TextAnnotation {
        timestamp,
        position: Some(position),
        text: text.to_owned(),
        font_size: 14.0,
        text_color: Some(color),
        background_color: Some(Color { r: 0.0, g: 0.0, b: 0.0, a: 0.5 }),
        metadata: Vec::new(),
    };
    let (magenta, orange) = (Color { r: 1.0, g: 0.2, b: 0.9, a: 1.0 }, Color { r: 1.0, g: 0.6, b: 0.1, a: 1.0 });
    let mut drawn = ImageAnnotations { timestamp, ..ImageAnnotations::default() };
    if let Some((point, caption)) = &marks.waypoint {
        drawn.circles.push(CircleAnnotation {
            timestamp,
            position: Some(pixel(point.u, point.v)),
            diameter: RING,
            thickness: LINE,
            fill_color: None,
            outline_color: Some(magenta),
            metadata: Vec::new(),
        });
        let mut below = pixel(point.u, point.v);
        below.y += RING;
        drawn.texts.push(text(below, caption, magenta));
    }
    for (area, caption) in &marks.boxes {
        let corners = [(area.left, area.top), (area.right, area.top), (area.right, area.bottom), (area.left, area.bottom)];
        drawn.points.push(PointsAnnotation {
            timestamp,
            r#type: points_annotation::Type::LineLoop.into(),
            points: corners.map(|(u, v)| pixel(u, v)).to_vec(),
            outline_color: Some(orange),
            thickness: LINE,
            ..PointsAnnotation::default()
        });
        drawn.texts.push(text(pixel(area.left, area.top), caption, orange));
    }
    drawn
}

/// The calibration of the camera, including lens distortion.
#[must_use]
pub fn calibration(at: Time, camera: &Camera) -> CameraCalibration {
    let Camera { width, height, fx, fy, cx, cy, distortion, .. } = *camera;
    CameraCalibration {
        timestamp: Some(stamp(at)),
        frame_id: CAMERA.to_owned(),
        width,
        height,
        distortion_model: LENS.to_owned(),
        d: vec![distortion.k1, distortion.k2, distortion.p1, distortion.p2, 0.0],
        k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

/// The transforms from world to body, and from body to the camera, which is tilted down by `tilt` radians.
#[must_use]
pub fn transforms(at: Time, body: &Pose, tilt: f64) -> FrameTransforms {
    let link = |parent: &str, child: &str, translation: Vector3, rotation: Quaternion| FrameTransform {
        timestamp: Some(stamp(at)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(translation),
        rotation: Some(rotation),
    };
    let EnuPosition { east, north, up } = body.position;
    FrameTransforms {
        transforms: vec![
            link(WORLD, BODY, Vector3 { x: east, y: north, z: up }, flu_rotation(body.attitude)),
            link(BODY, CAMERA, Vector3::default(), optical_rotation(tilt)),
        ],
    }
}

/// A pose in the world.
#[must_use]
pub fn pose(at: Time, pose: &Pose) -> PoseInFrame {
    let EnuPosition { east, north, up } = pose.position;
    let pose = foxglove::messages::Pose {
        position: Some(Vector3 { x: east, y: north, z: up }),
        orientation: Some(flu_rotation(pose.attitude)),
    };
    PoseInFrame { timestamp: Some(stamp(at)), frame_id: WORLD.to_owned(), pose: Some(pose) }
}

/// The pose of a message that [`pose`] made; `None` if it is none.
#[must_use]
pub fn read_pose(data: &[u8]) -> Option<Pose> {
    let foxglove::messages::Pose { position, orientation } = PoseInFrame::decode(data).ok()?.pose?;
    let Vector3 { x: east, y: north, z: up } = position?;
    Some(Pose { position: EnuPosition { east, north, up }, attitude: attitude(orientation?) })
}

/// An object of the scene as a prism: closed polygons of east and north, from one height to another.
#[derive(Clone, Debug, PartialEq)]
pub struct Prism {
    /// Name of the object.
    pub name: String,
    /// Closed polygons of east and north, metres.
    pub polygons: Vec<Vec<[f64; 2]>>,
    /// Lower height, metres.
    pub bottom: f64,
    /// Upper height, metres.
    pub top: f64,
    /// Red, green, blue.
    pub colour: [u8; 3],
}

/// The scene as outlines.
#[must_use]
pub fn scene(at: Time, things: &[Prism]) -> SceneUpdate {
    let entities = things.iter().map(|thing| {
        let [r, g, b] = thing.colour.map(|value| f64::from(value) / 255.0);
        entity(at, format!("scene/{}", thing.name), edges(thing), Color { r, g, b, a: 1.0 })
    });
    SceneUpdate { deletions: Vec::new(), entities: entities.collect() }
}

/// The plan of a decision, from its start to its end. It replaces the previous plan.
#[must_use]
pub fn plan(at: Time, from: EnuPosition, to: EnuPosition) -> SceneUpdate {
    let magenta = Color { r: 1.0, g: 0.2, b: 0.9, a: 1.0 };
    let entity = entity(at, "plan".to_owned(), vec![corner(from), corner(to)], magenta);
    SceneUpdate { deletions: Vec::new(), entities: vec![entity] }
}

/// The middles of a map's occupied cells as points: `x`, `y`, `z` as 32-bit floats.
#[must_use]
pub fn cells(at: Time, occupied: impl Iterator<Item = EnuPosition>) -> PointCloud {
    let mut data = BytesMut::new();
    for EnuPosition { east, north, up } in occupied {
        for along in [east, north, up] {
            data.extend_from_slice(&(along as f32).to_le_bytes());
        }
    }
    let field = |(index, name): (usize, &str)| PackedElementField {
        name: name.to_owned(),
        offset: 4 * index as u32,
        r#type: packed_element_field::NumericType::Float32.into(),
    };
    PointCloud {
        timestamp: Some(stamp(at)),
        frame_id: WORLD.to_owned(),
        // Some readers need it.
        pose: Some(foxglove::messages::Pose {
            position: Some(Vector3::default()),
            orientation: Some(Quaternion { w: 1.0, ..Quaternion::default() }),
        }),
        point_stride: 12,
        fields: ["x", "y", "z"].into_iter().enumerate().map(field).collect(),
        data: data.freeze(),
    }
}

/// The planner's path through these places, and the target's position as a sphere with its standard deviation in metres as
/// radius. Both replace the previous ones; an empty path has no line.
#[must_use]
pub fn path(at: Time, places: &[EnuPosition], target: Option<(EnuPosition, f64)>) -> SceneUpdate {
    let green = Color { r: 0.1, g: 0.8, b: 0.4, a: 1.0 };
    let pieces = places.windows(2).flat_map(|ends| [corner(ends[0]), corner(ends[1])]).collect();
    let path = entity(at, "path".to_owned(), pieces, green);
    let sphere = target.map(|(EnuPosition { east, north, up }, sd)| {
        let size = 2.0 * sd.max(0.1);
        let pose = foxglove::messages::Pose {
            position: Some(Vector3 { x: east, y: north, z: up }),
            orientation: Some(Quaternion { w: 1.0, ..Quaternion::default() }),
        };
        let size = Some(Vector3 { x: size, y: size, z: size });
        SpherePrimitive { pose: Some(pose), size, color: Some(Color { r: 1.0, g: 0.2, b: 0.9, a: 0.4 }) }
    });
    let target = SceneEntity {
        timestamp: Some(stamp(at)),
        frame_id: WORLD.to_owned(),
        id: "target".to_owned(),
        spheres: sphere.into_iter().collect(),
        ..SceneEntity::default()
    };
    SceneUpdate { deletions: Vec::new(), entities: vec![path, target] }
}

/// A text message.
#[must_use]
pub fn log_line(at: Time, level: Level, message: String) -> Log {
    let level = match level {
        Level::Info => log::Level::Info,
        Level::Warning => log::Level::Warning,
        Level::Error => log::Level::Error,
    };
    Log { timestamp: Some(stamp(at)), level: level.into(), message, name: "spf".to_owned(), ..Log::default() }
}

/// Converts flight time to a time stamp in seconds since the start. It overflows after 136 years.
fn stamp(at: Time) -> Timestamp {
    let nanos = at.as_nanos();
    Timestamp::new(u32::try_from(nanos / 1_000_000_000).unwrap_or(u32::MAX), (nanos % 1_000_000_000) as u32)
}

fn entity(at: Time, id: String, points: Vec<Point3>, color: Color) -> SceneEntity {
    let line = LinePrimitive {
        r#type: line_primitive::Type::LineList.into(),
        thickness: LINE,
        scale_invariant: true,
        points,
        color: Some(color),
        ..LinePrimitive::default()
    };
    SceneEntity { timestamp: Some(stamp(at)), frame_id: WORLD.to_owned(), id, lines: vec![line], ..SceneEntity::default() }
}

/// Edges as pairs of points: both outlines, and a vertical at each corner.
fn edges(thing: &Prism) -> Vec<Point3> {
    let mut ends = Vec::new();
    for polygon in &thing.polygons {
        for (index, &[east, north]) in polygon.iter().enumerate() {
            let [next_east, next_north] = polygon[(index + 1) % polygon.len()];
            let at = |east, north, up| corner(EnuPosition { east, north, up });
            for up in [thing.bottom, thing.top] {
                ends.extend([at(east, north, up), at(next_east, next_north, up)]);
            }
            ends.extend([at(east, north, thing.bottom), at(east, north, thing.top)]);
        }
    }
    ends
}

fn corner(at: EnuPosition) -> Point3 {
    Point3 { x: at.east, y: at.north, z: at.up }
}

/// Rotation from FLU to ENU: roll (right side down), then pitch (nose up), then heading (clockwise from north).
fn flu_rotation(attitude: Attitude) -> Quaternion {
    let yaw = core::f64::consts::FRAC_PI_2 - attitude.heading;
    // Positive pitch is a negative rotation about the left axis.
    turn_z(yaw, turn_y(-attitude.pitch, turn_x(attitude.roll)))
}

/// The inverse of [`flu_rotation`], for a rotation of unit length. Straight up and down, roll and heading are the same turn: it counts
/// as heading.
fn attitude(Quaternion { x, y, z, w }: Quaternion) -> Attitude {
    // Elements of the rotation matrix: its first column is the nose in the world.
    let (nose_east, nose_north, nose_up) = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y));
    let pitch = libm::asin(nose_up.clamp(-1.0, 1.0));
    Attitude {
        heading: wrap_angle(core::f64::consts::FRAC_PI_2 - libm::atan2(nose_north, nose_east)),
        pitch,
        roll: libm::atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    }
}

/// Rotation from the optical frame to FLU, tilted downwards.
fn optical_rotation(tilt: f64) -> Quaternion {
    let level = Quaternion { x: -0.5, y: 0.5, z: -0.5, w: 0.5 };
    turn_y(tilt, level)
}

fn turn_x(angle: f64) -> Quaternion {
    Quaternion { x: libm::sin(0.5 * angle), y: 0.0, z: 0.0, w: libm::cos(0.5 * angle) }
}

/// `q` followed by a rotation about y.
fn turn_y(angle: f64, q: Quaternion) -> Quaternion {
    let (s, c) = (libm::sin(0.5 * angle), libm::cos(0.5 * angle));
    Quaternion { x: c * q.x + s * q.z, y: c * q.y + s * q.w, z: c * q.z - s * q.x, w: c * q.w - s * q.y }
}

/// `q` followed by a rotation about z.
fn turn_z(angle: f64, q: Quaternion) -> Quaternion {
    let (s, c) = (libm::sin(0.5 * angle), libm::cos(0.5 * angle));
    Quaternion { x: c * q.x - s * q.y, y: c * q.y + s * q.x, z: c * q.z + s * q.w, w: c * q.w - s * q.z }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotates a vector by a quaternion: v + 2w(q×v) + 2q×(q×v).
    fn turned(q: Quaternion, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let cross = |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let axis = [q.x, q.y, q.z];
        let once = cross(axis, [x, y, z]);
        let twice = cross(axis, once);
        [x + 2.0 * (q.w * once[0] + twice[0]), y + 2.0 * (q.w * once[1] + twice[1]), z + 2.0 * (q.w * once[2] + twice[2])]
    }

    fn close(a: [f64; 3], b: [f64; 3]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    }

    #[test]
    fn cells_are_three_floats_each() {
        let places = [(1.125, -2.375, 0.125), (-8.875, 3.125, 4.375)];
        let message = cells(Time::ZERO, places.iter().map(|&(east, north, up)| EnuPosition { east, north, up }));
        assert_eq!((message.point_stride, message.data.len()), (12, 24));
        assert_eq!(
            message.fields.iter().map(|field| (field.name.as_str(), field.offset)).collect::<Vec<_>>(),
            [("x", 0), ("y", 4), ("z", 8)]
        );
        assert_eq!(&message.data[12..16], &(-8.875f32).to_le_bytes());
    }

    #[test]
    fn a_path_is_drawn_piece_by_piece_and_a_target_as_large_as_its_deviation() {
        let at = |east| EnuPosition { east, north: 0.0, up: 1.0 };
        let drawn = path(Time::ZERO, &[at(0.0), at(1.0), at(2.0)], Some((at(9.0), 1.5)));
        assert_eq!(drawn.entities[0].lines[0].points.iter().map(|point| point.x).collect::<Vec<_>>(), [0.0, 1.0, 1.0, 2.0]);
        assert_eq!(drawn.entities[1].spheres[0].size.map(|size| size.x), Some(3.0));
        let nothing = path(Time::ZERO, &[], None);
        assert!(nothing.entities[0].lines[0].points.is_empty() && nothing.entities[1].spheres.is_empty());
    }

    #[test]
    fn the_body_faces_its_heading() {
        let attitude = |heading: f64, pitch: f64, roll: f64| Attitude { heading, pitch, roll };
        let forward = [1.0, 0.0, 0.0];
        // Heading 0 is north, a quarter turn clockwise is east.
        close(turned(flu_rotation(attitude(0.0, 0.0, 0.0)), forward), [0.0, 1.0, 0.0]);
        close(turned(flu_rotation(attitude(core::f64::consts::FRAC_PI_2, 0.0, 0.0)), forward), [1.0, 0.0, 0.0]);
        // Nose up by 30°: the nose is half a metre up; right side down: the left wing rises.
        let up = turned(flu_rotation(attitude(0.0, 30f64.to_radians(), 0.0)), forward);
        assert!((up[2] - 0.5).abs() < 1e-9, "{up:?}");
        let left = turned(flu_rotation(attitude(0.0, 0.0, 30f64.to_radians())), [0.0, 1.0, 0.0]);
        assert!((left[2] - 0.5).abs() < 1e-9, "{left:?}");
    }

    #[test]
    fn a_pose_is_read_back() {
        for (heading, pitch, roll) in [(0.0, 0.0, 0.0), (1.2, -0.3, 0.2), (-2.9, 0.7, -1.1), (3.1, 1.4, 2.0)] {
            let position = EnuPosition { east: 1.5, north: -2.0, up: 30.25 };
            let written = Pose { position, attitude: Attitude { heading, pitch, roll } };
            let read = read_pose(&encode(&pose(Time::from_millis(1500), &written))).unwrap();
            let (a, b) = (read.attitude, written.attitude);
            assert_eq!(read.position, position);
            let apart = [a.heading - b.heading, a.pitch - b.pitch, a.roll - b.roll];
            assert!(apart.iter().all(|angle| angle.abs() < 1e-12), "{a:?} {b:?}");
        }
        assert_eq!(read_pose(b"no message"), None);
    }

    #[test]
    fn the_image_is_upright_and_the_lens_looks_down_by_its_tilt() {
        let tilt = 30f64.to_radians();
        // Optical axis: forward and half a metre down. Right in the image: the body's right.
        let into = turned(optical_rotation(tilt), [0.0, 0.0, 1.0]);
        close(into, [libm::cos(tilt), 0.0, -0.5]);
        close(turned(optical_rotation(tilt), [1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
        // Down in the image: down, and backwards because of the tilt.
        close(turned(optical_rotation(tilt), [0.0, 1.0, 0.0]), [-0.5, 0.0, -libm::cos(tilt)]);
    }

    #[test]
    fn a_square_has_twelve_edges() {
        let polygon = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let thing = Prism { name: "hut".to_owned(), polygons: vec![polygon], bottom: 0.0, top: 3.0, colour: [0; 3] };
        let update = scene(Time::ZERO, &[thing]);
        assert_eq!(update.entities[0].lines[0].points.len(), 2 * 12);
    }

    #[test]
    fn numbers_stay_and_other_texts_do_not() {
        let at = |east| EnuPosition { east, north: 0.0, up: 1.0 };
        let lines = [plan(Time::ZERO, at(0.0), at(1.0)), path(Time::ZERO, &[at(0.0), at(1.0)], Some((at(9.0), 1.5)))];
        for data in lines.map(|message| encode(&message)) {
            assert_eq!(numbers_only("foxglove.SceneUpdate", &data).as_ref(), Some(&data));
        }
        let poses = encode(&transforms(Time::ZERO, &Pose::default(), 0.1));
        assert_eq!(numbers_only("foxglove.FrameTransforms", &poses), Some(poses));
        let lens = encode(&calibration(Time::ZERO, &Camera::quad()));
        assert_eq!(numbers_only("foxglove.CameraCalibration", &lens), Some(lens));
        let hut = Prism { name: "hut".to_owned(), polygons: Vec::new(), bottom: 0.0, top: 3.0, colour: [0; 3] };
        assert_eq!(numbers_only("foxglove.SceneUpdate", &encode(&scene(Time::ZERO, &[hut]))), None);
        assert_eq!(numbers_only("foxglove.Log", &encode(&log_line(Time::ZERO, Level::Info, String::new()))), None);
    }

    #[test]
    fn marks_are_read_back() {
        let area = ImageBox { left: 0.25, top: 0.5, right: 0.5, bottom: 0.75 };
        let waypoint = Some((ImagePoint { u: 0.75, v: 0.125 }, "7.0 m".to_owned()));
        for marks in [Marks { waypoint, boxes: vec![(area, "tree 3".to_owned())] }, Marks::default()] {
            let data = encode(&annotations(Time::ZERO, (640, 480), &marks));
            assert_eq!(marks_of(&data, (640, 480)), Some(marks));
        }
    }
}
