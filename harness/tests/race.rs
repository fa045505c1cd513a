//! A folder that changes while it is copied: whoever hands it in swaps a folder of it for a link to somebody
//! else's file, again and again. Nothing behind the link may ever be copied.

#![cfg(target_os = "linux")]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nix::fcntl::{AT_FDCWD, RenameFlags, renameat2};
use umbra::files::files_below;
use umbra::intake::{ArchiveLimits, IntakeError, TreeSpec, unpack};

const SECRET: &str = "the secret of another student";
/// Enough for some twenty thousand swaps and some thousand copies.
const TIME: Duration = Duration::from_secs(10);

/// Exchanges two paths in one step, without an end.
fn swap(a: &Path, b: &Path, stop: &AtomicBool) -> u64 {
    let mut swaps = 0;
    while !stop.load(Ordering::Relaxed) {
        renameat2(AT_FDCWD, a, AT_FDCWD, b, RenameFlags::RENAME_EXCHANGE).unwrap();
        swaps += 1;
    }
    swaps
}

/// Copies `submission` while `a` and `b` are exchanged; answers copies, refusals and swaps.
fn race(place: &Path, submission: &Path, a: &Path, b: &Path) -> (u32, u32, u64) {
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
    let stop = AtomicBool::new(false);
    let (mut copies, mut refusals) = (0, 0);
    let swaps = std::thread::scope(|scope| {
        let swaps = scope.spawn(|| swap(a, b, &stop));
        let begin = Instant::now();
        while begin.elapsed() < TIME / 2 {
            let dest = tempfile::tempdir_in(place).unwrap();
            match unpack(submission, dest.path(), &tree, &limits) {
                Ok(_) => copies += 1,
                Err(IntakeError::Refused(refusal)) => {
                    let code = refusal.findings[0].code.as_str();
                    assert!(["link", "changed_while_read"].contains(&code), "{refusal:?}");
                    refusals += 1;
                }
                Err(error) => panic!("{error}"),
            }
            for file in files_below(dest.path()).unwrap() {
                let content = fs::read_to_string(&file).unwrap();
                assert!(!content.contains(SECRET), "{} was copied", file.display());
            }
        }
        stop.store(true, Ordering::Relaxed);
        swaps.join().unwrap()
    });
    (copies, refusals, swaps)
}

#[test]
fn nothing_behind_a_link_is_copied_however_fast_it_comes_and_goes() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    for folder in ["class/eve/src", "class/eve/src/deep", "secret/src/deep", "secret/deep"] {
        fs::create_dir_all(at(folder)).unwrap();
    }
    for folder in ["class/eve/src", "class/eve/src/deep"] {
        fs::write(at(folder).join("lib.rs"), "her own").unwrap();
    }
    for folder in ["secret", "secret/src", "secret/src/deep", "secret/deep"] {
        fs::write(at(folder).join("lib.rs"), SECRET).unwrap();
    }
    // A folder in it, and the submission itself.
    symlink(at("secret/src"), at("link-to-src")).unwrap();
    let found = race(place.path(), &at("class/eve"), &at("class/eve/src"), &at("link-to-src"));
    let (copies, refusals, swaps) = found;
    assert!(copies > 10 && refusals > 10 && swaps > 100, "{found:?}");
    // An odd number of swaps left the link in the folder.
    if at("class/eve/src").is_symlink() {
        fs::rename(at("class/eve/src"), at("aside")).unwrap();
        fs::rename(at("link-to-src"), at("class/eve/src")).unwrap();
    }
    symlink(at("secret"), at("link-to-all")).unwrap();
    let found = race(place.path(), &at("class/eve"), &at("class/eve"), &at("link-to-all"));
    let (copies, refusals, swaps) = found;
    assert!(copies > 10 && refusals > 10 && swaps > 100, "{found:?}");
}
