//! A small simulator for tests, over real sockets: a point that moves as it is told, and whatever fault is wanted.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use super::address::Address;
use super::wire::structs::{
    CameraInfo, CollisionInfo, GeoPoint, ImageRequest, ImageResponse, ImageType, KinematicsState, MultirotorState, Pose,
    ProjectionMatrix, Quaternionr, RcData, Vector3r, YawMode,
};
use super::wire::{Decoder, Encoding, Limits, Message, Raw, errors};

/// How long a take-off and a landing take.
const MANOEUVRE: Duration = Duration::from_millis(150);

/// What is wrong.
#[derive(Clone, Debug, Default)]
pub(super) struct Faults {
    /// The pose is no number.
    pub(super) nan: bool,
    /// Its time stands still.
    pub(super) still: bool,
    /// Images of no size, with this message.
    pub(super) no_image: Option<&'static str>,
    /// Images with fewer bytes than they say.
    pub(super) short_image: bool,
    /// This method is answered with this error.
    pub(super) error: Option<(&'static str, &'static str)>,
    /// This method is never answered.
    pub(super) silent: Option<&'static str>,
    /// Connections are closed, and new ones at once.
    pub(super) closed: bool,
    /// Something was touched.
    pub(super) collided: bool,
}

/// The vehicle.
#[derive(Debug)]
pub(super) struct World {
    pub(super) faults: Faults,
    /// NED, metres and m/s.
    pub(super) position: [f64; 3],
    pub(super) velocity: [f64; 3],
    /// Degrees clockwise from north, and a second.
    pub(super) yaw_deg: f64,
    pub(super) yaw_rate_deg: f64,
    pub(super) landed: bool,
    pub(super) armed: bool,
    pub(super) controlled: bool,
    /// Calls of the flight in order, with their numbers.
    pub(super) calls: Vec<(String, Vec<f64>)>,
    until: Instant,
    moved: Instant,
    /// When its time stands still.
    pub(super) paused: Option<Instant>,
    /// Number of the newest motion call.
    motion: u64,
}

impl World {
    /// Its time.
    fn now(&self) -> Instant {
        self.paused.unwrap_or_else(Instant::now)
    }

    fn advance(&mut self) {
        let now = self.now();
        let flown = now.min(self.until).saturating_duration_since(self.moved).as_secs_f64();
        (0..3).for_each(|axis| self.position[axis] += flown * self.velocity[axis]);
        self.yaw_deg += flown * self.yaw_rate_deg;
        if now >= self.until {
            (self.velocity, self.yaw_rate_deg) = ([0.0; 3], 0.0);
        }
        self.moved = now;
    }

    /// How often a method was called.
    pub(super) fn count(&self, method: &str) -> usize {
        self.calls.iter().filter(|(called, _)| called == method).count()
    }
}

/// The simulator.
pub(super) struct Fake {
    pub(super) world: Arc<Mutex<World>>,
    pub(super) address: Address,
    stopped: Arc<AtomicBool>,
}

/// The size of its images.
pub(super) const SIZE: (u32, u32) = (32, 18);

impl Fake {
    /// One that speaks in this encoding.
    pub(super) fn start(encoding: Encoding) -> Self {
        Self::with(encoding, Faults::default())
    }

    /// The same with faults.
    pub(super) fn with(encoding: Encoding, faults: Faults) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        listener.set_nonblocking(true).unwrap();
        let now = Instant::now();
        let world = Arc::new(Mutex::new(World {
            faults,
            position: [0.0; 3],
            velocity: [0.0; 3],
            yaw_deg: 0.0,
            yaw_rate_deg: 0.0,
            landed: true,
            armed: false,
            controlled: false,
            calls: Vec::new(),
            until: now,
            moved: now,
            paused: None,
            motion: 0,
        }));
        let stopped = Arc::new(AtomicBool::new(false));
        let (shared, over) = (world.clone(), stopped.clone());
        std::thread::spawn(move || {
            while !over.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) => {
                        let (world, over) = (shared.clone(), over.clone());
                        std::thread::spawn(move || {
                            Server { stream, encoding, world, begun: now, waiting: Vec::new() }.serve(&over)
                        });
                    }
                    Err(_) => std::thread::sleep(Duration::from_millis(5)),
                }
            }
        });
        let address = Address { host: "127.0.0.1".to_owned(), port, vehicle: String::new() };
        Self { world, address, stopped }
    }

    pub(super) fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap()
    }

    /// Waits until something is so; the time only detects a hang.
    pub(super) fn wait(&self, what: &str, mut is_so: impl FnMut(&World) -> bool) {
        let begun = Instant::now();
        while !is_so(&self.world()) {
            assert!(begun.elapsed() < Duration::from_secs(60), "{what}: {:?}", self.world());
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
    }
}

/// A task of a motion call that is answered later: its id, its end, its number.
struct Task {
    id: u32,
    ends: Instant,
    number: u64,
    height: Option<f64>,
}

/// One connection.
struct Server {
    stream: TcpStream,
    encoding: Encoding,
    world: Arc<Mutex<World>>,
    begun: Instant,
    waiting: Vec<Task>,
}

impl Server {
    fn serve(mut self, over: &AtomicBool) {
        self.stream.set_nonblocking(false).unwrap();
        self.stream.set_read_timeout(Some(Duration::from_millis(3))).unwrap();
        let mut decoder = Decoder::new(Limits::REQUESTS);
        let mut buffer = [0; 4096];
        while !over.load(Ordering::Relaxed) && !self.world.lock().unwrap().faults.closed {
            match self.stream.read(&mut buffer) {
                Ok(0) => return,
                Ok(length) => decoder.push(&buffer[..length]),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => return,
            }
            while let Ok(Some(message)) = decoder.next_message() {
                let Message::Request { id, method, params } = message else { panic!("a client answers nothing") };
                if let Some(outcome) = self.answer(id, &method, &params) {
                    self.reply(id, outcome);
                }
            }
            self.end_tasks();
        }
    }

    fn reply(&mut self, id: u32, outcome: Result<Raw, String>) {
        let outcome = outcome.map_err(|text| Raw::of(&text, self.encoding));
        drop(self.stream.write_all(&Message::Response { id, outcome }.encode()));
    }

    fn value<T: serde::Serialize + ?Sized>(&self, value: &T) -> Option<Result<Raw, String>> {
        Some(Ok(Raw::of(value, self.encoding)))
    }

    fn end_tasks(&mut self) {
        for task in std::mem::take(&mut self.waiting) {
            let mut world = self.world.lock().unwrap();
            let is_cut_off = task.number != world.motion;
            if !is_cut_off && world.now() < task.ends {
                drop(world);
                self.waiting.push(task);
                continue;
            }
            if let Some(height) = task.height.filter(|_| !is_cut_off) {
                world.position[2] = -height;
                world.landed = height == 0.0;
            }
            drop(world);
            self.reply(task.id, Ok(Raw::of(&!is_cut_off, self.encoding)));
        }
    }

    fn answer(&mut self, id: u32, method: &str, params: &[Raw]) -> Option<Result<Raw, String>> {
        let shared = self.world.clone();
        let mut world = shared.lock().unwrap();
        world.advance();
        if world.faults.silent == Some(method) {
            return None;
        }
        if let Some((_, text)) = world.faults.error.filter(|(of, _)| *of == method) {
            return Some(Err(errors::failed(method, params.len(), text)));
        }
        let numbers: Vec<f64> = params.iter().filter_map(|raw| raw.read().ok()).collect();
        let flag = || params[0].read::<bool>().unwrap();
        match method {
            "ping" => self.value(&true),
            "getServerVersion" => self.value(&1),
            "listVehicles" => self.value(&["Drone1", "Drone2"]),
            "getSettingsString" => self.value("{}"),
            "isApiControlEnabled" => self.value(&world.controlled),
            "getMultirotorState" => self.value(&self.state(&world)),
            "simGetCollisionInfo" => {
                let has_collided = std::mem::take(&mut world.faults.collided);
                self.value(&CollisionInfo { has_collided, object_name: "Wall_7".to_owned(), ..CollisionInfo::default() })
            }
            "simPause" => {
                world.paused = flag().then(|| world.now());
                Some(Ok(Raw::nil()))
            }
            "simContinueForTime" => {
                world.paused = Some(world.now() + Duration::from_secs_f64(numbers[0]));
                world.advance();
                Some(Ok(Raw::nil()))
            }
            "simGetCameraInfo" => {
                let pose = Pose { position: Vector3r::default(), orientation: turned(world.yaw_deg) };
                self.value(&CameraInfo { pose, fov: 90.0, proj_mat: ProjectionMatrix { matrix: [[0.0; 4]; 4] } })
            }
            "simGetImages" => {
                let requests: Vec<ImageRequest> = params[0].read().unwrap();
                let images: Vec<ImageResponse> = requests.iter().map(|request| self.image(&world, request)).collect();
                self.value(&images)
            }
            "enableApiControl" | "armDisarm" => {
                let on = flag();
                world.calls.push((format!("{method} {on}"), Vec::new()));
                if method == "armDisarm" {
                    world.armed = on;
                    return self.value(&true);
                }
                world.controlled = on;
                Some(Ok(Raw::nil()))
            }
            "takeoff" | "land" | "hover" | "moveByVelocityBodyFrame" => {
                let expected = params.last().unwrap().read::<String>().unwrap();
                assert!(expected.is_empty() || expected == "Drone2", "{expected}");
                let mut numbers = numbers;
                if method == "moveByVelocityBodyFrame" {
                    assert_eq!((params.len(), params[5].encoding()), (7, Some(self.encoding)));
                    let yaw: YawMode = params[5].read().unwrap();
                    assert!(yaw.is_rate);
                    numbers.push(yaw.yaw_or_rate);
                }
                world.calls.push((method.to_owned(), numbers.clone()));
                world.motion += 1;
                let (length, height) = Self::begin(&mut world, method, &numbers);
                self.waiting.push(Task { id, ends: world.now() + length, number: world.motion, height });
                None
            }
            _ => Some(Err(errors::unknown_method(method, params.len()))),
        }
    }

    /// Begins a motion: how long it takes, and the height that it ends at.
    fn begin(world: &mut World, method: &str, numbers: &[f64]) -> (Duration, Option<f64>) {
        (world.velocity, world.yaw_rate_deg) = ([0.0; 3], 0.0);
        match method {
            "takeoff" => (MANOEUVRE, Some(2.0)),
            "land" => (MANOEUVRE, Some(0.0)),
            "moveByVelocityBodyFrame" => {
                let (sin, cos) = world.yaw_deg.to_radians().sin_cos();
                let [ahead, right, down, duration, _, rate] = numbers else { panic!("{numbers:?}") };
                world.velocity = [ahead * cos - right * sin, ahead * sin + right * cos, *down];
                world.yaw_rate_deg = *rate;
                world.until = world.now() + Duration::from_secs_f64(*duration);
                (Duration::from_secs_f64(*duration), None)
            }
            _ => (Duration::ZERO, None),
        }
    }

    fn stamp(&self, world: &World) -> u64 {
        if world.faults.still {
            5
        } else {
            1_000_000_000_000 + world.now().saturating_duration_since(self.begun).as_nanos() as u64
        }
    }

    fn state(&self, world: &World) -> MultirotorState {
        let [x, y, z] = world.position;
        let position = if world.faults.nan { Vector3r::NAN } else { Vector3r::new(x, y, z) };
        let [north, east, down] = world.velocity;
        let kinematics_estimated = KinematicsState {
            position,
            orientation: turned(world.yaw_deg),
            linear_velocity: Vector3r::new(north, east, down),
            angular_velocity: Vector3r::new(0.0, 0.0, world.yaw_rate_deg.to_radians()),
            ..KinematicsState::default()
        };
        let more = self.encoding == Encoding::Array;
        MultirotorState {
            collision: CollisionInfo::default(),
            kinematics_estimated,
            gps_location: GeoPoint::default(),
            timestamp: self.stamp(world),
            landed_state: u8::from(!world.landed),
            rc_data: RcData::default(),
            ready: more.then_some(true),
            ready_message: more.then(String::new),
            can_arm: more.then_some(true),
        }
    }

    /// Blue on the left, red on the right; depth 5 m.
    fn image(&self, world: &World, request: &ImageRequest) -> ImageResponse {
        let (width, height) = if world.faults.no_image.is_some() { (0, 0) } else { SIZE };
        let pixels = (width * height) as usize;
        let is_depth = request.image_type == ImageType::DepthPlanar;
        let left = |i: usize| i % (SIZE.0 as usize) < SIZE.0 as usize / 2;
        let mut bytes: Vec<u8> = (0..pixels).flat_map(|i| if left(i) { [255, 0, 0] } else { [0, 0, 255] }).collect();
        if world.faults.short_image {
            bytes.pop();
        }
        ImageResponse {
            image_data_uint8: if is_depth { Vec::new() } else { bytes },
            image_data_float: if is_depth { vec![5.0; pixels] } else { Vec::new() },
            camera_position: Vector3r::default(),
            camera_name: request.camera_name.clone(),
            camera_orientation: turned(world.yaw_deg),
            time_stamp: self.stamp(world),
            message: world.faults.no_image.unwrap_or_default().to_owned(),
            pixels_as_float: request.pixels_as_float,
            compress: request.compress,
            width,
            height,
            image_type: request.image_type,
        }
    }
}

fn turned(yaw_deg: f64) -> Quaternionr {
    let half = 0.5 * yaw_deg.to_radians();
    Quaternionr { w_val: half.cos(), x_val: 0.0, y_val: 0.0, z_val: half.sin() }
}
