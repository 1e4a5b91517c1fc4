//! The Drone interface and its drivers
