//! Per-triangle values of a view, computed once and shared by its pixels.

use fearless_simd::prelude::*;

use super::lanes::{F, LANES, Simd, V3, each};
use super::shadow::Receiver;

/// A triangle in a view (`T` is a number), or the triangles of eight pixels (`T` is a vector).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet<T> {
    /// Unit normal, towards the eye.
    pub(crate) flat: V3<T>,
    pub(crate) u_axis: V3<T>,
    pub(crate) v_axis: V3<T>,
    /// Texture coordinates of the eye itself.
    pub(crate) eye_u: T,
    pub(crate) eye_v: T,
    /// Change of u and v per pixel right and per pixel down at 1 m of depth, as for a surface perpendicular to the
    /// axis.
    pub(crate) right_u: T,
    pub(crate) right_v: T,
    pub(crate) down_u: T,
    pub(crate) down_v: T,
    /// Additional change due to the slant, per metre of distance of (u, v) from the eye's.
    pub(crate) slant_right: T,
    pub(crate) slant_down: T,
    /// Cosine of the angle between the plane's normal and the sun.
    pub(crate) faces_sun: T,
    pub(crate) receiver: Receiver<T>,
    /// Unoccluded fraction of the sun's light, and light of sky and ground, on the flat plane.
    pub(crate) direct: T,
    pub(crate) ambient: V3<T>,
}

/// Normals of the curved surface that the triangle approximates: `rows · p + offset`, not normalised, on the eye's
/// side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve<T> {
    pub(crate) rows: [V3<T>; 3],
    pub(crate) offset: V3<T>,
}

/// Reads one number of a `T`.
type Read<T> = fn(&T) -> f32;

impl Facet<f32> {
    /// The facets of eight pixels.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(simd: S, of: [&Self; LANES]) -> Facet<F<S>> {
        let same = of[1..].iter().all(|&f| core::ptr::eq(f, of[0]));
        if same {
            Self::gather(
                #[inline(always)]
                |read| F::splat(simd, read(of[0])),
            )
        } else {
            Self::gather(
                #[inline(always)]
                |read| {
                    let numbers = each(
                        #[inline(always)]
                        |lane| read(of[lane]),
                    );
                    F::from_slice(simd, &numbers)
                },
            )
        }
    }

    #[inline(always)]
    fn gather<T>(number: impl Fn(Read<Self>) -> T) -> Facet<T> {
        let v3 = |x: Read<Self>, y: Read<Self>, z: Read<Self>| V3 { x: number(x), y: number(y), z: number(z) };
        Facet {
            flat: v3(|f| f.flat.x, |f| f.flat.y, |f| f.flat.z),
            u_axis: v3(|f| f.u_axis.x, |f| f.u_axis.y, |f| f.u_axis.z),
            v_axis: v3(|f| f.v_axis.x, |f| f.v_axis.y, |f| f.v_axis.z),
            eye_u: number(|f| f.eye_u),
            eye_v: number(|f| f.eye_v),
            right_u: number(|f| f.right_u),
            right_v: number(|f| f.right_v),
            down_u: number(|f| f.down_u),
            down_v: number(|f| f.down_v),
            slant_right: number(|f| f.slant_right),
            slant_down: number(|f| f.slant_down),
            faces_sun: number(|f| f.faces_sun),
            receiver: Receiver {
                normal: v3(|f| f.receiver.normal.x, |f| f.receiver.normal.y, |f| f.receiver.normal.z),
                shift: v3(|f| f.receiver.shift.x, |f| f.receiver.shift.y, |f| f.receiver.shift.z),
                margin: number(|f| f.receiver.margin),
            },
            direct: number(|f| f.direct),
            ambient: v3(|f| f.ambient.x, |f| f.ambient.y, |f| f.ambient.z),
        }
    }
}

impl Curve<f32> {
    /// The curves of eight pixels.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(simd: S, of: [&Self; LANES]) -> Curve<F<S>> {
        Self::gather(
            #[inline(always)]
            |read| {
                let numbers = each(
                    #[inline(always)]
                    |lane| read(of[lane]),
                );
                F::from_slice(simd, &numbers)
            },
        )
    }

    #[inline(always)]
    fn gather<T>(number: impl Fn(Read<Self>) -> T) -> Curve<T> {
        let v3 = |x: Read<Self>, y: Read<Self>, z: Read<Self>| V3 { x: number(x), y: number(y), z: number(z) };
        Curve {
            rows: [
                v3(|c| c.rows[0].x, |c| c.rows[0].y, |c| c.rows[0].z),
                v3(|c| c.rows[1].x, |c| c.rows[1].y, |c| c.rows[1].z),
                v3(|c| c.rows[2].x, |c| c.rows[2].y, |c| c.rows[2].z),
            ],
            offset: v3(|c| c.offset.x, |c| c.offset.y, |c| c.offset.z),
        }
    }
}
