//! From errors and panics to a status with a message.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, Once};

use super::api;
use crate::realtime::RayRefused;
use crate::{Error, Result};

/// Where the last panic of this library happened.
static PANIC_PLACE: Mutex<Option<String>> = Mutex::new(None);

/// Runs `body` and turns its error or panic into a status and a message.
pub fn guard(message: *mut api::Message, body: impl FnOnce() -> Result<()>) -> api::Status {
    guard_noting(message, || body().map(|()| String::new()))
}

/// The same for a call that has something to tell when it succeeds.
pub fn guard_noting(
    message: *mut api::Message,
    body: impl FnOnce() -> Result<String>,
) -> api::Status {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        std::panic::set_hook(Box::new(|info| {
            // That one is an error of the scene, told by the answer.
            if !panic_text(info.payload()).starts_with(crate::scene::NO_LIGHT) {
                eprintln!("{info}");
            }
            if let Ok(mut place) = PANIC_PLACE.lock() {
                *place = info.location().map(|l| format!("{}:{}", l.file(), l.line()));
            }
        }));
    });
    let (status, said) = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(note)) if note.is_empty() => return api::STATUS_OK,
        Ok(Ok(note)) => (api::STATUS_OK, note),
        // The status says it already: the message is the task alone, as for `todo!()`.
        Ok(Err(Error::NotImplemented(task))) => (api::STATUS_NOT_IMPLEMENTED, task),
        Ok(Err(error)) => (status_of(&error), error.to_string()),
        Err(payload) => {
            let described = describe_panic(payload.as_ref());
            forget(payload);
            described
        }
    };
    // SAFETY: the host's message with a buffer of `capacity` bytes.
    unsafe {
        let message = &mut *message;
        let mut length = said.len().min(message.capacity);
        while !said.is_char_boundary(length) {
            length -= 1;
        }
        std::ptr::copy_nonoverlapping(said.as_ptr(), message.data, length);
        message.length = length;
    }
    status
}

fn status_of(error: &Error) -> api::Status {
    match error {
        Error::NoAdapter(_) => api::STATUS_NO_ADAPTER,
        Error::Cancelled => api::STATUS_CANCELLED,
        _ => api::STATUS_ERROR,
    }
}

/// What a panic says.
fn panic_text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("a panic without a message")
}

/// Dropping a panic's payload may panic again, which would end the worker.
pub fn forget(payload: Box<dyn Any + Send>) {
    std::mem::forget(payload);
}

/// `todo!()` and `unimplemented!()` are panics with a fixed beginning: not a crash, but work to do.
fn describe_panic(payload: &(dyn Any + Send)) -> (api::Status, String) {
    if payload.is::<RayRefused>() {
        let error = RayRefused::error();
        return (status_of(&error), error.to_string());
    }
    let said = panic_text(payload).to_owned();
    let task = ["not yet implemented", "not implemented"].iter().find_map(|p| said.strip_prefix(p));
    if let Some(task) = task {
        let task = task.trim_start_matches(':').trim();
        return (api::STATUS_NOT_IMPLEMENTED, task.to_owned());
    }
    if said.starts_with(crate::scene::NO_LIGHT) {
        return (api::STATUS_ERROR, said);
    }
    let place = PANIC_PLACE.lock().ok().and_then(|mut place| place.take());
    match place {
        Some(place) => (api::STATUS_PANICKED, format!("{said} (at {place})")),
        None => (api::STATUS_PANICKED, said),
    }
}
