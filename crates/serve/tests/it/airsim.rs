//! AirSim's calls over a socket, byte by byte as its clients send them. Time stands still but for what a test lets run, so nothing
//! depends on how fast the machine is.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use spf_core::rng::RandomStream;
use spf_drone::airsim::wire::structs::{
    CameraInfo, CollisionInfo, DistanceSensorData, ImageRequest, ImageResponse, ImageType, ImuData, KinematicsState,
    MultirotorState, Pose, Quaternionr, Vector3r, YawMode,
};
use spf_drone::airsim::wire::{Decoder, Encoding, Limits, Message, NO_TIMEOUT, Raw};
use spf_flight::sim::LoadedScene;
use spf_serve::airsim::{AirSimPlan, AirSimServer, Settings};

/// Longer than any answer takes, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(300);

fn served(settings: &str) -> AirSimServer {
    static CITY: OnceLock<Arc<LoadedScene>> = OnceLock::new();
    let plan = AirSimPlan {
        loaded: CITY.get_or_init(|| Arc::new(LoadedScene::load("city").unwrap())).clone(),
        settings: Settings::parse(settings).unwrap(),
        listen: "127.0.0.1:0".parse().unwrap(),
        seed: 1,
        paused: true,
    };
    AirSimServer::start(plan).unwrap()
}

struct Client {
    stream: TcpStream,
    decoder: Decoder,
    next: u32,
    early: Vec<(u32, Result<Raw, Raw>)>,
    encoding: Encoding,
}

impl Client {
    fn of(server: &AirSimServer) -> Self {
        let stream = TcpStream::connect(server.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        Self { stream, decoder: Decoder::new(Limits::RESPONSES), next: 0, early: Vec::new(), encoding: Encoding::Map }
    }

    fn send(&mut self, method: &str, params: &[Raw]) -> u32 {
        self.next += 1;
        self.stream.write_all(&Message::request(self.next, method, params.to_vec()).encode()).unwrap();
        self.next
    }

    fn read(&mut self) -> (u32, Result<Raw, Raw>) {
        loop {
            if let Some(message) = self.decoder.next_message().unwrap() {
                let Message::Response { id, outcome } = message else { panic!("{message:?}") };
                return (id, outcome);
            }
            let mut bytes = [0; 1 << 16];
            let count = self.stream.read(&mut bytes).unwrap();
            assert!(count > 0, "the server has hung up");
            self.decoder.push(&bytes[..count]);
        }
    }

    /// The answer to a request, others are kept.
    fn wait(&mut self, id: u32) -> Result<Raw, String> {
        if let Some(place) = self.early.iter().position(|(of, _)| *of == id) {
            return self.early.remove(place).1.map_err(|error| error.text());
        }
        loop {
            let (of, outcome) = self.read();
            if of == id {
                return outcome.map_err(|error| error.text());
            }
            self.early.push((of, outcome));
        }
    }

    fn call(&mut self, method: &str, params: &[Raw]) -> Result<Raw, String> {
        let id = self.send(method, params);
        self.wait(id)
    }

    /// A call that succeeds.
    fn ok<T: for<'a> serde::Deserialize<'a>>(&mut self, method: &str, params: &[Raw]) -> T {
        self.call(method, params).unwrap_or_else(|error| panic!("{method}: {error}")).read().unwrap()
    }

    fn done(&mut self, method: &str, params: &[Raw]) {
        assert!(self.call(method, params).unwrap().is_nil(), "{method} returns nothing");
    }

    /// A motion, run to its end in simulated time; its result, and how long it took, s.
    fn flown(&mut self, method: &str, params: &[Raw]) -> (bool, f64) {
        let began = self.state().timestamp;
        let id = self.send(method, params);
        for _ in 0..2000 {
            self.done("simContinueForTime", &[it(0.1)]);
            if let Some(place) = self.early.iter().position(|(of, _)| *of == id) {
                let result = self.early.remove(place).1.unwrap().read().unwrap();
                return (result, (self.state().timestamp - began) as f64 * 1e-9);
            }
        }
        panic!("{method} does not end within 200 s");
    }

    fn state(&mut self) -> MultirotorState {
        self.ok("getMultirotorState", &[it("")])
    }

    fn position(&mut self) -> Vector3r {
        self.state().kinematics_estimated.position
    }

    fn ready(&mut self) {
        self.done("enableApiControl", &[it(true), it("")]);
        assert!(self.ok::<bool>("armDisarm", &[it(true), it("")]));
        assert!(self.flown("takeoff", &[it(20), it("")]).0);
    }

    fn yaw(&self, is_rate: bool, yaw_or_rate: f64) -> Raw {
        Raw::of(&YawMode { is_rate, yaw_or_rate }, self.encoding)
    }
}

fn it<T: serde::Serialize>(value: T) -> Raw {
    Raw::of(&value, Encoding::Map)
}

fn near(a: Vector3r, b: Vector3r, within: f64) -> bool {
    (a.x_val - b.x_val).abs() < within && (a.y_val - b.y_val).abs() < within && (a.z_val - b.z_val).abs() < within
}

#[test]
fn what_a_client_asks_at_the_start_is_answered_to_the_byte() {
    let server = served("{}");
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    for (asked, answered) in [
        (&b"\x94\x00\x00\xa4ping\x90"[..], &b"\x94\x01\x00\xc0\xc3"[..]),
        (b"\x94\x00\x01\xb0getServerVersion\x90", b"\x94\x01\x01\xc0\x01"),
        (b"\x94\x00\x03\xb0enableApiControl\x92\xc3\xa0", b"\x94\x01\x03\xc0\xc0"),
        (b"\x94\x00\x04\xb3isApiControlEnabled\x91\xa0", b"\x94\x01\x04\xc0\xc3"),
    ] {
        // In pieces, as a slow network delivers it.
        for piece in asked.chunks(3) {
            stream.write_all(piece).unwrap();
        }
        let mut read = vec![0; answered.len()];
        stream.read_exact(&mut read).unwrap();
        assert_eq!(read, answered, "{asked:?}");
    }
}

#[test]
fn a_craft_takes_off_flies_a_box_and_lands() {
    let server = served("{}");
    let mut client = Client::of(&server);
    assert_eq!(client.state().landed_state, 0);
    client.ready();
    let state = client.state();
    assert_eq!(state.landed_state, 1);
    assert!((state.kinematics_estimated.position.z_val + 2.0).abs() < 0.1, "{state:?}");
    for (x, y) in [(3.0, 0.0), (3.0, 3.0), (0.0, 0.0)] {
        let free = client.yaw(true, 0.0);
        let to = [it(x), it(y), it(-3), it(2), it(NO_TIMEOUT), it(0), free, it(-1), it(1), it("")];
        assert!(client.flown("moveToPosition", &to).0);
        let at = client.position();
        assert!(near(at, Vector3r::new(x, y, -3.0), 0.5), "{at:?}");
    }
    let (landed, took) = client.flown("land", &[it(60), it("")]);
    assert!(landed && (10.0..25.0).contains(&took), "3 m at 0.2 m/s: {took}");
    assert_eq!(client.state().landed_state, 0);
}

#[test]
fn a_new_motion_cancels_the_one_under_way_which_returns_false() {
    let server = served("{}");
    let mut client = Client::of(&server);
    client.ready();
    let first = client.send("hover", &[it("")]);
    client.done("simContinueForTime", &[it(1)]);
    assert!(client.wait(first).unwrap().read::<bool>().unwrap());
    let velocity =
        |client: &Client, x: f64, seconds: f64| [it(x), it(0), it(0), it(seconds), it(0), client.yaw(true, 0.0), it("")];
    let params = velocity(&client, 1.0, 50.0);
    let long = client.send("moveByVelocity", &params);
    client.done("simContinueForTime", &[it(2)]);
    let params = velocity(&client, 0.0, 0.1);
    let short = client.send("moveByVelocity", &params);
    assert!(!client.wait(long).unwrap().read::<bool>().unwrap());
    // By another connection, too.
    client.done("simContinueForTime", &[it(1)]);
    assert!(client.wait(short).unwrap().read::<bool>().unwrap());
    let params = velocity(&client, 1.0, 50.0);
    let long = client.send("moveByVelocity", &params);
    // Answered on the same connection while that is under way.
    assert!(client.ok::<bool>("ping", &[]));
    Client::of(&server).done("cancelLastTask", &[it("")]);
    assert!(!client.wait(long).unwrap().read::<bool>().unwrap());
}

#[test]
fn a_velocity_of_the_body_is_turned_once_by_the_heading_at_the_call() {
    let server = served(r#"{"Vehicles": {"D": {"Yaw": 90}}}"#);
    let mut client = Client::of(&server);
    client.ready();
    let before = client.position();
    let turning = client.yaw(true, 45.0);
    assert!(client.flown("moveByVelocityBodyFrame", &[it(1), it(0), it(0), it(4), it(0), turning, it("D")]).0);
    let after = client.position();
    assert!(after.y_val - before.y_val > 2.5 && (after.x_val - before.x_val).abs() < 0.7, "{before:?} {after:?}");
    let turned = client.flown("rotateToYaw", &[it(-170), it(30), it(5), it("")]);
    assert!(turned.0, "{turned:?}");
    let q = client.state().kinematics_estimated.orientation;
    let yaw = 2.0 * q.z_val.atan2(q.w_val).to_degrees();
    let off = (yaw + 170.0).rem_euclid(360.0);
    assert!(!(6.0..=354.0).contains(&off), "{yaw}");
}

#[test]
fn errors_are_worded_as_rpclib_words_them() {
    let server = served("{}");
    let mut client = Client::of(&server);
    let error = client.call("flyToTheMoon", &[it(1)]).unwrap_err();
    assert_eq!(error, "rpclib: server could not find function 'flyToTheMoon' with argument count 1.");
    let error = client.call("ping", &[it(1)]).unwrap_err();
    assert_eq!(error, "rpclib: Function 'ping' was called with an invalid number of arguments. Expected: 0, got: 1");
    let error = client.call("getMultirotorState", &[it("nobody")]).unwrap_err();
    let begins = "rpclib: function 'getMultirotorState' (called with 1 arg(s)) threw an exception.";
    assert!(error.starts_with(begins) && error.contains("nobody"), "{error}");
    // Without API control, nothing moves and nothing is thrown.
    assert!(!client.flown("takeoff", &[it(20), it("")]).0);
    assert_eq!(client.state().landed_state, 0);
    let error = client.call("getLidarData", &[it(""), it("")]).unwrap_err();
    assert!(error.contains("no lidar"), "{error}");
}

fn request(camera: &str, image_type: ImageType, pixels_as_float: bool, compress: bool) -> ImageRequest {
    ImageRequest { camera_name: camera.to_owned(), image_type, pixels_as_float, compress }
}

#[test]
fn pictures_come_in_three_encodings() {
    let settings = r#"{"CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 64, "Height": 48, "FOV_Degrees": 90}]}}"#;
    let server = served(settings);
    let mut client = Client::of(&server);
    let requests = [
        request("0", ImageType::Scene, false, true),
        request("front_center", ImageType::Scene, false, false),
        request("", ImageType::DepthPlanar, true, false),
        request("0", ImageType::DepthPerspective, true, false),
        request("0", ImageType::DepthVis, false, false),
        request("0", ImageType::Segmentation, false, false),
        request("0", ImageType::OpticalFlow, false, true),
    ];
    let all: Vec<ImageResponse> = client.ok("simGetImages", &[it(&requests), it(""), it(false)]);
    let [png, bgr, planar, ray, vis, ids, flow] = &all[..] else { panic!("{}", all.len()) };
    let (size, rgb) = {
        let decoded = spf_media::jpeg::decode_any(&png.image_data_uint8);
        let image = decoded.expect("a PNG");
        ((image.width(), image.height()), image.into_data())
    };
    assert_eq!(size, (64, 48));
    let swapped: Vec<u8> = rgb.chunks(3).flat_map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect();
    assert_eq!(swapped, bgr.image_data_uint8, "blue, green, red");
    assert_eq!((planar.image_data_float.len(), planar.image_data_uint8.len()), (64 * 48, 0));
    // At the corner, the ray is longer by the root of 1 + 1² + 0.75², less half a pixel.
    let ratio = ray.image_data_float[64 * 47] / planar.image_data_float[64 * 47];
    assert!((f64::from(ratio) - f64::sqrt(1.0 + (63.0_f64 / 64.0).powi(2) + (47.0_f64 / 64.0).powi(2))).abs() < 1e-3, "{ratio}");
    let expected = (planar.image_data_float[64 * 47] / 100.0 * 255.0).clamp(0.0, 255.0).round() as u8;
    assert_eq!(vis.image_data_uint8[3 * 64 * 47], expected);
    assert_eq!(ids.image_data_uint8.len(), 64 * 48 * 3);
    assert_eq!((flow.width, flow.height, flow.image_data_uint8.len()), (0, 0, 0));
    assert!(flow.message.contains("not simulated"), "{}", flow.message);
    assert!(client.call("simGetImages", &[it([request("nowhere", ImageType::Scene, false, true)]), it(""), it(false)]).is_err());
    // Everything with one number is one colour, that of the table.
    assert!(client.ok::<bool>("simSetSegmentationObjectID", &[it(".*"), it(3), it(true)]));
    let [ids] = &client.ok::<Vec<ImageResponse>>("simGetImages", &[it([requests[5].clone()]), it(""), it(false)])[..] else {
        panic!()
    };
    let colours: std::collections::BTreeSet<_> = ids.image_data_uint8.chunks(3).map(<[u8]>::to_vec).collect();
    assert!(colours.is_subset(&[vec![72, 121, 89], vec![0, 0, 0]].into()) && colours.contains(&vec![72, 121, 89]), "{colours:?}");
    let info: CameraInfo = client.ok("simGetCameraInfo", &[it("0"), it(""), it(false)]);
    assert_eq!(info.fov, 90.0);
}

#[test]
fn time_stands_still_but_for_what_is_asked_for() {
    let server = served("{}");
    let mut client = Client::of(&server);
    assert!(client.ok::<bool>("simIsPaused", &[]));
    let before = client.state().timestamp;
    assert_eq!(client.state().timestamp, before);
    client.done("simContinueForTime", &[it(0.5)]);
    assert_eq!(client.state().timestamp - before, 500_000_000);
    client.done("simContinueForFrames", &[it(2)]);
    assert_eq!(client.state().timestamp - before, 540_000_000);
    assert!(client.ok::<bool>("simIsPaused", &[]));
    client.done("simPause", &[it(false)]);
    while client.state().timestamp - before < 600_000_000 {}
}

#[test]
fn poses_are_set_kept_where_nan_and_undone_by_reset() {
    let server = served("{}");
    let mut client = Client::of(&server);
    let there = Pose { position: Vector3r::new(1.0, f64::NAN, -20.0), orientation: Quaternionr::NAN };
    client.done("simSetVehiclePose", &[it(there), it(true), it("")]);
    let pose: Pose = client.ok("simGetVehiclePose", &[it("")]);
    assert!(near(pose.position, Vector3r::new(1.0, 0.0, -20.0), 1e-6), "{pose:?}");
    let imu: ImuData = client.ok("getImuData", &[it(""), it("")]);
    assert!((imu.linear_acceleration.z_val + 9.8).abs() < 0.1, "{imu:?}");
    // Down through the ground: stopped by it, and noted once.
    let below = Pose { position: Vector3r::new(1.0, 0.0, 30.0), orientation: pose.orientation };
    client.done("simSetVehiclePose", &[it(below), it(false), it("")]);
    let hit: CollisionInfo = client.ok("simGetCollisionInfo", &[it("")]);
    assert!(hit.has_collided && !hit.object_name.is_empty(), "{hit:?}");
    assert!(!client.ok::<CollisionInfo>("simGetCollisionInfo", &[it("")]).has_collided, "reading it clears it");
    client.done("reset", &[]);
    let state = client.state();
    assert!(near(state.kinematics_estimated.position, Vector3r::default(), 1e-6) && state.landed_state == 0, "{state:?}");
    assert!(!client.ok::<bool>("isApiControlEnabled", &[it("")]));
    let nobody: Pose = client.ok("simGetObjectPose", &[it("nobody")]);
    assert!(nobody.position.x_val.is_nan());
    let names: Vec<String> = client.ok("simListSceneObjects", &[it(".*")]);
    let first: Pose = client.ok("simGetObjectPose", &[it(&names[0])]);
    assert!(first.position.x_val.is_finite());
    let down: DistanceSensorData = client.ok("getDistanceSensorData", &[it(""), it("")]);
    assert!((down.min_distance..=down.max_distance).contains(&down.distance), "{down:?}");
}

#[test]
fn who_sends_arrays_gets_arrays_of_colosseum() {
    let server = served("{}");
    let mut client = Client::of(&server);
    let state = client.call("getMultirotorState", &[it("")]).unwrap();
    assert_eq!(state.encoding(), Some(Encoding::Map));
    client.encoding = Encoding::Array;
    let free = client.yaw(true, 0.0);
    let id = client.send("moveByVelocity", &[it(0), it(0), it(0), it(0), it(0), free, it("")]);
    drop(client.wait(id));
    let state = client.call("getMultirotorState", &[it("")]).unwrap();
    assert_eq!(state.items().map(|items| items.len()), Some(9));
    // Another connection is asked by itself.
    assert_eq!(Client::of(&server).call("getMultirotorState", &[it("")]).unwrap().encoding(), Some(Encoding::Map));
}

#[test]
fn a_vehicle_without_physics_stays_where_it_is_put() {
    let server = served(r#"{"SimMode": "ComputerVision"}"#);
    let mut client = Client::of(&server);
    let tilted = Quaternionr { w_val: 0.9, x_val: 0.3, y_val: 0.3, z_val: 0.1 };
    let state = KinematicsState { position: Vector3r::new(2.0, 3.0, -9.0), orientation: tilted, ..KinematicsState::default() };
    client.done("simSetKinematics", &[it(state), it(true), it("")]);
    client.done("simContinueForTime", &[it(3)]);
    let now: KinematicsState = client.ok("simGetGroundTruthKinematics", &[it("")]);
    assert!(near(now.position, state.position, 1e-9), "{now:?}");
    assert!((now.orientation.w_val - 0.9).abs() < 1e-6 && (now.orientation.x_val - 0.3).abs() < 1e-6, "{now:?}");
}

#[test]
fn a_thousand_calls_of_any_kind_leave_the_server_in_order() {
    const METHODS: &[&str] = &[
        "ping",
        "reset",
        "enableApiControl",
        "armDisarm",
        "takeoff",
        "land",
        "goHome",
        "hover",
        "moveByVelocity",
        "moveByVelocityZ",
        "moveByVelocityBodyFrame",
        "moveToPosition",
        "moveOnPath",
        "moveToZ",
        "moveToGPS",
        "rotateToYaw",
        "rotateByYawRate",
        "cancelLastTask",
        "getMultirotorState",
        "simGetVehiclePose",
        "simSetVehiclePose",
        "simSetKinematics",
        "simGetImages",
        "simGetImage",
        "simGetCameraInfo",
        "simSetCameraPose",
        "simSetCameraFov",
        "simSetWind",
        "simListSceneObjects",
        "simGetObjectPose",
        "simSetSegmentationObjectID",
        "simPause",
        "simContinueForTime",
        "simContinueForFrames",
        "getImuData",
        "getDistanceSensorData",
        "getGpsData",
        "simTestLineOfSightToPoint",
        "simSpawnObject",
        "nothing",
    ];
    let settings = r#"{"CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 8, "Height": 6}]}}"#;
    let server = served(settings);
    let mut client = Client::of(&server);
    let mut random = RandomStream::new(59, "calls", &[]);
    let mut below = |most: usize| ((random.uniform() * most as f64) as usize).min(most - 1);
    for _ in 0..1000 {
        let method = METHODS[below(METHODS.len())];
        let count = below(11);
        let mut params = Vec::new();
        for _ in 0..count {
            params.push(match below(12) {
                0 => it(true),
                1 => it([0.0, 1.0, -3.5, 1e300, f64::NAN, f64::INFINITY, NO_TIMEOUT][below(7)]),
                2 => it([0, 1, -1, 255, i64::MAX, i64::MIN][below(6)]),
                3 | 4 => it(""),
                5 => it(["0", "front_center", "(", ".*", "nobody"][below(5)]),
                6 => it(Pose { position: Vector3r::new(below(50) as f64, -3.0, -9.0), ..Pose::default() }),
                7 => it(YawMode { is_rate: below(2) == 0, yaw_or_rate: 1e3 }),
                8 => it(Vector3r::NAN),
                9 => it(vec![Vector3r::new(1.0, 2.0, -3.0); below(4)]),
                10 => it([request("0", ImageType::ALL[below(10)], below(2) == 0, below(2) == 0)]),
                _ => Raw::nil(),
            });
        }
        client.send(method, &params);
    }
    // Whatever is still under way ends.
    let mut other = Client::of(&server);
    other.done("cancelLastTask", &[it("")]);
    other.done("simPause", &[it(true)]);
    other.done("reset", &[]);
    let last = client.send("ping", &[]);
    assert!(client.wait(last).unwrap().read::<bool>().unwrap());
    let mut answered: Vec<u32> = client.early.iter().map(|(id, _)| *id).collect();
    // What was started last is cancelled once more, by now that all have been taken.
    other.done("cancelLastTask", &[it("")]);
    other.done("simPause", &[it(true)]);
    while answered.len() < 1000 {
        answered.push(client.read().0);
    }
    answered.sort_unstable();
    assert_eq!(answered, (1..=1000).collect::<Vec<_>>(), "each is answered once");
    other.ready();
}

#[test]
fn who_speaks_another_protocol_is_disconnected_and_nobody_else() {
    let server = served("{}");
    let mut client = Client::of(&server);
    let mut stranger = TcpStream::connect(server.address()).unwrap();
    stranger.set_read_timeout(Some(PATIENCE)).unwrap();
    stranger.write_all(b"GET / HTTP/1.1\r\n\r\n").unwrap();
    // Closed, or reset with what it has sent still unread.
    assert!(!matches!(stranger.read(&mut [0; 10]), Ok(1..)));
    assert!(client.ok::<bool>("ping", &[]));
}
