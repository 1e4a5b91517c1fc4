//! Reading a flight's log.

use std::path::Path;

use spf_core::geometry::Pose;
use spf_flight::log::{Channel, FlightHeader};
use spf_flight::replay::{head, row};
use spf_flight::summary::Summary;
use spf_pilot::Decision;
use spf_record::log::foxglove::read_pose;
use spf_record::log::{LogReader, ReadError};

use crate::error::Error;

/// A pose at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseAt {
    /// Flight time, seconds.
    pub time_s: f64,
    /// World frame: metres east, north and up of the scene's origin; radians, heading clockwise from north, pitch positive nose up,
    /// roll positive right side down. A craft that counts its position from its take-off point counts it here too.
    pub pose: Pose,
}

/// What a log `flight.mcap` holds of a flight.
#[derive(Clone, Debug)]
pub struct FlightRecord {
    /// Settings, craft, camera and limits, and in the simulator scene and seed.
    pub header: FlightHeader,
    /// The decisions, in order.
    pub decisions: Vec<Decision>,
    /// Where the craft believed itself to be, 20 times per second.
    pub trajectory: Vec<PoseAt>,
    /// Where it truly was at the same times; empty for a real drone.
    pub true_trajectory: Vec<PoseAt>,
    /// The result; `None` in a log that ends before the flight did.
    pub summary: Option<Summary>,
    /// Whether the log ends before the flight did: the program was killed, or the disk was full.
    pub is_truncated: bool,
}

/// Reads a log. Of a truncated one, what it holds.
///
/// # Errors
/// A usage error if the file cannot be read, is no flight log, or is of another version.
pub fn read_log(path: &Path) -> Result<FlightRecord, Error> {
    let unreadable = |error: &dyn std::error::Error| {
        Error::usage(format!("cannot read the log `{}`", path.display()))
            .because(error)
            .hint("give the flight.mcap of a flight's folder")
    };
    let mut entries = LogReader::open(path).map_err(|error| unreadable(&error))?;
    let header = head(&mut entries).map_err(|error| unreadable(&error))?;
    let (decisions, trajectory, true_trajectory) = (Vec::new(), Vec::new(), Vec::new());
    let mut record = FlightRecord { header, decisions, trajectory, true_trajectory, summary: None, is_truncated: false };
    for entry in entries {
        let entry = match entry {
            Ok(entry) => entry,
            Err(ReadError::Torn) => break,
            Err(error) => return Err(unreadable(&error)),
        };
        let channel = Channel::of_topic(&entry.topic);
        match channel {
            Some(Channel::Decision) => record.decisions.push(row(&entry).map_err(|error| unreadable(&error))?),
            Some(Channel::Summary) => record.summary = Some(row(&entry).map_err(|error| unreadable(&error))?),
            Some(Channel::PoseKnown | Channel::PoseTrue) => {
                let Some(pose) = read_pose(&entry.data) else { continue };
                let poses =
                    if channel == Some(Channel::PoseKnown) { &mut record.trajectory } else { &mut record.true_trajectory };
                poses.push(PoseAt { time_s: entry.time.as_secs_f64(), pose });
            }
            _ => {}
        }
    }
    record.is_truncated = record.summary.is_none();
    Ok(record)
}
