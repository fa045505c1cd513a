//! Hostile archives, one test each: the finding, the entry it names, nothing written outside the
//! destination, nothing left inside it.

use umbra::intake::Submission;

use crate::support::scratch::{assert_accepted, assert_refused};
use crate::support::tar_bytes::{self, gz, pax_record, tar};
use crate::support::zip_bytes::{Entry, Zip, crc32, deflated, extra};

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
    let plain = assert_refused(&tar(&all), "a.tar", code, path);
    let packed = assert_refused(&gz(&tar(&all)), "a.tar.gz", code, path);
    assert_eq!(plain, packed);
    plain.message
}

// --- names ---

#[test]
fn zip_absolute_path() {
    zip_refused([Entry::stored("/etc/cron.d/x", b"x")], "path_absolute", "/etc/cron.d/x");
}

#[test]
fn zip_drive_letter() {
    zip_refused([Entry::stored("C:/Windows/x", b"x")], "path_drive", "C:/Windows/x");
}

#[test]
fn zip_parent_at_start() {
    zip_refused([Entry::stored("../canary.txt", b"x")], "path_escape", "../canary.txt");
}

#[test]
fn zip_parent_in_the_middle() {
    zip_refused(
        [Entry::stored("src/../../canary.txt", b"x")],
        "path_escape",
        "src/../../canary.txt",
    );
}

#[test]
fn zip_parent_in_a_folder() {
    zip_refused([Entry::stored("../out/", b"")], "path_escape", "../out/");
}

#[test]
fn zip_parent_in_an_ignored_place() {
    zip_refused([Entry::stored("__MACOSX/../../x", b"x")], "path_escape", "__MACOSX/../../x");
}

#[test]
fn zip_backslash_parent() {
    zip_refused([Entry::stored("..\\..\\canary.txt", b"x")], "path_escape", "../../canary.txt");
}

#[test]
fn zip_backslash_drive() {
    zip_refused([Entry::stored("C:\\Windows\\x", b"x")], "path_drive", "C:/Windows/x");
}

#[test]
fn zip_backslash_absolute() {
    zip_refused([Entry::stored("\\etc\\cron.d\\x", b"x")], "path_absolute", "/etc/cron.d/x");
}

#[test]
fn zip_backslash_beside_slashes() {
    let entries = [Entry::stored("src/lib.rs", b"x"), Entry::stored("src\\lib.rs", b"y")];
    zip_refused(entries, "name_backslash", "src\\lib.rs");
}

#[test]
fn zip_backslash_duplicate() {
    let entries = [Entry::stored("src\\lib.rs", b"x"), Entry::stored("src\\\\lib.rs", b"y")];
    zip_refused(entries, "duplicate_entry", "src/lib.rs");
}

#[test]
fn zip_backslash_file_and_folder() {
    let entries = [Entry::stored("src", b"x"), Entry::stored("src\\lib.rs", b"y")];
    zip_refused(entries, "file_and_folder", "src/lib.rs");
}

#[test]
fn zip_nul_in_name() {
    zip_refused([Entry::stored("src/lib.rs\0.txt", b"x")], "name_nul", "src/lib.rs\\u{0}.txt");
}

#[test]
fn zip_control_characters_in_name() {
    zip_refused([Entry::stored("a\x1b[2J\n", b"x")], "name_control", "a\\u{1b}[2J\\n");
}

#[test]
fn zip_bidi_override_in_name() {
    zip_refused([Entry::stored("a\u{202e}txt.exe", b"x")], "name_control", "a\\u{202e}txt.exe");
}

#[test]
fn zip_empty_name() {
    zip_refused([Entry::stored("", b"x")], "name_empty", "");
}

#[test]
fn zip_name_of_the_root() {
    zip_refused([Entry::stored("./.", b"x")], "name_empty", "");
}

#[test]
fn zip_name_too_long() {
    let name = "n".repeat(121);
    zip_refused([Entry::stored(&name, b"x")], "limit_path_bytes", &name);
}

#[test]
fn zip_too_deep() {
    zip_refused([Entry::stored("1/2/3/4/5/6/7", b"x")], "limit_depth", "1/2/3/4/5/6/7");
}

#[test]
fn zip_unicode_extra_field_with_another_name() {
    let mut field = vec![1];
    field.extend(crc32(b"readme.txt").to_le_bytes());
    field.extend(b"../canary.txt");
    let entry = Entry::stored("readme.txt", b"x").both(|h| h.extra = extra(0x7075, &field));
    zip_refused([entry], "zip_name_override", "readme.txt");
}

#[test]
fn zip_unicode_extra_field_that_escapes() {
    let mut field = vec![1];
    field.extend(crc32(b"\xe9.txt").to_le_bytes());
    field.extend(b"../canary.txt");
    let entry =
        Entry::with(b"\xe9.txt", 0, b"x".to_vec(), b"x").both(|h| h.extra = extra(0x7075, &field));
    zip_refused([entry], "path_escape", "../canary.txt");
}

// --- kinds ---

#[test]
fn zip_symbolic_link() {
    zip_refused([Entry::stored("src/lib.rs", b"/etc/passwd").mode(0o120777)], "link", "src/lib.rs");
}

#[test]
fn zip_link_then_file_through_it() {
    let entries = [Entry::stored("src", b"/tmp").mode(0o120777), Entry::stored("src/lib.rs", b"x")];
    zip_refused(entries, "link", "src");
}

#[test]
fn zip_device() {
    zip_refused([Entry::stored("dev", b"").mode(0o020666)], "special_file", "dev");
}

#[test]
fn zip_fifo() {
    zip_refused([Entry::stored("pipe", b"").mode(0o010666)], "special_file", "pipe");
}

#[test]
fn zip_folder_with_data() {
    zip_refused([Entry::stored("src/", b"hidden")], "zip_folder_data", "src/");
}

// --- several entries in one place ---

#[test]
fn zip_duplicate_entry() {
    let twice = [Entry::stored("src/lib.rs", b"a"), Entry::stored("src/lib.rs", b"b")];
    zip_refused(twice, "duplicate_entry", "src/lib.rs");
}

#[test]
fn zip_duplicate_after_normalising() {
    let twice = [Entry::stored("src/lib.rs", b"a"), Entry::stored("./src//./lib.rs", b"b")];
    zip_refused(twice, "duplicate_entry", "src/lib.rs");
}

#[test]
fn zip_file_and_folder() {
    let both = [Entry::stored("src", b"a"), Entry::stored("src/lib.rs", b"b")];
    zip_refused(both, "file_and_folder", "src/lib.rs");
}

#[test]
fn zip_folder_and_file() {
    let both = [Entry::stored("src/lib.rs", b"b"), Entry::stored("src", b"a")];
    zip_refused(both, "file_and_folder", "src");
}

#[test]
fn zip_overlap_same_local_header() {
    let mut second = Entry::deflated("b", b"bbbb");
    second.local = Entry::deflated("config.json", b"{}").local;
    second.central = second.local.clone();
    second.offset = Some(0);
    let message = zip_refused([second], "zip_overlap", "config.json");
    assert!(message.contains("config.json"));
}

#[test]
fn zip_overlap_quoted_local_headers() {
    // The full overlap of a better zip bomb: the first entry's data holds the second whole.
    let inner = Entry::stored("b", b"bomb");
    let inner_bytes = Zip::of([inner.clone()]).bytes();
    let local = &inner_bytes[..30 + 1 + 4];
    let outer = Entry::stored("a", local);
    let mut zip = Zip::of([outer, inner]);
    zip.entries[1].offset = Some(30 + 1);
    assert_refused(&zip.bytes(), "a.zip", "zip_overlap", "b");
}

// --- limits ---

#[test]
fn zip_too_many_entries() {
    let many = (0..41).map(|i| Entry::stored(&format!("src/{i}.rs"), b""));
    assert_refused(&Zip::of(many).bytes(), "a.zip", "limit_entries", "");
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
fn zip_file_too_large() {
    zip_refused(
        [Entry::stored("big.bin", &noise(2 * 1024 * 1024 + 1, 1))],
        "limit_file",
        "big.bin",
    );
}

#[test]
fn zip_total_too_large() {
    let content = noise(2 * 1024 * 1024, 4);
    zip_refused(["a", "b", "c"].map(|name| Entry::deflated(name, &content)), "limit_total", "b");
}

#[test]
fn zip_ratio_bomb() {
    zip_refused([Entry::deflated("bomb", &vec![0; 1536 * 1024])], "limit_ratio", "bomb");
}

#[test]
fn zip_bomb_with_a_small_size_in_its_headers() {
    let entry = Entry::deflated("bomb", &vec![0; 1536 * 1024]).both(|h| h.unpacked = 10);
    zip_refused([entry], "zip_size", "bomb");
}

// --- encryption and compression ---

#[test]
fn zip_encrypted() {
    zip_refused([Entry::stored("secret", b"x").both(|h| h.flags = 1)], "zip_encrypted", "secret");
}

#[test]
fn zip_aes() {
    zip_refused([Entry::stored("secret", b"x").both(|h| h.method = 99)], "zip_encrypted", "secret");
}

#[test]
fn zip_unsupported_compression() {
    let message =
        zip_refused([Entry::stored("a", b"x").both(|h| h.method = 14)], "zip_compression", "a");
    assert!(message.contains("lzma (14)"), "{message}");
}

// --- headers that disagree ---

#[test]
fn zip_names_disagree() {
    let mut entry = Entry::stored("readme.txt", b"x");
    entry.local.name = b"src/lib.rs".to_vec();
    let message = zip_refused([entry], "zip_headers_disagree", "readme.txt");
    assert!(message.contains("src/lib.rs"), "{message}");
}

#[test]
fn zip_methods_disagree() {
    let mut entry = Entry::stored("a", b"x");
    entry.local.method = 8;
    let message = zip_refused([entry], "zip_headers_disagree", "a");
    assert_eq!(message, "compression method: the directory says 0, the entry's own header 8");
}

#[test]
fn zip_unpacked_sizes_disagree() {
    let mut entry = Entry::deflated("a", b"xxxx");
    entry.local.unpacked = 3;
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip_packed_sizes_disagree() {
    let mut entry = Entry::deflated("a", b"xxxx");
    entry.local.packed -= 1;
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip_checksums_disagree() {
    let mut entry = Entry::stored("a", b"x");
    entry.local.crc32 ^= 1;
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip_flags_disagree() {
    let mut entry = Entry::stored("a", b"x");
    entry.local.flags = 1;
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip_descriptor_disagrees() {
    let mut entry = Entry::deflated("a", b"xxxx").streamed();
    entry.descriptor[12] ^= 1;
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip_descriptor_lies_where_nothing_was_deferred() {
    let mut entry = Entry::deflated("a", b"xxxx").streamed();
    let central = entry.central.clone();
    (entry.local.crc32, entry.local.packed, entry.local.unpacked) =
        (central.crc32, central.packed, central.unpacked);
    entry.descriptor[12] ^= 1;
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip_deferred_fields_of_an_entry_without_a_descriptor() {
    for field in 0..3 {
        let mut entry = Entry::deflated("a", b"xxxx");
        match field {
            0 => entry.local.crc32 = 0,
            1 => entry.local.packed = 0,
            _ => entry.local.unpacked = 0,
        }
        zip_refused([entry], "zip_headers_disagree", "a");
    }
}

#[test]
fn zip_one_deferred_field_and_another_that_lies() {
    let mut entry = Entry::deflated("a", b"xxxx").streamed();
    entry.local.unpacked = 3;
    zip_refused([entry], "zip_headers_disagree", "a");
}

#[test]
fn zip_descriptor_missing() {
    let mut entry = Entry::deflated("a", b"xxxx").streamed();
    entry.descriptor.clear();
    zip_refused([entry], "zip_headers_disagree", "a");
}

// --- data that is not what the headers say ---

#[test]
fn zip_wrong_checksum() {
    zip_refused([Entry::deflated("a", b"x").both(|h| h.crc32 ^= 1)], "zip_crc", "a");
}

#[test]
fn zip_more_data_than_said() {
    let entry = Entry::deflated("a", b"xxxx").both(|h| h.unpacked = 3);
    assert_eq!(zip_refused([entry], "zip_size", "a"), "expected 3 unpacked bytes, found more");
}

#[test]
fn zip_less_data_than_said() {
    let entry = Entry::deflated("a", b"xxxx").both(|h| h.unpacked = 5);
    assert_eq!(zip_refused([entry], "zip_size", "a"), "expected 5 unpacked bytes, found fewer");
}

#[test]
fn zip_stored_sizes_differ() {
    zip_refused([Entry::stored("a", b"xxxx").both(|h| h.unpacked = 5)], "zip_size", "a");
}

#[test]
fn zip_broken_deflate_stream() {
    let entry = Entry::with(b"a", 8, vec![0xff; 20], b"xxxx");
    zip_refused([entry], "zip_corrupt", "a");
}

#[test]
fn zip_data_after_deflate_stream() {
    let mut data = deflated(b"xxxx");
    data.extend(b"hidden");
    zip_refused([Entry::with(b"a", 8, data, b"xxxx")], "zip_entry_slack", "a");
}

// --- the archive as a whole ---

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

// --- tar ---

use tar_bytes::Entry as Tar;

#[test]
fn tar_absolute_path() {
    tar_refused(&[Tar::file("/tmp/x", b"x")], "path_absolute", "/tmp/x");
}

#[test]
fn tar_parent() {
    tar_refused(&[Tar::file("a/../../canary.txt", b"x")], "path_escape", "a/../../canary.txt");
}

#[test]
fn tar_symbolic_link() {
    tar_refused(&[Tar::link("src", b'2', "/tmp"), Tar::file("src/x", b"x")], "link", "src");
}

#[test]
fn tar_hard_link() {
    for to in ["/etc/passwd", "b", "../canary.txt", "", "a", "src"] {
        let entries =
            [Tar::file("src/lib.rs", b"x"), Tar::link("a", b'1', to), Tar::file("b", b"x")];
        tar_refused(&entries, "link", "a");
    }
    tar_refused(&[Tar::link("../a", b'1', "config.json")], "path_escape", "../a");
}

#[test]
fn tar_character_device() {
    tar_refused(&[Tar::of(b"null", b'3', b"")], "special_file", "null");
}

#[test]
fn tar_block_device() {
    tar_refused(&[Tar::of(b"sda", b'4', b"")], "special_file", "sda");
}

#[test]
fn tar_fifo() {
    tar_refused(&[Tar::of(b"pipe", b'6', b"")], "special_file", "pipe");
}

#[test]
fn tar_unknown_type() {
    tar_refused(&[Tar::of(b"volume", b'M', b"")], "tar_type", "volume");
}

#[test]
fn tar_pax_path_escapes() {
    let entries = [Tar::pax(b'x', &[("path", "../../canary.txt")]), Tar::file("harmless", b"x")];
    tar_refused(&entries, "path_escape", "../../canary.txt");
}

#[test]
fn tar_pax_path_absolute() {
    let entries = [Tar::pax(b'x', &[("path", "/etc/cron.d/x")]), Tar::file("harmless", b"x")];
    tar_refused(&entries, "path_absolute", "/etc/cron.d/x");
}

#[test]
fn tar_pax_path_with_nul() {
    let entries = [Tar::pax(b'x', &[("path", "src/lib.rs\0x")]), Tar::file("harmless", b"x")];
    tar_refused(&entries, "name_nul", "src/lib.rs\\u{0}x");
}

#[test]
fn tar_global_pax_path() {
    tar_refused(
        &[Tar::pax(b'g', &[("path", "src/lib.rs")]), Tar::file("a", b"x")],
        "tar_global_override",
        "",
    );
}

#[test]
fn tar_pax_size_disagrees() {
    // One reader sees a file of 1024 bytes, the other a second header inside it.
    let entries = [Tar::pax(b'x', &[("size", "1024")]), Tar::file("a", b"x")];
    tar_refused(&entries, "tar_pax_size", "a");
}

#[test]
fn tar_pax_record_with_a_wrong_length() {
    let mut record = pax_record("path", "a");
    record[0] = b'8';
    tar_refused(&[Tar::of(b"p", b'x', &record), Tar::file("a", b"x")], "tar_header", "");
}

#[test]
fn tar_pax_header_without_an_entry() {
    tar_refused(&[Tar::pax(b'x', &[("path", "a")])], "tar_header", "");
}

#[test]
fn tar_huge_extended_header() {
    let mut entry = Tar::of(b"p", b'x', b"");
    entry.size_field = Some(b"77777777777\0".to_vec());
    tar_refused(&[entry], "tar_header", "");
}

#[test]
fn tar_gnu_sparse() {
    tar_refused(&[Tar::of(b"sparse", b'S', b"")], "tar_sparse", "sparse");
}

#[test]
fn tar_pax_sparse() {
    for records in [
        &[("GNU.sparse.major", "1"), ("GNU.sparse.minor", "0")][..],
        &[("GNU.sparse.size", "9"), ("GNU.sparse.map", "0,1,0,1")],
        &[("GNU.sparse.size", "9"), ("GNU.sparse.map", "9,1")],
        &[("GNU.sparse.size", "9"), ("GNU.sparse.map", "0")],
        &[("GNU.sparse.size", "9"), ("GNU.sparse.map", "0,2")],
        &[("GNU.sparse.size", "9"), ("GNU.sparse.map", "x,1")],
        &[("GNU.sparse.size", "9"), ("GNU.sparse.offset", "0"), ("GNU.sparse.offset", "0")],
        &[("GNU.sparse.size", "-1"), ("GNU.sparse.map", "0,1")],
        &[("GNU.sparse.size", "9"), ("GNU.sparse.unknown", "0,1")],
        &[("GNU.sparse.major", "2"), ("GNU.sparse.realsize", "9")],
    ] {
        tar_refused(&[Tar::pax(b'x', records), Tar::file("a", b"x")], "tar_sparse", "a");
    }
    let of_block = |map: &[u8]| {
        let records =
            [("GNU.sparse.major", "1"), ("GNU.sparse.minor", "0"), ("GNU.sparse.realsize", "9")];
        let mut content = map.to_vec();
        content.resize(512, 0);
        content.push(b'x');
        [Tar::pax(b'x', &records), Tar::file("a", &content)]
    };
    for map in [&b""[..], b"99999999\n", b"1\n0\n", b"1\n9\n1\n", b"1\n0\n99999999999999999999\n"] {
        tar_refused(&of_block(map), "tar_sparse", "a");
    }
    let name = [("GNU.sparse.name", "../a"), ("GNU.sparse.size", "9"), ("GNU.sparse.map", "0,1")];
    tar_refused(&[Tar::pax(b'x', &name), Tar::file("a", b"x")], "path_escape", "../a");
}

#[test]
fn tar_sparse_bomb() {
    let records = [("GNU.sparse.size", "99999999999"), ("GNU.sparse.map", "0,1")];
    tar_refused(&[Tar::pax(b'x', &records), Tar::file("a", b"x")], "limit_file", "a");
}

#[test]
fn tar_gnu_long_name_escapes() {
    let name = format!("../{}", "n".repeat(100));
    tar_refused(&[Tar::long_name(&name), Tar::file("a", b"x")], "path_escape", &name);
}

#[test]
fn tar_two_long_names() {
    tar_refused(
        &[Tar::long_name("a"), Tar::long_name("b"), Tar::file("c", b"x")],
        "tar_header",
        "",
    );
}

#[test]
fn tar_duplicate() {
    tar_refused(&[Tar::file("a", b"1"), Tar::file("./a", b"2")], "duplicate_entry", "a");
}

#[test]
fn tar_too_many_entries() {
    let many: Vec<Tar> = (0..41).map(|i| Tar::file(&format!("src/{i}.rs"), b"")).collect();
    tar_refused(&many, "limit_entries", "");
}

#[test]
fn tar_many_extended_headers() {
    let many: Vec<Tar> = (0..41).map(|_| Tar::pax(b'g', &[("comment", "x")])).collect();
    tar_refused(&many, "limit_entries", "");
}

#[test]
fn tar_too_deep() {
    tar_refused(&[Tar::file("1/2/3/4/5/6/7", b"x")], "limit_depth", "1/2/3/4/5/6/7");
}

#[test]
fn tar_size_larger_than_the_archive() {
    let mut entry = Tar::file("a", b"x");
    entry.size_field = Some(b"00000004000\0".to_vec());
    let mut bytes = tar_bytes::open(&[entry]);
    bytes.extend([0; 512]);
    assert_refused(&bytes, "a.tar", "tar_truncated", "a");
}

#[test]
fn tar_size_of_exabytes() {
    let mut entry = Tar::file("a", b"x");
    entry.size_field = Some(vec![0x80, 0, 0, 0, 0x7f, 255, 255, 255, 255, 255, 255, 255]);
    tar_refused(&[entry], "tar_truncated", "a");
}

#[test]
fn tar_size_not_a_number() {
    let mut entry = Tar::file("a", b"x");
    entry.size_field = Some(b"twelve bytes".to_vec());
    tar_refused(&[entry], "tar_header", "a");
}

#[test]
fn tar_wrong_checksum() {
    let mut entry = Tar::file("a", b"x");
    entry.checksum = Some(1);
    tar_refused(&[entry], "tar_checksum", "");
}

#[test]
fn tar_data_after_the_end() {
    let mut bytes = tar(&[Tar::file("config.json", b"{}")]);
    bytes.extend(tar(&[Tar::file("hidden", b"x")]));
    assert_refused(&bytes, "a.tar", "tar_data_after", "");
    assert_refused(&gz(&bytes), "a.tar.gz", "tar_data_after", "");
}

#[test]
fn tar_file_too_large() {
    tar_refused(&[Tar::file("big", &noise(2 * 1024 * 1024 + 1, 4))], "limit_file", "big");
}

// --- gzip ---

#[test]
fn gz_ratio_bomb() {
    let bomb = gz(&tar(&[Tar::file("bomb", &vec![0; 1536 * 1024])]));
    assert_refused(&bomb, "a.tar.gz", "limit_ratio", "bomb");
}

#[test]
fn gz_bomb_of_ignored_files() {
    let bomb = gz(&tar(&[Tar::file("__MACOSX/x", &vec![0; 1536 * 1024])]));
    assert_refused(&bomb, "a.tar.gz", "limit_ratio", "__MACOSX/x");
}

#[test]
fn gz_bomb_of_padding() {
    let mut bytes = tar(&[Tar::file("config.json", b"{}")]);
    bytes.resize(bytes.len() + 3 * 1024 * 1024, 0);
    assert_refused(&gz(&bytes), "a.tar.gz", "limit_ratio", "");
    assert_accepted(&bytes, "a.tar", "");
    bytes.resize(bytes.len() + 2 * 1024 * 1024, 0);
    assert_refused(&bytes, "a.tar", "limit_total", "");
}

#[test]
fn gz_data_after() {
    let mut bytes = gz(&tar(&[Tar::file("config.json", b"{}")]));
    bytes.extend(b"tail\x1f\x8b\x08");
    assert_refused(&bytes, "a.tar.gz", "gz_data_after", "");
}

#[test]
fn gz_second_member_is_a_second_tar() {
    let mut bytes = gz(&tar(&[Tar::file("config.json", b"{}")]));
    bytes.extend(gz(&tar(&[Tar::file("hidden", b"x")])));
    assert_refused(&bytes, "a.tar.gz", "tar_data_after", "");
}

#[test]
fn gz_second_member_truncated() {
    let whole = tar(&[Tar::file("config.json", b"{}"), Tar::file("a", &noise(4000, 1))]);
    let (first, second) = whole.split_at(1000);
    let second = gz(second);
    let bytes = [gz(first), second[..second.len() - 9].to_vec()].concat();
    assert_refused(&bytes, "a.tar.gz", "gz_corrupt", "");
}

#[test]
fn gz_bomb_of_members() {
    // Each is no bomb, together they are.
    let piece = gz(&vec![0; 200 * 1024]);
    let mut bytes = gz(&tar_bytes::open(&[Tar::file("bomb", &vec![0; 1536 * 1024])])[..512]);
    for _ in 0..12 {
        bytes.extend(&piece);
    }
    assert_refused(&bytes, "a.tar.gz", "limit_ratio", "bomb");
}

#[test]
fn gz_endless_members() {
    let bytes = [gz(b"").repeat(20_000), gz(&tar(&[Tar::file("config.json", b"{}")]))].concat();
    assert_refused(&bytes, "a.tar.gz", "limit_members", "");
}

#[test]
fn gz_data_after_zeros() {
    // Python's gzip goes on behind zeros, gzip itself does not.
    let more = gz(&tar(&[Tar::file("hidden", b"x")]));
    let bytes = [gz(&tar(&[Tar::file("config.json", b"{}")])), vec![0; 600], more].concat();
    assert_refused(&bytes, "a.tar.gz", "gz_data_after", "");
    // Also in the middle of a file, which is not cut off.
    let whole = tar(&[Tar::file("config.json", b"{}"), Tar::file("src/lib.rs", &[7; 3000])]);
    let (head, tail) = whole.split_at(2500);
    let bytes = [gz(head), vec![0; 100], gz(tail)].concat();
    let found = assert_refused(&bytes, "a.tar.gz", "gz_data_after", "src/lib.rs");
    assert!(found.message.contains("behind 100 zeros: this can be read in two ways"), "{found}");
}

#[test]
fn gz_truncated() {
    let bytes = gz(&tar(&[Tar::file("config.json", b"{}")]));
    let found = assert_refused(&bytes[..bytes.len() / 2], "a.tar.gz", "gz_corrupt", "");
    assert!(found.hint.as_ref().is_some_and(|hint| hint.contains("cut off")), "{found}");
}

#[test]
fn gz_wrong_checksum() {
    let mut bytes = gz(&tar(&[Tar::file("config.json", b"{}")]));
    let at = bytes.len() - 8;
    bytes[at] ^= 1;
    let found = assert_refused(&bytes, "a.tar.gz", "gz_corrupt", "");
    assert!(found.hint.as_ref().is_some_and(|hint| hint.contains("damaged")), "{found}");
}

#[test]
fn gz_without_a_tar() {
    assert_refused(&gz(b"just text"), "a.tar.gz", "not_a_tar", "");
}

// --- other formats ---

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

// --- oddities that are reported, not refused ---

#[test]
fn nested_archive_is_reported() {
    let inner = Zip::of([Entry::stored("x", b"x")]).bytes();
    let (submission, _scratch) = assert_accepted(
        &Zip::of([good(), Entry::stored("src/lib.rs", b"x"), Entry::stored("src.zip", &inner)])
            .bytes(),
        "a.zip",
        "nested_archive",
    );
    assert_eq!(submission.findings[0].path.as_deref(), Some("src.zip"));
}

/// Nobody has seen what was submitted: it is no submission without a source.
#[test]
fn a_source_that_may_be_in_an_archive_which_is_not_opened_is_not_missing() {
    let zip = Zip::of([Entry::stored("lib.rs", b"x")]).bytes();
    for (inner, archive) in [
        ("i.7z", b"7z\xbc\xaf\x27\x1cxxxx".as_slice()),
        ("a2/i.rar", b"Rar!\x1a\x07\0xxxx"),
        ("i.tar.xz", b"\xfd7zXZ\0xxxx"),
        ("src.zip", &zip),
        // What its bytes do not tell, its name does.
        ("a2.iso", b"\0\0\0\0"),
        ("a2.7z.002", b"xxxx"),
        ("a2.Z01", b"xxxx"),
    ] {
        let archive = Entry::stored(inner, archive);
        let others = ["readme.txt", "notes.rs", "main.cpp", "old/phong.fs.wgsl"];
        let beside = others.map(|name| vec![archive.clone(), Entry::stored(name, b"x")]);
        for entries in beside.into_iter().chain([vec![good(), archive.clone()]]) {
            let bytes = Zip::of(entries).bytes();
            let first = assert_refused(&bytes, "a.zip", "nested_archive", inner).to_string();
            assert!(first.contains("no source is there besides"), "{first}");
        }
    }
    for entry in ["src/lib.rs", "a2/lib.rs"] {
        let bytes = Zip::of([Entry::stored(entry, b"x"), Entry::stored("x.zip", &zip)]).bytes();
        assert_accepted(&bytes, "a.zip", "nested_archive");
    }
}

/// Paths and contents of a copy.
fn contents(submission: &Submission) -> Vec<(String, Vec<u8>)> {
    let read = |path: &String| std::fs::read(submission.root.join(path)).unwrap();
    submission.files.iter().map(|file| (file.path.clone(), read(&file.path))).collect()
}

/// The tar that GNU tar makes of a file with holes in its own format.
fn gnu_sparse(pieces: &[(u64, &[u8])], size: u64) -> Vec<u8> {
    let stored: Vec<u8> = pieces.iter().flat_map(|(_, data)| data.to_vec()).collect();
    let mut header = tar::Header::new_gnu();
    header.set_path("src/lib.rs").unwrap();
    header.set_entry_type(tar::EntryType::GNUSparse);
    header.set_size(stored.len() as u64);
    let (first, more) = pieces.split_at(pieces.len().min(4));
    let set = |entry: &mut tar::GnuSparseHeader, (offset, data): &(u64, &[u8])| {
        entry.set_offset(*offset);
        entry.set_length(data.len() as u64);
    };
    let gnu = header.as_gnu_mut().unwrap();
    gnu.set_real_size(size);
    gnu.set_is_extended(!more.is_empty());
    gnu.sparse.iter_mut().zip(first).for_each(|(entry, piece)| set(entry, piece));
    header.set_cksum();
    let mut bytes = header.as_bytes().to_vec();
    if !more.is_empty() {
        let mut block = tar::GnuExtSparseHeader::new();
        block.sparse_mut().iter_mut().zip(more).for_each(|(entry, piece)| set(entry, piece));
        bytes.extend(block.as_bytes());
    }
    bytes.extend(&stored);
    bytes.resize(bytes.len().next_multiple_of(512) + 1024, 0);
    bytes
}

#[test]
fn files_with_holes_are_whole() {
    let whole = b"ab\0\0\0c\0\0".to_vec();
    let expected = vec![("src/lib.rs".to_owned(), whole.clone())];
    let pax = |records: &[(&str, &str)], name: &str, stored: &[u8]| {
        tar_bytes::tar(&[Tar::pax(b'x', records), Tar::file(name, stored)])
    };
    let mut block = b"2\n0\n2\n5\n1\n".to_vec();
    block.resize(512, 0);
    block.extend(b"abc");
    let forms = [
        gnu_sparse(&[(0, b"ab"), (5, b"c")], 8),
        // More pieces than one header holds; the last says that a hole ends the file.
        gnu_sparse(&[(0, b"a"), (1, b"b"), (2, b"\0"), (3, b"\0"), (5, b"c"), (8, b"")], 8),
        pax(
            &[
                ("GNU.sparse.size", "8"),
                ("GNU.sparse.numblocks", "2"),
                ("GNU.sparse.offset", "0"),
                ("GNU.sparse.numbytes", "2"),
                ("GNU.sparse.offset", "5"),
                ("GNU.sparse.numbytes", "1"),
            ],
            "src/lib.rs",
            b"abc",
        ),
        pax(
            &[
                ("GNU.sparse.name", "src/lib.rs"),
                ("GNU.sparse.size", "8"),
                ("GNU.sparse.numblocks", "2"),
                ("GNU.sparse.map", "0,2,5,1"),
            ],
            "src/GNUSparseFile.7/lib.rs",
            b"abc",
        ),
        pax(
            &[
                ("GNU.sparse.major", "1"),
                ("GNU.sparse.minor", "0"),
                ("GNU.sparse.name", "src/lib.rs"),
                ("GNU.sparse.realsize", "8"),
            ],
            "src/GNUSparseFile.7/lib.rs",
            &block,
        ),
    ];
    for (form, bytes) in forms.iter().enumerate() {
        let (submission, _scratch) = assert_accepted(bytes, "a.tar", "");
        assert_eq!(contents(&submission), expected, "form {form}");
        let (packed, _scratch) = assert_accepted(&gz(bytes), "a.tar.gz", "");
        assert_eq!(packed.digest, submission.digest, "form {form}");
        // Cut off in its data.
        let mut cut = bytes.clone();
        cut.truncate(bytes.len() - 1024 - 510);
        assert_refused(&cut, "a.tar", "tar_truncated", "src/lib.rs");
    }
}

#[test]
fn a_hard_link_is_the_file_that_came_before() {
    let entries = [
        Tar::file("offline/a.exr", b"image"),
        Tar::link("offline/b.exr", b'1', "./offline/a.exr"),
        Tar::link("offline/c.exr", b'1', "offline/b.exr"),
    ];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "");
    let same = |(_, content): &(String, Vec<u8>)| content == b"image";
    let found = contents(&submission);
    assert!(found.len() == 3 && found.iter().all(same), "{found:?}");
}

#[test]
fn labels_and_backups_are_read() {
    let mut label = Tar::of(b"backup of ada", b'V', b"");
    label.size_field = Some(vec![0; 12]);
    let entries = [label, Tar::of(b"src/", b'D', b"Ylib.rs\0\0"), Tar::file("src/lib.rs", b"x")];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "tar_label");
    assert_eq!(contents(&submission), [("src/lib.rs".to_owned(), b"x".to_vec())]);
}

#[test]
fn bytes_after_a_tar_are_reported() {
    let plain = tar(&[Tar::file("config.json", b"{}")]);
    for tail in [&b"--boundary--\r\n"[..], &[7; 2000]] {
        assert_accepted(&[&plain, tail].concat(), "a.tar", "tar_data_after");
        assert_accepted(&[&gz(&plain), tail].concat(), "a.tar.gz", "gz_data_after");
    }
    let tail = [vec![0; 700], b"x".to_vec()].concat();
    assert_accepted(&[gz(&plain), tail].concat(), "a.tar.gz", "gz_data_after");
}

#[test]
fn two_entries_of_one_name_and_content_are_one() {
    let zip = Zip::of([good(), Entry::stored("a", b"1"), Entry::deflated("./a", b"1")]);
    let (submission, _scratch) = assert_accepted(&zip.bytes(), "a.zip", "duplicate_entry");
    assert_eq!(submission.files.len(), 2);
    let entries = [Tar::file("a", b"1"), Tar::file("b", b"2"), Tar::file("a", b"1")];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "duplicate_entry");
    let expected = [("a".to_owned(), b"1".to_vec()), ("b".to_owned(), b"2".to_vec())];
    assert_eq!(contents(&submission), expected);
}

#[test]
fn an_archive_in_nothing_but_another_is_opened() {
    let files = [Tar::file("config.json", b"{}"), Tar::file("src/lib.rs", b"x")];
    let (tar, zip) = (tar(&files), Zip::of([good(), Entry::stored("src/lib.rs", b"x")]).bytes());
    let digest = assert_accepted(&zip, "a.zip", "").0.digest;
    let junk = || Entry::stored("__MACOSX/x", b"x");
    for (what, bytes) in [
        ("zip in zip", Zip::of([Entry::stored("a2/a2_ada.zip", &zip), junk()]).bytes()),
        ("tar.gz in zip", Zip::of([Entry::stored("a2.tar.gz", &gz(&tar))]).bytes()),
        ("tar in zip", Zip::of([Entry::stored("a2.tar", &tar)]).bytes()),
        ("zip in tar", tar_bytes::tar(&[Tar::file("a2.zip", &zip)])),
        ("tar.gz gzipped", gz(&gz(&tar))),
        ("zip gzipped", gz(&zip)),
    ] {
        let (submission, _scratch) = assert_accepted(&bytes, "a", "packed_twice");
        assert_eq!(submission.digest, digest, "{what}");
    }
    // What is wrong with the inner one is said of it.
    let escaping = Zip::of([good(), Entry::stored("../x", b"x")]).bytes();
    let outer = Zip::of([Entry::stored("inner.zip", &escaping)]).bytes();
    assert_refused(&outer, "a.zip", "path_escape", "../x");
    let bomb = Zip::of([Entry::deflated("x", &vec![0; 1536 * 1024])]).bytes();
    assert_refused(&Zip::of([Entry::stored("x.zip", &bomb)]).bytes(), "a.zip", "limit_ratio", "x");
    // Once is enough.
    let deep = Zip::of([Entry::stored("b.zip", &outer)]).bytes();
    assert_refused(&deep, "a.zip", "nested_archive", "inner.zip");
}

#[test]
fn backslashes_of_windows_are_folders_beside_slashes_too() {
    let mixed = Zip::of([
        Entry::stored("a2/", b"").mode(0o40755),
        Entry::stored("a2/config.json", b"{}"),
        Entry::stored("a2\\src\\lib.rs", b"x"),
    ]);
    let mut bytes = mixed.bytes();
    assert_refused(&bytes, "a.zip", "name_backslash", "a2\\src\\lib.rs");
    let made_by: Vec<usize> =
        (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02")).collect();
    for host in [0, 10, 11] {
        made_by.iter().for_each(|at| bytes[at + 5] = host);
        let (submission, _scratch) = assert_accepted(&bytes, "a.zip", "zip_backslash");
        let paths: Vec<&str> = submission.files.iter().map(|file| file.path.as_str()).collect();
        assert_eq!(paths, ["config.json", "src/lib.rs"], "{host}");
    }
}

/// A zip of files below a folder, whose names are made of both, as made on a host.
fn zip_below(folder: &[u8], slash: &[u8], host: u8) -> Vec<u8> {
    let entry = |name: &[u8], data: &[u8]| {
        Entry::with(&[folder, slash, name].concat(), 0, data.to_vec(), data)
    };
    let lib = [b"src", slash, b"lib.rs"].concat();
    let mut bytes = Zip::of([entry(b"config.json", b"{}"), entry(&lib, b"x")]).bytes();
    let made_by: Vec<usize> =
        (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02")).collect();
    made_by.iter().for_each(|at| bytes[at + 5] = host);
    bytes
}

#[test]
fn a_backslash_that_is_half_a_letter_separates_nothing() {
    let paths = ["config.json", "src/lib.rs"].map(str::to_owned);
    let listed = |bytes: &[u8], code: &str| {
        let (submission, _scratch) = assert_accepted(bytes, "a.zip", code);
        let backslash = submission.findings.iter().any(|finding| finding.code == "zip_backslash");
        let found = submission.files.iter().map(|file| file.path.clone()).collect::<Vec<_>>();
        assert_eq!(found, paths);
        (submission.wrapped_in.unwrap(), backslash)
    };
    // Folders called "source" in Shift-JIS, "homework Hsu" in Big5, a name in GBK, and one in EUC-KR.
    for (folder, shown) in [
        (&b"\x83\x5c\x81\x5b\x83\x58"[..], "_x83_x5C_x81[_x83X"),
        (b"\xa5\x5c\xbd\xd2\xb3\x5c", "_xA5_x5C_xBD\u{4b3}_x5C"),
        (b"\xd5\x5c", "_xD5_x5C"),
        (b"\xc7\xd1\xb1\xdb", "_xC7\u{471}_xDB"),
    ] {
        for host in [0, 3, 10, 11] {
            let bytes = zip_below(folder, b"/", host);
            assert_eq!(listed(&bytes, "name_not_utf8"), (shown.to_owned(), false), "{host}");
            // Where no name holds a slash, the others separate.
            let bytes = zip_below(folder, b"\\", host);
            assert_eq!(listed(&bytes, "zip_backslash"), (shown.to_owned(), true), "{host}");
        }
    }
    // In a code page of one byte a letter, one behind an accent separates: no file were config.json else.
    let bytes = zip_below(b"Ren\x82", b"\\", 0);
    assert_eq!(listed(&bytes, "zip_backslash"), ("Ren_x82".to_owned(), true));
}

#[test]
fn backslashes_in_a_tar_are_folders_where_no_name_holds_a_slash() {
    let entries = [
        Tar::of(b"src\\", b'5', b""),
        Tar::file("config.json", b"{}"),
        Tar::file("src\\lib.rs", b"x"),
        Tar::link("src\\mod.rs", b'1', "src\\lib.rs"),
    ];
    for (bytes, name) in [(tar(&entries), "a.tar"), (gz(&tar(&entries)), "a.tar.gz")] {
        let (submission, _scratch) = assert_accepted(&bytes, name, "tar_backslash");
        let paths: Vec<&str> = submission.files.iter().map(|file| file.path.as_str()).collect();
        assert_eq!(paths, ["config.json", "src/lib.rs", "src/mod.rs"]);
    }
    let beside = Tar::file("src/a.rs", b"x");
    tar_refused(&[beside, Tar::file("src\\lib.rs", b"x")], "name_backslash", "src\\lib.rs");
    tar_refused(&[Tar::file("..\\x", b"x")], "path_escape", "../x");
}

#[test]
fn names_that_our_own_signs_make_equal_are_told_apart() {
    let entry = |name: &[u8]| Entry::with(name, 0, b"x".to_vec(), b"x");
    for names in [[&b"src/\x81.rs"[..], b"src/_x81.rs"], [b"src/_x81.rs", b"src/\x81.rs"]] {
        let message = zip_refused(names.map(entry), "name_written_alike", "src/_x81.rs");
        assert!(message.contains("not UTF-8"), "{message}");
    }
    // The same name twice is that.
    let twice = [entry(b"src/\x81.rs"), entry(b"./src//\x81.rs")];
    let bytes = Zip::of([good()].into_iter().chain(twice)).bytes();
    assert_accepted(&bytes, "a.zip", "duplicate_entry");
}

#[test]
fn case_collisions_are_reported() {
    let entries = [good(), Entry::stored("src/lib.rs", b"a"), Entry::stored("Src/lib.rs", b"b")];
    let (submission, _scratch) =
        assert_accepted(&Zip::of(entries).bytes(), "a.zip", "case_collision");
    assert_eq!(submission.findings[0].path.as_deref(), Some("Src"));
    assert_eq!(submission.files.len(), 3);
    let entries = [good(), Entry::stored("src/A.rs", b"a"), Entry::stored("src/a.rs", b"b")];
    assert_accepted(&Zip::of(entries).bytes(), "a.zip", "case_collision");
}

#[test]
fn names_that_are_not_utf8_are_kept_readable() {
    let entry = Entry::with(b"src/caf\xe9.rs", 0, b"x".to_vec(), b"x");
    let (submission, _scratch) =
        assert_accepted(&Zip::of([good(), entry]).bytes(), "a.zip", "name_not_utf8");
    assert!(submission.file("src/caf_xE9.rs").is_some());
    let bytes = tar(&[Tar::file("config.json", b"{}"), Tar::of(b"src/caf\xe9.rs", b'0', b"x")]);
    let (submission, _scratch) = assert_accepted(&bytes, "a.tar", "name_not_utf8");
    assert!(submission.file("src/caf_xE9.rs").is_some());
}

#[test]
fn gap_between_entries_is_reported() {
    let zip = Zip { entries: vec![good()], gap: vec![0; 10], ..Zip::default() };
    assert_accepted(&zip.bytes(), "a.zip", "zip_gap");
}

#[test]
fn bytes_around_a_zip_are_reported() {
    let zip = Zip { prefix: b"#!/bin/sh\n".to_vec(), entries: vec![good()], ..Zip::default() };
    assert_accepted(&zip.bytes(), "a.zip", "zip_data_before");
    let mut bytes = b"MZ self-extracting".to_vec();
    bytes.extend(Zip::of([good()]).bytes());
    assert_accepted(&bytes, "a.zip", "zip_data_before");
    let zip = |suffix: &[u8]| {
        Zip { entries: vec![good()], suffix: suffix.to_vec(), ..Zip::default() }.bytes()
    };
    assert_accepted(&zip(b"tail"), "a.zip", "zip_data_after");
    assert_accepted(&zip(&[0; 9000]), "a.zip", "zip_padding");
    assert_accepted(&zip(&vec![b'x'; 100_000]), "a.zip", "zip_data_after");
    let cut = Zip { entries: vec![good()], comment_length: Some(9), ..Zip::default() };
    assert_accepted(&cut.bytes(), "a.zip", "zip_comment_cut");
}

#[test]
fn zeros_after_gzip_are_reported() {
    let bytes = [gz(&tar(&[Tar::file("config.json", b"{}")])), vec![0; 600]].concat();
    assert_accepted(&bytes, "a.tar.gz", "gz_padding");
}

#[test]
fn links_where_all_is_ignored_are_no_matter() {
    let entries = [
        Tar::file("config.json", b"{}"),
        Tar::link("target/release/libx.so", b'1', "target/release/deps/libx.so"),
        Tar::link("__MACOSX", b'2', "/etc"),
        Tar::file("__MACOSX/passwd", b"x"),
    ];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "ignored");
    assert_eq!(submission.files.len(), 1);
}

#[test]
fn tar_without_an_end_is_reported() {
    let config = || Tar::file("config.json", b"{}");
    let mut files = vec![config(), Tar::file("src/lib.rs", b"x")];
    for scene in ["teapot", "cbox"] {
        for path in ["offline", "realtime"] {
            files.push(Tar::file(&format!("{path}/{scene}_simple_{path}.exr"), b"x"));
        }
    }
    assert_accepted(&tar_bytes::open(&files), "a.tar", "tar_no_end");
    // What is missing may have been behind the cut.
    for number in 1..files.len() {
        assert_refused(&tar_bytes::open(&files[..number]), "a.tar", "tar_no_end", "");
    }
    // So may a file that the source names.
    for (text, named) in [
        ("mod renderer;", "src/renderer.rs"),
        ("pub mod bsdfs;", "src/bsdfs/mod.rs"),
        ("const A: &str = include_str!(\"a.wgsl\");", "src/a.wgsl"),
    ] {
        files[1] = Tar::file("src/lib.rs", text.as_bytes());
        assert_refused(&tar_bytes::open(&files), "a.tar", "tar_no_end", "");
        let mut whole = files.clone();
        whole.push(Tar::file(named, b"x"));
        assert_accepted(&tar_bytes::open(&whole), "a.tar", "tar_no_end");
    }
}

#[test]
fn wrong_extension_is_reported() {
    assert_accepted(&Zip::of([good()]).bytes(), "a.rar", "wrong_extension");
    assert_accepted(&gz(&tar(&[Tar::file("config.json", b"{}")])), "a.zip", "wrong_extension");
}
