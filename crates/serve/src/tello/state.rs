//! The state line, sent ten times per second.

use spf_core::geometry::wrap_angle;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_sim::craft::SimCraft;

use super::figures::Firmware;

/// The values of a state line, in its units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    pub(super) pads: bool,
    /// Pitch, roll and yaw, degrees; `None` if they are unknown.
    pub(super) attitude: Option<[i32; 3]>,
    /// dm/s in the power-on frame, with forward and left negative, down positive.
    pub(super) speed: [i32; 3],
    pub(super) temperature: f64,
    /// Centimetres.
    pub(super) tof: i32,
    pub(super) height: i32,
    pub(super) battery: i32,
    pub(super) barometer: f64,
    pub(super) motor_time: u32,
    /// 0.001 g.
    pub(super) acceleration: [f64; 3],
}

/// Value of the distance sensor when nothing is in range.
const NO_ECHO: i32 = 6553;
/// Range of the distance sensor, metres.
const TOF_REACH: f64 = 10.0;
/// Its value on the ground, metres.
const TOF_GROUND: f64 = 0.1;
/// Barometric altitude of the location, metres.
const PLACE_ALTITUDE: f64 = 150.12;

fn rounded(value: f64) -> i32 {
    libm::round(value) as i32
}

impl State {
    /// The state of `craft` at its current tick. `datum` is its heading at power-on.
    pub(super) fn of(craft: &SimCraft, datum: f64, pads: bool, temperature: f64, motor_time: f64) -> Self {
        let Telemetry { velocity, attitude, height, battery, phase, .. } = craft.telemetry();
        let velocity = velocity.unwrap_or_default();
        let (sin, cos) = (libm::sin(datum), libm::cos(datum));
        let (forward, right) = (velocity.east * sin + velocity.north * cos, velocity.east * cos - velocity.north * sin);
        let tenths = |speed: f64| rounded(10.0 * speed);
        let (pitch, roll) = (attitude.pitch, attitude.roll);
        // Reset on the ground.
        let height = height.filter(|_| phase != FlightPhase::OnGround).unwrap_or(0.0);
        Self {
            pads,
            attitude: Some([pitch, roll, wrap_angle(attitude.heading - datum)].map(|angle| rounded(angle.to_degrees()))),
            speed: [-tenths(forward), -tenths(right), -tenths(velocity.up)],
            temperature,
            tof: tof(craft),
            height: 10 * rounded(10.0 * height),
            battery: rounded(100.0 * battery.unwrap_or(0.0)),
            barometer: PLACE_ALTITUDE + height,
            motor_time: motor_time as u32,
            acceleration: [
                -1000.0 * libm::sin(pitch),
                1000.0 * libm::sin(roll) * libm::cos(pitch),
                -1000.0 * libm::cos(pitch) * libm::cos(roll),
            ],
        }
    }

    /// The same with the height, its change, and the distance to the ground of `other`.
    pub(super) fn with_height_of(self, other: &Self) -> Self {
        let ([x, y, _], [_, _, down]) = (self.speed, other.speed);
        let Self { height, tof, barometer, .. } = *other;
        Self { speed: [x, y, down], height, tof, barometer, ..self }
    }

    /// The attitude's fields, empty if it is unknown.
    pub(super) fn attitude_text(&self) -> String {
        match self.attitude {
            Some([pitch, roll, yaw]) => format!("pitch:{pitch};roll:{roll};yaw:{yaw};"),
            None => "pitch:;roll:;yaw:;".to_owned(),
        }
    }

    /// The line as written by the firmware. Plain ASCII; counts are never negative, which clients rely on.
    pub(super) fn line(&self, firmware: Firmware) -> String {
        let pads = match firmware {
            Firmware::V13 => String::new(),
            Firmware::V20 => "mid:-1;x:0;y:0;z:0;mpry:0,0,0;".to_owned(),
            Firmware::V30 if self.pads => "mid:-1;x:-100;y:-100;z:-100;mpry:-1,-1,-1;".to_owned(),
            Firmware::V30 => "mid:-2;x:-200;y:-200;z:-200;mpry:-2,-2,-2;".to_owned(),
        };
        let [vgx, vgy, vgz] = self.speed;
        let [agx, agy, agz] = self.acceleration;
        let low = rounded(self.temperature);
        format!(
            "{pads}{}vgx:{vgx};vgy:{vgy};vgz:{vgz};templ:{};temph:{};tof:{};h:{};bat:{};baro:{:.2};\
             time:{};agx:{agx:.2};agy:{agy:.2};agz:{agz:.2};\r\n",
            self.attitude_text(),
            low - 1,
            low + 1,
            self.tof,
            self.height,
            self.battery.clamp(0, 100),
            self.barometer,
            self.motor_time,
        )
    }
}

/// Distance to the surface below, centimetres.
fn tof(craft: &SimCraft) -> i32 {
    let position = craft.dynamics().pose().position;
    let radius = craft.dynamics().model().craft.radius;
    let Some(ground) = craft.collider().ground_below(position) else {
        return if craft.dynamics().phase() == FlightPhase::OnGround { rounded(100.0 * TOF_GROUND) } else { NO_ECHO };
    };
    let below = (position.up - ground.up - radius).max(0.0) + TOF_GROUND;
    if below <= TOF_REACH { rounded(100.0 * below) } else { NO_ECHO }
}
