//! Creates the VLM of a flight: a model over HTTP, or the oracle of the simulated world.

use std::sync::Arc;

use spf_oracle::ErrorFile;
use spf_vlm::Vlm;

use super::oracle::OracleVlm;
use super::world::SimWorld;

/// Creates the VLM for a flight from the flight's seed. The oracle reads the simulated world; a model over HTTP sees frames only
/// and needs no world.
pub type VlmFactory = Arc<dyn Fn(Option<&SimWorld>, u64) -> Result<Box<dyn Vlm>, VlmFactoryError> + Send + Sync>;

/// Why a VLM could not be created.
pub type VlmFactoryError = Box<dyn std::error::Error + Send + Sync>;

/// A factory for the oracle `name` with these pointing errors.
#[must_use]
pub fn oracle_factory(name: String, errors: ErrorFile) -> VlmFactory {
    Arc::new(move |world, seed| {
        let world = world.ok_or("the oracle needs the simulator's images; use a VLM with a real drone")?;
        Ok(Box::new(OracleVlm::new(name.clone(), world.clone(), errors.clone(), seed)))
    })
}
