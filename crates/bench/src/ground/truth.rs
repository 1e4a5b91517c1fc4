//! Ground truth of an instruction in an image.

use std::path::{Path, PathBuf};

use spf_core::query::{ImageBox, ImagePoint};
use spf_media::file::{self, FileError, Limits};

/// Maximum side length of a mask, pixels.
const LONGEST_SIDE: u32 = 8192;

/// The known properties of an instruction's target.
#[derive(Clone, Debug, PartialEq)]
pub enum Truth {
    /// Unknown: no grades.
    Unknown,
    /// The target is not in the image.
    Absent,
    /// The target.
    Target(Box<Target>),
}

/// A target in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Its shape.
    pub shape: Shape,
    /// The point from which errors are measured; `None` for the centre of the shape.
    pub point: Option<ImagePoint>,
    /// Its distance from the lens, metres.
    pub distance_m: Option<f64>,
    /// True boxes of the objects in the image, including the target, for grading boxes.
    pub boxes: Vec<ImageBox>,
}

/// The shape of a target, as in the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// An image with the same aspect ratio; every pixel that is not black is inside.
    MaskFile(PathBuf),
    /// The same in memory.
    Mask(Mask),
    /// Boxes; a point in any of them is inside.
    Boxes(Vec<ImageBox>),
    /// Closed polygons; a point in any of them is inside.
    Polygons(Vec<Vec<ImagePoint>>),
    /// Points, with the maximum distance of a hit, as a fraction of the image width; `None` if only distances are
    /// graded.
    Points(Vec<ImagePoint>, Option<f64>),
}

/// A mask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Pixels in rows from the upper left.
    pub inside: Vec<bool>,
}

/// Why ground truth cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TruthError {
    /// The mask's file could not be read.
    #[error("cannot read the mask `{}`", path.display())]
    Mask {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: FileError,
    },
    /// An empty mask.
    #[error("the mask `{}` is empty", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// The shape of a target for an image of a given size.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    shape: Shape,
    /// Width and height of the image, pixels.
    size: (f64, f64),
    /// Points from which errors are measured, the nearest counts; the first belongs to the largest part.
    middles: Vec<ImagePoint>,
    /// Area in pixels of the image, of the largest part; `None` for points.
    area: Option<f64>,
}

impl Mask {
    /// Reads a mask: PNG or JPEG of at most 8192 pixels per side.
    ///
    /// # Errors
    /// [`TruthError`] if it cannot be read or is empty.
    pub fn read(path: &Path) -> Result<Self, TruthError> {
        let wrong = |source| TruthError::Mask { path: path.to_owned(), source };
        let bytes = spf_input::read(path, super::photo::LONGEST_FILE).map_err(|error| wrong(error.into()))?;
        let grey = file::decode(&bytes, Limits { side: LONGEST_SIDE, ..Limits::default() }).map_err(wrong)?;
        let (width, height) = (grey.width(), grey.height());
        let mask = Self { width, height, inside: grey.into_grey8().into_iter().map(|value| value > 0).collect() };
        if mask.area() == 0 { Err(TruthError::Empty { path: path.to_owned() }) } else { Ok(mask) }
    }

    /// Number of pixels inside.
    #[must_use]
    pub fn area(&self) -> u64 {
        self.inside.iter().filter(|inside| **inside).count() as u64
    }

    /// Whether the pixel under a point is inside; a point on the lower or right edge belongs to the last pixel.
    #[must_use]
    pub fn holds(&self, at: ImagePoint) -> bool {
        let index =
            |fraction: f64, side: u32| ((fraction.clamp(0.0, 1.0) * f64::from(side)) as usize).min(side.max(1) as usize - 1);
        let (x, y) = (index(at.u, self.width), index(at.v, self.height));
        self.inside.get(y * self.width as usize + x).copied().unwrap_or(false)
    }

    /// The deepest pixel inside, by its centre.
    fn deepest(&self) -> ImagePoint {
        let ids: Vec<u16> = self.inside.iter().map(|inside| u16::from(*inside)).collect();
        let (w, h) = (f64::from(self.width.max(1)), f64::from(self.height.max(1)));
        spf_oracle::masks(&ids, self.width as usize).first().map_or(ImagePoint { u: 0.5, v: 0.5 }, |mask| ImagePoint {
            u: (mask.deepest.0 as f64 + 0.5) / w,
            v: (mask.deepest.1 as f64 + 0.5) / h,
        })
    }
}

impl Target {
    /// The target's shape in an image of `size` pixels; reads its mask.
    ///
    /// # Errors
    /// [`TruthError`] if the mask cannot be read.
    pub fn outline(&self, size: (u32, u32)) -> Result<Outline, TruthError> {
        let shape = match &self.shape {
            Shape::MaskFile(path) => Shape::Mask(Mask::read(path)?),
            other => other.clone(),
        };
        let size = (f64::from(size.0.max(1)), f64::from(size.1.max(1)));
        let pixels = size.0 * size.1;
        let (middles, area) = match &shape {
            Shape::Mask(mask) => {
                let all = f64::from(mask.width.max(1)) * f64::from(mask.height.max(1));
                (vec![mask.deepest()], Some(mask.area() as f64 / all * pixels))
            }
            Shape::Boxes(boxes) => {
                largest_first(boxes.iter().map(|b| (centre(b), (b.right - b.left) * (b.bottom - b.top) * pixels)))
            }
            Shape::Polygons(polygons) => {
                largest_first(polygons.iter().map(|polygon| (deep_inside(polygon), enclosed(polygon) * pixels)))
            }
            Shape::Points(points, _) => (points.clone(), None),
            Shape::MaskFile(_) => (Vec::new(), None),
        };
        let middles = self.point.map_or(middles, |point| vec![point]);
        Ok(Outline { shape, size, middles, area })
    }
}

impl Outline {
    /// Whether a point is inside; `None` for targets without extent.
    #[must_use]
    pub fn holds(&self, at: ImagePoint) -> Option<bool> {
        Some(match &self.shape {
            Shape::Mask(mask) => mask.holds(at),
            Shape::Boxes(boxes) => boxes.iter().any(|b| (b.left..=b.right).contains(&at.u) && (b.top..=b.bottom).contains(&at.v)),
            Shape::Polygons(polygons) => polygons.iter().any(|polygon| inside(polygon, at)),
            Shape::Points(points, radius) => {
                let radius = (*radius)? * self.size.0;
                points.iter().any(|point| self.pixels_between(*point, at) <= radius)
            }
            Shape::MaskFile(_) => return None,
        })
    }

    /// Distance in pixels from the target's point, the nearest of several.
    #[must_use]
    pub fn error_px(&self, at: ImagePoint) -> f64 {
        self.middles.iter().map(|middle| self.pixels_between(*middle, at)).fold(f64::INFINITY, f64::min)
    }

    /// Side of a square with the area of the target, pixels; `None` for points.
    #[must_use]
    pub fn side_px(&self) -> Option<f64> {
        self.area.filter(|area| *area > 0.0).map(f64::sqrt)
    }

    /// Width of the image, pixels.
    #[must_use]
    pub fn width_px(&self) -> f64 {
        self.size.0
    }

    /// The mask, if it is one.
    #[must_use]
    pub fn mask(&self) -> Option<&Mask> {
        if let Shape::Mask(mask) = &self.shape { Some(mask) } else { None }
    }

    /// The point from which errors are measured; of several parts that of the largest.
    #[must_use]
    pub fn middle(&self) -> ImagePoint {
        self.middles.first().copied().unwrap_or_default()
    }

    /// Its bounding box.
    #[must_use]
    pub fn bounds(&self) -> ImageBox {
        match &self.shape {
            Shape::Boxes(boxes) => {
                let corners = |b: &ImageBox| [ImagePoint { u: b.left, v: b.top }, ImagePoint { u: b.right, v: b.bottom }];
                around(&boxes.iter().flat_map(corners).collect::<Vec<_>>())
            }
            Shape::Polygons(polygons) => around(&polygons.concat()),
            Shape::Points(points, _) => around(points),
            Shape::Mask(mask) => {
                let (w, h) = (mask.width.max(1) as usize, f64::from(mask.height.max(1)));
                let at = |i: usize| ((i % w) as f64, (i / w) as f64);
                let corners = (0..mask.inside.len()).filter(|i| mask.inside[*i]).flat_map(|i| {
                    let (x, y) = at(i);
                    [(x, y), (x + 1.0, y + 1.0)].map(|(x, y)| ImagePoint { u: x / w as f64, v: y / h })
                });
                around(&corners.collect::<Vec<_>>())
            }
            Shape::MaskFile(_) => ImageBox::default(),
        }
    }

    fn pixels_between(&self, a: ImagePoint, b: ImagePoint) -> f64 {
        libm::hypot((a.u - b.u) * self.size.0, (a.v - b.v) * self.size.1)
    }
}

fn centre(b: &ImageBox) -> ImagePoint {
    ImagePoint { u: 0.5 * (b.left + b.right), v: 0.5 * (b.top + b.bottom) }
}

fn around(points: &[ImagePoint]) -> ImageBox {
    let fold = |value: fn(&ImagePoint) -> f64, pick: fn(f64, f64) -> f64| points.iter().map(value).reduce(pick).unwrap_or(0.0);
    ImageBox {
        left: fold(|p| p.u, f64::min),
        top: fold(|p| p.v, f64::min),
        right: fold(|p| p.u, f64::max),
        bottom: fold(|p| p.v, f64::max),
    }
}

/// Centres of several parts, largest first, and the largest area.
fn largest_first(parts: impl Iterator<Item = (ImagePoint, f64)>) -> (Vec<ImagePoint>, Option<f64>) {
    let mut parts: Vec<(ImagePoint, f64)> = parts.collect();
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    let area = parts.first().map_or(0.0, |(_, area)| *area);
    (parts.into_iter().map(|(middle, _)| middle).collect(), Some(area))
}

/// Grid cells per side for finding the deepest point of a polygon.
const CELLS: u32 = 96;

/// The deepest point inside a polygon, to a grid cell; the centre of its box if no cell centre is inside.
fn deep_inside(polygon: &[ImagePoint]) -> ImagePoint {
    let b = around(polygon);
    let of = |fraction: f64, low: f64, high: f64| low + fraction * (high - low);
    let place = |at: ImagePoint| ImagePoint { u: of(at.u, b.left, b.right), v: of(at.v, b.top, b.bottom) };
    let cell = |i: u32| ImagePoint {
        u: (f64::from(i % CELLS) + 0.5) / f64::from(CELLS),
        v: (f64::from(i / CELLS) + 0.5) / f64::from(CELLS),
    };
    let mask =
        Mask { width: CELLS, height: CELLS, inside: (0..CELLS * CELLS).map(|i| inside(polygon, place(cell(i)))).collect() };
    place(mask.deepest())
}

/// By the even-odd rule.
fn inside(polygon: &[ImagePoint], at: ImagePoint) -> bool {
    let mut inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        if (a.v > at.v) != (b.v > at.v) && at.u < a.u + (at.v - a.v) / (b.v - a.v) * (b.u - a.u) {
            inside = !inside;
        }
    }
    inside
}

/// Area of a polygon, by the shoelace formula.
fn enclosed(polygon: &[ImagePoint]) -> f64 {
    let next = |i: usize| &polygon[(i + 1) % polygon.len()];
    (polygon.iter().enumerate().map(|(i, a)| a.u * next(i).v - next(i).u * a.v).sum::<f64>() / 2.0).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(u: f64, v: f64) -> ImagePoint {
        ImagePoint { u, v }
    }

    fn target(shape: Shape) -> Outline {
        Target { shape, point: None, distance_m: None, boxes: Vec::new() }.outline((100, 50)).unwrap()
    }

    #[test]
    fn masks_by_pixel() {
        // Four by two pixels; the right half of the lower row.
        let inside = vec![false, false, false, false, false, false, true, true];
        let outline = target(Shape::Mask(Mask { width: 4, height: 2, inside }));
        assert_eq!(outline.holds(at(0.51, 0.51)), Some(true));
        assert_eq!(outline.holds(at(1.0, 1.0)), Some(true));
        assert_eq!(outline.holds(at(0.49, 0.9)), Some(false));
        assert_eq!(outline.holds(at(0.9, 0.49)), Some(false));
        // A quarter of 100 × 50 pixels.
        assert!((outline.side_px().unwrap() - 1250.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!(outline.bounds(), ImageBox { left: 0.5, top: 0.5, right: 1.0, bottom: 1.0 });
    }

    #[test]
    fn polygons_and_boxes() {
        let triangle = target(Shape::Polygons(vec![vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)]]));
        assert_eq!((triangle.holds(at(0.2, 0.2)), triangle.holds(at(0.7, 0.7))), (Some(true), Some(false)));
        assert!((triangle.side_px().unwrap() - 2500.0_f64.sqrt()).abs() < 1e-9);
        let boxed = target(Shape::Boxes(vec![ImageBox { left: 0.2, top: 0.2, right: 0.4, bottom: 0.6 }]));
        assert_eq!((boxed.holds(at(0.3, 0.3)), boxed.holds(at(0.5, 0.3))), (Some(true), Some(false)));
        // From the middle (0.3, 0.4): 10 px across and 10 px down.
        assert!((boxed.error_px(at(0.4, 0.6)) - 200.0_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn of_several_the_nearest_counts_and_no_error_is_measured_from_between_them() {
        let square = |u: f64, side: f64| vec![at(u, 0.2), at(u + side, 0.2), at(u + side, 0.2 + side), at(u, 0.2 + side)];
        let cars = target(Shape::Polygons(vec![square(0.0, 0.1), square(0.8, 0.2)]));
        assert!(cars.error_px(at(0.05, 0.25)) < 1.0 && cars.error_px(at(0.9, 0.3)) < 1.5);
        assert!(cars.error_px(at(0.5, 0.25)) > 35.0);
        // The side is that of the larger.
        assert!((cars.side_px().unwrap() - (20.0_f64 * 10.0).sqrt()).abs() < 1e-9);
        assert!(cars.middle().u > 0.8);
        let boxes = [0.0, 0.8].map(|left| ImageBox { left, top: 0.0, right: left + 0.2, bottom: 1.0 });
        assert!(target(Shape::Boxes(boxes.to_vec())).error_px(at(0.1, 0.5)) < 1e-9);
        // A C-shaped outline: its centre is outside.
        let c = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.2), (0.2, 0.2), (0.2, 0.8), (1.0, 0.8), (1.0, 1.0), (0.0, 1.0)];
        let c = target(Shape::Polygons(vec![c.map(|(u, v)| at(u, v)).to_vec()]));
        assert_eq!(c.holds(c.middle()), Some(true));
    }

    #[test]
    fn points_alone_give_no_hits() {
        let points = target(Shape::Points(vec![at(0.1, 0.1), at(0.9, 0.9)], None));
        assert_eq!((points.holds(at(0.1, 0.1)), points.side_px()), (None, None));
        assert!((points.error_px(at(0.9, 0.8)) - 5.0).abs() < 1e-9);
        let with_radius = target(Shape::Points(vec![at(0.1, 0.1)], Some(0.05)));
        assert_eq!((with_radius.holds(at(0.14, 0.1)), with_radius.holds(at(0.16, 0.1))), (Some(true), Some(false)));
    }
}
