//! The hostile suite: plugins, sources and archives that try to hurt, each in a process of its own
//! with an outer limit, and one line of figures in the end. `./run hostile` runs it.
//!
//! As root every plugin runs twice: started by root, and by an ordinary user.

#[cfg(target_os = "linux")]
mod archives;
#[cfg(target_os = "linux")]
mod fixture;
#[cfg(target_os = "linux")]
mod plugins;
#[cfg(target_os = "linux")]
mod points;
#[cfg(target_os = "linux")]
mod secrets;
#[cfg(target_os = "linux")]
mod sources;
#[cfg(target_os = "linux")]
mod suite;

fn main() -> std::process::ExitCode {
    #[cfg(target_os = "linux")]
    return suite::main();
    #[cfg(not(target_os = "linux"))]
    {
        println!("hostile: there is no sandbox on this system, nothing is run");
        std::process::ExitCode::SUCCESS
    }
}
