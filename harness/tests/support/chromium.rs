//! A headless Chromium, driven over a pipe by the DevTools protocol: JSON texts that end with a zero byte. No crate is
//! needed for that.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

/// Nothing in these tests may take longer, on a busy machine either.
const PATIENCE: Duration = Duration::from_secs(60);
/// What a page and the page in it say.
const PAGE: &str = "[window, ...frames].map((w) => `${w.location.href}: ${w.document.body.innerText.slice(0, 1500)}`)";

/// A browser with one open page.
pub struct Chromium {
    process: Child,
    commands: ChildStdin,
    messages: Receiver<Value>,
    session: String,
    last: u64,
    _profile: TempDir,
}

/// Shift, as the protocol counts modifier keys.
pub const SHIFT: u32 = 8;
/// Control.
pub const CONTROL: u32 = 2;

impl Chromium {
    /// Starts the browser that is on `PATH`. Without one the test says so; where `CI` is `true` it fails.
    pub fn start() -> Option<Self> {
        let names = ["chromium", "chromium-browser", "google-chrome"];
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders: Vec<_> = std::env::split_paths(&path).collect();
        let found = names
            .iter()
            .find_map(|name| folders.iter().map(|f| f.join(name)).find(|file| file.is_file()));
        let Some(program) = found else {
            assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "no Chromium on PATH");
            eprintln!("not run here: there is no Chromium on PATH");
            return None;
        };
        let profile = tempfile::tempdir().unwrap();
        // It reads commands from file 3 and writes to file 4.
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1"])
            .arg(program)
            .args(["--headless", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run"])
            .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let commands = process.stdin.take().unwrap();
        let mut answers = BufReader::new(process.stdout.take().unwrap());
        let (sender, messages) = channel();
        thread::spawn(move || {
            let mut bytes = Vec::new();
            while answers.read_until(0, &mut bytes).is_ok_and(|read| read > 0) {
                bytes.pop();
                let message = serde_json::from_slice(&bytes).unwrap();
                bytes.clear();
                if sender.send(message).is_err() {
                    break;
                }
            }
        });
        let session = String::new();
        let mut browser = Self { process, commands, messages, session, last: 0, _profile: profile };
        let page = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let attach = json!({"targetId": page["targetId"], "flatten": true});
        let attached = browser.call("Target.attachToTarget", attach);
        browser.session = attached["sessionId"].as_str().unwrap().to_owned();
        browser.call("Page.enable", json!({}));
        browser.size(1200, 800);
        Some(browser)
    }

    /// Asks for something and waits for the answer.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.asked(method, parameters).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// The same, with Chromium's error where it has one.
    fn asked(&mut self, method: &str, parameters: Value) -> Result<Value, Value> {
        self.last += 1;
        let mut command = json!({"id": self.last, "method": method, "params": parameters});
        if !self.session.is_empty() {
            command["sessionId"] = json!(self.session);
        }
        self.commands.write_all(format!("{command}\0").as_bytes()).unwrap();
        loop {
            let message = self.messages.recv_timeout(PATIENCE).expect("Chromium answers");
            if message["id"] == json!(self.last) {
                let error = &message["error"];
                return if error.is_null() {
                    Ok(message["result"].clone())
                } else {
                    Err(error.clone())
                };
            }
        }
    }

    /// The size of the window, in CSS pixels.
    pub fn size(&mut self, width: u32, height: u32) {
        let metrics =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.call("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// Whether the page is asked for in dark colors.
    pub fn dark(&mut self, dark: bool) {
        let value = if dark { "dark" } else { "light" };
        let features = json!([{"name": "prefers-color-scheme", "value": value}]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// What axe-core finds serious about the open page, or worse, wide and narrow, light and dark. Nothing where
    /// `./run test` could not install axe-core.
    pub fn serious_findings(&mut self) -> Vec<String> {
        let axe =
            concat!(env!("CARGO_MANIFEST_DIR"), "/../target/umbra/browser/package/axe.min.js");
        let Ok(axe) = std::fs::read_to_string(axe) else {
            eprintln!("not run here: there is no axe-core, which ./run test installs where npm is");
            return Vec::new();
        };
        self.value(&format!("{axe};0"));
        const RUN: &str = "axe.run(document, { iframes: false, resultTypes: ['violations'] }).then(({ violations }) => \
            violations.filter(({ impact }) => impact === 'serious' || impact === 'critical') \
            .map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target.join(' ')).slice(0, 4).join(', ')}`))";
        let found = |browser: &mut Self| -> Vec<String> {
            serde_json::from_value(browser.value(RUN)).unwrap()
        };
        // It sees what is there to be seen.
        self.value("document.body.insertAdjacentHTML('beforeend', '<img id=\"wrong\" width=\"9\" height=\"9\">')");
        assert!(
            found(self).iter().any(|finding| finding.contains("#wrong")),
            "axe-core finds nothing"
        );
        self.value("document.getElementById('wrong').remove()");
        let mut all = Vec::new();
        for (width, dark) in [(1200, false), (1200, true), (390, true), (390, false)] {
            self.size(width, 800);
            self.dark(dark);
            self.frame();
            let look = if dark { "dark" } else { "light" };
            all.extend(
                found(self).into_iter().map(|finding| format!("{width} px, {look}: {finding}")),
            );
        }
        self.size(1200, 800);
        all
    }

    /// Opens a page of the file system; `suffix` is a query or fragment.
    pub fn open(&mut self, page: &Path, suffix: &str) {
        // A fragment alone would not load the page again.
        self.call("Page.navigate", json!({"url": "about:blank"}));
        let url = format!("file://{}{suffix}", page.display());
        let answer = self.call("Page.navigate", json!({ "url": url }));
        assert!(answer["errorText"].is_null(), "{url}: {answer}");
        self.until("location.protocol === 'file:' && document.readyState === 'complete'");
    }

    /// The value of an expression in the page; promises are waited for.
    pub fn value(&mut self, expression: &str) -> Value {
        let answer = self.evaluate(expression);
        answer.unwrap_or_else(|error| panic!("{expression}: {error}"))
    }

    fn evaluate(&mut self, expression: &str) -> Result<Value, Value> {
        let request =
            json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let answer = self.asked("Runtime.evaluate", request)?;
        let thrown = &answer["exceptionDetails"];
        assert!(thrown.is_null(), "{expression}: {thrown}");
        Ok(answer["result"]["value"].clone())
    }

    /// Waits until an expression is true. A page that another one takes the place of has no answer.
    pub fn until(&mut self, expression: &str) {
        let begun = Instant::now();
        let guarded =
            format!("(() => {{ try {{ return !!({expression}) }} catch {{ return false }} }})()");
        loop {
            let answer = self.evaluate(&guarded);
            if answer == Ok(json!(true)) {
                return;
            }
            if begun.elapsed() > PATIENCE {
                let page = self.evaluate(PAGE);
                panic!("never true: {expression} ({answer:?}); the page: {page:?}");
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the page has drawn what was asked for.
    pub fn frame(&mut self) {
        self.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))");
    }

    /// Presses a key down, with modifiers.
    pub fn key_down(&mut self, key: &str, modifiers: u32) {
        let code = match key {
            digit if digit.len() == 1 && digit.as_bytes()[0].is_ascii_digit() => {
                format!("Digit{digit}")
            }
            other => other.to_owned(),
        };
        let mut event =
            json!({"type": "keyDown", "key": key, "code": code, "modifiers": modifiers});
        // Else no dialog closes and no slider moves.
        let number = match key {
            "Escape" => Some(27),
            "Home" => Some(36),
            "ArrowLeft" => Some(37),
            "ArrowUp" => Some(38),
            "ArrowRight" => Some(39),
            "ArrowDown" => Some(40),
            _ => None,
        };
        if let Some(number) = number {
            event["windowsVirtualKeyCode"] = json!(number);
        }
        if key.chars().count() == 1 && modifiers & CONTROL == 0 {
            event["text"] = json!(key);
        }
        self.call("Input.dispatchKeyEvent", event);
        self.frame();
    }

    /// Lets a key go.
    pub fn key_up(&mut self, key: &str) {
        self.call("Input.dispatchKeyEvent", json!({"type": "keyUp", "key": key, "code": key}));
        self.frame();
    }

    /// Presses a key and lets it go.
    pub fn key(&mut self, key: &str, modifiers: u32) {
        self.key_down(key, modifiers);
        self.key_up(key);
    }

    /// Moves the pointer, presses or releases the left button (`mouseMoved`, `mousePressed`, `mouseReleased`).
    pub fn mouse(&mut self, what: &str, x: f64, y: f64) {
        let event =
            json!({"type": what, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1});
        self.call("Input.dispatchMouseEvent", event);
        self.frame();
    }

    /// Turns the wheel by so many CSS pixels.
    pub fn wheel(&mut self, x: f64, y: f64, delta: f64) {
        let event = json!({"type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": delta});
        self.call("Input.dispatchMouseEvent", event);
        self.frame();
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        self.session.clear();
        let close = json!({"id": 0, "method": "Browser.close"});
        let asked = self.commands.write_all(format!("{close}\0").as_bytes());
        let begun = Instant::now();
        while asked.is_ok() && begun.elapsed() < Duration::from_secs(10) {
            if self.process.try_wait().is_ok_and(|ended| ended.is_some()) {
                return;
            }
            thread::sleep(Duration::from_millis(20));
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
