//! HTML pages: one for the batch, one for each submission. They load nothing, need no script to be
//! read, and forbid the browser to run any but the one that sorts the table.

mod batch;
mod checks;
mod curve;
mod lobe;
mod lost;
mod markup;
mod overview;
mod pictures;
mod similarity;
mod submission;
mod superseded;
#[cfg(test)]
mod tests;
mod viewer;

use base64::Engine as _;
use sha2::Digest as _;

pub use batch::batch;
pub use overview::{is_read_by_class, says_its_mistake};
pub use similarity::{SIMILARITY, SimilarPair, SimilarityPage, write_similarity};
pub use submission::submission;
pub use superseded::mark_superseded;
pub use viewer::viewer;

use self::markup::Html;
use super::BatchReport;
use crate::rubric::{Grade, PartGrade};

const STYLE: &str = include_str!("style.css");
/// Sorts, searches and filters the batch's table; the page is whole without it.
const CLASS: &str = include_str!("class.js");

/// Whom a page is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reader {
    /// Nothing of held-back scenes but whether they are right and how wrong.
    Student,
    /// Everything. The page lies one folder deeper.
    Instructor,
}

/// What a page may do beyond being read. Should an escape ever be forgotten, the browser still runs and loads nothing
/// that is not ours.
struct Powers<'a> {
    /// Its style.
    style: &'a str,
    /// Its script; empty if it has none.
    script: &'a str,
    /// Whether its script may load others.
    loads_scripts: bool,
}

/// Everything up to the page's content.
fn begin(title: &str) -> Html {
    begin_with(title, &Powers { style: STYLE, script: CLASS, loads_scripts: false })
}

fn begin_with(title: &str, powers: &Powers) -> Html {
    let hash =
        |text: &str| base64::engine::general_purpose::STANDARD.encode(sha2::Sha256::digest(text));
    let mut html = Html::default();
    html.raw("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    html.raw("<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; ");
    html.raw("img-src 'self' file:; base-uri 'none'; form-action 'none'; style-src 'sha256-");
    html.text(&hash(powers.style)).raw("'; script-src 'sha256-").text(&hash(powers.script));
    html.raw(if powers.loads_scripts { "' 'strict-dynamic'\">\n" } else { "'\">\n" });
    html.raw("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n");
    html.raw("<meta name=\"referrer\" content=\"no-referrer\">\n");
    html.raw("<title>").text(title).raw("</title>\n<style>").own(powers.style);
    html.raw("</style>\n</head>\n<body>\n");
    html
}

/// Everything after the page's content.
fn end(mut html: Html, report: &BatchReport) -> String {
    html.raw("<footer>").text(&report.course).raw(" · ").text(&report.title).raw(" · due ");
    html.raw("<time>")
        .text(&super::number::due(&report.due))
        .raw("</time></footer>\n</body>\n</html>\n");
    html.finish()
}

/// The class of points that lie in `[least, most]` of `out_of`: how a cell is colored.
fn class(least: f64, most: f64, out_of: f64) -> &'static str {
    if super::number::is_range(least, most) {
        "open"
    } else if least >= out_of {
        "full"
    } else if least > 0.0 {
        "some"
    } else {
        "zero"
    }
}

/// [`class`] of a whole grade: what is lost in a part is lost, also where a bonus makes up for it.
fn total_class(grade: &Grade) -> &'static str {
    match class(grade.points, grade.points_max, grade.out_of) {
        "full" if grade.parts.iter().any(PartGrade::is_lost) => "some",
        class => class,
    }
}

/// [`class`] of a part; a bonus that was not earned is nothing lost.
fn part_class(part: &PartGrade) -> &'static str {
    if part.is_unearned() { "unearned" } else { class(part.points, part.points_max, part.out_of) }
}
