//! The terminal: its width, its colors, and the display of progress.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::harmless::harmless;

/// Columns where there is no terminal, and nobody says how many there are.
const LOG_COLUMNS: usize = 160;
/// In a log, progress is repeated at this interval.
const LOG_INTERVAL: Duration = Duration::from_secs(10);

/// How wide standard output is, in columns: as `COLUMNS` says, else as the terminal is.
pub fn width() -> usize {
    let told = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    let term = console::Term::stdout();
    let own = || Some(usize::from(term.size_checked()?.1));
    told.filter(|&columns| columns > 0).or_else(own).unwrap_or(LOG_COLUMNS)
}

/// Whether standard output takes colors; a `NO_COLOR` that is not empty refuses them, and changes
/// nothing else.
pub fn colors() -> bool {
    let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    std::io::stdout().is_terminal() && !refused
}

/// What is being done, on standard error: a line or bar that changes on a terminal, lines in a log.
pub struct Progress {
    /// Draws nothing in a log.
    line: ProgressBar,
    /// In a log: the first word that was told last, and when.
    log: Option<Mutex<(String, Instant)>>,
}

impl Progress {
    /// A line.
    pub fn new() -> Self {
        let line = ProgressBar::new_spinner();
        line.set_style(style("{spinner} {wide_msg}"));
        let log =
            (!std::io::stderr().is_terminal()).then(|| Mutex::new((String::new(), Instant::now())));
        Self { line, log }
    }

    /// Tells what is being done. In a log, a message that begins with the same word as the one before
    /// is another step of the same, and told only now and then.
    pub fn say(&self, message: &str) {
        self.line.set_message(harmless(message));
        self.line.tick();
        let Some(mut told) = self.log.as_ref().and_then(|log| log.lock().ok()) else { return };
        let word = message.split(' ').next().unwrap_or_default();
        if told.0 != word || told.1.elapsed() >= LOG_INTERVAL {
            *told = (word.to_owned(), Instant::now());
            eprintln!("umbra: {message}");
        }
    }

    /// Nothing more is being done.
    pub fn end(&self) {
        self.line.finish_and_clear();
    }

    /// A line that stays, above what is being done.
    pub fn note(&self, message: &str) {
        self.line.suspend(|| eprintln!("umbra: {message}"));
    }

    /// From now on so many steps are counted, each told by [`Progress::step`].
    pub fn count(&self, steps: usize) {
        self.line.set_style(style("{wide_bar} {pos} of {len}, {eta} left; {msg}"));
        self.line.set_length(steps as u64);
        self.line.reset_elapsed();
    }

    /// What one of the counted steps is at; told on a terminal alone.
    pub fn at(&self, message: &str) {
        self.line.set_message(harmless(message));
        self.line.tick();
    }

    /// One of the counted steps is done. A log gets the line, and how long the rest will take.
    pub fn step(&self, message: &str) {
        self.line.inc(1);
        if self.log.is_none() {
            return;
        }
        let (done, all) = (self.line.position(), self.line.length().unwrap_or_default());
        let rest = all.saturating_sub(done);
        let left = self.line.elapsed().mul_f64(rest as f64 / done.max(1) as f64);
        let left = if rest == 0 { String::new() } else { format!("; {} left", about(left)) };
        eprintln!("umbra: {done} of {all}: {message}{left}");
    }
}

/// A duration in a few words: `about 40 s`, `about 3 min`.
pub fn about(time: Duration) -> String {
    match time.as_secs() {
        s @ 0..100 => format!("about {} s", s.max(1)),
        s @ 100..6000 => format!("about {} min", (s + 30) / 60),
        s => format!("about {} h", (s + 1800) / 3600),
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_short() {
        for (s, text) in
            [(0, "about 1 s"), (99, "about 99 s"), (100, "about 2 min"), (7000, "about 2 h")]
        {
            assert_eq!(about(Duration::from_secs(s)), text);
        }
    }
}
