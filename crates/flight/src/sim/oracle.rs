//! The oracle behind the `Vlm` interface: it reads the id and depth images of the query's frame, never its pose or
//! task.

use spf_core::frame::FrameId;
use spf_core::query::Query;
use spf_core::time::Duration;
use spf_oracle::{ErrorFile, GroundTruthView, Oracle, Percept};
use spf_render::Channels;
use spf_vlm::{Answer, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use super::loaded_scene::{PerceptBuffers, WorldSnapshot};
use super::world::SimWorld;

/// The oracle of a simulated world.
pub struct OracleVlm {
    name: String,
    world: SimWorld,
    oracle: Oracle,
    /// The percept of the last frame, shared by all queries on it.
    percept: Option<(FrameId, Percept)>,
}

impl OracleVlm {
    /// An oracle called `name` with these errors. It flies the world's brief, if there is one.
    #[must_use]
    pub fn new(name: String, world: SimWorld, errors: ErrorFile, seed: u64) -> Self {
        let near = world.loaded().scene.near;
        let oracle = Oracle::new(errors, near, seed).with_brief(world.brief());
        Self { name, oracle, world, percept: None }
    }

    /// Answers a query for the given snapshot, whatever the current state of the world.
    pub fn answer_at(&self, query: &Query, snapshot: &WorldSnapshot) -> Answer {
        let percept = self.look(query.frame, snapshot);
        self.answer_from(query, &percept)
    }

    fn answer_from(&self, query: &Query, percept: &Percept) -> Answer {
        let answer = self.oracle.answer(query, percept);
        let (latency, model) = (answer.latency, self.name.clone());
        Answer { text: Ok(answer.text), latency, model, account: Usage::default() }
    }

    /// The percept of a frame.
    fn percept(&mut self, frame: FrameId) -> Result<Percept, VlmError> {
        if let Some((_, percept)) = self.percept.as_ref().filter(|(of, _)| *of == frame) {
            return Ok(percept.clone());
        }
        let snapshot =
            self.world.capture(frame).ok_or_else(|| VlmError::Image(format!("frame {} is no longer stored", frame.0)))?;
        let percept = self.look(frame, &snapshot);
        self.percept = Some((frame, percept.clone()));
        Ok(percept)
    }

    fn look(&self, frame: FrameId, snapshot: &WorldSnapshot) -> Percept {
        let mut eyes = self.world.loaded().eyes();
        let PerceptBuffers { sight, wide } = &mut eyes;
        // Two images in parallel: much of rendering without colours is single-threaded.
        let ((), in_frame) =
            rayon::join(|| self.world.render_into(snapshot, Channels::PERCEPT, sight), || self.world.in_frame(snapshot, wide));
        // Outside of the parallel section: the first request for light waits for its computation, and must not run
        // another flight's percept in the meantime, which would wait for itself.
        let light = self.world.light_on(snapshot, &eyes.sight);
        let signs = self.world.loaded().scene.signs_from(snapshot.pose.position);
        let image = &eyes.sight;
        let sight = GroundTruthView {
            width: image.width as usize,
            height: image.height as usize,
            ids: image.ids.as_deref().unwrap_or_default(),
            depth: image.depth.as_deref().unwrap_or_default(),
            piece_ids: image.piece_ids.as_deref().unwrap_or_default(),
            pieces: &self.world.loaded().scene.pieces,
            opening_ids: image.opening_ids.as_deref().unwrap_or_default(),
            opening_depth: image.opening_depth.as_deref().unwrap_or_default(),
            camera: self.world.camera(),
            attitude: snapshot.pose.attitude,
            in_frame: &in_frame,
            light: &light,
            signs: &signs,
        };
        let percept = self.oracle.percept(frame, &sight, &self.world.loaded().tags);
        self.world.loaded().give_back(eyes);
        percept
    }
}

impl Vlm for OracleVlm {
    fn name(&self) -> &str {
        &self.name
    }

    fn answer(&mut self, request: &QueryRequest<'_>, _image: &mut dyn QueryImage) -> Answer {
        match self.percept(request.query.frame) {
            Ok(percept) => self.answer_from(request.query, &percept),
            Err(error) => {
                let (latency, model) = (Duration::ZERO, self.name.clone());
                Answer { text: Err(error), latency, model, account: Usage::default() }
            }
        }
    }
}
