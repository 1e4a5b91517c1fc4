//! Text form of poses.

use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};

/// Parses `east,north,up,heading_deg[,pitch_deg]`, in metres and degrees.
///
/// # Errors
/// A message stating the expected form.
pub fn parse_pose(text: &str) -> Result<Pose, String> {
    let expected = || "a pose east,north,up,heading_deg[,pitch_deg] in metres and degrees".to_owned();
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse::<f64>()).collect::<Result<_, _>>().map_err(|_| expected())?;
    if !(4..=5).contains(&numbers.len()) || numbers.iter().any(|number| !number.is_finite() || number.abs() > 1e6) {
        return Err(expected());
    }
    let pitch = numbers.get(4).copied().unwrap_or(0.0);
    if pitch.abs() > 90.0 {
        return Err("a pose whose pitch is at most 90 degrees up or down".to_owned());
    }
    Ok(Pose {
        position: EnuPosition { east: numbers[0], north: numbers[1], up: numbers[2] },
        attitude: Attitude { heading: wrap_angle(numbers[3].to_radians()), pitch: pitch.to_radians(), roll: 0.0 },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_pose_is_read_in_degrees() {
        let pose = parse_pose("1, -2,3.5,90,-10").unwrap();
        assert_eq!(pose.position, EnuPosition { east: 1.0, north: -2.0, up: 3.5 });
        assert_eq!(pose.attitude.heading, core::f64::consts::FRAC_PI_2);
        assert!((pose.attitude.pitch + 10.0_f64.to_radians()).abs() < 1e-12);
        assert!(parse_pose("1,2,3").is_err() && parse_pose("1,2,3,4,5,6").is_err() && parse_pose("1,2,3,4,91").is_err());
    }

    proptest! {
        #[test]
        fn a_pose_is_finite_or_refused(text in "[-+0-9.,einfa ]{0,40}|.{0,40}") {
            if let Ok(pose) = parse_pose(&text) {
                let (position, attitude) = (pose.position, pose.attitude);
                let all = [position.east, position.north, position.up, attitude.heading, attitude.pitch];
                prop_assert!(all.iter().all(|number| number.is_finite()));
                prop_assert!(attitude.heading.abs() <= core::f64::consts::PI);
            }
        }
    }
}
