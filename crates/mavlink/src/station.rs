//! Who sends heartbeats on a link: vehicles, cameras, ground stations.

use core::fmt;

use crate::modes::Autopilot;
use crate::wire::Packet;

/// `MAV_TYPE` of multicopters: quad-, hexa-, octo-, tri-, deca- and dodecarotor, coaxial.
const COPTERS: [u8; 7] = [2, 3, 13, 14, 15, 29, 35];
/// `MAV_AUTOPILOT_INVALID`: whoever is no autopilot.
const NONE: u8 = 8;

/// A sender of heartbeats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Station {
    /// Its system.
    pub system: u8,
    /// Its component.
    pub component: u8,
    /// `MAV_TYPE`.
    pub kind: u8,
    /// `MAV_AUTOPILOT`.
    pub autopilot: u8,
}

impl Station {
    /// The sender of a heartbeat; `None` for any other packet, and for one without a system.
    #[must_use]
    pub fn of(packet: &Packet) -> Option<Self> {
        let autopilot = packet.autopilot().filter(|_| packet.system != 0)?;
        let [kind] = packet.bytes(4);
        Some(Self { system: packet.system, component: packet.component, kind, autopilot })
    }

    /// The autopilot, if it is a multicopter with one that is flown here. Cameras, gimbals and receivers may say that they have an
    /// autopilot, too.
    #[must_use]
    pub fn copter(&self) -> Option<Autopilot> {
        Autopilot::from_heartbeat(self.autopilot).filter(|_| COPTERS.contains(&self.kind))
    }

    /// Whether it is the autopilot of such a multicopter (component 1).
    #[must_use]
    pub fn is_vehicle(&self) -> bool {
        self.component == 1 && self.copter().is_some()
    }
}

impl fmt::Display for Station {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "system {} component {} (", self.system, self.component)?;
        match name(self.kind) {
            Some(name) => f.write_str(name)?,
            None => write!(f, "MAV_TYPE {}", self.kind)?,
        }
        match (Autopilot::from_heartbeat(self.autopilot), self.autopilot) {
            (Some(autopilot), _) => write!(f, ", {})", autopilot.name()),
            // Generic: it stands for nothing in particular.
            (None, NONE | 0) => f.write_str(")"),
            (None, other) => write!(f, ", MAV_AUTOPILOT {other})"),
        }
    }
}

/// What a `MAV_TYPE` is, in words.
fn name(kind: u8) -> Option<&'static str> {
    Some(match kind {
        _ if COPTERS.contains(&kind) => "multicopter",
        1 => "fixed-wing aircraft",
        4 => "helicopter",
        5 => "antenna tracker",
        6 => "ground station",
        7 => "airship",
        8 => "balloon",
        10 => "rover",
        11 => "boat",
        12 => "submarine",
        18 => "onboard computer",
        19..=25 => "VTOL aircraft",
        26 => "gimbal",
        27 => "ADS-B receiver",
        30 => "camera",
        34 => "remote ID",
        36 => "battery",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stations_are_told_in_words_and_only_copters_are_vehicles() {
        let told = |[system, component, kind, autopilot]: [u8; 4]| {
            let station = Station { system, component, kind, autopilot };
            (station.to_string(), station.is_vehicle())
        };
        for (of, text, is_vehicle) in [
            ([1, 1, 2, 12], "system 1 component 1 (multicopter, PX4)", true),
            ([7, 1, 15, 3], "system 7 component 1 (multicopter, ArduPilot)", true),
            ([1, 100, 30, 8], "system 1 component 100 (camera)", false),
            ([1, 1, 30, 0], "system 1 component 1 (camera)", false),
            ([3, 1, 10, 3], "system 3 component 1 (rover, ArduPilot)", false),
            ([4, 1, 2, 17], "system 4 component 1 (multicopter, MAV_AUTOPILOT 17)", false),
            ([1, 191, 2, 12], "system 1 component 191 (multicopter, PX4)", false),
            ([9, 156, 200, 8], "system 9 component 156 (MAV_TYPE 200)", false),
        ] {
            assert_eq!(told(of), (text.to_owned(), is_vehicle));
        }
    }
}
