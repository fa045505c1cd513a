//! Estimates what is wrong in a formula from answers with known geometry. An extra cosine, for example, needs no
//! catalogue. A pure function from answers to words.

mod deviation;
mod estimate;
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
