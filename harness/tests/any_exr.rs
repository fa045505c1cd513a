//! EXR files of any kind: `umbra view` shows what can be shown, `umbra compare` compares the same pixels, and both
//! refuse the rest with one clear error.

use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::exr_io::{Band, ExrRows, read_exr};
use serde_json::Value;

use crate::support::made_exr::{Made, made, value};

/// Exit code, standard output and standard error.
fn umbra(arguments: &[&Path]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_umbra"));
    let run = command.args(arguments).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").output();
    let run = run.unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (run.status.code().unwrap(), text(&run.stdout), text(&run.stderr))
}

fn write(folder: &Path, name: &str, parts: &[Made]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, made(parts)).unwrap();
    path
}

/// The cases of the page of `umbra view`, each with its images' names, and what was said.
fn viewed(folder: &Path, files: &[&Path]) -> (Vec<(String, Vec<String>)>, String) {
    let out = folder.join("out");
    let mut arguments = vec![Path::new("view")];
    arguments.extend(files);
    arguments.extend([Path::new("-o"), &out]);
    let (code, _, said) = umbra(&arguments);
    assert_eq!(code, 0, "{said}");
    let page = std::fs::read_to_string(out.join("view.html")).unwrap();
    let manifest = page.split("id=\"manifest\">").nth(1).unwrap().split("</script>").next();
    let manifest: Value = serde_json::from_str(manifest.unwrap()).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let case = |case: &Value| {
        let layers = case["layers"].as_array().unwrap();
        (text(&case["id"]), layers.iter().map(|layer| text(&layer["name"])).collect())
    };
    (manifest["cases"].as_array().unwrap().iter().map(case).collect(), said)
}

/// The values of channels of a part, row by row.
fn values(file: &ExrRows, channels: &[usize]) -> Vec<Vec<f32>> {
    let mut whole = Band::default();
    file.read(0..file.height(), channels, &mut whole).unwrap();
    let planes: Vec<Vec<f32>> = (0..channels.len())
        .map(|at| (0..file.height()).flat_map(|y| whole.row(at, y).to_vec()).collect())
        .collect();
    // Row by row it is the same.
    let mut band = Band::default();
    for y in 0..file.height() {
        file.read(y..y + 1, channels, &mut band).unwrap();
        for (at, plane) in planes.iter().enumerate() {
            assert_eq!(band.row(at, 0), &plane[y * file.width()..][..file.width()]);
        }
    }
    planes
}

fn names(all: &[&str]) -> Vec<String> {
    all.iter().map(|&name| name.to_owned()).collect()
}

#[test]
fn each_part_is_an_image_named_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let bgr = ["B", "G", "R"];
    let parts = |other| {
        let mut small = Made::new("small", &bgr);
        small.data = [0, 0, 2, 1];
        small.display = small.data;
        [
            Made::new("beauty", &bgr),
            Made::new(other, &["albedo.B", "albedo.G", "albedo.R"]),
            Made::new("depth", &["Z"]),
            small,
        ]
    };
    let file = write(folder.path(), "a.exr", &parts("albedo"));
    let (cases, said) = viewed(folder.path(), &[&file]);
    assert_eq!(said, "");
    assert_eq!(
        cases,
        [
            ("4x2".into(), names(&["a.exr beauty", "a.exr albedo", "a.exr beauty - a.exr albedo"])),
            ("2x1".into(), names(&["a.exr small"])),
            ("4x2 depth.Z".into(), names(&["a.exr depth.Z"])),
        ]
    );
    let (opened, _) = ExrRows::open_parts(&file).unwrap();
    assert_eq!(
        opened.iter().map(ExrRows::part).collect::<Vec<_>>(),
        ["beauty", "albedo", "depth", "small"]
    );
    assert_eq!(
        values(&opened[3], &[2, 0]),
        [[value(2, 0, 0), value(2, 1, 0)], [value(0, 0, 0), value(0, 1, 0)]]
    );

    // The same names choose what is compared.
    let (code, _, said) = umbra(&[Path::new("compare"), &file, &file]);
    assert!(code == 2 && said.contains("one of beauty, albedo, small"), "{said}");
    let plain = write(folder.path(), "plain.exr", &[Made::new("", &bgr)]);
    for layer in ["beauty", "albedo"] {
        let layer = Path::new(layer);
        let (code, said, error) =
            umbra(&[Path::new("compare"), &file, &plain, Path::new("--layer"), layer]);
        assert!(code == 0 && said.contains("0 of 8 pixels differ"), "{said}{error}");
        assert!(said.contains("actual: part depth is not compared: it has no colors"), "{said}");
    }
    // What a student hands in has one part, as ever.
    let refused = read_exr(&file).unwrap_err().to_string();
    assert!(refused.ends_with("a.exr: several parts, expected one part"), "{refused}");
}

#[test]
fn deep_data_are_refused_and_what_is_beside_them_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let bgr = ["B", "G", "R"];
    let deep = || Made { deep: true, ..Made::new("smoke", &bgr) };
    let file = write(folder.path(), "deep.exr", &[deep()]);
    let two = write(folder.path(), "two.exr", &[deep(), Made { name: "fog", ..deep() }]);
    for (file, name) in [(&file, "deep.exr"), (&two, "two.exr")] {
        for command in [vec!["view"], vec!["compare"]] {
            let mut arguments = vec![Path::new(command[0]), file];
            if command[0] == "compare" {
                arguments.push(file);
            }
            let (code, out, said) = umbra(&arguments);
            let expected = format!("{name}: deep data, expected one colour a pixel\n");
            assert!(code == 2 && out.is_empty() && said.ends_with(&expected), "{out}{said}");
            assert_eq!(said.lines().count(), 1, "{said}");
        }
    }
    let mixed = write(folder.path(), "mixed.exr", &[deep(), Made::new("beauty", &bgr)]);
    let (cases, said) = viewed(folder.path(), &[&mixed]);
    assert_eq!(cases, [("4x2".into(), names(&["mixed.exr beauty"]))]);
    let note = "part smoke is left out: deep data, expected one colour a pixel";
    assert!(said.contains(note), "{said}");
    let plain = write(folder.path(), "plain.exr", &[Made::new("", &bgr)]);
    let (code, said, error) = umbra(&[Path::new("compare"), &mixed, &plain]);
    assert!(code == 0 && said.contains(&format!("actual: {note}")), "{said}{error}");
}

#[test]
fn stored_pixels_lie_where_the_picture_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let placed = |data, display| Made { data, display, ..Made::new("", &["B", "G", "R"]) };
    // Cropped: black where nothing is stored.
    let crop = write(folder.path(), "crop.exr", &[placed([1, 2, 2, 1], [0, 0, 4, 4])]);
    let (opened, _) = ExrRows::open_parts(&crop).unwrap();
    let mut expected = vec![0.0; 16];
    expected[9..11].copy_from_slice(&[value(2, 0, 0), value(2, 1, 0)]);
    assert_eq!(values(&opened[0], &[2]), [expected]);
    let (cases, said) = viewed(folder.path(), &[&crop]);
    assert_eq!(cases, [("4x4".into(), names(&["crop.exr"]))]);
    let note = "the pixels cover 2x1 at (1, 2), the picture is 4x4 at (0, 0); pixels that are not stored are black";
    assert!(said.contains(note), "{said}");
    // Beside the whole picture the stored pixels alone may be alike.
    let whole = write(folder.path(), "whole.exr", &[placed([0, 0, 4, 4], [0, 0, 4, 4])]);
    let (code, said, _) = umbra(&[Path::new("compare"), &crop, &whole]);
    assert!(code == 1 && said.contains("16 of 16 pixels differ") && said.contains(note), "{said}");
    assert_eq!(umbra(&[Path::new("compare"), &crop, &crop]).0, 0);

    // With overscan: all of it.
    let over = write(folder.path(), "over.exr", &[placed([-1, -1, 6, 4], [0, 0, 4, 2])]);
    let (opened, _) = ExrRows::open_parts(&over).unwrap();
    assert_eq!(values(&opened[0], &[0])[0][13], value(0, 1, 2));
    let (cases, said) = viewed(folder.path(), &[&over]);
    assert_eq!(cases[0].0, "6x4");
    let note = "the pixels cover 6x4 at (-1, -1), the picture is 4x2 at (0, 0); all stored pixels are taken";
    assert!(said.contains(note), "{said}");
    let (code, said, _) = umbra(&[Path::new("compare"), &over, &over]);
    assert!(code == 0 && said.contains(note), "{said}");
    // A picture too large to be shown is no reason to show nothing.
    let huge = write(folder.path(), "huge.exr", &[placed([7, 9, 2, 1], [0, 0, 2_000_000, 10])]);
    assert_eq!(viewed(folder.path(), &[&huge]).0[0].0, "2x1");
    // What a student hands in covers the film.
    for file in [&crop, &over] {
        let refused = read_exr(file).unwrap_err().to_string();
        assert!(refused.contains("hint: write the whole film, uncropped"), "{refused}");
    }
}

#[test]
fn luminance_and_chroma_make_colors() {
    let folder = tempfile::tempdir().unwrap();
    for data in [[0, 0, 4, 4], [-2, 4, 4, 2]] {
        let mut part = Made { data, display: data, ..Made::new("", &["BY", "RY", "Y"]) };
        part.channels[0].1 = 2;
        part.channels[1].1 = 2;
        let file = write(folder.path(), "yc.exr", &[part]);
        let (opened, _) = ExrRows::open_parts(&file).unwrap();
        let (width, height) = (opened[0].width(), opened[0].height());
        let found = values(&opened[0], &[0, 2]);
        for (at, y) in found[1].iter().enumerate() {
            let (x, row) = (at % width, at / width);
            assert_eq!(*y, value(2, x, row));
            assert_eq!(
                found[0][at],
                value(0, x / 2 * 2, row / 2 * 2),
                "one sample for four pixels"
            );
        }
        assert_eq!(found[0].len(), width * height);
        let (layers, notes) = opened[0].layers().unwrap();
        let (layer, channels) = &layers[0];
        assert!(layer.is_empty() && layers.len() == 1);
        assert!(notes.iter().any(|note| note.contains("luminance and chroma")), "{notes:?}");
        let colors = values(&opened[0], channels);
        let [y, ry, by] = [2, 1, 0].map(|channel| values(&opened[0], &[channel]).swap_remove(0));
        let [red, green, blue] = [0, 1, 2].map(|c| &colors[c]);
        for (at, &y) in y.iter().enumerate() {
            assert_eq!((red[at], blue[at]), ((ry[at] + 1.0) * y, (by[at] + 1.0) * y));
            // Both sides have terms a hundred times as large.
            let sum = 0.2126 * red[at] + 0.7152 * green[at] + 0.0722 * blue[at];
            assert!((sum - y).abs() < 20.0, "{sum} is not {y}");
        }
        let (cases, said) = viewed(folder.path(), &[&file]);
        let images: Vec<_> = cases.into_iter().flat_map(|(_, images)| images).collect();
        assert_eq!(images, ["yc.exr", "yc.exr BY", "yc.exr RY", "yc.exr Y"]);
        assert!(said.contains("channel BY has a sample for 2x2 pixels"), "{said}");
        let (code, said, error) = umbra(&[Path::new("compare"), &file, &file]);
        assert!(code == 0 && said.contains("luminance and chroma"), "{said}{error}");
    }
    // Luminance alone.
    let gray = write(folder.path(), "gray.exr", &[Made::new("", &["Y"])]);
    let (cases, _) = viewed(folder.path(), &[&gray]);
    assert_eq!(cases, [("4x2 Y".into(), names(&["gray.exr Y"]))]);
    let (code, said, error) = umbra(&[Path::new("compare"), &gray, &gray]);
    assert!(code == 0 && said.contains("luminance only (channel Y)"), "{said}{error}");
    assert!(read_exr(&gray).unwrap_err().to_string().contains("luminance only"));
    // What the decoder has wrong is refused.
    let mut part = Made { compression: 4, ..Made::new("", &["B", "G", "R"]) };
    part.channels[0].1 = 2;
    let file = write(folder.path(), "piz.exr", &[part]);
    for arguments in [vec![Path::new("view"), &file], vec![Path::new("compare"), &file, &file]] {
        let (code, _, said) = umbra(&arguments);
        let expected = "piz.exr: channel B is subsampled, piz compression, \
             expected scan lines, compressed by none, RLE or ZIP\n";
        assert!(code == 2 && said.ends_with(expected), "{said}");
    }
}

/// Every byte of a file of several kinds changed, and every length of it: an error or an image, never a panic.
#[test]
fn damaged_parts_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let mut chroma = Made { data: [-2, 4, 4, 2], ..Made::new("yc", &["BY", "RY", "Y"]) };
    chroma.channels[0].1 = 2;
    let whole = made(&[
        Made { deep: true, ..Made::new("smoke", &["Z"]) },
        Made::new("beauty", &["B", "G", "R"]),
        chroma,
    ]);
    let path = folder.path().join("a.exr");
    let (mut accepted, mut refused) = (0, 0);
    let mut check = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        match ExrRows::open_parts(&path) {
            Ok((parts, _)) => {
                accepted += 1;
                for part in parts.iter().filter(|part| part.width() * part.height() < 1 << 16) {
                    let all: Vec<usize> = (0..part.channels().len()).collect();
                    let mut band = Band::default();
                    let read = part.read(0..part.height(), &all, &mut band);
                    assert!(!read.is_err_and(|error| error.to_string().contains("panicked")));
                }
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().contains("panicked"), "{error}");
            }
        }
    };
    for at in 0..whole.len() {
        for mask in [0x01, 0x08, 0x10, 0x7f, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= mask;
            check(&bytes);
        }
        check(&whole[..at]);
    }
    check(&whole);
    assert!(accepted > 1000 && refused > 1000, "{accepted} accepted, {refused} refused");
}
