//! What is known about a vehicle besides its motion: firmware, battery, satellites, home, parameters, its last words.

use std::collections::{BTreeMap, VecDeque};

use spf_core::geometry::EnuPosition;
use spf_core::time::{Duration, Time};
use spf_mavlink::fence::{FenceItem, FenceShape};
use spf_mavlink::frames::GlobalPosition;
use spf_mavlink::modes::Autopilot;
use spf_mavlink::parameter::{ParameterEncoding, ParameterValue};
use spf_mavlink::report::{Gps, Report};

use super::uncertainty::Uncertainty;

/// A parameter is requested again after this long, at most this often.
const AGAIN: Duration = Duration::from_millis(500);
const TRIES: u8 = 5;
/// Texts of this severity and worse explain a refusal.
const WARNING: u8 = 4;
/// Texts that are remembered, and for how long they explain something.
const TEXTS: usize = 8;
const RECENT: Duration = Duration::from_secs(4);
/// Refusals to arm are repeated by the autopilot every 30 s or so, and stay true until then.
const REASONS: [&str; 3] = ["PreArm:", "Arm:", "Preflight Fail"];

/// `MAV_PROTOCOL_CAPABILITY_MISSION_FENCE`.
const TAKES_FENCE: u64 = 16_384;
/// The parameters that matter here, of PX4 and of ArduPilot.
const PX4: &[&str] = &[
    "COM_OF_LOSS_T",
    "COM_OBL_RC_ACT",
    "COM_RCL_EXCEPT",
    "NAV_RCL_ACT",
    "NAV_DLL_ACT",
    "COM_LOW_BAT_ACT",
    "GF_ACTION",
    "GF_MAX_HOR_DIST",
    "GF_MAX_VER_DIST",
    "MIS_TAKEOFF_ALT",
    "RTL_RETURN_ALT",
    "RTL_LAND_DELAY",
    "RTL_TYPE",
    "RTL_CONE_ANG",
    "NAV_ACC_RAD",
    "MPC_ACC_HOR",
    "MPC_XY_VEL_MAX",
    "MPC_Z_VEL_MAX_UP",
    "MPC_Z_VEL_MAX_DN",
];
const COPTER: &[&str] = &[
    "GUID_TIMEOUT",
    "FS_THR_ENABLE",
    "FS_GCS_ENABLE",
    "BATT_FS_LOW_ACT",
    "FENCE_ENABLE",
    "FENCE_ACTION",
    "FENCE_TYPE",
    "FENCE_RADIUS",
    "FENCE_ALT_MAX",
    "RTL_ALT",
    "RTL_ALT_FINAL",
    "RTL_ALT_M",
    "RTL_ALT_FINAL_M",
    "RTL_ALT_TYPE",
    "RTL_CLIMB_MIN",
    "RTL_CLIMB_MIN_M",
    "WPNAV_ACCEL",
    "WPNAV_SPEED",
    "WPNAV_SPEED_UP",
    "WPNAV_SPEED_DN",
];

/// What is known about a vehicle.
#[derive(Clone, Debug)]
pub struct Facts {
    /// Its autopilot.
    pub autopilot: Autopilot,
    /// Major, minor and patch number of its firmware, once known.
    pub firmware: Option<[u8; 3]>,
    /// Charge, 0..=1.
    pub battery: Option<f64>,
    /// Whether its arming checks pass; `None` if it does not say.
    pub may_arm: Option<bool>,
    /// Satellite navigation.
    pub gps: Option<Gps>,
    /// Where it returns to, relative to where its estimator started.
    pub home: Option<EnuPosition>,
    /// The same, on the globe.
    home_place: Option<GlobalPosition>,
    /// Number of its rally points, to which it may return instead.
    pub rally_points: Option<u16>,
    /// Whether it has answered a command or request of ours, as what is addressed to us shows. Parameters and versions are addressed
    /// to nobody: another station may have asked.
    pub(super) answers: bool,
    /// When a sensor around it that looks level was last heard.
    pub ranged: Option<Time>,
    /// Where its estimator started, on the globe.
    pub origin: Option<GlobalPosition>,
    /// Whether it takes a fence over the mission protocol.
    pub takes_fence: bool,
    /// Whether a fence is in force, if it says so.
    pub fenced: Option<bool>,
    /// The fence of points that it has; `None` until it was read.
    pub fence: Option<Vec<FenceShape>>,
    /// The same, as it was read.
    pub fence_items: Option<Vec<FenceItem>>,
    uncertainty: Uncertainty,
    encoding: ParameterEncoding,
    parameters: BTreeMap<&'static str, ParameterValue>,
    /// Names still to be read, with the number of requests.
    missing: VecDeque<(&'static str, u8)>,
    ask_at: Time,
    texts: VecDeque<(Time, u8, String)>,
}

impl Facts {
    pub(super) fn of(autopilot: Autopilot) -> Self {
        let (names, encoding) = match autopilot {
            Autopilot::Px4 => (PX4, ParameterEncoding::Bytewise),
            Autopilot::ArduPilot => (COPTER, ParameterEncoding::Cast),
        };
        Self {
            autopilot,
            firmware: None,
            battery: None,
            may_arm: None,
            gps: None,
            home: None,
            home_place: None,
            rally_points: None,
            answers: false,
            ranged: None,
            origin: None,
            takes_fence: false,
            fenced: None,
            fence: None,
            fence_items: None,
            uncertainty: Uncertainty::default(),
            encoding,
            parameters: BTreeMap::new(),
            missing: names.iter().map(|name| (*name, 0)).collect(),
            ask_at: Time::ZERO,
            texts: VecDeque::new(),
        }
    }

    pub(super) fn observe(&mut self, now: Time, report: &Report) {
        self.uncertainty.observe(now, report);
        match report {
            Report::System { battery, may_arm, fenced, .. } => {
                (self.battery, self.may_arm, self.fenced) = (*battery, *may_arm, *fenced);
            }
            Report::Gps(gps) => self.gps = Some(*gps),
            Report::Home(place) => {
                self.home_place = Some(*place);
                self.home = self.origin.map(|origin| origin.offset_to(*place));
            }
            Report::Origin(origin) => {
                self.origin = Some(*origin);
                self.home = self.home_place.map(|place| origin.offset_to(place));
            }
            Report::Version { capabilities, firmware } => {
                self.firmware = Some(*firmware);
                self.takes_fence = capabilities & TAKES_FENCE != 0;
                self.encoding = ParameterEncoding::from_capabilities(*capabilities).unwrap_or(self.encoding);
            }
            Report::Parameter { name, field, kind } => {
                if let Some(index) = self.missing.iter().position(|(missing, _)| missing == name)
                    && let Some(value) = ParameterValue::decode(*field, *kind, self.encoding)
                {
                    self.missing.remove(index).map(|(name, _)| self.parameters.insert(name, value));
                }
            }
            _ => {}
        }
    }

    pub(super) fn said(&mut self, now: Time, severity: u8, text: &str) {
        if self.texts.len() >= TEXTS {
            self.texts.pop_front();
        }
        self.texts.push_back((now, severity, text.to_owned()));
    }

    /// What it has said lately that may explain a refusal, each text once.
    pub(super) fn recent_words(&self, now: Time) -> Vec<String> {
        let mut words: Vec<String> = Vec::new();
        for (at, severity, text) in &self.texts {
            let lasting = REASONS.iter().any(|reason| text.starts_with(reason));
            if *severity <= WARNING && (lasting || now.since(*at) <= RECENT) && !words.contains(text) {
                words.push(text.clone());
            }
        }
        words
    }

    /// What it has said lately, whatever its severity.
    #[must_use]
    pub fn last_words(&self) -> Vec<String> {
        self.texts.iter().map(|(.., text)| text.clone()).collect()
    }

    /// The next parameter to request, one at a time: a burst would be lost on a slow link.
    pub(super) fn poll(&mut self, now: Time) -> Option<String> {
        // How integers travel must be known first, if it can be.
        if now < self.ask_at || (self.firmware.is_none() && now < Time::ZERO + AGAIN) {
            return None;
        }
        let (name, tries) = self.missing.pop_front()?;
        self.ask_at = now + AGAIN / 8;
        if tries < TRIES {
            // The answer to the last request may be under way.
            self.missing.push_back((name, tries + 1));
            return Some(name.to_owned());
        }
        None
    }

    /// Whether all parameters have arrived or were given up.
    pub(super) fn is_read(&self) -> bool {
        self.missing.is_empty()
    }

    /// Whether it has answered any request of ours.
    #[must_use]
    pub fn has_answered(&self) -> bool {
        self.answers
    }

    /// Standard deviation of its horizontal position, metres, if it says so; 1e6 if it says that it has none.
    #[must_use]
    pub fn position_error(&self, now: Time) -> Option<f64> {
        self.uncertainty.deviation(now)
    }

    /// A parameter, if the vehicle has it.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.get(name).map(|value| value.number())
    }

    /// Height above home to which it climbs at most before it returns by itself, metres, or from where it is by
    /// [`return_climb`](Self::return_climb), if that is more.
    ///
    /// # Errors
    /// Why it cannot be sent home: what it would do is unknown, or it would not land.
    pub fn return_height(&self) -> Result<f64, &'static str> {
        let number = |name| self.parameter(name);
        match self.rally_points {
            Some(0) => {}
            Some(_) => return Err("it has rally points, to one of which it would return"),
            None => return Err("its rally points, to one of which it would return, could not be read"),
        }
        let plain = match self.autopilot {
            Autopilot::Px4 => ("RTL_TYPE", "RTL_TYPE is not 0: it would not return straight home"),
            Autopilot::ArduPilot => ("RTL_ALT_TYPE", "RTL_ALT_TYPE is not 0: its height would follow the terrain"),
        };
        match number(plain.0) {
            Some(0.0) => {}
            Some(_) => return Err(plain.1),
            None => return Err("how it returns (RTL_TYPE, RTL_ALT_TYPE) could not be read"),
        }
        match self.autopilot {
            Autopilot::Px4 => {
                let read = (number("RTL_RETURN_ALT"), number("RTL_LAND_DELAY"), number("RTL_CONE_ANG"), number("NAV_ACC_RAD"));
                match read {
                    (_, Some(delay), ..) if delay < 0.0 => Err("RTL_LAND_DELAY is negative: it would hover over home for ever"),
                    // Near home it climbs to this much, whatever the height of its return.
                    (Some(height), Some(_), Some(cone), Some(radius)) if cone > 0.0 => Ok(height.max(2.0 * radius)),
                    (Some(height), Some(_), Some(_), Some(_)) => Ok(height),
                    _ => Err("RTL_RETURN_ALT, RTL_LAND_DELAY, RTL_CONE_ANG and NAV_ACC_RAD could not be read"),
                }
            }
            // From firmware 4.7 on in metres, and with other names.
            Autopilot::ArduPilot => {
                let either = |cm, metres| number(cm).map(|value| 0.01 * value).or_else(|| number(metres));
                let climb = either("RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M");
                match (either("RTL_ALT", "RTL_ALT_M"), either("RTL_ALT_FINAL", "RTL_ALT_FINAL_M")) {
                    _ if climb.is_none() => Err("RTL_CLIMB_MIN could not be read"),
                    (Some(_), Some(last)) if last != 0.0 => Err("RTL_ALT_FINAL is not 0: it would hover over home for ever"),
                    (Some(height), Some(_)) => Ok(height),
                    _ => Err("RTL_ALT and RTL_ALT_FINAL could not be read"),
                }
            }
        }
    }

    /// Height that it climbs at least before it returns, metres, from wherever it is.
    #[must_use]
    pub fn return_climb(&self) -> f64 {
        let cm = self.parameter("RTL_CLIMB_MIN").map(|cm| 0.01 * cm);
        cm.or_else(|| self.parameter("RTL_CLIMB_MIN_M")).unwrap_or(0.0).max(0.0)
    }

    /// Its own fence in words: of points, and of parameters.
    #[must_use]
    pub fn fence_in_words(&self) -> Vec<String> {
        let number = |name| self.parameter(name).filter(|limit| *limit > 0.0);
        let mut parts: Vec<String> = self.fence.iter().flatten().map(shape_in_words).collect();
        let limits = match self.autopilot {
            Autopilot::Px4 => [(number("GF_MAX_HOR_DIST"), "distance"), (number("GF_MAX_VER_DIST"), "height")],
            Autopilot::ArduPilot if number("FENCE_ENABLE").is_some() || self.fenced == Some(true) => {
                [(number("FENCE_RADIUS"), "distance"), (number("FENCE_ALT_MAX"), "height")]
            }
            Autopilot::ArduPilot => [(None, ""); 2],
        };
        parts.extend(limits.into_iter().filter_map(|(limit, what)| limit.map(|limit| format!("{what} {limit} m"))));
        parts
    }

    /// What the vehicle does when our setpoints end, as far as its parameters tell.
    #[must_use]
    pub fn on_loss(&self) -> String {
        let number = |name| self.parameter(name);
        match self.autopilot {
            Autopilot::Px4 => {
                let action = number("COM_OBL_RC_ACT").map(|action| match action as i64 {
                    0 => "changes to Position mode, which needs an RC transmitter (without one it goes on to its next failsafe)",
                    1 => "changes to Altitude mode, which needs an RC transmitter (without one it goes on to its next failsafe)",
                    2 => {
                        "changes to Stabilized mode, which needs an RC transmitter (without one it goes on to its next failsafe)"
                    }
                    3 => "returns home",
                    4 => "lands",
                    5 => "holds its position",
                    6 => "stops its motors",
                    7 => "disarms",
                    _ => "does what COM_OBL_RC_ACT says",
                });
                match (number("COM_OF_LOSS_T"), action) {
                    (Some(time), Some(action)) => format!("{time} s after the last setpoint PX4 {action} (COM_OBL_RC_ACT)"),
                    _ => "what PX4 does then is unknown: COM_OF_LOSS_T and COM_OBL_RC_ACT could not be read".to_owned(),
                }
            }
            Autopilot::ArduPilot => match number("GUID_TIMEOUT") {
                Some(time) => format!(
                    "{time} s after the last setpoint ArduPilot stops and hovers (GUID_TIMEOUT) until its battery failsafe, unless \
                     the RC transmitter takes over"
                ),
                None => "what ArduPilot does then is unknown: GUID_TIMEOUT could not be read".to_owned(),
            },
        }
    }
}

fn shape_in_words(shape: &FenceShape) -> String {
    let side = |inside: &bool| if *inside { "inside" } else { "outside" };
    match shape {
        FenceShape::Polygon { inside, corners } => format!("{} a polygon of {} corners", side(inside), corners.len()),
        FenceShape::Circle { inside, radius, .. } => format!("{} a circle of {radius:.0} m", side(inside)),
    }
}
