//! Small scenes with actors, and contact with them.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use std::fmt::Write as _;
use std::sync::Arc;

use spf_scene::actors::Cast;
use spf_scene::collide::Collider;
use spf_scene::{Scene, SceneError};

pub(crate) const HEAD: &str = r#"format = 1
name = "test"
craft = "quad"
start = "0,0,0,0"
success_radius_m = 5.0
near_m = 3.0
bounds = { east = [-90, 90], north = [-90, 90], up = [0, 50] }

[templates.person]
mesh = { kind = "person" }
names = ["person"]
kind = "person"

[templates.car]
mesh = { kind = "car", style = "sedan" }
names = ["car"]
kind = "vehicle"

[[objects]]
id = "floor"
position = [0.0, 0.0]
mesh = { kind = "slab", size = [400.0, 400.0], thickness = 0.1 }
names = ["floor"]
kind = "ground"
"#;

pub(crate) fn actor(text: &mut String, id: &str, like: &str, motion: &str) {
    writeln!(text, "[[objects]]\nid = \"{id}\"\nlike = \"{like}\"\n{motion}").expect("a string takes it");
}

pub(crate) fn walk(path: &str, rest: &str) -> String {
    format!("walk = {{ path = {path}, speed_m_s = 1.3{rest} }}")
}

pub(crate) fn drive(path: &str, rest: &str) -> String {
    format!("drive = {{ path = {path}, speed_m_s = 8.0{rest} }}")
}

pub(crate) struct Stage {
    pub(crate) scene: Scene,
    pub(crate) collider: Arc<Collider>,
    pub(crate) cast: Arc<Cast>,
}

impl Stage {
    pub(crate) fn new(text: &str) -> Result<Self, SceneError> {
        let scene = Scene::parse(text, "test.toml")?;
        let collider = Arc::new(Collider::new(&scene.geometry).expect("meshes are sound"));
        let cast = Arc::new(Cast::new(&scene.actors, &collider).expect("meshes are sound"));
        Ok(Self { scene, collider, cast })
    }

    pub(crate) fn of(actors: &[(&str, &str, String)]) -> Self {
        let mut text = HEAD.to_owned();
        for (id, like, motion) in actors {
            actor(&mut text, id, like, motion);
        }
        Self::new(&text).expect("the scene is sound")
    }
}
