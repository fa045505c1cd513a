//! Entries of a zip: names, links, duplicates, sizes, and headers that disagree.

use super::{noise, zip_refused};
use crate::support::scratch::assert_refused;
use crate::support::zip_bytes::{Entry, Zip, crc32, deflated, extra};

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

#[test]
fn zip_duplicate_entry() {
    let twice = [Entry::stored("src/lib.rs", b"a"), Entry::stored("src/lib.rs", b"b")];
    zip_refused(twice, "duplicate_entry", "src/lib.rs");
}

#[test]
fn zip_duplicate_after_normalizing() {
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

#[test]
fn zip_too_many_entries() {
    let many = (0..41).map(|i| Entry::stored(&format!("src/{i}.rs"), b""));
    assert_refused(&Zip::of(many).bytes(), "a.zip", "limit_entries", "");
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
