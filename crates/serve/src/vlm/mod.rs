//! An endpoint that programs take for a vendor of vision-language models, and whose mind is the oracle of the simulator in the same
//! process (docs/guide/grounding.md, "An endpoint without a key").
//!
//! The oracle reads ids and depth, which an image that comes over the network has not. So the endpoint keeps in [`Memory`] what its
//! camera saw in the last ten seconds, finds out which of those frames it was sent, and asks the oracle about that one. An image
//! that it does not know gets no answer.

mod camera;
mod lens;
mod memory;
mod mind;
mod onboard;
mod server;
mod wire;

pub use camera::Camera;
pub use lens::Lens;
pub use memory::{KEPT, Memory, Remembered, Unrecognised};
pub use mind::{AnswerForm, Instruction, Mind, Thought};
pub use onboard::OnboardCamera;
pub use server::{Endpoint, EndpointError, Serving};
