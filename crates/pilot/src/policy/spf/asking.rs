//! Queries: the one that is open, and what the next one is for.

use std::sync::Arc;

use super::rules::Rules;
use crate::policy::{Step, View};
use spf_core::prompt::{PromptText, ends_near_target};
use spf_core::query::{ImageBox, Mark, Memory, Query, QueryId};

/// What a query is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The next step.
    #[default]
    Decide,
    /// To confirm a `done`, while holding.
    Confirm,
}

/// The open query and the view it refers to.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenQuery {
    pub(super) id: QueryId,
    pub(super) view: View,
    pub(super) purpose: Purpose,
}

/// Field of view of a view's image from left to right and from top to bottom, degrees.
fn field_deg(view: &View) -> [f64; 2] {
    let (across, down) = view.camera.half_fov();
    [across, down].map(|half| 2.0 * half.to_degrees())
}

/// The queries of a flight.
#[derive(Clone, Debug)]
pub(super) struct Asking {
    instruction: String,
    prompt: Arc<PromptText>,
    next_id: u64,
    open: Option<OpenQuery>,
    /// Purpose of the next query.
    pub(super) purpose: Purpose,
}

impl Asking {
    pub(super) fn new(prompt: Arc<PromptText>) -> Self {
        Self { instruction: String::new(), prompt, next_id: 0, open: None, purpose: Purpose::default() }
    }

    /// Replaces the prompt.
    pub(super) fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// Begins with a new instruction. Ids go on, since a reply to an earlier query may still arrive.
    pub(super) fn begin(&mut self, instruction: &str) {
        instruction.clone_into(&mut self.instruction);
        (self.open, self.purpose) = (None, Purpose::default());
    }

    /// Whether a distance may contradict a `done`.
    pub(super) fn ends_near_target(&self) -> bool {
        ends_near_target(&self.instruction)
    }

    /// Whether a query about this view can be sent: none is open, and a `done` is confirmed at rest.
    pub(super) fn is_due(&self, view: &View) -> bool {
        self.open.is_none() && (view.at_rest || self.purpose == Purpose::Decide)
    }

    /// Asks about a view.
    pub(super) fn ask(&mut self, rules: &Rules, view: &View, memory: Memory, close_up: Option<ImageBox>) -> Step {
        let id = QueryId(self.next_id);
        self.next_id += 1;
        self.open = Some(OpenQuery { id, view: *view, purpose: self.purpose });
        let settings = &rules.settings;
        let mut query = Query {
            instruction: self.instruction.clone(),
            near_m: settings.near_m,
            keep_m: rules.kept_m,
            measures: settings.method.measures_view(),
            image_size: settings.image_size,
            close_up,
            field_deg: Some(field_deg(view)),
            horizon: view.horizon(),
            marks: memory.kept_out.iter().map(|area| Mark::Box { area: *area, label: "keep away".to_owned() }).collect(),
            memory,
            ..Query::new(id, view.frame.id, rules.kind())
        };
        query.prompt = self.prompt.write_point(&query, &settings.grounding);
        Step::Ask(Box::new(query))
    }

    /// Closes the query if it is the open one.
    pub(super) fn close(&mut self, id: QueryId) -> Option<OpenQuery> {
        self.open.take_if(|open| open.id == id)
    }
}
