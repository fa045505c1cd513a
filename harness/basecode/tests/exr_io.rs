//! EXR files in and out: round trips, and files that are wrong in every way a submission can be.

#![allow(clippy::unwrap_used)] // its helpers are tests too

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use basecode::exr_io::{
    Band, ExrLayers, ExrRows, ImageError, Precision, decode_exr, read_exr, read_exr_layers,
    write_exr, write_exr_layers,
};
use basecode::image::Image;
use exr::block::{self, UncompressedBlock, writer::ChunksWriter};
use exr::compression::Compression;
use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{
    ChannelDescription, LevelMode, LineOrder, SampleType, Text, TileDescription,
};
use exr::meta::{BlockDescription, header::Header};
use glam::{Vec3, vec3};

/// Remembers the largest block of memory that was ever asked for in this test binary.
struct Watching;
static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system allocator unchanged.
unsafe impl GlobalAlloc for Watching {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are the same.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are the same.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are the same.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Watching = Watching;

fn decode(bytes: &[u8]) -> Result<ExrLayers, ImageError> {
    decode_exr(bytes, Path::new("submission.exr"))
}

fn message(bytes: &[u8]) -> String {
    decode(bytes).expect_err("a refusal").to_string()
}

/// A folder of its own for each test, gone when the test ends.
struct TestFolder(std::path::PathBuf);

impl TestFolder {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("umbra-exr-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for TestFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// 5x3 pixels with everything a float can be.
fn difficult() -> Image {
    let mut image = Image::new(5, 3);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel = vec3(i as f32 * 0.25, 39.0, -1.5);
    }
    image.pixels[1] = vec3(f32::NAN, f32::INFINITY, f32::NEG_INFINITY);
    image.pixels[7] = vec3(-0.0, 6.0e-8, 65504.0);
    image
}

fn assert_same_bits(a: &Image, b: &Image) {
    assert_eq!((a.width, a.height), (b.width, b.height));
    for (p, q) in a.pixels.iter().zip(&b.pixels) {
        for c in 0..3 {
            let same = p[c].to_bits() == q[c].to_bits() || (p[c].is_nan() && q[c].is_nan());
            assert!(same, "{p} became {q}");
        }
    }
}

/// A file as someone else's program might write it: 4x3 pixels, each channel filled with its index.
fn foreign(
    channels: &[(&str, SampleType)],
    compression: Compression,
    blocks: BlockDescription,
    change: impl FnOnce(&mut Header),
) -> Vec<u8> {
    let list: exr::prelude::SmallVec<[ChannelDescription; 5]> = channels
        .iter()
        .map(|(name, kind)| ChannelDescription::new(Text::new_or_panic(name), *kind, false))
        .collect();
    let mut header = Header::new(Text::default(), (4, 3), list).with_encoding(
        compression,
        blocks,
        LineOrder::Increasing,
    );
    header.own_attributes.layer_name = None;
    change(&mut header);
    let mut file = std::io::Cursor::new(Vec::new());
    block::write(&mut file, std::iter::once(header).collect(), false, |meta, writer| {
        for (index, position) in block::enumerate_ordered_header_block_indices(&meta.headers) {
            let block =
                UncompressedBlock::from_lines(&meta.headers[0].channels, position, |line| {
                    let value = line.location.channel as f32;
                    match channels[line.location.channel].1 {
                        SampleType::F16 => {
                            line.write_samples(|_| exr::prelude::f16::from_f32(value)).unwrap()
                        }
                        SampleType::F32 => line.write_samples(|_| value).unwrap(),
                        SampleType::U32 => line.write_samples(|_| value as u32).unwrap(),
                    }
                });
            writer.write_chunk(index, block.compress_to_chunk(&meta.headers)?)?;
        }
        Ok(())
    })
    .unwrap();
    file.into_inner()
}

const BGR: [(&str, SampleType); 3] =
    [("B", SampleType::F16), ("G", SampleType::F16), ("R", SampleType::F16)];
const LINES: BlockDescription = BlockDescription::ScanLines;

fn plain() -> Vec<u8> {
    foreign(&BGR, Compression::Uncompressed, LINES, |_| ())
}

/// Overwrites the bytes that follow the one place where `after` occurs.
fn patched(mut bytes: Vec<u8>, after: &[u8], skip: usize, with: &[u8]) -> Vec<u8> {
    let found: Vec<_> =
        bytes.windows(after.len()).enumerate().filter(|(_, w)| *w == after).collect();
    let at = found.first().expect("the pattern is there").0 + after.len() + skip;
    bytes[at..at + with.len()].copy_from_slice(with);
    bytes
}

#[test]
fn float_round_trip_is_exact() {
    let folder = TestFolder::new("float");
    let path = folder.0.join("a.exr");
    write_exr(&path, &difficult(), Precision::Float, &[]).unwrap();
    assert_same_bits(&read_exr(&path).unwrap(), &difficult());
}

#[test]
fn half_round_trip_keeps_nan_infinity_and_the_sign_of_zero() {
    let folder = TestFolder::new("half");
    let path = folder.0.join("a.exr");
    let mut image = difficult();
    image.pixels[7].y = 5.960_464_5e-8; // the smallest half
    write_exr(&path, &image, Precision::Half, &[]).unwrap();
    assert_same_bits(&read_exr(&path).unwrap(), &image);

    image.pixels[0] = vec3(1.0 + 1.0 / 4096.0, 1e6, 0.1);
    write_exr(&path, &image, Precision::Half, &[]).unwrap();
    assert_eq!(
        read_exr(&path).unwrap().pixels[0],
        vec3(1.0, f32::INFINITY, 0.099_975_586),
        "rounded to 11 bits, too large is infinite"
    );
}

#[test]
fn a_written_file_is_what_the_course_hands_out() {
    let folder = TestFolder::new("course");
    let path = folder.0.join("a.exr");
    write_exr(&path, &difficult(), Precision::Half, &[("seed", "260000000")]).unwrap();
    let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let header = &meta.headers[0];
    assert_eq!(meta.headers.len(), 1);
    assert_eq!(header.compression, Compression::Uncompressed);
    assert_eq!(header.blocks, LINES);
    assert_eq!(header.line_order, LineOrder::Increasing);
    let channels: Vec<_> =
        header.channels.list.iter().map(|c| (c.name.to_string(), c.sample_type)).collect();
    assert_eq!(channels, ["B", "G", "R"].map(|n| (n.to_owned(), SampleType::F16)));
    assert_eq!(read_exr_layers(&path).unwrap().attributes["seed"], "260000000");
}

#[test]
fn layers_come_back_with_their_provenance_and_the_same_bytes() {
    let folder = TestFolder::new("layers");
    let (a, b) = (folder.0.join("a.exr"), folder.0.join("b.exr"));
    let mut content = ExrLayers::default();
    for (i, name) in ["mean", "variance", "centre"].into_iter().enumerate() {
        let mut image = Image::new(40, 33);
        image.pixels.fill(Vec3::splat(i as f32));
        image.pixels[7] = vec3(1.0, 2.0, 3.0);
        content.layers.insert(name.into(), image);
    }
    content.attributes.insert("scene".into(), "sphere = 1".into());
    content.attributes.insert("spp".into(), "256".into());
    write_exr_layers(&a, &content, Precision::Float).unwrap();
    write_exr_layers(&b, &content, Precision::Float).unwrap();
    assert_eq!(read_exr_layers(&a).unwrap(), content);
    let bytes = std::fs::read(&a).unwrap();
    assert_eq!(bytes, std::fs::read(&b).unwrap());
    assert!(bytes.len() < 40 * 33 * 12, "compressed: {} bytes", bytes.len());
    let error = read_exr(&a).unwrap_err().to_string();
    assert!(error.contains("no channel R") && error.contains("centre, mean, variance"), "{error}");
}

#[test]
fn what_has_no_valid_form_is_not_written() {
    let path = Path::new("never.exr");
    let refuse = |image: &Image, attributes: &[(&str, &str)]| {
        let error = write_exr(path, image, Precision::Half, attributes).unwrap_err();
        assert!(matches!(error, ImageError::Unwritable { .. }), "{error}");
        error.to_string()
    };
    assert_eq!(refuse(&Image::new(0, 4), &[]), "never.exr: cannot be written: the image is 0x4");
    refuse(&difficult(), &[("a", "two\nlines")]);
    refuse(&difficult(), &[("a", "\u{1F600}")]);
    let mut content = ExrLayers::default();
    assert!(write_exr_layers(path, &content, Precision::Half).is_err(), "no layer");
    content.layers.insert("a".into(), Image::new(2, 2));
    content.layers.insert("b".into(), Image::new(2, 3));
    let error = write_exr_layers(path, &content, Precision::Half).unwrap_err().to_string();
    assert_eq!(error, "never.exr: cannot be written: layer \"b\" is not 2x2");
    assert!(!path.exists());
}

#[test]
fn every_coding_but_dwa_and_plain_tiles_are_read() {
    let tiles = BlockDescription::Tiles(TileDescription {
        tile_size: Vec2(3, 2),
        level_mode: LevelMode::Singular,
        rounding_mode: RoundingMode::Down,
    });
    use Compression::{B44, B44A, PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
    let [half, float] = [SampleType::F16, SampleType::F32];
    let mixed = [
        BGR,
        [("B", float), ("G", float), ("R", float)],
        [("B", float), ("G", half), ("R", float)],
        [("B", half), ("G", half), ("R", float)],
    ];
    for compression in [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44, B44A] {
        for (blocks, channels) in
            [LINES, tiles].into_iter().flat_map(|of| mixed.map(|all| (of, all)))
        {
            let file = decode(&foreign(&channels, compression, blocks, |_| ())).unwrap();
            let expected = vec![vec3(2.0, 1.0, 0.0); 12];
            assert_eq!(file.layers[""].pixels, expected, "{compression} {channels:?}");
            assert!(file.notes.is_empty());
        }
    }
}

#[test]
fn other_channels_are_ignored_with_a_note() {
    let channels = [
        ("A", SampleType::F16),
        ("B", SampleType::F16),
        ("G", SampleType::F16),
        ("R", SampleType::F16),
        ("Z", SampleType::U32),
    ];
    let file = decode(&foreign(&channels, Compression::ZIP16, LINES, |_| ())).unwrap();
    assert_eq!(file.notes, ["channel A is ignored", "channel Z is ignored"]);
    assert_eq!(file.layers[""].pixels, vec![vec3(3.0, 2.0, 1.0); 12]);
}

/// A layer that is no color image keeps nobody from those that are.
#[test]
fn incomplete_and_integer_layers_are_ignored_with_a_note() {
    let (half, whole) = (SampleType::F16, SampleType::U32);
    let file = |more: &[(&str, SampleType)]| {
        let mut channels = [&BGR[..], more].concat();
        channels.sort_by(|a, b| a.0.cmp(b.0));
        foreign(&channels, Compression::ZIP16, LINES, |_| ())
    };
    for (more, notes) in [
        (
            &[("motion.G", half), ("motion.R", half)][..],
            &["layer motion is ignored: no channel motion.B"][..],
        ),
        (&[("mask.R", half)], &["layer mask is ignored: no channel mask.G"]),
        (&[("mask.R", whole)], &["layer mask is ignored: channel mask.R holds integers"]),
        (
            &[("id.B", whole), ("id.G", whole), ("id.R", whole), ("id.X", half)],
            &["channel id.X is ignored", "layer id is ignored: channel id.R holds integers"],
        ),
        (&[("a.b.G", half)], &["layer a.b is ignored: no channel a.b.R"]),
    ] {
        let read = decode(&file(more)).unwrap();
        assert_eq!(read.notes, notes);
        assert_eq!(read.layers.keys().collect::<Vec<_>>(), [""]);
        let first = read.layers[""].pixels[0];
        assert_eq!((first.y - first.z, first.x - first.y), (1.0, 1.0), "B, G, R count up");
    }
    // Plain channels are a layer like others; who wants those alone is told what they lack.
    let channels = [("G", half), ("R", half), ("x.B", half), ("x.G", half), ("x.R", half)];
    let bytes = foreign(&channels, Compression::ZIP16, LINES, |_| ());
    let read = decode(&bytes).unwrap();
    assert_eq!(read.notes, ["layer without a name is ignored: no channel B"]);
    assert_eq!(read.layers["x"].pixels[0], vec3(4.0, 3.0, 2.0));
    let folder = TestFolder::new("incomplete");
    let path = folder.0.join("a.exr");
    std::fs::write(&path, bytes).unwrap();
    assert!(read_exr(&path).unwrap_err().to_string().contains("no channel B; expected R, G and B"));
}

#[test]
fn wrong_kinds_of_file_are_named() {
    assert_eq!(
        message(b""),
        "submission.exr: not an EXR file: it starts with nothing (the file is empty), expected 76 2f 31 01"
    );
    for (start, said) in [
        (&b"\x89PNG\r\n\x1a\n"[..], "89 50 4e 47, as a PNG image does, expected 76 2f 31 01"),
        (b"#?RADIANCE\n", "23 3f 52 41, as a Radiance HDR image does, expected"),
        (b"PF\n4 3\n", "50 46 0a 34, as a PFM image does, expected"),
        (b"version https://git-lfs.github.com", "76 65 72 73, as the pointer does that Git LFS"),
        (b"some text", "it starts with 73 6f 6d 65, expected"),
    ] {
        assert!(message(start).contains(said), "{}", message(start));
    }
    assert!(
        message(&patched(plain(), &[0x76, 0x2f, 0x31, 0x01, 2], 0, &[8])).contains("deep data")
    );
    assert!(
        message(&patched(plain(), &[0x76, 0x2f, 0x31, 0x01, 2], 0, &[16])).contains("one part")
    );
    let missing = read_exr("/nonexistent/a.exr").unwrap_err();
    assert!(
        matches!(missing, ImageError::Io { .. })
            && missing.to_string().contains("/nonexistent/a.exr")
    );
    // What DWAA compresses is not read, so any bytes will do.
    let at = [&b"compression\0compression\0"[..], &1u32.to_le_bytes()].concat();
    let zip = foreign(&BGR, Compression::ZIP16, LINES, |_| ());
    let lossy = message(&patched(zip, &at, 0, &[8]));
    assert_eq!(
        lossy,
        "submission.exr: dwaa compression, expected none, RLE, ZIP, PIZ, PXR24 or B44"
    );
    let mip = BlockDescription::Tiles(TileDescription {
        tile_size: Vec2(2, 2),
        level_mode: LevelMode::MipMap,
        rounding_mode: RoundingMode::Down,
    });
    assert!(
        message(&foreign(&BGR, Compression::RLE, mip, |_| ()))
            .contains("several resolution levels")
    );
}

#[test]
fn wrong_channels_are_named() {
    let file = |channels: &[(&str, SampleType)]| {
        message(&foreign(channels, Compression::Uncompressed, LINES, |_| ()))
    };
    let half = SampleType::F16;
    assert_eq!(
        file(&[("B", half), ("G", half)]),
        "submission.exr: no channel R; expected R, G and B, found B, G"
    );
    assert_eq!(
        file(&[("Y", half)]),
        "submission.exr: luminance only (channel Y); expected R, G and B"
    );
    assert!(file(&[("Z", half)]).contains("no channel R"));
    assert_eq!(
        file(&[("X", half), ("Y", half), ("Z", half)]),
        "submission.exr: no channel R; expected R, G and B, found X, Y, Z"
    );
    assert!(file(&[("x.B", half), ("x.R", half)]).contains("no channel x.G"));
    assert!(file(&[("B", half), ("G", half), ("R", SampleType::U32)]).contains("holds integers"));
    // name, type, linear flag, then the sampling rates in x and y
    let subsampled = patched(plain(), b"G\0\x01\0\0\0", 4, &[2, 0, 0, 0]);
    assert!(message(&subsampled).contains("subsampling"), "{}", message(&subsampled));
}

#[test]
fn what_can_be_read_in_two_ways_is_damaged() {
    let values = |values: [i32; 4]| values.map(i32::to_le_bytes).concat();
    for (name, what) in [("dataWindow", "data"), ("displayWindow", "display")] {
        let attribute = [name.as_bytes(), b"\0box2i\0"].concat();
        let said = message(&patched(plain(), &attribute, 4, &values([10, 10, 0, 0])));
        let expected =
            format!("damaged: the {what} window ends at (0, 0), before it starts at (10, 10)");
        assert!(said.contains(&expected), "{said}");
    }
    let twice = patched(plain(), b"channels\0chlist\0", 4 + 18, b"B");
    assert!(message(&twice).contains("damaged: channel B is listed twice"), "{}", message(&twice));
    for (place, with, expected) in [
        (&b"compression\0compression\0"[..], &[99][..], "expected none, RLE, ZIP"),
        (b"\x76\x2f\x31\x01", &[3], "expected version 2"),
    ] {
        let skip = if place.len() == 4 { 0 } else { 4 };
        let said = message(&patched(plain(), place, skip, with));
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn windows_must_agree() {
    let cropped = foreign(&BGR, Compression::Uncompressed, LINES, |h| {
        h.own_attributes.layer_position = Vec2(1, 2);
    });
    assert!(
        message(&cropped)
            .contains("the pixels cover 4x3 at (1, 2) but the picture is 4x3 at (0, 0)"),
        "{}",
        message(&cropped)
    );
    let larger = foreign(&BGR, Compression::Uncompressed, LINES, |h| {
        h.shared_attributes.display_window.size = Vec2(8, 3);
    });
    assert!(message(&larger).contains("the picture is 8x3"));
    let moved = foreign(&BGR, Compression::Uncompressed, LINES, |h| {
        h.own_attributes.layer_position = Vec2(-5, 7);
        h.shared_attributes.display_window.position = Vec2(-5, 7);
    });
    let moved = decode(&moved).unwrap();
    assert_eq!(moved.notes, ["both windows start at (-5, 7) instead of (0, 0)"]);
    assert_eq!(moved.layers[""].pixels, vec![vec3(2.0, 1.0, 0.0); 12]);
}

/// A small file that claims a huge image is refused before memory is taken for it.
#[test]
fn a_claim_of_many_pixels_takes_no_memory() {
    let claim = |bytes: Vec<u8>, lines_a_chunk: i32, width: i32, height: i32| {
        let corner = [(width - 1).to_le_bytes(), (height - 1).to_le_bytes()].concat();
        let chunks = (height.max(1) - 1) / lines_a_chunk + 1;
        let bytes = patched(bytes, b"chunkCount\0int\0", 4, &chunks.to_le_bytes());
        let bytes = patched(bytes, b"dataWindow\0box2i\0", 12, &corner);
        patched(bytes, b"displayWindow\0box2i\0", 12, &corner)
    };
    for (compression, n) in
        [(Compression::Uncompressed, 1), (Compression::ZIP16, 16), (Compression::PIZ, 32)]
    {
        let small = || foreign(&BGR, compression, LINES, |_| ());
        let error = message(&claim(small(), n, 16_384, 4096));
        assert!(error.contains("truncated") && error.contains("16384x4096"), "{error}");
        for (w, h) in [(16_385, 1), (1, i32::MAX), (16_384, 4097), (i32::MAX, i32::MAX)] {
            let error = message(&claim(small(), n, w, h));
            // The decoder itself refuses a window whose corners overflow.
            let named = error.contains("at most 67108864 pixels") || error.contains("window size");
            assert!(named, "{w}x{h}: {error}");
        }
        assert!(decode(&claim(small(), n, 0, 3)).is_err());
        assert!(decode(&claim(small(), n, -7, 3)).is_err());
    }
    assert!(LARGEST.load(Ordering::Relaxed) < 16 << 20, "{LARGEST:?} bytes asked for at once");
}

#[test]
fn truncated_at_every_length_is_an_error() {
    for compression in
        [Compression::Uncompressed, Compression::RLE, Compression::ZIP16, Compression::PIZ]
    {
        let whole = foreign(&BGR, compression, LINES, |_| ());
        assert!(decode(&whole).is_ok());
        for length in 0..whole.len() {
            let error = decode(&whole[..length]).expect_err("cut off");
            let named = matches!(error, ImageError::Truncated { .. } | ImageError::NotExr { .. });
            assert!(named, "{compression}, cut at {length} of {}: {error}", whole.len());
        }
    }
}

/// Every byte of small files changed in several ways: an error or an image of a bounded size, never a panic.
#[test]
fn changed_bytes_never_panic() {
    let tiles = BlockDescription::Tiles(TileDescription {
        tile_size: Vec2(3, 2),
        level_mode: LevelMode::Singular,
        rounding_mode: RoundingMode::Down,
    });
    use Compression::{B44, B44A, PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
    let (mut accepted, mut refused) = (0, 0);
    for compression in [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44, B44A] {
        for blocks in [LINES, tiles] {
            let whole = foreign(&BGR, compression, blocks, |_| ());
            for at in 0..whole.len() {
                for mask in [0x01, 0x08, 0x10, 0x7f, 0x80, 0xff] {
                    let mut bytes = whole.clone();
                    bytes[at] ^= mask;
                    match decode(&bytes) {
                        Ok(file) => {
                            accepted += 1;
                            assert!(file.layers.values().all(|i| i.pixels.len() <= 4096));
                        }
                        Err(error) => {
                            refused += 1;
                            let error = error.to_string();
                            assert!(
                                !error.contains("panicked"),
                                "byte {at} ^ {mask:#x}, {compression}: {error}"
                            );
                        }
                    }
                }
            }
        }
    }
    assert!(accepted > 1000 && refused > 1000, "{accepted} accepted, {refused} refused");
    assert!(LARGEST.load(Ordering::Relaxed) < 16 << 20, "{LARGEST:?} bytes asked for at once");
}

#[test]
fn a_block_stored_twice_is_refused() {
    let mut bytes = plain();
    // The last scan line claims to be the one before it; a line is y, its byte count, and 3 channels of 4 halves.
    let at = bytes.len() - (8 + 24);
    assert_eq!(bytes[at..at + 4], 2i32.to_le_bytes());
    bytes[at] = 1;
    assert!(message(&bytes).contains("row 1 are stored twice"), "{}", message(&bytes));
}

/// Any rows of any channels, whatever the blocks; and from several threads at once.
#[test]
fn rows_are_read_from_anywhere() {
    use Compression::{PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
    let (width, height) = (21, 75);
    let value = |channel: usize, x: usize, y: usize| (channel * 512 + y * 4 + x % 3) as f32;
    let tiles = BlockDescription::Tiles(TileDescription {
        tile_size: Vec2(8, 10),
        level_mode: LevelMode::Singular,
        rounding_mode: RoundingMode::Down,
    });
    let kinds = [SampleType::F16, SampleType::F32, SampleType::F16, SampleType::F32];
    let folder = TestFolder::new("rows");
    for (round, (compression, blocks)) in [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24]
        .into_iter()
        .flat_map(|compression| [LINES, tiles].map(|blocks| (compression, blocks)))
        .enumerate()
    {
        let channel = |(name, kind): (&str, SampleType)| {
            ChannelDescription::new(Text::new_or_panic(name), kind, false)
        };
        let list: exr::prelude::SmallVec<[ChannelDescription; 5]> =
            ["A", "B", "G", "R"].into_iter().zip(kinds).map(channel).collect();
        let mut header = Header::new(Text::default(), (width, height), list);
        header = header.with_encoding(compression, blocks, LineOrder::Increasing);
        header.own_attributes.layer_name = None;
        let mut bytes = std::io::Cursor::new(Vec::new());
        block::write(&mut bytes, std::iter::once(header).collect(), false, |meta, writer| {
            for (index, position) in block::enumerate_ordered_header_block_indices(&meta.headers) {
                let channels = &meta.headers[0].channels;
                let block = UncompressedBlock::from_lines(channels, position, |line| {
                    let (channel, Vec2(left, y)) = (line.location.channel, line.location.position);
                    match kinds[channel] {
                        SampleType::F16 => line.write_samples(|i| {
                            exr::prelude::f16::from_f32(value(channel, left + i, y))
                        }),
                        _ => line.write_samples(|i| value(channel, left + i, y)),
                    }
                    .unwrap();
                });
                writer.write_chunk(index, block.compress_to_chunk(&meta.headers)?)?;
            }
            Ok(())
        })
        .unwrap();
        let path = folder.0.join(format!("{round}.exr"));
        std::fs::write(&path, bytes.into_inner()).unwrap();
        let file = ExrRows::open(&path).unwrap();
        assert_eq!(file.channels(), ["A", "B", "G", "R"]);
        assert_eq!(file.layers().unwrap().0, [(String::new(), [3, 2, 1])]);
        let check = |rows: std::ops::Range<usize>, channels: &[usize], band: &mut Band| {
            file.read(rows.clone(), channels, band).unwrap();
            for (plane, &channel) in channels.iter().enumerate() {
                for y in rows.clone() {
                    let expected: Vec<f32> = (0..width).map(|x| value(channel, x, y)).collect();
                    assert_eq!(band.row(plane, y - rows.start), expected, "{compression}, row {y}");
                }
            }
        };
        std::thread::scope(|scope| {
            for thread in 0..3 {
                let check = &check;
                scope.spawn(move || {
                    let mut band = Band::default();
                    for first in (thread..height).step_by(7) {
                        check(first..height.min(first + 1 + 9 * thread), &[3, 0], &mut band);
                        check(first..first + 1, &[2], &mut band);
                    }
                    check(0..height, &[0, 1, 2, 3], &mut band);
                });
            }
        });
        let whole = read_exr(&path).unwrap();
        let color = |i: usize| [3, 2, 1].map(|c| value(c, i % width, i / width));
        assert!((0..width * height).all(|i| whole.pixels[i].to_array() == color(i)));
    }
}
