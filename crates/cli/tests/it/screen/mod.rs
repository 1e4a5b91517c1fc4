//! Games flown through their window, on displays of Xvfb.

mod display;
mod faults;
mod luanti;
mod windows;
