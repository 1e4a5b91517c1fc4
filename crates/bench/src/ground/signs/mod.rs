//! A dataset of misleading signs: which models obey printed text (docs/guide/grounding.md, "Signs").
//!
//! [`write()`] renders the tasks of the suite `signs`, each with its clean twin, from a place on the way from which the sign can
//! be
//! read and the rightful target is in view. [`obedience`] grades answers about them.

mod grade;

use std::io;
use std::path::Path;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::query::ImagePoint;
use spf_core::sign::{Arrow, SignView};
use spf_flight::dataset::record::{DatasetHeader, FORMAT, Files, HostileSign, Row, SceneHead};
use spf_flight::dataset::{Kind, Target, Visible, Wording};
use spf_flight::sim::{LoadedScene, SceneLoadError, WorldSnapshot};
use spf_media::jpeg::EncodeError;
use spf_media::png;
use spf_oracle::{LETTER_PX, Mask, masks};
use spf_render::surroundings::Surroundings;
use spf_render::{Channels, RenderedImage};
use spf_scene::geometry::ObjectId;
use spf_sim::model::Model;

pub use grade::{ObedienceRow, obedience, rows};

use crate::task::{SignContent, Task, TaskError, centre, select_all, suite};

/// The name of the dataset in place of a folder.
pub const SIGNS: &str = "signs";
/// Places tried on the way from the start to the target, metres from the start.
const WAY: [f64; 24] =
    [0.0, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 2.1, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0, 9.0, 10.0, 12.0, 14.0];
/// Key of the hostile sign in the tasks' files.
const SIGN: &str = "sign";
/// Least height of a target in the image, as a fraction.
const HIGH: f64 = 0.015;

/// Why the dataset could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SignsError {
    /// A task is invalid.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// The task's scene cannot be loaded.
    #[error("cannot load the scene of `{task}`")]
    Scene {
        /// The task.
        task: String,
        /// The cause.
        #[source]
        source: Box<SceneLoadError>,
    },
    /// No place shows sign and target.
    #[error("no point on the route of task `{0}` has both its sign and its target in view")]
    NoView(String),
    /// An image could not be encoded.
    #[error("cannot encode an image")]
    Encode(#[from] EncodeError),
    /// A file could not be written.
    #[error("cannot write the dataset")]
    Write(#[from] io::Error),
}

/// Writes the dataset into a folder, over what is there; returns the number of examples. Each image of a hostile sign is followed
/// by
/// that of its clean twin, taken from the same place.
///
/// # Errors
/// [`SignsError`] if a task shows nothing, or a file cannot be written.
pub fn write(folder: &Path) -> Result<usize, SignsError> {
    for name in ["pictures", "ids", "depth", "openings", "masks", "legends"] {
        std::fs::create_dir_all(folder.join(name))?;
    }
    let tasks = suite(SIGNS).map_or(Ok(Vec::new()), |suite| suite.tasks())?;
    let (mut rows, mut scenes) = (String::new(), Vec::new());
    let mut pose = Pose::default();
    for (number, task) in tasks.iter().enumerate() {
        let loaded = task
            .load_scene(&task.scene)
            .map_err(|source| SignsError::Scene { task: task.id.clone(), source: Box::new(source) })?;
        let clean = task.hostile.as_ref().is_some_and(|hostile| hostile.clean);
        let mut look = Look::new(task, &loaded);
        if !clean {
            pose = look.place().ok_or_else(|| SignsError::NoView(task.id.clone()))?;
        }
        let scene = SceneHead {
            name: task.id.clone(),
            legend: format!("legends/{number}.json"),
            light: loaded.scene.lighting.name().to_owned(),
            weather: loaded.scene.weather.name().to_owned(),
            near_m: loaded.scene.near,
        };
        std::fs::write(folder.join(&scene.legend), format!("{:#}\n", loaded.scene.legend_json()))?;
        let row = look.example(number as u64, pose, &scene, folder)?.ok_or_else(|| SignsError::NoView(task.id.clone()))?;
        rows += &serde_json::to_string(&row).map_err(io::Error::from)?;
        rows.push('\n');
        scenes.push(scene);
    }
    let head = DatasetHeader {
        format: FORMAT,
        seed: 0,
        examples: tasks.len() as u64,
        scenes,
        drone_model: "quad".to_owned(),
        camera: Camera::quad(),
        camera_effects: "none".to_owned(),
        absent: 0.0,
        look_alikes: 0.0,
        min_pixels: 0,
        images: "png".to_owned(),
    };
    std::fs::write(folder.join("examples.jsonl"), rows)?;
    std::fs::write(folder.join("dataset.json"), serde_json::to_string_pretty(&head).map_err(io::Error::from)? + "\n")?;
    Ok(tasks.len())
}

/// Looks at the scene of one task. All images have the camera of the quadrotor, so that one dataset holds all of them.
struct Look<'a> {
    task: &'a Task,
    loaded: &'a LoadedScene,
    camera: Camera,
    surroundings: Surroundings,
    targets: Vec<ObjectId>,
    sign: Option<ObjectId>,
    image: RenderedImage,
    wide: RenderedImage,
}

impl<'a> Look<'a> {
    fn new(task: &'a Task, loaded: &'a LoadedScene) -> Self {
        let camera = Camera::quad();
        let goals = task.goals.last().map_or(&[][..], |goal| &goal.targets);
        Self {
            task,
            loaded,
            camera,
            surroundings: Surroundings::of(&camera),
            targets: select_all(goals, loaded, loaded.scene.start.position),
            sign: loaded.scene.by_key(SIGN).map(|object| object.id),
            image: RenderedImage::default(),
            wide: RenderedImage::default(),
        }
    }

    /// The first place on the straight way to the nearest target from which the sign can be read and the target is in view.
    fn place(&mut self) -> Option<Pose> {
        let start = self.loaded.scene.start.position;
        let from = EnuPosition { up: start.up + Model::of(self.task.craft).craft.take_off_height, ..start };
        let centres = self.targets.iter().filter_map(|id| self.loaded.scene.object(*id)).map(|object| centre(&object.bounds));
        let to = centres.min_by(|a, b| a.distance(from).total_cmp(&b.distance(from)))?;
        let heading = libm::atan2(to.east - from.east, to.north - from.north);
        let away = from.horizontal_distance(to);
        WAY.into_iter().take_while(|metres| *metres < away).find_map(|metres| {
            let fraction = metres / away;
            let at = from.towards(EnuPosition { up: from.up, ..to }, fraction);
            let pose = Pose { position: at, attitude: Attitude { heading, ..Attitude::default() } };
            self.shows(pose).then_some(pose)
        })
    }

    fn render(&mut self, pose: Pose) -> Vec<Mask> {
        let snapshot = self.loaded.initial_snapshot(pose);
        self.loaded.render_into(&self.camera, &snapshot, Channels::TRUTH, &mut self.image);
        let ids = [self.image.ids.as_deref(), self.image.opening_ids.as_deref()].into_iter().flatten();
        ids.flat_map(|ids| masks(ids, self.image.width as usize)).collect()
    }

    fn shows(&mut self, pose: Pose) -> bool {
        let seen = self.render(pose);
        let whole = |id: ObjectId| seen.iter().find(|mask| mask.id == id);
        let (width, height) = (self.image.width as usize, self.image.height as usize);
        let inside = |mask: &Mask| mask.left > 0 && mask.top > 0 && mask.right + 1 < width && mask.bottom + 1 < height;
        let high = |mask: &Mask| (mask.bottom - mask.top + 1) as f64 >= HIGH * height as f64;
        let target = self.targets.iter().any(|id| whole(*id).is_some_and(high));
        let lure = self.lure();
        let lured = lure.is_empty() || lure.iter().any(|id| whole(*id).is_some_and(high));
        let signs = self.signs(pose);
        let read = self.sign.and_then(whole).is_some_and(|mask| {
            let Some(sign) = signs.iter().find(|sign| sign.id == mask.id) else { return inside(mask) };
            let depth = self.image.depth.as_ref().and_then(|depth| depth.get(mask.deepest.1 * width + mask.deepest.0));
            depth.is_some_and(|along| sign.letter_m * self.camera.fy / f64::from(*along) >= LETTER_PX) && inside(mask)
        });
        target && lured && read
    }

    fn signs(&self, pose: Pose) -> Vec<SignView> {
        self.loaded.scene.signs_from(pose.position)
    }

    /// What the sign leads to, or, for an arrow, nothing.
    fn lure(&self) -> Vec<ObjectId> {
        let selectors = self.task.hostile.as_ref().map_or(&[][..], |hostile| &hostile.lure);
        select_all(selectors, self.loaded, self.loaded.scene.start.position)
    }

    /// Renders and writes an example; `None` if the target is not in the image.
    fn example(&mut self, number: u64, pose: Pose, scene: &SceneHead, folder: &Path) -> Result<Option<Row>, SignsError> {
        let seen = self.render(pose);
        let of_target = |mask: &&Mask| self.targets.contains(&mask.id);
        let Some(mask) = seen.iter().filter(of_target).max_by_key(|mask| mask.area) else { return Ok(None) };
        let (Some(target), Some(hostile)) = (self.target(mask, pose), &self.task.hostile) else { return Ok(None) };
        let snapshot = self.loaded.initial_snapshot(pose);
        let visible = self.visible(&snapshot, &seen);
        let sign = self.sign.and_then(|id| self.loaded.scene.object(id));
        let says = match sign {
            Some(object) => object.sign.as_ref().map_or_else(
                || object.tags.looks_like.map_or_else(String::new, |of| self.loaded.key(of)),
                |sign| sign.text.replace('\n', " "),
            ),
            None => String::new(),
        };
        let arrow = sign.and_then(|object| object.sign.as_ref()?.arrow);
        let shows = serde_json::to_value(hostile.shows).map_err(io::Error::from)?;
        let hostile = HostileSign {
            pair: self.task.drawn_as().to_owned(),
            clean: hostile.clean,
            shows: shows.as_str().unwrap_or_default().to_owned(),
            says,
            rightful: self.targets.clone(),
            lure: if hostile.shows == SignContent::Arrow { self.sign.into_iter().collect() } else { self.lure() },
            side: match arrow {
                Some(Arrow::Left) => -1,
                Some(Arrow::Right) => 1,
                _ => 0,
            },
        };
        let row = Row {
            number,
            scene: scene.name.clone(),
            kind: Kind::Present,
            instruction: self.task.instruction.clone(),
            wording: Wording::Name,
            target: Some(target),
            look_alikes: Vec::new(),
            files: self.files(number, mask, &snapshot, folder)?,
            near_m: scene.near_m,
            pose: pose.into(),
            visible,
            signs: self.signs(pose),
            hostile: Some(hostile),
        };
        Ok(Some(row))
    }

    fn target(&self, mask: &Mask, pose: Pose) -> Option<Target> {
        let (w, h) = (self.image.width as usize, self.image.height as usize);
        let (x, y) = mask.deepest;
        let opening = self.loaded.scene.object(mask.id)?.opening;
        let depth = if opening { &self.image.opening_depth } else { &self.image.depth };
        let along = f64::from(*depth.as_ref()?.get(y * w + x)?);
        let ray = self.camera.ray(ImagePoint { u: (x as f64 + 0.5) / w as f64, v: (y as f64 + 0.5) / h as f64 });
        let actors = self.loaded.cast.starts();
        Some(Target {
            id: mask.id,
            key: self.loaded.key(mask.id),
            opening,
            point: [x as u32, y as u32],
            bounds: [mask.left, mask.top, mask.right + 1, mask.bottom + 1].map(|at| at as u32),
            pixels: mask.area,
            distance_m: along * libm::sqrt(1.0 + ray.right * ray.right + ray.up * ray.up),
            nearest_m: self.loaded.distance_to(mask.id, &actors, pose.position)?,
            occlusion: 0.0,
        })
    }

    fn visible(&mut self, snapshot: &WorldSnapshot, seen: &[Mask]) -> Vec<Visible> {
        let light = self.loaded.renderer.light_on(&self.camera, &snapshot.pose, &self.image);
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.loaded.render_into(self.surroundings.camera(), snapshot, channels, &mut self.wide);
        let fractions = self.surroundings.fractions(&self.wide);
        let one = |mask: &Mask| {
            let object = self.loaded.scene.object(mask.id)?;
            Some(Visible {
                id: mask.id,
                key: object.key.clone(),
                opening: object.opening,
                pixels: mask.area,
                in_frame: fractions.get(&mask.id).copied().unwrap_or(1.0),
                light: light.get(&mask.id).copied().unwrap_or(1.0),
            })
        };
        seen.iter().filter_map(one).collect()
    }

    fn files(&self, number: u64, target: &Mask, snapshot: &WorldSnapshot, folder: &Path) -> Result<Files, SignsError> {
        let (width, height) = (self.image.width, self.image.height);
        let put = |name: String, bytes: Vec<u8>| std::fs::write(folder.join(&name), bytes).map(|()| name);
        let grey = |pixels: &[u16]| png::encode_grey16(width, height, pixels);
        // As in every dataset: centimetres along the optical axis, 0 for none.
        let centimetres = |metres: &f32| match 100.0 * metres + 0.5 {
            cm if cm.is_finite() && cm < f32::from(u16::MAX) => cm as u16,
            _ => 0,
        };
        let deep = |depth: &[f32]| depth.iter().map(centimetres).collect::<Vec<u16>>();
        let photograph = self.loaded.render(&self.camera, snapshot, Channels::RGB);
        let image = png::encode_rgb8(width, height, photograph.rgb.as_deref().unwrap_or_default())?;
        let layer = |layer: &Option<Vec<u16>>| layer.clone().filter(|ids| ids.iter().any(|id| *id != 0));
        let openings = layer(&self.image.opening_ids);
        let opening_depth = openings.as_ref().and(self.image.opening_depth.as_deref());
        let opening = self.loaded.scene.object(target.id).is_some_and(|object| object.opening);
        let ids = if opening { &self.image.opening_ids } else { &self.image.ids };
        let mask: Vec<u8> = ids.iter().flatten().map(|id| u8::from(*id == target.id) * 255).collect();
        let name = |folder: &str, end: &str| format!("{folder}/{number:06}{end}");
        Ok(Files {
            image: put(name("pictures", ".png"), image)?,
            ids: put(name("ids", ".png"), grey(self.image.ids.as_deref().unwrap_or_default())?)?,
            depth: put(name("depth", ".png"), grey(&deep(self.image.depth.as_deref().unwrap_or_default()))?)?,
            opening_ids: openings
                .as_deref()
                .map(|ids| Ok::<_, SignsError>(put(name("openings", ".png"), grey(ids)?)?))
                .transpose()?,
            opening_depth: opening_depth
                .map(|depth| Ok::<_, SignsError>(put(name("openings", "_depth.png"), grey(&deep(depth))?)?))
                .transpose()?,
            mask: Some(put(name("masks", ".png"), png::encode_grey8(width, height, &mask)?)?),
        })
    }
}
