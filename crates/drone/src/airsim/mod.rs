//! AirSim and its heirs (`docs/guide/airsim.md`): what is said on the wire.

pub mod wire;
