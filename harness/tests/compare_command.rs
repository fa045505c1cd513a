//! `umbra compare`: what is equal, what is said of what differs, and what is not compared.

use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::exr_io::{ExrLayers, Precision, write_exr, write_exr_layers};
use basecode::{Image, Vec3};
use serde_json::Value;

/// Exit code, standard output and standard error.
fn compare(arguments: &[&Path]) -> (i32, String, String) {
    let run =
        Command::new(env!("CARGO_BIN_EXE_umbra")).arg("compare").args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (run.status.code().unwrap(), text(&run.stdout), text(&run.stderr))
}

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/compare").join(name)
}

/// A file with a 2x2 image, 0.5 but for these pixels.
fn file(folder: &tempfile::TempDir, name: &str, pixels: &[(usize, Vec3)]) -> PathBuf {
    let mut image = Image::new(2, 2);
    image.pixels.fill(Vec3::splat(0.5));
    for (index, value) in pixels {
        image.pixels[*index] = *value;
    }
    let path = folder.path().join(name);
    write_exr(&path, &image, Precision::Float, &[]).unwrap();
    path
}

#[test]
fn equal_infinities_and_nan_are_equal_unless_told_otherwise() {
    let inf = golden("inf.exr");
    let (code, said, _) = compare(&[&inf, &inf]);
    assert!(code == 0 && said.contains("0 of 4 pixels differ"), "{said}");

    let folder = tempfile::tempdir().unwrap();
    let infinite = (0, Vec3::INFINITY);
    let nan = (2, Vec3::new(0.5, f32::NAN, 0.5));
    let a = file(&folder, "a.exr", &[infinite, nan]);
    let (code, said, _) = compare(&[&a, &a]);
    assert!(code == 0 && said.contains("0 of 4 pixels differ"), "{said}");
    assert!(said.contains("actual: 2 pixels are not finite; first at (0, 0)"), "{said}");
    let (code, said, _) = compare(&[&a, &a, Path::new("--nan-is-error")]);
    assert!(code == 1 && said.contains("1 of 4 pixels differ"), "{said}");
    assert!(said.contains("largest at (0, 1)"), "{said}");

    let b = file(&folder, "b.exr", &[infinite, nan, (3, Vec3::splat(0.75))]);
    let (code, said, _) = compare(&[&b, &a]);
    assert!(code == 1 && said.contains("1 of 4 pixels differ"), "{said}");
    assert!(said.contains("largest at (1, 1)") && said.contains("difference 0.25"), "{said}");

    // Infinity of the other sign, a number where NaN is, and one finite difference.
    let c = file(&folder, "c.exr", &[(0, Vec3::NEG_INFINITY), (1, Vec3::splat(0.375))]);
    let (code, said, _) = compare(&[&c, &a]);
    assert!(code == 1 && said.contains("3 of 4 pixels differ"), "{said}");
    assert!(said.contains("largest at (0, 0)"), "{said}");
    assert!(said.contains("largest finite difference at (1, 0)"), "{said}");
    let d = file(&folder, "d.exr", &[infinite]);
    let (code, said, _) = compare(&[&d, &a]);
    assert!(code == 1 && said.contains("no pixel with finite values differs"), "{said}");
}

#[test]
fn what_is_not_compared_is_said() {
    let (zero, one, aces) = (golden("alpha_0.exr"), golden("alpha_1.exr"), golden("aces.exr"));
    let (code, said, _) = compare(&[&one, &zero]);
    assert_eq!(code, 0, "{said}");
    for side in ["actual", "expected"] {
        assert!(said.contains(&format!("{side}: channel A is ignored")), "{said}");
    }
    let (_, said, _) = compare(&[&aces, &one]);
    assert!(
        said.contains("chromaticities differ") && said.contains("red (0.7347, 0.2653)"),
        "{said}"
    );
    let (_, said, _) = compare(&[&one, &one]);
    assert!(!said.contains("chromaticities"), "{said}");
}

#[test]
fn layers_are_chosen_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let image = |value: f32| Image { width: 1, height: 1, pixels: vec![Vec3::splat(value)] };
    let write = |name: &str, layers: &[(&str, f32)]| {
        let path = folder.path().join(name);
        let layers =
            layers.iter().map(|(name, value)| ((*name).to_owned(), image(*value))).collect();
        let content = ExrLayers { layers, ..ExrLayers::default() };
        write_exr_layers(&path, &content, Precision::Float).unwrap();
        path
    };
    let plain = write("plain.exr", &[("", 0.5)]);
    let stored = write("stored.exr", &[("mean", 0.5), ("variance", 0.25)]);
    let stereo = write("stereo.exr", &[("", 0.5), ("left", 0.75)]);
    let single = write("single.exr", &[("raw", 0.5)]);
    let layer =
        |a: &Path, b: &Path, name: &str| compare(&[a, b, Path::new("--layer"), Path::new(name)]);

    let (code, _, said) = compare(&[&plain, &stored]);
    assert!(
        code == 2
            && said.contains("stored.exr: which layer? hint: --layer NAME, one of mean, variance"),
        "{said}"
    );
    let (code, said, _) = layer(&plain, &stored, "mean");
    assert!(code == 0 && said.contains("other layers are not compared: variance"), "{said}");
    let (code, said, _) = layer(&plain, &stored, "variance");
    assert!(code == 1 && said.contains("expected: layer variance"), "{said}");
    let (code, said, _) = compare(&[&stereo, &plain]);
    assert!(code == 0 && said.contains("actual: other layers are not compared: left"), "{said}");
    let (code, said, _) = layer(&stereo, &stereo, "left");
    assert!(code == 0 && said.contains("plain R, G, B"), "{said}");
    assert_eq!(compare(&[&single, &plain]).0, 0, "its only layer");
    let (code, _, said) = layer(&plain, &stored, "none");
    assert!(
        code == 2 && said.contains("no layer \"none\"") && said.contains("mean, variance"),
        "{said}"
    );
}

#[test]
fn json_is_json_alone() {
    let folder = tempfile::tempdir().unwrap();
    let a = file(
        &folder,
        "a.exr",
        &[(0, Vec3::INFINITY), (1, Vec3::splat(0.25)), (2, Vec3::splat(-1.0))],
    );
    let b = file(&folder, "b.exr", &[]);
    let json = |arguments: &[&Path]| -> (i32, Value) {
        let (code, out, _) = compare(&[arguments, &[Path::new("--json")]].concat());
        (code, serde_json::from_str(&out).unwrap())
    };
    let (code, told) = json(&[&a, &b]);
    assert_eq!((code, &told["equal"], &told["differing"]), (1, &false.into(), &3.into()));
    assert_eq!(told["largest"]["actual"][0], "inf");
    assert_eq!(told["largest"]["difference"], Value::Null);
    let finite = &told["largest_finite"];
    assert_eq!(
        (&finite["x"], &finite["y"], &finite["difference"]),
        (&0.into(), &1.into(), &1.5.into())
    );
    assert_eq!(told["actual"]["not_finite"]["count"], 1);
    assert_eq!(told["actual"]["negative"]["first"], serde_json::json!([0, 1]));
    let pictures = folder.path().join("pictures");
    let (code, told) = json(&[&b, &b, Path::new("--pictures"), &pictures]);
    assert_eq!((code, &told["equal"], &told["metrics"]["mae"]), (0, &true.into(), &0.0.into()));
    assert_eq!(told["pictures"].as_object().unwrap().len(), 3);
    assert!(pictures.join("difference.png").is_file());
    let (code, told) = json(&[&a, &b, Path::new("--no-metrics")]);
    assert_eq!((code, &told["differing"], told.get("metrics")), (1, &3.into(), None));
    let (_, said, _) = compare(&[&a, &b, Path::new("--no-metrics")]);
    assert!(said.ends_with("difference 1.5\n"), "{said}");
    let small = folder.path().join("small.exr");
    write_exr(&small, &Image::new(1, 2), Precision::Half, &[]).unwrap();
    let (code, told) = json(&[&small, &b]);
    assert_eq!((code, &told["equal"], &told["actual"]["width"]), (1, &false.into(), &1.into()));
    assert_eq!(told.get("differing"), None);
}
