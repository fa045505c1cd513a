//! Serves the page of `umbra watch`, on this machine alone.
//!
//! Every address begins with a secret. It reaches the browser through a file that only its owner can read, so it never
//! appears on a command line. Requests for another host, or from another origin, are refused: a page elsewhere, or a
//! name that somebody points at this machine, learns nothing.

use std::io::{self, Write as _};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use anyhow::Context as _;
use serde::Serialize;
use tempfile::TempDir;
use tiny_http::{Header, Method, Request, Response};

use super::live::{FrameQuestion, LiveView};
use super::page::page as watch_page;
use crate::report::HTML_FILE;

/// Time after which a browser that went away is noticed.
const PING: Duration = Duration::from_secs(20);
/// Bytes of the secret.
const SECRET_BYTES: usize = 16;

/// The state of the last save.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CheckState {
    /// It is being checked.
    #[default]
    Running,
    /// Its report is there, and nothing is wrong.
    Done,
    /// Its report is there, all points too, but it cannot be submitted so.
    Unready,
    /// Its report is there, and tells of lost points.
    Lost,
    /// Its report is there; something of it does not compile.
    Refused,
    /// There is no report.
    Failed,
}

/// What the last report is worth after the last save.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Holds {
    /// There is none, or nothing of it need hold any more.
    #[default]
    Nothing,
    /// What it says of the offline half still holds.
    Offline,
    /// All of it: it is that of the last save.
    All,
}

/// What the page shows beside the report.
#[derive(Clone, Debug, Default, Serialize)]
struct Shown {
    /// Rises with every change.
    version: u64,
    stage: CheckState,
    message: String,
    /// What the page's title says of the last report.
    verdict: String,
    /// How many reports there were: the page loads it again when this rises.
    reports: u64,
    /// How many libraries there were for the live view, which asks again when this rises.
    libraries: u64,
    /// Whether the last of them is that of the last save.
    fresh: bool,
    /// What the last report is worth.
    holds: Holds,
}

/// Where the watch tells its browsers what it does.
#[derive(Default)]
pub struct Board {
    shown: Mutex<Shown>,
    changed: Condvar,
}

impl Board {
    /// Shows a stage; an empty message leaves the last one.
    pub fn show(&self, stage: CheckState, message: &str) {
        self.change(stage, message, |_| ());
    }

    /// Shows that there is a new report, with its verdict in a few words and in a sentence.
    pub fn report(&self, stage: CheckState, verdict: &str, message: &str) {
        self.change(stage, message, |shown| {
            shown.holds = Holds::All;
            shown.verdict = crate::report::harmless(verdict);
            shown.reports += 1;
        });
    }

    /// Shows that a save is being checked, and whether what was found offline still holds.
    pub fn saved(&self, offline_holds: bool) {
        self.change(CheckState::Running, "starting", |shown| {
            shown.fresh = false;
            shown.holds = if offline_holds { Holds::Offline } else { Holds::Nothing };
        });
    }

    /// Shows that it compiled.
    pub fn compiled(&self) {
        self.change(CheckState::Running, "", |shown| {
            shown.libraries += 1;
            shown.fresh = true;
        });
    }

    fn change(&self, stage: CheckState, message: &str, what: impl FnOnce(&mut Shown)) {
        let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        what(&mut shown);
        shown.version += 1;
        shown.stage = stage;
        if !message.is_empty() {
            shown.message = crate::report::harmless(message);
        }
        self.changed.notify_all();
    }

    /// What is shown once it is newer than `version`; none when that takes long.
    fn newer(&self, version: u64) -> Option<Shown> {
        let shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        let old = |shown: &mut Shown| shown.version <= version;
        let waited = self.changed.wait_timeout_while(shown, PING, old);
        let (shown, waited) = waited.unwrap_or_else(PoisonError::into_inner);
        (!waited.timed_out()).then(|| shown.clone())
    }
}

/// The server; it ends with the program.
pub struct Server {
    /// `127.0.0.1:PORT`
    host: String,
    secret: String,
}

/// A private file that leads the browser to the page; gone when this is dropped.
pub struct Door {
    folder: TempDir,
}

impl Door {
    /// The file.
    pub fn path(&self) -> PathBuf {
        self.folder.path().join("watch.html")
    }
}

impl Server {
    /// Serves the report in a folder, and what is on the board.
    ///
    /// # Errors
    /// When no port can be had.
    pub fn start(folder: PathBuf, board: Arc<Board>, live: Arc<LiveView>) -> anyhow::Result<Self> {
        let server = tiny_http::Server::http("127.0.0.1:0").map_err(anyhow::Error::from_boxed)?;
        let address = server.server_addr().to_ip().context("a port of this machine")?;
        let mut secret = [0; SECRET_BYTES];
        getrandom::fill(&mut secret).map_err(io::Error::from)?;
        let secret = crate::files::hex(&secret);
        let own = Self { host: address.to_string(), secret: secret.clone() };
        let (host, secret) = (own.host.clone(), secret);
        std::thread::spawn(move || {
            for request in server.incoming_requests() {
                let asked = Route::of(&request, &host, &secret);
                let (folder, board) = (folder.clone(), Arc::clone(&board));
                let live = Arc::clone(&live);
                // One that only waits must not hold up the others.
                std::thread::spawn(move || answer(request, asked, &folder, &board, &live));
            }
        });
        Ok(own)
    }

    /// A new file that leads to the page, which only its owner can read.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn door(&self) -> io::Result<Door> {
        let door = Door { folder: crate::files::private_folder("umbra-watch-")? };
        let mut options = std::fs::OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let (host, secret) = (&self.host, &self.secret);
        writeln!(
            options.open(door.path())?,
            "<!DOCTYPE html><meta charset=\"utf-8\"><meta name=\"referrer\" content=\"no-referrer\">\
             <meta http-equiv=\"refresh\" content=\"0;url=http://{host}/{secret}/\"><title>Umbra</title>"
        )?;
        Ok(door)
    }
}

/// What a request asks for, after everything that could be wrong with it.
#[derive(Debug, PartialEq)]
enum Route {
    Page,
    Events,
    /// The scenes of the live view.
    Scenes,
    /// A picture of one.
    Frame(FrameQuestion),
    /// A file of the report, by a path of plain names.
    File(PathBuf),
    /// Refused, with the status.
    Nothing(u16),
}

impl Route {
    fn of(request: &Request, host: &str, secret: &str) -> Self {
        let header = |name: &str| {
            let mut all = request.headers().iter();
            all.find(|header| header.field.as_str().as_str().eq_ignore_ascii_case(name))
                .map(|header| header.value.as_str())
        };
        if *request.method() != Method::Get {
            return Self::Nothing(405);
        }
        Self::of_parts(request.url(), header("host"), header("origin"), host, secret)
    }

    fn of_parts(
        url: &str,
        asked_host: Option<&str>,
        origin: Option<&str>,
        host: &str,
        secret: &str,
    ) -> Self {
        let own = format!("http://{host}");
        if asked_host != Some(host) || origin.is_some_and(|origin| origin != own) {
            return Self::Nothing(403);
        }
        let path = url.split(['?', '#']).next().unwrap_or_default();
        let mut parts = path.trim_start_matches('/').splitn(2, '/');
        let (Some(given), Some(rest)) = (parts.next(), parts.next()) else {
            return Self::Nothing(403);
        };
        if !same(given.as_bytes(), secret.as_bytes()) {
            return Self::Nothing(403);
        }
        match rest {
            "" => Self::Page,
            "events" => Self::Events,
            "scenes" => Self::Scenes,
            "frame" => url
                .split_once('?')
                .and_then(|(_, query)| FrameQuestion::parse(query))
                .map_or(Self::Nothing(400), Self::Frame),
            _ => rest
                .strip_prefix("report/")
                .and_then(plain_path)
                .map_or(Self::Nothing(404), Self::File),
        }
    }
}

/// Whether two texts are equal, in a time that does not tell where they differ.
fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |apart, (a, b)| apart | (a ^ b)) == 0
}

/// A path of names that mean nothing but themselves, percent signs decoded.
fn plain_path(text: &str) -> Option<PathBuf> {
    let mut bytes = Vec::new();
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => {
                let digits = [rest.next()?, rest.next()?];
                u8::from_str_radix(std::str::from_utf8(&digits).ok()?, 16).ok()?
            }
            other => other,
        });
    }
    let text = String::from_utf8(bytes).ok()?;
    let path = PathBuf::from(&text);
    let plain = |part: Component| match part {
        Component::Normal(name) => !name.as_encoded_bytes().starts_with(b"."),
        _ => false,
    };
    let odd = text.contains(['\\', '\0', ':']) || text.contains("//");
    (!odd && path.components().count() > 0 && path.components().all(plain)).then_some(path)
}

fn answer(request: Request, asked: Route, folder: &Path, board: &Board, live: &LiveView) {
    // A browser that goes away is no error.
    let _ = match asked {
        Route::Page => {
            request.respond(page("text/html; charset=utf-8", watch_page(HTML_FILE).into_bytes()))
        }
        Route::Events => events(request, board),
        Route::Scenes => request.respond(page("application/json", live.scenes().into_bytes())),
        Route::Frame(question) => match live.picture(&question) {
            Ok(Some(bytes)) => request.respond(page("application/octet-stream", bytes)),
            Ok(None) => request.respond(page("text/plain", Vec::new()).with_status_code(204)),
            Err(words) => {
                let lines: Vec<String> = words.lines().map(crate::report::harmless).collect();
                let words = lines.join("\n").into_bytes();
                request.respond(page("text/plain; charset=utf-8", words).with_status_code(409))
            }
        },
        Route::File(path) => match file(folder, &path) {
            Some((kind, bytes)) => request.respond(page(kind, bytes)),
            None => request.respond(refused(404)),
        },
        Route::Nothing(status) => request.respond(refused(status)),
    };
}

/// What every answer says: nothing of it is kept, guessed at, shown inside other pages or told to them.
const HEADERS: [(&str, &str); 5] = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Content-Security-Policy", "frame-ancestors 'self'"),
];

fn page(kind: &str, bytes: Vec<u8>) -> Response<io::Cursor<Vec<u8>>> {
    let all = HEADERS.iter().copied().chain([("Content-Type", kind)]);
    let headers = all.filter_map(|(name, value)| Header::from_bytes(name, value).ok());
    headers.fold(Response::from_data(bytes), Response::with_header)
}

fn refused(status: u16) -> Response<io::Cursor<Vec<u8>>> {
    page("text/plain; charset=utf-8", b"umbra watch: refused\n".to_vec()).with_status_code(status)
}

/// A file below the report's folder, with its type; none for what is no file there.
fn file(folder: &Path, path: &Path) -> Option<(&'static str, Vec<u8>)> {
    let kind = match path.extension()?.to_str()? {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "png" => "image/png",
        _ => return None,
    };
    // No link leads out.
    let folder = folder.canonicalize().ok()?;
    let file = folder.join(path).canonicalize().ok()?;
    if !file.starts_with(&folder) || !file.is_file() {
        return None;
    }
    Some((kind, std::fs::read(file).ok()?))
}

/// Tells a browser what is shown, whenever that changes.
fn events(request: Request, board: &Board) -> io::Result<()> {
    let mut out = request.into_writer();
    write!(out, "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nConnection: close\r\n")?;
    for (name, value) in HEADERS {
        write!(out, "{name}: {value}\r\n")?;
    }
    write!(out, "\r\n")?;
    let mut version = 0;
    loop {
        match board.newer(version) {
            Some(shown) => {
                version = shown.version;
                let shown = serde_json::to_string(&shown).map_err(io::Error::other)?;
                write!(out, "data: {shown}\n\n")?;
            }
            None => write!(out, ": still here\n\n")?,
        }
        out.flush()?;
    }
}

#[cfg(test)]
mod tests;
