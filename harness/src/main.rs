//! The `umbra` binary.

fn main() -> std::process::ExitCode {
    umbra::cli::main()
}
