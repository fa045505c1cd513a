//! The command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<_> = std::env::args_os().skip(1).collect();
    #[cfg(target_os = "linux")]
    if let Some(name) = args.first().and_then(|name| name.to_str()) {
        use umbra::sandbox::{LAUNCH_COMMAND, doctor, launch_main};
        match (name, args.get(1)) {
            (LAUNCH_COMMAND, Some(program)) => return launch_main(program, &args[2..]),
            (doctor::PROBE_COMMAND, _) => return ExitCode::SUCCESS,
            _ => {}
        }
    }
    eprintln!("umbra: expected a command");
    ExitCode::from(2)
}
