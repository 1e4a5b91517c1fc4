//! The calls that the driver makes, for one vehicle, in the dialect of its simulator.

use std::time::Duration;

use serde::de::DeserializeOwned;

use super::address::Address;
use super::control::{NUMBERS, Request, VALID};
use super::rpc::{Numbered, Rpc, RpcError};
use super::wire::structs::{CameraInfo, CollisionInfo, ImageRequest, ImageResponse, MultirotorState, YawMode};
use super::wire::{Encoding, Raw};

/// How long an answer of a call that does nothing but tell may take.
const WAIT: Duration = Duration::from_secs(2);
/// The same for images: the simulator may load or compile what it shows.
const IMAGE_WAIT: Duration = Duration::from_secs(10);
/// Time that the simulator allows for a take-off and a landing, s, after which it answers `false`.
const TAKE_OFF_TIME: f64 = 20.0;
const LANDING_TIME: f64 = 60.0;

/// The first number of calls that mark what was sent before them: none of the numbers of the flight's calls.
pub(super) const MARK: u32 = NUMBERS;

/// One connection, for one vehicle.
pub(super) struct Session {
    rpc: Rpc,
    encoding: Encoding,
    vehicle: String,
}

impl Session {
    /// Connects; structs are written as in this encoding.
    pub(super) fn open(address: &Address, encoding: Encoding) -> Result<Self, RpcError> {
        Ok(Self { rpc: Rpc::connect(address)?, encoding, vehicle: address.vehicle.clone() })
    }

    /// The encoding that the simulator was found to speak.
    pub(super) fn speak(&mut self, encoding: Encoding) {
        self.encoding = encoding;
    }

    fn ask<T: DeserializeOwned>(&mut self, method: &'static str, params: Vec<Raw>, wait: Duration) -> Result<T, RpcError> {
        let answer = self.rpc.call(method, params, wait)?;
        answer.read().map_err(|source| RpcError::Unreadable { method, source })
    }

    fn value<T: serde::Serialize + ?Sized>(&self, value: &T) -> Raw {
        Raw::of(value, self.encoding)
    }

    fn name(&self) -> Raw {
        self.value(&self.vehicle)
    }

    /// Whether it answers.
    pub(super) fn ping(&mut self) -> Result<(), RpcError> {
        self.rpc.call("ping", Vec::new(), WAIT).map(drop)
    }

    /// The version of its interface.
    pub(super) fn version(&mut self) -> Result<i64, RpcError> {
        self.ask("getServerVersion", Vec::new(), WAIT)
    }

    /// The names of its vehicles.
    pub(super) fn vehicles(&mut self) -> Result<Vec<String>, RpcError> {
        self.ask("listVehicles", Vec::new(), WAIT)
    }

    /// Its settings, JSON.
    pub(super) fn settings(&mut self) -> Result<String, RpcError> {
        self.ask("getSettingsString", Vec::new(), WAIT)
    }

    /// The state of the vehicle, and how its structs are written.
    pub(super) fn state(&mut self) -> Result<(MultirotorState, Encoding), RpcError> {
        let method = "getMultirotorState";
        let answer = self.rpc.call(method, vec![self.name()], WAIT)?;
        let state = answer.read().map_err(|source| RpcError::Unreadable { method, source })?;
        Ok((state, answer.encoding().unwrap_or_default()))
    }

    /// Its collisions since this was asked last.
    pub(super) fn collision(&mut self) -> Result<CollisionInfo, RpcError> {
        self.ask("simGetCollisionInfo", vec![self.name()], WAIT)
    }

    /// Whether a program has its control.
    pub(super) fn is_controlled(&mut self) -> Result<bool, RpcError> {
        self.ask("isApiControlEnabled", vec![self.name()], WAIT)
    }

    /// Where a camera is and how wide it sees.
    pub(super) fn camera(&mut self, camera: &str) -> Result<CameraInfo, RpcError> {
        let params = vec![self.value(camera), self.name(), self.value(&false)];
        self.ask("simGetCameraInfo", params, WAIT)
    }

    /// Pictures of its cameras, in the order of the requests.
    pub(super) fn images(&mut self, requests: &[ImageRequest]) -> Result<Vec<ImageResponse>, RpcError> {
        let params = vec![self.value(requests), self.name(), self.value(&false)];
        self.ask("simGetImages", params, IMAGE_WAIT)
    }

    /// Stops or continues the simulator's time.
    pub(super) fn pause(&mut self, paused: bool) -> Result<(), RpcError> {
        self.rpc.call("simPause", vec![self.value(&paused)], WAIT).map(drop)
    }

    /// Lets the simulator's time run for this many seconds; it is paused before and after.
    pub(super) fn run_for(&mut self, seconds: f64) -> Result<(), RpcError> {
        self.rpc.call("simContinueForTime", vec![self.value(&seconds)], IMAGE_WAIT).map(drop)
    }

    /// Sends a call of the flight; [`answer`](Self::answer) returns what becomes of it.
    pub(super) fn send(&mut self, number: u32, request: Request) -> Result<(), RpcError> {
        let name = self.name();
        let (method, params) = match request {
            Request::Control(take) => ("enableApiControl", vec![self.value(&take), name]),
            Request::Arm(arm) => ("armDisarm", vec![self.value(&arm), name]),
            Request::TakeOff => ("takeoff", vec![self.value(&TAKE_OFF_TIME), name]),
            Request::Land => ("land", vec![self.value(&LANDING_TIME), name]),
            Request::Hover => ("hover", vec![name]),
            Request::Fly([forward, right, down, yaw_rate]) => {
                let mut params: Vec<Raw> = [forward, right, down, VALID].iter().map(|number| self.value(number)).collect();
                // The craft's heading does not follow its way (drivetrain 0), but turns at a rate.
                let yaw = YawMode { is_rate: true, yaw_or_rate: yaw_rate };
                params.extend([self.value(&0), self.value(&yaw), name]);
                ("moveByVelocityBodyFrame", params)
            }
        };
        self.rpc.send(number, method, params)
    }

    /// Sends a call that is answered at once, with this number, from [`MARK`] on.
    pub(super) fn mark(&mut self, number: u32) -> Result<(), RpcError> {
        self.rpc.send(number, "ping", Vec::new())
    }

    /// The next answer to a call that was [sent](Self::send), within `wait`: its number, and `false` or an error's text if it did not
    /// end as it should.
    pub(super) fn answer(&mut self, wait: Duration) -> Result<Option<Numbered<bool, String>>, RpcError> {
        let Some((number, outcome)) = self.rpc.receive(wait)? else { return Ok(None) };
        let answer = match outcome {
            // Some answer with nothing.
            Ok(result) if result.is_nil() => Ok(true),
            Ok(result) => result.read().map_err(|error| error.to_string()),
            Err(error) => Err(error.text()),
        };
        Ok(Some((number, answer)))
    }
}
