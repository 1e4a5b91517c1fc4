//! What others connect to: parts of the simulator over the interfaces of real ones (`spf sim serve`).
//!
//! [`tello`] is a virtual drone for other people's clients and for our own driver; [`vlm`] an endpoint that programs take for a
//! vendor of vision-language models. Both keep to the wall clock, and both show the same [`SimWorld`](spf_flight::sim::SimWorld)
//! to whoever asks; what flies in it still follows from the seed. [`truth`] judges the flights that others make.
//!
//! Nothing here flies by itself, and no pilot of ours is in it: a flight of ours is `spf_flight`'s.

pub mod tello;
pub mod truth;
pub mod vlm;
