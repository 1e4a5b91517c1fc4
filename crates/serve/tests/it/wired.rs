//! The Tello's driver and the virtual Tello, connected in virtual time without sockets.

use std::collections::VecDeque;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};

use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::frame::{FrameId, FrameMeta, Unusable};
use spf_core::time::{Duration, Time};
use spf_drone::frames::Frames;
use spf_drone::frames::usable::why_unusable;
use spf_drone::tello::conversation::Order;
use spf_drone::tello::intake;
use spf_drone::tello::link::Link;
use spf_drone::tello::sticks::Calibration;
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;
use spf_flight::sim::{SimFrames, SimWorld};
use spf_media::Rgb;
use spf_motion::estimator::TelemetryAccuracy;
use spf_serve::fault::{CraftFault, FaultMachine, FaultPlan, Stream};
use spf_serve::tello::lens::disturb;
use spf_serve::tello::{Firmware, Output, ProtocolParameters, VirtualTello};
use spf_sim::frame_clock::FrameClock;

/// Faults after which an image shows nothing.
pub(crate) const CAMERA_FAULTS: [CraftFault; 3] = [CraftFault::LensCovered, CraftFault::VideoBlack, CraftFault::VideoUniform];

const STEP: Duration = Duration::from_millis(5);
/// Address of the drone, and of another machine in its network.
const DRONE: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 168, 10, 1));
const OTHER: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 168, 10, 7));
/// Answers that nobody was asked for.
const ANSWERS: [&[u8]; 6] = [b"ok", b"error", b"error Motor stop", b"0\r\n", b"\xff\xfe\0", b"out of range"];

/// Somebody who sends an answer, a state line and video to the driver's ports every 20 ms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stranger {
    /// When this begins.
    pub(crate) from: Time,
    /// Whether the drone's own address is forged.
    pub(crate) forges: bool,
}

/// The driver, the drone, and a virtual connection.
pub(crate) struct Wired {
    world: SimWorld,
    tello: VirtualTello,
    link: Link,
    now: Time,
    clock: FrameClock,
    frame: FrameId,
    /// An image of the scene, to which the faults of the camera are applied.
    image: Option<Rgb>,
    events: VecDeque<(Time, DroneEvent)>,
    /// When one of the driver's threads dies.
    pub(crate) thread_dies_at: Option<Time>,
    /// Who else sends datagrams.
    pub(crate) stranger: Option<Stranger>,
    /// The first and the newest state line of the drone, which the stranger repeats.
    heard: [Vec<u8>; 2],
    /// Every command to the drone, with its time.
    pub(crate) sent: Arc<Mutex<Vec<(Time, String)>>>,
}

impl Wired {
    /// A drone with these parameters, on the ground, in SDK mode soon.
    pub(crate) fn new(world: SimWorld, figures: ProtocolParameters, faults: FaultPlan) -> Self {
        let tello = {
            let craft = world.shared_craft();
            let craft = craft.lock().unwrap();
            let faults = FaultMachine::new(faults, 3).unwrap();
            VirtualTello::new(&craft, figures, Firmware::V20, faults, 3)
        };
        let mut link = Link::new(Calibration::default());
        link.order(Order::quick("command"));
        link.order(Order::quick("streamon"));
        let (now, frame, events) = (Time::ZERO, FrameId(0), VecDeque::new());
        Self {
            world,
            tello,
            link,
            now,
            clock: FrameClock::default(),
            frame,
            image: None,
            events,
            thread_dies_at: None,
            stranger: None,
            heard: Default::default(),
            sent: Arc::default(),
        }
    }

    fn client() -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], 40_000))
    }

    /// Why this frame is unusable, if the camera has a fault.
    fn show(&mut self, meta: FrameMeta) -> Option<Unusable> {
        let faults = self.tello.faults();
        if !CAMERA_FAULTS.iter().any(|&fault| faults.has_fault(meta.captured, fault)) {
            return None;
        }
        let mut image = match &self.image {
            Some(image) => image.clone(),
            None => (*SimFrames::new(self.world.clone()).photo(meta.id).unwrap().pixels()).clone(),
        };
        self.image.get_or_insert_with(|| image.clone());
        disturb(&mut image, faults, meta.captured);
        Some(why_unusable(&image).expect("a fault that shows nothing is seen"))
    }

    /// Passes a text on as the driver's threads do.
    fn hear(&mut self, from: IpAddr, text: &[u8], to: fn(&mut Link, Time, &[u8])) {
        if intake::accepts(from, DRONE, text.len(), intake::TEXT) {
            to(&mut self.link, self.now, text);
        }
    }

    /// Datagrams of a stranger: answers, state lines of a drone on the ground or with values changed, and images.
    fn disturb(&mut self, stranger: Stranger) {
        let turn = self.now.as_nanos() / STEP.as_nanos() as u64;
        if !turn.is_multiple_of(4) {
            return;
        }
        let turn = turn as usize / 4;
        let from = if stranger.forges { DRONE } else { OTHER };
        self.hear(from, ANSWERS[turn % ANSWERS.len()], Link::handle_answer);
        let newest = String::from_utf8_lossy(&self.heard[1]).into_owned();
        let line = match turn % 4 {
            0 => self.heard[0].clone(),
            1 => newest.replace("bat:", "bat:1;old:").into_bytes(),
            2 => newest.replace("vgx:", "vgx:99;old:").into_bytes(),
            _ => vec![b'x'; 2 * intake::TEXT],
        };
        self.hear(from, &line, Link::handle_state);
        if !stranger.forges && intake::accepts(from, DRONE, intake::VIDEO, intake::VIDEO) {
            // What becomes of forged video depends on the decoder, which is not part of this connection.
            let camera = *self.world.camera();
            let meta = self.clock.meta(self.frame, camera.width, camera.height);
            let meta = FrameMeta { captured: self.now, received: self.now, unusable: Some(Unusable::Undecodable), ..meta };
            self.events.push_back((self.now, DroneEvent::Frame(meta)));
        }
    }

    fn step(&mut self) {
        if self.thread_dies_at.take_if(|at| *at <= self.now).is_some() {
            self.link.fail(self.now);
        }
        while let Some(text) = self.link.poll(self.now) {
            self.sent.lock().unwrap().push((self.now, text.clone()));
            self.tello.handle(self.now, Self::client(), text.as_bytes());
        }
        self.now += STEP;
        let craft = self.world.shared_craft();
        self.tello.advance(self.now, &mut craft.lock().unwrap());
        while let Some(output) = self.tello.poll(self.now) {
            match output {
                Output::Response { bytes, .. } => self.hear(DRONE, &bytes, Link::handle_answer),
                Output::State { bytes, .. } => {
                    self.hear(DRONE, &bytes, Link::handle_state);
                    if self.heard[0].is_empty() {
                        self.heard[0].clone_from(&bytes);
                    }
                    self.heard[1] = bytes;
                }
            }
        }
        if let Some(stranger) = self.stranger.filter(|stranger| self.now >= stranger.from) {
            self.disturb(stranger);
        }
        while let Some(event) = self.link.take_event() {
            self.events.push_back(event);
        }
        let camera = *self.world.camera();
        let meta = self.clock.meta(self.frame, camera.width, camera.height);
        if meta.received <= self.now {
            self.frame = FrameId(self.frame.0 + 1);
            let faults = self.tello.faults();
            let lost =
                faults.has_fault(self.now, CraftFault::LinkCut) || faults.pass(self.now, Stream::Frames, meta.id.0).is_empty();
            let frozen = faults.freezes(self.now, Stream::Frames);
            let unusable = self.show(meta);
            let capture_counter = if frozen { 0 } else { meta.capture_counter };
            if !lost {
                self.events.push_back((self.now, DroneEvent::Frame(FrameMeta { capture_counter, unusable, ..meta })));
            }
        }
    }
}

impl Drop for Wired {
    /// As in the driver: urgent commands are still sent.
    fn drop(&mut self) {
        while self.link.is_urgent() {
            self.step();
        }
    }
}

impl Drone for Wired {
    fn name(&self) -> &str {
        "tello"
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { manoeuvres: true, ..Capabilities::of(Craft::tello(), *self.world.camera(), TelemetryAccuracy::tello()) }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(SimFrames::new(self.world.clone()))
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        self.link.heartbeat(now);
        self.link.apply(now, command);
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.link.heartbeat(self.now);
        while self.events.is_empty() && self.now + STEP <= until {
            self.step();
        }
        self.events.pop_front()
    }

    fn next_event_at(&self) -> Option<Time> {
        Some(if self.events.is_empty() { self.now + STEP } else { self.now })
    }
}
