//! Effects of a real camera: lens distortion, motion blur, exposure, sensor noise, link compression. All are off by
//! default (docs/reference/camera-effects.md).
//!
//! They are applied in physical order: light is accumulated while the shutter is open, distorted by the lens, exposed,
//! disturbed by the sensor, and compressed. The lens also affects ids and depth; the other effects only apply to
//! colour. An image depends only on the poses while its shutter was open, its capture time and the flight's seed.

mod blur;
mod compression;
mod lens;
mod light;
mod noise;
mod settings;

use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use spf_core::camera::Camera;
use spf_core::time::Time;
use spf_media::frame::Rgb;

use crate::RenderedImage;
pub use blur::{Posed, Shot};
pub use compression::Compression;
pub use lens::Lens;
use lens::Remap;
use light::Curve;
pub use settings::{Effects, EffectsError, Exposure};

/// Number of cached lens maps: the camera's size, the video's, and that of the VLM's images.
const SIZES: usize = 4;

/// A simulated camera: intrinsics, lens and image effects. Share it by reference.
#[derive(Debug)]
pub struct SimCamera {
    camera: Camera,
    effects: Effects,
    seed: u64,
    remaps: Mutex<Vec<Arc<Remap>>>,
    /// Buffers for pinhole images, reused.
    scratch: Mutex<Vec<RenderedImage>>,
}

impl SimCamera {
    /// A camera with the intrinsics of `camera` and these effects; noise depends on `seed`.
    #[must_use]
    pub fn new(camera: Camera, effects: Effects, seed: u64) -> Self {
        let camera = effects.lens.as_ref().map_or(camera, |lens| lens.on(&camera));
        Self { camera, effects, seed, remaps: Mutex::default(), scratch: Mutex::default() }
    }

    /// The camera including its lens, as calibration would measure it; used for lifting points of its images.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Its effects.
    #[must_use]
    pub fn effects(&self) -> &Effects {
        &self.effects
    }

    /// Renders the channels with lens distortion, at the size and with the distortion of `camera`. `draw` renders the image of
    /// the undistorted pinhole camera passed to it.
    pub fn look(&self, camera: &Camera, image: &mut RenderedImage, draw: impl FnOnce(&Camera, &mut RenderedImage)) {
        if camera.distortion.is_none() {
            draw(camera, image);
            return;
        }
        let remap = self.remap(camera);
        let mut straight = self.take_scratch();
        draw(&remap.pinhole, &mut straight);
        remap.bend(&straight, image);
        self.keep_scratch(straight);
    }

    /// The exposure of an image captured at `at`: the states while the shutter is open, as many as the motion requires.
    /// `snapshot_at` gives the state at a time. `None` if it lacks one of them, because it is in the future or too old.
    pub fn shot<M: Posed>(&self, at: Time, snapshot_at: impl Fn(Time) -> Option<M>) -> Option<Shot<M>> {
        blur::shot(&self.camera, self.effects.shutter, at, snapshot_at)
    }

    /// A colour image with all effects, at `size` or at the camera's own. `draw` renders the colour image of an undistorted
    /// camera at one instant.
    pub fn photograph<M>(
        &self,
        shot: &Shot<M>,
        size: Option<(u32, u32)>,
        mut draw: impl FnMut(&Camera, &M, &mut RenderedImage),
    ) -> Rgb {
        let camera = size.map_or(self.camera, |(width, height)| self.camera.resized(width, height));
        let mut image = RenderedImage::default();
        if let [moment] = shot.moments() {
            self.look(&camera, &mut image, |pinhole, image| draw(pinhole, moment, image));
        } else {
            self.look(&camera, &mut image, |pinhole, image| {
                blur::add_up(shot.moments(), image, |moment, image| draw(pinhole, moment, image));
            });
        }
        let (width, height) = (image.width, image.height);
        let mut rgb = image.rgb.unwrap_or_default();
        self.develop(&mut rgb, shot.at());
        let photograph = Rgb::from_raw(width, height, rgb).unwrap_or_else(|_| Rgb::new(width, height));
        match self.effects.compression {
            Some(compression) => compression.round_trip(photograph),
            None => photograph,
        }
    }

    /// Exposure and noise.
    fn develop(&self, rgb: &mut [u8], at: Time) {
        let Effects { exposure, noise, .. } = self.effects;
        if exposure.is_none() && noise.is_none() {
            return;
        }
        let curve = Curve::get();
        let mut light = curve.lit(rgb);
        let stops = match exposure {
            None => 0.0,
            Some(Exposure::Stops(stops)) => stops,
            Some(Exposure::Automatic) => curve.automatic_stops(&light),
        };
        let gain = libm::exp2(stops) as f32;
        if gain != 1.0 {
            light.par_iter_mut().for_each(|light| *light *= gain);
        }
        if let Some(noise) = noise {
            noise::add(&mut light, gain, noise, self.seed, at.as_nanos());
        }
        rgb.par_iter_mut().zip(&light).for_each(|(byte, light)| *byte = curve.byte(*light));
    }

    fn remap(&self, camera: &Camera) -> Arc<Remap> {
        let known = |remaps: &Vec<Arc<Remap>>| remaps.iter().find(|remap| remap.camera == *camera).cloned();
        if let Some(remap) = known(&self.remaps.lock().unwrap_or_else(PoisonError::into_inner)) {
            return remap;
        }
        // Computed outside the lock: two threads may both do so, with the same result.
        let made = Arc::new(Remap::new(camera));
        let mut remaps = self.remaps.lock().unwrap_or_else(PoisonError::into_inner);
        if remaps.len() >= SIZES {
            remaps.remove(0);
        }
        remaps.push(made.clone());
        made
    }

    fn take_scratch(&self) -> RenderedImage {
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn keep_scratch(&self, image: RenderedImage) {
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(image);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::{Attitude, EnuPosition, Pose};

    /// A white stripe whose position depends on the heading.
    fn stripe(camera: &Camera, pose: &Pose, image: &mut RenderedImage) {
        let (w, h) = (camera.width as usize, camera.height as usize);
        (image.width, image.height) = (camera.width, camera.height);
        let column = camera.cx - camera.fx * libm::tan(pose.attitude.heading);
        let lit = |i: usize| u8::from((((i % w) as f64) + 0.5 - column).abs() < 4.0) * 255;
        image.rgb = Some((0..w * h).flat_map(|i| [lit(i); 3]).collect());
        image.ids = Some((0..w * h).map(|i| u16::from(lit(i))).collect());
    }

    /// Turning at a radian per second.
    fn turning(at: Time) -> Option<Pose> {
        let heading = at.as_secs_f64() - 1.0;
        Some(Pose { position: EnuPosition::default(), attitude: Attitude { heading, ..Attitude::default() } })
    }

    fn photograph(effects: &str, at: Time) -> Rgb {
        let camera = Camera { width: 96, height: 16, fx: 200.0, fy: 200.0, cx: 48.0, cy: 8.0, ..Camera::tello() };
        let sim_camera = SimCamera::new(camera, effects.parse().unwrap(), 3);
        let shot = sim_camera.shot(at, turning).unwrap();
        sim_camera.photograph(&shot, None, stripe)
    }

    #[test]
    fn without_effects_the_image_is_untouched() {
        let mut plain = RenderedImage::default();
        let camera = Camera { width: 96, height: 16, fx: 200.0, fy: 200.0, cx: 48.0, cy: 8.0, ..Camera::tello() };
        stripe(&camera, &Pose::default(), &mut plain);
        assert_eq!(photograph("none", Time::from_millis(1000)).data(), plain.rgb.unwrap());
    }

    #[test]
    fn a_turn_smears_by_what_is_turned_while_the_shutter_is_open() {
        let row = |effects| -> Vec<u8> {
            photograph(effects, Time::from_millis(1000)).data().chunks_exact(3).take(96).map(|pixel| pixel[0]).collect()
        };
        let touched = |row: &[u8]| row.iter().filter(|value| **value > 0).count();
        let (sharp, smeared) = (row("none"), row("blur=50"));
        assert_eq!(touched(&sharp), 8);
        // 0.05 rad at 200 pixels per radian.
        assert!((16..=19).contains(&touched(&smeared)), "{smeared:?}");
        // The light is the same, and the middle stays in the middle.
        let light = |row: &[u8]| row.iter().map(|value| f64::from(Curve::get().light(*value))).sum::<f64>();
        assert!((light(&smeared) - light(&sharp)).abs() < 0.1, "{}", light(&smeared));
        let centre = |row: &[u8]| {
            let at = |(x, value): (usize, &u8)| x as f64 * f64::from(Curve::get().light(*value));
            row.iter().enumerate().map(at).sum::<f64>() / light(row)
        };
        assert!((centre(&smeared) - centre(&sharp)).abs() < 0.2);
    }

    #[test]
    fn a_craft_at_rest_is_sharp() {
        let sim_camera = SimCamera::new(Camera::tello(), "blur=50".parse().unwrap(), 3);
        let shot = sim_camera.shot(Time::from_millis(1000), |_| Some(Pose::default())).unwrap();
        assert_eq!(shot.moments().len(), 1);
    }

    #[test]
    fn effects_repeat_and_follow_the_capture_time() {
        let all = "blur,noise,exposure=-1,lens=wide,compression=jpeg:50";
        let at = Time::from_millis(1010);
        assert_eq!(photograph(all, at), photograph(all, at));
        assert_ne!(
            photograph("noise", at),
            photograph("noise", Time::from_millis(1010) + spf_core::time::Duration::from_nanos(1))
        );
    }

    #[test]
    fn a_stop_doubles_the_light() {
        let grey = |stops: &str| {
            let sim_camera = SimCamera::new(Camera::quad().resized(16, 16), format!("exposure={stops}").parse().unwrap(), 0);
            let shot = sim_camera.shot(Time::ZERO, |_| Some(Pose::default())).unwrap();
            let draw = |camera: &Camera, _: &Pose, image: &mut RenderedImage| {
                (image.width, image.height) = (camera.width, camera.height);
                image.rgb = Some(vec![100; 16 * 16 * 3]);
            };
            sim_camera.photograph(&shot, None, draw).data()[0]
        };
        // sRGB 100 is 0.127 of full light; twice that is 137.6, half of it 71.4.
        assert_eq!([grey("1"), grey("-1"), grey("0")], [138, 71, 100]);
    }
}
