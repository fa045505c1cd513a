//! The worker: a child process that loads a plugin and answers requests, and its supervision.
//!
//! ```text
//! Job -> Supervisor::run_job -> [umbra-worker DIR: load, call] -> JobReport
//! ```
//! Large inputs and all outputs travel through files that the worker maps (`arena`), progress and
//! answers through a table of fixed-size records (`table`). The parent trusts neither: a plugin
//! shares the worker's address space and can write anything there.

mod arena;
mod cage;
mod child;
mod command;
mod job;
mod neutral_pass;
mod outcome;
mod patience;
mod shaders;
mod supervise;
mod table;
mod wire;

pub use cage::as_given;
pub use child::{child_main, draw_in_process};
pub use job::{
    Adapter, AdapterKind, BsdfQuery, BsdfSource, CameraValue, Job, Matrices, RayQuery, Request,
    SceneRef, Stage,
};
pub use outcome::{Answer, JobReport, Late, Matter, Outcome, WitnessUse, WorkerRun};
pub use patience::{Budget, Patience, Reference, blames_the_machine};
pub use supervise::{Progress, Supervisor};
// What is parsed of a file that foreign code could write: public for its fuzz target.
pub use table::{Noted, RECORD};
