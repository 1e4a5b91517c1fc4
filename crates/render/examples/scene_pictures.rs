//! Images of a scene from given viewpoints, each with a list of the objects that fill more than 1 % of it.
//!
//! `cargo run -p spf-render --example scene_pictures -- city[:LIGHT[:WEATHER]] OUT_FOLDER [east,north,up,heading_deg[,pitch_deg] …]`
//! Without poses: five views of the city. The list goes into `N.txt` beside `N.png`.

use std::fmt::Write as _;
use std::path::Path;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_render::{Channels, Renderer};
use spf_scene::{Lighting, Scene, SceneLook, Weather};

const VIEWS: [&str; 5] = ["0,0,3,0", "-6,6,8,300", "12,-14,7,62", "-28,4,9,318,-2", "48,-12,24,338,-10"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "give a scene and a folder";
    let scene = arguments.next().ok_or(usage)?;
    let mut words = scene.split(':');
    let name = words.next().ok_or(usage)?;
    let lighting = words.next().map(|light| Lighting::from_name(light).ok_or("no such light")).transpose()?;
    let weather = words.next().map(|weather| Weather::from_name(weather).ok_or("no such weather")).transpose()?;
    let scene = Scene::load_with(name, &SceneLook { lighting, weather })?;
    let folder = arguments.next().ok_or(usage)?;
    std::fs::create_dir_all(&folder)?;
    let given: Vec<String> = arguments.collect();
    let poses = if given.is_empty() { VIEWS.map(str::to_owned).to_vec() } else { given };
    let renderer = Renderer::new(&scene.geometry);
    for (i, text) in poses.iter().enumerate() {
        let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
        let [east, north, up, heading] =
            *numbers.get(..4).and_then(|n| <&[f64; 4]>::try_from(n).ok()).ok_or("a pose has four numbers")?;
        let pitch = numbers.get(4).copied().unwrap_or(0.0).to_radians();
        let attitude = Attitude { heading: heading.to_radians(), pitch, roll: 0.0 };
        let image =
            renderer.render(&Camera::quad(), &Pose { position: EnuPosition { east, north, up }, attitude }, Channels::ALL);
        image.save_rgb(&Path::new(&folder).join(format!("{}.png", i + 1)))?;
        let ids = image.ids.as_deref().unwrap_or_default();
        let mut list = format!("{text}\n");
        for object in &scene.objects {
            let fraction = ids.iter().filter(|&&id| id == object.id).count() as f64 / ids.len() as f64;
            if fraction > 0.01 {
                writeln!(list, "{:5.1} %  {}  ({})", 100.0 * fraction, object.key, object.tags.names.join(", "))?;
            }
        }
        std::fs::write(Path::new(&folder).join(format!("{}.txt", i + 1)), list)?;
    }
    Ok(())
}
