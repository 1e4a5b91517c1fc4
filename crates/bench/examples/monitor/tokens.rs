//! Tokens that a model would have read and written.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use spf_core::query::QueryKind;
use spf_flight::sim::{VlmFactory, oracle_factory};
use spf_oracle::ErrorFile;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Vlm};

/// The size at which a model is sent the images of points, pixels: that of most rows of the table of models.
const POINTS: (u32, u32) = (768, 576);

/// Counts of a flight; clones share them.
#[derive(Clone, Default)]
pub(crate) struct Counts(Arc<[AtomicU64; 4]>);

impl Counts {
    /// Queries for points, queries of the monitor, tokens of each.
    pub(crate) fn taken(&self) -> [u64; 4] {
        [0, 1, 2, 3].map(|index: usize| self.0[index].swap(0, Ordering::Relaxed))
    }
}

struct Counted(Box<dyn Vlm>, Counts);

impl Vlm for Counted {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.0.image_spec(camera)
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let answer = self.0.answer(request, image);
        let query = request.query;
        let monitors = query.kind == QueryKind::Monitor;
        let (width, height) = if monitors { query.image_size.unwrap_or(POINTS) } else { POINTS };
        let images = u64::from(width) * u64::from(height) / 750 * (1 + u64::from(query.close_up.is_some()));
        let text = answer.text.as_ref().map_or(0, String::len);
        let tokens = images + (query.prompt.len() as u64).div_ceil(4) + (text as u64).div_ceil(4);
        let [points, monitor, of_points, of_monitor] = &*self.1.0;
        let (count, sum) = if monitors { (monitor, of_monitor) } else { (points, of_points) };
        count.fetch_add(1, Ordering::Relaxed);
        sum.fetch_add(tokens, Ordering::Relaxed);
        answer
    }
}

/// The oracle with an error file, counted.
pub(crate) fn counted(errors: &str, counts: &Counts) -> Result<VlmFactory, Box<dyn std::error::Error>> {
    let oracle = oracle_factory(format!("oracle:{errors}"), ErrorFile::named(errors)?);
    let counts = counts.clone();
    Ok(Arc::new(move |world, seed| Ok(Box::new(Counted(oracle(world, seed)?, counts.clone())))))
}

/// The median; 0 of nothing.
pub(crate) fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}
