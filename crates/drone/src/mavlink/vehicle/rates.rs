//! Rates: which messages the vehicle is asked for, and how often.

use spf_core::time::{Duration, Time};
use spf_mavlink::command::{VehicleCommand, ids};
use spf_mavlink::modes::Autopilot;
use spf_mavlink::wire::EKF_STATUS_REPORT;

use super::Vehicle;

/// If the rates were forgotten, which a restart does, they are requested again at this interval.
const RATES_AGAIN: Duration = Duration::from_secs(4);
/// The range of a gimbal, and its attitude.
const GIMBAL_MANAGER_INFORMATION: f32 = 280.0;
/// Who has control of it.
const GIMBAL_MANAGER_STATUS: f32 = 281.0;
/// Where the estimator started: `LOCAL_POSITION_NED` counts from there.
const GPS_GLOBAL_ORIGIN: f32 = 49.0;
const GIMBAL_DEVICE_ATTITUDE_STATUS: u32 = 285;
/// A proximity sensor's ranges.
const OBSTACLE_DISTANCE: u32 = 330;
/// The sticks and switches of the radio: whether a person has moved them.
const RC_CHANNELS: u32 = 65;
/// PX4's own report of its estimator.
const ESTIMATOR_STATUS: u32 = 230;
/// The messages that are needed, with their rate in Hz, and the rate over a slow link.
const RATES: [(u32, f32, f32); 13] = [
    (1, 1.0, 1.0),
    (24, 1.0, 0.5),
    (30, 20.0, 8.0),
    (32, 20.0, 8.0),
    (33, 5.0, 2.0),
    (132, 10.0, 2.0),
    (RC_CHANNELS, 2.0, 0.5),
    (EKF_STATUS_REPORT, 1.0, 0.2),
    (ESTIMATOR_STATUS, 1.0, 0.2),
    (242, 0.5, 0.2),
    (245, 5.0, 2.0),
    (GIMBAL_DEVICE_ATTITUDE_STATUS, 10.0, 4.0),
    (OBSTACLE_DISTANCE, 10.0, 2.0),
];
/// The message whose refused rate shows that rates of single messages are unknown to the firmware.
pub(super) const ATTITUDE: f32 = 30.0;
/// The groups that contain the messages above (`MAV_DATA_STREAM`: extended status, radio, position, extra 1 and 3), in the same manner.
const STREAMS: [(u8, u16, u16); 5] = [(2, 2, 1), (3, 2, 1), (6, 10, 4), (10, 20, 8), (12, 5, 1)];

/// `AUTOPILOT_VERSION`.
const AUTOPILOT_VERSION: f32 = 148.0;

impl Vehicle {
    /// What is asked for first.
    pub(super) fn request_first(&mut self, now: Time) {
        for message in [AUTOPILOT_VERSION, GPS_GLOBAL_ORIGIN, GIMBAL_MANAGER_INFORMATION, GIMBAL_MANAGER_STATUS] {
            self.commands.submit(VehicleCommand::new(ids::REQUEST, &[message]));
        }
        self.request_rates(now);
    }

    fn request_rates(&mut self, now: Time) {
        self.rates_at = now + RATES_AGAIN;
        let others = if self.autopilot == Autopilot::Px4 { EKF_STATUS_REPORT } else { ESTIMATOR_STATUS };
        for (message, fast, slow) in RATES.into_iter().filter(|(message, ..)| *message != others) {
            let rate = if self.slow { slow } else { fast };
            self.commands.submit(VehicleCommand::new(ids::INTERVAL, &[message as f32, 1e6 / rate]));
        }
    }

    /// The rates of single messages are refused: their groups are requested, which nothing acknowledges.
    pub(super) fn request_streams(&mut self) {
        self.streams = STREAMS.into_iter().map(|(stream, fast, slow)| (stream, if self.slow { slow } else { fast })).collect();
    }

    /// Asks again for rates that were forgotten.
    pub(super) fn keep_rates(&mut self, now: Time) {
        if now >= self.rates_at && self.commands.is_idle() && !self.lost {
            // The answer to the first request may have been lost.
            if self.facts.firmware.is_none() {
                self.commands.submit(VehicleCommand::new(ids::REQUEST, &[AUTOPILOT_VERSION]));
            }
            // There is none before it has a position.
            if self.facts.origin.is_none() {
                self.commands.submit(VehicleCommand::new(ids::REQUEST, &[GPS_GLOBAL_ORIGIN]));
            }
            if self.is_oriented(now) {
                self.rates_at = now + RATES_AGAIN;
            } else {
                self.request_rates(now);
            }
        }
    }
}
