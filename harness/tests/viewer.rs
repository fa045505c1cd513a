//! The viewer in a real browser: the pages that `umbra compare --html` and `umbra view` write.

use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::exr_io::{Precision, read_exr, write_exr, write_exr_channels};
use basecode::{Image, Vec3};
use serde_json::{Value, json};

use crate::support::chromium::{CONTROL, Chromium, SHIFT};

const WIDTH: usize = 60;
const HEIGHT: usize = 40;
/// Where a value is not a number.
const WORST: (usize, usize) = (17, 29);

/// Values that no other arithmetic brings about.
fn image(scale: f32) -> Image {
    let value = |index: usize| {
        let (x, y) = (index % WIDTH, index / WIDTH);
        let wave = |k: f32| 0.4 + 0.3 * (k * x as f32 * 0.13 + y as f32 * 0.21).sin();
        Vec3::new(wave(1.0), wave(0.7), wave(1.3)) * scale
    };
    Image { width: WIDTH, height: HEIGHT, pixels: (0..WIDTH * HEIGHT).map(value).collect() }
}

/// An actual image of floats with oddities, an expected one of halves, and the page that compares them.
fn compared(folder: &Path) -> (Image, Image, PathBuf) {
    let mut actual = image(0.8);
    actual.pixels[WORST.1 * WIDTH + WORST.0].y = f32::from_bits(0x7fc0_1234);
    actual.pixels[3] = Vec3::new(f32::INFINITY, -0.0, f32::MIN_POSITIVE / 8.0);
    actual.pixels[4] = Vec3::new(-1.5, 39.0, 65519.0);
    let files = ["a.exr", "b.exr"].map(|name| folder.join(name));
    write_exr(&files[0], &actual, Precision::Float, &[]).unwrap();
    write_exr(&files[1], &image(1.0), Precision::Half, &[]).unwrap();
    let out = folder.join("page");
    let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .arg("compare")
        .args(&files)
        .args(["--no-metrics", "--html"])
        .arg(&out)
        .output()
        .unwrap();
    let page = out.join("view.html");
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(said.lines().any(|line| line == page.display().to_string()), "{said}");
    let [actual, expected] = files.map(|file| read_exr(file).unwrap());
    (actual, expected, page)
}

fn opened(browser: &mut Chromium, page: &Path, suffix: &str) {
    browser.open(page, suffix);
    browser.until("stage.about && stage.layers.length && !stage.pending");
    browser.frame();
}

/// The bits of all values of a layer, pixel by pixel.
fn bits(browser: &mut Chromium, layer: usize) -> Vec<u32> {
    let found = browser.value(&format!("[...stage.layers[{layer}].image.bits]"));
    found.as_array().unwrap().iter().map(|bits| bits.as_u64().unwrap() as u32).collect()
}

fn bits_of(image: &Image) -> Vec<u32> {
    image.pixels.iter().flat_map(|pixel| pixel.to_array().map(f32::to_bits)).collect()
}

/// The largest difference, in levels of 255, between what the screen shows of a pane and what `shade` says.
const SCREEN_IS_WRONG_BY: &str = "(() => {
  const { gl, context } = stage.painter, { width, height } = (gl ?? context).canvas;
  // Rows of WebGL begin at the bottom.
  const screen = gl ? new Uint8Array(4 * width * height) : context.getImageData(0, 0, width, height).data;
  if (gl) gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, screen);
  let worst = 0;
  for (const { layer, box, clip } of panes()) {
    const origin = originOf(box), { zoom } = view(), settings = settingsOf(layer);
    for (let y = 0; y < layer.image.height; y += 3) for (let x = 0; x < layer.image.width; x += 3) {
      const px = Math.floor((origin.x + (x + 0.5) * zoom) * stage.ratio), py = Math.floor((origin.y + (y + 0.5) * zoom) * stage.ratio);
      if (px < clip.x || py < clip.y || px >= clip.x + clip.width || py >= clip.y + clip.height) continue;
      const at = 4 * ((gl ? height - 1 - py : py) * width + px), seen = screen.subarray(at, at + 4);
      const wanted = shade(layerValues(layer, x, y, settings), layer, settings);
      wanted.forEach((level, c) => { worst = Math.max(worst, Math.abs(level - seen[c])); });
    }
  }
  return worst;
})()";

#[test]
fn pixels_modes_keys_and_addresses() {
    let Some(mut browser) = Chromium::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (actual, expected, page) = compared(folder.path());
    let browser = &mut browser;
    opened(browser, &page, "");
    assert_eq!(browser.value("stage.painter.name"), "WebGL 2");
    assert_eq!(bits(browser, 0), bits_of(&actual));
    assert_eq!(bits(browser, 1), bits_of(&expected));
    assert_eq!(
        browser.value("stage.layers.map((layer) => layer.image.type)"),
        json!(["float", "half", "float"])
    );

    // What is on the screen, for every way from values to colors.
    let state = |browser: &mut Chromium, what: &str| browser.value(&format!("state.{what}"));
    let mut seen = Vec::new();
    for key in ["1", "2", "3"] {
        browser.key(key, 0);
        for _ in 0..5 {
            browser.key("ArrowRight", SHIFT);
            seen.push(browser.value("lookNow().tone"));
            let apart = browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap();
            assert!(apart <= 2.0, "layer {key}, {:?}: {apart} levels", seen.last());
        }
    }
    assert_eq!(seen[..5], ["gamma", "false", "signed", "reinhard", "srgb"].map(Value::from));

    // Flicker: the other image while the key is held.
    browser.key("1", 0);
    for key in ["Shift", " "] {
        assert_eq!(browser.value("panes().map((pane) => pane.index)"), json!([0]));
        browser.key_down(key, if key == "Shift" { SHIFT } else { 0 });
        assert_eq!(browser.value("panes().map((pane) => pane.index)"), json!([1]), "{key}");
        assert!(browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap() <= 2.0);
        browser.key_up(key);
    }
    assert_eq!(browser.value("panes().map((pane) => pane.index)"), json!([0]));

    // Side by side, then the wipe, whose edge the mouse drags.
    browser.key("m", 0);
    assert_eq!(browser.value("panes().map((pane) => pane.index)"), json!([0, 1, 2]));
    assert!(browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap() <= 2.0);
    browser.key("m", 0);
    assert_eq!(browser.value("panes().map((pane) => pane.index)"), json!([0, 1]));
    let edge = browser.value(
        "(() => { const r = get('stage').getBoundingClientRect(); return [r.left, r.width, r.top + r.height / 3] })()",
    );
    let [left, width, y] = [0, 1, 2].map(|i| edge[i].as_f64().unwrap());
    browser.mouse("mousePressed", left + 0.5 * width, y);
    browser.mouse("mouseMoved", left + 0.25 * width, y);
    browser.mouse("mouseReleased", left + 0.25 * width, y);
    assert!((state(browser, "wipe").as_f64().unwrap() - 0.25).abs() < 0.01);
    assert!(browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap() <= 2.0);
    assert!(state(browser, "view").is_null(), "the drag moved the image too");
    browser.key("m", 0);

    // The wheel keeps the pixel under the pointer; dragging moves.
    let under = format!("imageAt({{ x: {}, y: 200 }})", 0.3 * width);
    let before = browser.value(&under);
    let top = browser.value("get('stage').getBoundingClientRect().top").as_f64().unwrap();
    browser.wheel(left + 0.3 * width, top + 200.0, -300.0);
    let after = browser.value(&under);
    for axis in ["x", "y"] {
        let moved = before[axis].as_f64().unwrap() - after[axis].as_f64().unwrap();
        assert!(moved.abs() < 0.1, "{axis}: {before} became {after}");
    }
    let zoom = state(browser, "view.zoom").as_f64().unwrap();
    browser.mouse("mousePressed", left + 100.0, top + 100.0);
    browser.mouse("mouseMoved", left + 150.0, top + 100.0);
    browser.mouse("mouseReleased", left + 150.0, top + 100.0);
    let moved = after["x"].as_f64().unwrap() - browser.value(&under)["x"].as_f64().unwrap();
    assert!((moved - 50.0 / zoom).abs() < 0.1);

    // The other keys.
    browser.key("f", 0);
    assert!(state(browser, "view").is_null());
    browser.key("e", 0);
    let exposure = browser.value("settingsOf(stage.layers[0]).exposure").as_f64().unwrap();
    browser.key("E", SHIFT);
    let lower = browser.value("settingsOf(stage.layers[0]).exposure").as_f64().unwrap();
    assert!((exposure - lower - 0.5).abs() < 1e-9);
    browser.key("n", 0);
    assert!(browser.value("lookNow().exposure").is_null());
    browser.key("x", 0);
    assert_eq!(state(browser, "metric"), "absolute");
    browser.key("ArrowRight", CONTROL);
    assert_eq!(state(browser, "metric"), "relative");
    browser.key("ArrowRight", 0);
    assert_eq!(state(browser, "channel"), "r");
    browser.key("ArrowDown", 0);
    browser.key("3", SHIFT);
    assert_eq!([state(browser, "layer"), state(browser, "reference")], [json!(1), json!(2)]);
    browser.key("p", 0);
    assert_eq!(
        state(browser, "pin"),
        json!({"x": 3, "y": 0}),
        "infinity is the first that is furthest off"
    );
    assert!(browser.value("view().zoom").as_f64().unwrap() >= 44.0, "values can be read");
    assert!(browser.value("get('probe').textContent").as_str().unwrap().contains("inf"));

    // The address holds all that, and leads back to it.
    browser.until("location.hash.includes('pixel=3,0')");
    let address = browser.value("location.hash").as_str().unwrap().to_owned();
    let all = browser.value("JSON.stringify(state)");
    browser.key("r", 0);
    assert_ne!(browser.value("JSON.stringify(state)"), all);
    opened(browser, &page, &address);
    assert_eq!(browser.value("JSON.stringify(state)"), all);

    browser.key("?", SHIFT);
    assert_eq!(browser.value("get('help').open"), true);
    browser.key("Escape", 0);
    browser.key("0", 0);
    assert_eq!(browser.value("view().zoom"), 1);
    assert_eq!(browser.serious_findings(), Vec::<String>::new());

    // Without WebGL the same, and a missing file is said.
    opened(browser, &page, "?plain");
    assert_eq!(browser.value("stage.painter.name"), "plain canvas");
    assert_eq!(browser.value(SCREEN_IS_WRONG_BY), 0);
    let data = page.with_file_name("viewer");
    let file = std::fs::read_dir(&data).unwrap().next().unwrap().unwrap().path();
    std::fs::remove_file(&file).unwrap();
    browser.open(&page, "");
    let name = file.file_name().unwrap().to_string_lossy().into_owned();
    browser.until(&format!("get('message').textContent.includes('{name} is missing')"));
}

/// The page of `umbra view`, and whether all files could be shown.
fn viewed(out: &Path, files: &[PathBuf]) -> (PathBuf, bool) {
    let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .arg("view")
        .args(files)
        .arg("-o")
        .arg(out)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .unwrap();
    let page = out.join("view.html");
    assert_eq!(String::from_utf8_lossy(&run.stdout).trim_end(), page.display().to_string());
    (page, run.status.success())
}

/// Writes images beside each other, as floats.
fn written<const N: usize>(folder: &Path, images: [(&str, &Image); N]) -> Vec<PathBuf> {
    let write = |(name, image): (&str, &Image)| {
        let file = folder.join(name);
        write_exr(&file, image, Precision::Float, &[]).unwrap();
        file
    };
    images.map(write).into()
}

fn flat(pixel: Vec3) -> Image {
    Image { width: WIDTH, height: HEIGHT, pixels: vec![pixel; WIDTH * HEIGHT] }
}

#[test]
fn what_differs_looks_different() {
    let Some(mut browser) = Chromium::start() else { return };
    let browser = &mut browser;
    let folder = tempfile::tempdir().unwrap();
    let exposures = "stage.layers.map((layer) => settingsOf(layer).exposure)";
    let color = "shade(layerValues(stage.layers[2], 5, 5, settingsOf(stage.layers[2])), stage.layers[2], settingsOf(stage.layers[2]))";

    // One exposure for all images, that of the first: a constant factor stays visible, also after N.
    let (one, two, black) = (image(1.0), image(1000.0), flat(Vec3::ZERO));
    let files = written(folder.path(), [("a.exr", &one), ("b.exr", &two), ("black.exr", &black)]);
    let (page, _) = viewed(&folder.path().join("factor"), &files[..2]);
    opened(browser, &page, "");
    for _ in 0..2 {
        let stops = browser.value(exposures);
        assert_eq!(stops[0], stops[1]);
        assert!(
            stops[0].as_f64().unwrap().abs() < 1.5 && stops[2].as_f64().unwrap() < -8.0,
            "{stops}"
        );
        browser.key("2", 0);
        browser.key("n", 0);
    }
    // Of a black one nothing can be found: the next decides.
    let files = [files[2].clone(), files[1].clone(), files[0].clone()];
    let (page, _) = viewed(&folder.path().join("black"), &files);
    opened(browser, &page, "");
    let stops = browser.value(exposures);
    assert!(stops[0] == stops[2] && stops[0].as_f64().unwrap() < -8.0, "{stops}");
    assert_eq!(stops[3], stops[4], "one exposure for all differences");
    // Of a comparison it is that of the expected one.
    let out = folder.path().join("compared");
    let mut compare = Command::new(env!("CARGO_BIN_EXE_umbra"));
    compare.arg("compare").args(&files[1..]).args(["--no-metrics", "--html"]).arg(&out);
    compare.output().unwrap();
    opened(browser, &out.join("view.html"), "");
    let stops = browser.value(exposures);
    assert!(stops[0] == stops[1] && stops[0].as_f64().unwrap().abs() < 1.5, "{stops}");

    // Channels that are exchanged differ, with a sign, relatively and absolutely, on both canvases.
    let pixels = [Vec3::new(0.8, 0.2, 0.5), Vec3::new(0.2, 0.8, 0.5)].map(flat);
    let files = written(folder.path(), [("s.exr", &pixels[0]), ("t.exr", &pixels[1])]);
    let (page, _) = viewed(&folder.path().join("swapped"), &files);
    for suffix in ["", "?plain"] {
        opened(browser, &page, suffix);
        browser.key("3", 0);
        for metric in ["signed", "absolute", "relative"] {
            assert_eq!(browser.value("state.metric"), metric);
            let shown = browser.value(color);
            let [r, b] = [0, 2].map(|c| shown[c].as_i64().unwrap());
            assert!((r - b).abs() > 100, "{metric}{suffix}: {shown}");
            assert!(browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap() <= 2.0, "{metric}{suffix}");
            let unit = browser.value("get('unit').textContent");
            assert!(unit.as_str().unwrap().contains("of the channel that differs most"), "{unit}");
            browser.key("x", 0);
        }
    }
}

#[test]
fn numbers_are_those_of_the_whole_image() {
    let Some(mut browser) = Chromium::start() else { return };
    let browser = &mut browser;
    let folder = tempfile::tempdir().unwrap();
    // More pixels than are looked at for a histogram, and the odd ones not among these.
    let (width, height) = (900, 500);
    let value = |index: usize| 0.25 + 0.5 * (index % 7) as f32 / 7.0;
    let pixels = (0..width * height).map(|index| Vec3::splat(value(index))).collect();
    let mut one = Image { width, height, pixels };
    one.pixels[width + 1].x = 1234567.0;
    one.pixels[width + 3].y = -77.0;
    one.pixels[3 * width + 501] = Vec3::new(f32::NAN, f32::INFINITY, 0.5);
    let mut two = one.clone();
    two.pixels[201 * width + 103].z += 0.25;
    let files = written(folder.path(), [("one.exr", &one), ("two.exr", &two)]);
    let (page, _) = viewed(&folder.path().join("out"), &files);
    opened(browser, &page, "");
    let facts = browser.value("get('facts').textContent");
    let facts = facts.as_str().unwrap();
    assert!(facts.starts_with("least -77 · mean "), "{facts}");
    assert!(facts.ends_with(" · most 1234567 · 1 pixel not finite"), "{facts}");

    // Moving the image counts nothing anew.
    browser.value("window.counted = 0; { const own = forPixels; forPixels = (...all) => { counted++; own(...all); }; } 0");
    browser.key("h", 0);
    browser.key("+", 0);
    assert_eq!(browser.value("counted"), 0);

    // What is no number in both is no difference, as for `umbra compare`.
    browser.key("3", 0);
    assert_eq!(
        browser.value("get('facts').textContent").as_str().unwrap().rsplit(" · ").next(),
        Some("most 0")
    );
    assert_eq!(
        browser.value("[...layerValues(stage.layers[2], 501, 3, { metric: 'relative' })]"),
        json!([0, 0, 0])
    );
    browser.key("p", 0);
    assert_eq!(browser.value("state.pin"), json!({"x": 103, "y": 201}));
    assert!(browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap() <= 2.0);

    // An image and itself have no worst pixel.
    let (page, _) = viewed(&folder.path().join("same"), &[files[0].clone(), files[0].clone()]);
    opened(browser, &page, "");
    browser.key("p", 0);
    assert!(browser.value("state.pin").is_null());
    assert_eq!(browser.value("get('message').textContent"), "one.exr - one.exr: no pixel differs.");

    // The probe's digits give the very value back.
    let probed = |browser: &mut Chromium, value: f32, kind: &str| {
        let words = browser.value(&format!("exact({}, '{kind}')", f64::from(value)));
        words.as_str().unwrap().to_owned()
    };
    for value in [
        0.1,
        1234567.0,
        16777216.0,
        123456792.0,
        0.333_333_34,
        3.402_823_5e38,
        1e-45,
        -0.000_123_4,
        12345.67,
    ] {
        let words = probed(browser, value, "float");
        assert_eq!(words.parse::<f32>().unwrap(), value, "{words}");
    }
    assert_eq!(probed(browser, 1234567.0, "float"), "1234567");
    assert_eq!(probed(browser, 0.1, "float"), "0.1");
    for bits in (0..0x7c00u16).step_by(13) {
        let half = half::f16::from_bits(bits);
        let words = probed(browser, half.to_f32(), "half");
        assert_eq!(half::f16::from_f64(words.parse().unwrap()), half, "{words}");
        assert!(words.len() <= 10, "{words}");
    }
    assert_eq!(probed(browser, half::f16::from_f32(0.1).to_f32(), "half"), "0.1");
    // Values over pixels never lose digits in front of the point.
    assert_eq!(
        browser.value("[digits(12345), digits(1234567), digits(12345.6), digits(0.123456)]"),
        json!(["12345", "1234567", "1.23e+4", "0.1235"])
    );
}

#[test]
fn keys_reach_what_has_the_focus_and_a_lost_context_is_replaced() {
    let Some(mut browser) = Chromium::start() else { return };
    let browser = &mut browser;
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (image(1.0), image(0.9));
    let files = written(folder.path(), [("a.exr", &one), ("b.exr", &two)]);
    let (page, _) = viewed(&folder.path().join("out"), &files);
    opened(browser, &page, "");
    let slider =
        |browser: &mut Chromium| browser.value("Number(get('exposure').value)").as_f64().unwrap();

    // A slider that has the focus takes the arrows, and leaves letters to the images.
    browser.value("get('exposure').focus()");
    let before = slider(browser);
    for _ in 0..3 {
        browser.key("ArrowRight", 0);
    }
    assert!((slider(browser) - before - 0.3).abs() < 1e-6);
    assert!((browser.value("lookNow().exposure").as_f64().unwrap() - before - 0.3).abs() < 1e-6);
    browser.key("Home", 0);
    assert_eq!(slider(browser), -20.0);
    assert_eq!(browser.value("[state.layer, state.channel]"), json!([0, "rgb"]));
    browser.key("2", 0);
    assert_eq!(browser.value("state.layer"), 1);

    // A list used by keys keeps them; one used by the mouse gives them back.
    let choose = "get('tone').focus(); get('tone').value = 'gamma'; get('tone').dispatchEvent(new Event('change'))";
    browser.value(choose);
    assert_eq!(browser.value("document.activeElement.id"), "tone");
    browser.value(&format!("get('tone').dispatchEvent(new Event('pointerdown')); {choose}"));
    assert_eq!(browser.value("document.activeElement.id"), "stage");
    browser.key("1", 0);
    assert_eq!(browser.value("state.layer"), 0);
    // So does a button, one of the list of images too.
    for button in ["#fit", "#layers .show", "#layers li:last-child .against", "#auto"] {
        let at = browser.value(&format!(
            "(({{ left, top }}) => [left + 4, top + 4])(document.querySelector('{button}').getBoundingClientRect())"
        ));
        let [x, y] = [0, 1].map(|axis| at[axis].as_f64().unwrap());
        browser.mouse("mousePressed", x, y);
        browser.mouse("mouseReleased", x, y);
        browser.key_down(" ", 0);
        assert_eq!(browser.value("stage.held"), true, "{button}");
        browser.key_up(" ");
    }

    assert_eq!(browser.value("stage.painter.name"), "WebGL 2");
    browser.value("stage.gl.gl.getExtension('WEBGL_lose_context').loseContext()");
    browser.until("stage.painter.name === 'plain canvas' && !stage.pending");
    assert!(browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap() <= 1.0);
    let said = browser.value("get('painter').textContent");
    assert!(said.as_str().unwrap().starts_with("Without WebGL"), "{said}");
    assert_eq!(browser.serious_findings(), Vec::<String>::new());
}

#[test]
fn every_channel_is_shown_and_a_file_that_cannot_be_read_ends_nothing() {
    let Some(mut browser) = Chromium::start() else { return };
    let browser = &mut browser;
    let folder = tempfile::tempdir().unwrap();
    let [gray, deep, other, broken] =
        ["gray.exr", "deep.exr", "other.exr", "broken.exr"].map(|name| folder.path().join(name));
    let plane = |scale: f32| (0..12).map(|index| scale * index as f32).collect::<Vec<f32>>();
    write_exr_channels(&gray, [0, 0], 4, &[("Y", plane(1.0))]).unwrap();
    for (file, scale) in [(&deep, 10.0), (&other, 20.0)] {
        let colors = ["B", "G", "R"].map(|name| (name, plane(1.0)));
        let all: Vec<_> = colors.into_iter().chain([("depth.Z", plane(scale))]).collect();
        write_exr_channels(file, [0, 0], 4, &all).unwrap();
    }
    std::fs::write(&broken, "no image").unwrap();
    let files = [gray, broken.clone(), deep, other];
    let (page, whole) = viewed(&folder.path().join("out"), &files);
    assert!(!whole, "one was left out");
    opened(browser, &page, "");
    let cases = browser
        .value("manifest.cases.map((own) => [own.id, ...own.layers.map((layer) => layer.name)])");
    assert_eq!(
        cases,
        json!([
            ["4x3", "deep.exr", "other.exr", "deep.exr - other.exr"],
            ["4x3 Y", "gray.exr Y"],
            [
                "4x3 depth.Z",
                "deep.exr depth.Z",
                "other.exr depth.Z",
                "deep.exr depth.Z - other.exr depth.Z"
            ],
        ])
    );
    opened(browser, &page, "#case=4x3%20depth.Z&layer=3");
    assert_eq!(
        browser.value("[...layerValues(stage.layers[2], 3, 1, { metric: 'signed' })]"),
        json!([-70])
    );
    for key in ["1", "3"] {
        browser.key(key, 0);
        assert!(browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap() <= 2.0, "{key}");
    }
    // Nothing is left if none can be read.
    let mut view = Command::new(env!("CARGO_BIN_EXE_umbra"));
    let run =
        view.arg("view").arg(&broken).arg("-o").arg(folder.path().join("none")).output().unwrap();
    assert_eq!(run.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&run.stderr).contains("broken.exr"));
}

#[test]
fn the_case_that_was_chosen_last_is_shown() {
    let Some(mut browser) = Chromium::start() else { return };
    let browser = &mut browser;
    let folder = tempfile::tempdir().unwrap();
    let small = Image { width: 4, height: 3, pixels: vec![Vec3::ONE; 12] };
    let (page, _) = viewed(
        &folder.path().join("out"),
        &written(folder.path(), [("small.exr", &small), ("large.exr", &image(1.0))]),
    );
    opened(browser, &page, "#case=4x3");
    let slow = format!(
        "{{ const own = loadImage; window.late = []; loadImage = (about) => about.width === {WIDTH} \
         ? own(about).then((image) => new Promise((done) => late.push(() => done(image)))) : own(about); }} 0"
    );
    browser.value(&slow);
    // The address, the list, and the way back: whatever is loaded first.
    for back in ["location.hash = 'case=4x3'", "history.back()"] {
        browser.value(&format!("location.hash = 'case={WIDTH}x{HEIGHT}'"));
        browser.until("state.case === '60x40' && late.length === 1");
        browser.value(&format!("{back}; 0"));
        browser.until("state.case === '4x3' && stage.about");
        browser.value("late.pop()()");
        browser.frame();
        assert_eq!(
            browser.value(
                "[state.case, stage.about.id, stage.layers[0].image.width, get('case').value]"
            ),
            json!(["4x3", "4x3", 4, "4x3"])
        );
        browser.until("location.hash.startsWith('#case=4x3&')");
    }
    // What comes late is shown where it is still wanted.
    browser.value(&format!("location.hash = 'case={WIDTH}x{HEIGHT}'"));
    browser.until("late.length === 1");
    browser.value("late.pop()()");
    browser.until("stage.about?.id === '60x40' && stage.layers[0].image.width === 60");
}

#[test]
fn a_long_thin_image_is_seen() {
    let Some(mut browser) = Chromium::start() else { return };
    let browser = &mut browser;
    let folder = tempfile::tempdir().unwrap();
    let sizes = [(5000, 1), (1, 5000)];
    let files: Vec<PathBuf> = sizes
        .iter()
        .map(|&(width, height)| {
            let pixels = vec![Vec3::new(0.9, 0.4, 0.1); width * height];
            let file = folder.path().join(format!("{width}x{height}.exr"));
            write_exr(&file, &Image { width, height, pixels }, Precision::Float, &[]).unwrap();
            file
        })
        .collect();
    let (page, _) = viewed(&folder.path().join("out"), &files);
    for suffix in ["", "?plain"] {
        for (width, height) in sizes {
            opened(browser, &page, &format!("{suffix}#case={width}x{height}"));
            assert_eq!(browser.value("stage.layers[0].image.width"), width);
            let apart = browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap();
            assert!(apart <= 2.0, "{width}x{height}{suffix}: {apart} levels");
        }
    }
}

#[test]
fn what_can_be_told_apart_reads_differently() {
    let Some(mut browser) = Chromium::start() else { return };
    let browser = &mut browser;
    let folder = tempfile::tempdir().unwrap();
    let flat = flat(Vec3::splat(0.1));
    let files = ["float.exr", "half.exr", "other.exr"].map(|name| folder.path().join(name));
    for (file, precision) in files.iter().zip([Precision::Float, Precision::Half, Precision::Half])
    {
        write_exr(file, &flat, precision, &[]).unwrap();
    }
    let probed = |browser: &mut Chromium, files: &[PathBuf], name: &str| {
        let (page, _) = viewed(&folder.path().join(name), files);
        opened(browser, &page, "#pixel=6,0");
        browser.value("[...get('probe').querySelectorAll('td')].filter((_, i) => i % 3 === 0).map((cell) => cell.textContent)")
    };
    // Beside a float a half has digits that give its value back, not only the half.
    assert_eq!(
        probed(browser, &files[..2], "mixed"),
        json!(["0.1", "0.099975586", "2.4415553e-5"])
    );
    assert_eq!(probed(browser, &files[1..], "halves"), json!(["0.1", "0.1", "0"]));
    // No two regions have one color, nor one that another has in the shade of edges or highlights.
    assert_eq!(
        browser
            .value("new Set([...Array(25).keys()].map((index) => regionColor(index).join())).size"),
        25
    );
}

#[test]
fn a_name_injects_nothing() {
    let Some(mut browser) = Chromium::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let evil =
        "<img src=x onerror=window.pwned=1><\u{202e}script>window.pwned=2<\\script>&quot;.exr";
    let file = folder.path().join(evil);
    write_exr(&file, &image(1.0), Precision::Half, &[]).unwrap();
    let (page, _) = viewed(&folder.path().join("out"), &[file]);
    opened(&mut browser, &page, "");
    let shown = browser.value("stage.layers[0].name");
    assert_eq!(shown, evil.replace('\u{202e}', "\\u{202e}"));
    // Even markup that got in would not run.
    browser.value(
        "addEventListener('securitypolicyviolation', () => { window.refused = (window.refused ?? 0) + 1 }); \
         document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=\"window.pwned = 3\">')",
    );
    browser.until("window.refused > 0");
    assert!(browser.value("window.pwned ?? null").is_null());
}

#[test]
fn pages_that_were_given_no_folder_do_not_pile_up() {
    let place = tempfile::tempdir().unwrap();
    let image = place.path().join("a.exr");
    write_exr(&image, &Image::new(2, 2), Precision::Half, &[]).unwrap();
    let others = ["umbra-view-file", "else"].map(|name| place.path().join(name));
    others.iter().for_each(|other| std::fs::write(other, "").unwrap());
    let mut pages = Vec::new();
    for _ in 0..5 {
        let mut umbra = std::process::Command::new(env!("CARGO_BIN_EXE_umbra"));
        umbra.arg("view").arg(&image).env("TMPDIR", place.path()).env_remove("DISPLAY");
        let said = umbra.env_remove("WAYLAND_DISPLAY").output().unwrap();
        assert!(said.status.success(), "{said:?}");
        pages.push(PathBuf::from(String::from_utf8(said.stdout).unwrap().trim_end()));
    }
    let there: Vec<bool> = pages.iter().map(|page| page.is_file()).collect();
    assert_eq!(there, [false, false, true, true, true]);
    assert!(others.iter().all(|other| other.exists()));
}
