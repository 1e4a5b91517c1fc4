//! Sensors around the craft, and the gimbal of its camera.

use spf_core::ranges::{RangeRay, RangeScan};
use spf_mavlink::gimbal::{GimbalNews, Look};
use spf_mavlink::ranges::Ranges;

use super::*;

fn ranges(sensor: u32, boot_ms: u64, elevation: f64) -> Report {
    let ray = RangeRay { azimuth: 0.0, elevation, width: 0.1, metres: Some(4.0), reach: 9.0 };
    Report::Ranges(Ranges { sensor, from_north: false, rays: vec![ray], boot_ms })
}

fn scans(vehicle: &mut Vehicle) -> Vec<Time> {
    let of = |event| if let (_, DroneEvent::Ranges(scan)) = event { Some(scan.captured) } else { None };
    core::iter::from_fn(|| vehicle.take_event()).filter_map(of).collect()
}

#[test]
fn what_the_vehicle_is_told_by_us_and_tells_again_is_no_measurement() {
    let mut vehicle = flying();
    let scan = RangeScan {
        captured: at(0),
        sensor: 0,
        rays: vec![RangeRay { azimuth: 0.0, elevation: 0.0, width: 0.1, metres: Some(4.0), reach: 9.0 }],
    };
    vehicle.tell_surroundings(&scan);
    scans(&mut vehicle);
    // Its proximity sensor, and sectors of its avoidance.
    for (n, sensor) in [1 << 16, 10 << 8, 17 << 8].into_iter().enumerate() {
        vehicle.handle(at(100), &ranges(sensor, 5000 + n as u64, 0.0));
    }
    assert!(scans(&mut vehicle).is_empty() && !vehicle.measures_ranges(at(100)) && vehicle.wants_surroundings());
    // A rangefinder of its own counts.
    vehicle.handle(at(200), &ranges(1 << 8, 5000, 0.0));
    assert_eq!(scans(&mut vehicle).len(), 1);
    assert!(vehicle.measures_ranges(at(200)) && vehicle.wants_surroundings());
    // One that measured before anything was told is not told.
    let mut vehicle = flying();
    vehicle.handle(at(100), &ranges(1 << 16, 5000, 0.0));
    assert!(vehicle.measures_ranges(at(100)) && !vehicle.wants_surroundings());
}

#[test]
fn a_scan_was_measured_when_its_sensor_says_and_only_once_and_one_upwards_is_no_sight() {
    let mut vehicle = flying();
    vehicle.handle(at(100), &ranges(24, 5000, 1.57));
    assert!(!vehicle.measures_ranges(at(100)), "upwards only");
    for (ms, boot) in [(200, 5100), (300, 5100), (400, 5300), (900, 5400)] {
        vehicle.handle(at(ms), &ranges(1 << 8, boot, 0.0));
    }
    let found = scans(&mut vehicle);
    assert_eq!((found.len(), found[2]), (4, at(400)), "{found:?}");
    assert!(found[3] < at(600), "late: {found:?}");
}

fn look(tilt: f64, yaw: Option<f64>, from_north: bool, device: u8) -> GimbalNews {
    GimbalNews::Look(Look { tilt, yaw, from_north, device: [154, device], boot_ms: 0 })
}

fn seen(vehicle: &mut Vehicle) -> Option<(f64, [f64; 2], bool)> {
    let of = |event| if let (_, DroneEvent::Gimbal(it)) = event { Some((it.tilt, it.range, it.aside)) } else { None };
    core::iter::from_fn(|| vehicle.take_event()).filter_map(of).last()
}

#[test]
fn a_camera_that_looks_aside_is_told_and_only_the_first_gimbal_counts() {
    let mut vehicle = flying();
    let mut aside = |ms, news| {
        vehicle.handle_gimbal(at(ms), news);
        seen(&mut vehicle).map(|(.., aside)| aside)
    };
    assert_eq!(aside(100, look(0.3, Some(0.05), false, 1)), Some(false));
    assert_eq!(aside(200, look(0.3, Some(0.1), false, 1)), Some(true));
    assert_eq!(aside(300, look(0.3, None, false, 1)), Some(true));
    assert_eq!(aside(400, look(0.3, Some(0.0), true, 1)), Some(true), "without a heading");
    assert_eq!(aside(500, look(0.9, Some(0.0), false, 2)), None, "another gimbal");
    let heading = spf_core::geometry::Attitude { heading: 1.0, ..Default::default() };
    vehicle.handle(at(600), &Report::Attitude { attitude: heading, yaw_rate: 0.0, boot_ms: 0 });
    vehicle.handle_gimbal(at(600), look(0.3, Some(1.02), true, 1));
    assert_eq!(seen(&mut vehicle).map(|(.., aside)| aside), Some(false));
    assert_eq!((vehicle.camera_tilt(at(1600)), vehicle.camera_tilt(at(1601))), (Some(0.3), None), "too old");
}

/// What is sent to a gimbal that answers so.
fn tilted(result: u8, control: Option<[u8; 2]>, insists: bool) -> (Vec<u16>, [f64; 2], usize) {
    let mut vehicle = flying();
    vehicle.handle_gimbal(at(0), look(0.0, Some(0.0), false, 1));
    if let Some(control) = control {
        vehicle.handle_gimbal(at(0), GimbalNews::Control(control));
    }
    if insists {
        vehicle.insist_on_gimbal();
    }
    vehicle.tilt(at(10), 0.5);
    let mut ids = Vec::new();
    for ms in (10..4000).step_by(5) {
        while let Some(outgoing) = vehicle.poll(at(ms)) {
            let Outgoing::Command(sent) = outgoing else { continue };
            let command = sent.command.id;
            let gimbal = [ids::GIMBAL_CONFIGURE, ids::GIMBAL_PITCHYAW, ids::MOUNT_CONTROL].contains(&command);
            if gimbal {
                ids.push(command);
            }
            let result = if gimbal && command != ids::MOUNT_CONTROL { result } else { 0 };
            vehicle.handle(at(ms), &Report::Acknowledgement { command, result, target: [1, 191] });
        }
    }
    vehicle.handle_gimbal(at(4000), look(0.0, Some(0.0), false, 1));
    let range = seen(&mut vehicle).unwrap().1;
    let notices = core::iter::from_fn(|| vehicle.take_notice()).filter(|it| matches!(it, Notice::Refused { .. })).count();
    (ids, range, notices)
}

#[test]
fn a_gimbal_is_not_taken_from_the_operator_nor_forced_by_older_commands() {
    for result in [1, 2, 4, 10] {
        let (sent, range, notices) = tilted(result, None, false);
        assert!(!sent.contains(&ids::MOUNT_CONTROL), "{result}: {sent:?}");
        assert_eq!((range, notices), ([0.0; 2], 1), "{result}: the craft climbs instead, and it is told once");
    }
    let (sent, range, notices) = tilted(3, None, false);
    assert!(sent.contains(&ids::MOUNT_CONTROL) && range[1] > 1.0 && notices == 0, "{sent:?}");
    // Another station has it, nobody, or we.
    assert_eq!(tilted(0, Some([255, 190]), false), (Vec::new(), [0.0; 2], 1));
    assert!(tilted(0, Some([255, 190]), true).0.contains(&ids::GIMBAL_CONFIGURE));
    assert!(tilted(0, Some([0, 0]), false).0.contains(&ids::GIMBAL_CONFIGURE));
    assert!(tilted(0, Some([1, 191]), false).0.contains(&ids::GIMBAL_PITCHYAW));
}
