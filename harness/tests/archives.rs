//! Hostile archives, one test each: the finding, the entry it names, nothing written outside the
//! destination, nothing left inside it.

mod oddities;
mod tar;
mod zip_entries;
mod zip_whole;

use crate::support::scratch::assert_refused;
use crate::support::tar_bytes::{self, gz};
use crate::support::zip_bytes::{Entry, Zip};

/// A second, honest entry: a refusal must not keep it.
fn good() -> Entry {
    Entry::deflated("config.json", b"{}")
}

#[track_caller]
fn zip_refused(entries: impl IntoIterator<Item = Entry>, code: &str, path: &str) -> String {
    let entries = std::iter::once(good()).chain(entries);
    assert_refused(&Zip::of(entries).bytes(), "a.zip", code, path).message
}

#[track_caller]
fn tar_refused(entries: &[tar_bytes::Entry], code: &str, path: &str) -> String {
    let mut all = vec![tar_bytes::Entry::file("config.json", b"{}")];
    all.extend_from_slice(entries);
    let plain = assert_refused(&tar_bytes::tar(&all), "a.tar", code, path);
    let packed = assert_refused(&gz(&tar_bytes::tar(&all)), "a.tar.gz", code, path);
    assert_eq!(plain, packed);
    plain.message
}

/// Bytes that pack to about `1 / every` of their size.
fn noise(bytes: u32, every: u32) -> Vec<u8> {
    let mut seed = 1u32;
    (0..bytes)
        .map(|i| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if i % every == 0 { (seed >> 24) as u8 } else { 0 }
        })
        .collect()
}

#[test]
fn rar_gets_a_kind_sentence() {
    let finding = assert_refused(b"Rar!\x1a\x07\x01\x00....", "a.zip", "format_unsupported", "");
    assert!(finding.message.starts_with("this is a rar archive"), "{finding}");
    assert!(finding.hint.is_some_and(|hint| hint.starts_with("your files are fine")));
}

#[test]
fn seven_zip_gets_a_kind_sentence() {
    let finding = assert_refused(b"7z\xbc\xaf\x27\x1c....", "a.7z", "format_unsupported", "");
    assert!(finding.message.starts_with("this is a 7z archive"), "{finding}");
}

#[test]
fn xz_is_named() {
    assert_refused(b"\xfd7zXZ\0....", "a.tar.xz", "format_unsupported", "");
}

#[test]
fn web_page_is_named() {
    let finding = assert_refused(b"<!DOCTYPE html><html>", "a.zip", "format_unknown", "");
    assert!(finding.message.ends_with("found a web page"));
}

#[test]
fn empty_file() {
    assert_refused(b"", "a.zip", "empty", "");
}
