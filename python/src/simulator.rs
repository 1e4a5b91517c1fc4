//! `spf.Simulator`: a craft that is flown by velocities.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use spf_api::error::Error;
use spf_api::simulator::SimulatorSettings;
use spf_core::command::Setpoint;
use spf_core::query::ImagePoint;

use crate::arrays::shared;
use crate::convert::{craft, json, pose, start};
use crate::errors::{raised, wrong};

/// A simulated craft in a scene, flown by velocities; on the ground at first. Time stands still between calls.
///
/// scene: a built-in scene or the path of a scene file. craft: quad or tello; the scene's own by default. seed: of sensor noise and
/// actors. start: east, north and up in metres, heading and perhaps pitch in degrees. size: width and height of images in pixels; the
/// camera's own by default.
///
/// Every command passes the safety envelope, which limits speed, height and distance. It does not brake before obstacles here.
/// Raises spf.UsageError if the scene cannot be loaded, or the start is blocked.
#[pyclass(frozen, module = "spf")]
pub(crate) struct Simulator {
    simulator: Mutex<spf_api::simulator::Simulator>,
}

impl Simulator {
    fn locked(&self) -> MutexGuard<'_, spf_api::simulator::Simulator> {
        // It is valid between calls.
        self.simulator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn flown(
        &self,
        py: Python<'_>,
        fly: impl FnOnce(&mut spf_api::simulator::Simulator) -> Result<spf_api::simulator::Observation, Error> + Send,
    ) -> PyResult<Observation> {
        // Another thread may hold the lock while it works, and needs Python for its result.
        let observation = py.detach(|| fly(&mut self.locked())).map_err(|error| raised(py, &error))?;
        Ok(Observation { observation })
    }
}

#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(signature = (scene = "city", *, craft = None, seed = 0, start = None, size = None))]
    fn new(
        py: Python<'_>,
        scene: &str,
        craft: Option<&str>,
        seed: u64,
        start: Option<Vec<f64>>,
        size: Option<(u32, u32)>,
    ) -> PyResult<Self> {
        let (craft, start) = (self::craft(py, craft)?, self::start(py, start)?);
        let settings = SimulatorSettings { scene: scene.to_owned(), craft, seed, start, size };
        let made = py.detach(|| spf_api::simulator::Simulator::new(&settings));
        Ok(Self { simulator: Mutex::new(made.map_err(|error| raised(py, &error))?) })
    }

    /// Takes off, to the craft's usual height, and hovers there. Returns a spf.Observation.
    ///
    /// Raises spf.UsageError if the safety envelope refuses it, as in the air.
    fn takeoff(&self, py: Python<'_>) -> PyResult<Observation> {
        self.flown(py, spf_api::simulator::Simulator::takeoff)
    }

    /// Descends to the ground. Returns a spf.Observation.
    fn land(&self, py: Python<'_>) -> PyResult<Observation> {
        self.flown(py, spf_api::simulator::Simulator::land)
    }

    /// Flies with these velocities for dt seconds, at most 60. Returns a spf.Observation.
    ///
    /// forward, right, up: m/s in the level body frame. yaw_rate_deg_s: degrees per second, clockwise positive.
    /// Raises spf.UsageError unless every number is finite and dt positive.
    #[pyo3(signature = (*, forward = 0.0, right = 0.0, up = 0.0, yaw_rate_deg_s = 0.0, dt = 0.1))]
    fn step(&self, py: Python<'_>, forward: f64, right: f64, up: f64, yaw_rate_deg_s: f64, dt: f64) -> PyResult<Observation> {
        let setpoint = Setpoint { right, forward, up, yaw_rate: yaw_rate_deg_s.to_radians() };
        self.flown(py, move |simulator| simulator.step(setpoint, dt))
    }

    /// Flies the step that the method takes towards a point of the image with a depth label, as spf.lift gives it, until the craft is at
    /// rest. Returns a spf.Observation.
    ///
    /// point: (u, v), fractions of the image from its upper left corner. label: 1 to 10, need not be whole. Nothing stops the craft
    /// before an obstacle. Raises spf.UsageError for another point or label, and if the craft does not fly.
    fn point(&self, py: Python<'_>, point: (f64, f64), label: f64) -> PyResult<Observation> {
        let point = ImagePoint { u: point.0, v: point.1 };
        self.flown(py, move |simulator| simulator.point(point, label))
    }

    /// The centres of the scene's objects now by their keys: metres east, north and up.
    #[getter]
    fn places(&self, py: Python<'_>) -> BTreeMap<String, (f64, f64, f64)> {
        let places = py.detach(|| self.locked().places());
        places.into_iter().map(|(key, at)| (key, (at.east, at.north, at.up))).collect()
    }

    /// What is there now, without any time passing. Returns a spf.Observation.
    fn observe(&self, py: Python<'_>) -> PyResult<Observation> {
        self.flown(py, |simulator| Ok(simulator.observe()))
    }

    /// The camera at the size of the images: width, height, fx, fy, cx, cy in pixels, distortion, tilt below the horizon in radians.
    #[getter]
    fn camera<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let camera = py.detach(|| *self.locked().camera());
        json(py, &camera)
    }

    /// The preset speeds, at which flights cruise: forward, right and up in m/s, yaw in degrees per second. The envelope lets half as much
    /// again pass.
    #[getter]
    fn speeds(&self, py: Python<'_>) -> (f64, f64, f64, f64) {
        let craft = py.detach(|| self.locked().craft());
        (craft.cruise_speed, craft.cruise_speed, craft.climb_speed, craft.yaw_rate.to_degrees())
    }

    /// Distance from an object's surface at which the scene counts it as reached, metres.
    #[getter]
    fn near_m(&self, py: Python<'_>) -> f64 {
        py.detach(|| self.locked().scene().scene.success_radius)
    }

    /// The keys of the scene's objects by the ids of spf.Observation.ids.
    #[getter]
    fn objects(&self, py: Python<'_>) -> BTreeMap<u16, String> {
        py.detach(|| self.locked().scene().tags.iter().map(|tags| (tags.id, tags.key.clone())).collect())
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        py.detach(|| {
            let simulator = self.locked();
            format!("<spf.Simulator {}: {:.1} s>", simulator.scene().scene.name, simulator.observe().time_s)
        })
    }
}

/// The names of the built-in scenes.
#[pyfunction]
pub(crate) fn scenes() -> Vec<&'static str> {
    spf_api::simulator::scenes()
}

/// Steps many simulators at once, in threads, and renders their images: the same as Simulator.step of each, in less time. Returns the
/// spf.Observations in order.
///
/// simulators: each at most once. actions: (N, 4), rows of forward, right, up in m/s and the yaw rate in degrees per second.
/// dt: seconds. Raises spf.UsageError for a wrong number of actions, before anything moves, and what the first that failed would raise,
/// after all others have been stepped.
#[pyfunction]
#[pyo3(signature = (simulators, actions, *, dt = 0.1))]
pub(crate) fn step_all(
    py: Python<'_>,
    simulators: Vec<Py<Simulator>>,
    actions: Vec<[f64; 4]>,
    dt: f64,
) -> PyResult<Vec<Observation>> {
    if simulators.len() != actions.len() {
        let message = format!("{} simulators and {} actions", simulators.len(), actions.len());
        return Err(wrong(py, message, "actions has one row of four numbers for each simulator"));
    }
    let setpoint = |[forward, right, up, yaw]: [f64; 4]| Setpoint { right, forward, up, yaw_rate: yaw.to_radians() };
    let stepped = py.detach(|| {
        let craft: Vec<_> = simulators.iter().map(|one| &one.get().simulator).zip(actions.into_iter().map(setpoint)).collect();
        spf_api::simulator::step_all(&craft, dt)
    });
    let observation = |one: Result<_, Error>| one.map(|observation| Observation { observation });
    stepped.into_iter().map(observation).collect::<Result<_, _>>().map_err(|error| raised(py, &error))
}

/// What is there at an instant, by ground truth. Images are rendered when they are first read, and show this instant.
#[pyclass(frozen, module = "spf")]
pub(crate) struct Observation {
    observation: spf_api::simulator::Observation,
}

impl Observation {
    fn shape(&self) -> [usize; 2] {
        let (width, height) = self.observation.size();
        [height as usize, width as usize]
    }
}

#[pymethods]
impl Observation {
    /// The image, (H, W, 3) of uint8, sRGB, rows from the top; read-only.
    #[getter]
    fn rgb(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        let (this, owner) = (slf.get(), slf.clone().into_any());
        let (data, [height, width]) = (slf.py().detach(|| this.observation.rgb()), this.shape());
        shared(&[height, width, 3], data, owner)
    }

    /// Depth along the optical axis, (H, W) of float32, metres, 0 where there is nothing; read-only.
    #[getter]
    fn depth(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        let (this, owner) = (slf.get(), slf.clone().into_any());
        shared(&this.shape(), slf.py().detach(|| this.observation.depth()), owner)
    }

    /// Id of the object at each pixel's centre, (H, W) of uint16, 0 for none; read-only.
    #[getter]
    fn ids(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        let (this, owner) = (slf.get(), slf.clone().into_any());
        shared(&this.shape(), slf.py().detach(|| this.observation.ids()), owner)
    }

    /// True pose, a spf.Pose: metres east, north and up; degrees, heading clockwise from north.
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        pose(py, &self.observation.pose)
    }

    /// True velocity, m/s east, north and up.
    #[getter]
    fn velocity(&self) -> (f64, f64, f64) {
        let velocity = self.observation.velocity;
        (velocity.east, velocity.north, velocity.up)
    }

    /// Time since the simulator was made, seconds.
    #[getter]
    fn time_s(&self) -> f64 {
        self.observation.time_s
    }

    /// Whether the craft is in the air.
    #[getter]
    fn airborne(&self) -> bool {
        self.observation.is_airborne
    }

    /// Whether the craft has hit anything in flight so far.
    #[getter]
    fn collided(&self) -> bool {
        !self.observation.touched.is_empty()
    }

    /// Keys of the objects that it has hit, in order.
    #[getter]
    fn touched(&self) -> Vec<String> {
        self.observation.touched.clone()
    }

    /// Distance from the craft to the nearest surface of an object, metres, by its key. Raises spf.UsageError for an unknown one.
    fn distance_to(&self, py: Python<'_>, key: &str) -> PyResult<f64> {
        self.observation.distance_to(key).map_err(|error| raised(py, &error))
    }

    /// Why the safety envelope did not fly the last step as given, or None.
    #[getter]
    fn limited(&self) -> Option<&str> {
        self.observation.limited.as_deref()
    }

    fn __repr__(&self) -> String {
        let (at, [height, width]) = (self.observation.pose.position, self.shape());
        let time = self.observation.time_s;
        format!(
            "<spf.Observation at {time:.2} s: {:.2} m east, {:.2} m north, {:.2} m up; {width}×{height}>",
            at.east, at.north, at.up
        )
    }
}
