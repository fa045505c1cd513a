//! A zip as a whole: what lies beside the entries, its directory, and zip64.

use super::{good, zip_refused};
use crate::support::scratch::{assert_accepted, assert_refused};
use crate::support::zip_bytes::{Entry, Zip, extra};

/// Where a second reader could find another archive.
fn hidden() -> Vec<u8> {
    Zip::of([Entry::stored("src/lib.rs", b"hidden")]).bytes()
}

#[test]
fn zip_after_another_zip() {
    let bytes = [hidden(), Zip::of([good()]).bytes()].concat();
    assert_refused(&bytes, "a.zip", "zip_two_directories", "");
    let zip = Zip { prefix: hidden(), entries: vec![good()], ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_hidden_entry_before() {
    let local = hidden()[..40].to_vec();
    let zip = Zip { prefix: local, entries: vec![good()], ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_hidden_entry_between() {
    let local = hidden()[..40].to_vec();
    let zip = Zip { entries: vec![good()], gap: local, ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_hidden_entry_in_the_comment() {
    let local = hidden()[..40].to_vec();
    let zip = Zip { entries: vec![good()], comment: local, ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_hidden_entry_after() {
    let local = hidden()[..40].to_vec();
    let zip = Zip { entries: vec![good()], suffix: local, ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_before_another_zip() {
    let zip = Zip { entries: vec![good()], suffix: hidden(), ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_whose_offset_leads_to_another_directory() {
    // Counted from the file's first byte, the directory is one in the data of an entry.
    let inner = hidden();
    let at = inner.len() - 22 - (46 + 10);
    let mut outer = Zip::of([Entry::stored("a", &inner)]);
    outer.directory_offset = Some((30 + 1 + at) as u32);
    assert_refused(&outer.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_end_record_cut_off_in_a_nested_zip() {
    let zip = Zip::of([Entry::stored("inner.zip", &hidden())]).bytes();
    let cut = &zip[..zip.len() - 40];
    assert_refused(cut, "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_two_directories() {
    let inner = Zip::of([Entry::stored("other", b"x")]).bytes();
    let zip = Zip { entries: vec![good()], comment: inner, ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_two_directories", "");
}

#[test]
fn zip_count_lies() {
    let zip = Zip { entries: vec![good()], count: Some(2), ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_directory", "");
}

#[test]
fn zip_directory_points_past_the_end() {
    let zip = Zip { entries: vec![good()], directory_offset: Some(1 << 30), ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_directory", "");
}

#[test]
fn zip_bytes_between_directory_and_end() {
    let zip = Zip { entries: vec![good()], before_end: vec![7; 9], ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_directory", "");
}

#[test]
fn zip_offset_to_nowhere() {
    let mut entry = Entry::stored("a", b"x");
    entry.offset = Some(u32::MAX - 1);
    zip_refused([entry], "zip_local_missing", "a");
}

#[test]
fn zip_data_reach_into_the_directory() {
    let entry = Entry::stored("a", b"x").both(|h| (h.packed, h.unpacked) = (100_000, 100_000));
    zip_refused([entry], "zip_data_outside", "a");
}

/// The zip64 field of these numbers.
fn zip64_field(numbers: &[u64]) -> Vec<u8> {
    extra(1, &numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>())
}

#[test]
fn zip64_sizes_disagree() {
    let mut entry = Entry::stored("a", b"x");
    for (header, size) in [(&mut entry.local, 2), (&mut entry.central, 1)] {
        (header.packed, header.unpacked) = (u32::MAX, u32::MAX);
        header.extra = zip64_field(&[size, 1]);
    }
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip64_sizes_missing() {
    let entry = Entry::stored("a", b"x").both(|h| (h.packed, h.unpacked) = (u32::MAX, u32::MAX));
    zip_refused([entry], "zip64", "a");
}

#[test]
fn zip64_too_few_and_too_many_sizes() {
    for numbers in [&[1][..], &[1, 1, 0, 0]] {
        let entry = Entry::stored("a", b"x").both(|h| {
            (h.packed, h.unpacked) = (u32::MAX, u32::MAX);
            h.extra = zip64_field(numbers);
        });
        zip_refused([entry], "zip64", "a");
    }
}

#[test]
fn zip64_sizes_of_exabytes() {
    let entry = Entry::stored("a", b"x").both(|h| {
        (h.packed, h.unpacked) = (u32::MAX, u32::MAX);
        h.extra = zip64_field(&[u64::MAX, u64::MAX]);
    });
    zip_refused([entry], "zip_data_outside", "a");
}

#[test]
fn zip64_place_outside() {
    for place in [u64::MAX, 1 << 40] {
        let mut entry = Entry::stored("a", b"x");
        entry.offset = Some(u32::MAX);
        entry.central.extra = zip64_field(&[place]);
        zip_refused([entry], "zip_local_missing", "a");
    }
}

/// A zip whose end is a zip64 record, its locator and an end record that holds nothing; `change` lies.
fn zip64_end(change: impl Fn(&mut [u8])) -> Vec<u8> {
    let mut bytes = Zip::of([good(), Entry::stored("a", b"x")]).bytes();
    let end = bytes.split_off(bytes.len() - 22);
    let field = |at: usize| u64::from(u32::from_le_bytes(end[at..at + 4].try_into().unwrap()));
    let (size, offset) = (field(12), field(16));
    let start = bytes.len();
    bytes.extend(b"PK\x06\x06");
    bytes.extend(44u64.to_le_bytes());
    bytes.extend([45, 3, 45, 0]);
    bytes.extend([0; 8]);
    for number in [2, 2, size, offset] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(b"PK\x06\x07\0\0\0\0");
    bytes.extend((offset + size).to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([0xff; 12]);
    bytes.extend([0; 2]);
    change(&mut bytes[start..]);
    bytes
}

#[test]
fn zip64_end_records_disagree() {
    assert_accepted(&zip64_end(|_| ()), "a.zip", "");
    let lie = |at: usize, code: &str| {
        let bytes = zip64_end(|end| end[at] ^= 1);
        assert_refused(&bytes, "a.zip", code, "");
    };
    // Its own length, its disk, its counts, size and offset of the directory.
    lie(4, "zip64");
    lie(16, "zip64");
    lie(24, "zip_multi_disk");
    lie(40, "zip64");
    lie(48, "zip64");
    // The locator's place and number of disks.
    lie(56 + 8, "zip64");
    lie(56 + 4, "zip_multi_disk");
    // What the plain record holds although it need not.
    for at in [8, 12, 16] {
        lie(76 + at, "zip64");
    }
}

#[test]
fn zip64_count_lies() {
    let bytes = zip64_end(|end| (end[24], end[32]) = (3, 3));
    assert_refused(&bytes, "a.zip", "zip_directory", "");
    let bytes = zip64_end(|end| end[24..40].fill(0xff));
    assert_refused(&bytes, "a.zip", "limit_entries", "");
}

#[test]
fn zip64_extra_beside_plain_sizes() {
    let mut entry = Entry::stored("a", b"x");
    entry.central.extra = extra(1, &[9; 16]);
    zip_refused([entry], "zip64", "a");
}

#[test]
fn zip64_end_locator() {
    let mut locator = b"PK\x06\x07".to_vec();
    locator.extend([0; 16]);
    let zip = Zip { entries: vec![good()], before_end: locator, ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip64", "");
}

#[test]
fn zip_over_several_disks() {
    let zip = Zip { entries: vec![good()], disk: 1, ..Zip::default() };
    assert_refused(&zip.bytes(), "a.zip", "zip_multi_disk", "");
}

#[test]
fn zip_truncated() {
    let bytes = Zip::of([good(), Entry::stored("a", b"xxxx")]).bytes();
    assert_refused(&bytes[..bytes.len() - 30], "a.zip", "zip_truncated", "");
}

#[test]
fn zip_empty() {
    assert_refused(&Zip::default().bytes(), "a.zip", "empty", "");
}

#[test]
fn zip_only_junk() {
    let junk = [Entry::stored("__MACOSX/._x", b"x"), Entry::stored(".DS_Store", b"x")];
    assert_refused(&Zip::of(junk).bytes(), "a.zip", "empty", "");
}
