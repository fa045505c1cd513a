//! The tests of `umbra` from outside, one program of all: each that were one of its own would link the
//! whole grader again.

#![allow(clippy::unwrap_used)] // their helpers are tests too

mod any_exr;
mod appeals;
mod archives;
mod arrivals;
mod attempts;
mod batch;
mod build;
mod check;
mod compare;
mod compare_command;
mod decode;
mod diagnosis;
mod downloads;
mod expected;
mod full_disk;
mod gradescope;
mod instructor;
mod intake;
mod intake_properties;
mod isolation;
mod kept_frames;
mod kill;
mod labeled;
mod metrics;
mod original_scene;
mod outputs;
mod owners;
mod program;
mod race;
mod real_archives;
mod regrade;
mod render_command;
#[path = "sandbox/main.rs"]
mod sandbox;
mod similarity;
mod statistics;
mod submitted;
mod support;
mod suspicions;
mod tasks;
mod viewer;
mod watch;
mod worker;
