//! Finds the object under the pointer from the id and depth images.

use spf_core::camera::Camera;
use spf_core::query::ImagePoint;
use spf_flight::sim::LoadedScene;
use spf_render::RenderedImage;

use super::message::Under;

/// The object or opening under a point, if any, with the id for its outline.
pub(super) fn under(loaded: &LoadedScene, camera: &Camera, image: &RenderedImage, [u, v]: [f64; 2]) -> Option<(u16, Under)> {
    let pixel = |fraction: f64, side: u32| ((fraction * f64::from(side)) as usize).min((side as usize).saturating_sub(1));
    let index = pixel(v, image.height) * image.width as usize + pixel(u, image.width);
    let at = |ids: &Option<Vec<u16>>, depth: &Option<Vec<f32>>| {
        let id = ids.as_ref()?.get(index).copied().filter(|id| *id != 0)?;
        Some((id, f64::from(*depth.as_ref()?.get(index)?)))
    };
    let solid = at(&image.ids, &image.depth);
    let opening = at(&image.opening_ids, &image.opening_depth);
    let (id, depth) = solid.or(opening)?;
    let object = loaded.scene.object(id)?;
    let words = |id: u16| loaded.tags.get(usize::from(id).checked_sub(1)?).map(|tags| tags.words());
    let ray = camera.ray(ImagePoint { u, v });
    // Depth is along the optical axis; the ray to the pixel is longer.
    let lengthening = (ray.right * ray.right + ray.up * ray.up + 1.0).sqrt();
    let tags = &object.tags;
    let number = tags.number.map(|number| format!("number {number}"));
    let further = tags.names.iter().skip(1).chain(&tags.synonyms).chain(&tags.qualities).chain(&tags.uses).chain(&tags.group);
    let under = Under {
        key: object.key.clone(),
        words: words(id).unwrap_or_default(),
        kind: tags.kind.clone(),
        tags: further.cloned().chain(number).collect(),
        distance_m: depth * lengthening,
        through: opening.filter(|(other, _)| *other != id).and_then(|(other, _)| words(other)),
    };
    Some((id, under))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::{Attitude, EnuPosition, Pose};
    use spf_render::Channels;

    #[test]
    fn the_red_crane_is_named_where_it_is_seen() {
        let loaded = LoadedScene::load("city").unwrap();
        let camera = Camera::quad();
        let crane = loaded.scene.by_key("red_crane").unwrap();
        // From 30 m south of the mast's foot, 10 m up.
        let (min, max) = (crane.bounds.min, crane.bounds.max);
        let position = EnuPosition { east: (min.east + max.east) / 2.0, north: min.north - 30.0, up: 10.0 };
        let pose = Pose { position, attitude: Attitude::default() };
        let image = loaded.renderer.render(&camera, &pose, Channels::TRUTH);
        let ids = image.ids.as_ref().unwrap();
        let index = ids.iter().position(|id| *id == crane.id).unwrap();
        let (x, y) = (index % 960, index / 960);
        let point = [(x as f64 + 0.5) / 960.0, (y as f64 + 0.5) / 720.0];
        let (id, seen) = under(&loaded, &camera, &image, point).unwrap();
        assert_eq!((id, seen.key.as_str()), (crane.id, "red_crane"));
        assert!(seen.words.contains("red") && seen.words.contains("crane"), "{seen:?}");
        let truth = loaded.collider.distance_to(crane.id, position).unwrap();
        assert!(seen.distance_m >= truth - 0.1 && seen.distance_m < truth + 80.0, "{} from {truth}", seen.distance_m);
        assert_eq!(under(&loaded, &camera, &RenderedImage::default(), [0.5, 0.5]), None);
    }
}
