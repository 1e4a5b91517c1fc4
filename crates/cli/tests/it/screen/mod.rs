//! Games flown through their window, on displays of Xvfb.

mod calibrate;
mod display;
mod faults;
mod luanti;
#[path = "../../../../screen/tests/it/server.rs"]
mod server;
mod windows;
