//! Loading and calling plugins: foreign code behind safe functions.
//!
//! Only the worker does this, in a process of its own: a plugin may crash, hang or lie. "Safe" means that this side
//! keeps the promises of `renderer_api`. It does not restrain the plugin: the worker's process does. All `unsafe` of
//! plugin loading lives here.

mod scene;
mod witness;

use std::error::Error as _;
use std::ffi::c_void;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};

use renderer_api as api;

pub use scene::{LoadedScene, OfflineJob, OpenPass, RealtimeJob};
pub use witness::WitnessState;

/// A plugin that passed [`api::Plugin::check`]. It is never unloaded: threads that it left behind
/// may still run its code.
pub struct HostPlugin {
    table: &'static api::Plugin,
    _library: ManuallyDrop<libloading::Library>,
}

/// Why a library was refused.
#[derive(Debug, thiserror::Error)]
pub enum PluginError {
    /// The system's loader refuses it.
    #[error("cannot load the plugin {}: {message}", path.display())]
    Load {
        /// The library.
        path: PathBuf,
        /// Message of the loader.
        message: String,
    },
    /// The symbol [`api::ENTRY_SYMBOL`] is missing.
    #[error("{} does not export `{}`: use `export_renderer!` once", path.display(), api::ENTRY_SYMBOL)]
    NoEntry {
        /// The library.
        path: PathBuf,
    },
    /// Its table is not one of this interface.
    #[error("{}: {mismatch}", path.display())]
    Mismatch {
        /// The library.
        path: PathBuf,
        /// What differs.
        mismatch: api::Mismatch,
    },
}

/// What a call of the plugin answered instead of [`api::STATUS_OK`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct CallError {
    /// The status.
    pub kind: CallErrorKind,
    /// The plugin's message, at most [`MESSAGE_BYTES`] long.
    pub message: String,
}

/// The status of a failed call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallErrorKind {
    /// [`api::STATUS_ERROR`].
    Failed,
    /// [`api::STATUS_NOT_IMPLEMENTED`].
    NotImplemented,
    /// [`api::STATUS_PANICKED`].
    Panicked,
    /// [`api::STATUS_CANCELLED`].
    Cancelled,
    /// [`api::STATUS_NO_ADAPTER`].
    NoAdapter,
    /// No plugin's answer: a stage that Umbra's own pass was given is no WGSL.
    Stage,
    /// No plugin's answer: Umbra itself is at fault.
    Ours,
}

/// Longest message that a plugin can give, in bytes of UTF-8.
pub const MESSAGE_BYTES: usize = 4000;

impl HostPlugin {
    /// Loads the library at `path`, which runs its constructors, and checks its table.
    ///
    /// # Errors
    /// When the loader refuses it, the entry symbol is missing, or the table does not fit.
    pub fn load(path: &Path) -> Result<Self, PluginError> {
        let failed = |error: libloading::Error| PluginError::Load {
            path: path.to_owned(),
            // The loader's own words, not that of the call that failed.
            message: error.source().unwrap_or(&error).to_string(),
        };
        let library = open(path).map_err(failed)?;
        // SAFETY: the symbol is only looked up; its type is checked by `Plugin::check` below. The
        // interface says that it is a constant, so its address is a pointer to the table.
        let entry = unsafe { library.get::<*const api::Plugin>(api::ENTRY_SYMBOL) };
        let Ok(entry) = entry else {
            return Err(PluginError::NoEntry { path: path.to_owned() });
        };
        let table = *entry;
        // SAFETY: the address of an exported object. A foreign one may be shorter than the reads
        // of `check`; it still lies in a mapped page of the library or ends this worker.
        let table: &'static api::Plugin = unsafe { api::Plugin::check(table) }
            .map_err(|mismatch| PluginError::Mismatch { path: path.to_owned(), mismatch })?;
        Ok(Self { table, _library: ManuallyDrop::new(library) })
    }

    /// The renderer's name and version, for reports.
    pub fn name(&self) -> String {
        let text = |text: &api::Text| {
            // SAFETY: the interface says that both texts are valid while the library is loaded.
            String::from_utf8_lossy(unsafe { text.bytes() }).into_owned()
        };
        format!("{} {}", text(&self.table.name), text(&self.table.version))
    }

    /// Loads the scene whose TOML file is at `path`. `options` is empty except for the reference.
    ///
    /// # Errors
    /// What the plugin answers.
    pub fn load_scene(&self, path: &str, options: &str) -> Result<LoadedScene<'_>, CallError> {
        LoadedScene::load(self.table, path, options)
    }
}

#[cfg(unix)]
fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: constructors of foreign code run; this process is a worker's, made for that.
    let library = unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }?;
    Ok(library.into())
}

#[cfg(not(unix))]
fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    // SAFETY: constructors of foreign code run; this process is a worker's, made for that.
    unsafe { libloading::Library::new(path) }
}

/// Makes one call with a message buffer and turns its status into a result.
fn call(call: impl FnOnce(*mut api::Message) -> api::Status) -> Result<(), CallError> {
    call_noted(call).map(drop)
}

/// The same; answers what the plugin has to tell although all is well.
fn call_noted(call: impl FnOnce(*mut api::Message) -> api::Status) -> Result<String, CallError> {
    let mut buffer = vec![0u8; MESSAGE_BYTES];
    let mut message = api::Message { data: buffer.as_mut_ptr(), capacity: buffer.len(), length: 0 };
    let status = call(&mut message);
    let length = message.length.min(buffer.len());
    let mut message = String::from_utf8_lossy(&buffer[..length]).into_owned();
    if status == api::STATUS_OK {
        return Ok(message);
    }
    let kind = match status {
        api::STATUS_ERROR => CallErrorKind::Failed,
        api::STATUS_NOT_IMPLEMENTED => CallErrorKind::NotImplemented,
        api::STATUS_PANICKED => CallErrorKind::Panicked,
        api::STATUS_CANCELLED => CallErrorKind::Cancelled,
        api::STATUS_NO_ADAPTER => CallErrorKind::NoAdapter,
        unknown => {
            message = format!("the plugin answered with the unknown status {unknown}: {message}");
            CallErrorKind::Failed
        }
    };
    Err(CallError { kind, message })
}

/// A handle of the plugin's that must not be null after a successful call.
fn handle(handle: *mut c_void, what: &str) -> Result<*mut c_void, CallError> {
    if handle.is_null() {
        let message = format!("the plugin answered that it made a {what}, but the handle is null");
        return Err(CallError { kind: CallErrorKind::Failed, message });
    }
    Ok(handle)
}

/// The interface checks that every entry is set before a table is used.
const CHECKED: &str = "`Plugin::check` passed, so every entry is set";
