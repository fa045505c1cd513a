//! What is wrong in a formula, estimated from answers whose geometry is known: no catalogue is
//! needed for a cosine too many. Pure: answers in, words out.

mod deviation;
mod forms;
mod formula;
mod linear;
mod pass;
mod search;
mod shadow;
mod vertex;

pub use deviation::{Deviation, Of, Subject, Value};
pub use formula::{Reflector, Sample};
pub use pass::{Bound, explain_pass};
pub use search::{Accuracy, Fitted, explain};
pub use shadow::{ShadowRay, explain_shadows};
pub use vertex::{VertexSeen, explain_vertex};
