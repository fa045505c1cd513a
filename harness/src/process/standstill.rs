//! Whether a child is idle by its own choice. By the clock alone, a starved child on a busy machine looks like a
//! sleeping one; the states of its threads tell them apart.

use std::fs::{read_dir, read_to_string};
use std::time::{Duration, Instant};

use nix::unistd::Pid;

/// The most that counts between two looks.
const LONGEST: Duration = Duration::from_secs(1);

/// How long a child stood still: neither computed nor waited for a processor or a disk.
pub(super) struct Standstill {
    looked: Instant,
    was_still: bool,
    so_far: Duration,
}

impl Standstill {
    pub fn new(now: Instant) -> Self {
        Self { looked: now, was_still: false, so_far: Duration::ZERO }
    }

    /// Counts the time since the last look, if the child stood still at both. What the system does
    /// not tell (`None`) counts as if it had.
    pub fn look(&mut self, now: Instant, still: Option<bool>) {
        let since = now.saturating_duration_since(self.looked);
        match still {
            None => self.so_far += since,
            Some(true) if self.was_still => self.so_far += since.min(LONGEST),
            Some(_) => {}
        }
        (self.looked, self.was_still) = (now, still.unwrap_or(false));
    }

    pub fn so_far(&self) -> Duration {
        self.so_far
    }
}

/// Whether no thread of a process and its descendants runs, wants to run or waits for a disk; nothing
/// where the system does not tell.
pub(super) fn stands_still(pid: Pid) -> Option<bool> {
    let threads = read_dir(format!("/proc/{pid}/task")).ok()?;
    for thread in threads.flatten() {
        let stat = read_to_string(thread.path().join("stat")).unwrap_or_default();
        // The name before it may hold anything.
        let state = stat.rsplit_once(") ").and_then(|(_, rest)| rest.bytes().next());
        if matches!(state, Some(b'R' | b'D')) {
            return Some(false);
        }
        let children = read_to_string(thread.path().join("children")).unwrap_or_default();
        for child in children.split_whitespace().filter_map(|pid| pid.parse().ok()) {
            if stands_still(Pid::from_raw(child)) == Some(false) {
                return Some(false);
            }
        }
    }
    Some(true)
}

/// CPU seconds of a process's threads so far, without its children's; 0 when it is not known.
pub(super) fn cpu_s(pid: Pid) -> f64 {
    let stat = read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let rest = stat.rsplit_once(") ").map_or("", |(_, rest)| rest);
    // Fields 14 and 15 of proc(5), in hundredths: USER_HZ is 100 wherever Linux shows it.
    let ticks = rest.split(' ').skip(11).take(2).filter_map(|field| field.parse::<u64>().ok());
    ticks.sum::<u64>() as f64 / 100.0
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::process::{Command, Stdio};

    use super::*;

    /// What a shell command looks like after a moment.
    fn seen(script: &str) -> (Option<bool>, f64) {
        let mut shell = Command::new("sh");
        shell.args(["-c", script]).stdout(Stdio::null()).stderr(Stdio::null());
        let mut shell = shell.spawn().expect("a shell");
        std::thread::sleep(Duration::from_millis(300));
        let pid = Pid::from_raw(shell.id() as i32);
        let seen = (stands_still(pid), cpu_s(pid));
        shell.kill().expect("a child of ours");
        shell.wait().expect("a child of ours");
        seen
    }

    #[test]
    fn who_sleeps_stands_still_and_who_computes_or_has_a_child_that_does_does_not() {
        assert_eq!(seen("exec sleep 5").0, Some(true));
        let (still, cpu_s) = seen("while :; do :; done");
        assert_eq!(still, Some(false));
        assert!(cpu_s > 0.0);
        // The shell itself only waits; the time limit ends what it is killed too early to end.
        assert_eq!(seen("timeout 2 sh -c 'while :; do :; done'; true").0, Some(false));
        assert_eq!(seen("sleep 2; true").0, Some(true));
    }

    #[test]
    fn only_time_between_two_still_looks_counts() {
        let begin = Instant::now();
        let at = |ms| begin + Duration::from_millis(ms);
        let mut still = Standstill::new(begin);
        for (ms, state, expected) in [
            (20, Some(true), 0),
            (40, Some(true), 20),
            (60, Some(false), 20),
            (80, Some(true), 20),
            (100, Some(true), 40),
            // This process was starved itself.
            (9_100, Some(true), 1_040),
            (9_200, None, 1_140),
        ] {
            still.look(at(ms), state);
            assert_eq!(still.so_far(), Duration::from_millis(expected), "at {ms} ms");
        }
    }
}
