//! The page of `umbra watch`: a status line above the report.

use base64::Engine as _;
use sha2::Digest as _;

const STYLE: &str = include_str!("watch.css");
/// Alone in the one script element: the live view first, which the other tells of news.
const SCRIPT: &str = concat!(include_str!("live.js"), include_str!("watch.js"));
const LIVE: &str = include_str!("live.html");

/// The page, which shows `report`, a page of the folder `report`. Nothing that anybody wrote is in it; what goes on
/// reaches it as text, by its script.
pub fn page(report: &'static str) -> String {
    let hash =
        |text: &str| base64::engine::general_purpose::STANDARD.encode(sha2::Sha256::digest(text));
    let (style, script) = (hash(STYLE), hash(SCRIPT));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; base-uri 'none'; \
         form-action 'none'; connect-src 'self'; frame-src 'self'; style-src 'sha256-{style}'; \
         script-src 'sha256-{script}'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>umbra watch</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <h1>umbra watch</h1>\n<p id=\"status\" role=\"status\">Checking</p>\n\
         <noscript><p>This page needs JavaScript. The report alone: \
         <a href=\"report/{report}\">{report}</a></p></noscript>\n\
         {LIVE}<p id=\"mark\" role=\"status\" hidden></p>\n\
         <iframe id=\"report\" title=\"Report\" data-page=\"{report}\"></iframe>\n</main>\n\
         <script>{SCRIPT}</script>\n</body>\n</html>\n"
    )
}
