//! What is saved in the folder that is watched, and when that is to be checked.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, SystemTime};

use notify::{EventKind, RecommendedWatcher, RecursiveMode, Watcher as _};

/// A save is over after this long without another change: an editor may write several files, and one file in several
/// steps.
const QUIET: Duration = Duration::from_millis(150);
/// How often it is looked whether a folder that is gone is back.
const LOOK: Duration = Duration::from_millis(500);

/// The folder that is watched. It may go, be replaced, and come back.
pub(super) struct Watched {
    folder: PathBuf,
    watcher: RecommendedWatcher,
    identity: Option<Identity>,
}

impl Watched {
    /// Prepares to report what is saved in `folder`, other than what is `written` there.
    ///
    /// # Errors
    /// When the system gives no watcher.
    pub fn new(folder: &Path, written: &Path, saved: Sender<Happened>) -> notify::Result<Self> {
        let (watched, written) = (folder.to_owned(), written.to_owned());
        let watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
            // What cannot be told counts as a change.
            let paths = match event {
                Ok(event) if matches!(event.kind, EventKind::Access(_)) => return,
                Ok(event) => event.paths,
                Err(_) => vec![watched.clone()],
            };
            for path in paths.iter().filter(|path| is_source(path, &watched, &written)) {
                let change = if is_shader(path) { Change::Shader } else { Change::Other };
                let _ = saved.send(Happened::Saved(change));
            }
        })?;
        Ok(Self { folder: folder.to_owned(), watcher, identity: None })
    }

    /// Begins to watch.
    ///
    /// # Errors
    /// When the folder cannot be watched.
    pub fn begin(&mut self) -> notify::Result<()> {
        self.watcher.watch(&self.folder, RecursiveMode::Recursive)?;
        self.identity = identity(&self.folder);
        Ok(())
    }

    pub fn is_gone(&self) -> bool {
        self.identity.is_none()
    }

    /// Follows a folder that was replaced, or is back: to the system it is another one. Returns false where it was gone
    /// and still is.
    pub fn follow(&mut self) -> bool {
        let (now, before) = (identity(&self.folder), self.identity);
        if now != before {
            let _ = self.watcher.unwatch(&self.folder);
            let watches =
                |_: &Identity| self.watcher.watch(&self.folder, RecursiveMode::Recursive).is_ok();
            self.identity = now.filter(watches);
        }
        now.is_some() || before.is_some()
    }
}

/// What tells a folder from another one of its name; none where there is no folder.
fn identity(folder: &Path) -> Option<Identity> {
    let about = folder.metadata().ok().filter(std::fs::Metadata::is_dir)?;
    #[cfg(unix)]
    let (device, number) = {
        use std::os::unix::fs::MetadataExt as _;
        (about.dev(), about.ino())
    };
    #[cfg(not(unix))]
    let (device, number) = (0, 0);
    Some(Identity { device, number, created: about.created().ok() })
}

/// See [`identity`]. The system gives the number of a folder that was removed to a new one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Identity {
    device: u64,
    number: u64,
    created: Option<SystemTime>,
}

/// Whether a change of a file can change what a check finds.
pub(super) fn is_source(path: &Path, watched: &Path, written: &Path) -> bool {
    let Ok(inside) = path.strip_prefix(watched) else { return false };
    let hidden = |part: std::path::Component| {
        let name = part.as_os_str().to_string_lossy();
        name.starts_with('.') || name == "target" || name.ends_with('~')
    };
    !path.starts_with(written) && !inside.components().any(hidden)
}

/// Whether a file can change nothing but the realtime half of what a check finds.
pub(super) fn is_shader(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "wgsl")
}

/// What was saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// WGSL alone: what was found offline still holds.
    Shader,
    Other,
}

/// What a watch waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Happened {
    Saved(Change),
    /// The check with this number.
    Ended(usize),
    Interrupted,
}

/// What happens next; of a save, all that belongs to it. Nothing is looked at until then: an idle watch costs nothing.
/// Only a folder that is `gone` sends no word when it is back: then a while without any counts as a save.
pub(super) fn wait(happens: &Receiver<Happened>, gone: bool) -> Happened {
    let first = match gone {
        true => happens.recv_timeout(LOOK),
        false => happens.recv().map_err(RecvTimeoutError::from),
    };
    let first = match first {
        Ok(first) => first,
        Err(RecvTimeoutError::Timeout) => return Happened::Saved(Change::Other),
        Err(RecvTimeoutError::Disconnected) => return Happened::Interrupted,
    };
    let Happened::Saved(mut all) = first else { return first };
    while let Ok(next) = happens.recv_timeout(QUIET) {
        match next {
            Happened::Saved(change) if change == Change::Other => all = change,
            // What ended is about the save before.
            Happened::Saved(_) | Happened::Ended(_) => {}
            Happened::Interrupted => return next,
        }
    }
    Happened::Saved(all)
}

#[cfg(test)]
mod tests;
