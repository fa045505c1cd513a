//! The line on the pages of an attempt that was graded and does not count any more.

use std::io;
use std::path::Path;

use super::markup::Html;
use crate::files::write_whole;

/// How the line begins.
const MARK: &str = "<p class=\"notice superseded\">";
/// What it stands before.
const BEFORE: &str = "</header>\n<main>\n";

/// Says on a page, if it is there, that its attempt does not count; `instead` is the folder of the one that does, with
/// the address of its page where there is a link to it.
///
/// # Errors
/// When it cannot be read or written.
pub fn mark_superseded(page: &Path, instead: Option<(&str, Option<&str>)>) -> io::Result<()> {
    if !page.is_file() {
        return Ok(());
    }
    let text = std::fs::read_to_string(page)?;
    let own = text.split_inclusive('\n').filter(|line| !line.starts_with(MARK));
    let own: String = own.collect();
    let Some(at) = own.find(BEFORE) else { return Ok(()) };
    let mut html = Html::default();
    html.own(MARK).raw("This attempt does not count");
    match instead {
        None => html.raw("."),
        Some((slug, None)) => html.raw(": ").text(slug).raw(" does."),
        Some((slug, Some(address))) => {
            html.raw(": <a href=\"").address(address).raw("\">").text(slug).raw("</a> does.")
        }
    };
    html.raw("</p>\n");
    let marked = format!("{}{}{}", &own[..at], html.finish(), &own[at..]);
    if marked == text { Ok(()) } else { write_whole(page, marked.as_bytes()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_says_once_what_counts_instead() {
        let place = tempfile::tempdir().unwrap();
        let page = place.path().join("report.html");
        mark_superseded(&page, None).unwrap();
        assert!(!page.exists());
        std::fs::write(&page, "<h1>Ann</h1>\n</header>\n<main>\n</main>\n").unwrap();
        let read = || std::fs::read_to_string(&page).unwrap();
        mark_superseded(&page, None).unwrap();
        assert!(read().contains("This attempt does not count.</p>\n</header>"), "{}", read());
        mark_superseded(&page, Some(("a2-<2>", None))).unwrap();
        mark_superseded(&page, Some(("a2-<2>", None))).unwrap();
        assert_eq!(read().matches("superseded").count(), 1);
        assert!(read().contains("count: a2-&lt;2&gt; does.</p>"), "{}", read());
        mark_superseded(&page, Some(("b", Some("../b/report.html")))).unwrap();
        assert!(read().contains("<a href=\"./../b/report.html\">b</a> does."), "{}", read());
    }
}
