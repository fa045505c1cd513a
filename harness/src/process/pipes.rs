//! The output of a child on Unix, while it runs and when it is gone.

use std::fs::File;
use std::io::{self, Read};
use std::os::fd::{AsFd, OwnedFd};
use std::process::Child;
use std::time::{Duration, Instant};

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use super::Captured;
use super::capture::Capture;

/// The most that is taken from an output stream at a time, so that a flood cannot keep us there.
const READ_AT_ONCE: usize = 1 << 20;

/// The read ends of a child's standard output and standard error.
pub(super) struct Pipes([Pipe; 2]);

impl Pipes {
    /// Takes them from the child. Of each stream the first `keep` bytes and a short tail are kept.
    ///
    /// # Errors
    /// When a pipe cannot be made non-blocking.
    pub fn of(child: &mut Child, keep: usize) -> io::Result<Self> {
        let [stdout, stderr] =
            [child.stdout.take().map(OwnedFd::from), child.stderr.take().map(OwnedFd::from)];
        Ok(Self([Pipe::new(stdout, keep)?, Pipe::new(stderr, keep)?]))
    }

    /// Whether some process holds one of them open.
    pub fn any_open(&self) -> bool {
        self.0.iter().any(|pipe| pipe.end.is_some())
    }

    /// Reads the available bytes, up to a limit. Returns whether there were any.
    pub fn read(&mut self) -> bool {
        let [stdout, stderr] = &mut self.0;
        stdout.read() | stderr.read()
    }

    /// Waits until one can be read or `longest` has passed; less when the child closed both.
    pub fn wait(&self, longest: Duration) {
        let ends = self.0.iter().filter_map(|pipe| pipe.end.as_ref());
        let mut polled: Vec<_> =
            ends.map(|end| PollFd::new(end.as_fd(), PollFlags::POLLIN)).collect();
        if polled.is_empty() {
            std::thread::sleep(longest.min(Duration::from_millis(1)));
            return;
        }
        let longest = longest.as_millis() as u16;
        // An error is a signal that arrived: the caller looks at everything anyway.
        let _ = poll(&mut polled, PollTimeout::from(longest.max(1)));
    }

    /// Reads what is left by a child that is gone, for at most `longest`.
    pub fn drain(&mut self, longest: Duration) {
        let until = Instant::now() + longest;
        while self.any_open() && Instant::now() < until {
            self.wait(until.saturating_duration_since(Instant::now()));
            self.read();
        }
    }

    /// What was read of standard output and standard error.
    pub fn finish(self) -> [Captured; 2] {
        self.0.map(|pipe| pipe.capture.finish())
    }
}

struct Pipe {
    end: Option<File>,
    capture: Capture,
}

impl Pipe {
    fn new(end: Option<OwnedFd>, keep: usize) -> io::Result<Self> {
        if let Some(end) = &end {
            fcntl(end, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        }
        Ok(Self { end: end.map(File::from), capture: Capture::new(keep) })
    }

    /// Reads the available bytes, up to a limit. Returns whether there were any.
    fn read(&mut self) -> bool {
        let Some(end) = &mut self.end else { return false };
        let (mut buffer, mut taken) = ([0; 64 << 10], 0);
        while taken < READ_AT_ONCE {
            match end.read(&mut buffer) {
                Ok(count @ 1..) => {
                    self.capture.push(&buffer[..count]);
                    taken += count;
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => break,
                Ok(0) | Err(_) => {
                    self.end = None;
                    break;
                }
            }
        }
        taken > 0
    }
}
