//! Any bytes as what a client or a server of AirSim sends: read or refused, never a panic, and never more kept than allowed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_drone::airsim::wire::structs::{
    CameraInfo, CollisionInfo, ImageRequest, ImageResponse, KinematicsState, LidarData, MultirotorState, Pose, Vector3r, YawMode,
};
use spf_drone::airsim::wire::{Decoder, Limits, Message, Raw};

fuzz_target!(|bytes: &[u8]| {
    // The first byte sets the length of what arrives at once.
    let length = bytes.first().map_or(1, |byte| 1 + usize::from(*byte));
    for limits in [Limits::REQUESTS, Limits { bytes: 200, objects: 20, depth: 3 }] {
        let mut decoder = Decoder::new(limits);
        for piece in bytes.get(1..).unwrap_or_default().chunks(length) {
            decoder.push(piece);
            while let Ok(Some(message)) = decoder.next_message() {
                assert!(message.encode().len() <= limits.bytes + 16, "no message is longer than the limit");
                match message {
                    Message::Request { params, .. } | Message::Notification { params, .. } => params.iter().for_each(read),
                    Message::Response { outcome: Ok(it) | Err(it), .. } => read(&it),
                }
            }
        }
    }
});

fn read(object: &Raw) {
    let _ = (object.text(), object.encoding(), object.read::<f64>(), object.read::<bool>(), object.read::<String>());
    let _ = (object.read::<Vector3r>(), object.read::<Pose>(), object.read::<YawMode>(), object.read::<Vec<Vector3r>>());
    let _ = (object.read::<ImageRequest>(), object.read::<Vec<ImageResponse>>(), object.read::<CameraInfo>());
    let _ = (object.read::<MultirotorState>(), object.read::<KinematicsState>(), object.read::<CollisionInfo>());
    let _ = object.read::<LidarData>();
    object.items().unwrap_or_default().iter().for_each(read);
}
