//! The page of the viewer: everything that shows images, in one file; the images lie beside it.

use serde::Serialize;

use super::super::harmless;
use super::markup::Html;
use super::{Powers, begin_with};
use crate::viewer::ViewedCase;

const STYLE: &str = include_str!("../viewer/viewer.css");
/// In the order in which they need each other; one script for the browser.
const SCRIPT: &str = concat!(
    include_str!("../viewer/data.js"),
    include_str!("../viewer/color.js"),
    include_str!("../viewer/gl.js"),
    include_str!("../viewer/canvas.js"),
    include_str!("../viewer/state.js"),
    include_str!("../viewer/values.js"),
    include_str!("../viewer/panes.js"),
    include_str!("../viewer/panel.js"),
    include_str!("../viewer/input.js"),
    include_str!("../viewer/viewer.js"),
);
const BODY: &str = include_str!("../viewer/body.html");

/// What the viewer's script reads.
#[derive(Serialize)]
struct Manifest {
    cases: Vec<ViewedCase>,
}

/// A page that shows cases of images, whose files lie below its own folder. `back` is the name of a page beside it
/// that it leads back to.
pub fn viewer(title: &str, back: Option<&str>, cases: &[ViewedCase]) -> String {
    let powers = Powers { style: STYLE, script: SCRIPT, loads_scripts: true };
    let mut html = begin_with(title, &powers);
    if let Some(page) = back {
        html.raw("<nav><a href=\"").address(page).raw("\">Back to the report</a><span>");
        html.text(title).raw("</span></nav>\n");
    }
    html.raw(BODY).raw("<script type=\"application/json\" id=\"manifest\">");
    html.json(&Manifest { cases: cases.iter().map(clean).collect() });
    html.raw("</script>\n<script>").raw(SCRIPT).raw("</script>\n</body>\n</html>\n");
    Html::finish(html)
}

/// The case with nothing in its words that could hide or reorder what is read.
fn clean(case: &ViewedCase) -> ViewedCase {
    let mut case = case.clone();
    for text in case.strings_mut() {
        *text = harmless(text);
    }
    case
}
