//! An endpoint compatible with vision-language model APIs that answers with the simulator's oracle in the same process
//! (docs/guide/grounding.md, "An endpoint without a key").
//!
//! The oracle needs ids and depth, which a received image lacks. The endpoint therefore keeps the last ten seconds of
//! its camera in [`Memory`], determines which of those frames it received, and queries the oracle about that frame. An
//! unknown image results in an error.

mod camera;
mod lens;
mod memory;
mod onboard;
mod responder;
mod server;
mod wire;
mod wording;

pub use camera::Camera;
pub use lens::FrameProvider;
pub use memory::{FRAME_RETENTION, Memory, Remembered, Unrecognised};
pub use onboard::OnboardCamera;
pub use responder::{AnswerForm, Instruction, OracleReply, Responder};
#[doc(hidden)]
pub use server::read_any_request;
pub use server::{Endpoint, EndpointError, Serving};
