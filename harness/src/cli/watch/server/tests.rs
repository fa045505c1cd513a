use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use super::*;

#[test]
fn only_the_page_itself_may_ask() {
    let (host, secret) = ("127.0.0.1:4000", "abcdef");
    let ask = |url: &str, asked, origin| Route::of_parts(url, asked, origin, host, secret);
    let own = Some(host);
    assert_eq!(ask("/abcdef/", own, None), Route::Page);
    assert_eq!(ask("/abcdef/frame?path=offline", own, None), Route::Nothing(400));
    let frame = "path=offline&scene=a&shadows=1&spp=4&viewer=1&camera=1,2,3,4,5,6,0,1,0,30";
    let question = FrameQuestion::parse(frame).unwrap();
    assert_eq!(ask(&format!("/abcdef/frame?{frame}"), own, None), Route::Frame(question));
    assert_eq!(ask("/abcdef/events?x", own, Some("http://127.0.0.1:4000")), Route::Events);
    let file = |path: &str| Route::File(path.into());
    assert_eq!(ask("/abcdef/report/report.html", own, None), file("report.html"));
    assert_eq!(ask("/abcdef/report/viewer/a%20b.js", own, None), file("viewer/a b.js"));
    // Another name for this machine, another origin, another secret.
    for (url, asked, origin) in [
        ("/abcdef/", Some("localhost:4000"), None),
        ("/abcdef/", Some("evil.example:4000"), None),
        ("/abcdef/", None, None),
        ("/abcdef/", own, Some("null")),
        ("/abcdef/", own, Some("http://evil.example")),
        ("/abcdef/", own, Some("http://127.0.0.1:4001")),
        ("/abcdeg/", own, None),
        ("/abcde/", own, None),
        ("/abcdef", own, None),
        ("/", own, None),
        ("//abcdef", own, None),
    ] {
        assert_eq!(ask(url, asked, origin), Route::Nothing(403), "{url} {asked:?} {origin:?}");
    }
    for path in [
        "../record.json",
        "a/../../b.html",
        "%2e%2e/b.html",
        "/etc/passwd",
        "//etc/passwd.html",
        ".hidden.html",
        "a\\b.html",
        "a%00.html",
        "%zz.html",
        "c:/b.html",
        "",
    ] {
        let asked = ask(&format!("/abcdef/report/{path}"), own, None);
        assert_eq!(asked, Route::Nothing(404), "{path}");
    }
}

#[test]
fn a_browser_gets_the_report_and_nothing_else() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("slug");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("report.html"), "the report").unwrap();
    std::fs::write(folder.join("last-check.json"), "{}").unwrap();
    std::fs::write(place.path().join("secret.html"), "secret").unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(place.path().join("secret.html"), folder.join("link.html")).unwrap();
    let board = Arc::new(Board::default());
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let assignment = crate::assignment::Assignment::load(&root).unwrap();
    let supervisor = crate::worker::Supervisor::new("none".into(), place.path().to_owned());
    let live = Arc::new(LiveView::new(&assignment, &supervisor, &[]).unwrap());
    let server = Server::start(folder, Arc::clone(&board), live).unwrap();
    let (host, secret) = (server.host.clone(), server.secret.clone());
    let ask = |path: &str, more: &str| {
        let mut stream = TcpStream::connect(&host).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{more}\r\n")
            .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    let report = ask(&format!("/{secret}/report/report.html"), "");
    assert!(report.starts_with("HTTP/1.1 200") && report.ends_with("the report"), "{report}");
    assert!(report.contains("no-store") && report.contains("frame-ancestors 'self'"));
    for (path, more, status) in [
        (format!("/{secret}/report/last-check.json"), "", 404),
        (format!("/{secret}/report/link.html"), "", 404),
        (format!("/{secret}/report/../secret.html"), "", 404),
        (format!("/{secret}/other/report.html"), "", 404),
        (format!("/{secret}/"), "Origin: http://evil.example\r\n", 403),
        ("/0123/report/report.html".to_owned(), "", 403),
    ] {
        let answer = ask(&path, more);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{path}: {answer}");
        assert!(!answer.contains("secret"), "{answer}");
    }

    // What is shown arrives when it changes.
    let mut stream = TcpStream::connect(&host).unwrap();
    write!(stream, "GET /{secret}/events HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    let mut seen = String::new();
    let mut until = |words: &str| {
        while !seen.contains(words) {
            let mut bytes = [0; 512];
            let read = stream.read(&mut bytes).unwrap();
            assert!(read > 0, "{seen}");
            seen.push_str(&String::from_utf8_lossy(&bytes[..read]));
        }
    };
    board.show(CheckState::Running, "compiling\u{1b}[2J");
    until("\"message\":\"compiling\\\\u{1b}[2J\"");
    board.report(CheckState::Lost, "3 of 5 points", "");
    until("\"stage\":\"lost\",\"message\":\"compiling");
    until("\"verdict\":\"3 of 5 points\"");
    until("\"reports\":1");
    until("\"holds\":\"all\"");
    board.saved(true);
    until("\"holds\":\"offline\"");

    let door = server.door().unwrap();
    let text = std::fs::read_to_string(door.path()).unwrap();
    assert!(text.contains(&format!("http://{host}/{secret}/")));
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let mode = |path: &Path| path.metadata().unwrap().mode() & 0o777;
        assert_eq!(mode(&door.path()), 0o600);
        assert_eq!(mode(door.path().parent().unwrap()), 0o700);
    }
}
