//! Any bytes at all: no panic, nothing written outside the destination, limits kept.

use crate::support::scratch::{Scratch, listing, small_limits};
use crate::support::tar_bytes::{self, gz, tar};
use crate::support::zip_bytes::{Entry, Zip};
use proptest::prelude::*;
use umbra::intake::{
    IntakeError, SubmittedConfig, TreeSpec, check_config, scan_text, validate_submission,
};

/// Unpacks and checks what must hold of every submission; whether it was accepted.
fn survives(bytes: &[u8]) -> Result<bool, TestCaseError> {
    let scratch = Scratch::new();
    let before = scratch.outside();
    let result = scratch.unpack_here(bytes, "a.zip", &small_limits());
    prop_assert_eq!(scratch.outside(), before);
    let written = listing(&scratch.dest);
    match result {
        Ok(submission) => {
            prop_assert_eq!(written.len(), submission.files.len());
            let total: usize = written.values().map(Vec::len).sum();
            prop_assert!(total <= 4 << 20);
            let validation = validate_submission(&submission, &TreeSpec::default());
            prop_assert!(validation.is_ok_and(|v| !v.to_text().is_empty()));
            Ok(true)
        }
        Err(IntakeError::Refused(refusal)) => {
            prop_assert!(written.is_empty());
            prop_assert!(!refusal.findings.is_empty());
            Ok(false)
        }
        Err(other) => Err(TestCaseError::fail(other.to_string())),
    }
}

/// Small but complete archives of each kind.
fn archives() -> Vec<Vec<u8>> {
    let zip = Zip::of([
        Entry::deflated("config.json", b"{\"id\": 1}"),
        Entry::stored("src/lib.rs", b"fn x() {}").streamed(),
    ]);
    let entries = [
        tar_bytes::Entry::long_name("src/lib.rs"),
        tar_bytes::Entry::file("x", b"fn x() {}"),
        tar_bytes::Entry::pax(b'x', &[("path", "src/a.rs"), ("size", "1")]),
        tar_bytes::Entry::file("config.json", b"{"),
    ];
    vec![zip.bytes(), tar(&entries), gz(&tar(&entries))]
}

#[test]
fn the_archives_to_be_damaged_are_accepted() {
    for bytes in archives() {
        assert!(survives(&bytes).unwrap());
    }
}

/// Bytes before the tar checksum is made right again, so that changes reach the fields.
fn repair_tar_checksums(bytes: &mut [u8]) {
    for block in bytes.chunks_exact_mut(512) {
        if block[257..262] == *b"ustar" {
            block[148..156].copy_from_slice(b"        ");
            let sum: u32 = block.iter().map(|b| u32::from(*b)).sum();
            block[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes(kind in 0..4usize, mut bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        let magic: [&[u8]; 4] = [b"", b"PK\x03\x04", b"\x1f\x8b\x08", b"PK\x05\x06"];
        bytes.splice(0..0, magic[kind].iter().copied());
        survives(&bytes)?;
        let mut end = bytes.clone();
        end.extend(b"PK\x05\x06");
        end.extend(&bytes[..bytes.len().min(18)]);
        survives(&end)?;
    }

    #[test]
    fn damaged_archives(
        which in 0..3usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
        repaired in any::<bool>(),
    ) {
        let mut bytes = archives().swap_remove(which);
        for (index, value) in changes {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        if repaired && which == 1 {
            repair_tar_checksums(&mut bytes);
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        survives(&bytes)?;
    }

    #[test]
    fn any_names(names in prop::collection::vec("(\\.\\./|/|a|B|b|\\\\|\\.|\u{202e}|\0|__MACOSX/|é){1,6}", 1..5)) {
        let zip = Zip::of(names.iter().map(|name| Entry::stored(name, b"x")));
        let accepted = survives(&zip.bytes())?;
        // Where no name holds a slash, a backslash is one.
        let slash = if names.iter().any(|name| name.contains('/')) { '/' } else { '\\' };
        let bad = |name: &String| name.contains(['\0', '\u{202e}']) || name.starts_with(slash)
            || name.split(slash).any(|c| c == "..") || (slash == '/' && name.contains('\\'));
        prop_assert!(!accepted || !names.iter().any(bad));
        let entries: Vec<_> = names.iter().map(|name| tar_bytes::Entry::file(name, b"x")).collect();
        survives(&tar(&entries))?;
    }

    #[test]
    fn any_config(text in "([{}\\[\\],:\"'\\\\/#*]|render|renders|id|1|-|\n|\u{feff}|é| ){0,60}", bytes in prop::collection::vec(any::<u8>(), 0..100)) {
        for bytes in [text.as_bytes(), &bytes] {
            let (config, findings, is_whole) = SubmittedConfig::parse(bytes);
            let findings: Vec<_> = findings.into_iter().chain(check_config(&config, is_whole, &["a.exr"], &[], &TreeSpec::default())).collect();
            for finding in findings {
                prop_assert!(finding.line.is_some_and(|line| line >= 1), "{finding}");
                prop_assert!(finding.hint.is_some() && finding.path.is_some(), "{finding}");
            }
        }
    }

    #[test]
    fn well_formed_json_is_accepted(first in "[a-zA-Zé \"\\\\/\t]{0,12}", id in any::<u64>()) {
        let text = serde_json::json!({ "firstName": first, "id": id, "x": [1.5, null, { "y": [] }] }).to_string();
        let (config, findings, _) = SubmittedConfig::parse(text.as_bytes());
        prop_assert_eq!(findings, []);
        prop_assert_eq!(config.sampler_seed(), Some(id));
        prop_assert_eq!(config.first_name.map(|f| f.text), Some(first.trim().to_owned()));
    }

    #[test]
    fn any_source(text in "([\"'#!/*\\[\\]{}:;,a\n\\\\]|r|b|unsafe|std|extern|include_str|path|=| ){0,80}") {
        let lines = text.lines().count().max(1) as u32 + 1;
        for finding in scan_text("src/a.rs", &text) {
            prop_assert!(finding.line.is_none_or(|line| (1..=lines).contains(&line)));
        }
    }
}
