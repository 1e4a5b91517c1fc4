mod brake;
mod failings;
mod flights;
mod limits;
mod manoeuvres;
mod person;
mod rows;

use self::flights::Body;
use super::*;
use crate::geofence::Geofence;
use spf_core::command::Manoeuvre;
use spf_core::frame::FrameId;
use spf_core::geometry::{Attitude, BodyDisplacement};
use spf_core::time::Duration;

/// An envelope around a craft that hovers 3 m above its take-off point, facing north, with everything fresh.
struct Rig {
    envelope: Envelope,
    telemetry: Telemetry,
    frames: u64,
}

impl Rig {
    fn flying(limits: Limits) -> Self {
        let mut rig = Self { envelope: Envelope::new(limits, Craft::quad()), telemetry: Telemetry::default(), frames: 0 };
        rig.telemetry = Telemetry {
            position: Some(EnuPosition::default()),
            velocity: Some(EnuVelocity::default()),
            height: Some(0.0),
            battery: Some(0.9),
            attitude: Attitude::default(),
            ..Telemetry::default()
        };
        rig.tell(ms(0));
        rig.telemetry.phase = FlightPhase::Flying;
        rig.place(0.0, 0.0, 3.0);
        rig.fresh(ms(1000));
        rig
    }

    /// Around another craft, which flies above its take-off point.
    fn airborne(limits: Limits, craft: Craft) -> Self {
        let mut rig = Self::flying(limits.clone());
        rig.envelope = Envelope::new(limits, craft);
        rig.telemetry.phase = FlightPhase::OnGround;
        rig.place(0.0, 0.0, 0.0);
        rig.tell(ms(1));
        rig.telemetry.phase = FlightPhase::Flying;
        rig
    }

    fn place(&mut self, east: f64, north: f64, up: f64) {
        self.telemetry.position = Some(EnuPosition { east, north, up });
        self.telemetry.height = Some(up);
    }

    fn tell(&mut self, now: Time) {
        self.telemetry.time = now;
        self.envelope.observe_telemetry(now, &self.telemetry);
    }

    fn frame(&mut self, now: Time) -> FrameMeta {
        self.frames += 1;
        FrameMeta {
            id: FrameId(self.frames),
            captured: now,
            received: now,
            capture_counter: self.frames,
            width: 960,
            height: 720,
            unusable: None,
        }
    }

    fn see(&mut self, now: Time) {
        let frame = self.frame(now);
        self.envelope.observe_frame(now, &frame);
    }

    /// New telemetry and a new frame.
    fn fresh(&mut self, now: Time) {
        self.tell(now);
        self.see(now);
    }

    /// Telemetry of a body, which then gets the setpoint as cleared.
    fn steer(&mut self, now: Time, body: &mut Body, asked: Setpoint) {
        self.telemetry.position = Some(body.at);
        self.telemetry.height = Some(body.at.up);
        self.telemetry.velocity = Some(body.v);
        self.telemetry.attitude.heading = body.heading;
        self.fresh(now);
        let clearance = self.envelope.clear_setpoint(now, asked);
        body.sent.push((now, clearance.setpoint().unwrap(), clearance.cleared.valid_until()));
        // What was sent longer ago has expired.
        let old = body.sent.len().saturating_sub(20);
        body.sent.drain(..old);
    }

    fn ask(&mut self, now: Time, setpoint: Setpoint) -> (Setpoint, Option<Cause>) {
        let clearance = self.envelope.clear_setpoint(now, setpoint);
        (clearance.setpoint().unwrap(), clearance.changed)
    }
}

fn ms(millis: u64) -> Time {
    Time::from_millis(millis)
}

fn forward(speed: f64) -> Setpoint {
    Setpoint { forward: speed, ..Setpoint::HOLD }
}

/// A square fence of `half` metres to each side of the origin.
fn square(half: f64, properties: &str) -> Geofence {
    Geofence::from_geojson(&format!(
        r#"{{"type": "Feature", "properties": {properties}, "geometry": {{"type": "Polygon", "coordinates":
        [[[-{half}, -{half}], [{half}, -{half}], [{half}, {half}], [-{half}, {half}], [-{half}, -{half}]]]}}}}"#
    ))
    .unwrap()
}

#[test]
fn what_is_within_the_limits_passes_bit_for_bit() {
    let mut rig = Rig::flying(Limits::default());
    let requested = Setpoint { right: 0.3, forward: 2.9, up: 0.7, yaw_rate: -1.1 };
    assert_eq!(rig.ask(ms(1000), requested), (requested, None));
}

#[test]
fn home_is_the_last_place_on_the_ground() {
    let mut rig = Rig::flying(Limits::default());
    assert_eq!(rig.envelope.home(), Some(EnuPosition::default()));
    rig.telemetry.phase = FlightPhase::OnGround;
    rig.place(7.0, 8.0, 9.0);
    rig.tell(ms(1100));
    rig.telemetry.phase = FlightPhase::Flying;
    rig.place(70.0, 80.0, 90.0);
    rig.tell(ms(1200));
    assert_eq!(rig.envelope.home(), Some(EnuPosition { east: 7.0, north: 8.0, up: 9.0 }));
    // First seen in the air: the point below.
    let mut envelope = Envelope::new(Limits::default(), Craft::quad());
    envelope.observe_telemetry(ms(100), &Telemetry { time: ms(100), height: Some(80.0), ..rig.telemetry });
    assert_eq!(envelope.home(), Some(EnuPosition { east: 70.0, north: 80.0, up: 10.0 }));
}
