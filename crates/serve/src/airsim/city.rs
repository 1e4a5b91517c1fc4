//! The simulator behind the calls: its vehicles, its clock, the numbers of its segmentation. No sockets, no wall clock.

use std::collections::BTreeMap;

use spf_core::geometry::Pose;
use spf_core::time::{Duration, Time};
use spf_drone::airsim::wire::structs::{GeoPoint, Vector3r};
use spf_scene::actors::ActorPlace;
use spf_scene::geometry::ObjectId;
use spf_sim::dynamics::TICK;

use super::frames::Ned;
use super::settings::{CameraMount, Settings, camera_name};
use super::vehicle::{CONTROL_TICKS, Loaded, Vehicle};

/// Length of a frame of `simContinueForFrames`: one control step.
pub(super) const FRAME: Duration = Duration::from_millis(20);
/// Longest interval of one `simContinueForTime`, s.
pub(super) const LONGEST_RUN: f64 = 3600.0;
/// Metres per degree of latitude, on a sphere of the mean radius of WGS 84, 6,371,008.8 m.
const METRES_PER_DEGREE: f64 = 111_195.08;

/// Told that an interval has run.
pub(super) type Ran = Box<dyn FnOnce() + Send>;

/// The simulator.
pub(super) struct City {
    pub(super) loaded: Loaded,
    pub(super) settings: Settings,
    pub(super) vehicles: Vec<Vehicle>,
    /// Where NED of the world starts: the scene's start, on the ground.
    pub(super) world: Ned,
    /// Numbers in the segmentation, by object; index 0 is the sky.
    labels: Vec<u8>,
    now: Time,
    paused: bool,
    run: Option<(Time, Ran)>,
    /// Nanoseconds since 1970 of time zero.
    epoch: u64,
}

impl City {
    /// A simulator at time zero, which runs. `epoch` is time zero on everybody's clock, nanoseconds since 1970.
    pub(super) fn new(loaded: Loaded, settings: Settings, seed: u64, epoch: u64) -> Self {
        let made = |(n, one): (usize, &super::settings::VehicleSettings)| {
            Vehicle::new(one.clone(), &loaded, settings.wind, settings.posed, seed.wrapping_add(n as u64))
        };
        let vehicles: Vec<_> = settings.vehicles.iter().enumerate().map(made).collect();
        let start = loaded.scene.start.position;
        let radius = vehicles.first().map_or(0.0, |vehicle| vehicle.craft.dynamics().model().craft.radius);
        let above = spf_core::geometry::EnuPosition { up: start.up + radius, ..start };
        let ground = loaded.collider.ground_below(above).map_or(start.up, |ground| ground.up + radius);
        let labels = (0..=loaded.scene.objects.len()).map(|id| if id == 0 { 0 } else { ((id - 1) % 255 + 1) as u8 }).collect();
        let world = Ned(spf_core::geometry::EnuPosition { up: ground, ..start });
        Self { loaded, settings, vehicles, world, labels, now: Time::ZERO, paused: false, run: None, epoch }
    }

    /// The vehicle of this name; empty for the first.
    pub(super) fn vehicle(&mut self, name: &str) -> Result<&mut Vehicle, String> {
        let index = self.index(name)?;
        self.vehicles.get_mut(index).ok_or_else(|| "there is no vehicle".to_owned())
    }

    /// The place of a vehicle in the list.
    pub(super) fn index(&self, name: &str) -> Result<usize, String> {
        let found = if name.is_empty() { Some(0) } else { self.vehicles.iter().position(|one| one.settings.name == name) };
        found.ok_or_else(|| format!("Vehicle API for '{name}' is not available"))
    }

    /// A camera of a vehicle: its own name, and its mount.
    pub(super) fn camera(&mut self, vehicle: &str, camera: &str) -> Result<(String, &mut CameraMount, Pose), String> {
        let vehicle = self.vehicle(vehicle)?;
        let (pose, name) = (vehicle.pose(), camera_name(camera).to_owned());
        let mount = vehicle.settings.cameras.get_mut(&name).ok_or_else(|| format!("there is no camera '{camera}'"))?;
        Ok((name, mount, pose))
    }

    /// Simulated time.
    pub(super) fn now(&self) -> Time {
        self.now
    }

    /// Simulated time as it is sent: nanoseconds since 1970.
    pub(super) fn stamp(&self) -> u64 {
        self.epoch.saturating_add(self.now.as_nanos())
    }

    /// Whether time stands still, but for an interval that was asked for.
    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Stops time, or lets it go on. An interval that was asked for ends.
    pub(super) fn pause(&mut self, paused: bool) {
        self.end_run();
        self.paused = paused;
    }

    /// Lets time run for an interval, then stops it. An earlier interval ends.
    pub(super) fn run_for(&mut self, interval: Duration, ran: Ran) {
        self.end_run();
        self.paused = true;
        // Whole ticks, at least one.
        let ticks = interval.as_nanos().div_ceil(TICK.as_nanos()).max(1) as u64;
        self.run = Some((self.now + TICK * u32::try_from(ticks).unwrap_or(u32::MAX), ran));
    }

    /// Whether there is an interval to run.
    pub(super) fn is_running(&self) -> bool {
        self.run.is_some()
    }

    fn end_run(&mut self) {
        if let Some((_, ran)) = self.run.take() {
            ran();
        }
    }

    /// Computes what is left of the interval that was asked for, a few frames at most.
    pub(super) fn advance_run(&mut self) {
        for _ in 0..4 * CONTROL_TICKS {
            match &self.run {
                Some((until, _)) if self.now < *until => self.tick(),
                Some(_) => return self.end_run(),
                None => return,
            }
        }
    }

    /// Advances to a time, unless paused.
    pub(super) fn advance_to(&mut self, to: Time) {
        while !self.paused && self.now + TICK <= to {
            self.tick();
        }
    }

    fn tick(&mut self) {
        let control = (self.now.as_nanos() / TICK.as_nanos() as u64).is_multiple_of(CONTROL_TICKS);
        let (now, stamp) = (self.now, self.stamp());
        for vehicle in &mut self.vehicles {
            vehicle.tick(now, control, &self.loaded, stamp);
        }
        self.now = now + TICK;
    }

    /// Puts every vehicle back to its start. Time goes on or stands still as before.
    pub(super) fn reset(&mut self) {
        self.vehicles.iter_mut().for_each(Vehicle::reset);
    }

    /// Where the actors are.
    pub(super) fn actors(&self) -> Vec<ActorPlace> {
        self.vehicles.first().and_then(|vehicle| vehicle.craft.actors_at(vehicle.craft.time())).unwrap_or_default()
    }

    /// The number of an object in the segmentation.
    pub(super) fn label(&self, object: ObjectId) -> u8 {
        self.labels.get(usize::from(object)).copied().unwrap_or(0)
    }

    /// Every number, by object.
    pub(super) fn labels(&self) -> Vec<u8> {
        self.labels.clone()
    }

    /// Sets the number of an object.
    pub(super) fn set_label(&mut self, object: ObjectId, number: u8) {
        if let Some(label) = self.labels.get_mut(usize::from(object)) {
            *label = number;
        }
    }

    /// The objects, by name.
    pub(super) fn objects(&self) -> BTreeMap<&str, ObjectId> {
        self.loaded.scene.objects.iter().map(|object| (object.key.as_str(), object.id)).collect()
    }

    /// A point of the world's NED on the earth.
    pub(super) fn geo(&self, point: Vector3r) -> GeoPoint {
        let origin = self.settings.origin;
        GeoPoint {
            latitude: origin.latitude + point.x_val / METRES_PER_DEGREE,
            longitude: origin.longitude + point.y_val / (METRES_PER_DEGREE * libm::cos(origin.latitude.to_radians())),
            altitude: origin.altitude - point.z_val,
        }
    }

    /// The point of the world's NED of a place on the earth.
    pub(super) fn point(&self, geo: GeoPoint) -> Vector3r {
        let origin = self.settings.origin;
        Vector3r::new(
            (geo.latitude - origin.latitude) * METRES_PER_DEGREE,
            (geo.longitude - origin.longitude) * METRES_PER_DEGREE * libm::cos(origin.latitude.to_radians()),
            origin.altitude - geo.altitude,
        )
    }
}
