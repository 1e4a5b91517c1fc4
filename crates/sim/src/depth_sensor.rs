//! The simulated depth sensor: true depths with the errors of a small stereo camera (`docs/reference/dynamics.md`).
//!
//! 160×120 over 90° by 73.7°, 0.3 to 10 m, 15 grids a second that arrive 60 ms after their capture. The error is 0.4 % of the
//! square of the depth, at least 1 cm; 4 % of the pixels are holes; where depth jumps between neighbours, values lie anywhere
//! between them. The sky and what is out of range give no value. Clear glass is not seen: the depth is that of what is behind it.

use core::fmt;
use core::str::FromStr;

use spf_core::camera::Camera;
use spf_core::depth::stereo::Stereo;
use spf_core::depth::{DepthGrid, DepthSource};
use spf_core::time::{Duration, Time};

/// Columns and rows.
const SIZE: (u32, u32) = (160, 120);
/// Grids a second.
const RATE: u64 = 15;
/// From capture to arrival.
const LATENCY: Duration = Duration::from_millis(60);
/// Error of the faulty scale.
const OFF_SCALE: f64 = 1.1;
/// When a fault begins: in flight.
const FAULT_AT: Time = Time::from_millis(10_000);

/// A depth sensor, possibly with a fault from 10 s on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DepthSensor {
    /// The fault.
    pub fault: Option<DepthFault>,
}

impl fmt::Display for DepthSensor {
    /// `on`, or the name of the fault.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.fault {
            None => f.write_str("on"),
            Some(fault) => fault.fmt(f),
        }
    }
}

/// A fault of the depth sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthFault {
    /// The same values again and again, stamped new.
    Frozen,
    /// The left half has no values.
    HalfBlack,
    /// Depths are 10 % too large.
    Scale,
}

/// Names of the faults.
const FAULTS: [(DepthFault, &str); 3] =
    [(DepthFault::Frozen, "frozen"), (DepthFault::HalfBlack, "half"), (DepthFault::Scale, "scale")];

impl fmt::Display for DepthFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(FAULTS.iter().find(|(fault, _)| fault == self).map_or("", |(_, name)| name))
    }
}

/// An unknown fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown depth sensor fault `{0}`: use frozen, half or scale")]
pub struct UnknownFault(pub String);

impl FromStr for DepthFault {
    type Err = UnknownFault;

    fn from_str(name: &str) -> Result<Self, UnknownFault> {
        FAULTS.iter().find(|(_, known)| *known == name).map(|(fault, _)| *fault).ok_or_else(|| UnknownFault(name.to_owned()))
    }
}

impl DepthSensor {
    /// Its camera, level with the body.
    #[must_use]
    pub fn camera() -> Camera {
        Camera::from_fov(SIZE.0, SIZE.1, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0)
    }
}

/// The grids of one flight.
#[derive(Clone, Debug)]
pub struct DepthStream {
    sensor: DepthSensor,
    camera: Camera,
    seed: u64,
    number: u64,
    last: Vec<u16>,
}

impl DepthStream {
    /// The stream from the start of a flight.
    #[must_use]
    pub fn new(sensor: DepthSensor, seed: u64) -> Self {
        Self { sensor, camera: DepthSensor::camera(), seed, number: 0, last: Vec::new() }
    }

    /// Its camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Capture time of the next grid.
    #[must_use]
    pub fn captured(&self) -> Time {
        Time::from_nanos(self.number * 1_000_000_000 / RATE)
    }

    /// Arrival of the next grid.
    #[must_use]
    pub fn due(&self) -> Time {
        self.captured() + LATENCY
    }

    /// The next grid, from true depths along the optical axis, metres, 0 for none; with none at all, a grid without values.
    pub fn take(&mut self, depths: &[f32]) -> Option<DepthGrid> {
        let (captured, number) = (self.captured(), self.number);
        self.number += 1;
        let fault = self.sensor.fault.filter(|_| captured >= FAULT_AT);
        if fault != Some(DepthFault::Frozen) || self.last.is_empty() {
            self.last = stereo(fault).measure(depths, self.seed, number);
        }
        let (camera, cm, source) = (self.camera, self.last.clone(), DepthSource::Sensor);
        Some(DepthGrid { captured, counter: number, camera, cm, source })
    }
}

/// The stereo camera with this fault.
fn stereo(fault: Option<DepthFault>) -> Stereo {
    let scale = if fault == Some(DepthFault::Scale) { OFF_SCALE } else { 1.0 };
    let blind = if fault == Some(DepthFault::HalfBlack) { SIZE.0 / 2 } else { 0 };
    Stereo { scale, blind, ..Stereo::new(SIZE) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXELS: usize = 160 * 120;

    /// A stream at its `number`-th grid.
    fn at(number: u64, fault: Option<DepthFault>) -> DepthStream {
        DepthStream { number, ..DepthStream::new(DepthSensor { fault }, 3) }
    }

    fn grid(number: u64, fault: Option<DepthFault>, depth: f32) -> DepthGrid {
        at(number, fault).take(&vec![depth; PIXELS]).unwrap()
    }

    /// Mean and standard deviation of the values, metres.
    fn spread(grid: &DepthGrid) -> (f64, f64) {
        let values: Vec<f64> = grid.cm.iter().filter(|&&cm| cm > 0).map(|&cm| 0.01 * f64::from(cm)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / values.len() as f64;
        (mean, libm::sqrt(variance))
    }

    /// By hand: 1 cm at 1 m, 0.004·25 = 10 cm at 5 m; 4 % holes of 19,200 are 768 ± 27.
    #[test]
    fn noise_and_holes_are_those_stated() {
        for (depth, sigma) in [(1.0, 0.01), (5.0, 0.1), (9.0, 0.324)] {
            let grid = grid(0, None, depth);
            assert_eq!(grid.check(), Ok(()));
            let (mean, deviation) = spread(&grid);
            // Near the end of the range the largest values are cut off.
            let cut = if depth > 8.0 { 0.01 } else { 0.0 };
            assert!((mean - f64::from(depth)).abs() < 0.003 + cut && (deviation / sigma - 1.0).abs() < 0.1, "{mean} {deviation}");
            assert!((grid.valid_fraction() - 0.96).abs() < 0.01, "{}", grid.valid_fraction());
        }
    }

    #[test]
    fn nothing_is_measured_of_the_sky_or_out_of_range() {
        for depth in [0.0, 0.2, 15.0, 40.0, 100.0] {
            assert_eq!(grid(0, None, depth).valid_fraction(), 0.0, "{depth}");
        }
        assert_eq!(at(0, None).take(&[]).unwrap().valid_fraction(), 0.0);
    }

    #[test]
    fn an_edge_is_smeared_between_its_sides_and_nothing_else_is() {
        let depths: Vec<f32> = (0..PIXELS).map(|i| if i % 160 < 80 { 2.0 } else { 6.0 }).collect();
        let grid = at(0, None).take(&depths).unwrap();
        let column = |x: usize| -> Vec<u16> { (0..120).map(|y| grid.cm[160 * y + x]).filter(|&cm| cm > 0).collect() };
        let between = |x| column(x).iter().filter(|&&cm| (240..540).contains(&cm)).count();
        assert!(between(79) > 20 && between(80) > 20, "{} {}", between(79), between(80));
        assert!(between(70) == 0 && between(90) == 0);
    }

    #[test]
    fn faults_begin_at_10_s_and_are_what_they_are_called() {
        let before = grid(100, Some(DepthFault::Scale), 5.0);
        assert!((spread(&before).0 - 5.0).abs() < 0.01);
        assert!((spread(&grid(160, Some(DepthFault::Scale), 5.0)).0 - 5.5).abs() < 0.01);
        let half = grid(160, Some(DepthFault::HalfBlack), 5.0);
        assert!(half.cm.iter().enumerate().all(|(i, &cm)| i % 160 >= 80 || cm == 0));
        assert!((half.valid_fraction() - 0.48).abs() < 0.01);
        // Without the fault the other half is the same.
        let whole = grid(160, None, 5.0);
        assert!(half.cm.iter().zip(&whole.cm).enumerate().all(|(i, (half, whole))| i % 160 < 80 || half == whole));
        let mut frozen = at(149, Some(DepthFault::Frozen));
        let last = frozen.take(&vec![5.0; PIXELS]).unwrap();
        for number in 150..153 {
            let grid = frozen.take(&vec![1.0; PIXELS]).unwrap();
            assert!(grid.cm == last.cm && grid.counter == number && grid.captured >= FAULT_AT);
        }
    }

    #[test]
    fn grids_come_every_fifteenth_of_a_second_and_60_ms_late() {
        let stream = at(3, None);
        assert_eq!((stream.captured(), stream.due()), (Time::from_millis(200), Time::from_millis(260)));
        assert_eq!(grid(7, None, 5.0), grid(7, None, 5.0));
        assert_ne!(grid(7, None, 5.0).cm, grid(8, None, 5.0).cm);
    }

    #[test]
    fn faults_have_names() {
        for (fault, name) in FAULTS {
            assert_eq!((name.parse(), fault.to_string()), (Ok(fault), name.to_owned()));
        }
        assert!("broken".parse::<DepthFault>().is_err());
    }
}
