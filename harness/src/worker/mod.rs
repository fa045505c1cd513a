//! The worker: a child process that loads a plugin and answers requests, and its supervision.
//!
//! ```text
//! Job -> Supervisor::run_job -> [umbra-worker DIR: load, call] -> JobReport
//! ```
//! Large inputs and all outputs travel through files that the worker maps (`shared_memory`), progress and
//! answers through a table of fixed-size records (`table`). The parent trusts neither: a plugin
//! shares the worker's address space and can write anything there.

mod child;
mod command;
mod files;
mod job;
#[cfg_attr(not(unix), path = "live_fallback.rs")]
mod live;
mod neutral_pass;
mod outcome;
mod policy;
mod retry_budget;
mod shaders;
mod shared_memory;
mod supervise;
mod table;
mod wire;

pub use child::{child_main, draw_in_process};
pub(crate) use command::software_driver;
pub use job::{
    Adapter, AdapterKind, BsdfQuery, BsdfSource, CameraValue, Job, RayQuery, Request, STAGES,
    SceneRef, StageText,
};
pub use live::LiveWorker;
pub use outcome::{Answer, Fault, JobReport, Outcome, Timeout, WitnessUse, WorkerRun};
pub use policy::as_given;
pub use retry_budget::{Budget, Reference, RetryBudget, is_environment_failure};
pub use supervise::{JobProgress, Supervisor};
// What is parsed of a file that foreign code could write: public for its fuzz target.
pub use table::{SLOT_BYTES, SlotState};
