//! A scratch place in which everything but the destination is watched.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use umbra::assignment::Assignment;
use umbra::decode::Decoder;
use umbra::intake::{
    ArchiveLimits, Finding, IntakeError, Severity, Submission, TreeSpec, unpack, unpack_bytes,
};
use umbra::worker::Supervisor;

/// `root/around/dest` is the destination; everything else below `root` must stay as it is.
pub struct Scratch {
    pub root: tempfile::TempDir,
    pub dest: PathBuf,
}

impl Scratch {
    pub fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        let dest = root.path().join("around/dest");
        fs::create_dir_all(&dest).unwrap();
        fs::write(root.path().join("around/canary.txt"), "canary").unwrap();
        Self { root, dest }
    }

    /// Everything below the root but outside the destination, with contents.
    pub fn outside(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut all = listing(self.root.path());
        all.retain(|path, _| !path.starts_with(&self.dest));
        all
    }

    /// In a confined child, as submissions are; in this process the same must come out.
    pub fn unpack(
        &self,
        bytes: &[u8],
        name: &str,
        limits: &ArchiveLimits,
    ) -> Result<Submission, IntakeError> {
        let tree = TreeSpec::default();
        let apart =
            with_decoder(|decoder| decoder.unpack_bytes(bytes, name, &self.dest, &tree, limits));
        let here = Self::new();
        let own = here.unpack_here(bytes, name, limits);
        match (&apart, &own) {
            (Ok(apart), Ok(own)) => {
                let root = own.root.strip_prefix(&here.dest).unwrap();
                assert_eq!(*apart, Submission { root: self.dest.join(root), ..own.clone() });
            }
            (Err(IntakeError::Refused(apart)), Err(IntakeError::Refused(own))) => {
                assert_eq!(apart, own);
            }
            (Err(_), _) => {}
            (Ok(_), Err(own)) => panic!("a child unpacked what is refused here: {own}"),
        }
        apart
    }

    /// In this process.
    pub fn unpack_here(
        &self,
        bytes: &[u8],
        name: &str,
        limits: &ArchiveLimits,
    ) -> Result<Submission, IntakeError> {
        unpack_bytes(bytes, name, &self.dest, &TreeSpec::default(), limits)
    }
}

/// Calls `body` with what decodes submissions, and looks for what its children leave behind.
pub fn with_decoder<T>(body: impl FnOnce(&Decoder) -> T) -> T {
    let scratch = tempfile::tempdir().unwrap();
    let supervisor = Supervisor::new(env!("CARGO_BIN_EXE_umbra").into(), scratch.path().into());
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let limits = Assignment::load(root).unwrap().limits.decode;
    let result = body(&Decoder::new(&supervisor, &limits, &AtomicBool::new(false)));
    assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 0, "something was left behind");
    result
}

/// Files and links below `folder`, with contents.
pub fn listing(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let metadata = path.symlink_metadata().unwrap();
            if metadata.is_dir() {
                open.push(path);
            } else if metadata.is_file() {
                let content = fs::read(&path).unwrap();
                all.insert(path, content);
            } else {
                // Reading a fifo would wait for ever.
                all.insert(path, Vec::new());
            }
        }
    }
    all
}

/// Small limits, so that bombs in tests are small.
pub fn small_limits() -> ArchiveLimits {
    ArchiveLimits {
        max_entries: 40,
        max_total_mib: 4,
        max_file_mib: 2,
        max_ratio: 100,
        ratio_from_mib: 1,
        max_depth: 6,
        max_path_bytes: 120,
    }
}

/// Asserts that the archive is refused with `code` for `path` (empty: none named), that the
/// destination is empty afterwards and that nothing else changed. Returns the finding.
#[track_caller]
pub fn assert_refused(bytes: &[u8], name: &str, code: &str, path: &str) -> Finding {
    let scratch = Scratch::new();
    let before = scratch.outside();
    let result = scratch.unpack(bytes, name, &small_limits());
    check_refused(&scratch, before, result, code, path)
}

/// Like [`assert_refused`], of a folder.
#[track_caller]
pub fn assert_folder_refused(make: impl Fn(&Path), code: &str, path: &str) -> Finding {
    let scratch = Scratch::new();
    let source = scratch.root.path().join("a2_ada_lampglow");
    fs::create_dir(&source).unwrap();
    make(&source);
    let before = scratch.outside();
    let result = unpack(&source, &scratch.dest, &TreeSpec::default(), &small_limits());
    check_refused(&scratch, before, result, code, path)
}

#[track_caller]
fn check_refused(
    scratch: &Scratch,
    before: BTreeMap<PathBuf, Vec<u8>>,
    result: Result<Submission, IntakeError>,
    code: &str,
    path: &str,
) -> Finding {
    let refusal = match result {
        Err(IntakeError::Refused(refusal)) => refusal,
        Err(other) => panic!("expected a refusal, found {other}"),
        Ok(submission) => panic!("expected a refusal with {code}, found {submission:#?}"),
    };
    assert_eq!(scratch.outside(), before, "something outside the destination changed");
    assert_eq!(fs::read_dir(&scratch.dest).unwrap().count(), 0, "the destination is not empty");
    let first = &refusal.findings[0];
    assert_eq!(
        (first.severity, first.code.as_str(), first.path.as_deref().unwrap_or("")),
        (Severity::Error, code, path),
        "{:#?}",
        refusal.findings
    );
    for finding in &refusal.findings {
        assert!(!finding.to_string().chars().any(char::is_control), "{finding:?}");
    }
    first.clone()
}

/// Asserts that the archive is accepted with a finding `code`, and only the destination written.
#[track_caller]
pub fn assert_accepted(bytes: &[u8], name: &str, code: &str) -> (Submission, Scratch) {
    let scratch = Scratch::new();
    let before = scratch.outside();
    let submission = match scratch.unpack(bytes, name, &small_limits()) {
        Ok(submission) => submission,
        Err(error) => panic!("expected a copy, found {error}"),
    };
    assert_eq!(scratch.outside(), before, "something outside the destination changed");
    let codes: Vec<&str> = submission.findings.iter().map(|f| f.code.as_str()).collect();
    if code.is_empty() {
        assert_eq!(submission.findings, []);
    } else {
        assert!(codes.contains(&code), "{codes:?}");
    }
    (submission, scratch)
}
