//! The `umbra-worker` binary: the process that loads a plugin. It links only the code that a worker needs, and none
//! that judges, so a plugin that reads its own memory finds no answers there.

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

/// What libraries call to lock a file. The system refuses it here, since a lock on a shared file reaches
/// beyond this process. But Mesa keeps no compiled shader without one, so this function claims to grant locks in the
/// worker's own scratch, which nobody else sees.
#[cfg(target_os = "linux")]
// SAFETY: it has the signature of the C library's function, whose place it takes, and its answers.
#[unsafe(no_mangle)]
pub extern "C" fn flock(file: i32, _operation: i32) -> i32 {
    use nix::errno::Errno;
    use nix::sys::stat::{fstat, stat};
    let device = (file >= 0).then(|| {
        // SAFETY: the caller's descriptor, open or not: it is only asked about, during this call.
        fstat(unsafe { std::os::fd::BorrowedFd::borrow_raw(file) }).map(|found| found.st_dev)
    });
    let scratch = stat(umbra::sandbox::policy::SCRATCH).or_else(|_| stat("."));
    match (device, scratch) {
        (Some(Ok(device)), Ok(scratch)) if device == scratch.st_dev => 0,
        _ => {
            Errno::EPERM.set();
            -1
        }
    }
}
