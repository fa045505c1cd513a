//! Pictures on pages, each with its size, and the way to the viewer.

use super::markup::Html;
use crate::diagnosis::Diagnosis;
use crate::evidence::{Check, Picture};
use crate::report::VIEW_FILE;
use crate::viewer::ViewedCase;

/// Narrower pictures than this, in pixels, are shown enlarged.
const SMALL: usize = 300;

/// Where the files of pictures lie, as seen from the page.
#[derive(Clone, Copy)]
pub(super) struct Places<'a> {
    /// The folder of public pictures: empty, or ending with a slash.
    pub public: &'a str,
    /// What the viewer shows.
    pub views: &'a [ViewedCase],
}

impl Places<'_> {
    /// The pictures of a check, and a link to the viewer where it shows them.
    pub(super) fn of_check(&self, html: &mut Html, check: &Check) {
        let folder = if check.held_back { "" } else { self.public };
        let name = check.name();
        if !check.pictures.is_empty() && !check.scene.is_empty() {
            html.raw("<p class=\"of\">On the scene <b>").text(&check.scene).raw("</b>, by <code>");
            html.text(check.id.name()).raw("</code></p>\n");
        }
        self.show(html, &name, &name, folder, &check.pictures);
    }

    /// Pictures of a diagnosis, likewise.
    pub(super) fn of_diagnosis(&self, html: &mut Html, found: &Diagnosis) {
        let view = Diagnosis::view_of(&found.part);
        self.show(html, "looks like", &view, self.public, &found.pictures);
    }

    fn show(&self, html: &mut Html, name: &str, view: &str, folder: &str, pictures: &[Picture]) {
        let is_viewed = self.views.iter().any(|own| own.id == view);
        let target = is_viewed.then(|| (format!("{folder}{VIEW_FILE}"), fragment(view)));
        let files = |picture: &Picture| format!("{folder}{}", picture.file);
        figures(html, name, pictures, &files, target.as_ref());
        if let Some((page, fragment)) = &target {
            html.raw("<p class=\"open\"><a href=\"").address(page).raw("#").text(fragment);
            html.raw("\">Open in the viewer</a>: exposure, wipe, pixel values, where each rule counts</p>\n");
        }
    }
}

/// The part of the viewer's address that names a case.
fn fragment(case: &str) -> String {
    let mut fragment = "case=".to_owned();
    for byte in case.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.".contains(&byte) {
            fragment.push(char::from(byte));
        } else {
            fragment.push_str(&format!("%{byte:02X}"));
        }
    }
    fragment
}

/// Pictures side by side; each leads to the viewer, or to itself.
fn figures(
    html: &mut Html,
    name: &str,
    pictures: &[Picture],
    file_of: &dyn Fn(&Picture) -> String,
    view: Option<&(String, String)>,
) {
    if pictures.is_empty() {
        return;
    }
    html.raw("<div class=\"pictures\">\n");
    for picture in pictures {
        let file = file_of(picture);
        html.raw("<figure><a href=\"");
        match view {
            Some((page, fragment)) => html.address(page).raw("#").text(fragment),
            None => html.address(&file),
        };
        // A small film is enlarged: its pixels stay pixels.
        let small = (1..SMALL).contains(&picture.width);
        html.raw(if small { "\"><img class=\"small\"" } else { "\"><img" });
        html.raw(" loading=\"lazy\" src=\"").address(&file);
        if picture.width > 0 {
            html.raw("\" width=\"").show(picture.width).raw("\" height=\"").show(picture.height);
        }
        html.raw("\" alt=\"").text(name).raw(": ").text(&picture.title);
        html.raw("\"></a><figcaption>").text(&picture.title).raw("</figcaption></figure>\n");
    }
    html.raw("</div>\n");
}
