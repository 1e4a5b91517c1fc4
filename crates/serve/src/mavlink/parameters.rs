//! Parameters of the virtual vehicle: a part of those of PX4 and ArduCopter, with their defaults.

use spf_core::time::{Duration, duration_from_secs};
use spf_mavlink::modes::Autopilot;
use spf_mavlink::parameter::{INT32, ParameterEncoding, ParameterValue};

/// An integer of PX4, or of type `INT32`.
const fn int(name: &'static str, value: i32) -> (&'static str, ParameterValue) {
    (name, ParameterValue::Integer(value as i64, INT32))
}

/// A small integer, as ArduPilot types its choices (`INT8`).
const fn choice(name: &'static str, value: i8) -> (&'static str, ParameterValue) {
    (name, ParameterValue::Integer(value as i64, 2))
}

/// A number.
const fn real(name: &'static str, value: f32) -> (&'static str, ParameterValue) {
    (name, ParameterValue::Real(value))
}

/// What a ground station asks PX4 for, and what its failsafes depend on. `MPC_*` are those of the simulated craft.
const PX4: &[(&str, ParameterValue)] = &[
    int("BAT1_N_CELLS", 4),
    int("BAT1_SOURCE", 0),
    real("BAT_CRIT_THR", 0.07),
    real("BAT_EMERGEN_THR", 0.05),
    real("BAT_LOW_THR", 0.15),
    int("CAL_ACC0_ID", 1_310_988),
    int("CAL_GYRO0_ID", 1_310_988),
    int("CAL_MAG0_ID", 197_388),
    real("COM_DISARM_LAND", 2.0),
    real("COM_DISARM_PRFLT", 10.0),
    int("COM_DL_LOSS_T", 10),
    real("COM_FAIL_ACT_T", 5.0),
    int("COM_LOW_BAT_ACT", 0),
    int("COM_OBL_RC_ACT", 0),
    real("COM_OF_LOSS_T", 1.0),
    int("COM_RCL_EXCEPT", 0),
    int("COM_RC_IN_MODE", 1),
    real("COM_RC_LOSS_T", 0.5),
    real("CP_DIST", -1.0),
    int("GF_ACTION", 2),
    real("GF_MAX_HOR_DIST", 0.0),
    real("GF_MAX_VER_DIST", 0.0),
    int("MAV_SYS_ID", 1),
    int("MAV_TYPE", 2),
    real("MIS_TAKEOFF_ALT", 2.5),
    real("MPC_ACC_HOR", 4.0),
    real("MPC_XY_CRUISE", 5.0),
    real("MPC_XY_VEL_MAX", 10.0),
    real("MPC_Z_VEL_MAX_DN", 2.0),
    real("MPC_Z_VEL_MAX_UP", 3.0),
    real("NAV_ACC_RAD", 10.0),
    int("NAV_DLL_ACT", 0),
    int("NAV_RCL_ACT", 2),
    int("RTL_CONE_ANG", 45),
    real("RTL_DESCEND_ALT", 30.0),
    real("RTL_LAND_DELAY", 0.0),
    real("RTL_MIN_DIST", 10.0),
    real("RTL_RETURN_ALT", 60.0),
    int("RTL_TYPE", 0),
    int("SYS_AUTOCONFIG", 0),
    int("SYS_AUTOSTART", 4001),
];

/// The same of ArduCopter 4.5.
const COPTER: &[(&str, ParameterValue)] = &[
    choice("ARMING_CHECK", 1),
    choice("AVOID_ENABLE", 3),
    real("BATT_CRT_VOLT", 0.0),
    choice("BATT_FS_CRT_ACT", 0),
    choice("BATT_FS_LOW_ACT", 0),
    real("BATT_LOW_MAH", 0.0),
    choice("DISARM_DELAY", 10),
    choice("FENCE_ACTION", 1),
    real("FENCE_ALT_MAX", 100.0),
    choice("FENCE_ENABLE", 0),
    real("FENCE_MARGIN", 2.0),
    real("FENCE_RADIUS", 300.0),
    choice("FENCE_TYPE", 7),
    choice("FRAME_CLASS", 1),
    choice("FS_CRASH_CHECK", 1),
    choice("FS_EKF_ACTION", 1),
    real("FS_EKF_THRESH", 0.8),
    choice("FS_GCS_ENABLE", 0),
    real("FS_GCS_TIMEOUT", 5.0),
    choice("FS_THR_ENABLE", 1),
    real("GUID_TIMEOUT", 3.0),
    ("LAND_SPEED", ParameterValue::Integer(50, 4)),
    ("RTL_ALT", ParameterValue::Integer(1500, 4)),
    ("RTL_ALT_FINAL", ParameterValue::Integer(0, 4)),
    choice("RTL_ALT_TYPE", 0),
    ("RTL_CLIMB_MIN", ParameterValue::Integer(0, 4)),
    real("RTL_CONE_SLOPE", 3.0),
    int("RTL_LOIT_TIME", 5000),
    ("SYSID_MYGCS", ParameterValue::Integer(255, 4)),
    ("SYSID_THISMAV", ParameterValue::Integer(1, 4)),
    real("WPNAV_ACCEL", 400.0),
    real("WPNAV_SPEED", 1000.0),
    real("WPNAV_SPEED_DN", 150.0),
    real("WPNAV_SPEED_UP", 250.0),
];

/// The parameters of one vehicle, in the order of their indices.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    values: Vec<(&'static str, ParameterValue)>,
    pub(super) encoding: ParameterEncoding,
}

impl Parameters {
    pub(super) fn of(autopilot: Autopilot) -> Self {
        match autopilot {
            Autopilot::Px4 => Self { values: PX4.to_vec(), encoding: ParameterEncoding::Bytewise },
            Autopilot::ArduPilot => Self { values: COPTER.to_vec(), encoding: ParameterEncoding::Cast },
        }
    }

    pub(super) fn count(&self) -> u16 {
        self.values.len() as u16
    }

    pub(super) fn index(&self, name: &str) -> Option<u16> {
        self.values.iter().position(|(known, _)| *known == name).map(|index| index as u16)
    }

    pub(super) fn at(&self, index: u16) -> Option<(&'static str, ParameterValue)> {
        self.values.get(usize::from(index)).copied()
    }

    /// The value as a number; `default` if the vehicle has no such parameter.
    pub(super) fn number(&self, name: &str, default: f64) -> f64 {
        self.index(name).and_then(|index| self.at(index)).map_or(default, |(_, value)| value.number())
    }

    /// A duration in seconds, of an hour at most.
    pub(super) fn seconds(&self, name: &str, default: f64) -> Duration {
        duration_from_secs(self.number(name, default).clamp(0.0, 3600.0))
    }

    /// Sets a value that was received; it keeps its type. Returns its index, also if the value was refused.
    pub(super) fn set(&mut self, name: &str, field: f32, kind: u8) -> Option<u16> {
        let index = self.index(name)?;
        let slot = &mut self.values[usize::from(index)].1;
        let sent = ParameterValue::decode(field, kind, self.encoding);
        match (*slot, sent) {
            (ParameterValue::Real(_), Some(value)) => *slot = ParameterValue::Real(value.number() as f32),
            (ParameterValue::Integer(_, own), Some(value)) => {
                // A client that sends every value as a number means the whole one.
                let (low, high) = if own == 2 { (-128.0, 127.0) } else { (f64::from(i32::MIN), f64::from(i32::MAX)) };
                if value.number().fract() == 0.0 && (low..=high).contains(&value.number()) {
                    *slot = ParameterValue::Integer(value.number() as i64, own);
                }
            }
            (_, None) => {}
        }
        Some(index)
    }
}

#[cfg(test)]
mod tests {
    use spf_mavlink::parameter::REAL32;

    use super::*;

    #[test]
    fn names_are_unique_short_and_in_order() {
        for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
            let names: Vec<&str> = Parameters::of(autopilot).values.iter().map(|(name, _)| *name).collect();
            assert!(names.is_sorted_by(|a, b| a < b) && names.iter().all(|name| name.len() <= 16), "{names:?}");
        }
    }

    #[test]
    fn a_value_keeps_its_type_and_one_that_is_none_changes_nothing() {
        let mut parameters = Parameters::of(Autopilot::Px4);
        let (field, kind) = ParameterValue::int(4).encode(ParameterEncoding::Bytewise);
        let index = parameters.set("COM_OBL_RC_ACT", field, kind).unwrap();
        assert_eq!(parameters.at(index), Some(("COM_OBL_RC_ACT", ParameterValue::int(4))));
        parameters.set("COM_OBL_RC_ACT", 1.5, REAL32).unwrap();
        parameters.set("MIS_TAKEOFF_ALT", f32::NAN, REAL32).unwrap();
        assert_eq!((parameters.number("COM_OBL_RC_ACT", 0.0), parameters.number("MIS_TAKEOFF_ALT", 0.0)), (4.0, 2.5));
        assert_eq!(parameters.set("NO_SUCH", 1.0, REAL32), None);
    }
}
