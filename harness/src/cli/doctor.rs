//! `umbra doctor`: shows what this machine supports, and how to get the rest.

use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use basecode::gpu::{AdapterKind, Gpu};

use crate::sandbox::{Isolation, doctor::examine};

/// Where a desktop's programs keep their sockets. Graphics drivers print an error on their own when it names no folder.
const RUNTIME: &str = "XDG_RUNTIME_DIR";

/// Prints what there is; exit 0 when submissions can be graded with full isolation.
///
/// # Errors
/// When it cannot find or start its own program.
pub fn run() -> anyhow::Result<u8> {
    if !std::env::var_os(RUNTIME).is_some_and(|folder| Path::new(&folder).is_absolute()) {
        // No socket lies in the root folder either, and nothing is said of that.
        let mut again = Command::new(std::env::current_exe()?);
        return Err(again.args(std::env::args_os().skip(1)).env(RUNTIME, "/").exec().into());
    }
    let examination = examine(&std::env::current_exe()?);
    println!("isolation");
    for finding in &examination.findings {
        let there = if finding.available { "yes" } else { "no" };
        println!("  {:<16} {there:<4} {}", finding.layer, finding.detail);
        if !finding.remedy.is_empty() {
            println!("  {:<16}      to do: {}", "", finding.remedy);
        }
    }
    let isolation = examination.usable().isolation();
    println!("  {:<16} {isolation}", "together");
    println!("graphics adapters");
    let software = adapter("software", AdapterKind::Software);
    adapter("hardware", AdapterKind::Hardware);
    println!("compiler");
    let programs = ["rustc", "cargo", "cc"].map(compiler);
    let whole = isolation == Isolation::Full && software && programs == [true; 3];
    println!("{}", if whole { "ready to grade" } else { "not ready to grade: see above" });
    Ok(if whole { super::EXIT_OK } else { super::EXIT_MACHINE })
}

/// Opens the best adapter of a kind, and says which it is or why there is none.
fn adapter(name: &str, kind: AdapterKind) -> bool {
    match Gpu::open(kind, "") {
        Ok(gpu) => {
            let info = &gpu.adapter;
            println!("  {name:<16} yes  {} ({} {})", info.name, info.driver, info.driver_info);
            true
        }
        Err(error) => {
            println!("  {name:<16} no   {error}");
            false
        }
    }
}

/// Asks a program for its version.
fn compiler(program: &str) -> bool {
    let output = Command::new(program).arg("--version").output();
    match output {
        Ok(output) if output.status.success() => {
            let text = String::from_utf8_lossy(&output.stdout);
            println!("  {program:<16} yes  {}", text.lines().next().unwrap_or_default());
            true
        }
        Ok(output) => {
            println!("  {program:<16} no   exits with {}", output.status);
            false
        }
        Err(error) => {
            println!("  {program:<16} no   {error}; to do: install it (rustup, a C compiler)");
            false
        }
    }
}
