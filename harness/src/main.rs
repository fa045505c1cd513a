//! The command line.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    // First of all: cargo runs this very binary as its compiler wrapper while it is recorded.
    if let Some(code) = umbra::build::wrapper_main() {
        return code;
    }
    let args: Vec<_> = std::env::args_os().skip(1).collect();
    match (args.first().and_then(|name| name.to_str()), args.get(1)) {
        (Some("__worker"), Some(dir)) => umbra::worker::child_main(Path::new(dir)),
        (Some("__exec"), Some(program)) => umbra::process::exec_main(program, &args[2..]),
        _ => {
            eprintln!("umbra: expected a command");
            ExitCode::from(2)
        }
    }
}
