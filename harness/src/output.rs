//! Printing that survives a closed pipe. If the reader goes away (`umbra check | head`), nothing more is printed, but
//! all other work goes on, so that no report is lost. [`end_of_closed_pipe`] then ends the program like any other that
//! writes into a closed pipe.
//!
//! The macros take the place of the standard library's, which panic. What they print is harmless to a terminal,
//! whatever names it holds; only `print_as_is!` prints sequences that mean something to one.

use std::fmt;
use std::io::{ErrorKind, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::harmless::harmless_output;

/// Whether nobody reads standard output any more.
static CLOSED: AtomicBool = AtomicBool::new(false);

/// Prints to standard output, made harmless.
///
/// # Panics
/// As [`print_as_is`].
pub fn print(text: fmt::Arguments) {
    print_as_is(format_args!("{}", harmless_output(&text.to_string())));
}

/// Prints to standard output.
///
/// # Panics
/// When writing fails for another reason than a closed pipe; `Bug::unprintable` recognizes the message.
pub fn print_as_is(text: fmt::Arguments) {
    if CLOSED.load(Ordering::Relaxed) {
        return;
    }
    match std::io::stdout().lock().write_fmt(text) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {
            CLOSED.store(true, Ordering::Relaxed);
        }
        Err(error) => panic!("failed printing to stdout: {error}"),
        Ok(()) => {}
    }
}

/// Prints to standard error, made harmless, where that can be written.
pub fn eprint(text: fmt::Arguments) {
    let text = harmless_output(&text.to_string());
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// Ends the program by the signal of a closed pipe, if standard output was one.
pub fn end_of_closed_pipe() {
    #[cfg(unix)]
    if CLOSED.load(Ordering::Relaxed) {
        use nix::sys::signal::{SigHandler, Signal, raise, signal};
        // SAFETY: the default action replaces an ignored signal; no handler runs.
        let _ = unsafe { signal(Signal::SIGPIPE, SigHandler::SigDfl) };
        let _ = raise(Signal::SIGPIPE);
    }
}

macro_rules! print {
    ($($text:tt)*) => { $crate::output::print(format_args!($($text)*)) };
}
macro_rules! print_as_is {
    ($($text:tt)*) => { $crate::output::print_as_is(format_args!($($text)*)) };
}
macro_rules! println {
    () => { $crate::output::print(format_args!("\n")) };
    ($($text:tt)*) => { $crate::output::print(format_args!("{}\n", format_args!($($text)*))) };
}
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::output::eprint(format_args!("{}\n", format_args!($($text)*))) };
}
macro_rules! eprint {
    ($($text:tt)*) => { $crate::output::eprint(format_args!($($text)*)) };
}
