//! Pages for a browser, served from the program itself: nothing is fetched from elsewhere.
//!
//! [`view`] flies around in a scene of the simulator.

pub mod view;
