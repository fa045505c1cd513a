//! Watching a child where there is no Unix: a deadline, without groups or limits.

use std::io::{self, Read};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::capture::Capture;
use super::{Captured, ChildOutcome, Confinement, Exit, Watcher, start};

/// Runs `command` to its end; see the Unix version for the contract.
///
/// # Errors
/// When the child cannot be started or watched.
pub fn run(
    mut command: Command,
    confinement: &Confinement,
    keep: usize,
    cancel: &AtomicBool,
    watcher: &mut Watcher,
) -> io::Result<ChildOutcome> {
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let begin = Instant::now();
    let mut child = start(command, confinement)?;
    let stdout = child.stdout.take().map(|pipe| collect(pipe, keep));
    let stderr = child.stderr.take().map(|pipe| collect(pipe, keep));
    let exit = loop {
        if let Some(status) = child.try_wait()? {
            break Exit::Code(status.code().unwrap_or(-1));
        }
        let ended = if watcher(0.0).is_break() {
            Exit::OutOfCpu
        } else if cancel.load(Ordering::Relaxed) {
            Exit::Cancelled
        } else if begin.elapsed().as_secs_f64() >= confinement.limits.wall_s {
            Exit::TimedOut
        } else {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        };
        child.kill()?;
        child.wait()?;
        break ended;
    };
    let wall_s = begin.elapsed().as_secs_f64();
    let (stdout, out_held) = stdout.map(Stream::finish).unwrap_or_default();
    let (stderr, err_held) = stderr.map(Stream::finish).unwrap_or_default();
    Ok(ChildOutcome {
        exit: exit.with_memory(&stderr, 0, u64::MAX),
        pid: child.id(),
        stdout,
        stderr,
        wall_s,
        cpu_s: 0.0,
        still_s: wall_s,
        peak_resident_mib: 0,
        peak_address_mib: 0,
        in_force: None,
        left_process: out_held || err_held,
    })
}

/// A stream that a thread of its own reads; the thread is left behind when it does not end.
struct Stream {
    capture: Arc<Mutex<Capture>>,
    reader: std::thread::JoinHandle<()>,
}

fn collect(mut pipe: impl Read + Send + 'static, keep: usize) -> Stream {
    let capture = Arc::new(Mutex::new(Capture::new(keep)));
    let into = Arc::clone(&capture);
    let reader = std::thread::spawn(move || {
        let mut buffer = [0; 64 << 10];
        while let Ok(count @ 1..) = pipe.read(&mut buffer) {
            let Ok(mut capture) = into.lock() else { return };
            capture.push(&buffer[..count]);
        }
    });
    Stream { capture, reader }
}

impl Stream {
    /// What was read, and whether another process still holds the stream open.
    fn finish(self) -> (Captured, bool) {
        let deadline = Instant::now() + Duration::from_millis(200);
        while !self.reader.is_finished() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(1));
        }
        let held = !self.reader.is_finished();
        let captured = self
            .capture
            .lock()
            .map(|mut capture| std::mem::replace(&mut *capture, Capture::new(0)).finish());
        (captured.unwrap_or_default(), held)
    }
}
