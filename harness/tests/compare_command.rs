//! `umbra compare`: what is equal, what is said of what differs, and what is not compared.

use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::exr_io::{
    ExrLayers, ExrRows, Precision, read_exr, write_exr, write_exr_channels, write_exr_layers,
};
use basecode::{Image, Sampler, Vec3};
use serde_json::Value;
use umbra::imaging::difference::{Count, Differences, Different, Odd};
use umbra::imaging::rows::{Channels, Row, visit_rows};

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
fn pixels_of_another_shape_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let square = file(&folder, "a.exr", &[]);
    let wide = folder.path().join("b.exr");
    let mut bytes = std::fs::read(&square).unwrap();
    let name = b"pixelAspectRatio\0float\0\x04\0\0\0";
    let at = bytes.windows(name.len()).position(|bytes| bytes == name).unwrap() + name.len();
    bytes[at..at + 4].copy_from_slice(&2f32.to_le_bytes());
    std::fs::write(&wide, bytes).unwrap();
    let (code, said, _) = compare(&[&wide, &square]);
    assert!(code == 0 && said.contains("pixel aspect ratios differ"), "{said}");
    assert!(said.contains("actual 2, expected 1"), "{said}");
    let (_, said, _) = compare(&[&wide, &wide]);
    assert!(!said.contains("aspect"), "{said}");
}

#[test]
fn many_channels_and_names_in_utf_8_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let plain = file(&folder, "a.exr", &[]);
    let names: Vec<String> = ["R", "G", "B"]
        .iter()
        .map(|c| (*c).to_owned())
        .chain((0..200).map(|i| format!("z{i}.V")))
        .collect();
    let channels: Vec<(&str, Vec<f32>)> =
        names.iter().map(|name| (name.as_str(), vec![0.5; 4])).collect();
    let many = folder.path().join("many.exr");
    write_exr_channels(&many, [0, 0], 2, &channels).unwrap();
    let (code, said, _) = compare(&[Path::new("--no-metrics"), &many, &plain]);
    assert!(code == 0 && said.contains("0 of 4 pixels differ"), "{said}");
    // Two characters of Latin-1 are one of UTF-8.
    let named = folder.path().join("named.exr");
    let layer = ["R", "G", "B"].map(|c| format!("\u{c3}\u{a9}.{c}"));
    let channels = layer.each_ref().map(|name| (name.as_str(), vec![0.5; 4]));
    write_exr_channels(&named, [0, 0], 2, &channels).unwrap();
    let arguments = ["--no-metrics", "--layer", "\u{e9}"].map(Path::new);
    let (code, said, errors) = compare(&[&arguments[..], &[&named, &plain]].concat());
    assert!(code == 0 && said.contains("0 of 4 pixels differ"), "{said}{errors}");
}

#[test]
fn numbers_far_from_one_have_exponents() {
    let folder = tempfile::tempdir().unwrap();
    let far = file(&folder, "a.exr", &[(0, Vec3::new(1e-40, 3.4e38, 0.5))]);
    let (_, said, _) = compare(&[&far, &file(&folder, "b.exr", &[])]);
    assert!(said.contains("actual [1e-40, 3.4e38, 0.5], expected [0.5, 0.5, 0.5]"), "{said}");
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

/// A difference of finite values is finite, even where no 32-bit float holds it.
#[test]
fn the_largest_of_finite_values_has_its_difference() {
    let folder = tempfile::tempdir().unwrap();
    let values = |sign: f32| {
        [(0, 2e38), (1, 1e38), (2, 3e38), (3, 2.5e38)]
            .map(|(i, value): (usize, f32)| (i, Vec3::new(0.5, sign * value, 0.5)))
    };
    let (a, b) = (file(&folder, "a.exr", &values(1.0)), file(&folder, "b.exr", &values(-1.0)));
    let told = |a: &Path, b: &Path| -> Value {
        let (code, out, said) = compare(&[a, b, Path::new("--json")]);
        assert_eq!(code, 1, "{said}");
        serde_json::from_str(&out).unwrap()
    };
    for told in [told(&a, &b), told(&b, &a)] {
        for largest in [&told["largest"], &told["largest_finite"]] {
            assert_eq!((&largest["x"], &largest["y"]), (&0.into(), &1.into()));
            let difference = largest["difference"].as_f64().unwrap();
            assert!((difference / 6e38 - 1.0).abs() < 1e-6, "{difference}");
        }
    }
    let (_, said, _) = compare(&[&a, &b]);
    assert!(said.contains("largest at (0, 1): ") && !said.contains("largest finite"), "{said}");
    let (code, said, _) = compare(&[Path::new("--idiff"), &a, &b]);
    assert!(code == 2 && said.contains("Mean error = 1.41667e+38"), "{said}");
    assert!(said.contains("Max error  = inf @ (0, 0, G)") && !said.contains("NaN"), "{said}");
    // Infinity still comes first.
    let c = file(&folder, "c.exr", &[(3, Vec3::INFINITY)]);
    let told = told(&c, &b);
    assert_eq!((&told["largest"]["x"], &told["largest"]["difference"]), (&1.into(), &Value::Null));
    assert_eq!(told["largest_finite"]["y"], 1);
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

    // A file that has layers, but not this one, is not taken for it, whichever file comes first.
    let other = write("other.exr", &[("", 0.5), ("spec", 0.5)]);
    let torn = folder.path().join("torn.exr");
    let channels = ["R", "G", "B", "left.R"].map(|name| (name, vec![0.5]));
    write_exr_channels(&torn, [0, 0], 1, &channels).unwrap();
    for (lacking, has) in
        [(&other, "plain R, G, B, spec"), (&single, "raw"), (&torn, "plain R, G, B")]
    {
        for [a, b] in [[&stereo, lacking], [lacking, &stereo]] {
            let (code, out, said) = layer(a, b, "left");
            let file = lacking.file_name().unwrap().to_string_lossy();
            let expected = format!("{file} (it has: {has})\n");
            assert!(code == 2 && out.is_empty(), "{out}{said}");
            assert!(said.starts_with("umbra: no layer \"left\" in "), "{said}");
            assert!(said.ends_with(&expected), "{said}");
        }
    }
    // Plain channels beside R, G and B make no layer.
    let depth = folder.path().join("depth.exr");
    let channels = ["R", "G", "B", "Z"].map(|name| (name, vec![0.75]));
    write_exr_channels(&depth, [0, 0], 1, &channels).unwrap();
    assert_eq!(layer(&stereo, &depth, "left").0, 0);
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

#[test]
fn a_folder_for_pictures_that_cannot_be_made_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let a = file(&folder, "a.exr", &[]);
    let there = folder.path().join("there");
    let taken = there.join("expected.png");
    std::fs::create_dir_all(&taken).unwrap();
    for (given, named) in [(&a, &a), (&there, &taken), (&"/proc/x".into(), &"/proc/x".into())] {
        let (code, out, said) = compare(&[&a, &a, Path::new("--pictures"), given]);
        let expected = format!("umbra: cannot write to {}: ", named.display());
        assert!(code == 2 && out.is_empty() && said.starts_with(&expected), "{out}{said}");
    }
}

#[test]
fn images_of_two_sizes_have_pictures_too() {
    let folder = tempfile::tempdir().unwrap();
    let a = file(&folder, "a.exr", &[]);
    let small = folder.path().join("small.exr");
    write_exr(&small, &Image::new(1, 2), Precision::Half, &[]).unwrap();
    let pictures = folder.path().join("pictures");
    let (code, out, said) = compare(&[&a, &small, Path::new("--pictures"), &pictures]);
    assert!(code == 1 && said.is_empty(), "{out}{said}");
    let begins = "actual is 2x2 but expected is 1x2\nthere is no picture of the difference\n";
    assert!(out.contains(begins) && out.contains("actual.png: "), "{out}");
    for (name, is_there) in [("actual", true), ("expected", true), ("difference", false)] {
        assert_eq!(pictures.join(format!("{name}.png")).is_file(), is_there, "{name}");
    }
}

/// A file system that refuses such a name has nothing to test.
#[cfg(unix)]
#[test]
fn json_takes_any_file_name() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let a = file(&folder, "a.exr", &[]);
    let odd = |name: &[u8]| folder.path().join(std::ffi::OsStr::from_bytes(name));
    let own = odd(b"n\xff.exr");
    if std::fs::copy(&a, &own).is_err() {
        return;
    }
    let (pictures, page) = (odd(b"p\xff"), odd(b"h\xff"));
    let arguments: [&Path; 7] = [
        &own,
        &a,
        Path::new("--json"),
        Path::new("--pictures"),
        &pictures,
        Path::new("--html"),
        &page,
    ];
    let (code, out, said) = compare(&arguments);
    assert_eq!(code, 0, "{said}");
    let told: Value = serde_json::from_str(&out).unwrap();
    assert!(told["actual"]["file"].as_str().unwrap().ends_with("n\u{fffd}.exr"), "{out}");
    let mut written = told["pictures"].as_object().unwrap().keys();
    assert!(
        written.all(|name| name.contains("p\u{fffd}")) && pictures.join("actual.png").is_file()
    );
    assert!(told["page"].as_str().unwrap().contains("h\u{fffd}"), "{out}");
}

#[test]
fn ssim_and_flip_come_only_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, gain: f32| {
        let mut image = Image::new(32, 24);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Vec3::new(0.5, 0.1 + i as f32 * 0.001, 0.25) * gain;
        }
        let path = folder.path().join(name);
        write_exr(&path, &image, Precision::Float, &[]).unwrap();
        path
    };
    let (a, b) = (write("a.exr", 1.25), write("b.exr", 1.0));
    let metrics = |more: &[&str]| -> Value {
        let more: Vec<&Path> = more.iter().map(Path::new).collect();
        let (_, out, _) = compare(&[&more[..], &[&*a, &*b, Path::new("--json")]].concat());
        serde_json::from_str::<Value>(&out).unwrap()["metrics"].clone()
    };
    let (few, all) = (metrics(&[]), metrics(&["--metrics"]));
    assert!(few.get("ssim").is_none() && few.get("flip_hdr").is_none(), "{few}");
    for name in ["mae", "rmse", "rel_mse", "psnr_db", "peak"] {
        let (few, all) = (few[name].as_f64().unwrap(), all[name].as_f64().unwrap());
        assert!((few - all).abs() <= 1e-12 * all, "{name}: {few} and {all}");
    }
    assert!(all["ssim"].as_f64().unwrap() > 0.5 && all["flip_ldr"].as_f64().unwrap() > 0.0);
}

/// A float that is often one of those that are not like others.
fn any_float(sampler: &Sampler) -> f32 {
    let random = (sampler.next_1d() * 16.0) as usize;
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, 0.0, 1e-45, -1.0, f32::MAX];
    match random {
        0..8 => odd[random],
        8..13 => 0.5,
        _ => 256.0 * sampler.next_1d(),
    }
}

/// The one pass over rows against a plain loop over whole images, with any number of threads.
#[test]
fn one_pass_finds_what_a_plain_loop_finds() {
    let folder = tempfile::tempdir().unwrap();
    let sampler = Sampler::new(1);
    for (round, (width, height)) in
        [(1, 1), (3, 2), (5, 700), (130, 33), (1000, 300)].into_iter().enumerate()
    {
        let [a, b] = ["a.exr", "b.exr"].map(|name| {
            let mut image = Image::new(width, height);
            image.pixels.fill_with(|| Vec3::from_array([0; 3].map(|_| any_float(&sampler))));
            if round % 2 == 1 {
                // Most pixels are equal, as of two versions of an image.
                let other = Sampler::new(7);
                for (i, pixel) in image.pixels.iter_mut().enumerate() {
                    let same = Vec3::from_array([0; 3].map(|_| any_float(&other)));
                    *pixel = if i % 11 == 0 { *pixel } else { same };
                }
            }
            (folder.path().join(name), image)
        });
        write_exr(&a.0, &a.1, Precision::Float, &[]).unwrap();
        let layers = [(String::new(), b.1.clone())].into();
        let content = ExrLayers { layers, ..ExrLayers::default() };
        write_exr_layers(&b.0, &content, Precision::Float).unwrap();
        let files = [&a.0, &b.0].map(|path| ExrRows::open(path).unwrap());
        let channels = files.each_ref().map(|file| file.layers().unwrap().0[0].1);
        for nan_is_error in [false, true] {
            let expected = plain(&a.1, &b.1, nan_is_error);
            let mut before = None;
            for threads in [1, 2, 7] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let found = pool.install(|| one_pass(&files, &channels, nan_is_error));
                assert_eq!(told(&found.0, &found.1), expected, "{width}x{height} {nan_is_error}");
                let sums = format!("{:?}", found.1.sums);
                assert_eq!(*before.get_or_insert(sums.clone()), sums, "{threads} threads");
            }
        }
    }
}

fn one_pass(
    files: &[ExrRows<'static>; 2],
    channels: &[[usize; 3]; 2],
    nan_is_error: bool,
) -> ([Odd; 2], Differences) {
    let images = [0, 1].map(|i| Channels { file: &files[i], channels: &channels[i] });
    let visit = |(odd, found): &mut ([Odd; 2], Differences), row: Row| {
        let finite = [0, 1].map(|i| odd[i].add(row.y, row.colors(i)));
        found.add(&row, nan_is_error, finite == [true; 2], &mut Vec::new());
    };
    let mut all: ([Odd; 2], Differences) = Default::default();
    for (odd, found) in visit_rows(&images, visit).unwrap() {
        all.0.iter_mut().zip(&odd).for_each(|(all, odd)| all.append(odd));
        all.1.append(&found);
    }
    all
}

/// Counts and places, as text.
fn told(odd: &[Odd; 2], found: &Differences) -> String {
    let odd = odd.map(|odd| (odd.not_finite, odd.negative));
    let place = |found: Option<Different>| found.map(|found| (found.at, found.size.to_bits()));
    format!(
        "{odd:?} {} {:?} {:?}",
        found.differing,
        place(found.largest),
        place(found.largest_finite)
    )
}

/// What `umbra compare` did before it read rows.
fn plain(a: &Image, b: &Image, nan_is_error: bool) -> String {
    let count = |image: &Image, is_so: fn(&Vec3) -> bool| {
        let first = image.pixels.iter().position(is_so).unwrap_or_default();
        let count = image.pixels.iter().filter(|pixel| is_so(pixel)).count();
        Count { count, first: [first % image.width, first / image.width] }
    };
    let odd = [a, b].map(|image| Odd {
        not_finite: count(image, |p| !p.is_finite()),
        negative: count(image, |p| p.to_array().iter().any(|&v| v < 0.0)),
    });
    let mut found = Differences::default();
    for (i, (a, b)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        let mut size = None;
        for (x, y) in a.to_array().into_iter().zip(b.to_array()) {
            let differs = if x.is_nan() && y.is_nan() { nan_is_error } else { x != y };
            let apart = (x - y).abs();
            let apart = if apart.is_nan() { f32::INFINITY } else { apart };
            if differs && size.is_none_or(|size| apart > size) {
                size = Some(apart);
            }
        }
        let Some(size) = size else { continue };
        found.differing += 1;
        found.largest = larger(found.largest, size.into(), i);
        if size.is_finite() {
            found.largest_finite = larger(found.largest_finite, size.into(), i);
        }
    }
    for kept in [&mut found.largest, &mut found.largest_finite].into_iter().flatten() {
        kept.at = [kept.at[0] % a.width, kept.at[0] / a.width];
    }
    told(&odd, &found)
}

fn larger(kept: Option<Different>, size: f64, index: usize) -> Option<Different> {
    match kept {
        Some(kept) if kept.size >= size => Some(kept),
        _ => Some(Different { at: [index, 0], size, actual: [0.0; 3], expected: [0.0; 3] }),
    }
}

/// A copy of a file whose two windows begin one column further right.
fn moved(from: &Path, to: &Path) {
    let mut bytes = std::fs::read(from).unwrap();
    for window in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes.windows(window.len()).position(|own| own == window).unwrap();
        let corners = &mut bytes[at + window.len() + 4..][..16];
        corners[0] += 1;
        corners[8] += 1;
    }
    std::fs::write(to, bytes).unwrap();
}

/// Exit codes and words of idiff 2.4.7 on these images, but for what `docs/reference/compare.md` excepts.
#[test]
fn idiff_s_arguments_have_idiff_s_answers() {
    let folder = tempfile::tempdir().unwrap();
    let half = Vec3::splat(0.5);
    file(&folder, "a.exr", &[]);
    file(&folder, "b.exr", &[(3, half * 1.5)]);
    file(&folder, "c.exr", &[(2, Vec3::new(0.5, 1.5, 0.5)), (3, half * 1.5)]);
    file(&folder, "nan.exr", &[(0, Vec3::NAN)]);
    file(&folder, "inf.exr", &[(0, Vec3::INFINITY)]);
    file(&folder, "minus.exr", &[(0, Vec3::NEG_INFINITY)]);
    write_exr(folder.path().join("small.exr"), &Image::new(2, 1), Precision::Float, &[]).unwrap();
    write_exr_channels(folder.path().join("xyz.exr"), [0, 0], 2, &[("X", vec![0.5; 4])]).unwrap();
    moved(&folder.path().join("a.exr"), &folder.path().join("right.exr"));
    let run = |line: &str| {
        let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .current_dir(folder.path())
            .args(["compare", "--idiff"])
            .args(line.split(' '))
            .output()
            .unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (run.status.code().unwrap(), text(&run.stdout), text(&run.stderr))
    };
    for (line, code) in [
        ("a.exr a.exr", 0),
        ("a.exr b.exr", 2),
        ("-fail 0.3 a.exr b.exr", 0),
        ("--fail 0.3 a.exr b.exr", 0),
        ("a.exr -fail 0.2 b.exr", 2),
        ("-failpercent 25 a.exr b.exr", 1),
        ("-failpercent 24 a.exr b.exr", 2),
        ("-failpercent 25 -warnpercent 25 a.exr b.exr", 0),
        ("-failpercent 25 -hardfail 0.2 a.exr b.exr", 2),
        ("-failpercent 50 -hardfail 1 -warnpercent 50 a.exr c.exr", 0),
        ("-failpercent 50 -hardwarn 0.9 -warnpercent 50 a.exr c.exr", 1),
        ("-failrelative 0.41 a.exr b.exr", 0),
        ("-failrelative 0.39 a.exr b.exr", 2),
        ("-fail 0.3 -failrelative 0.1 a.exr b.exr", 0),
        ("-allowfailures 1 a.exr b.exr", 0),
        ("-allowfailures 1 a.exr c.exr", 2),
        ("inf.exr inf.exr", 0),
        ("nan.exr nan.exr", 0),
        // idiff passes these.
        ("nan.exr a.exr", 2),
        ("a.exr nan.exr", 2),
        ("inf.exr minus.exr", 2),
        ("nan.exr inf.exr", 2),
        ("-fail 1e30 a.exr inf.exr", 2),
        // No pixel is above -fail: nothing else counts.
        ("-fail 0.3 -warn 0.1 a.exr b.exr", 0),
        ("-fail 0.3 -hardfail 0.1 a.exr b.exr", 0),
        ("-fail 0.3 -hardwarn 1000 a.exr b.exr", 0),
        ("-fail 0.3 -warnrelative 0 a.exr b.exr", 0),
        ("-failrelative 0.41 -warnpercent 1 a.exr b.exr", 0),
        ("-hardfail -1 -warnpercent -1 a.exr a.exr", 0),
        ("-allowfailures 1 -hardfail 0.1 -hardwarn 0.1 a.exr b.exr", 0),
        ("-allowfailures -1 a.exr b.exr", 0),
        ("-failpercent 25 -hardwarn 0.1 -warnpercent 25 a.exr b.exr", 1),
        ("a.exr xyz.exr", 2),
        ("a.exr small.exr", 3),
        ("right.exr right.exr", 0),
        ("right.exr a.exr", 2),
        ("a.exr right.exr", 2),
        // idiff passes this one.
        ("-fail 1 a.exr right.exr", 2),
        ("a.exr none.exr", 4),
        ("-fail much a.exr b.exr", 4),
        ("-allowfailures 1.7 a.exr b.exr", 4),
        ("-unknown a.exr b.exr", 4),
        ("a.exr", 4),
        ("-o d.png a.exr b.exr", 4),
    ] {
        let (found, out, err) = run(line);
        assert_eq!(found, code, "{line}\n{out}{err}");
    }
    let (_, out, _) = run("a.exr c.exr");
    let words = "Comparing \"a.exr\" and \"c.exr\"\n  Mean error = 0.145833\n  RMS error = 0.314576\n  \
                 Peak SNR = 13.5673\n  Max error  = 1 @ (0, 1, G)  values are 0.5, 0.5, 0.5 vs 0.5, 1.5, 0.5\n  \
                 2 pixels (50%) over 1e-06\n  2 pixels (50%) over 1e-06\nFAILURE\n";
    assert_eq!(out, words);
    assert_eq!(run("-q a.exr a.exr"), (0, String::new(), String::new()));
    assert_eq!(run("-q a.exr b.exr"), (2, String::new(), "FAILURE\n".to_owned()));

    run("-q -abs -scale 10 -o d.exr a.exr c.exr");
    let difference = read_exr(folder.path().join("d.exr")).unwrap();
    assert_eq!(difference.pixels[2..], [Vec3::new(0.0, 10.0, 0.0), Vec3::splat(2.5)]);
    assert_eq!(run("-q -o D.EXR a.exr c.exr").0, 2);
    assert_eq!(read_exr(folder.path().join("D.EXR")).unwrap().pixels[2].y, -1.0);
    moved(&folder.path().join("c.exr"), &folder.path().join("right_c.exr"));
    let (_, out, _) = run("-o moved.exr right.exr right_c.exr");
    assert!(out.contains("Max error  = 1 @ (1, 1, G)"), "{out}");
    assert_eq!(ExrRows::open(folder.path().join("moved.exr")).unwrap().origin(), [1, 0]);
    run("-q -od -o none.exr a.exr a.exr");
    assert!(!folder.path().join("none.exr").exists());
}

/// The files come from OpenImageIO 2.4.7, and so do the exit codes: `read_b44.exr` is `b44.exr` as it reads it.
#[test]
fn idiff_s_files_are_read() {
    for (a, b, code) in [("uint_1.exr", "uint_1.exr", 0), ("uint_1.exr", "uint_2.exr", 2)] {
        let (found, out, err) = compare(&[Path::new("--idiff"), &golden(a), &golden(b)]);
        assert_eq!(found, code, "{a} {b}: {out}{err}");
    }
    for file in ["pxr24.exr", "b44.exr", "b44a.exr"] {
        let read = format!("read_{file}");
        let (found, out, err) = compare(&[&golden(file), &golden(&read)]);
        assert_eq!(found, 0, "{file}: {out}{err}");
        let (found, out, err) = compare(&[Path::new("--idiff"), &golden(file), &golden(&read)]);
        assert_eq!(found, 0, "{file}: {out}{err}");
    }
}

/// What a file calls its channels reaches a terminal as plain text, in one line.
#[test]
fn names_from_files_do_nothing_to_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .unwrap();
        let text = [run.stdout, run.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        let acts = |c: char| c.is_control() && c != '\n';
        assert!(!text.concat().contains(acts), "{arguments:?}: {text:?}");
        text
    };
    let write = |file: &str, names: &[&str]| {
        let channels: Vec<_> = names.iter().map(|name| (*name, vec![0.5; 4])).collect();
        write_exr_channels(folder.path().join(file), [0, 0], 2, &channels).unwrap();
    };
    let (evil, shown) = ("x\u{1b}[2J\u{9b}31m\nPASS\r", "x\\u{1b}[2J\\u{9b}31m\\nPASS\\r");
    let layer = ["R", "G", "B"].map(|c| format!("{evil}.{c}"));
    let layer: Vec<&str> = layer.iter().map(String::as_str).collect();
    write("plain.exr", &["R", "G", "B"]);
    write("channel.exr", &["R", "G", "B", evil]);
    write("layer.exr", &[&["R", "G", "B"][..], &layer].concat());
    write("only.exr", &layer);
    write("two.exr", &[&["a.R", "a.G", "a.B"][..], &layer].concat());
    write("torn.exr", &[&["R", "G", "B"][..], &layer[..1]].concat());
    write("none.exr", &layer[..1]);
    let plain = "plain.exr";
    for (arguments, expected) in [
        (&["channel.exr", plain][..], format!("channel {shown} is ignored\n")),
        (&["layer.exr", plain], format!("other layers are not compared: {shown} (--layer")),
        (&["layer.exr", plain, "--layer", evil], format!("actual: layer {shown}\n")),
        (&["only.exr", plain], format!("actual: layer {shown}\n")),
        (&["two.exr", plain], format!("one of a, {shown}\n")),
        (&["two.exr", plain, "--layer", "b"], format!("(it has: a, {shown})")),
        (&["torn.exr", plain], format!("layer {shown} is ignored: no channel {shown}.G\n")),
        (&["none.exr", plain], format!("no channel {shown}.G")),
        (&["only.exr", plain, "--json"], "\"layer\": \"x\\u001b[2J\\u009b31m\\nPASS\\r\"".into()),
        (
            &["--idiff", "channel.exr", plain],
            format!("channels differ: R, G, B, {shown} vs R, G, B\n"),
        ),
    ] {
        let said = run(&[&["compare"], arguments].concat()).concat();
        assert!(said.contains(&expected), "{arguments:?}: {said}\n{expected}");
    }
    let said = run(&["view", "channel.exr", "-o", "page"]).concat();
    assert!(said.contains("view.html") && !said.contains('\u{1b}'), "{said}");
    // A path is the user's own; even so.
    std::fs::copy(folder.path().join(plain), folder.path().join("p\u{1b}[2J.exr")).unwrap();
    assert!(run(&["compare", "--idiff", "p\u{1b}[2J.exr", plain]).concat().contains("p\\u{1b}[2J"));

    let scene = "\"key\\u001b[2J\" = 1\n[input]\nobjfile = \"s.obj\"\n[camera]\neye = [0.0, 1.0, 4.0]\n\
                 at = [0.0, 0.0, 0.0]\nfov = 50.0\n[film]\nwidth = 4\nheight = 4\n";
    let mesh = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\u{1b}[2J\nf 1 2 3\n";
    for (file, text) in
        [("s.toml", scene), ("s.obj", mesh), ("m.mtl", "newmtl b\u{1b}[2J\nillum 7\nKd 0 0 0\n")]
    {
        std::fs::write(folder.path().join(file), text).unwrap();
    }
    let said = run(&["render", "s.toml", "--plugin", "reference", "-o", "o.exr"]).concat();
    assert!(said.contains("key\\u{1b}[2J") && said.contains("a\\u{1b}[2J"), "{said}");
}
