//! Arguments of a call, checked as they are read.

use core::time::Duration;

use serde::Deserialize;
use spf_core::geometry::EnuPosition;
use spf_core::time::Time;
use spf_drone::airsim::wire::structs::Vector3r;
use spf_drone::airsim::wire::{Encoding, Raw};

use crate::airsim::frames::Ned;

/// Farthest that a point may be from the origin, metres.
const FARTHEST: f64 = 1e6;
/// Longest time that is told from none, s: about three years.
const LONGEST: f64 = 1e8;

/// Arguments, in order.
#[derive(Clone, Copy)]
pub(super) struct Arguments<'a>(pub(super) &'a [Raw]);

impl Arguments<'_> {
    /// An argument of any type.
    pub(super) fn read<'a, T: Deserialize<'a>>(&'a self, place: usize) -> Result<T, String> {
        let raw = self.0.get(place).ok_or_else(|| format!("argument {} is missing", place + 1))?;
        raw.read().map_err(|error| format!("argument {}: {error}", place + 1))
    }

    /// A text.
    pub(super) fn text(&self, place: usize) -> Result<String, String> {
        self.read(place)
    }

    /// A finite number.
    pub(super) fn number(&self, place: usize) -> Result<f64, String> {
        let number: f64 = self.read(place)?;
        number.is_finite().then_some(number).ok_or_else(|| format!("argument {}: {number} is no finite number", place + 1))
    }

    /// A vector of finite numbers, each at most 1,000 km.
    pub(super) fn vector(&self, place: usize) -> Result<Vector3r, String> {
        check(self.read(place)?).map_err(|why| format!("argument {}: {why}", place + 1))
    }

    /// A point given by three arguments from this one on.
    pub(super) fn point(&self, place: usize) -> Result<Vector3r, String> {
        check(Vector3r::new(self.number(place)?, self.number(place + 1)?, self.number(place + 2)?))
    }

    /// Seconds from now; `None` if they are as good as none.
    pub(super) fn later(&self, place: usize, now: Time) -> Result<Option<Time>, String> {
        let seconds = self.number(place)?;
        Ok((seconds < LONGEST).then(|| now + Duration::from_secs_f64(seconds.max(0.0))))
    }

    /// Seconds from now, at most three years.
    pub(super) fn until(&self, place: usize, now: Time) -> Result<Time, String> {
        Ok(now + Duration::from_secs_f64(self.number(place)?.clamp(0.0, LONGEST)))
    }
}

/// Refuses vectors that are not finite, or beyond all places.
pub(super) fn check(v: Vector3r) -> Result<Vector3r, String> {
    let fine = [v.x_val, v.y_val, v.z_val].iter().all(|part| part.abs() <= FARTHEST);
    fine.then_some(v).ok_or_else(|| format!("({}, {}, {}) is no place within 1000 km", v.x_val, v.y_val, v.z_val))
}

/// A point whose components keep `old` where they are NaN.
pub(super) fn kept(frame: Ned, new: Vector3r, old: EnuPosition) -> Result<EnuPosition, String> {
    let old = frame.of(old);
    let part = |new: f64, old: f64| if new.is_nan() { old } else { new };
    let point = Vector3r::new(part(new.x_val, old.x_val), part(new.y_val, old.y_val), part(new.z_val, old.z_val));
    Ok(frame.position(check(point)?))
}

/// Bytes as they are sent.
pub(super) fn bytes(bytes: &[u8]) -> Raw {
    #[derive(serde::Serialize)]
    #[serde(transparent)]
    struct Bytes<'a>(#[serde(with = "serde_bytes")] &'a [u8]);
    Raw::of(&Bytes(bytes), Encoding::Map)
}
