//! Groups the pixels of a tile by material, so that eight at a time are shaded alike.

use super::develop::film;
use super::edge::COUNT;
use super::lanes::{F, LANES, Simd, V3};
use super::raster::{NONE, TILE_AREA};
use super::shade::{Place, Shader, Shape};

/// Up to eight pixels with one paint.
#[derive(Clone, Copy, Debug)]
struct Packet {
    place: Place,
    /// Index into the shapes; unused for the sky.
    shape: [u32; LANES],
    pixel: [u16; LANES],
    /// Number of samples of the pixel with this surface: all of them, or some for an edge pixel.
    samples: [u8; LANES],
    len: u8,
    sky: bool,
}

/// The pixels of a tile that are to be shaded.
#[derive(Debug, Default)]
pub(crate) struct Packets {
    packets: Vec<Packet>,
    /// For the sky and each paint the packet being filled, counted from one; 0 for none.
    open: Vec<u32>,
    shapes: Vec<Shape>,
    /// Triangle and index of shapes, hashed by the last bits of the triangle's id.
    slots: Vec<(u32, u32)>,
    /// Pixels in which several surfaces meet, and for each pixel of the tile the sum of its samples' display light.
    blended: Vec<u16>,
    sums: Vec<[f32; 3]>,
}

/// Slots for finding shapes again, a power of two.
const SLOTS: usize = 512;

impl Packets {
    pub(crate) fn clear(&mut self, paints: usize) {
        self.packets.clear();
        self.blended.clear();
        self.shapes.clear();
        self.open.clear();
        self.open.resize(paints + 1, 0);
        self.slots.clear();
        self.slots.resize(SLOTS, (NONE, 0));
    }

    fn shape(&mut self, shader: &Shader<'_>, id: u32) -> u32 {
        if id == NONE {
            return 0;
        }
        let slot = &mut self.slots[id as usize & (SLOTS - 1)];
        if slot.0 != id {
            *slot = (id, self.shapes.len() as u32);
            self.shapes.push(shader.shape(id));
        }
        slot.1
    }

    /// Adds eight adjacent pixels that show one triangle or the sky: the first at index `pixel` of the tile and (`x`,
    /// `y`).
    pub(crate) fn push_row(&mut self, shader: &Shader<'_>, id: u32, (x, y): (f32, f32), near: [f32; LANES], pixel: u16) {
        let shape = self.shape(shader, id);
        let lane = |i: usize| i as f32;
        self.packets.push(Packet {
            place: Place { x: core::array::from_fn(|i| x + lane(i)), y: [y; LANES], near },
            shape: [shape; LANES],
            pixel: core::array::from_fn(|i| pixel + i as u16),
            samples: [COUNT as u8; LANES],
            len: LANES as u8,
            sky: id == NONE,
        });
    }

    /// Adds one pixel, or `samples` samples of it.
    pub(crate) fn push(&mut self, shader: &Shader<'_>, id: u32, (x, y): (f32, f32), near: f32, pixel: u16, samples: u8) {
        let shape = self.shape(shader, id);
        let open = if id == NONE { 0 } else { self.shapes[shape as usize].paint as usize + 1 };
        if self.open[open] == 0 {
            // Unused lanes repeat the first pixel, without its samples.
            self.packets.push(Packet {
                place: Place { x: [x; LANES], y: [y; LANES], near: [near; LANES] },
                shape: [shape; LANES],
                pixel: [pixel; LANES],
                samples: [0; LANES],
                len: 0,
                sky: id == NONE,
            });
            self.open[open] = self.packets.len() as u32;
        }
        let packet = &mut self.packets[self.open[open] as usize - 1];
        let lane = usize::from(packet.len);
        (packet.place.x[lane], packet.place.y[lane], packet.place.near[lane]) = (x, y, near);
        (packet.shape[lane], packet.pixel[lane], packet.samples[lane]) = (shape, pixel, samples);
        packet.len += 1;
        if usize::from(packet.len) == LANES {
            self.open[open] = 0;
        }
    }

    /// Marks `pixel` as composed of several parts.
    pub(crate) fn blend(&mut self, pixel: u16) {
        self.blended.push(pixel);
        self.sums.resize(TILE_AREA, [0.0; 3]);
        self.sums[usize::from(pixel)] = [0.0; 3];
    }

    /// Adds samples of a pixel that look like another pixel, which is already shaded.
    #[inline]
    pub(crate) fn add_like(&mut self, shader: &Shader<'_>, pixel: u16, colour: [u8; 3], samples: u8) {
        let sum = &mut self.sums[usize::from(pixel)];
        for (sum, byte) in sum.iter_mut().zip(colour) {
            *sum += shader.palette.srgb.linear(byte) * f32::from(samples);
        }
    }

    /// Shades the pending pixels, into three bytes per pixel or, for composed pixels, into their sums.
    #[inline(always)]
    pub(crate) fn shade<S: Simd>(&mut self, simd: S, shader: &Shader<'_>, rgb: &mut [u8]) {
        for packet in &self.packets {
            let light = if packet.sky {
                shader.sky(simd, &packet.place)
            } else {
                let shapes = packet.shape.map(|i| &self.shapes[i as usize]);
                shader.exposed(simd, shapes, &packet.place)
            };
            let whole = packet.samples == [COUNT as u8; LANES];
            if whole || packet.samples.contains(&(COUNT as u8)) {
                let bytes = shader.palette.developed.bytes(light);
                for (lane, bytes) in bytes.into_iter().enumerate() {
                    if usize::from(packet.samples[lane]) == COUNT {
                        let at = usize::from(packet.pixel[lane]) * 3;
                        rgb[at..at + 3].copy_from_slice(&bytes);
                    }
                }
            }
            if !whole {
                // The function itself, unlike a closure that calls it, is not inlined, and has no wide instructions then.
                let shown = light.map(
                    #[inline(always)]
                    |light| film(light),
                );
                add(&mut self.sums, packet, shown);
            }
        }
        self.packets.clear();
        self.open.fill(0);
    }

    /// Writes the composed pixels.
    pub(crate) fn put_blended(&self, shader: &Shader<'_>, rgb: &mut [u8]) {
        for &pixel in &self.blended {
            let pixel = usize::from(pixel);
            let bytes = self.sums[pixel].map(|sum| shader.palette.srgb.byte(sum / COUNT as f32));
            rgb[pixel * 3..pixel * 3 + 3].copy_from_slice(&bytes);
        }
    }
}

/// Adds the display light of samples to their pixels.
#[inline(always)]
fn add<S: Simd>(sums: &mut [[f32; 3]], packet: &Packet, light: V3<F<S>>) {
    for lane in 0..LANES {
        let samples = packet.samples[lane];
        if samples != 0 && usize::from(samples) < COUNT {
            let (sum, samples) = (&mut sums[usize::from(packet.pixel[lane])], f32::from(samples));
            *sum = [sum[0] + light.x[lane] * samples, sum[1] + light.y[lane] * samples, sum[2] + light.z[lane] * samples];
        }
    }
}
