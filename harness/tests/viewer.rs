//! The viewer in a real browser: the pages that `umbra compare --html` and `umbra view` write.

use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::exr_io::{Precision, read_exr, write_exr};
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
  let worst = 0;
  for (const { layer, box, clip } of panes()) {
    const origin = originOf(box), { zoom } = view(), settings = settingsOf(layer);
    for (let y = 0; y < layer.image.height; y += 3) for (let x = 0; x < layer.image.width; x += 3) {
      const px = Math.floor((origin.x + (x + 0.5) * zoom) * stage.ratio), py = Math.floor((origin.y + (y + 0.5) * zoom) * stage.ratio);
      if (px < clip.x || py < clip.y || px >= clip.x + clip.width || py >= clip.y + clip.height) continue;
      let seen;
      if (stage.painter.gl) {
        seen = new Uint8Array(4);
        const gl = stage.painter.gl;
        gl.readPixels(px, stage.painter.height - 1 - py, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, seen);
      } else seen = stage.painter.context.getImageData(px, py, 1, 1).data;
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
        for _ in 0..4 {
            browser.key("ArrowRight", SHIFT);
            seen.push(browser.value("lookNow().tone"));
            let apart = browser.value(SCREEN_IS_WRONG_BY).as_f64().unwrap();
            assert!(apart <= 2.0, "layer {key}, {:?}: {apart} levels", seen.last());
        }
    }
    assert_eq!(seen[..4], ["gamma", "false", "signed", "srgb"].map(Value::from));

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

#[test]
fn a_name_injects_nothing() {
    let Some(mut browser) = Chromium::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let evil =
        "<img src=x onerror=window.pwned=1><\u{202e}script>window.pwned=2<\\script>&quot;.exr";
    let file = folder.path().join(evil);
    write_exr(&file, &image(1.0), Precision::Half, &[]).unwrap();
    let out = folder.path().join("out");
    let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .arg("view")
        .arg(&file)
        .arg("-o")
        .arg(&out)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .unwrap();
    let page = out.join("view.html");
    assert_eq!(String::from_utf8_lossy(&run.stdout).trim_end(), page.display().to_string());
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
