//! Who points: anybody who answers a query, and the oracle of the simulated world.

use std::sync::Arc;

use spf_oracle::ErrorFile;
use spf_vlm::Vlm;

use super::oracle::OracleVlm;
use super::world::SimWorld;

/// Makes who points, with the flight's seed: the oracle looks at the simulated world, a model over HTTP at pictures only, and so
/// needs none.
pub type WhoPoints = Arc<dyn Fn(Option<&SimWorld>, u64) -> Result<Box<dyn Vlm>, WhoError> + Send + Sync>;

/// Why nobody points.
pub type WhoError = Box<dyn std::error::Error + Send + Sync>;

/// The oracle called `name` with these errors.
#[must_use]
pub fn oracle_points(name: String, errors: ErrorFile) -> WhoPoints {
    Arc::new(move |world, seed| {
        let world = world.ok_or("the oracle reads the simulator's own pictures; with a real drone a VLM is needed")?;
        Ok(Box::new(OracleVlm::new(name.clone(), world.clone(), errors.clone(), seed)))
    })
}
