//! Tars, plain and in gzip.

use super::{noise, tar_refused};
use crate::support::scratch::{assert_accepted, assert_refused};
use crate::support::tar_bytes::{self, Entry as Tar, gz, pax_record, tar};

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
