//! The `umbra-worker` binary: the process that loads a plugin. Of the library it holds what a worker needs,
//! and nothing that judges, so that a plugin that reads its own memory finds no answers there.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    match std::env::args_os().nth(1) {
        Some(dir) => umbra::worker::child_main(Path::new(&dir)),
        None => {
            eprintln!("umbra-worker: this program is for Umbra's own use");
            ExitCode::from(2)
        }
    }
}
