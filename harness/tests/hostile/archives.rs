//! Hostile archives: one test each, in tests/archives.rs; here they are run and counted.

use std::process::Command;

/// Runs them all: how many passed, how many there are, and what failed.
pub fn run() -> Result<(usize, usize, String), String> {
    let cargo = std::env::var_os("CARGO").unwrap_or("cargo".into());
    let output = Command::new(cargo)
        .args(["test", "--release", "--workspace", "--quiet", "--test", "it", "archives::"])
        .args(["--", "--skip", "real_archives::", "--format=pretty"])
        .current_dir(crate::fixture::workspace())
        .output()
        .map_err(|error| format!("cannot run the tests of archives: {error}"))?;
    let said = String::from_utf8_lossy(&output.stdout);
    let results = said.lines().filter_map(|line| line.strip_prefix("test ")?.split_once(" ... "));
    let results: Vec<_> = results.collect();
    let passed = results.iter().filter(|(_, result)| *result == "ok").count();
    let failed = results.iter().filter(|(_, result)| *result != "ok").map(|(name, _)| *name);
    let failed = failed.collect::<Vec<_>>().join(", ");
    if results.is_empty() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    Ok((passed, results.len(), failed))
}
