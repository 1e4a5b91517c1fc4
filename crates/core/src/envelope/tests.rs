use super::*;
use crate::frame::FrameId;
use crate::geometry::Attitude;

/// An envelope about a craft that hovers 3 m above its take-off point, facing north, with everything fresh.
pub(super) struct Rig {
    pub(super) envelope: Envelope,
    pub(super) telemetry: Telemetry,
    pub(super) frames: u64,
}

impl Rig {
    pub(super) fn flying(limits: Limits) -> Self {
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

    pub(super) fn place(&mut self, east: f64, north: f64, up: f64) {
        self.telemetry.position = Some(EnuPosition { east, north, up });
        self.telemetry.height = Some(up);
    }

    pub(super) fn tell(&mut self, now: Time) {
        self.telemetry.time = now;
        self.envelope.observe_telemetry(now, &self.telemetry);
    }

    pub(super) fn frame(&mut self, now: Time) -> FrameMeta {
        self.frames += 1;
        FrameMeta {
            id: FrameId(self.frames),
            captured: now,
            received: now,
            capture_counter: self.frames,
            width: 960,
            height: 720,
            unusable: false,
        }
    }

    pub(super) fn see(&mut self, now: Time) {
        let frame = self.frame(now);
        self.envelope.observe_frame(now, &frame);
    }

    /// New telemetry and a new frame.
    pub(super) fn fresh(&mut self, now: Time) {
        self.tell(now);
        self.see(now);
    }

    pub(super) fn ask(&mut self, now: Time, setpoint: Setpoint) -> (Setpoint, Option<Cause>) {
        let clearance = self.envelope.clear_setpoint(now, setpoint);
        (clearance.setpoint().unwrap(), clearance.changed)
    }
}

pub(super) fn ms(millis: u64) -> Time {
    Time::from_millis(millis)
}

pub(super) fn forward(speed: f64) -> Setpoint {
    Setpoint { forward: speed, ..Setpoint::HOLD }
}

#[test]
fn what_is_within_the_limits_passes_bit_for_bit() {
    let mut rig = Rig::flying(Limits::default());
    let asked = Setpoint { right: 0.3, forward: 2.9, up: 0.7, yaw_rate: -1.1 };
    assert_eq!(rig.ask(ms(1000), asked), (asked, None));
}

#[test]
fn speeds_are_clamped_and_the_direction_kept() {
    let mut rig = Rig::flying(Limits::default());
    let (is, why) = rig.ask(ms(1000), Setpoint { right: 30.0, forward: 40.0, up: 9.0, yaw_rate: 9.0 });
    // 4.5 m/s along (3, 4)/5, 1.5 m/s, 1.5 · 95°/s.
    assert!((is.right - 2.7).abs() < 1e-12 && (is.forward - 3.6).abs() < 1e-12, "{is:?}");
    assert_eq!((is.up, is.yaw_rate, why), (1.5, 1.5 * 95.0_f64.to_radians(), Some(Cause::SpeedLimit)));
}

#[test]
fn a_setpoint_that_is_not_a_number_is_a_hold() {
    let mut rig = Rig::flying(Limits::default());
    assert_eq!(rig.ask(ms(1000), forward(f64::NAN)), (Setpoint::HOLD, Some(Cause::NotFinite)));
}

#[test]
fn on_the_ground_setpoints_are_holds_and_landing_passes() {
    let mut envelope = Envelope::new(Limits::default(), Craft::quad());
    assert_eq!(envelope.clear(ms(0), Command::TakeOff), Err(Refusal::NoTelemetry));
    envelope.observe_telemetry(ms(10), &Telemetry { time: ms(10), ..Telemetry::default() });
    let clearance = envelope.clear_setpoint(ms(10), forward(1.0));
    assert_eq!((clearance.setpoint(), clearance.changed), (Some(Setpoint::HOLD), Some(Cause::NotFlying)));
    for command in [Command::TakeOff, Command::Land, Command::EmergencyStop] {
        let clearance = envelope.clear(ms(10), command).unwrap();
        assert_eq!((clearance.cleared.get(), clearance.cleared.valid_until()), (&command, Time::MAX));
    }
}
